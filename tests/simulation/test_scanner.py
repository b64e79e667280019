import json
from pathlib import Path

import numpy as np
import pytest
import torch

from pnpct.geometry import FanBeam, ImageGrid, evenly_spaced_views
from pnpct.operators import Projector
from pnpct.physics import scan_from_moments
from pnpct.simulation import (
    Phantom,
    chest_phantom,
    clinical_fan_beam,
    moments_behind,
    relative_attenuation,
    scanner_beam,
    simulate_moments,
    simulate_scan,
    water_correction,
)
from pnpct.units import MU_WATER_70_KEV

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


def chords(fan: FanBeam) -> torch.Tensor:
    """Mean path of each cell's rays through the disc, mm."""
    edges = np.linspace(fan.fan_angle_edges[:-1], fan.fan_angle_edges[1:], 201)
    offsets = fan.source_to_isocenter * np.sin((edges[:-1] + edges[1:]) / 2)
    return torch.from_numpy((2 * np.sqrt(np.maximum(RADIUS**2 - offsets**2, 0))).mean(0))


def test_transmission_through_water_is_the_integral_over_the_spectrum(water: Phantom, fan: FanBeam) -> None:
    beam = scanner_beam(fan)
    moments = simulate_moments(water, fan, beam)
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


def test_after_the_correction_water_has_its_path_at_70_kev(water: Phantom, fan: FanBeam) -> None:
    scan = simulate_scan(water, fan, tube_current_ma=100.0, generator=None)
    measured = -torch.log(scan.counts / scan.incident).mean(0, keepdim=True)
    assert scan.beam_hardening is not None
    corrected = scan.beam_hardening.correct(measured)[0] / scan.mu_water
    middle = chords(fan) > 80
    torch.testing.assert_close(corrected[middle].double(), chords(fan)[middle], rtol=3e-3, atol=0)
    assert scan.mu_water == MU_WATER_70_KEV


def test_the_middle_of_the_clinical_fan_gets_34800_quanta_at_40_ma(water: Phantom) -> None:
    fan = clinical_fan_beam()
    assert fan.shape == (984, 900)
    beam = scanner_beam(fan)
    mean, variance = (beam.photons @ torch.from_numpy(beam.energies**power) for power in (1, 2))
    quanta = mean**2 / variance * 40 / 984
    assert quanta[450].item() == pytest.approx(34800, rel=5e-3)
    # The bow-tie leaves a tenth of it at the edge.
    assert 0.06 < (quanta[0] / quanta[450]).item() < 0.12


def test_counts_vary_as_their_moments_say(water: Phantom) -> None:
    fan = clinical_fan_beam(views=1000, bins=30)
    moments = simulate_moments(water, fan, scanner_beam(fan))
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
    def counts(seed: int | None) -> torch.Tensor:
        generator = None if seed is None else torch.Generator().manual_seed(seed)
        return simulate_scan(water, fan, tube_current_ma=40.0, generator=generator).counts

    clean = counts(None)
    first, second = counts(1) - clean, counts(2) - clean
    correlation = torch.corrcoef(torch.stack([first.ravel(), second.ravel()]))[0, 1]
    assert correlation.abs() < 4 / first.numel() ** 0.5
    assert torch.equal(counts(1), clean + first)


def test_quanta_grow_with_current_and_time_and_line_integrals_do_not(water: Phantom, fan: FanBeam) -> None:
    one = simulate_scan(water, fan, tube_current_ma=50.0, generator=None)
    four = simulate_scan(water, fan, tube_current_ma=100.0, rotation_time=2.0, generator=None)
    torch.testing.assert_close(four.incident, 4 * one.incident)
    torch.testing.assert_close(four.counts / four.incident, one.counts / one.incident)


def test_a_lower_voltage_attenuates_more(water: Phantom, fan: FanBeam) -> None:
    low, high = (
        simulate_scan(water, fan, tube_current_ma=100.0, tube_voltage_kvp=kvp, generator=None) for kvp in (80.0, 140.0)
    )
    middle = chords(fan) > 80
    assert ((low.counts / low.incident)[:, middle] < (high.counts / high.incident)[:, middle]).all()
    assert low.incident.sum() < high.incident.sum()


def test_a_chest_can_be_scanned_and_bone_hardens_the_beam(fan: FanBeam) -> None:
    phantom = chest_phantom(np.random.default_rng(0), grid=ImageGrid(150, 150, spacing=3.0))
    moments = simulate_moments(phantom, fan, scanner_beam(fan))
    hardness = moments.signal_variance / moments.signal_mean / moments.quantum
    assert hardness.min() > 1 - 1e-5
    assert hardness.max() > 1.1


def test_numbers_that_cannot_be_are_refused(water: Phantom, fan: FanBeam) -> None:
    with pytest.raises(ValueError, match="tube_current_ma must be positive, in mA"):
        simulate_scan(water, fan, tube_current_ma=0.0, generator=None)
    with pytest.raises(ValueError, match="rotation_time must be positive, in s"):
        simulate_scan(water, fan, tube_current_ma=40.0, rotation_time=-1.0, generator=None)
    with pytest.raises(ValueError, match="The beam is for 30 bins, the geometry has 60"):
        simulate_moments(water, fan, scanner_beam(clinical_fan_beam(views=4, bins=30)))


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
    assert relative.mean().abs() < 0.002
    assert relative.abs().median() < 0.004

    with np.load(folder / "signal_mean_800mA.npz") as s1, np.load(folder / "signal_var_800mA.npz") as s2:
        air, quantum = torch.from_numpy(s1["air_S1"]), torch.from_numpy(s2["air_S2"] / s1["air_S1"])
    torch.testing.assert_close(moments.quantum, quantum, rtol=0.012, atol=0)
    torch.testing.assert_close(moments.air_mean * 800 / 984, air, rtol=0.12, atol=0)

    with np.load(folder / "bhc_poly.npz") as correction:
        line_integrals = torch.linspace(0.5, 6.0, 12)[:, None].expand(12, 900)
        expected = np.stack([np.polyval(row, line_integrals[:, 0]) for row in correction["coef"]], axis=1)
    corrected = water_correction(beam).correct(line_integrals)
    torch.testing.assert_close(corrected, torch.from_numpy(expected).float(), rtol=0.015, atol=0)
