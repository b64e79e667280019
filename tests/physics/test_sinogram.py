import math
from dataclasses import replace

import pytest
import torch

from pnpct.geometry import ConeBeam, Detector, FanBeam, Trajectory, evenly_spaced_views
from pnpct.physics import BeamHardening, DiagonalWeights, Scan, Sinogram, simulate_counts, take_log

INCIDENT = torch.tensor(30_000.0)


def flat_scan(geometry, counts, electronic_noise, generator, slices=20):
    """Many rays that all expect the same count."""
    line_integrals = (INCIDENT / counts).log().expand(slices, *geometry.shape)
    drawn = simulate_counts(line_integrals, INCIDENT, electronic_noise=electronic_noise, generator=generator)
    return Scan(drawn, INCIDENT, electronic_noise, geometry, mu_water=0.0193)


@pytest.fixture
def body_scan(geometry, generator):
    """An ellipse of water."""
    bins, views = torch.arange(geometry.bins) - 24.0, torch.arange(geometry.views)[:, None]
    radius = 15.0 + 3.0 * torch.cos(views * (4 * math.pi / geometry.views))
    line_integrals = 4.0 * (1 - (bins / radius) ** 2).clamp_min(0.0).sqrt()
    counts = simulate_counts(line_integrals, INCIDENT, electronic_noise=3.0, generator=generator)
    return Scan(counts, INCIDENT, 3.0, geometry, mu_water=0.0193)


@pytest.fixture
def hardening(geometry):
    spread = torch.linspace(0.9, 1.1, geometry.bins)
    return BeamHardening(torch.stack([0.02 * spread, spread, torch.zeros_like(spread)], dim=-1))


def test_the_log_of_many_counts_is_the_line_integral(body_scan):
    sinogram = take_log(body_scan)
    torch.testing.assert_close(sinogram.line_integrals, -(body_scan.counts / INCIDENT).log(), rtol=1e-5, atol=1e-5)


def test_incident_may_vary_by_view_and_bin(body_scan, geometry):
    gain = torch.linspace(0.5, 2.0, geometry.bins) * torch.linspace(1.0, 3.0, geometry.views)[:, None]
    uneven = replace(body_scan, counts=body_scan.counts * gain, incident=INCIDENT * gain, electronic_noise=0.0)
    even = replace(body_scan, electronic_noise=0.0)
    torch.testing.assert_close(take_log(uneven).line_integrals, take_log(even).line_integrals, rtol=1e-5, atol=1e-5)
    # Where there are more quanta, their noise tells more.
    torch.testing.assert_close(
        take_log(uneven).weights.diagonal, take_log(even).weights.diagonal * gain, rtol=0.01, atol=0
    )


def test_starved_rays_are_less_biased_than_clipped_ones(geometry, generator):
    for counts in (5.0, 10.0, 20.0):
        scan = flat_scan(geometry, counts, 3.0, generator)
        clipped = -(scan.counts.clamp_min(1.0) / INCIDENT).log()
        truth = math.log(INCIDENT / counts)
        bias = float(take_log(scan).line_integrals.mean()) - truth
        assert abs(bias) < 0.5 * abs(float(clipped.mean()) - truth)
        assert abs(bias) < 0.1


@pytest.mark.parametrize("electronic_noise", [0.0, 6.0, 20.0])
@pytest.mark.parametrize("counts", [50.0, 200.0, 2000.0])
def test_weights_are_one_over_the_variance(geometry, generator, counts, electronic_noise):
    if counts**2 / (counts + electronic_noise**2) < 10:
        counts *= 2  # fewer noise-equivalent counts than 10 are too few for the formula
    sinogram = take_log(flat_scan(geometry, counts, electronic_noise, generator))
    variance = float(sinogram.line_integrals.var())
    assert float(sinogram.weights.diagonal.mean()) * variance == pytest.approx(1.0, abs=0.05)


