"""Work that falls into parts, in the order in which it was given."""

import math

import pytest

from pnpct.operators.processes import AHEAD, in_order, side_by_side


def test_results_come_in_order_and_few_calls_are_ahead_of_them():
    given = []

    def calls():
        for number in range(3 * AHEAD):
            given.append(number)
            yield (float(number**2),)

    for number, root in enumerate(in_order(math.sqrt, calls(), processes=1)):
        assert root == number
        assert len(given) == min(number + AHEAD, 3 * AHEAD)
    assert number == 3 * AHEAD - 1


@pytest.mark.parametrize("share", [in_order, side_by_side])
def test_errors_of_a_call_are_those_of_the_work(share):
    with pytest.raises(ValueError, match=r"math domain error|expected a nonnegative"):
        list(share(math.sqrt, [(4.0,), (-1.0,)], processes=1))
