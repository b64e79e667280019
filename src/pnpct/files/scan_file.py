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
    /truth/image                  the object, where it is known, with its grid as attributes

The root has the attributes format ("pnpct-scan"), format_version, description, provenance (JSON) and
mu_water_per_mm; each dataset has units and a description. Detector rows begin with the lowest.
"""

from pnpct.arrays import Image, Volume
from pnpct.files.errors import FileFormatError, PathLike
from pnpct.files.geometry_group import read_geometry_group, write_geometry_group
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
from pnpct.geometry import Grid
from pnpct.physics import BeamHardening, Scan

FORMAT = "pnpct-scan"


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
    with new_hdf5(path, file_format=FORMAT, provenance=provenance, description=description) as file:
        file.attrs["mu_water_per_mm"] = scan.mu_water
        write_array(file, "counts", scan.counts, units="quanta", description="what the detector counted")
        write_array(file, "incident", scan.incident, units="quanta", description="counts expected without an object")
        noise = file.create_dataset("electronic_noise", data=float(scan.electronic_noise))
        noise.attrs.update(units="quanta", description="standard deviation of the electronic noise in each count")
        write_geometry_group(file.create_group("geometry"), scan.geometry)
        if scan.beam_hardening is not None:
            coefficients = scan.beam_hardening.coefficients.detach().cpu().numpy()
            dataset = file.create_dataset("beam_hardening/coefficients", data=coefficients)
            meaning = "polynomials, highest power first, from measured line integrals to those of one energy"
            dataset.attrs.update(units="1", description=meaning)
        if truth is not None:
            write_image_dataset(file.create_group("truth"), *truth, description="the object that was scanned")


def read_scan(path: PathLike) -> Scan:
    """Read a scan; its tensors are on the CPU.

    Raises:
        OSError: If there is no such file or it cannot be read.
        FileFormatError: If it is not a complete scan that fits together; the sentence says what is wrong.
    """
    with open_hdf5(path, formats=(FORMAT,)) as file:
        geometry = read_geometry_group(group_of(file, "geometry"))
        counts = read_array(file, "counts")
        if tuple(counts.shape[counts.ndim - len(geometry.shape) :]) != geometry.shape:
            raise FileFormatError(
                f"the counts have the shape {tuple(counts.shape)}, but the geometry is for {geometry.shape}."
            )
        noise = read_array(file, "electronic_noise")
        if noise.ndim:
            raise FileFormatError(f"/electronic_noise must be one number, got the shape {tuple(noise.shape)}.")
        hardening = None
        if "beam_hardening" in file:
            hardening = BeamHardening(read_array(group_of(file, "beam_hardening"), "coefficients"))
        return Scan(
            counts=counts,
            incident=read_array(file, "incident"),
            electronic_noise=float(noise),
            geometry=geometry,
            mu_water=number_of(file, "mu_water_per_mm"),
            beam_hardening=hardening,
        )


def read_truth(path: PathLike) -> tuple[Image | Volume, Grid] | None:
    """Read the object that was scanned, and its grid; None where it is not known.

    Raises:
        OSError: If there is no such file or it cannot be read.
        FileFormatError: If it is not a scan, or its truth is incomplete.
    """
    with open_hdf5(path, formats=(FORMAT,)) as file:
        return read_image_dataset(group_of(file, "truth")) if "truth" in file else None