def test_weights_come_from_smoothed_counts(geometry, generator):
    scan = flat_scan(geometry, 100.0, 0.0, generator)
    own, smoothed = (take_log(scan, smoothing=smoothing).weights.diagonal for smoothing in (0.0, 1.5))
    torch.testing.assert_close(own, scan.counts)
    assert float(smoothed.std()) < 0.3 * float(own.std())
    line_integrals = take_log(scan).line_integrals
    truth = math.log(INCIDENT / 100.0)
    bias = [float((w * line_integrals).sum() / w.sum()) - truth for w in (own, smoothed)]
    assert bias[0] < -0.004  # each dark fluctuation takes its own weight away: -1/(2 · 100)
    assert abs(bias[1] - 0.005) < 0.002  # the bias of the logarithm alone: +1/(2 · 100)


@pytest.mark.parametrize("counts", [1.5, 3.0])
def test_weights_of_starved_rays_share_little_of_their_noise(geometry, generator, counts):
    sinogram = take_log(flat_scan(geometry, counts, 3.0, generator))
    y, w = sinogram.line_integrals, sinogram.weights.diagonal
    assert abs(float((w * y).sum() / w.sum() - y.mean())) < 0.05
    assert float(w.std() / w.mean()) < 0.5


def test_a_narrow_shadow_keeps_the_weights_of_its_few_quanta(geometry, generator):
    line_integrals = torch.full(geometry.shape, 4.0)
    line_integrals[:, 20:24] = 9.0
    counts = simulate_counts(line_integrals, INCIDENT, electronic_noise=3.0, generator=generator)
    weights = take_log(Scan(counts, INCIDENT, 3.0, geometry, mu_water=0.0193)).weights.diagonal
    beside = 30_000 * math.exp(-4.0)
    assert float(weights[:, 21:23].mean()) < 0.35 * beside
    assert float(weights[:, 30:].mean()) == pytest.approx(beside, rel=0.05)


@pytest.mark.parametrize("smoothing", [0.0, 1.5])
@pytest.mark.parametrize("low_counts", [0.0, 20.0])
@pytest.mark.parametrize("electronic_noise", [0.0, 5.0])
def test_rays_behind_lead_stay_finite(geometry, generator, smoothing, low_counts, electronic_noise):
    line_integrals = torch.zeros(geometry.shape)
    line_integrals[:, 10:30] = 80.0
    counts = simulate_counts(line_integrals, INCIDENT, electronic_noise=electronic_noise, generator=generator)
    scan = Scan(counts, INCIDENT, electronic_noise, geometry, mu_water=0.0193)
    sinogram = take_log(scan, smoothing=smoothing, low_counts=low_counts)
    dark = sinogram.line_integrals[:, 16:24]
    floor = max(1.0, electronic_noise)
    assert float(dark.mean()) == pytest.approx(math.log(INCIDENT / floor) + 1, abs=0.2)
    assert sinogram.weights.diagonal[:, 16:24].max() < 20.0
    assert sinogram.weights.diagonal[:, :4].min() > 29_000.0


def test_line_integrals_change_without_a_jump_from_few_counts_to_many(geometry):
    expected = torch.linspace(1.0, 100.0, 400)[:, None, None].expand(400, *geometry.shape)
    scan = Scan(expected, INCIDENT, 4.0, geometry, mu_water=0.0193)
    ray = take_log(scan).line_integrals[:, 30, 20]
    assert (ray.diff() < 0).all()
    torch.testing.assert_close(
        ray[expected[:, 0, 0] >= 4.0], (INCIDENT / expected[:, 0, 0]).log()[expected[:, 0, 0] >= 4.0]
    )


def test_beam_hardening_corrects_line_integrals_and_weights(body_scan, hardening):
    plain = take_log(body_scan)
    corrected = take_log(replace(body_scan, beam_hardening=hardening))
    torch.testing.assert_close(corrected.line_integrals, hardening.correct(plain.line_integrals))
    slope = (plain.weights.diagonal / corrected.weights.diagonal).sqrt()
    equivalent = plain.weights.diagonal
    smoothed = (equivalent + (equivalent**2 + 4 * equivalent * 3.0**2).sqrt()) / 2  # from l²/(l + s²)
    torch.testing.assert_close(slope, hardening.slope((INCIDENT / smoothed).log()), rtol=1e-3, atol=0)


