"""The images of a comparison as they are now, and whether they are still those that were measured."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from pnpct.arrays import Image
from pnpct.comparison import Case, Check, Comparison, StoredImage
from pnpct.comparison.image_hash import image_sha256
from pnpct.files import read_image
from pnpct.files.json_file import file_beside
from pnpct.geometry import require_image_grid
from pnpct.report.pixels import PackedPixels, pack_hu, pack_map
from pnpct.units import to_hu

GIVEN = {"reference": "Reference", "repeat": "Second reference scan", "truth": "Truth"}
"""What a case has besides its methods, shown last, and how it is called; of the repeat there are numbers only."""


@dataclass(frozen=True)
class FoundImage:
    """An image or a map of a case as it is in the folder now.

    Args:
        case: Name of the case.
        method: Name of the method, or "reference" or "truth".
        shows: What a map shows; empty for an image.
        sha256: Of what was found.
        expected_sha256: Of what was measured.
        packed: The pixels as text.
    """

    case: str
    method: str
    shows: str
    sha256: str
    expected_sha256: str
    packed: PackedPixels

    @property
    def changed(self) -> bool:
        """Whether it is not what was measured."""
        return self.sha256 != self.expected_sha256


def find_images(folder: Path, comparison: Comparison) -> tuple[FoundImage, ...]:
    """Read all images and maps of a comparison, case by case.

    Raises:
        OSError: If one is missing or cannot be read.
        ValueError: If one has not the size of its case.
    """
    return tuple(_find(folder, comparison))


def _find(folder: Path, comparison: Comparison) -> Iterator[FoundImage]:
    for case in comparison.cases:
        for method in columns(comparison, case):
            image, sha256 = _read(folder, case, stored := case.images[method])
            packed = pack_hu(np.asarray(to_hu(image.double())))
            yield FoundImage(case.name, method, "", sha256, stored.sha256, packed)
            for shows, of_map in case.maps.get(method, {}).items():
                values, sha256 = _read(folder, case, of_map)
                known = values.double().where(values != 0, torch.nan)  # 0 is where the map has no answer
                packed = pack_map(np.asarray(known))
                yield FoundImage(case.name, method, shows, sha256, of_map.sha256, packed)


def read_shown(folder: Path, case: Case, method: str) -> Image:
    """Read the image of a method, attenuation relative to water.

    Raises:
        OSError: If it is missing or cannot be read.
        ValueError: If it has not the size of its case.
    """
    return _read(folder, case, case.images[method])[0]


def columns(comparison: Comparison, case: Case) -> list[str]:
    """Return what has an image of a case, in the order of the columns: methods, then reference and truth."""
    order = [*(method.name for method in comparison.methods), *GIVEN]
    return [name for name in order if name in case.images]


def labels(comparison: Comparison) -> dict[str, str]:
    """Return what readers see for each method, the reference, its repeat and the truth."""
    return {**{method.name: method.label for method in comparison.methods}, **GIVEN}


def checks_of_images(images: tuple[FoundImage, ...]) -> tuple[Check, ...]:
    """Return a failed check for each image that is not what was measured."""
    return tuple(
        Check(
            name="image unchanged",
            case=image.case,
            method=image.method,
            value=None,
            low=None,
            high=None,
            verdict="fail",
            says=f"The {f'map {image.shows}' if image.shows else 'image'} has changed since it was measured: its "
            f"fingerprint was {image.expected_sha256[:12]} and is {image.sha256[:12]}. No number here is about it.",
        )
        for image in images
        if image.changed
    )


def _read(folder: Path, case: Case, stored: StoredImage) -> tuple[torch.Tensor, str]:
    path = file_beside(folder, stored.file)
    image, grid = read_image(path)
    shape = case.grid.shape
    if tuple(image.shape) != shape:
        raise ValueError(
            f"{path}: an image of the case {case.name} has {shape[0]} x {shape[1]} pixels, got the shape "
            f"{tuple(image.shape)}; make the comparison again."
        )
    return image, image_sha256(image, require_image_grid(grid))
