import math

import numpy as np
import pytest

from pnpct.simulation.anatomy.shapes import Shape, capsule, ellipsoid, loft, tube, union

BOXY = 8 * math.gamma(1 + 1 / 6) ** 3 / math.gamma(1 + 3 / 6)
SHAPES = {
    "ellipsoid": (ellipsoid((3.0, -4.0, 1.0), (20.0, 12.0, 9.0), angle=0.7), 4 / 3 * math.pi * 20 * 12 * 9),
    "boxy ellipsoid": (ellipsoid((0.0, 0.0, 0.0), (20.0, 12.0, 9.0), power=6.0), BOXY * 20 * 12 * 9),
    "capsule": (
        capsule((-10.0, 5.0, -3.0), (10.0, 5.0, 3.0), 4.0),
        math.pi * 16 * math.hypot(20, 6) + 4 / 3 * math.pi * 64,
    ),
    "shell": (
        ellipsoid((0.0, 0.0, 0.0), (9.0, 9.0, 9.0)).without(ellipsoid((0.0, 0.0, 0.0), (5.0, 5.0, 5.0))),
        4 / 3 * math.pi * (729 - 125),
    ),
    "grown ball": (ellipsoid((1.0, 2.0, 3.0), (9.0, 9.0, 9.0)).grown(2.0), 4 / 3 * math.pi * 11**3),
    "disc of a ball": (ellipsoid((0.0, 0.0, 0.0), (9.0, 9.0, 9.0)).between(-3.0, 3.0), math.pi * (486 - 18)),
    "half a ball": (
        ellipsoid((0.0, 0.0, 0.0), (9.0, 9.0, 9.0)).within(ellipsoid((0.0, 900.0, 0.0), (900.0, 900.0, 900.0))),
        2 / 3 * math.pi * 729 - 6,
    ),
    "loft": (loft([(-10.0, 0.0, 0.0, 8.0, 5.0), (10.0, 6.0, 0.0, 8.0, 5.0)]), math.pi * 40 * 20),
    "tube": (
        tube([(-15.0, 0.0, 0.0), (0.0, 0.0, 0.0), (15.0, 0.0, 0.0)], 5.0),
        math.pi * 25 * 30 + 4 / 3 * math.pi * 125,
    ),
}
# Middles of cubes of half a millimetre.
EACH = np.arange(-29.75, 30.0, 0.5)
X, Y = np.meshgrid(EACH, EACH)
HEIGHTS = EACH


@pytest.mark.parametrize("name", SHAPES)
def test_a_solid_has_its_volume_and_lies_in_its_box(name: str) -> None:
    shape, volume = SHAPES[name]
    inside = np.stack([shape.distance(X, Y, z) < 0 for z in HEIGHTS])
    assert inside.sum() * 0.5**3 == pytest.approx(volume, rel=0.03)
    z, row, col = np.nonzero(inside)
    for axis, places in enumerate((X[row, col], Y[row, col], HEIGHTS[z])):
        assert shape.low[axis] <= places.min() + 1e-9
        assert places.max() - 1e-9 <= shape.high[axis]


def test_distances_near_a_surface_are_in_mm() -> None:
    points = np.array([10.0, 11.0, 12.0])
    for shape in (ellipsoid((0.0, 0.0, 0.0), (11.0, 30.0, 20.0)), capsule((0.0, -9.0, 0.0), (0.0, 9.0, 0.0), 11.0)):
        np.testing.assert_allclose(shape.distance(points, np.zeros(3), 0.0), [-1.0, 0.0, 1.0], atol=0.05)


def test_a_smooth_union_fills_the_corner_and_nothing_far_away() -> None:
    left, right = (ellipsoid((x, 0.0, 0.0), (6.0, 6.0, 6.0)) for x in (-5.0, 5.0))
    x, y = np.array([0.0, -11.5]), np.array([3.6, 0.0])
    sharp, smooth = union(left, right).distance(x, y, 0.0), union(left, right, smoothing=3.0).distance(x, y, 0.0)
    assert sharp[0] > 0 > smooth[0]
    assert sharp[1] == smooth[1]


def test_a_loft_passes_through_its_stations() -> None:
    stations = [(-20.0, 0.0, 0.0, 10.0, 5.0), (0.0, 3.0, 0.0, 20.0, 6.0), (10.0, 3.0, 4.0, 8.0, 8.0)]
    shape = loft(stations)
    for z, x, y, a, _ in stations:
        assert shape.at((x + a, y, z)) == pytest.approx(0.0, abs=1e-9)
    assert shape.at((0.0, 0.0, -20.5)) > 0


def test_a_function_of_its_own_makes_a_shape() -> None:
    half = Shape(lambda x, y, z: x + 0 * y, (-9.0, -9.0, -9.0), (0.0, 9.0, 9.0))
    assert half.grown(2.0).at((1.0, 0.0, 0.0)) == -1.0
    assert half.grown(2.0).high == (2.0, 11.0, 11.0)
