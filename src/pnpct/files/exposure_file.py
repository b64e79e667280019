"""Exposures as HDF5: one slice at several tube voltages, from which scans are drawn later.

    /geometry                       as in a scan's file
    /120 kVp/signal_mean            S1, views x bins                     for 1 mAs in each view
    /120 kVp/signal_variance        S2, views x bins
    /120 kVp/air_mean, air_variance the same without object, one per bin
    /120 kVp/beam_hardening         coefficients, bins x powers, highest power first
    /120 kVp/bone_hardening         what it lacks behind bone, bins x 6
    /120 kVp/truth                  the object at the effective energy, where it is known, with its grid

Each voltage has the attributes mu_water_per_mm and electronic_noise. S1 and S2 have 13 bits after the leading one:
that is 6e-5 of their value, far below the noise of any scan, and makes the files half as large.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from pnpct.arrays import Image
from pnpct.files.errors import FileFormatError, PathLike
from pnpct.files.geometry_group import read_geometry_group, write_geometry_group
from pnpct.files.hardening import read_hardening, write_hardening
from pnpct.files.hdf5 import (
    group_of,
    new_hdf5,
    number_of,
    open_hdf5,
    read_array,
    read_image_dataset,
    write_array,
    write_image_dataset,
)
from pnpct.files.provenance import Provenance
from pnpct.files.rounding import rounded
from pnpct.geometry import ImageGrid, require_fan_beam, require_image_grid
from pnpct.geometry.short_repr import short_repr
from pnpct.physics import TUBE_VOLTAGE_KVP, Exposure, Moments

FORMAT = "pnpct-exposures"
_KEPT_BITS = 13
_MEANINGS = {
    "signal_mean": "mean signal of each ray",
    "signal_variance": "variance of the signal by the photons",
    "air_mean": "mean signal without an object",
    "air_variance": "its variance by the photons",
}


@dataclass(frozen=True, eq=False)
class ExposedSlice:
    """A slice at one tube voltage, and the truth.

    Args:
        exposure: All that is needed to draw its scans.
        truth: The object at the effective energy, relative to water; None where it is not known.
        grid: Where the pixels of the truth are; None without a truth.
    """

    exposure: Exposure
    truth: Image | None = None
    grid: ImageGrid | None = None

    __repr__ = short_repr


def write_exposures(
    path: PathLike, slices: Mapping[float, ExposedSlice], *, provenance: Provenance, description: str = ""
) -> None:
    """Write the exposures of one slice.

    Args:
        path: File to write; an existing one is replaced.
        slices: By tube voltage in kVp, all with one geometry.
        provenance: How they were made.
        description: What a reader should know, in words.

    Raises:
        OSError: If the file cannot be written.
        ValueError: If there are none, their geometries differ, or a truth does not fit its grid.
    """
    geometries = {each.exposure.geometry for each in slices.values()}
    if len(geometries) != 1:
        raise ValueError(f"The exposures in one file have one geometry, got {len(geometries)}.")
    with new_hdf5(path, file_format=FORMAT, provenance=provenance, description=description) as file:
        write_geometry_group(file.create_group("geometry"), geometries.pop())
        for voltage, each in slices.items():
            exposure, group = each.exposure, file.create_group(f"{voltage:g} kVp")
            group.attrs.update(mu_water_per_mm=exposure.mu_water, electronic_noise=exposure.moments.electronic_noise)
            for name, meaning in _MEANINGS.items():
                units = "signal" if name.endswith("mean") else "signal squared"
                values = rounded(getattr(exposure.moments, name), bits=_KEPT_BITS)
                write_array(group, name, values, units=units, description=meaning)
            if exposure.beam_hardening is not None:
                write_hardening(group, exposure.beam_hardening, water="beam_hardening", bone="bone_hardening")
            if each.truth is not None and each.grid is not None:
                meaning = "the object at the effective energy"
                write_image_dataset(group.create_group("truth"), each.truth, each.grid, description=meaning)


def read_exposure(path: PathLike, *, tube_voltage_kvp: float = TUBE_VOLTAGE_KVP) -> ExposedSlice:
    """Read a slice at one tube voltage; its tensors are on the CPU.

    Raises:
        OSError: If there is no such file or it cannot be read.
        FileFormatError: If it is not a complete file of exposures, or has none at this voltage.
    """
    with open_hdf5(path, formats=(FORMAT,)) as file:
        voltages = [name for name in file if name.endswith(" kVp")]
        name = f"{tube_voltage_kvp:g} kVp"
        if name not in voltages:
            raise FileFormatError(f"there is no exposure at {name} in this file; there are {', '.join(voltages)}.")
        group = group_of(file, name)
        moments = Moments(
            **{part: read_array(group, part) for part in _MEANINGS},
            electronic_noise=number_of(group, "electronic_noise"),
        )
        hardening = read_hardening(group, water="beam_hardening", bone="bone_hardening")
        geometry = require_fan_beam(read_geometry_group(group_of(file, "geometry")))
        if tuple(moments.signal_mean.shape[-2:]) != geometry.shape:
            raise FileFormatError(
                f"the moments have the shape {tuple(moments.signal_mean.shape)}, the geometry is for {geometry.shape}."
            )
        exposure = Exposure(moments, geometry, number_of(group, "mu_water_per_mm"), hardening)
        if "truth" not in group:
            return ExposedSlice(exposure)
        truth, grid = read_image_dataset(group_of(group, "truth"))
        return ExposedSlice(exposure, truth, require_image_grid(grid))


def tube_voltages(path: PathLike) -> tuple[float, ...]:
    """Return the tube voltages in a file of exposures, kVp.

    Raises:
        OSError: If there is no such file or it cannot be read.
        FileFormatError: If it is not a file of exposures.
    """
    with open_hdf5(path, formats=(FORMAT,)) as file:
        return tuple(sorted(float(name.removesuffix(" kVp")) for name in file if name.endswith(" kVp")))


def exposure_pixel(path: PathLike) -> float | None:
    """Return the spacing of the pixels of the truth in a file of exposures, mm, the least of all voltages, or None.

    Raises:
        OSError: If there is no such file or it cannot be read.
        FileFormatError: If it is not a file of exposures.
    """
    with open_hdf5(path, formats=(FORMAT,)) as file:
        known = [group_of(group_of(file, name), "truth")["image"] for name in file if f"{name}/truth" in file]
        return min((number_of(image, "spacing_mm") for image in known), default=None)