def test_weights_of_hardened_rays_are_one_over_their_variance(geometry, generator, hardening):
    scan = replace(flat_scan(geometry, 60.0, 3.0, generator), beam_hardening=hardening)
    sinogram = take_log(scan)
    variance = sinogram.line_integrals.var(dim=(0, 1))
    product = sinogram.weights.diagonal.mean(dim=(0, 1)) * variance
    assert float(product.mean()) == pytest.approx(1.0, abs=0.05)


def test_uniform_weights_are_the_mean_of_the_statistical_ones_and_leave_the_log_alone(body_scan):
    uniform, statistical = take_log(body_scan, weight="uniform"), take_log(body_scan)
    expected = statistical.weights.diagonal.mean().expand_as(body_scan.counts)
    torch.testing.assert_close(uniform.weights.diagonal, expected)
    assert torch.equal(uniform.line_integrals, statistical.line_integrals)


def test_a_batch_is_its_slices(geometry, generator, hardening):
    scan = replace(flat_scan(geometry, 30.0, 3.0, generator, slices=3), beam_hardening=hardening)
    batch = take_log(scan)
    for number in range(3):
        alone = take_log(replace(scan, counts=scan.counts[number]))
        torch.testing.assert_close(batch.line_integrals[number], alone.line_integrals, rtol=1e-5, atol=1e-5)
        torch.testing.assert_close(batch.weights.diagonal[number], alone.weights.diagonal, rtol=1e-5, atol=1e-5)


def test_the_order_of_the_views_does_not_matter(body_scan, geometry):
    order = torch.randperm(geometry.views, generator=torch.Generator().manual_seed(1))
    angles = [geometry.view_angles[view] for view in order]
    shuffled = replace(body_scan, counts=body_scan.counts[order], geometry=replace(geometry, view_angles=angles))
    torch.testing.assert_close(take_log(shuffled).weights.diagonal, take_log(body_scan).weights.diagonal[order])


def test_the_first_and_the_last_view_of_a_turn_are_neighbours(geometry):
    counts = torch.full(geometry.shape, 100.0)
    counts[0] = 1000.0
    weights = take_log(Scan(counts, INCIDENT, 0.0, geometry, mu_water=0.0193)).weights.diagonal[:, 20]
    assert float(weights[-1]) > 200.0
    torch.testing.assert_close(weights[1:], weights[1:].flip(0))


def test_means_over_neighbours_are_the_same_wherever_their_blocks_end(generator):
    geometry = FanBeam(
        evenly_spaced_views(150), bins=250, source_to_isocenter=541.0, source_to_detector=949.0, bin_width=1.0
    )
    scan = flat_scan(geometry, 20.0, 3.0, generator, slices=1)
    moved = replace(scan, counts=scan.counts.flip(-1).roll(37, -2))
    expected = take_log(scan).weights.diagonal.flip(-1).roll(37, -2)
    torch.testing.assert_close(take_log(moved).weights.diagonal, expected, rtol=1e-4, atol=1e-4)


def test_a_gap_in_the_views_changes_nothing_far_from_it(geometry, generator):
    whole = replace(geometry, view_angles=evenly_spaced_views(240))
    scan = flat_scan(whole, 100.0, 0.0, generator, slices=1)
    kept = [view for view in range(240) if not 100 <= view < 160]
    angles = [whole.view_angles[view] for view in kept]
    gapped = replace(scan, counts=scan.counts[:, kept], geometry=replace(whole, view_angles=angles))
    torch.testing.assert_close(
        take_log(gapped).weights.diagonal[:, :70], take_log(scan).weights.diagonal[:, :70], rtol=1e-5, atol=0
    )


