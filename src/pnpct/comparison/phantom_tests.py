"""The phantoms that methods are tested on, how often and at which doses they are scanned; plain, checked values."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache
from typing import Any

from pnpct.evaluation.observers.detectability_by_dose import READER
from pnpct.geometry import ImageGrid, Insert
from pnpct.operators import Kernel
from pnpct.physics import Exposure
from pnpct.simulation import as_exposure, clinical_fan_beam, low_contrast_phantom, scanner_beam, simulate_moments

INSERTS = (
    Insert(diameter=6.0, contrast_hu=-40.0, center=(40.0, 40.0)),
    Insert(diameter=8.0, contrast_hu=-30.0, center=(-40.0, 40.0)),
    Insert(diameter=10.0, contrast_hu=-20.0, center=(-40.0, -40.0)),
    Insert(diameter=14.0, contrast_hu=-15.0, center=(40.0, -40.0)),
)
"""Dark, as liver lesions are."""

EDGE = Insert(diameter=30.0, contrast_hu=-120.0, center=(0.0, 0.0))
"""The disc whose edge shows how sharp a method is."""

CURVES_MA = 100.0
"""Tube current of the phantoms for noise power and sharpness, mA."""

FULL_MA = 200.0
"""Tube current at which FBP sets the mark of detectability: the full dose, mA."""

FURTHER_MA = (20.0, FULL_MA, 2 * FULL_MA)
"""Tube currents at which inserts are looked for besides those of the scans, mA.

