import math

import numpy as np
import pytest

from pnpct.geometry import ImageGrid
from pnpct.simulation.canvas import Canvas
from pnpct.simulation.shapes import Shape, capsule, ellipse, union

SHAPES = {
    "ellipse": (ellipse((3.0, -4.0), (20.0, 12.0), angle=0.7), math.pi * 20 * 12),
    "boxy ellipse": (ellipse((0.0, 0.0), (20.0, 12.0), power=50.0), 4 * 20 * 12),
    "capsule": (capsule((-10.0, 5.0), (10.0, 5.0), 4.0), math.pi * 16 + 8 * 20),
    "ring": (ellipse((0.0, 0.0), (9.0, 9.0)).without(ellipse((0.0, 0.0), (5.0, 5.0))), math.pi * (81 - 25)),
    "grown disc": (ellipse((1.0, 2.0), (9.0, 9.0)).grown(2.0), math.pi * 121),
    "half of a disc": (ellipse((0.0, 0.0), (9.0, 9.0)).within(ellipse((0.0, 500.0), (500.0, 500.0))), 126.5),
    "two discs": (union(ellipse((-9.0, 0.0), (5.0, 5.0)), ellipse((9.0, 0.0), (5.0, 5.0))), 2 * math.pi * 25),
}


def canvas(grid: ImageGrid, *, bending: dict[float, float] | None = None, seed: int = 0) -> Canvas:
    return Canvas(("air", "water", "muscle"), grid, np.random.default_rng(seed), bending=bending or {})


@pytest.mark.parametrize("name", SHAPES)
def test_what_is_painted_has_the_area_of_the_shape(name: str) -> None:
    shape, area = SHAPES[name]
    on = canvas(ImageGrid(200, 240, spacing=0.25))
    on.paint(shape, {"water": 1.0})
    painted = on.finish().fractions[1].sum().item() * 0.25**2
    assert painted == pytest.approx(area, rel=0.01)


@pytest.mark.parametrize("name", SHAPES)
def test_nothing_of_a_shape_is_beyond_its_reach(name: str) -> None:
    shape, _ = SHAPES[name]
    x, y = np.meshgrid(np.linspace(-50, 50, 201), np.linspace(-50, 50, 201))
    inside = shape.distance(x, y) < 0
    away = np.hypot(x - shape.center[0], y - shape.center[1])
    assert inside.any()
    assert away[inside].max() <= shape.reach


def test_distances_near_an_outline_are_in_mm() -> None:
    points = np.array([10.0, 11.0, 12.0])
    distance = ellipse((0.0, 0.0), (11.0, 30.0)).distance(points, np.zeros(3))
    np.testing.assert_allclose(distance, [-1.0, 0.0, 1.0], atol=0.05)


def test_a_smooth_union_fills_the_corner_and_nothing_far_away() -> None:
    left, right = ellipse((-5.0, 0.0), (6.0, 6.0)), ellipse((5.0, 0.0), (6.0, 6.0))
    x, y = np.array([0.0, -11.5]), np.array([3.6, 0.0])
    sharp, smooth = union(left, right).distance(x, y), union(left, right, smoothing=3.0).distance(x, y)
    assert sharp[0] > 0 > smooth[0]
    assert sharp[1] == smooth[1]


def test_what_is_painted_last_lies_on_top_and_fractions_sum_to_1() -> None:
    on = canvas(ImageGrid(40, 40, spacing=1.0))
    on.paint(ellipse((0.0, 0.0), (15.3, 12.1)), {"water": 0.25, "muscle": 0.75})
    on.paint(ellipse((0.0, 0.0), (5.2, 5.2)), {"water": 1.0})
    on.paint(ellipse((0.0, 8.0), (2.0, 2.0)), {"air": 1.0}, opacity=0.5)
    fractions = on.finish().fractions
    assert fractions[:, 20, 20].tolist() == [0.0, 1.0, 0.0]
    assert fractions[:, 20, 30].tolist() == [0.0, 0.25, 0.75]
    assert fractions[:, 12, 20].tolist() == pytest.approx([0.5, 0.125, 0.375])
    assert fractions.sum(0).sub(1).abs().max() < 1e-6


def test_a_shape_outside_the_grid_paints_nothing() -> None:
    on = canvas(ImageGrid(10, 10, spacing=1.0))
    on.paint(ellipse((100.0, 0.0), (5.0, 5.0)), {"water": 1.0})
    assert on.finish().fractions[1].sum() == 0


def test_noise_has_its_variance_and_its_correlation_length_on_every_grid() -> None:
    fine = canvas(ImageGrid(400, 400, spacing=1.0)).noise(3.0)
    assert fine.std() == pytest.approx(1.0, abs=0.05)
    # A kernel of s.d. σ gives the correlation exp(−d² / 4σ²).
    assert np.mean(fine[:, 6:] * fine[:, :-6]) == pytest.approx(math.exp(-1), abs=0.05)
    coarse = canvas(ImageGrid(200, 200, spacing=2.0)).noise(3.0)
    between = (fine[:, 0::2] + fine[:, 1::2]) / 2
    between = (between[0::2] + between[1::2]) / 2
    assert np.corrcoef(coarse.ravel(), between.ravel())[0, 1] > 0.99


def test_bending_moves_outlines_by_the_given_distance() -> None:
    grid = ImageGrid(200, 200, spacing=2.0)
    bent = canvas(grid, bending={15.0: 2.0}, seed=3)
    assert (bent.x - grid.x).std() == pytest.approx(2.0, rel=0.1)
    assert (bent.y - grid.y[:, None]).std() == pytest.approx(2.0, rel=0.1)
    bent.paint(Shape(lambda x, y: x, (0.0, 0.0), 200.0), {"water": 1.0})
    edge = bent.finish().fractions[1].sum(1).numpy()
    assert 0.5 < edge.std() < 2.0
