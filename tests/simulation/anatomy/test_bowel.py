import itertools
import math

import numpy as np
import pytest

from pnpct.simulation.anatomy.bowel import (
    Bowel,
    folded,
    haustra,
    juice,
    painted,
    pieces,
    small_bowel,
    smooth_line,
    wander,
)
from pnpct.simulation.anatomy.room import Room
from pnpct.simulation.anatomy.shapes import ellipsoid
from pnpct.simulation.anatomy.tissues import AIR, MUSCLE
from pnpct.simulation.anatomy.variation import Variation

RADIUS, GAP = 8.0, 2.0


@pytest.fixture(scope="module")
def room() -> Room:
    return Room(ellipsoid((0.0, 0.0, 0.0), (70.0, 50.0, 60.0)))


@pytest.fixture
def vary() -> Variation:
    return Variation(np.random.default_rng(3))


def test_loops_keep_clear_of_each_other_and_of_what_is_there(room: Room, vary: Variation) -> None:
    taken = [((0.0, 0.0, 0.0), 15.0)]
    lines = [np.array(line) for line in wander(room, RADIUS, vary, taken, gap=GAP)]
    assert sum(len(line) for line in lines) > 80
    for line in lines:
        assert np.linalg.norm(line, axis=1).min() >= 15.0 + RADIUS + GAP - 1e-9
        assert room.depth(line).min() >= RADIUS
    for one, other in itertools.combinations(lines, 2):
        assert np.linalg.norm(one[:, None] - other[None], axis=2).min() >= 2 * RADIUS + GAP - 1e-9


def test_small_bowel_fills_the_room_around_other_bowel(room: Room, vary: Variation) -> None:
    colon = Bowel(smooth_line([(-60, 0, 0), (60, 0, 0)], 4.0), [12.0] * 31, MUSCLE, 2.0, juice())
    loops = list(small_bowel(room, [colon], MUSCLE, vary, filled=0.5))
    assert len(loops) > 5
    nearest = min(math.dist(a, b) for loop in loops for a in loop.points for b in colon.points)
    assert nearest > 18.0


def test_gas_lies_in_front_of_what_is_liquid(vary: Variation) -> None:
    line = smooth_line([(-30, 0, 0), (30, 0, 0)], 5.0)
    tract = Bowel(line, [10.0] * len(line), MUSCLE, 2.0, juice(), gas=5.0)
    gas = [layer.shape for layer in tract.contents() if layer.tissue is AIR]
    assert any(shape.at((1.0, 7.0, 0.0)) < 0 for shape in gas)
    assert all(shape.at((1.0, 2.0, 0.0)) > 0 for shape in gas)
    assert all(shape.at((1.0, 9.0, 0.0)) > 0 for shape in gas)  # the wall


def test_walls_are_painted_before_contents() -> None:
    line = smooth_line([(-30, 0, 0), (30, 0, 0)], 5.0)
    tracts = [Bowel(line, [10.0] * len(line), MUSCLE, 2.0, folded(MUSCLE)) for _ in range(2)]
    walls = [layer.tissue is MUSCLE for layer in painted(tracts)]
    assert walls == sorted(walls, reverse=True)
    assert sum(walls) == len(walls) / 2


def test_a_smooth_line_goes_through_its_corners_in_small_steps() -> None:
    corners = [(0, 0, 0), (30, 0, 0), (30, 40, 10)]
    line = smooth_line(corners, 4.0)
    assert all(min(math.dist(corner, point) for point in line) < 1e-9 for corner in corners)
    assert max(math.dist(a, b) for a, b in itertools.pairwise(line)) < 6.0


def test_a_colon_has_folds(vary: Variation) -> None:
    radii = haustra(smooth_line([(0, 0, 0), (300, 0, 0)], 4.0), 20.0, vary, depth=0.3)
    assert min(radii) < 16.0 < 19.0 < max(radii)


def test_pieces_share_their_ends() -> None:
    parts = list(pieces([(float(x), 0.0, 0.0) for x in range(50)], [1.0] * 50, 12))
    assert len(parts) == 4
    assert (parts[0].start, parts[-1].stop) == (0, 50)
    assert all(one.stop - 1 == other.start for one, other in itertools.pairwise(parts))
