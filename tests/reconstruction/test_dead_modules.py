"""Modules of the detector that measure nothing: what they would have seen is in a first image."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from pnpct.geometry import FanBeam, ImageGrid, evenly_spaced_views
from pnpct.operators import Projector
from pnpct.physics import Scan, Sinogram, take_log
from pnpct.reconstruction import FBP, fbp
from pnpct.reconstruction.dead_modules import WIDE, filled_from_image

MU = 0.0192587
FAN = FanBeam(evenly_spaced_views(180), 128, source_to_isocenter=570.0, source_to_detector=1040.0, bin_width=4.0)
GRID = ImageGrid(60, 60, 4.0)
BODY = ((0.0, 0.0, 100.0, 1.0), (55.0, 0.0, 14.0, 0.8))  # water, +800 HU
MODULE = range(68, 84)


def scan_of(geometry: FanBeam, dead=(), views=slice(None)) -> Scan:
    """Chords of two discs, as counts; dead bins have no incident counts in some views."""
    spots, points = geometry.focal_spots(), geometry.detector_points(geometry.fan_angles)
    along = points - spots[:, None]
    along /= np.linalg.norm(along, axis=-1, keepdims=True)
    p = np.zeros(geometry.shape)
    for x, y, radius, relative in BODY:
        off = (x - spots[:, :1]) * along[..., 1] - (y - spots[:, 1:]) * along[..., 0]
        p += relative * MU * 2 * np.sqrt(np.maximum(radius**2 - off**2, 0))
    incident = torch.full(geometry.shape, 1e5)
    incident[views, list(dead)] = 0
    return Scan(torch.from_numpy(1e5 * np.exp(-p)).float() * (incident > 0), incident, 0.0, geometry, mu_water=MU)


def prepared(geometry: FanBeam, dead=(), views=slice(None)) -> tuple[Sinogram, Projector]:
    return take_log(scan_of(geometry, dead, views)), Projector(GRID, geometry, mu_water=MU)


def error(image: torch.Tensor, right: torch.Tensor) -> float:
    return float(1000 * (image - right).square().mean().sqrt())


@pytest.mark.parametrize("geometry", [FAN, replace(FAN, detector="flat"), replace(FAN, detector_offset=0.25)])
@pytest.mark.parametrize("dead", [MODULE, range(20, 36), range(100, 128), [*range(40, 46), *range(90, 106)]])
@pytest.mark.parametrize("views", [slice(None), slice(100)])
def test_a_bone_behind_a_dead_module_keeps_its_height(geometry: FanBeam, dead: range, views: slice) -> None:
    right = FBP()(*prepared(geometry)).image
    sinogram, A = prepared(geometry, dead, views)
    image, along_detector = FBP()(sinogram, A).image, fbp(sinogram.line_integrals, A, kernel="hann")
    bone = torch.from_numpy(np.hypot(GRID.x - 55, GRID.y[:, None]) < 9)
    assert error(image, right) < max(0.25 * error(along_detector, right), 6)
    assert 1000 * float((image - right)[bone].mean()) == pytest.approx(0, abs=15)
    if dead is MODULE:
        assert 1000 * float((along_detector - right)[bone].mean()) < -60


@pytest.mark.parametrize("dead", [range(56, 72), [*range(40, 48), *range(75, 91)]])
def test_lines_that_neither_side_has_measured_are_those_of_a_smooth_image(dead: range) -> None:
    right = FBP()(*prepared(FAN)).image
    sinogram, A = prepared(FAN, dead)
    image, along_detector = FBP()(sinogram, A).image, fbp(sinogram.line_integrals, A, kernel="hann")
    assert error(image, right) < 0.5 * error(along_detector, right)


def test_it_does_not_depend_on_the_image_and_leaves_what_was_measured() -> None:
    sinogram, A = prepared(FAN, MODULE)
    filled, of_part = (
        filled_from_image(sinogram, Projector(grid, FAN, mu_water=MU)) for grid in (A.grid, ImageGrid(8, 8, 2.0))
    )
    assert torch.equal(filled.line_integrals, of_part.line_integrals)
    changed = (filled.line_integrals != sinogram.line_integrals).any(0)
    assert changed.nonzero().flatten().tolist() == list(MODULE)
    assert filled.weights is sinogram.weights


@pytest.mark.parametrize("geometry", [FAN, FAN[range(60)]])
@pytest.mark.parametrize("dead", [(), range(70, 69 + WIDE), MODULE])
def test_few_cells_and_a_limited_angle_stay_as_they_are(geometry: FanBeam, dead: range) -> None:
    sinogram, A = prepared(geometry, dead)
    assert (filled_from_image(sinogram, A) is sinogram) == (geometry.limited_angle or dead is not MODULE)


def test_a_batch_equals_its_scans() -> None:
    sinogram, A = prepared(FAN, MODULE)
    pair = torch.stack([sinogram.line_integrals, 0.5 * sinogram.line_integrals])
    together = filled_from_image(replace(sinogram, line_integrals=pair), A)
    for one, filled in zip(pair, together.line_integrals, strict=True):
        alone = filled_from_image(replace(sinogram, line_integrals=one), A)
        torch.testing.assert_close(filled, alone.line_integrals, rtol=0, atol=1e-5)
