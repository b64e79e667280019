import numpy as np
import pytest

from pnpct.simulation.anatomy.room import Room, streaks, tree
from pnpct.simulation.anatomy.shapes import ellipsoid
from pnpct.simulation.anatomy.variation import Variation

BALL = ellipsoid((10.0, -5.0, 20.0), (42.0, 42.0, 42.0))


@pytest.fixture(scope="module")
def room() -> Room:
    return Room(BALL)


@pytest.fixture
def vary() -> Variation:
    return Variation(np.random.default_rng(1))


def test_depth_is_the_distance_to_the_surface(room: Room) -> None:
    points = np.array([[10.0, -5.0, 20.0], [42.0, -5.0, 20.0], [10.0, -5.0, 75.0]])
    depth = room.depth(points)
    assert depth[:2] == pytest.approx([42.0, 10.0], abs=room.spacing)
    assert depth[2] < 0


def test_places_are_drawn_as_deep_as_asked_for(room: Room, vary: Variation) -> None:
    places = np.array([room.draw(vary.generator, 10.0) for _ in range(20)])
    assert room.depth(places).min() >= 10.0
    assert np.ptp(places, axis=0).min() > 15.0


def test_a_tree_stays_in_its_room_and_thins_out(room: Room, vary: Variation) -> None:
    pieces = list(tree((-20.0, -5.0, 20.0), (1.0, 0.0, 0.0), 4.0, room, vary))
    radii = [radius for _, radius in pieces]
    assert len(pieces) > 30
    assert radii[0] == 4.0
    assert min(radii) >= 0.6
    for shape, radius in pieces:
        middle = tuple((low + high) / 2 for low, high in zip(shape.low, shape.high, strict=True))
        assert BALL.at(middle) < radius + room.spacing


def test_streaks_stay_in_their_muscle(vary: Variation) -> None:
    layers = list(streaks(BALL, 20, vary))
    assert len(layers) > 5
    for layer in layers:
        x, y = np.meshgrid(np.arange(-40.0, 60.0), np.arange(-55.0, 45.0))
        inside = layer.shape.distance(x, y, 20.0) < 0
        assert np.all(BALL.distance(x, y, 20.0)[inside] < 1.0)
