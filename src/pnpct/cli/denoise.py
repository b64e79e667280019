"""`pnpct denoise`: from an image to a less noisy one."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import nibabel as nib
from tyro.conf import Positional

from pnpct.cli.artefact import IMAGES, check_output, finish
from pnpct.cli.denoiser_options import DenoiserOptions
from pnpct.cli.devices import DeviceName, choose_device
from pnpct.cli.terminal import working
from pnpct.files import read_image, record_run, write_image
from pnpct.reconstruction import denoiser_settings


@dataclass(frozen=True)
class Denoise(DenoiserOptions):
    """Denoise an image, or each slice of it.

    Args:
        image: The image, .h5, .nii or .nii.gz; networks that pnpct trains expect FBP with the sharpest kernel.
        denoised: Where the result shall be: .h5 to go on with, .nii or .nii.gz (HU) for viewers, .png to look at.
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
        write_image(self.denoised, denoised, grid, provenance=provenance, slice_spacing=_slice_spacing(self.image))
        finish(self.denoised, provenance, summary=f"{grid.rows} x {grid.cols} pixels of {grid.spacing:.4g} mm")


def _slice_spacing(image: Path) -> float:
    """Distance between the slices of an image that has been read, mm; 1 where the format has none."""
    if image.name.lower().endswith(".h5"):
        return 1.0
    to_canonical: Any = nib.as_closest_canonical  # nibabel says no types here
    return float(to_canonical(nib.load(image)).affine[2, 2])
