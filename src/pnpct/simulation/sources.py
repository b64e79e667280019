"""Where bodies come from: procedural anatomies, a CT series, or a voxelised phantom."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pnpct.denoisers import NonlocalMeans
from pnpct.files import read_dicom_series, read_volume, read_xcist_phantom, sha256_of
from pnpct.files.errors import existing_file
from pnpct.files.plausible import doubt_of_image
from pnpct.files.provenance import sha256_of_files, sha256_of_folder
from pnpct.geometry import DEFAULT_SIZE, ImageGrid
from pnpct.simulation.anatomy import ANATOMIES
from pnpct.simulation.body import Body
from pnpct.simulation.ct_body import CTBody
from pnpct.simulation.resized_body import ResizedBody
from pnpct.simulation.voxel_body import VoxelBody


@dataclass(frozen=True, eq=False)
class Source:
    """A body, and where to look at it.

    Args:
        body: The body.
        grid: Square that covers all of it.
        height: z to look at first, mm.
        notes: What was done to its images on the way, a sentence each, for the user to read.
    """

    body: Body
    grid: ImageGrid
    height: float
    notes: tuple[str, ...] = ()

    def resized(self, scale: float) -> "Source":
        """Return it larger by a factor > 0 along all three axes, or smaller, with as many pixels."""
        grid = replace(self.grid, spacing=scale * self.grid.spacing)
        return replace(self, body=ResizedBody(self.body, scale), grid=grid, height=scale * self.height)


def procedural_patient(anatomy: str, generator: np.random.Generator, *, size: int = DEFAULT_SIZE) -> Source:
    """Return a procedural patient.

    Args:
        anatomy: One of `ANATOMIES`.
        generator: Generator of the variation between patients.
        size: Rows and columns of the images of it.

    Raises:
        ValueError: If there is no such anatomy.
    """
    if anatomy not in ANATOMIES:
        raise ValueError(f'There is no anatomy "{anatomy}"; there are {", ".join(ANATOMIES)}.')
    chosen = ANATOMIES[anatomy]
    grid = ImageGrid(size, size, spacing=chosen.field_of_view / size)
    return Source(chosen.build(generator), grid, chosen.height)


def from_files(path: Path, *, size: int = DEFAULT_SIZE, noise_hu: float = 0.0, series_uid: str | None = None) -> Source:
    """Read a body: a folder with a DICOM CT series, a volume of HU (.npz), or an XCIST phantom (.json, .zip).

    Args:
        path: The folder or file.
        size: Rows and columns of the images of it.
        noise_hu: Standard deviation of the noise of a CT series, HU, which non-local means removes; 0 keeps it.
        series_uid: SeriesInstanceUID of the series to read, where the folder holds several.

    Raises:
        OSError: If it does not exist or cannot be read.
        ValueError: If it is none of these, or incomplete, or the noise is negative or that of a phantom, or a series is
            chosen where there is no folder.
    """
    if series_uid is not None and not path.is_dir():
        raise ValueError(f"A series is chosen in a folder of DICOM images, and {path} is none; leave out the series.")
    if path.is_dir() or path.suffix.lower() == ".npz":
        series = read_dicom_series(path, series_uid=series_uid) if path.is_dir() else read_volume(path)
        denoise = NonlocalMeans(noise_hu / 1000) if noise_hu else None
        side = series.plane.spacing * max(series.plane.shape)
        doubt = doubt_of_image(series.image)
        notes = (*series.notes, f"{path}: {doubt}") if doubt else series.notes
        return replace(_source(CTBody(series, denoise=denoise), side, size), notes=notes)
    if is_phantom(path):
        if noise_hu:
            raise ValueError(f"{path} is a phantom, which has no noise to remove; leave out its noise.")
        body = VoxelBody(read_xcist_phantom(path))
        edges = (max(abs(each.grid.x).max(), abs(each.grid.y).max()) + each.grid.spacing / 2 for each in body.maps)
        return _source(body, 2 * float(max(edges)), size)
    raise ValueError(
        f"{path}: a body is read from a folder of DICOM images, a volume of HU (.npz), or an XCIST phantom "
        "(.json, .zip)."
    )


def _source(body: Body, side: float, size: int) -> Source:
    return Source(body, ImageGrid(size, size, spacing=side / size), sum(body.extent) / 2)


def is_phantom(path: Path) -> bool:
    """Return whether a path is that of an XCIST phantom, by its name."""
    return path.suffix.lower() in (".json", ".zip") and not path.is_dir()


def fingerprint(path: Path) -> str:
    """Return the SHA-256 of a file, or of the names and contents of several.

    These are the files in a folder, and for the .json of a phantom the files beside it that it names.

    Raises:
        OSError: If something cannot be read.
    """
    if path.is_dir():
        return sha256_of_folder(path)
    if path.suffix.lower() != ".json":
        return sha256_of(path)
    text = existing_file(path).read_text(encoding="utf-8", errors="replace")
    named = sorted(file for file in path.parent.iterdir() if file.is_file() and f'"{file.name}"' in text)
    return sha256_of_files([path, *named])
