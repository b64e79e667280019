"""`pnpct evaluate`: from an image and the truth to numbers."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional

from pnpct.cli.artefact import NUMBERS, check_output, finish
from pnpct.cli.image_input import image_of, truth_of
from pnpct.cli.parsing import option
from pnpct.cli.scores import say_scores, write_scores
from pnpct.cli.terminal import say, working
from pnpct.comparison import (
    fidelity_values,
    histogram_values,
    score_definitions,
    texture_values,
    why_no_texture,
)
from pnpct.evaluation import on_one_grid
from pnpct.files import record_run
from pnpct.files.plausible import doubt_of_image


@dataclass(frozen=True)
class Evaluate:
    """Compare an image or a volume with the truth.

    Errors are in HU, over the whole image, the body, soft tissue and ranges of HU of the truth. The names of PSNR (dB)
    and SSIM in the body include the level and width of their window. There follow the scores of ldct-benchmark in its
    three windows and of LoDoPaB on whole slices, the earth mover's distance between the histograms of the body, and the
    texture (GLCM) of patches of soft tissue. A tissue that the truth does not have gets no number. Values that look as
    if they were in another unit are pointed out.

    Args:
        image: The image: .h5, .nii, .nii.gz, .npz with hu [slices, rows, cols], z_mm and spacing_mm, or a folder with a
            DICOM CT series.
        truth: The truth on the same grid: an image or a series as above, or a scan that holds its truth.
        numbers: File for the numbers, .json; they are printed in any case.
        series: SeriesInstanceUID of the image, if its folder holds several series.
        truth_series: SeriesInstanceUID of the truth, if its folder holds several series.
    """

    image: Positional[Path]
    truth: Positional[Path]
    numbers: Annotated[Positional[Path | None], option(default="none")] = None
    series: Annotated[str | None, option(metavar="UID", default="the only one")] = None
    truth_series: Annotated[str | None, option(metavar="UID", default="the only one")] = None

    def run(self, command: Sequence[str]) -> None:
        """Compare, print the numbers, and write them."""
        if self.numbers:
            check_output(self.numbers, NUMBERS, inputs=[self.image, self.truth])
        with working("Measuring"):
            image, truth = on_one_grid(image_of(self.image, self.series), truth_of(self.truth, self.truth_series))
            values = fidelity_values(image, truth) | histogram_values(image, truth) | texture_values(image, truth)
        for path, each in ((self.image, image), (self.truth, truth)):
            if doubt := doubt_of_image(each):
                say(f"{path}: {doubt}")
        say_scores({self.image.name: values})
        if values["glcm_contrast"] is None:
            say(f"No texture: {why_no_texture(truth)}")
        if self.numbers:
            write_scores(self.numbers, values)
            settings = {"scores": score_definitions()}
            provenance = record_run(command, inputs=[self.image, self.truth], settings=settings)
            finish(self.numbers, provenance, summary=f"{len(values)} numbers")
