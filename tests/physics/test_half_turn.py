"""Both halves of a turn see the same edges; a detector that is elsewhere is found by that."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from pnpct.geometry import ConeBeam, Detector, FanBeam, Trajectory
from pnpct.physics import Scan, column_shift, half_turn_views

VIEWS, STEP = 80, 2 * math.pi / 60
BALLS = (((22.0, -31.0, 1.0), 25.0, 0.02), ((-30.0, 12.0, -3.0), 14.0, 0.03), ((5.0, 2.0, 0.0), 9.0, -0.02))
NONE, CROSS, ALONG = [(0.0, 0.0, 0.0)], [(-0.4, 0.0, 0.0), (0.4, 0.0, 0.0)], [(-0.2, 0.0, 0.0), (-0.2, 5.4, -0.66)]


def geometry_of(*, feed=9.0, direction=1.0, shifts=NONE, rows=8) -> ConeBeam:
    angles = direction * STEP * (np.arange(VIEWS) - VIEWS / 2) + 0.7
    z = feed * np.arange(VIEWS) / 60
    z = z - z.mean()
    trajectory = Trajectory(angles, z, shifts * (VIEWS // len(shifts)))
    return ConeBeam(trajectory, Detector(100, 4.0, offset=0.25, rows=rows, row_height=3.0), 541.0, 949.0)


def scan_of(geometry: ConeBeam, balls=BALLS) -> Scan:
    source = geometry.focal_spots()[:, None, None]
    cells = geometry.detector_points(geometry.fan_angles)[:, None].repeat(geometry.rows, axis=1)
    cells[..., 2] += geometry.detector.row_positions[:, None]
    along = (cells - source) / np.linalg.norm(cells - source, axis=-1, keepdims=True)
    total = np.zeros(geometry.shape)
    for center, radius, attenuation in balls:
        to = np.array(center) - source
        away = (to**2).sum(-1) - (to * along).sum(-1) ** 2
        total += attenuation * 2 * np.sqrt(np.clip(radius**2 - away, 0.0, None))
    return Scan(torch.from_numpy(1e5 * np.exp(-total)), torch.tensor(1e5).double(), 0.0, geometry, 0.02)


def shift_seen(scan: Scan) -> float | None:
    near, far = half_turn_views(scan.geometry)
    return column_shift(scan[near], scan[far])


def elsewhere(scan: Scan, columns: float) -> Scan:
    """The same data, as if the detector were shifted by so many columns."""
    detector = replace(scan.geometry.detector, offset=scan.geometry.detector.offset + columns)
    return replace(scan, geometry=replace(scan.geometry, detector=detector))


@pytest.mark.parametrize("shifts", [NONE, CROSS, ALONG], ids=["at rest", "across", "along"])
@pytest.mark.parametrize(("feed", "direction"), [(9.0, 1.0), (-9.0, 1.0), (9.0, -1.0), (0.0, 1.0)])
def test_halves_agree_where_the_detector_is_and_find_it_elsewhere(feed, direction, shifts):
    scan = scan_of(geometry_of(feed=feed, direction=direction, shifts=shifts))
    assert shift_seen(scan) == pytest.approx(0.0, abs=0.1)
    for columns in (-1.5, 2.0):
        assert shift_seen(elsewhere(scan, columns)) == pytest.approx(-columns, abs=0.1)


def test_noise_hides_little(generator):
    scan = scan_of(geometry_of())
    noisy = replace(scan, counts=torch.poisson(scan.counts / 50, generator=generator), incident=scan.incident / 50)
    assert shift_seen(elsewhere(noisy, 1.5)) == pytest.approx(-1.5, abs=0.3)


def test_a_single_row_at_rest_is_enough():
    assert shift_seen(elsewhere(scan_of(geometry_of(feed=0.0, rows=1)), 1.0)) == pytest.approx(-1.0, abs=0.1)


def test_nothing_is_said_where_nothing_is_seen_twice():
    assert shift_seen(scan_of(geometry_of(), balls=())) is None
    assert half_turn_views(geometry_of()[:30]) is None
    assert half_turn_views(geometry_of()[:1]) is None
    assert shift_seen(scan_of(geometry_of(feed=200.0))) is None


def test_a_fan_beam_is_refused():
    fan = FanBeam((0.0, 0.1), 3, 541.0, 949.0, 1.0)
    scan = Scan(torch.ones(2, 3), torch.tensor(2.0), 0.0, fan, 0.02)
    with pytest.raises(ValueError, match="detector rows are needed"):
        column_shift(scan, scan)
