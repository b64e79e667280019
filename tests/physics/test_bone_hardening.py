import subprocess
import sys

import numpy as np
import pytest
import torch

from pnpct.physics import BeamHardening, BoneHardening, DiagonalWeights, Sinogram
from pnpct.simulation import clinical_fan_beam, hardening_correction, relative_attenuation, scanner_beam

BEAM = scanner_beam(clinical_fan_beam(views=2, bins=5))
OF_WATER, OF_BONE = relative_attenuation(("water", "cortical bone"), BEAM.energies)
WATER, BONE = relative_attenuation(("water", "cortical bone"), np.array([BEAM.effective_energy]))[:, 0].tolist()


@pytest.fixture(scope="module")
def hardening() -> BeamHardening:
    return hardening_correction(BEAM)


@pytest.fixture(scope="module")
def bone(hardening: BeamHardening) -> BoneHardening:
    assert hardening.bone is not None
    return hardening.bone


def measured(water_mm: torch.Tensor, bone_mm: torch.Tensor) -> torch.Tensor:
    """What each bin measures behind water and bone: (paths, bins)."""
    detected = BEAM.photons * BEAM.response
    passed = torch.exp(-water_mm[:, None] * OF_WATER - bone_mm[:, None] * OF_BONE)
    return -((passed @ detected.T) / detected.sum(-1)).log()


def test_bone_and_water_look_as_with_one_energy(hardening: BeamHardening, bone: BoneHardening) -> None:
    water_mm = torch.linspace(0, 350, 8, dtype=torch.float64).repeat(6)
    bone_mm = torch.linspace(0, 50, 6, dtype=torch.float64).repeat_interleave(8)
    p, q = hardening.correct(measured(water_mm, bone_mm)), (BONE * bone_mm)[:, None].expand(-1, 5)
    wanted = (WATER * water_mm + BONE * bone_mm)[:, None].expand(-1, 5)
    assert (p - wanted).abs().max() > 0.15
    torch.testing.assert_close(p + bone.lacking(p, q), wanted, rtol=0, atol=0.02)


def test_without_bone_nothing_changes(bone: BoneHardening) -> None:
    p = torch.linspace(0, 8, 10)[:, None].expand(-1, 5)
    assert not bone.lacking(p, torch.zeros_like(p)).any()
    assert not bone.slope(p, torch.zeros_like(p)).any()


def test_the_slope_is_that_of_finite_differences(bone: BoneHardening) -> None:
    p = torch.linspace(-0.5, 12, 10, dtype=torch.float64)[:, None].expand(-1, 5)
    q = torch.linspace(0, 2, 5, dtype=torch.float64).expand(10, 5)
    difference = bone.lacking(p + 1e-4, q) - bone.lacking(p - 1e-4, q)
    torch.testing.assert_close(bone.slope(p, q), difference / 2e-4, rtol=1e-6, atol=1e-9)


def test_bone_is_compact_bone_mixed_with_water(bone: BoneHardening) -> None:
    shares = torch.tensor([[0.0, 0.5, 1.0]])
    image = 1 + shares * (bone.compact - 1)
    fat = bone.in_image(*[torch.ones(1, 1)] * 3)  # of water, a little
    torch.testing.assert_close(bone.in_image(image, image, image), torch.where(shares > 0, shares * bone.compact, fat))
    denser = torch.full((1, 1), 1.5 * bone.compact)
    torch.testing.assert_close(bone.in_image(denser, denser, denser), denser)


def test_air_lungs_and_organs_are_water(bone: BoneHardening) -> None:
    image = torch.tensor([[-0.2, 0.0, 0.3, 0.7, 1.03, 1.05]])
    assert not bone.in_image(image, image, image).any()


def test_noise_of_a_pixel_is_neither_bone_nor_fat(bone: BoneHardening) -> None:
    muscle = torch.full((1, 4), 1.04)
    assert not bone.in_image(torch.tensor([[0.5, 0.9, 1.3, 2.0]]), muscle, muscle).any()