They reach beyond the full dose, so that what is worse than FBP can be told by how much.
"""

REFERENCE_KERNELS: tuple[Kernel, ...] = ("ram-lak", "hann", "soft")
"""Kernels of FBP, the best of which sets the mark for each insert."""

LEAST_PAIRS = 40
"""Fewer pairs of scans give the Hotelling observer no covariance in some resample."""


@dataclass(frozen=True)
class Phantoms:
    """Discs of water with and without inserts, their scanner, and the pixels of their images.

    Args:
        grid: Of all images; the phantoms are drawn with half its spacing.
        views: Views of the scanner in a turn.
        bins: Cells of its detector.
        radius: Of the discs of water, mm.
        inserts: What is looked for, all in one phantom.
        edge: The disc of another phantom, by whose edge sharpness is measured.

    Raises:
        ValueError: If there is no insert, or the edge has not the place that its measurement needs.
    """

    grid: ImageGrid = ImageGrid(256, 256, spacing=0.9)  # noqa: RUF009 - a frozen value
    views: int = 984
    bins: int = 900
    radius: float = 100.0
    inserts: tuple[Insert, ...] = INSERTS
    edge: Insert = EDGE

    @property
    def patch(self) -> int:
        """Side of the patches for noise power, pixels: they tile the middle half of the image."""
        return min(self.grid.shape) // 4

    def __post_init__(self) -> None:
        if not self.inserts:
            raise ValueError("A phantom needs at least one insert to look for.")
        radius, room = self.edge.diameter / 2, max(map(abs, self.edge.center)) + self.edge.diameter
        if radius < 4 * self.grid.spacing or room > (min(self.grid.shape) - 1) / 2 * self.grid.spacing:
            raise ValueError(f"The edge needs a radius of 4 pixels, and as much around it in the image: {self.edge}.")


@dataclass(frozen=True, kw_only=True)
class PhantomTests:
    """What is measured on phantoms.

    Args:
        repeats: Scans of each phantom for noise power and sharpness, at least 2; 0 leaves these out.
        pairs: Scans with and without inserts at each dose, at least 40; 0 leaves detectability out.
        tube_currents_ma: Tube currents at which inserts are looked for besides 20, 200 and 400 mA.
        tube_voltage_kvp: Of all scans, kVp.
        phantoms: The phantoms.

    Raises:
        ValueError: If a number is out of its range, or inserts would be looked for at fewer than four doses.
    """

    repeats: int = 8
    pairs: int = 0
    tube_currents_ma: tuple[float, ...] = ()
    tube_voltage_kvp: float = 120.0
    phantoms: Phantoms = Phantoms()

    def __post_init__(self) -> None:
        if self.repeats < 2 and self.repeats != 0:
            raise ValueError(f"Noise power needs two repeats of the phantoms or more, or 0 for none: {self.repeats}.")
        if self.pairs < LEAST_PAIRS and self.pairs != 0:
            raise ValueError(f"Detectability needs {LEAST_PAIRS} pairs of scans or more, or 0 for none: {self.pairs}.")
        if not all(math.isfinite(current) and current > 0 for current in self.tube_currents_ma):
            raise ValueError(f"Tube currents must be positive, in mA, got {_listed(self.tube_currents_ma)}.")
        if self.pairs and len(self.doses_ma) < 4:
            raise ValueError(
                f"Detectability needs a tube current besides {_listed(FURTHER_MA)} mA, which it adds itself; got "
                f"{_listed(self.tube_currents_ma) or 'none'}."
            )

    @property
    def doses_ma(self) -> tuple[float, ...]:
        """Tube currents at which inserts are looked for, mA, rising."""
        return tuple(sorted({*map(float, self.tube_currents_ma), *FURTHER_MA}))

    def exposure(self, inserts: tuple[Insert, ...]) -> Exposure:
        """Return the exposure of the disc of water with inserts.

        Raises:
            ValueError: If an insert does not fit into it, or the tube voltage is out of its range.
        """
        return _exposure(self.phantoms, inserts, self.tube_voltage_kvp)

    def described(self) -> dict[str, Any]:
        """Return all that the numbers depend on, as plain values with units in their names."""
        it = self.phantoms
        about: dict[str, Any] = {
            "radius_mm": it.radius,
            "views": it.views,
            "bins": it.bins,
            "rows": it.grid.rows,
            "cols": it.grid.cols,
            "spacing_mm": it.grid.spacing,
            "tube_voltage_kvp": self.tube_voltage_kvp,
        }
        if self.repeats:
            about["noise and sharpness"] = {
                "edge": _described(it.edge),
                "tube_current_ma": CURVES_MA,
                "repeats": self.repeats,
                "patch_pixels": it.patch,
            }
        if self.pairs:
            about["detectability"] = {
                "pairs": self.pairs,
                "tube_currents_ma": list(self.doses_ma),
                "inserts": {in_words(insert): _described(insert) for insert in it.inserts},
                "reference": {"kernels": list(REFERENCE_KERNELS), "tube_current_ma": FULL_MA},
                "eye of NPWE": {"distance_mm": READER.distance, "zoom": READER.zoom, "decay": READER.decay},
            }
        return about if self.repeats or self.pairs else {}


def in_words(insert: Insert) -> str:
    """Return an insert as readers see it.

    Example:
        >>> in_words(Insert(diameter=10.0, contrast_hu=-15.0, center=(0.0, 0.0)))
        '10 mm, −15 HU'
    """
    return f"{insert.diameter:g} mm, {insert.contrast_hu:+g} HU".replace("-", "−")


@lru_cache(maxsize=8)  # the same for all methods that one process measures
def _exposure(phantoms: Phantoms, inserts: tuple[Insert, ...], tube_voltage_kvp: float) -> Exposure:
    geometry = clinical_fan_beam(views=phantoms.views, bins=phantoms.bins)
    beam = scanner_beam(geometry, tube_voltage_kvp=tube_voltage_kvp)
    grid = phantoms.grid
    fine = ImageGrid(2 * grid.rows, 2 * grid.cols, grid.spacing / 2)
    phantom = low_contrast_phantom(fine, inserts=inserts, radius=phantoms.radius, energy=beam.effective_energy)
    (moments,) = simulate_moments(phantom, geometry, [beam])
    return as_exposure(moments, geometry, beam)


def _described(insert: Insert) -> dict[str, Any]:
    values = asdict(insert)
    return {
        "diameter_mm": values["diameter"],
        "contrast_hu": values["contrast_hu"],
        "center_mm": list(values["center"]),
    }


def _listed(values: Sequence[float]) -> str:
    return ", ".join(f"{value:g}" for value in values)
