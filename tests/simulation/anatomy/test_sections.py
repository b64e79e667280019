import numpy as np
import pytest

from pnpct.simulation.anatomy.sections import outline, sheet, shell
from pnpct.simulation.anatomy.tissues import FAT

SQUARE = [(-10.0, -10.0), (10.0, -10.0), (10.0, 10.0), (-10.0, 10.0)]


def test_an_outline_knows_its_distance() -> None:
    block = outline((0.0, SQUARE), (100.0, SQUARE))
    assert block.at((0.0, 0.0, 50.0)) == pytest.approx(-10.0)
    assert block.at((25.0, 0.0, 50.0)) == pytest.approx(15.0)
    assert block.at((0.0, -13.0, 50.0)) == pytest.approx(3.0)
    assert block.at((0.0, 0.0, 103.0)) == pytest.approx(3.0)


def test_an_outline_loses_its_corners() -> None:
    block = outline((0.0, SQUARE), (100.0, SQUARE))
    # From (5, 10) to (10, 5): the corner is 5/√2 away from the cut.
    assert block.at((10.0, 10.0, 50.0)) == pytest.approx(5 / np.sqrt(2))


def test_an_outline_grows_from_station_to_station() -> None:
    cone = outline((0.0, SQUARE), (100.0, [(2 * x, 2 * y) for x, y in SQUARE]))
    areas = []
    x = np.linspace(-25, 25, 101)
    for z in (0.0, 50.0, 100.0):
        areas.append((cone.distance(x[None, :], x[:, None], z) <= 0).sum())
    assert areas[0] < areas[1] < areas[2]


def test_a_sheet_is_as_thick_as_its_stations_say() -> None:
    plate = sheet((0.0, [(-20.0, 0.0, 2.0), (20.0, 0.0, 4.0)]), (10.0, [(-20.0, 0.0, 2.0), (20.0, 0.0, 4.0)]))
    assert plate.at((-20.0, 5.0, 5.0)) == pytest.approx(3.0)
    assert plate.at((20.0, 5.0, 5.0)) == pytest.approx(1.0)
    assert plate.at((0.0, 3.0, 5.0)) == pytest.approx(0.0)
    assert plate.at((0.0, 0.0, 12.0)) == pytest.approx(2.0)


def test_a_sheet_bends_smoothly_through_its_points() -> None:
    line = [(-20.0, 0.0, 1.0), (0.0, 10.0, 1.0), (20.0, 0.0, 1.0)]
    arc = sheet((0.0, line), (10.0, line), smoothing=0.0)
    for x, y, _ in line:
        assert arc.at((x, y, 5.0)) == pytest.approx(-1.0)
    # In the middle of a segment the arc is outside the chord.
    assert arc.at((10.0, 6.5, 5.0)) < arc.at((10.0, 5.0, 5.0))


def test_a_shell_is_a_skin_on_the_surface() -> None:
    layer = shell(outline((0.0, SQUARE), (100.0, SQUARE)), 2.0, FAT, opacity=0.3)
    assert layer.opacity == 0.3
    assert layer.shape.at((10.0, 0.0, 50.0)) == pytest.approx(-1.0)
    assert layer.shape.at((0.0, 0.0, 50.0)) == pytest.approx(9.0)
    assert layer.shape.at((13.0, 0.0, 50.0)) == pytest.approx(2.0)
