import math
from dataclasses import replace

import jaxtyping
import pytest
import torch

from pnpct.geometry import ConeBeam, Detector, FanBeam, Trajectory
from pnpct.physics import BeamHardening, Moments, Scan, scan_from_moments, simulate_counts


@pytest.fixture
def scan(geometry):
    return Scan(torch.full(geometry.shape, 500.0), torch.tensor(1000.0), 3.0, geometry, mu_water=0.0193)


@pytest.fixture
def moments(geometry):
    """Rays of 70 keV behind an object that hardens them to 80 keV, and some that nothing reaches."""
    photons = torch.linspace(0.0, 500.0, geometry.bins).expand(geometry.shape).contiguous()
    return Moments(
        photons * 80.0, photons * 80.0**2, torch.tensor(2000.0 * 70.0), torch.tensor(2000.0 * 70.0**2), 200.0
    )


@pytest.mark.parametrize("electronic_noise", [0.0, 6.0])
def test_counts_have_the_mean_and_variance_of_poisson_plus_normal(generator, electronic_noise):
    line_integrals = torch.tensor([0.0, 2.0, 5.0])[:, None, None].expand(3, 200, 500)
    counts = simulate_counts(
        line_integrals, torch.tensor(3000.0), electronic_noise=electronic_noise, generator=generator
    )
    expected = 3000.0 * torch.exp(-line_integrals[:, 0, 0])
    variance = expected + electronic_noise**2
    standard_error = (variance / 100_000).sqrt()
    assert ((counts.mean((1, 2)) - expected).abs() < 4 * standard_error).all()
    # The fourth moment adds 1/expected to the relative error of a Poisson variance.
    torch.testing.assert_close(counts.var((1, 2)), variance, rtol=4 * math.sqrt((2 + 0.05) / 100_000), atol=0)


def test_counts_without_electronic_noise_are_whole_numbers(generator):
    counts = simulate_counts(torch.ones(20, 20), torch.tensor(50.0), generator=generator)
    assert torch.equal(counts, counts.round())
    assert counts.min() >= 0


def test_one_seed_gives_one_scan(geometry, moments):
    first, again = (
        scan_from_moments(moments, geometry, mu_water=0.0193, generator=torch.Generator().manual_seed(5)).counts
        for _ in range(2)
    )
    assert torch.equal(first, again)


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ({"line_integrals": torch.full((2, 2), math.nan)}, "finite line integrals"),
        ({"incident": torch.tensor(0.0)}, "incident must be positive"),
        ({"electronic_noise": -1.0}, "electronic_noise must be finite and not negative, got -1.0"),
        ({"electronic_noise": 1e300}, r"electronic_noise must be .* at most 1e\+18"),
    ],
)
def test_impossible_simulations_are_refused(generator, arguments, sentence):
    possible = {"line_integrals": torch.ones(2, 2), "incident": torch.tensor(10.0), "electronic_noise": 0.0}
    with pytest.raises(ValueError, match=sentence):
        simulate_counts(**(possible | arguments), generator=generator)


@pytest.mark.parametrize("shape", [(), (48,), (60, 1), (60, 48)])
def test_incident_may_vary_by_bin_by_view_or_by_ray(scan, shape):
    assert replace(scan, incident=torch.full(shape, 1000.0)).incident.shape == shape


def test_a_batch_of_slices_is_one_scan(scan, geometry):
    assert replace(scan, counts=torch.ones(2, 3, *geometry.shape)).counts.shape == (2, 3, *geometry.shape)


