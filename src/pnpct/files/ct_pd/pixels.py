"""The line integrals of DICOM-CT-PD as counts, a few views at a time."""

import hashlib
import os
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from pnpct.files.ct_pd.elements import Elements, read_elements
from pnpct.files.ct_pd.series import CTPDSeries
from pnpct.files.ct_pd.view import Layout, View
from pnpct.files.errors import FileFormatError
from pnpct.files.rounding import rounded
from pnpct.physics import Scan

VIEWS_OF_A_SLAB = 64
"""Views that are read together."""

_BITS = 13
"""Of the counts, after the leading one: an error of 6e-5 in a line integral, of which the files have steps of 1e-4."""

_LARGEST_LINE_INTEGRAL = 50.0
_THREADS = min(4, os.cpu_count() or 1)
"""Files are small, and a disk or a network gives several at a time."""


@dataclass(frozen=True, eq=False)
class Slab:
    """A few consecutive views.

    Args:
        scan: The scan of these views.
        sha256: Fingerprint of the files that they were read from.
    """

    scan: Scan
    sha256: bytes


def read_slabs(
    series: CTPDSeries,
    *,
    incident: float | None = None,
    electronic_noise: float = 0.0,
    mu_water: float | None = None,
) -> Iterator[Slab]:
    """Read the pixels of a series, and yield its scan in slabs of 64 views.

    Line integrals p, as they are stored, become counts, incident · exp(−p). Nothing is cut off: noise takes p below 0
    in air. Two slabs are in memory at a time, 16 bytes for each of their rays.

    Args:
        series: The headers, in order.
        incident: Quanta of a ray without an object at the mean tube current, in each view by its own tube current;
            None takes PhotonStatistics, which the files have per view and column.
        electronic_noise: Standard deviation of the electronic noise of a count, quanta; the files do not state it.
        mu_water: Attenuation of water at the effective energy, 1/mm; None takes that of the files.

    Yields:
        The slabs, from the first view to the last.

    Raises:
        OSError: If a file cannot be read.
        FileFormatError: If a file is damaged, or does not say how many quanta or which attenuation there was.
        ValueError: If a number is out of range.
    """
    mu_water = _mu_water(series, mu_water)
    quanta: list[float | None] = [None] * len(series.views)
    if incident is not None:
        currents = series.tube_currents_ma
        relative = currents / currents.mean() if currents.all() else np.ones(len(currents))
        quanta = [float(one) for one in incident * relative]

    with ThreadPoolExecutor(_THREADS) as pool:

        def begin(first: int) -> list[Future[tuple[NDArray[np.float32], NDArray[np.float32], bytes]]]:
            views = slice(first, first + VIEWS_OF_A_SLAB)
            return [pool.submit(_counts, *one) for one in zip(series.views[views], quanta[views], strict=True)]

        following = begin(0)
        for first in range(0, len(series.views), VIEWS_OF_A_SLAB):
            reading, following = following, begin(first + VIEWS_OF_A_SLAB)
            try:
                counts, photons, digests = zip(*(one.result() for one in reading), strict=True)
            except BaseException:
                pool.shutdown(cancel_futures=True)
                raise
            scan = Scan(
                counts=rounded(torch.from_numpy(np.stack(counts)), bits=_BITS),
                incident=torch.from_numpy(np.stack(photons))[:, None, :],
                electronic_noise=electronic_noise,
                geometry=series.geometry[first : first + VIEWS_OF_A_SLAB],
                mu_water=mu_water,
            )
            yield Slab(scan, hashlib.sha256(b"".join(digests)).digest())


def _mu_water(series: CTPDSeries, given: float | None) -> float:
    if given is None and not series.layout.mu_water:
        raise FileFormatError(
            f"{series.folder}: the files do not state the attenuation of water; give it in 1/mm (--mu-water)."
        )
    return series.layout.mu_water if given is None else given


def _counts(view: View, incident: float | None) -> tuple[NDArray[np.float32], NDArray[np.float32], bytes]:
    """The counts (rows, columns) of a view, lowest row first, its incident quanta, and the file's fingerprint."""
    content = view.path.read_bytes()
    elements = read_elements(view.path, pixels=content)
    if elements is None:
        raise FileFormatError(f"{view.path} is not in DICOM any more; something has changed it.")
    line_integrals = _line_integrals(elements, view.layout)
    quanta = _incident(elements, view.layout.columns) if incident is None else np.full(view.layout.columns, incident)
    counts = quanta.astype(np.float32) * np.exp(-line_integrals)
    return counts, quanta.astype(np.float32), hashlib.sha256(content).digest()


def _line_integrals(elements: Elements, layout: Layout) -> NDArray[np.float32]:
    path, stored = elements.path, elements.pixels
    if stored.size != layout.rows * layout.columns:
        raise FileFormatError(
            f"{path} holds {stored.size} pixels, but its detector has {layout.columns} columns and {layout.rows} rows; "
            "copy it again."
        )
    for name, extreme in (("Smallest", stored.min()), ("Largest", stored.max())):
        stated = elements.numbers(f"{name}ImagePixelValue")
        if stated.size and stated[0] != extreme:
            raise FileFormatError(
                f"{path}: the {name.lower()} pixel value should be {stated[0]:.0f}, got {extreme}; copy it again."
            )
    slope, intercept = elements.number("RescaleSlope"), elements.number("RescaleIntercept")
    low, high = (float(extreme) * slope + intercept for extreme in (stored.min(), stored.max()))
    if not (slope > 0 and max(abs(low), abs(high)) < _LARGEST_LINE_INTEGRAL):
        raise FileFormatError(
            f"{path}: line integrals from {low:.4g} to {high:.4g} cannot be; its rescale slope is {slope:g}, the "
            f"intercept {intercept:g}."
        )
    values = stored.astype(np.float32) * np.float32(slope) + np.float32(intercept)
    rows = values.reshape(layout.columns, layout.rows).T if layout.by_columns else values.reshape(layout.rows, -1)
    return rows[::-1]


def _incident(elements: Elements, columns: int) -> NDArray[np.float64]:
    quanta = elements.numbers("PhotonStatistics")
    if not quanta.size:
        raise FileFormatError(
            f"{elements.path} does not state the quanta of a ray without an object (PhotonStatistics); give them "
            "(--incident)."
        )
    if quanta.size not in (1, columns) or quanta.min() <= 0:
        raise FileFormatError(
            f"{elements.path}: PhotonStatistics must be a positive number for each of the {columns} columns, got "
            f"{quanta.size} from {quanta.min():g}; give the quanta of a ray yourself (--incident)."
        )
    return np.broadcast_to(quanta, columns)
