"""The views of one scan in DICOM-CT-PD, in their order, and where their rays are.

Coordinates are those of the format's manual, which are those of `ConeBeam`: x to the right and y up, seen from the
table; z from the table into the gantry. Columns run towards growing fan angle, rows downwards in z.
"""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pnpct.files.ct_pd.view import Layout, View
from pnpct.files.errors import FileFormatError, PathLike
from pnpct.geometry import ConeBeam, Detector, Trajectory

_MOST_NAMED = 6
_ALIKE = 1e-5
"""Relative differences between the lengths of views that single precision explains."""


@dataclass(frozen=True)
class CTPDSeries:
    """The projections of one scan, of which only the headers are read.

    Args:
        folder: Where the files are.
        views: The views in their order.
        central_column: Column of the central ray, from 1, instead of that of the files; None takes theirs.
    """

    folder: Path
    views: Sequence[View]
    central_column: float | None = None

    @property
    def layout(self) -> Layout:
        """What all views share."""
        return self.views[0].layout

    @cached_property
    def geometry(self) -> ConeBeam:
        """Where the rays are; the lowest row first, angles without jumps, focal spots where they were.

        Raises:
            ValueError: If lengths or the central column cannot be.
        """
        layout = self.layout
        step = layout.column_width / layout.distance
        width = 2 * layout.distance * math.tan(step / 2)
        central = layout.central_column if self.central_column is None else self.central_column
        if not 0 <= central <= layout.columns + 1:
            raise FileFormatError(
                f"{self.folder}: the central column must be among the columns 1 to {layout.columns}, got {central:g}."
            )
        away = ((layout.columns + 1) / 2 - central) * step
        turn, up, out = np.array([view.shift for view in self.views]).T
        radius = layout.radius + out
        shifts = np.stack([-radius * np.sin(turn), radius * np.cos(turn) - layout.radius, up])
        return ConeBeam(
            Trajectory(
                angles=unwrapped(self.views),
                z=[view.z for view in self.views],
                focal_spot_shifts=list(zip(*shifts.tolist(), strict=True)) if shifts.any() else (),
            ),
            Detector(
                bins=layout.columns,
                bin_width=width,
                offset=math.tan(away) * layout.distance / width,
                rows=layout.rows,
                row_height=layout.row_height,
                row_offset=layout.central_row - (layout.rows + 1) / 2,
            ),
            source_to_isocenter=layout.radius,
            source_to_detector=layout.distance,
        )

    @property
    def tube_currents_ma(self) -> NDArray[np.float64]:
        """Tube current in each view, mA; 0 where it is not stated."""
        return np.array([view.tube_current_ma for view in self.views])


def unwrapped(views: Sequence[View]) -> NDArray[np.float64]:
    """Return the angles of views without jumps by 2π, rad."""
    return np.unwrap([view.angle for view in views])


def series_of(folder: PathLike, views: Sequence[View]) -> CTPDSeries:
    """Put the views of a folder in order, and check that they are one scan, with nothing missing.

    Args:
        folder: Where the files are.
        views: Their headers, in any order.

    Raises:
        FileFormatError: If there is no view, several series or spectra, views that do not fit each other, or if views
            are missing or come twice, or the table jumps.
    """
    folder = Path(folder)
    if not views:
        raise FileFormatError(
            f"{folder} holds no projections in DICOM-CT-PD; give the folder that holds the files of one series."
        )
    _check_one_series(folder, views)
    ordered = sorted(views, key=lambda view: view.number)
    _check_numbers(folder, ordered)
    _check_layouts(ordered)
    _check_heights(ordered)
    _check_angles(ordered)
    return CTPDSeries(folder, ordered)


def _check_one_series(folder: Path, views: Sequence[View]) -> None:
    counts = Counter(view.series for view in views)
    if len(counts) > 1:
        listed = ", ".join(f"{uid or 'without a uid'} ({count} views)" for uid, count in counts.most_common(3))
        raise FileFormatError(
            f"{folder} holds {len(counts)} series, but a scan is one; move each into a folder of its own: {listed}."
        )


def _check_numbers(folder: Path, ordered: Sequence[View]) -> None:
    pairs = list(pairwise(ordered))
    twice = [(one, other) for one, other in pairs if one.number == other.number]
    if twice:
        one, other = twice[0]
        raise FileFormatError(
            f"{folder}: views come twice ({len(twice)} in all), such as number {one.number} in {one.path.name} and in "
            f"{other.path.name}; remove the copies."
        )
    gaps = [(one.number + 1, other.number - 1) for one, other in pairs if other.number > one.number + 1]
    if gaps:
        missing = sum(last - first + 1 for first, last in gaps)
        listed = ", ".join(f"{first}" if first == last else f"{first} to {last}" for first, last in gaps[:_MOST_NAMED])
        more = ", ..." if len(gaps) > _MOST_NAMED else ""
        raise FileFormatError(
            f"{folder}: of the views {ordered[0].number} to {ordered[-1].number} these are missing: {listed}{more} "
            f"({missing} in all); copy them again."
        )


def _check_layouts(ordered: Sequence[View]) -> None:
    first = ordered[0]
    spectra = sorted({view.layout.spectrum for view in ordered})
    if len(spectra) > 1:
        raise FileFormatError(
            f"{first.path.parent} mixes the spectra {', '.join(map(str, spectra))} (SpectrumIndex), but a scan has "
            "one; move each into a folder of its own."
        )
    for view in ordered:
        for field in fields(Layout):
            one, other = getattr(first.layout, field.name), getattr(view.layout, field.name)
            if one != other and not (isinstance(one, float) and math.isclose(one, other, rel_tol=_ALIKE)):
                raise FileFormatError(
                    f"{view.path} does not fit {first.path.name}: its {field.name.replace('_', ' ')} is {other}, that "
                    f"of the other {one}."
                )


def _check_heights(ordered: Sequence[View]) -> None:
    """Check that the table does not jump by a detector row or more, as between two scans or where a turn is missing."""
    steps = np.diff([view.z for view in ordered])
    layout = ordered[0].layout
    away = np.abs(steps - np.median(steps)) if steps.size else steps
    if steps.size and away.max() > layout.row_height * layout.radius / layout.distance:
        at = int(away.argmax())
        one, other = ordered[at], ordered[at + 1]
        raise FileFormatError(
            f"{one.path.parent}: the table jumps from z = {one.z:.4g} to {other.z:.4g} mm between the views "
            f"{one.number} and {other.number}; copy the views that are missing there, or move the views of each scan "
            "into a folder of its own."
        )


def _check_angles(ordered: Sequence[View]) -> None:
    """Check that the views follow each other evenly, also where they are numbered without a gap."""
    steps = np.diff(unwrapped(ordered))
    if not steps.size:
        return
    usual = float(np.median(steps))
    uneven = np.flatnonzero(np.abs(steps - usual) > 0.5 * abs(usual))
    if uneven.size or usual == 0:
        at = int(uneven[0]) if uneven.size else 0
        raise FileFormatError(
            f"{ordered[at].path.parent}: views must follow each other evenly, {math.degrees(usual):.4g} degrees apart, "
            f"but the numbers {ordered[at].number} and {ordered[at + 1].number} are "
            f"{math.degrees(steps[at]):.4g} degrees apart; are views missing?"
        )
