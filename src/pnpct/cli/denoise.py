"""`pnpct denoise`: from an image to a less noisy one."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from tyro.conf import Positional

from pnpct.cli.artefact import IMAGES, check_output, finish
from pnpct.cli.denoiser_options import DenoiserOptions
from pnpct.cli.devices import DeviceName, choose_device
from pnpct.cli.terminal import working
from pnpct.files import read_image, record_run, write_image
from pnpct.reconstruction import denoiser_settings


@dataclass(frozen=True)
class Denoise(DenoiserOptions):
    """Denoise an image, or each slice of a volume.

    Args:
        image: The image, .h5, .nii or .nii.gz; pnpct's networks expect FBP with the sharpest kernel (ram-lak).
        denoised: Output file: .h5 for further processing, .nii or .nii.gz (HU) for viewers, .png to look at.
        device: Where to compute; auto takes a CUDA device if there is one.
    """

    image: Positional[Path]
    denoised: Positional[Path]
    device: DeviceName = "auto"

    def run(self, command: Sequence[str]) -> None:
        """Denoise, and write the image."""
        check_output(self.denoised, IMAGES, inputs=[self.image])
        device = choose_device(self.device)
        image, grid = read_image(self.image)
        denoise = self.chosen_denoiser(device)
        with working("Denoising"):
            denoised = denoise(image.to(device)).cpu()
        settings = {**denoiser_settings(denoise), "grid": asdict(grid), "device": device.type}
        provenance = record_run(command, inputs=[self.image], settings=settings)
        write_image(self.denoised, denoised, grid, provenance=provenance)
        finish(self.denoised, provenance, summary=str(grid))
