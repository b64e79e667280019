"""Scans from arrays that other programs have written."""

import os
from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
import torch
from numpy.typing import NDArray

from pnpct.files.array_file import load_array
from pnpct.files.errors import PathLike
from pnpct.files.geometry_json import read_geometry
from pnpct.physics import BeamHardening, Scan
from pnpct.units import MU_WATER_70_KEV

Array = NDArray[Any]
_LARGEST_LINE_INTEGRAL = 50.0


def scan_from_arrays(
    array: PathLike | Array,
    geometry: PathLike | Mapping[str, Any],
    *,
    kind: Literal["line-integrals", "counts"] = "line-integrals",
    incident: float | PathLike | Array,
    electronic_noise: float = 0.0,
    mu_water: float = MU_WATER_70_KEV,
    beam_hardening: PathLike | Array | None = None,
    signal_per_quantum: float = 1.0,
) -> Scan:
    """Make a scan of measured counts or line integrals and a geometry written in JSON.

    Line integrals p become counts, incident · exp(−p). Arrays come from memory or from .npy and .npz
    files, a member of the latter chosen as in "scan.npz:counts".

    Args:
        array: Counts or line integrals, (views, bins), or a batch of them.
        geometry: The JSON file, or its content; the schema is that of `pnpct.files.geometry_json`.
        kind: What the array holds: "line-integrals" −ln(counts/incident), dimensionless, or "counts".
        incident: Counts expected without an object: one number, or an array of shape (bins,), (views, 1) or
            (views, bins), in the array's order.
        electronic_noise: Standard deviation of the electronic noise in a count, quanta.
        mu_water: Attenuation of water at the scan's effective energy, 1/mm.
        beam_hardening: Coefficients (bins, order + 1), in the array's order of bins, highest power first,
            that turn line integrals into those at the energy of `mu_water`; None if they are so already.
        signal_per_quantum: Signal of one quantum, in the unit of the counts and `incident`; 1 if these are in quanta.
            For an energy-integrating detector it is ⟨E²⟩/⟨E⟩ of the spectrum detected without an object.

    Returns:
        The scan, in quanta, float32.

    Raises:
        OSError: If a file is not there or cannot be read.
        FileFormatError: If a file is incomplete or not what it should be; wrong keys are named.
        ValueError: If shapes do not fit, or values are not finite or out of range.

    Example:
        >>> geometry = dict(source_to_isocenter_mm=541, source_to_detector_mm=949, bin_width_mm=1)
        >>> scan = scan_from_arrays(np.zeros((2, 3)), {**geometry, "bins": 3, "views": 2}, incident=1e5)
        >>> scan.counts[0].tolist()
        [100000.0, 100000.0, 100000.0]
    """
    written = read_geometry(geometry)
    name = "The array" if isinstance(array, np.ndarray) else str(array)
    values = _loaded(array)
    _check_shape(values.shape, written.geometry.shape, name)
    quanta = _incident(incident, written.geometry.shape, signal_per_quantum)
    counts = counts_of(values, quanta, name=name) if kind == "line-integrals" else values / signal_per_quantum
    if written.bins_reversed:
        counts = counts[..., ::-1]
        quanta = quanta[..., ::-1] if quanta.ndim else quanta
    return Scan(
        counts=as_float32(counts),
        incident=as_float32(quanta),
        electronic_noise=electronic_noise,
        geometry=written.geometry,
        mu_water=mu_water,
        beam_hardening=correction_of(beam_hardening, bins_reversed=written.bins_reversed),
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
    values = _loaded(coefficients)
    return BeamHardening(torch.from_numpy(values[::-1].copy() if bins_reversed else values))


def counts_of(line_integrals: Array, incident: Array, *, name: str) -> Array:
    """Return incident · exp(−p), in double precision.

    Args:
        line_integrals: p, dimensionless.
        incident: Counts without an object, quanta; broadcasts to the line integrals.
        name: Name of the line integrals in errors.

    Raises:
        ValueError: If these cannot be line integrals.
    """
    largest = float(np.abs(line_integrals).max(initial=0.0))
    if largest > _LARGEST_LINE_INTEGRAL:
        raise ValueError(
            f"{name} holds values as large as {largest:.6g}, no line integral; if these are counts, set kind to counts."
        )
    return np.asarray(incident * np.exp(-line_integrals.astype(np.float64)))


def as_float32(array: Array) -> torch.Tensor:
    """Return an array as a tensor of single precision."""
    return torch.from_numpy(np.array(array, dtype=np.float32, order="C"))


def _loaded(array: PathLike | Array) -> NDArray[np.float64]:
    """An array in double precision, checked to be finite wherever it comes from."""
    values = array if isinstance(array, np.ndarray) else load_array(array)
    if values.dtype.kind not in "fiu" or not np.isfinite(values).all():
        raise ValueError(f"Arrays of a scan must hold finite real numbers, got {values.dtype} of {values.shape}.")
    return values.astype(np.float64)


def _check_shape(shape: tuple[int, ...], needed: tuple[int, int], name: str) -> None:
    if shape[-2:] != needed:
        advice = "transpose it" if shape == needed[::-1] else "correct one of them"
        raise ValueError(
            f"{name} has the shape {shape}, but the geometry has {needed[0]} views and {needed[1]} bins; {advice}."
        )


def _incident(incident: float | PathLike | Array, shape: tuple[int, int], per_quantum: float) -> Array:
    """The incident counts, in quanta."""
    if not 0 < per_quantum < np.inf:
        raise ValueError(f"signal_per_quantum must be a positive number, got {per_quantum}.")
    if isinstance(incident, str | os.PathLike | np.ndarray):
        values = _loaded(incident)
    else:
        values = np.asarray(incident, dtype=np.float64)
    if values.shape not in ((), (shape[1],), (shape[0], 1), shape):
        raise ValueError(
            f"The incident counts must be one number or of the shape ({shape[1]},), ({shape[0]}, 1) or "
            f"{shape}, got {values.shape}."
        )
    if not (np.isfinite(values).all() and (values > 0).all()):
        raise ValueError(f"The incident counts must be positive and finite, got {values.min()} as the least.")
    return np.asarray(values / per_quantum)
