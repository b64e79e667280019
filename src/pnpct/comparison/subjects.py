"""The scans that are compared: measured ones, and those that are drawn from the exposures of a data set."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from pnpct.arrays import Image
from pnpct.comparison.study import Study
from pnpct.files import describe_file, read_exposure, read_scan, read_truth, tube_voltages
from pnpct.geometry import ImageGrid, require_image_grid
from pnpct.geometry.short_repr import short_repr
from pnpct.physics import Scan

REFERENCE_MA = 800.0
"""Tube current of the reference, mA."""


@dataclass(frozen=True)
class Subject:
    """One scan of one object, by what it is made of; `load` makes it.

    Args:
        name: What it is called in all tables.
        patient: Whose slice it is: scans of one patient are not independent.
        file: A scan, or exposures that a scan is drawn from.
        tube_current_ma: Tube current of the scan that is drawn; None for a measured scan.
        tube_voltage_kvp: Peak tube voltage, kVp; None for a measured scan.
        seed: Of the noise.
        size: Rows and columns of the images where there is no truth that says it.
    """

    name: str
    patient: str
    file: Path
    tube_current_ma: float | None
    tube_voltage_kvp: float | None
    seed: int
    size: int

    @property
    def label(self) -> str:
        """What readers see."""
        if self.tube_current_ma is None or self.tube_voltage_kvp is None:
            return self.file.stem
        return f"{self.file.stem}, {self.tube_current_ma:g} mA, {self.tube_voltage_kvp:g} kVp"

    def load(self) -> "LoadedSubject":
        """Read the scan, or draw it.

        Raises:
            OSError: If the file cannot be read.
            ValueError: If it is not what it should be.
        """
        if self.tube_current_ma is None or self.tube_voltage_kvp is None:
            scan, known = read_scan(self.file), read_truth(self.file)
            if known is None:
                return LoadedSubject(scan, _whole_view(scan, self.size), None, {})
            return LoadedSubject(scan, require_image_grid(known[1]), known[0], {})
        exposed = read_exposure(self.file, tube_voltage_kvp=self.tube_voltage_kvp)
        if exposed.truth is None or exposed.grid is None:
            raise ValueError(f"{self.file} has no truth that images could be compared with.")
        # All scans of a slice have one reference, and none the noise of another.
        own, shared = (np.random.SeedSequence([self.seed, *name.encode()]) for name in (self.name, self.file.stem))
        seeds = [*own.generate_state(1, np.uint64), *shared.generate_state(2, np.uint64)]
        scans = [
            exposed.exposure.scan(tube_current_ma=current, generator=torch.Generator().manual_seed(int(seed) % 2**63))
            for current, seed in zip((self.tube_current_ma, REFERENCE_MA, REFERENCE_MA), seeds, strict=True)
        ]
        references = {"reference": scans[1], "repeat": scans[2]}
        return LoadedSubject(scans[0], exposed.grid, exposed.truth, references)


@dataclass(frozen=True, eq=False)
class LoadedSubject:
    """A scan with all that is known of its object.

    Args:
        scan: The scan.
        grid: Of all images.
        truth: The object; None if it is not known.
        references: "reference" and "repeat", two scans at the dose of the reference; nothing for a measured scan.
    """

    scan: Scan
    grid: ImageGrid
    truth: Image | None
    references: Mapping[str, Scan]

    __repr__ = short_repr


def subjects_of(files: Sequence[Path], study: Study) -> Iterator[Subject]:
    """Yield the subjects of files: a scan is one, exposures are one for each tube current of the study.

    Raises:
        OSError: If a file cannot be read.
        ValueError: If a file is neither, two have one name, or exposures are given without a tube current.
    """
    names = set()
    for file in files:
        name = file.stem
        if name in names:
            raise ValueError(f"Two files are called {name}; tables would not tell them apart.")
        names.add(name)
        about = describe_file(file)
        patient = _patient(about["provenance"]["settings"], name)
        if about["format"] == "pnpct-scan":
            yield Subject(name, patient, file, None, None, study.seed, study.size)
            continue
        if study.tube_voltage_kvp not in (voltages := tube_voltages(file)):
            there = ", ".join(f"{voltage:g}" for voltage in voltages)
            raise ValueError(f"{file} has no exposure at {study.tube_voltage_kvp:g} kVp; there are {there}.")
        if not study.tube_currents_ma:
            raise ValueError(f"{file} holds exposures: give the tube currents of the scans to draw from it.")
        for current in sorted(study.tube_currents_ma):
            drawn = float(current), study.tube_voltage_kvp, study.seed, study.size
            yield Subject(f"{name}-{current:g}mA", patient, file, *drawn)


def _patient(settings: Mapping[str, Any], name: str) -> str:
    """Slices of one patient of a data set are not independent; other files are taken for patients of their own."""
    match settings.get("station"):
        case {"source": str(source), "patient": int(number)}:
            return f"{source} {number}"
    return name


def _whole_view(scan: Scan, size: int) -> ImageGrid:
    return ImageGrid(size, size, spacing=2 * scan.geometry.field_of_view_radius / size)
