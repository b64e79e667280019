"""The window of a PNG at the command line."""

import numpy as np
import pytest
from PIL import Image as Picture

from pnpct.files import read_image
from pnpct.units import to_hu


def test_a_png_shows_the_window_that_is_asked_for(run, made, tmp_path):
    given = "denoise", made / "image.h5", tmp_path / "bone.png", "--denoiser", "gaussian", "--strength", "0"
    assert run(*given, "--window", "400", "2000")[0] == 0
    with Picture.open(tmp_path / "bone.png") as picture:
        shown = np.asarray(picture)
    hu = to_hu(read_image(made / "image.h5")[0].double()).numpy()
    np.testing.assert_array_equal(shown, np.rint(255 * ((hu - 400) / 2000 + 0.5).clip(0, 1)))


@pytest.mark.parametrize(
    ("name", "window", "said"),
    [
        ("image.h5", ("40", "400"), "--window is for .png"),
        ("image.png", ("40", "0"), "a positive width"),
        ("image.png", ("40",), "--window"),
    ],
)
def test_a_window_that_cannot_be_is_refused(name, window, said, run, made, tmp_path):
    status, out, err = run("denoise", made / "image.h5", tmp_path / name, "--window", *window)
    assert (status, out) == (2, "")
    assert said in err
    assert err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []
