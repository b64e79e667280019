"""What arrays of other programs say of each ray: whether it was measured, its counts and its incident counts."""

import os
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from pnpct.files.array_file import load_array
from pnpct.files.errors import PathLike
from pnpct.physics import MOST_QUANTA, dead_cells, estimate_incident, lost_readings, stuck_cells

Array: TypeAlias = NDArray[Any]
Kind: TypeAlias = Literal["line-integrals", "counts"]
_LARGEST_LINE_INTEGRAL = 50.0
_LARGEST_TRANSMISSION = 2.0
_LEAST_TRANSMISSION = 1e-6
_NO_COUNT = 1e-30
_STEADY = 0.1
"""Counts of rays that pass the object differ by no more over the views, relative to their median."""

_LEAST_AIR = 0.2
"""Line integrals of air are below."""

_OFFSET = 0.03
"""Line integrals of air that noise and a few scattered photons do not make."""

_BLOCKS, _END = 8, 50
"""Parts of the views, and of the bins, of which each has the same offset."""

_USED = 0.5
"""A mask leaves more of the rays."""

_ENOUGH_COUNTS = 40.0
"""Where the logarithm needs no correction for noise, so that a wrong unit of the counts does not matter."""

_DARKEST = 0.05
"""Share of the rays that are the darkest ones."""

_ENOUGH_RAYS = 1000
"""To say what their noise is."""

_LESS_NOISE = 30.0
"""How many times more quanta the noise may speak of than there were: smoothing makes it some ten times."""


def counts_of(line_integrals: Array, incident: Array, *, name: str) -> Array:
    """Return incident · exp(−p), in double precision.

    Args:
        line_integrals: p, dimensionless.
        incident: Counts without an object, quanta; broadcasts to the line integrals.
        name: Name of the line integrals in errors.

    Raises:
        ValueError: If these cannot be line integrals.
    """
    largest = float(np.nanmax(np.abs(line_integrals), initial=0.0))
    if largest > _LARGEST_LINE_INTEGRAL:
        raise ValueError(
            f"{name} holds values as large as {largest:.6g}, no line integral; if these are counts, set kind to counts."
        )
    return np.asarray(incident * np.exp(-line_integrals.astype(np.float64)))


def loaded(array: PathLike | Array, *, nan: bool = False) -> NDArray[np.float64]:
    """Return an array in double precision, checked to be finite (or NaN) wherever it comes from."""
    values = array if isinstance(array, np.ndarray) else load_array(array, nan=nan)
    real = values.dtype.kind in ("fiub" if nan else "fiu")
    if not real or (np.isinf(values) if nan else ~np.isfinite(values)).any():
        raise ValueError(f"Arrays of a scan must hold finite real numbers, got {values.dtype} of {values.shape}.")
    with np.errstate(invalid="ignore"):  # a NaN may be one that signals
        return values.astype(np.float64)


def incident_of(incident: float | PathLike | Array, shape: tuple[int, int], per_quantum: float) -> Array:
    """Return the incident counts, in quanta; 0 where a ray was not measured."""
    if not 0 < per_quantum < np.inf:
        raise ValueError(f"signal_per_quantum must be a positive number, got {per_quantum}.")
    if isinstance(incident, str | os.PathLike | np.ndarray):
        values = np.nan_to_num(_for_rays(incident, shape, "incident counts"))
    else:
        values = np.asarray(incident, dtype=np.float64)
    if not (np.isfinite(values).all() and (values >= 0).all() and values.any()):
        raise ValueError(
            "The incident counts must be positive and finite, or 0 where a ray was not measured, got "
            f"{values.min():.6g} to {values.max():.6g}."
        )
    return np.asarray(values / per_quantum)


def measured_rays(
    values: Array,
    incident: Array | None,
    mask: PathLike | Array | None,
    shape: tuple[int, int],
    *,
    insist: bool = False,
) -> Array:
    """Return whether each ray was measured, (views, bins): not if it is NaN, masked, or has no incident counts.

    A mask that leaves out most of the rays is refused as one the wrong way round, unless the user insists.
    """
    measured: Array = np.logical_not(np.isnan(values).reshape(-1, *shape).any(axis=0))
    if incident is not None:
        measured &= incident > 0
    if mask is not None:
        used = np.broadcast_to(np.nan_to_num(_for_rays(mask, shape, "mask")) != 0, shape)
        if not insist and 0 < used.mean() < _USED:
            raise ValueError(
                f"The mask leaves {used.sum()} of {used.size} rays: is it the wrong way round? It has a 0 where a ray "
                "was not measured; if it is meant, insist on it (--insist)."
            )
        measured &= used
    if not measured.any():
        raise ValueError(
            "No ray was measured: all are NaN, without incident counts, or 0 in the mask; give those that were a 1."
        )
    return measured


def quanta_of(
    values: Array, given: Array | None, measured: Array, kind: Kind, *, name: str, per_quantum: float, insist: bool
) -> tuple[Array, Array, list[str]]:
    """Return counts and incident counts in quanta, and what was assumed; counts are any where not measured.

    Incident counts whose noise would be far more than there is, with few counts in the darkest ray, are scaled to what
    the noise says, unless the user insists.
    """
    known, notes = values[..., measured], []
    unknown, counted = given is None or float(given.max()) <= _LARGEST_TRANSMISSION, False
    if kind == "line-integrals":
        if not insist and _are_counts(values):
            raise ValueError(
                f"{name} holds values up to {known.max():.3g} that are steady at both ends of the fan and less "
                "between, as counts or transmissions counts/incident are; set kind to counts, or insist on line "
                "integrals (--insist)."
            )
        transmissions = counts_of(np.where(measured, values, 0.0), np.asarray(1.0), name=name)
    elif given is None:
        raise ValueError("Counts need their incident counts, those expected without an object; give incident.")
    elif 0 < float(known.max()) <= _LARGEST_TRANSMISSION:
        transmissions = values / (per_quantum * np.where(given > 0, given, 1.0)) if unknown else values
        notes = [f"The largest count is {known.max():.4g}: the counts were taken for transmissions, counts/incident."]
    else:
        if not insist and _are_line_integrals(values, float(given.max()) * per_quantum):
            raise ValueError(
                f"{name} holds no value above {known.max():.3g}, and the least at both ends of the fan, as line "
                "integrals have; set kind to line-integrals, or insist on counts (--insist)."
            )
        unknown, counted = False, True
        with np.errstate(all="ignore"):  # numbers that no detector counts are refused later
            transmissions = values / per_quantum / np.where(given > 0, given, 1.0)
        if not np.isfinite(transmissions[..., measured]).all():
            return values / per_quantum, given, []
    estimate = estimate_incident(np.where(measured, -np.log(transmissions.clip(_LEAST_TRANSMISSION)), np.nan))
    if given is None or unknown:
        used = np.asarray(estimate)
    else:
        counts = values / per_quantum if counted else given * transmissions
        usual = float(np.median(given[given > 0]))
        darkest = float(np.quantile(counts[..., measured], _DARKEST))
        if insist or known.size < _ENOUGH_RAYS or darkest >= _ENOUGH_COUNTS or estimate <= _LESS_NOISE * usual:
            return counts, given, notes
        used = np.asarray(given * (estimate / usual))
        notes.append(
            f"{name} has far less noise than {usual:.4g} incident quanta have, of which {darkest:.2g} would arrive "
            "in the darkest rays; they were not used (--insist uses them)."
        )
    seen = "estimated from the noise" if estimate < MOST_QUANTA else "assumed, since no noise can be seen"
    notes.append(f"{estimate:.3g} incident quanta were {seen}; weights depend on them, FBP does not.")
    return used * transmissions, used, notes


def _are_counts(values: Array) -> bool:
    """Whether values are steady over the views at both ends of the fan, as of air, and less between them."""
    if not np.nanmin(values) >= 0 or not np.nanmax(values) <= _LARGEST_LINE_INTEGRAL:
        return False
    rays = values.reshape(-1, values.shape[-1])
    ends = rays[:, [0, -1]]
    air = np.median(ends, axis=0)  # NaN, and so nothing, where one was not measured
    steady = np.quantile(np.abs(ends - air), 0.9, axis=0) < _STEADY * air
    least = np.nanmin(np.median(rays, axis=0), initial=np.inf)
    return bool(steady.all() and (air > _LEAST_AIR).all() and least < (1 - _STEADY) * air.min())


def _are_line_integrals(values: Array, incident: float) -> bool:
    """Whether no value is larger than line integrals are, far below the incident counts, and air has the least."""
    if not np.nanmax(values) <= _LARGEST_LINE_INTEGRAL < incident / 10:
        return False
    per_bin = np.median(np.nan_to_num(values).reshape(-1, values.shape[-1]), axis=0)
    return bool(per_bin[[0, -1]].max() < 0.1 * per_bin.max())


def without_faults(measured: Array, counts: Array, incident: Array, electronic_noise: float) -> tuple[Array, list[str]]:
    """Return which of the measured rays tell something, and what readers should know of the others.

    Cells and views that counted nothing but noise in all their rays do not, nor cells that are stuck at one value, nor
    does a ray of no count among many.

    Args:
        measured: Whether each ray was measured, (views, bins).
        counts: Counts, (views, bins) or a batch of them, any where not measured, quanta.
        incident: Incident counts, which broadcast to these, quanta.
        electronic_noise: Standard deviation of the electronic noise in a count, quanta.
    """
    told, notes = measured.copy(), []
    known = np.where(measured, counts, 0.0).reshape(-1, *measured.shape)

    def dead(along: int) -> Array:
        return dead_cells(known.sum(axis=(0, along)), len(known) * told.sum(axis=along - 1), electronic_noise)

    bins = dead(along=1)
    if len(bins) < measured.shape[1]:  # else the scan says it
        told[:, bins] = False
        told[dead(along=2)] = False
    if len(bins):
        notes.append(f"Bins that counted nothing but noise in all views were left out as dead: {_named(bins)}.")
    lost = told & lost_readings(known, electronic_noise).any(axis=0)
    told &= ~lost
    if lost.any():
        notes.append(f"{int(lost.sum())} rays without counts, among rays of many, were left out as lost.")
    alive = np.flatnonzero(told.any(axis=0))
    p = np.where(told, -np.log(known.clip(_NO_COUNT) / np.where(incident > 0, incident, 1.0)), np.nan)
    stuck = alive[stuck_cells(p[..., alive])]
    told[:, stuck] = False
    if len(stuck):
        notes.append(f"Bins with one value in all views, unlike those around, were left out as stuck: {_named(stuck)}.")
    if not told.all():
        notes.append(f"{int((~told).sum())} of {told.size} rays were not measured.")
    if views := int((~told.any(axis=1)).sum()):
        notes.append(f"{views} views in which nothing was measured were left out.")
    return told, notes


def offset_of_air(line_integrals: Array) -> float:
    """Return what the line integrals at both ends of the fan are in all views, if that is one value other than 0.

    There are usually rays through air, and then the incident counts are those of another exposure. An object that is
    cut off rises from the ends on, or is not half as high there as elsewhere.

    Args:
        line_integrals: p, (..., views, bins), NaN where not measured.

    Returns:
        The value; 0 if there is none, or too few views to tell.
    """
    p = line_integrals.reshape(-1, line_integrals.shape[-1])
    cells = max(2, p.shape[1] // _END)
    if len(p) < 2 * _BLOCKS or p.shape[1] < 4 * cells:
        return 0.0
    ends = np.concatenate([p[:, :cells], p[:, -cells:]], axis=1)
    values = np.stack([np.median(part, axis=0) for part in np.array_split(ends, _BLOCKS)])
    offset = float(np.median(values))
    steady = float(np.abs(values - offset).max()) < _STEADY * abs(offset)  # not where one was not measured
    return offset if steady and _OFFSET < abs(offset) < 0.5 * float(np.nanmax(np.median(p, axis=0))) else 0.0


def _named(bins: Array) -> str:
    return ", ".join(map(str, bins[:10])) + (" and more" if len(bins) > 10 else "")


def _for_rays(array: PathLike | Array, shape: tuple[int, int], name: str) -> NDArray[np.float64]:
    values = loaded(array, nan=True)
    if values.shape not in ((), (shape[1],), (shape[0], 1), shape):
        raise ValueError(
            f"The {name} must be one number or of the shape ({shape[1]},), ({shape[0]}, 1) or {shape}, got "
            f"{values.shape}."
        )
    return values
