import json
from pathlib import Path

import numpy as np
import pytest
import torch

from pnpct.geometry import FanBeam, ImageGrid, evenly_spaced_views
from pnpct.operators import Projector
from pnpct.physics import Moments, scan_from_moments
from pnpct.simulation import (
    Beam,
    Phantom,
    Sampling,
    bowtie_thickness,
    chest_body,
    clinical_fan_beam,
    effective_mu_water,
    expose,
    moments_behind,
    relative_attenuation,
    scanner_beam,
    simulate_moments,
)

RADIUS = 100.0


@pytest.fixture(scope="module")
def fan() -> FanBeam:
    return clinical_fan_beam(views=40, bins=60)


@pytest.fixture(scope="module")
def water() -> Phantom:
    """A disc of water."""
    grid = ImageGrid(420, 420, spacing=0.5)
    distance = np.hypot(grid.x[None, :], grid.y[:, None])
    inside = torch.from_numpy(np.clip(0.5 + (RADIUS - distance) / grid.spacing, 0, 1)).float()
    return Phantom(("air", "water"), torch.stack([1 - inside, inside]), grid)


def moments_of(phantom: Phantom, fan: FanBeam, beam: Beam, **options: object) -> Moments:
    (moments,) = simulate_moments(phantom, fan, [beam], **options)
    return moments


def chords(fan: FanBeam) -> torch.Tensor:
    """Mean path of each cell's rays through the disc, mm."""
    edges = np.linspace(fan.fan_angle_edges[:-1], fan.fan_angle_edges[1:], 201)
    offsets = fan.source_to_isocenter * np.sin((edges[:-1] + edges[1:]) / 2)
    return torch.from_numpy((2 * np.sqrt(np.maximum(RADIUS**2 - offsets**2, 0))).mean(0))


def test_transmission_through_water_is_the_integral_over_the_spectrum(water: Phantom, fan: FanBeam) -> None:
    beam = scanner_beam(fan)
    moments = moments_of(water, fan, beam)
    energies = torch.from_numpy(beam.energies)
    mu = relative_attenuation(("water",), beam.energies)[0]
    passed = beam.photons * torch.exp(-mu * chords(fan)[:, None])
    middle = chords(fan) > 80
    for power, measured in ((1, moments.signal_mean), (2, moments.signal_variance)):
        expected = (passed * energies**power).sum(1)
        torch.testing.assert_close(
            measured.double().mean(0)[middle], expected[middle], rtol=2e-3, atol=0, msg=f"moment {power}"
        )
    blocked = chords(fan) == 0
    torch.testing.assert_close(moments.signal_mean[:, blocked], moments.air_mean[blocked].expand(40, -1))


@pytest.mark.parametrize("tube_voltage_kvp", [80.0, 100.0, 120.0])
def test_after_the_correction_water_has_its_path_at_the_effective_energy(
    water: Phantom, fan: FanBeam, tube_voltage_kvp: float
) -> None:
    beam = scanner_beam(fan, tube_voltage_kvp=tube_voltage_kvp)
    scan = expose(water, fan, beam).scan(tube_current_ma=100.0, generator=None)
    measured = -torch.log(scan.counts / scan.incident).mean(0, keepdim=True)
    assert scan.beam_hardening is not None
    corrected = scan.beam_hardening.correct(measured)[0] / scan.mu_water
    middle = chords(fan) > 80
    torch.testing.assert_close(corrected[middle].double(), chords(fan)[middle], rtol=3e-3, atol=0)
    assert scan.mu_water == effective_mu_water(beam)


def test_effective_energies_grow_with_the_voltage() -> None:
    fan = clinical_fan_beam(views=1, bins=9)
    energies = [scanner_beam(fan, tube_voltage_kvp=voltage).effective_energy for voltage in (80.0, 100.0, 120.0)]
    assert energies == pytest.approx([56, 64, 71.5], abs=1)


def test_the_middle_of_the_clinical_fan_gets_34800_quanta_at_40_ma(water: Phantom) -> None:
    fan = clinical_fan_beam()
    assert fan.shape == (984, 900)
    beam = scanner_beam(fan)
    mean, variance = (beam.photons @ torch.from_numpy(beam.energies**power) for power in (1, 2))
    quanta = mean**2 / variance * 40 / 984
    assert quanta[450].item() == pytest.approx(34800, rel=5e-3)
    # The bow-tie leaves a tenth of it at the edge.
    assert 0.06 < (quanta[0] / quanta[450]).item() < 0.12
    assert bowtie_thickness(np.array([0.0])) < 3 < bowtie_thickness(np.array([0.4]))
    assert not bowtie_thickness(np.array([0.0, 0.4]), "none").any()