def test_views_far_apart_are_not_smoothed_into_each_other(geometry):
    few = FanBeam(evenly_spaced_views(6), 48, 541.0, 949.0, 12.0)
    counts = torch.tensor([100.0, 1000.0] * 3)[:, None].expand(few.shape).contiguous()
    weights = take_log(Scan(counts, INCIDENT, 0.0, few, mu_water=0.0193)).weights.diagonal
    torch.testing.assert_close(weights, counts, rtol=1e-3, atol=0)


def test_a_single_view_is_smoothed_along_its_bins_only(geometry, generator):
    one = replace(geometry, view_angles=[0.3])
    sinogram = take_log(flat_scan(one, 200.0, 0.0, generator))
    assert 0.2 < float(sinogram.weights.diagonal.std()) / math.sqrt(200.0) < 0.6


def test_double_precision_stays_double(body_scan):
    double = take_log(replace(body_scan, counts=body_scan.counts.double()))
    assert double.line_integrals.dtype == double.weights.diagonal.dtype == torch.float64
    torch.testing.assert_close(double.line_integrals.float(), take_log(body_scan).line_integrals, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"smoothing": -1.0}, "smoothing must be finite and not negative, got -1.0"),
        ({"low_counts": math.nan}, "low_counts must be finite and not negative, got nan"),
    ],
)
def test_impossible_options_are_refused(body_scan, options, sentence):
    with pytest.raises(ValueError, match=sentence):
        take_log(body_scan, **options)


def test_sinograms_that_do_not_fit_their_weights_are_refused():
    weights = DiagonalWeights(torch.ones(2, 3))
    with pytest.raises(ValueError, match=r"\(2, 3\), the line integrals have \(2, 4\)"):
        Sinogram(torch.ones(2, 4), weights)
    with pytest.raises(ValueError, match="1 of 6 are NaN"):
        Sinogram(torch.tensor([[0.0, 1.0, math.inf], [0.0, 1.0, 2.0]]), weights)


CONE = ConeBeam(Trajectory((0.0, 0.1), z=(0.0, 5.0)), Detector(4, 2.0, rows=3, row_height=1.0), 541.0, 949.0)


@pytest.fixture
def cone_scan(generator) -> Scan:
    counts = 1000.0 * (1 + torch.rand(5, *CONE.shape, generator=generator))
    return Scan(counts, torch.tensor(3000.0), 0.0, CONE, mu_water=0.0193)


def test_a_cone_beam_is_smoothed_over_rows_and_bins_of_each_view_alone(cone_scan):
    whole = take_log(cone_scan)
    torch.testing.assert_close(whole.line_integrals, -(cone_scan.counts / 3000.0).log())
    assert float(whole.weights.diagonal.std()) < 0.5 * float(cone_scan.counts.std())
    for view in range(2):
        one = take_log(cone_scan[[view]])
        torch.testing.assert_close(one.weights.diagonal, whole.weights.diagonal[:, [view]])
    turned = Scan(
        cone_scan.counts.mT.contiguous(),
        cone_scan.incident,
        0.0,
        replace(CONE, detector=Detector(3, 2.0, rows=4, row_height=1.0)),
        mu_water=0.0193,
    )
    torch.testing.assert_close(take_log(turned).weights.diagonal, whole.weights.diagonal.mT)


def test_rays_of_a_cone_beam_take_the_logarithm_unsmoothed(cone_scan):
    cone, scan = CONE, cone_scan
    sinogram = take_log(scan, smoothing=0.0)
    assert sinogram.weights.range_shape == cone.shape
    torch.testing.assert_close(sinogram.line_integrals, -(scan.counts / 3000.0).log())
    torch.testing.assert_close(sinogram.weights(torch.ones(5, *cone.shape)), scan.counts)
    with pytest.raises(ValueError, match=r"for rays of the shape \(2, 3, 4\), the line integrals have \(2, 1, 4\)"):
        Sinogram(torch.ones(2, 1, 4), sinogram.weights)
