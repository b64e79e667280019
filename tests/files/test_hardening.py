"""Corrections of beam hardening in files that are damaged."""

import h5py
import numpy as np
import pytest

from pnpct.files import FileFormatError
from pnpct.files.hardening import read_hardening


@pytest.mark.parametrize("shape", [(3,), (2, 1, 3)])
@pytest.mark.parametrize("damaged", ["water", "bone"])
def test_coefficients_of_another_shape_are_refused(tmp_path, damaged, shape):
    with h5py.File(tmp_path / "scan.h5", "w") as file:
        file["water"], file["bone"] = np.array([[0.0, 1.0, 0.0]]), np.zeros((1, 6))
        file["bone"].attrs["compact_bone"] = 2.5
        assert read_hardening(file, water="water", bone="bone").bone.compact == 2.5
        del file[damaged]
        file[damaged] = np.ones(shape)
        if damaged == "bone":
            file["bone"].attrs["compact_bone"] = 2.5
        with pytest.raises(FileFormatError, match=f"{damaged} must hold one row of coefficients per bin"):
            read_hardening(file, water="water", bone="bone")
