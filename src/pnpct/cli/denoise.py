"""`pnpct denoise`: from an image to a less noisy one."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional

from pnpct.arrays import Image, Volume
from pnpct.cli.denoiser_options import DenoiserOptions
from pnpct.cli.devices import DeviceName, choose_device
from pnpct.cli.dicom_output import finish_folder
from pnpct.cli.image_input import check_series, image_of
from pnpct.cli.image_output import ImageOptions, names_folder
from pnpct.cli.parsing import option
from pnpct.cli.terminal import say, working
from pnpct.denoisers import denoiser_settings
from pnpct.files import SourceSeries, read_source_series, record_run
from pnpct.files.plausible import doubt_of_image
from pnpct.geometry import Grid


@dataclass(frozen=True)
class Denoise(DenoiserOptions, ImageOptions):
    """Denoise an image, or each slice of a volume.

    Args:
        image: The image: .h5, .nii, .nii.gz, .npz with hu [slices, rows, cols], z_mm and spacing_mm, or a folder with a
            DICOM CT series. pnpct's networks expect FBP with the sharpest kernel (ram-lak).
        denoised: Output: .h5 for further processing, .nii or .nii.gz (HU) for viewers, .png to look at. A name without
            a suffix, or one that ends with a slash, is a folder for a DICOM series, which keeps the patient, the study
            and the slice positions of the series that was read.
        series: SeriesInstanceUID of the series to read, if the folder holds several.
        device: Where to compute; auto uses a CUDA device if there is one.
    """

    image: Positional[Path]
    denoised: Positional[Path]
    series: Annotated[str | None, option(metavar="UID", default="the only one")] = None
    device: DeviceName = "auto"

    def run(self, command: Sequence[str]) -> None:
        """Denoise, and write the image."""
        self.check_image(self.denoised, command, inputs=[self.image])
        device = choose_device(self.device)
        with working("Reading"):
            image, place = self._input(command)
        if doubt := doubt_of_image(image):
            say(f"{self.image}: {doubt}")
        denoise = self.chosen_denoiser(device)
        with working("Denoising"):
            denoised = denoise(image.to(device)).cpu()
        where = {"series": place.uid} if isinstance(place, SourceSeries) else {"grid": asdict(place)}
        settings = {**denoiser_settings(denoise), **where, "device": device.type}
        provenance = record_run(command, inputs=[self.image], settings=settings)
        if isinstance(place, SourceSeries):
            finish_folder(self.denoised, denoised, place, provenance=provenance, body_part=self.body_part)
        else:
            self.finish_image(self.denoised, denoised, place, provenance=provenance)

    def _input(self, command: Sequence[str]) -> tuple[Image | Volume, Grid | SourceSeries]:
        """The image and where it is: from series to series each slice stays in its own plane."""
        check_series(self.image, self.series)
        if not (self.image.is_dir() and names_folder(self.denoised, command)):
            return image_of(self.image, self.series)
        source = read_source_series(self.image, series_uid=self.series)
        return source.image, source