def test_counts_vary_as_their_moments_say(water: Phantom) -> None:
    fan = clinical_fan_beam(views=1000, bins=30)
    moments = moments_of(water, fan, scanner_beam(fan))
    dose = 2e-4  # mAs per view: a few hundred quanta behind the middle of the disc
    generator = torch.Generator().manual_seed(1)
    scan = scan_from_moments(moments, fan, mu_water=0.02, dose_fraction=dose, generator=generator)
    signal = scan.counts * moments.quantum
    mean = dose * moments.signal_mean
    variance = dose * moments.signal_variance + moments.electronic_noise**2
    deviation = (signal - mean) / variance.sqrt()
    # 1000 views a bin: the mean is good to 0.03, the variance to 0.045.
    assert deviation.mean(0).abs().max() < 0.13
    assert (deviation.var(0) - 1).abs().max() < 0.2
    assert deviation.mean().abs() < 0.02
    assert deviation.var().item() == pytest.approx(1.0, abs=0.03)


def test_two_scans_of_one_phantom_have_independent_noise_and_a_seed_repeats_one(water: Phantom, fan: FanBeam) -> None:
    exposure = expose(water, fan)

    def counts(seed: int | None) -> torch.Tensor:
        generator = None if seed is None else torch.Generator().manual_seed(seed)
        return exposure.scan(tube_current_ma=40.0, generator=generator).counts

    clean = counts(None)
    first, second = counts(1) - clean, counts(2) - clean
    correlation = torch.corrcoef(torch.stack([first.ravel(), second.ravel()]))[0, 1]
    assert correlation.abs() < 4 / first.numel() ** 0.5
    assert torch.equal(counts(1), clean + first)


def test_quanta_grow_with_current_and_time_and_line_integrals_do_not(water: Phantom, fan: FanBeam) -> None:
    one = expose(water, fan).scan(tube_current_ma=50.0, generator=None)
    four = expose(water, fan).scan(tube_current_ma=100.0, rotation_time=2.0, generator=None)
    torch.testing.assert_close(four.incident, 4 * one.incident)
    torch.testing.assert_close(four.counts / four.incident, one.counts / one.incident)


def test_a_lower_voltage_attenuates_more(water: Phantom, fan: FanBeam) -> None:
    low, high = (
        expose(water, fan, scanner_beam(fan, tube_voltage_kvp=kvp)).scan(tube_current_ma=100.0, generator=None)
        for kvp in (80.0, 140.0)
    )
    middle = chords(fan) > 80
    assert ((low.counts / low.incident)[:, middle] < (high.counts / high.incident)[:, middle]).all()
    assert low.incident.sum() < high.incident.sum()


def test_a_chest_can_be_scanned_and_bone_hardens_the_beam(fan: FanBeam) -> None:
    phantom = chest_body(np.random.default_rng(0)).slice(0.0, ImageGrid(150, 150, spacing=3.0))
    moments = moments_of(phantom, fan, scanner_beam(fan))
    hardness = moments.signal_variance / moments.signal_mean / moments.quantum
    assert hardness.min() > 1 - 1e-5
    assert hardness.max() > 1.1


def test_a_photon_counting_detector_counts_poisson_numbers_without_electronic_noise(
    water: Phantom, fan: FanBeam
) -> None:
    moments = moments_of(water, fan, scanner_beam(fan, detector="photon-counting"))
    torch.testing.assert_close(moments.signal_variance, moments.signal_mean)
    assert moments.electronic_noise == 0
    scan = expose(water, fan, scanner_beam(fan, detector="photon-counting")).scan(
        tube_current_ma=1.0, generator=torch.Generator().manual_seed(0)
    )
    torch.testing.assert_close(scan.counts, scan.counts.round())
    high, low = (
        scanner_beam(fan, detector="photon-counting", threshold=threshold).response.sum() for threshold in (60.0, 25.0)
    )
    assert high < low


def test_blur_averages_intensities_and_leaves_the_middle_of_a_disc(water: Phantom, fan: FanBeam) -> None:
    beam = scanner_beam(fan)
    sharp = moments_of(water, fan, beam)
    blurred = moments_of(water, fan, beam, sampling=Sampling(columns=2, focal_spot=(2, 2), views=2))
    middle, edge = chords(fan) > 150, (chords(fan) > 0) & (chords(fan) < 80)
    ratio = blurred.signal_mean / sharp.signal_mean
    torch.testing.assert_close(ratio[:, middle], torch.ones(40, int(middle.sum())), rtol=0, atol=0.02)
    # Intensities average above the intensity of the average path.
    assert ratio[:, edge].mean() > 1.005


