import numpy as np
import pytest

from pnpct.evaluation import EyeFilter


def test_the_eye_has_its_peak_at_one() -> None:
    for eye in (EyeFilter(), EyeFilter(zoom=3.0), EyeFilter(decay=3.22)):
        values = eye(np.linspace(0, 5, 20001))
        assert values.max() == pytest.approx(1.0, abs=1e-4)
        assert values[0] == 0.0


def test_zoom_moves_the_eye_to_higher_frequencies_of_the_patient() -> None:
    f = np.linspace(0.01, 2, 50)
    assert EyeFilter(zoom=2.0)(2 * f) == pytest.approx(EyeFilter()(f), rel=1e-12)
    assert EyeFilter(distance=1000.0)(f / 2) == pytest.approx(EyeFilter()(f), rel=1e-12)


def test_impossible_readers_are_refused() -> None:
    with pytest.raises(ValueError, match="zoom"):
        EyeFilter(zoom=0.0)
