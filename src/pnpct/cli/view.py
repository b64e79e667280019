"""`pnpct view`: a volume as a page to look at."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional

from pnpct.arrays import Volume
from pnpct.cli.artefact import check_output, finish
from pnpct.cli.image_input import image_of
from pnpct.cli.parsing import option
from pnpct.cli.terminal import working
from pnpct.files import record_run
from pnpct.geometry import VolumeGrid
from pnpct.report import write_volume_page

_PAGES = (".html",)


@dataclass(frozen=True)
class View:
    """Write a volume as one HTML page that works offline: three planes, windows, and the HU under the pointer.

    The page contains the viewer (NiiVue) and the volume, in whole HU.

    Args:
        volume: An image file with several slices, or a folder with a DICOM CT series.
        page: Output, .html.
        beside: A second volume, which is scrolled together with the first, by position in mm.
        window: Level and width of the window in which it is first shown, HU.
        series: SeriesInstanceUID of the series to show, if the folder holds several.
    """

    volume: Positional[Path]
    page: Positional[Path]
    beside: Annotated[Path | None, option(default="none")] = None
    window: tuple[float, float] = (40.0, 400.0)
    series: Annotated[str | None, option(metavar="UID", default="the only one")] = None

    def run(self, command: Sequence[str]) -> None:
        """Read, and write the page."""
        paths = [self.volume] if self.beside is None else [self.volume, self.beside]
        check_output(self.page, _PAGES, inputs=paths)
        if self.beside is not None and self.beside.resolve() == self.volume.resolve():
            raise ValueError(f"--beside needs another volume than {self.volume}.")
        volumes = dict(zip(_labels(paths), map(self._volume, paths), strict=True))
        with working("Packing"):
            write_volume_page(self.page, volumes, window=self.window)
        size = self.page.stat().st_size / 1e6
        finish(self.page, record_run(command, inputs=paths), summary=f"a page of {size:.1f} MB, for any browser")

    def _volume(self, path: Path) -> tuple[Volume, VolumeGrid]:
        image, grid = image_of(path, self.series if path == self.volume else None)
        if not isinstance(grid, VolumeGrid) or image.ndim != 3:
            raise ValueError(f"{path} holds no volume: several slices are needed; look at an image as .png.")
        return image, grid


def _labels(paths: Sequence[Path]) -> list[str]:
    """What the volumes are called: by name, or by path where the names are equal."""
    names = [path.resolve().name for path in paths]
    return names if len(set(names)) == len(names) else [str(path) for path in paths]