def test_electronic_noise_may_take_counts_below_zero(scan):
    counts = scan.counts.clone()
    counts[0, 0] = -7.9 * 3.0
    assert replace(scan, counts=counts).counts.min() < 0


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"counts": torch.ones(60, 47)}, r"\(60, 48\), got \(60, 47\)"),
        ({"counts": torch.full((60, 48), math.nan)}, "2880 of 2880 are NaN"),
        ({"counts": torch.full((60, 48), math.inf)}, "2880 of 2880 are NaN or infinite"),
        ({"counts": torch.zeros(60, 48)}, "No ray detected anything"),
        ({"counts": torch.ones(60, 48).index_fill(0, torch.tensor(3), -25.0)}, "lowest count is -25 quanta"),
        ({"incident": torch.ones(47)}, r"broadcast to \(views, bins\) = \(60, 48\), got \(47,\)"),
        ({"incident": torch.ones(2, 60, 48)}, "incident must broadcast"),
        (
            {"incident": torch.linspace(-1, 1, 48)},
            "incident must be positive and finite, or 0 where .* from -1 to 1",
        ),
        ({"incident": torch.tensor(math.inf)}, "incident must be positive and finite"),
        ({"electronic_noise": -3.0}, "electronic_noise must be finite and not negative, got -3.0"),
        ({"electronic_noise": math.nan}, "electronic_noise must be finite"),
        ({"mu_water": 0.0}, "positive attenuation in 1/mm, got 0.0"),
        ({"beam_hardening": BeamHardening(torch.tensor([[1.0, 0.0]] * 47))}, "for 47 bins, the scan has 48"),
    ],
)
def test_scans_that_do_not_fit_together_are_refused(scan, changes, sentence):
    with pytest.raises(ValueError, match=sentence):
        replace(scan, **changes)


@pytest.fixture
def no_type_checks():
    """As users run it: what the annotations promise is checked in the tests only."""
    jaxtyping.config.update("jaxtyping_disable", True)
    yield
    jaxtyping.config.update("jaxtyping_disable", False)


@pytest.mark.usefixtures("no_type_checks")
def test_arrays_of_the_wrong_kind_are_refused_in_words(scan, moments):
    with pytest.raises(ValueError, match=r"floating-point arrays, got torch.int32 and torch.float32"):
        replace(scan, counts=scan.counts.int())
    with pytest.raises(ValueError, match=r"one shape, got \(60, 48\) and \(60, 47\)"):
        replace(moments, signal_variance=torch.ones(60, 47))


def test_negative_counts_without_electronic_noise_are_refused(scan):
    counts = scan.counts.clone()
    counts[5, 5] = -1.0
    with pytest.raises(ValueError, match="lowest count is -1 quanta, too far below 0 for an electronic noise of 0"):
        replace(scan, counts=counts, electronic_noise=0.0)


def test_in_air_the_variance_of_a_moments_scan_is_its_mean(geometry: FanBeam, generator):
    air = torch.linspace(50.0, 90.0, geometry.bins)  # the mean energy differs from bin to bin
    photons = torch.full(geometry.shape, 400.0)
    moments = Moments(photons * air, photons * air**2, 400.0 * air, 400.0 * air**2)
    scan = scan_from_moments(moments, geometry, mu_water=0.0193, dose_fraction=0.5, generator=generator)
    torch.testing.assert_close(scan.incident, torch.full((geometry.bins,), 200.0))
    z_scores = (scan.counts - scan.incident) / scan.incident.sqrt()
    assert abs(z_scores.mean()) < 4 / math.sqrt(z_scores.numel())
    assert z_scores.var().item() == pytest.approx(1.0, abs=4 * math.sqrt(2 / z_scores.numel()))


def test_behind_an_object_the_noise_has_the_moments_of_the_signal(geometry, moments, generator):
    repeated = replace(
        moments,
        signal_mean=moments.signal_mean.expand(20, *geometry.shape),
        signal_variance=moments.signal_variance.expand(20, *geometry.shape),
    )
    scan = scan_from_moments(repeated, geometry, mu_water=0.0193, dose_fraction=0.1, generator=generator)
    photons = 0.1 * torch.linspace(0.0, 500.0, geometry.bins)
    counts = scan.counts.reshape(-1, geometry.bins)
    variance = photons * (80 / 70) ** 2 + (200 / 70) ** 2
    standard_error = (variance / len(counts)).sqrt()
    assert ((counts.mean(0) - photons * 80 / 70).abs() < 4.5 * standard_error).all()
    torch.testing.assert_close(counts.var(0), variance, rtol=0.15, atol=0)
    assert scan.electronic_noise == pytest.approx(200 / 70)


