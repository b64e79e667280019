"""`pnpct measure`: from images of a phantom to noise power, sharpness and detectability."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional

from pnpct.cli.artefact import check_output, finish
from pnpct.cli.image_input import image_of
from pnpct.cli.parsing import option
from pnpct.cli.scores import say_scores
from pnpct.cli.seeds import generators
from pnpct.cli.terminal import say, working
from pnpct.evaluation import PhantomFigures, measure_phantom
from pnpct.files import record_run
from pnpct.files.plausible import doubt_of_image
from pnpct.geometry import VolumeGrid
from pnpct.report import write_phantom_page


@dataclass(frozen=True)
class Measure:
    """Measure noise power, sharpness and detectability on images of a phantom, and show them as a page.

    Slices (or a batch) count as repeated scans: the phantom is the same in all of them, and they must not overlap. With
    one image alone, the smooth part of its uniform region is subtracted. Positions are in mm from
    the isocentre, or as the file has them, x to the right and y to the front.

    Args:
        image: Images of the phantom: .h5, .nii, .nii.gz, .npz with hu [slices, rows, cols], z_mm and spacing_mm, or a
            folder with a DICOM CT series.
        page: File for the page, .html; all curves are written beside it as JSON.
        uniform: Where the phantom is uniform: x and y of the centre of a square, and its side, mm.
        disc: A rod or disc for the transfer function (TTF): x and y of its centre and its diameter, mm. It is at least
            8 pixels wide, and uniform material surrounds it out to twice its diameter.
        lesion: Contrast in HU and diameter in mm of a disc to detect, for d′ of the non-prewhitening matched filter,
            without and with an eye filter; its contrast should be near that of --disc.
        insert: An insert of low contrast to detect: x and y of its centre and its diameter, mm, for d′ of a channelised
            Hotelling observer. At least 40 images are needed, and the noise should be the same as in the middle of the
            uniform region.
        seed: Random seed of the splits and resamples of that observer.
        series: SeriesInstanceUID of the series to read, if the folder holds several.
    """

    image: Positional[Path]
    page: Positional[Path]
    uniform: tuple[float, float, float]
    disc: Annotated[tuple[float, float, float] | None, option(default="none")] = None
    lesion: Annotated[tuple[float, float] | None, option(default="none")] = None
    insert: Annotated[tuple[float, float, float] | None, option(default="none")] = None
    seed: int = 0
    series: Annotated[str | None, option(metavar="UID", default="the only one")] = None

    def run(self, command: Sequence[str]) -> None:
        """Measure, print the numbers, and write the page."""
        check_output(self.page, (".html",), inputs=[self.image])
        with working("Measuring"):
            image, grid = image_of(self.image, self.series)
            plane = grid.plane if isinstance(grid, VolumeGrid) else grid
            found = measure_phantom(
                image.reshape(-1, *plane.shape),
                plane,
                uniform=self.uniform,
                disc=self.disc,
                lesion=self.lesion,
                insert=self.insert,
                generator=generators(self.seed)[0],
            )
        if doubt := doubt_of_image(image):
            say(f"{self.image}: {doubt}")
        say_scores({self.image.name: found.values})
        write_phantom_page(self.page, self.image.name, found)
        provenance = record_run(command, inputs=[self.image], seed=self.seed, settings=_settings(found))
        finish(self.page, provenance, summary=f"{len(found.values)} numbers")


def _settings(found: PhantomFigures) -> dict[str, object]:
    """The numbers and curves, in plain values."""
    rings, transfer = found.power.radial(), found.transfer
    curves = {"noise_power_hu2_mm2": {"frequency_per_mm": rings.frequencies.tolist(), "values": rings.power.tolist()}}
    if transfer is not None:
        edge = {"frequency_per_mm": transfer.frequencies.tolist(), "values": transfer.transfer.tolist()}
        curves["transfer"] = edge
    return {"numbers": found.finite, "curves": curves}
