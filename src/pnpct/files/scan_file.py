"""Scans on disk: one HDF5 file that anybody can read with h5py.

    /counts                       (..., views, bins) or (..., views, detector_rows, bins) float32, quanta
    /incident                     float32, quanta: one number, (bins), (views, 1) or (views, bins); with detector rows
                                  whatever broadcasts to (views, detector_rows, bins)
    /electronic_noise             float64, quanta, standard deviation
    /geometry                     attributes: source_to_isocenter_mm, source_to_detector_mm, bin_width_mm,
                                  detector_offset_bins, bins, detector ("arc" or "flat"); of a cone beam also
                                  detector_rows, row_height_mm (at the detector), row_offset_rows
    /geometry/view_angles         (views) float64, rad
    /geometry/z                   (views) float64, mm, height of each view; only of a cone beam, 0 if it is absent
    /geometry/focal_spot_shifts   (views, 2) float64, mm, of a cone beam (views, 3); only if the focal spot moves
    /beam_hardening/coefficients  (bins, order + 1); only if there is a correction
    /beam_hardening/bone          (bins, 6), what it lacks behind bone; only if that is known
    /truth/image                  the object, where it is known, with its grid as attributes

The root has the attributes format ("pnpct-scan"), format_version, description, provenance (JSON) and
mu_water_per_mm; each dataset has units and a description. Detector rows begin with the lowest.
"""

from collections.abc import Callable, Iterable

import h5py
from torch import Tensor

from pnpct.arrays import Image, Volume
from pnpct.files.errors import FileFormatError, PathLike
from pnpct.files.geometry_group import read_geometry_group, write_geometry_group
from pnpct.files.hardening import read_hardening, write_hardening
from pnpct.files.hdf5 import (
    group_of,
    new_array,
    new_hdf5,
    number_of,
    open_hdf5,
    read_array,
    read_image_dataset,
    write_image_dataset,
)
from pnpct.files.provenance import Provenance
from pnpct.geometry import Geometry, Grid
from pnpct.physics import Scan

SCAN = "pnpct-scan"


def write_scan(
    path: PathLike,
    scan: Scan,
    *,
    provenance: Provenance,
    truth: tuple[Image | Volume, Grid] | None = None,
    description: str = "",
) -> None:
    """Write a scan, and the object that was scanned where it is known.

    Counts, incident quanta and images become float32; all else keeps its precision.

    Args:
        path: File to write; an existing one is replaced.
        scan: The scan.
        provenance: How it was made.
        truth: The object, relative to water, and its grid.
        description: What a reader should know, in words.

    Raises:
        OSError: If the file cannot be written.
        ValueError: If the truth does not fit its grid.
    """
    with new_hdf5(path, file_format=SCAN, provenance=provenance, description=description) as file:
        _fill(file, scan.geometry, [scan])
        if truth is not None:
            write_image_dataset(file.create_group("truth"), *truth, description="the object that was scanned")


def write_scan_slabs(
    path: PathLike,
    geometry: Geometry,
    slabs: Iterable[Scan],
    *,
    provenance: Provenance | Callable[[], Provenance],
    description: str = "",
) -> None:
    """Write a scan of which only a few views at a time need to be in memory; the file is that of `write_scan`.

    Args:
        path: File to write; an existing one is replaced.
        geometry: Where all rays are.
        slabs: The scan in pieces of consecutive views, from the first view to the last.
        provenance: How it was made; or a function that says so after the last slab.
        description: What a reader should know, in words.

    Raises:
        OSError: If the file cannot be written.
        ValueError: If the slabs are not pieces of one scan with this geometry.
    """
    with new_hdf5(path, file_format=SCAN, provenance=provenance, description=description) as file:
        _fill(file, geometry, slabs)


def _fill(file: h5py.File, geometry: Geometry, slabs: Iterable[Scan]) -> None:
    write_geometry_group(file.create_group("geometry"), geometry)
    axis, done, first = -len(geometry.shape), 0, None
    for slab in slabs:
        after = done + slab.geometry.views
        if after > geometry.views or slab.geometry != geometry[done:after]:
            raise ValueError(f"A slab of the views {done} to {after - 1} was needed, got one with another geometry.")
        if first is None:
            first = slab
            _begin(file, slab, views=geometry.views)
        part = (..., slice(done, after), *[slice(None)] * (-axis - 1))
        file["counts"][part] = slab.counts.detach().cpu().numpy()
        if per_view := _per_view(file["incident"].shape, geometry.shape):
            file["incident"][part] = slab.incident.detach().cpu().numpy()
        if _of_all_views(slab, per_view) != _of_all_views(first, per_view):
            raise ValueError("The slabs of a scan must agree in all but their views, but the later ones differ.")
        done = after
    if done != geometry.views:
        raise ValueError(f"The slabs must have all {geometry.views} views, got {done}.")


