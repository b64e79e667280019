import pytest

from pnpct.report.axes import Axis, fitted


def test_the_ends_of_an_axis_are_at_its_ends():
    for log in (False, True):
        axis = Axis(2.0, 50.0, 100.0, 20.0, log=log)
        assert (axis.at(2.0), axis.at(50.0)) == (100.0, 20.0)
        assert axis.at(1.0) == 100.0  # what is beyond stays at the end
    assert Axis(1.0, 100.0, 0.0, 10.0, log=True).at(10.0) == 5.0
    assert Axis(0.0, 100.0, 0.0, 10.0).at(10.0) == 1.0


@pytest.mark.parametrize("values", [[3.0, 7.0], [-92.0, 160.0], [-50.0, -2.0], [0.0], [], [1e-4, 3e-4], [346200.0]])
@pytest.mark.parametrize("log", [False, True])
def test_a_fitted_axis_holds_all_values_and_a_few_round_ticks(values, log):
    axis = fitted(values, (0.0, 400.0), log=log)
    for value in values:
        if value > 0 or not log:
            assert axis.low <= value <= axis.high
    assert 1 <= len(axis.ticks) <= 12
    places = [tick.place for tick in axis.ticks]
    assert places == sorted(places)
    assert all(0.0 <= place <= 400.0 for place in places)
    assert len({tick.text for tick in axis.ticks}) == len(places)


def test_a_linear_axis_holds_0_unless_told_otherwise():
    assert fitted([50.0, 60.0], (0.0, 1.0)).low == 0.0
    assert fitted([50.0, 60.0], (0.0, 1.0), zero=False).low > 40.0
