"""Few, uneven, repeated and missing views: FBP against a plain fan-beam FBP, and the shares of rays."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from pnpct.geometry import FanBeam, ImageGrid, evenly_spaced_views
from pnpct.operators import Projector
from pnpct.reconstruction import fbp
from pnpct.reconstruction.redundancy import _Circle, _share, ray_weights

MU_WATER = 0.0192587
SCANNER = FanBeam((0.0,), bins=256, source_to_isocenter=570.0, source_to_detector=1040.0, bin_width=2.4)
GRID = ImageGrid(72, 72, spacing=3.5)
X, Y = np.meshgrid(GRID.x, GRID.y)
BODY = [(0.0, 0.0, 110.0, 1.0), (60.0, 0.0, 14.0, 0.8), (-50.0, -10.0, 16.0, -0.09)]  # x, y, radius, attenuation
TRUTH = sum(attenuation * (np.hypot(X - x, Y - y) < radius) for x, y, radius, attenuation in BODY)
INSIDE = np.all([np.hypot(X, Y) < 105, *(abs(np.hypot(X - x, Y - y) - radius) > 6 for x, y, radius, _ in BODY)], axis=0)


def scan(degrees) -> tuple[FanBeam, np.ndarray]:
    """Views at the given angles, and the exact line integrals of the body."""
    geometry = replace(SCANNER, view_angles=np.radians(degrees))
    spots = geometry.focal_spots()[:, None]
    towards = geometry.detector_points(geometry.fan_angles) - spots
    towards /= np.linalg.norm(towards, axis=-1, keepdims=True)
    rays = np.zeros(geometry.shape)
    for x, y, radius, attenuation in BODY:
        apart = np.array([x, y]) - spots
        aside = apart[..., 0] * towards[..., 1] - apart[..., 1] * towards[..., 0]
        rays += attenuation * MU_WATER * 2 * np.sqrt(np.maximum(radius**2 - aside**2, 0))
    return geometry, rays


def plain_fbp(geometry: FanBeam, rays: np.ndarray) -> np.ndarray:
    """Fan-beam FBP after Kak and Slaney, section 3.4.1: each view weighs half of its two gaps, each ray one half."""
    beta = np.mod(geometry.view_angles, 2 * math.pi)
    order = np.argsort(beta, kind="stable")
    gaps = np.diff(beta[order], append=beta[order[0]] + 2 * math.pi)
    weight = np.empty_like(beta)
    weight[order] = (gaps + np.roll(gaps, 1)) / 2
    gamma, distance = geometry.fan_angles, geometry.source_to_isocenter
    pitch, k = gamma[1] - gamma[0], np.arange(1 - geometry.bins, geometry.bins)
    ramp = np.zeros(k.size)
    ramp[k % 2 == 1] = -1 / (math.pi * np.sin(k[k % 2 == 1] * pitch)) ** 2
    ramp[k == 0] = 1 / (4 * pitch**2)
    ramp = np.convolve(ramp, [0.25, 0.5, 0.25])  # the Hann window
    image = np.zeros(GRID.shape)
    for angle, step, view in zip(beta, weight, rays * np.cos(gamma) * distance, strict=True):
        filtered = np.convolve(view, ramp)[geometry.bins : 2 * geometry.bins] * pitch / 2
        depth, across = distance + X * math.sin(angle) - Y * math.cos(angle), X * math.cos(angle) + Y * math.sin(angle)
        image += step * np.interp(np.arctan2(across, depth), gamma, filtered) / (depth**2 + across**2)
    return image / MU_WATER


def error_hu(image: np.ndarray) -> float:
    """Root mean square error in the body, edges excepted."""
    return 1000 * math.sqrt(((image - TRUTH)[INSIDE] ** 2).mean())


def our_fbp(geometry: FanBeam, rays: np.ndarray) -> np.ndarray:
    projector = Projector(GRID, geometry, mu_water=MU_WATER)
    return fbp(torch.from_numpy(rays).float(), projector, kernel="hann").numpy()


def uneven_views() -> dict[str, np.ndarray]:
    """View angles in degrees."""
    random, turn = np.random.default_rng(1), np.arange(360.0)
    gated = [view for view in range(360) if view % 30 < 12]
    return {
        **{f"{views} even views": np.arange(views) * 360 / views for views in (3, 8, 24, 60)},
        "a tenth dropped": turn[random.permutation(360)[:324]],
        "half of them dropped": turn[random.permutation(360)[:180]],
        "jitter": turn + random.uniform(-0.4, 0.4, 360),
        "half a turn finer": np.r_[np.arange(0, 180, 0.5), np.arange(180, 360, 0.8)],
        "two turns, 0.2 degrees apart": np.r_[turn[::2], 360.2 + turn[::2]],
        "three turns from random angles": np.concatenate([random.uniform(0, 3) + turn[::3] for _ in range(3)]),
        "repeated and shuffled": random.permutation(np.tile(turn[::2], 3)),
        "nearly repeated": np.repeat(turn[::5], 8) + random.uniform(0, 0.05, 576),
        "golden angle": np.arange(100) * 180 * (5**0.5 - 1),
        "random": random.uniform(0, 360, 150),
        "backwards beyond two turns": 1000 - turn,
        "gated": np.array(gated, float),
        "two opposite gaps": np.r_[turn[:160], turn[180:340]],
        "a limited angle": np.arange(0, 60, 0.5),
    }


@pytest.mark.parametrize(("name", "degrees"), uneven_views().items())
def test_uneven_views_are_as_good_as_each_weighed_by_half_of_its_two_gaps(name, degrees):
    geometry, rays = scan(degrees)
    assert error_hu(our_fbp(geometry, rays)) < 1.1 * error_hu(plain_fbp(geometry, rays)) + 0.2


@pytest.mark.parametrize(
    ("degrees", "better"),
    [
        (np.delete(np.arange(360.0), np.arange(100, 140)), 3.0),
        (np.arange(0, 220, 0.5) + np.random.default_rng(2).uniform(-0.2, 0.2, 440), 3.0),
        (np.random.default_rng(3).permutation(np.arange(0, 220, 0.5))[:300], 7.0),
        (np.arange(100) * 180 * (5**0.5 - 1) % 220, 15.0),
    ],
    ids=["gap", "jittered short scan", "short scan with views dropped", "golden angle in a short scan"],
)
def test_what_was_measured_from_the_opposite_side_leaves_no_gap(degrees, better):
    """Where plain FBP errs by tens of HU."""
    geometry, rays = scan(degrees)
    assert error_hu(plain_fbp(geometry, rays)) > 20
    assert error_hu(our_fbp(geometry, rays)) < better


def test_a_gap_changes_the_shares_around_it_and_not_those_of_other_gaps():
    """The third gap is seen from the opposite side; the first two, opposite each other, are not."""
    degrees = np.arange(0, 360, 0.5)
    for begin, length in ((30, 20), (205, 20), (260, 10)):
        degrees = degrees[(degrees - begin) % 360 > length]
    geometry, rays = scan(degrees)
    assert error_hu(our_fbp(geometry, rays)) < 1.2 * error_hu(plain_fbp(geometry, rays))


def measured_share(geometry: FanBeam) -> np.ndarray:
    """The share of each ray in its line."""
    circle = _Circle.of(geometry)
    return _share(geometry, circle, circle.angles)[circle.number]


@pytest.mark.parametrize("measured", [range(240), range(140), range(190), [*range(20, 60), *range(75, 240)]])
@pytest.mark.parametrize("offset", [0, 25])
def test_the_shares_of_a_line_add_up_to_one(measured, offset):
    """On a grid of views and bins that has the other ray of each line."""
    step = 2 * math.pi / 240
    geometry = replace(
        SCANNER,
        view_angles=[step * view for view in measured],
        bins=41,
        bin_width=2 * math.tan(step / 4) * 1040.0,
        detector_offset=math.tan(offset / 2 * step) * 1040.0 / (2 * math.tan(step / 4) * 1040.0),
    )
    share = measured_share(geometry)
    number = np.rint(geometry.fan_angles / (step / 2)).astype(int)
    rows, cols = {view: row for row, view in enumerate(measured)}, {k: col for col, k in enumerate(number)}
    for view, row in rows.items():
        for k, col in cols.items():
            other_row, other_col = rows.get((view + 120 + k) % 240), cols.get(-k)
            there = 0.0 if other_row is None or other_col is None else share[other_row, other_col]
            assert share[row, col] + there == pytest.approx(1, abs=1e-6)


def test_a_full_turn_shares_evenly_and_a_short_scan_as_parker_says():
    np.testing.assert_allclose(measured_share(replace(SCANNER, view_angles=evenly_spaced_views(360))), 0.5)
    start, widest = 0.3, math.pi / 8
    short = replace(
        SCANNER,
        bin_width=2 * math.tan(widest / 256) * 1040,
        view_angles=evenly_spaced_views(700, start=start, span=math.pi + 2 * widest),
    )
    gamma, half_step = short.fan_angles, (math.pi + 2 * widest) / 1400
    view = 40
    beta = short.view_angles[view] - start + half_step
    expected = np.where(
        beta < 2 * (widest - gamma), np.sin(math.pi / 4 * beta / (widest - gamma)) ** 2, 1.0
    )  # Parker's Eq. 12 while the end of the scan sees the other side
    np.testing.assert_allclose(measured_share(short)[view], expected, atol=1e-6)


def test_views_stand_for_half_of_their_two_gaps_and_repeated_ones_share_it():
    degrees = np.append(np.arange(0.0, 360.0, 3.0), 363.0)
    degrees[5] += 1.0
    expected = np.full(degrees.size, 3.0)
    expected[[1, 4, 6, -1]] = 1.5, 3.5, 2.5, 1.5
    weights = ray_weights(replace(SCANNER, view_angles=np.radians(degrees)))
    np.testing.assert_allclose(2 * np.degrees(weights), np.broadcast_to(expected[:, None], weights.shape), rtol=1e-6)


@pytest.mark.parametrize("degrees", [np.arange(0, 230, 0.5), np.arange(0, 60, 0.5), [0.0, 10.0, 130.0], [0.0]])
def test_all_that_rays_stand_for_is_half_a_turn_of_each_line(degrees):
    """Every line is met twice in a turn and counted once."""
    geometry = replace(SCANNER, view_angles=np.radians(degrees))
    weights = ray_weights(geometry)
    total = weights + weights[:, ::-1]  # γ and −γ: a ray and the other on its line
    np.testing.assert_allclose(total.sum(0), 2 * math.pi, rtol=2e-3)
    assert (weights >= 0).all()
