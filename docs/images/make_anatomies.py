"""Draw the pictures of the guide to training scans: procedural patients, and one of them beside a real slice.

    python docs/images/make_anatomies.py [ct_series/chest.npz]

writes anatomies.png, and with a CT series also real-and-procedural.png, beside this file.
"""

import sys
from pathlib import Path

import numpy as np
from PIL import Image as Picture

from pnpct.arrays import Image
from pnpct.files import read_volume
from pnpct.geometry import ImageGrid
from pnpct.simulation import ANATOMIES, truth
from pnpct.units import to_hu

SLICES = {
    "abdomen": (-40.0, 20.0, 70.0),
    "chest": (-80.0, 0.0, 60.0),
    "head": (15.0, 60.0, 95.0),
    "pelvis": (-40.0, 0.0, 70.0),
}
WINDOWS = {"head": (0.0, 80.0)}
SIZE, SEED, REAL_SLICE = 256, 3, 52
HERE = Path(__file__).parent


def shown(image: Image, window: tuple[float, float] = (-160.0, 240.0)) -> np.ndarray:
    """Turn an image into grey values."""
    low, high = window
    return ((to_hu(image) - low) / (high - low)).clamp(0, 1).mul(255).round().byte().numpy()


def slices(anatomy: str, size: int) -> list[np.ndarray]:
    """Draw three heights of one patient."""
    chosen = ANATOMIES[anatomy]
    body = chosen.build(np.random.default_rng(SEED))
    grid = ImageGrid(size, size, spacing=0.96 * chosen.field_of_view / size)
    images = [truth(body.slice(z, grid), grid) for z in SLICES[anatomy]]
    return [shown(image, WINDOWS.get(anatomy, (-160.0, 240.0))) for image in images]


def sheet(size: int) -> Picture.Image:
    """Three slices of each anatomy, two anatomies in a row of the sheet."""
    rows = [
        np.hstack(slices(left, size) + slices(right, size))
        for left, right in (("abdomen", "chest"), ("head", "pelvis"))
    ]
    return Picture.fromarray(np.vstack(rows))


def beside_a_real_slice(series: Path, size: int) -> Picture.Image:
    """A procedural chest, and a real one."""
    grid = ImageGrid(size, size, spacing=420.0 / size)
    procedural = shown(truth(ANATOMIES["chest"].build(np.random.default_rng(SEED)).slice(0.0, grid), grid))
    hu = read_volume(series).image_hu[REAL_SLICE].astype(np.float32)
    border = 18  # of 512 pixels of 0.883 mm: 420 mm are left
    grey = np.clip((hu[border:-border, border:-border] + 160) / 400, 0, 1) * 255
    real = Picture.fromarray(grey.astype(np.uint8)).resize((size, size), Picture.Resampling.BICUBIC)
    return Picture.fromarray(np.hstack([procedural, np.asarray(real)]))


def main() -> None:
    """Draw the pictures."""
    sheet(SIZE).save(HERE / "anatomies.png", optimize=True)
    if len(sys.argv) > 1:
        beside_a_real_slice(Path(sys.argv[1]), 400).save(HERE / "real-and-procedural.png", optimize=True)


if __name__ == "__main__":
    main()
