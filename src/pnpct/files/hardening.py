"""Beam-hardening corrections in HDF5: a dataset for water and, where it is known, one for bone."""

import h5py
from jaxtyping import Float
from torch import Tensor

from pnpct.files.errors import FileFormatError
from pnpct.files.hdf5 import number_of, read_array
from pnpct.physics import BeamHardening, BoneHardening

_OF_WATER = "polynomials, highest power first, from measured line integrals to those of one energy"
_OF_BONE = "what line integrals lack behind bone: q (c0 + c1 p + c2 q + c3 p^2 + c4 p q + c5 q^2)"


def write_hardening(group: h5py.Group, hardening: BeamHardening, *, water: str, bone: str) -> None:
    """Write a correction as datasets with these names."""
    of_water = group.create_dataset(water, data=hardening.coefficients.detach().cpu().numpy())
    of_water.attrs.update(units="1", description=_OF_WATER)
    if hardening.bone is not None:
        of_bone = group.create_dataset(bone, data=hardening.bone.coefficients.detach().cpu().numpy())
        of_bone.attrs.update(units="1", description=_OF_BONE, compact_bone=hardening.bone.compact)


def read_hardening(group: h5py.Group, *, water: str, bone: str) -> BeamHardening | None:
    """Read a correction; None where there is none.

    Raises:
        FileFormatError: If it is incomplete, or an array has another shape.
        ValueError: If it cannot be one.
    """
    if water not in group:
        return None
    of_bone = None
    if bone in group:
        of_bone = BoneHardening(_rows(group, bone), compact=number_of(group[bone], "compact_bone"))
    return BeamHardening(_rows(group, water), of_bone)


def _rows(group: h5py.Group, name: str) -> Float[Tensor, "bins coefficients"]:
    values = read_array(group, name)
    if values.ndim != 2:
        raise FileFormatError(
            f"{group.name}/{name} must hold one row of coefficients per bin, or one for all, got the shape "
            f"{tuple(values.shape)}."
        )
    return values
