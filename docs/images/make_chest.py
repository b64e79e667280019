"""Draw the picture of the README: one low-dose scan of the procedural chest, reconstructed twice, beside the truth.

    python docs/images/make_chest.py

writes chest.png beside this file and says how far each image is from the truth. It takes seconds on two cores.
"""

from pathlib import Path

import numpy as np
import torch
from PIL import Image as Picture
from PIL import ImageDraw, ImageFont

from pnpct.arrays import Image
from pnpct.evaluation import WINDOWS, evaluate
from pnpct.files import load_denoiser
from pnpct.geometry import ImageGrid
from pnpct.operators import Projector
from pnpct.physics import take_log
from pnpct.reconstruction import fbp, reconstruct
from pnpct.simulation import chest_body, clinical_fan_beam, expose, scanner_beam, truth
from pnpct.units import to_hu

FIELD_OF_VIEW = 400.0  # mm
TUBE_CURRENT_MA, SEED = 5.0, 5
WIDTH, HEADER = 384, 34  # of a panel in the picture, and of the line with its name


def reconstructions(*, size: int, views: int, bins: int) -> dict[str, Image]:
    """Scan the chest, and reconstruct it; the kernel of FBP is the one with the smaller error."""
    grid, fine = (ImageGrid(pixels, pixels, FIELD_OF_VIEW / pixels) for pixels in (size, 2 * size))
    phantom = chest_body(np.random.default_rng(SEED)).slice(0.0, fine)
    geometry, noise = clinical_fan_beam(views=views, bins=bins), torch.Generator().manual_seed(SEED)
    scan = expose(phantom, geometry).scan(tube_current_ma=TUBE_CURRENT_MA, generator=noise)
    sinogram = take_log(scan)
    A = Projector(grid, geometry, mu_water=scan.mu_water)
    return {
        "Filtered back-projection": fbp(sinogram.line_integrals, A, kernel="soft"),
        "Plug-and-play ADMM": reconstruct(sinogram, A, load_denoiser()),
        "Truth": truth(phantom, grid, energy=scanner_beam(geometry).effective_energy),
    }


def panel(image: Image) -> Picture.Image:
    """Show the middle rows through the abdomen window, 400 HU wide."""
    low, high = WINDOWS["abdomen"]
    border = len(image) // 7
    shown = ((to_hu(image[border:-border]) - low) / (high - low)).clamp(0, 1)
    greys = shown.mul(255).round().to(torch.uint8).numpy()
    height = WIDTH * len(greys) // greys.shape[1]
    return Picture.fromarray(greys).resize((WIDTH, height), Picture.Resampling.BICUBIC)


def draw(images: dict[str, Image], path: Path) -> None:
    """Write the images side by side, each under its name."""
    panels = {name: panel(image) for name, image in images.items()}
    height = HEADER + panels["Truth"].height
    picture = Picture.new("L", (WIDTH * len(panels), height), color=255)
    pen, font = ImageDraw.Draw(picture), ImageFont.load_default(size=17)
    for number, (name, shown) in enumerate(panels.items()):
        picture.paste(shown, (number * WIDTH, HEADER))
        pen.text(((number + 0.5) * WIDTH, HEADER / 2), name, fill=0, font=font, anchor="mm")
    picture.save(path, optimize=True)


def main() -> None:
    """Draw the picture, and print the errors."""
    images = reconstructions(size=256, views=492, bins=450)
    draw(images, Path(__file__).with_name("chest.png"))
    for name, image in images.items():
        print(f"{name}: {evaluate(image, images['Truth'])['soft_tissue_rmse_hu']:.1f} HU in soft tissue")


if __name__ == "__main__":
    main()