def test_without_a_generator_the_counts_are_their_means(geometry, moments):
    scan = scan_from_moments(moments, geometry, mu_water=0.0193, dose_fraction=0.25, generator=None)
    transmission = moments.signal_mean / moments.air_mean
    torch.testing.assert_close(scan.counts / scan.incident, transmission)
    assert scan.incident.item() == pytest.approx(500.0)


@pytest.mark.parametrize("dose_fraction", [0.0, -1.0, math.inf])
def test_a_dose_that_is_not_positive_is_refused(geometry, moments, dose_fraction):
    with pytest.raises(ValueError, match="dose_fraction must be positive and finite"):
        scan_from_moments(moments, geometry, mu_water=0.0193, dose_fraction=dose_fraction, generator=None)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"signal_mean": torch.full((60, 48), -1.0)}, "signal_mean must be finite and not negative"),
        ({"signal_variance": torch.full((60, 48), math.nan)}, "signal_variance must be finite"),
        ({"signal_variance": torch.zeros(60, 48)}, "both a mean and a variance"),
        ({"air_mean": torch.zeros(())}, "air_mean must be positive"),
        ({"air_variance": torch.ones(47)}, r"air_variance must broadcast to \(60, 48\), got \(47,\)"),
        ({"electronic_noise": -1.0}, "electronic_noise must be finite and not negative"),
    ],
)
def test_impossible_moments_are_refused(moments, changes, sentence):
    with pytest.raises(ValueError, match=sentence):
        replace(moments, **changes)


CONE = ConeBeam(
    Trajectory([0.1 * view for view in range(6)], z=[0.5 * view for view in range(6)]),
    Detector(4, 2.0, rows=3, row_height=1.0),
    source_to_isocenter=541.0,
    source_to_detector=949.0,
)


@pytest.mark.parametrize("per", ["number", "bin", "view", "ray"])
@pytest.mark.parametrize("rows", [False, True])
def test_a_subset_of_the_views_has_their_counts_and_incident_quanta(geometry, generator, rows, per):
    geometry = CONE if rows else geometry[:6]
    ones = (1,) * (len(geometry.shape) - 1)
    shape = {"number": (), "bin": (geometry.bins,), "view": (6, *ones), "ray": geometry.shape}[per]
    incident = 900.0 + torch.rand(shape, generator=generator)
    counts = 500.0 * torch.rand(2, *geometry.shape, generator=generator)
    part = Scan(counts, incident, 3.0, geometry, mu_water=0.0193)[[4, 1, 1]]
    assert part.geometry == geometry[[4, 1, 1]]
    assert torch.equal(part.counts, counts[:, [4, 1, 1]])
    assert torch.equal(part.incident.expand(part.geometry.shape), incident.expand(geometry.shape)[[4, 1, 1]])


def test_counts_of_detector_rows_fit_a_cone_beam_only(geometry):
    with pytest.raises(ValueError, match=r"end in \(views, rows, bins\) = \(6, 3, 4\), got \(6, 4\)"):
        Scan(torch.ones(6, 4), torch.tensor(1.0), 0.0, CONE, mu_water=0.0193)
    with pytest.raises(
        ValueError, match=r"incident must broadcast to \(views, rows, bins\) = \(6, 3, 4\), got \(6, 1\)"
    ):
        Scan(torch.ones(6, 3, 4), torch.ones(6, 1), 0.0, CONE, mu_water=0.0193)
    with pytest.raises(ValueError, match="for 5 bins, the scan has 4"):
        Scan(torch.ones(6, 3, 4), torch.tensor(1.0), 0.0, CONE, 0.0193, BeamHardening(torch.ones(5, 2)))
