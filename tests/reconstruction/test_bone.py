from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy import ndimage

from pnpct.geometry import ImageGrid
from pnpct.operators import Projector
from pnpct.physics import DiagonalWeights, Scan, Sinogram, take_log
from pnpct.reconstruction import FBP, corrected_for_bone
from pnpct.simulation import Phantom, clinical_fan_beam, expose, truth

GRID = ImageGrid(96, 96, spacing=2.5)


def head(grid: ImageGrid) -> Phantom:
    """Brain-like water in a skull of compact bone, 8 mm thick."""
    radius = torch.from_numpy(np.hypot(grid.x, grid.y[:, None]))
    skull, inside = (radius >= 82) & (radius < 90), radius < 82
    air = ~(skull | inside)
    return Phantom(("air", "water", "cortical bone"), torch.stack([air, inside, skull]).float(), grid)


@pytest.fixture(scope="module")
def scan() -> Scan:
    exposure = expose(head(ImageGrid(384, 384, spacing=0.625)), clinical_fan_beam(views=180, bins=300))
    return exposure.scan(tube_current_ma=400.0, generator=None)


def projector(scan: Scan, grid: ImageGrid) -> Projector:
    return Projector(grid, scan.geometry, mu_water=scan.mu_water)


def test_the_brain_is_flat_in_its_skull(scan: Scan) -> None:
    A, sinogram = projector(scan, GRID), take_log(scan)
    radius = torch.from_numpy(np.hypot(GRID.x, GRID.y[:, None]))
    rings = radius < 25, (radius > 60) & (radius < 70)
    with_bone, without = (FBP()(each, A).image for each in (sinogram, replace(sinogram, bone=None)))
    middle, rim = (1000 * (with_bone[ring].mean() - 1) for ring in rings)
    middle_before, rim_before = (1000 * (without[ring].mean() - 1) for ring in rings)
    assert rim_before - middle_before > 8
    assert abs(rim - middle) < 3
    assert max(abs(middle), abs(rim)) < 4 < rim_before


def test_fat_and_contrast_medium_are_corrected_too() -> None:
    """A child: fat around muscle, and a liver with contrast medium in it."""
    fine, grid = ImageGrid(384, 384, spacing=0.9), ImageGrid(128, 128, spacing=2.7)
    x, y = torch.from_numpy(fine.x), torch.from_numpy(fine.y[:, None].copy())
    ellipses = ((0, 100, 80), (0, 85, 65), (-30, 40, 50))
    body, lean, liver = (((x - middle) / a) ** 2 + (y / b) ** 2 < 1 for middle, a, b in ellipses)
    layers = torch.stack([each.float() for each in (~body, body & ~lean, lean & ~liver, 0.75 * liver, 0.25 * liver)])
    phantom = Phantom(("air", "adipose", "muscle", "liver", "iodinated blood"), layers, fine)
    scan = expose(phantom, clinical_fan_beam(views=180, bins=450)).scan(tube_current_ma=400.0, generator=None)
    A, sinogram = projector(scan, grid), take_log(scan)
    ideal = FBP()(Sinogram(A(truth(phantom, grid, energy=71.5)), sinogram.weights), A).image
    of_water, of_tissue = (1000 * (FBP()(each, A).image - ideal) for each in (replace(sinogram, bone=None), sinogram))
    for tissue in (body & ~lean, liver):
        inside = torch.from_numpy(ndimage.binary_erosion(tissue[1::3, 1::3].numpy(), iterations=2))
        assert abs(float(of_water[inside].mean())) > 7
        assert abs(float(of_tissue[inside].mean())) < 2


def test_weights_stay_inverse_variances(scan: Scan) -> None:
    A, sinogram = projector(scan, GRID), take_log(scan)
    more = replace(sinogram, line_integrals=sinogram.line_integrals + 1e-3)
    corrected, of_more = (corrected_for_bone(each, A) for each in (sinogram, more))
    growth = (of_more.line_integrals - corrected.line_integrals) / 1e-3
    through = sinogram.line_integrals > 1
    ratio = sinogram.weights.diagonal / corrected.weights.diagonal
    # Bone in the first image changes a little too.
    torch.testing.assert_close(ratio[through].sqrt(), growth[through], rtol=0.02, atol=0)


def test_it_does_not_depend_on_the_image_and_is_done_once(scan: Scan) -> None:
    sinogram = take_log(scan)
    corrected, of_part = (
        corrected_for_bone(sinogram, projector(scan, grid)) for grid in (GRID, ImageGrid(20, 20, spacing=1.0))
    )
    assert torch.equal(corrected.line_integrals, of_part.line_integrals)
    assert corrected_for_bone(corrected, projector(scan, GRID)) is corrected


def test_streaks_of_a_limited_angle_are_not_taken_for_bone(scan: Scan) -> None:
    part = scan[:60]
    A, sinogram = projector(part, GRID), take_log(part)
    corrected = corrected_for_bone(sinogram, A)
    assert torch.equal(corrected.line_integrals, sinogram.line_integrals)
    assert torch.equal(corrected.weights.diagonal, sinogram.weights.diagonal)
    assert corrected.bone is None


def test_a_scan_of_unknown_spectrum_stays_as_it_is(scan: Scan) -> None:
    sinogram = Sinogram(take_log(scan).line_integrals, take_log(scan).weights)
    assert corrected_for_bone(sinogram, projector(scan, GRID)) is sinogram


def test_a_batch_is_its_slices(scan: Scan) -> None:
    A, sinogram = projector(scan, GRID), take_log(scan)
    other = replace(sinogram, line_integrals=0.7 * sinogram.line_integrals)
    weights = DiagonalWeights(torch.stack([sinogram.weights.diagonal] * 2), A.geometry.shape)
    pair = Sinogram(torch.stack([sinogram.line_integrals, other.line_integrals]), weights, sinogram.bone)
    together = corrected_for_bone(pair, A)
    for number, one in enumerate((sinogram, other)):
        alone = corrected_for_bone(one, A)
        torch.testing.assert_close(together.line_integrals[number], alone.line_integrals, rtol=0, atol=1e-5)
        torch.testing.assert_close(together.weights.diagonal[number], alone.weights.diagonal, rtol=1e-4, atol=0)
