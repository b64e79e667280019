"""Scans from arrays that other programs have written."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch

from pnpct.files.errors import PathLike
from pnpct.files.geometry_json import read_geometry
from pnpct.files.measured_rays import (
    Array,
    Kind,
    incident_of,
    loaded,
    measured_rays,
    offset_of_air,
    quanta_of,
    without_faults,
)
from pnpct.files.plausible import doubt_of
from pnpct.physics import BeamHardening, Scan
from pnpct.units import MU_WATER_70_KEV

_LARGEST_COUNT = 1e18
"""More than any detector counts; its square is a number in single precision too."""


@dataclass(frozen=True, eq=False)
class ImportedScan:
    """A scan made of arrays, and what was assumed of them.

    Args:
        scan: The scan.
        notes: What was assumed, in sentences.
    """

    scan: Scan
    notes: Sequence[str] = ()


def scan_from_arrays(array: PathLike | Array, geometry: PathLike | Mapping[str, Any], **options: Any) -> Scan:
    """Make a scan of arrays, as `import_arrays` does, without the notes.

    Args:
        array: Counts or line integrals.
        geometry: Geometry of the scan.
        **options: As for `import_arrays`.

    Raises:
        OSError: If a file is not there or cannot be read.
        ValueError: As `import_arrays`.

    Example:
        >>> geometry = dict(source_to_isocenter_mm=541, source_to_detector_mm=949, bin_width_mm=1)
        >>> scan = scan_from_arrays(np.zeros((2, 3)), {**geometry, "bins": 3, "views": 2}, incident=1e5)
        >>> scan.counts[0].tolist()
        [100000.0, 100000.0, 100000.0]
    """
    return import_arrays(array, geometry, **options).scan


def import_arrays(
    array: PathLike | Array,
    geometry: PathLike | Mapping[str, Any],
    *,
    kind: Kind = "line-integrals",
    incident: float | PathLike | Array | None = None,
    mask: PathLike | Array | None = None,
    electronic_noise: float = 0.0,
    mu_water: float = MU_WATER_70_KEV,
    beam_hardening: PathLike | Array | None = None,
    signal_per_quantum: float = 1.0,
    insist: bool = False,
) -> ImportedScan:
    """Make a scan of measured counts or line integrals and a geometry written in JSON.

    Line integrals p become counts, incident · exp(−p). Arrays come from memory or from .npy, .npz
    and .mat files, a member chosen as in "scan.npz:counts". Rays that are NaN, masked, or without incident counts
    were not measured, nor were cells and views that counted nothing but noise, cells that are stuck at one value, and
    rays of no count among many: their incident counts become 0.
    Views in which nothing was measured are left out.

    Args:
        array: Counts or line integrals, (views, bins), or a batch of them.
        geometry: The JSON file, or its content; the schema is that of `pnpct.files.geometry_json`. Or a .mat file of
            HelTomo.
        kind: What the array holds: "line-integrals" −ln(counts/incident), dimensionless, or "counts". Where no count
            exceeds 2, they are taken for transmissions counts/incident.
        incident: Counts expected without an object: one number, or an array of shape (bins,), (views, 1) or
            (views, bins), in the array's order. Where they are not known, or at most 2, the incident counts of line
            integrals and of transmissions are estimated from the noise, and so where they would have far more noise
            than there is; FBP does not depend on them.
        mask: 0 where a ray was not measured, of the same shapes; None if all were.
        electronic_noise: Standard deviation of the electronic noise in a count, quanta.
        mu_water: Attenuation of water at the scan's effective energy, 1/mm.
        beam_hardening: Coefficients (bins, order + 1), in the array's order of bins, highest power first,
            that turn line integrals into those at the energy of `mu_water`; None if they are so already.
        signal_per_quantum: Signal of one quantum, in the unit of the counts and `incident`; 1 if these are in quanta.
            For an energy-integrating detector it is ⟨E²⟩/⟨E⟩ of the spectrum detected without an object.
        insist: Whether numbers are taken that look like a mistake (`pnpct.files.plausible`).

    Returns:
        The scan, in quanta, float32, and what was assumed.

    Raises:
        OSError: If a file is not there or cannot be read.
        FileFormatError: If a file is incomplete or not what it should be; wrong keys are named.
        ValueError: If shapes do not fit, or values are infinite, out of range or unusual.
    """
    written = read_geometry(geometry)
    shape, name = written.geometry.shape, "The array" if isinstance(array, np.ndarray) else str(array)
    values = loaded(array, nan=True)
    _check_shape(values.shape, shape, name)
    given = None if incident is None else incident_of(incident, shape, signal_per_quantum)
    measured = measured_rays(values, given, mask, shape, insist=insist)
    counts, quanta, notes = quanta_of(
        values, given, measured, kind, name=name, per_quantum=signal_per_quantum, insist=insist
    )
    _check_largest(quanta)
    with np.errstate(all="ignore"):  # what cannot be is refused below
        offset = offset_of_air(np.where(measured, np.log(quanta / counts), np.nan))
    if offset:
        notes = [*notes, _OFFSET_SAID.format(offset, np.exp(offset))]
    measured, faults = without_faults(measured, counts, quanta, electronic_noise)
    if not measured.all():
        of_bins = (measured == measured[0]).all()
        counts, quanta = np.where(measured, counts, 0.0), np.where(measured[0] if of_bins else measured, quanta, 0.0)
    if written.bins_reversed:
        counts = counts[..., ::-1]
        quanta = quanta[..., ::-1] if quanta.ndim else quanta
    scan = Scan(
        counts=as_float32(counts),
        incident=as_float32(quanta),
        electronic_noise=electronic_noise,
        geometry=written.geometry,
        mu_water=mu_water,
        beam_hardening=correction_of(beam_hardening, bins_reversed=written.bins_reversed),
    )
    if not insist and (doubt := doubt_of(scan)):
        raise ValueError(f"This scan has {doubt} If it is meant, insist on it (--insist).")
    views = np.flatnonzero(measured.any(axis=1))
    return ImportedScan(scan if len(views) == len(measured) else scan[views], (*notes, *faults))


_OFFSET_SAID = (
    "Rays at both ends of the fan have line integrals of {0:.3g} in all views. If they pass through air alone, the "
    "incident counts are {1:.3g} times those of this scan: give its own (--incident), or subtract {0:.3g} from the "
    "line integrals."
)


def correction_of(coefficients: PathLike | Array | None, *, bins_reversed: bool = False) -> BeamHardening | None:
    """Make a beam-hardening correction of an array or a NumPy file; None stays None.

    Args:
        coefficients: (bins, order + 1), or (1, order + 1) for all bins; highest power first.
        bins_reversed: Whether to reverse the order of the bins.

    Raises:
        OSError: If a file is not there or cannot be read.
        ValueError: If the coefficients are not such an array.
    """
    if coefficients is None:
        return None
    values = loaded(coefficients)
    return BeamHardening(torch.from_numpy(values[::-1].copy() if bins_reversed else values))


def as_float32(array: Array) -> torch.Tensor:
    """Return an array of counts as a tensor of single precision.

    Raises:
        ValueError: If a number is larger than any count.
    """
    _check_largest(array)
    return torch.from_numpy(np.array(array, dtype=np.float32, order="C"))


def _check_largest(array: Array) -> None:
    largest = float(np.abs(array).max(initial=0.0))
    if largest > _LARGEST_COUNT:
        raise ValueError(f"A scan has counts of up to {_LARGEST_COUNT:g}, got {largest:.6g}.")


def _check_shape(shape: tuple[int, ...], needed: tuple[int, int], name: str) -> None:
    if shape[-2:] != needed:
        advice = "transpose it" if shape == needed[::-1] else "correct one of them"
        raise ValueError(
            f"{name} has the shape {shape}, but the geometry has {needed[0]} views and {needed[1]} bins; {advice}."
        )
