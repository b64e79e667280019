"""What a data set depends on, and the scans that follow from it."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeAlias, cast

import numpy as np

from pnpct.files import Split
from pnpct.geometry import DEFAULT_SIZE
from pnpct.simulation.anatomy import ANATOMIES
from pnpct.simulation.catsim import VOLTAGES as CATSIM_VOLTAGES
from pnpct.simulation.scanner import BINS, VIEWS

Simulator: TypeAlias = Literal["own", "catsim"]
"""Who makes the scans: pnpct or CatSim."""

_OWN = "own data"


@dataclass(frozen=True)
class Recipe:
    """All that a data set depends on.

    Args:
        anatomies: Which of `ANATOMIES` the procedural patients have, in turn.
        bodies: Paths of CT series and voxelised phantoms, each of them one more patient.
        cases: Number of procedural patients.
        scale: Least and largest factor by which patients are resized, drawn evenly for each; none becomes larger than
            the field of view of the scanner.
        stations: Axial scans of each patient, spread over its length.
        rows: Detector rows, each of which gives a slice of 0.625 mm.
        tube_voltages_kvp: Tube voltages of each scan, 70 to 140 kVp.
        simulator: pnpct's own, or CatSim where it is installed.
        views: Views per rotation.
        bins: Detector cells along the arc.
        size: Rows and columns of the truth; the phantom that is scanned has pixels of half the size.
        blur: Whether focal spot, detector cells and the rotation during a view blur the scans.
        noise_hu: Standard deviation of the noise to remove from CT series, HU.
        validation: Fraction of the patients of each anatomy that is held out for validation.
        test: Fraction that is held out for testing.
        seed: Seed of everything that is drawn.

    Raises:
        ValueError: If a number is out of range, or there is no patient.
    """

    anatomies: tuple[str, ...] = tuple(ANATOMIES)
    bodies: tuple[str, ...] = ()
    cases: int = 40
    scale: tuple[float, float] = (1.0, 1.0)
    stations: int = 1
    rows: int = 32
    tube_voltages_kvp: tuple[float, ...] = (80.0, 100.0, 120.0)
    simulator: Simulator = "own"
    views: int = VIEWS
    bins: int = BINS
    size: int = DEFAULT_SIZE
    blur: bool = False
    noise_hu: float = 0.0
    validation: float = 0.1
    test: float = 0.1
    seed: int = 0

    def __post_init__(self) -> None:
        for anatomy in self.anatomies:
            if anatomy not in ANATOMIES:
                raise ValueError(f'There is no anatomy "{anatomy}"; there are {", ".join(ANATOMIES)}.')
        if self.cases < 0 or (self.cases and not self.anatomies):
            raise ValueError(f"{self.cases} patients cannot cover {len(self.anatomies)} anatomies.")
        if not (self.cases or self.bodies):
            raise ValueError("A data set needs patients: procedural ones, or ones read from files.")
        for name in ("stations", "rows", "views", "bins", "size"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be at least 1, got {getattr(self, name)}.")
        if not 0.1 <= self.scale[0] <= self.scale[1] <= 10:
            raise ValueError(f"Patients are resized by rising factors from 0.1 to 10, got {self.scale}.")
        if not self.tube_voltages_kvp or not all(70 <= voltage <= 140 for voltage in self.tube_voltages_kvp):
            raise ValueError("A data set needs tube voltages, each from 70 to 140 kVp.")
        if self.simulator == "catsim" and not set(self.tube_voltages_kvp) <= set(CATSIM_VOLTAGES):
            raise ValueError("CatSim has spectra for 70 to 140 kVp in steps of 10; choose among these.")
        if len({f"{voltage:g}" for voltage in self.tube_voltages_kvp}) < len(self.tube_voltages_kvp):
            raise ValueError("A tube voltage is given twice.")
        if not (self.validation >= 0 and self.test >= 0 and self.validation + self.test <= 1):
            raise ValueError("The fractions for validation and testing must not be negative, nor exceed 1 together.")
        if not 0 <= self.noise_hu < math.inf or (self.noise_hu and not self.bodies):
            raise ValueError(f"The noise of CT series is from 0 HU up, and needs such a series, got {self.noise_hu}.")
        if not 0 <= self.seed < 2**63:
            raise ValueError(f"A seed is a whole number from 0 to 2^63 - 1, got {self.seed}.")


@dataclass(frozen=True)
class Station:
    """One axial scan of one patient.

    Args:
        name: Of the scan; its files are called <name>-row<number>.h5.
        source: An anatomy, or the path of a body.
        own: Whether the source is the path of a body.
        patient: Index of the patient among those of its source.
        scale: Factor by which it is resized, unless the field of view ends that.
        share: Where it is scanned: share of the height that can be scanned below the lowest row, 0 to 1.
        split: Training, validation or test, by patient.
    """

    name: str
    source: str
    own: bool
    patient: int
    scale: float
    share: float
    split: Split


def plan(recipe: Recipe) -> tuple[Station, ...]:
    """Return all axial scans of a data set, in order; the split of the patients depends on the seed.

    Of three patients and more of one source, at least one is held out for validation and one for testing where a
    fraction is given. CT series and phantoms count as patients of one source.
    """
    of_source: dict[str, list[tuple[str, str, int]]] = {}
    for number in range(recipe.cases):
        anatomy = recipe.anatomies[number % len(recipe.anatomies)]
        patients = of_source.setdefault(anatomy, [])
        patients.append((f"{anatomy}-{len(patients):03d}", anatomy, len(patients)))
    of_source[_OWN] = [(f"own-{Path(path).stem}-{n:03d}", path, n) for n, path in enumerate(recipe.bodies)]
    stations: list[Station] = []
    for source, patients in of_source.items():
        draw = np.random.default_rng([recipe.seed, *source.encode()])
        splits = _splits(recipe, len(patients), draw)
        for (name, path, number), split in zip(patients, splits, strict=True):
            scale = float(np.random.default_rng([recipe.seed, number, *source.encode()]).uniform(*recipe.scale))
            for station in range(recipe.stations):
                suffix = f"-{station}" if recipe.stations > 1 else ""
                share = (station + float(draw.uniform())) / recipe.stations
                stations.append(Station(name + suffix, path, source == _OWN, number, scale, share, split))
    return tuple(stations)


def _splits(recipe: Recipe, patients: int, draw: np.random.Generator) -> list[Split]:
    enough = patients >= 3
    held_out = [max(round(share * patients), int(enough and share > 0)) for share in (recipe.validation, recipe.test)]
    names = [*(held_out[0] * ["validation"]), *(held_out[1] * ["test"]), *(patients * ["train"])][:patients]
    return [cast(Split, names[place]) for place in draw.permutation(patients)]