def _begin(file: h5py.File, scan: Scan, *, views: int) -> None:
    """Store what is not of a view, and make room for what is."""
    file.attrs["mu_water_per_mm"] = scan.mu_water
    axis = -len(scan.geometry.shape)

    def room(name: str, values: Tensor, description: str) -> h5py.Dataset:
        shape = list(values.shape)
        if _per_view(tuple(shape), scan.geometry.shape):
            shape[axis] = views
        return new_array(file, name, tuple(shape), units="quanta", description=description)

    room("counts", scan.counts, "what the detector counted")
    incident = room("incident", scan.incident, "counts expected without an object")
    if incident.shape == tuple(scan.incident.shape):
        incident[()] = scan.incident.detach().cpu().numpy()
    noise = file.create_dataset("electronic_noise", data=float(scan.electronic_noise))
    noise.attrs.update(units="quanta", description="standard deviation of the electronic noise in each count")
    if scan.beam_hardening is not None:
        write_hardening(file.create_group("beam_hardening"), scan.beam_hardening, water="coefficients", bone="bone")


def _per_view(shape: tuple[int, ...], of_rays: tuple[int, ...]) -> bool:
    """Whether an array that broadcasts to the rays has an entry for each view."""
    return len(shape) >= len(of_rays) and shape[-len(of_rays)] == of_rays[0]


def _of_all_views(scan: Scan, per_view: bool) -> tuple[object, ...]:
    """What must be the same in all slabs of a scan."""
    hardening = scan.beam_hardening
    of_water = hardening.coefficients.tolist() if hardening else None
    of_bone = hardening.bone.coefficients.tolist() if hardening and hardening.bone else None
    return scan.mu_water, scan.electronic_noise, of_water, of_bone, None if per_view else scan.incident.tolist()


def read_scan(path: PathLike, *, views: slice = slice(None)) -> Scan:
    """Read a scan, or some views of it; its tensors are on the CPU.

    Args:
        path: The file.
        views: Which views to read, for scans that are larger than the memory; its step must be positive.

    Raises:
        OSError: If there is no such file or it cannot be read.
        FileFormatError: If it is not a complete scan that fits together, or has none of the views.
    """
    with open_hdf5(path, formats=(SCAN,)) as file:
        geometry = read_geometry_group(group_of(file, "geometry"), views)
        shape = (len(file["geometry/view_angles"]), *geometry.shape[1:])
        part = (..., views, *[slice(None)] * (len(shape) - 1))
        counts = read_array(file, "counts", part)
        if file["counts"].shape[-len(shape) :] != shape:
            raise FileFormatError(f"the counts have the shape {file['counts'].shape}, but the geometry is for {shape}.")
        noise = read_array(file, "electronic_noise")
        if noise.ndim:
            raise FileFormatError(f"/electronic_noise must be one number, got the shape {tuple(noise.shape)}.")
        hardening = None
        if "beam_hardening" in file:
            hardening = read_hardening(group_of(file, "beam_hardening"), water="coefficients", bone="bone")
        incident = file.get("incident")
        per_view = isinstance(incident, h5py.Dataset) and _per_view(incident.shape or (), shape)
        return Scan(
            counts=counts,
            incident=read_array(file, "incident", part if per_view else ()),
            electronic_noise=float(noise),
            geometry=geometry,
            mu_water=number_of(file, "mu_water_per_mm"),
            beam_hardening=hardening,
        )


def read_scan_geometry(path: PathLike) -> Geometry:
    """Read where the rays of a scan are, and nothing else.

    Raises:
        OSError: If there is no such file or it cannot be read.
        FileFormatError: If it is not a scan, or its geometry does not fit together.
    """
    with open_hdf5(path, formats=(SCAN,)) as file:
        return read_geometry_group(group_of(file, "geometry"))


def read_truth(path: PathLike) -> tuple[Image | Volume, Grid] | None:
    """Read the object that was scanned, and its grid; None where it is not known.

    Raises:
        OSError: If there is no such file or it cannot be read.
        FileFormatError: If it is not a scan, or its truth is incomplete.
    """
    with open_hdf5(path, formats=(SCAN,)) as file:
        return read_image_dataset(group_of(file, "truth")) if "truth" in file else None
