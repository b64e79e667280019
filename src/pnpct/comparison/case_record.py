"""One case in `metrics.json`: where its images are, and how they are to be read."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from pnpct.evaluation import Patch


@dataclass(frozen=True)
class StoredImage:
    """An image in the folder of the comparison.

    Args:
        file: Its path from the folder, an image as `pnpct.files.read_image` reads it.
        sha256: Of its pixels and grid, in hexadecimal: it changes when one pixel does.
        seconds: What it took to make; None where that means nothing.
    """

    file: str
    sha256: str
    seconds: float | None = None


@dataclass(frozen=True)
class Grid:
    """Where the pixels of a case are, as `pnpct.geometry.ImageGrid` has it, mm."""

    rows: int
    cols: int
    spacing: float
    center: tuple[float, float]


@dataclass(frozen=True)
class Detail:
    """A square that is shown enlarged: first row, first column and side, pixels.

    It is chosen on the reference, before any result was seen.
    """

    row: int
    col: int
    size: int


@dataclass(frozen=True)
class Case:
    """One scan, and what became of it.

    Args:
        name: What it is called in all tables.
        label: What readers see, say "chest, 40 mA".
        tube_current_ma: Tube current; None where it is not known.
        tube_voltage_kvp: Peak tube voltage; None where it is not known.
        grid: Of all its images.
        geometry: The scan's geometry in words.
        details: Squares to enlarge.
        images: By method; "truth" and "reference" (the scan at high dose, noisy too) where they exist.
        maps: By method, then by what they show: "t", the score test (no unit); "verifiable_hu", the least contrast that
            the data can confirm, one map for all methods; "difference_hu", what the prior has changed. Stored like
            images, but their values are plain numbers in the unit that the name says, not attenuation. Outside the
            body all are 0, and a verifiable contrast of 0 says that none is known there.
        seed: Of the noise, None where it is measured.
        patches: Where texture was measured; none where there is no soft tissue for it.
        texture_spec_hash: `GLCMSpec.hash` of how these were chosen and measured; None where there are none.
        disc_mm: Diameter of the discs of the score test, mm; None where it was not made.
    """

    name: str
    label: str
    tube_current_ma: float | None
    tube_voltage_kvp: float | None
    grid: Grid
    geometry: str
    details: tuple[Detail, ...]
    images: Mapping[str, StoredImage]
    maps: Mapping[str, Mapping[str, StoredImage]] = field(default_factory=dict)
    seed: int | None = None
    patches: tuple[Patch, ...] = ()
    texture_spec_hash: str | None = None
    disc_mm: float | None = None
