"""Low-contrast phantoms: discs of water with inserts whose size, place and contrast are known."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from pnpct.geometry import ImageGrid, Insert
from pnpct.physics import Exposure
from pnpct.simulation import (
    BINS,
    VIEWS,
    as_exposure,
    clinical_fan_beam,
    low_contrast_phantom,
    scanner_beam,
    simulate_moments,
)

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
"""Tube current at which FBP sets the d′ that methods have to reach: the full dose, mA."""

FURTHER_MA = (20.0, FULL_MA, 2 * FULL_MA)
"""Tube currents at which inserts are looked for besides those of the scans, mA.

They reach beyond the full dose, so that what is worse than FBP can be told by how much.
"""


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
    views: int = VIEWS
    bins: int = BINS
    radius: float = 100.0
    inserts: tuple[Insert, ...] = INSERTS
    edge: Insert = EDGE

    def __post_init__(self) -> None:
        if not self.inserts:
            raise ValueError("A phantom needs at least one insert to look for.")
        radius, room = self.edge.diameter / 2, max(map(abs, self.edge.center)) + self.edge.diameter
        if radius < 4 * self.grid.spacing or room > (min(self.grid.shape) - 1) / 2 * self.grid.spacing:
            raise ValueError(f"The edge needs a radius of 4 pixels, and as much around it in the image: {self.edge}.")

    @property
    def patch(self) -> int:
        """Side of the patches for noise power, pixels: they tile the middle half of the image."""
        return min(self.grid.shape) // 4

    @lru_cache(maxsize=8)  # the same for all methods that one process measures  # noqa: B019 - frozen values
    def exposure(self, inserts: tuple[Insert, ...], tube_voltage_kvp: float) -> Exposure:
        """Return the exposure of the disc of water with inserts.

        Raises:
            ValueError: If an insert does not fit into it, or the tube voltage is out of its range.
        """
        geometry = clinical_fan_beam(views=self.views, bins=self.bins)
        beam = scanner_beam(geometry, tube_voltage_kvp=tube_voltage_kvp)
        energy = beam.effective_energy
        phantom = low_contrast_phantom(self.grid.halved, inserts=inserts, radius=self.radius, energy=energy)
        (moments,) = simulate_moments(phantom, geometry, [beam])
        return as_exposure(moments, geometry, beam)

    @property
    def settings(self) -> dict[str, Any]:
        """The discs, the scanner and the pixels as plain values with units in their names."""
        rows, cols = self.grid.shape
        pixels = {"rows": rows, "cols": cols, "spacing_mm": self.grid.spacing}
        return {"radius_mm": self.radius, "views": self.views, "bins": self.bins, **pixels}


def insert_settings(insert: Insert) -> dict[str, Any]:
    """Return an insert as plain values with units in their names."""
    center = list(insert.center)
    return {"diameter_mm": insert.diameter, "contrast_hu": insert.contrast_hu, "center_mm": center}


def lesion_in_words(diameter: float, contrast_hu: float) -> str:
    """Return a lesion or an insert as readers see it.

    Example:
        >>> lesion_in_words(10.0, -15.0)
        '10 mm, −15 HU'
    """
    return f"{diameter:g} mm, {contrast_hu:+g} HU".replace("-", "−")
