"""The images of a comparison in its folder: made once, and read when the comparison is begun again."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from pnpct.arrays import Image
from pnpct.comparison.image_hash import image_sha256
from pnpct.comparison.schema import StoredImage
from pnpct.files import FileFormatError, Provenance, read_image, write_image, write_sidecar
from pnpct.geometry import ImageGrid


@dataclass(frozen=True)
class ImageFolder:
    """Where the images of one case are stored.

    Args:
        comparison: Folder of the comparison.
        place: Path of the case's images from there.
        grid: Where all their pixels are.
        origin: What all of them depend on, in plain values.
    """

    comparison: Path
    place: str
    grid: ImageGrid
    origin: Mapping[str, Any]

    def get(self, name: str, make: Callable[[], Image], settings: Mapping[str, Any]) -> tuple[Image, StoredImage]:
        """Return an image that is made now, or was by an earlier run with the same settings.

        Args:
            name: Of the image.
            make: Makes it.
            settings: What it depends on besides `origin`.

        Raises:
            OSError: If a file cannot be read or written.
        """
        file = f"{self.place}/{name}.h5"
        path, settings = self.comparison / file, {**self.origin, **settings}
        if (stored := _stored(path, self.grid, settings)) is not None:
            image, seconds = stored
        else:
            began = time.perf_counter()
            image = make()
            seconds = round(time.perf_counter() - began, 3)
            path.parent.mkdir(parents=True, exist_ok=True)
            provenance = Provenance(["pnpct", "compare"], version("pnpct"), settings={**settings, "seconds": seconds})
            write_image(path, image, self.grid, provenance=provenance)
            write_sidecar(path, provenance)
        return image, StoredImage(file, image_sha256(image, self.grid), seconds)


def _stored(path: Path, grid: ImageGrid, settings: Mapping[str, Any]) -> tuple[Image, float] | None:
    try:
        made = dict(Provenance.from_json(path.with_name(path.name + ".json").read_text()).settings)
        image, of_image = read_image(path)
    except (OSError, FileFormatError):
        return None
    seconds = float(made.pop("seconds", 0.0))
    fresh = Provenance([], version("pnpct"), settings=settings).settings
    return (image, seconds) if made == fresh and of_image == grid else None