@pytest.mark.parametrize(
    ("tissue", "iodinated_blood", "length", "before", "after"),
    [
        ("adipose", 0.0, 100.0, -10.7, -2.0),
        ("adipose", 0.0, 200.0, -5.8, -0.5),
        ("yellow marrow", 0.0, 100.0, -11.9, -5.7),
        ("muscle", 0.0, 200.0, 0.4, 0.4),
        ("liver", 0.25, 100.0, 14.4, -0.8),
        ("liver", 0.25, 400.0, -13.2, -1.4),
        ("blood", 0.5, 400.0, -32.6, -11.0),
    ],
)
def test_a_tissue_looks_as_with_one_energy(
    hardening: BeamHardening,
    bone: BoneHardening,
    tissue: str,
    iodinated_blood: float,
    length: float,
    before: float,
    after: float,
) -> None:
    """Errors in HU along a path through one tissue, in the middle of the fan."""
    mixture = torch.tensor([1 - iodinated_blood, iodinated_blood], dtype=torch.float64)
    of_tissue = mixture @ relative_attenuation((tissue, "iodinated blood"), BEAM.energies)
    at_one = mixture @ relative_attenuation((tissue, "iodinated blood"), np.array([BEAM.effective_energy]))
    detected = BEAM.photons * BEAM.response
    measured = -((detected * torch.exp(-length * of_tissue)).sum(-1) / detected.sum(-1)).log()
    p = hardening.correct(measured[None])
    value = (at_one / WATER).reshape(1, 1)
    q = (WATER * length * bone.in_image(value, value, value)).expand(1, 5)
    for line, wanted in ((p, before), (p + bone.lacking(p, q), after)):
        assert 1000 * float(line[0, 2] - at_one * length) / (WATER * length) == pytest.approx(wanted, abs=0.1)


@pytest.mark.parametrize(
    ("coefficients", "compact", "message"),
    [
        (torch.zeros(1, 5), 2.5, "6 coefficients"),
        (torch.full((1, 6), float("nan")), 2.5, "NaN or infinite"),
        (torch.zeros(1, 6), 0.9, "1 to 10 times"),
    ],
)
def test_what_cannot_be_is_refused(coefficients: torch.Tensor, compact: float, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        BoneHardening(coefficients, compact)


def test_both_corrections_are_for_the_same_bins() -> None:
    with pytest.raises(ValueError, match="for 3 bins, that for water for 2"):
        BeamHardening(torch.tensor([[1.0, 0.0]] * 2), BoneHardening(torch.zeros(3, 6), 2.5))


def test_line_integrals_are_of_as_many_bins(bone: BoneHardening) -> None:
    with pytest.raises(ValueError, match="for 5 bins, the line integrals have 4"):
        Sinogram(torch.ones(2, 4), DiagonalWeights(torch.ones(2, 4)), bone)


def test_the_same_beam_has_the_same_coefficients() -> None:
    first, second = (hardening_correction(scanner_beam(clinical_fan_beam(views=2, bins=7))).bone for _ in range(2))
    assert first is not None
    assert second is not None
    assert torch.equal(first.coefficients, second.coefficients)


@pytest.mark.slow
def test_each_process_fits_the_same_to_the_last_bit() -> None:
    """LAPACK behind PyTorch rounds with the place in memory: a data set that is resumed would not be the same."""
    program = (
        "from pnpct.simulation import *; beam = scanner_beam(clinical_fan_beam(views=2, bins=120));"
        "fit = hardening_correction(beam);"
        "print(fit.coefficients.numpy().tobytes().hex(), fit.bone.coefficients.numpy().tobytes().hex())"
    )
    fits = {subprocess.run([sys.executable, "-c", program], capture_output=True, check=True).stdout for _ in range(5)}
    assert len(fits) == 1