def test_each_sample_is_a_geometry_of_its_own() -> None:
    fan = clinical_fan_beam(views=8, bins=300)
    samples = list(Sampling(columns=3, focal_spot=(1, 2), views=2, length=1.0).geometries(fan))
    assert len(samples) == 4
    assert {each.bins for each in samples} == {900}
    np.testing.assert_allclose(samples[0].fan_angles.reshape(300, 3).mean(1), fan.fan_angles, atol=1e-6)
    turns = sorted({round(each.view_angles[0] / (2 * np.pi / 8), 6) for each in samples})
    assert turns == [-0.25, 0.25]
    depths = sorted({each.focal_spot_shifts[0][1] for each in samples})
    assert depths == pytest.approx([-2.036, 2.036], abs=1e-3)
    assert list(Sampling().geometries(fan)) == [fan]


def test_crosstalk_spreads_an_edge_and_keeps_the_sum(water: Phantom, fan: FanBeam) -> None:
    beam = scanner_beam(fan, bowtie="none")
    alone, shared = moments_of(water, fan, beam), moments_of(water, fan, beam, crosstalk=0.1)
    inner = alone.signal_mean[:, 10:13]
    torch.testing.assert_close(shared.signal_mean[:, 11], inner @ torch.tensor([0.1, 0.8, 0.1]))
    torch.testing.assert_close(shared.signal_mean.sum(), alone.signal_mean.sum())


def test_numbers_that_cannot_be_are_refused(water: Phantom, fan: FanBeam) -> None:
    exposure = expose(water, fan)
    with pytest.raises(ValueError, match="tube_current_ma must be positive, in mA"):
        exposure.scan(tube_current_ma=0.0, generator=None)
    with pytest.raises(ValueError, match="rotation_time must be positive, in s"):
        exposure.scan(tube_current_ma=40.0, rotation_time=-1.0, generator=None)
    with pytest.raises(ValueError, match="The beam is for 30 bins, the geometry has 60"):
        moments_of(water, fan, scanner_beam(clinical_fan_beam(views=4, bins=30)))
    with pytest.raises(ValueError, match="Crosstalk"):
        moments_of(water, fan, scanner_beam(fan), crosstalk=0.5)
    with pytest.raises(ValueError, match="at least one sample"):
        Sampling(views=0)
    with pytest.raises(ValueError, match="threshold"):
        scanner_beam(fan, threshold=0.0)
    with pytest.raises(ValueError, match="cannot be shared out"):
        moments_behind(torch.zeros(1, 4, 61), ("water",), scanner_beam(fan))


def test_catsim_sees_the_same_chest(shared_data: Path) -> None:
    """An independent simulator's noise-free line integrals of water and bone, of its air, and its correction."""
    folder = shared_data / "catsim" / "chest"
    about = json.loads((folder / "geometry.json").read_text())
    every = 82
    angles = evenly_spaced_views(about["n_views"])[::every]
    whole = clinical_fan_beam()
    fan = FanBeam(angles, whole.bins, whole.source_to_isocenter, whole.source_to_detector, whole.bin_width, 0.25)
    with np.load(folder / "truth.npz") as true:
        image = torch.from_numpy(true["mu"] / true["mu_water"])
    # CatSim's phantom was made from this image: above 100 HU part of the attenuation is cortical bone's.
    bone = ((image - 1.1) / 1.3).clamp(0, 1)
    water_70, bone_70 = relative_attenuation(("water", "cortical bone"), np.array([70.0]))[:, 0].tolist()
    fractions = torch.stack([(1 - bone) * image, bone * image * (water_70 / bone_70)]).float()
    grid = ImageGrid(*image.shape, spacing=about["fov_mm"] / image.shape[1])
    paths = Projector(grid, fan, mu_water=1.0)(fractions)
    beam = scanner_beam(fan)
    moments = moments_behind(paths, ("water", "cortical bone"), beam)
    ours = -torch.log(moments.signal_mean / moments.air_mean)
    with np.load(folder / "prep_clean.npz") as prep:
        theirs = torch.from_numpy(prep["prep"][::every])
    behind = theirs > 0.5
    relative = (ours / theirs - 1)[behind]
    assert relative.mean().abs() < 0.0015
    assert (ours - theirs)[(theirs > 0.05) & (theirs < 5)].square().mean().sqrt() < 0.005 * theirs[behind].mean()

    with np.load(folder / "signal_mean_800mA.npz") as s1, np.load(folder / "signal_var_800mA.npz") as s2:
        air, quantum = torch.from_numpy(s1["air_S1"]), torch.from_numpy(s2["air_S2"] / s1["air_S1"])
    torch.testing.assert_close(moments.quantum, quantum, rtol=0.005, atol=0)
    torch.testing.assert_close(moments.air_mean * 800 / 984, air, rtol=0.01, atol=0)


def test_air_alone_lets_everything_pass(fan: FanBeam) -> None:
    nothing = Phantom(("air",), torch.ones(1, 8, 8), ImageGrid(8, 8, spacing=10.0))
    moments = moments_of(nothing, fan, scanner_beam(fan))
    torch.testing.assert_close(moments.signal_mean, moments.air_mean.expand(40, -1))
