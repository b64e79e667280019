"""A page can be sent by mail: seven methods on three cases of 512 × 512 pixels, with all maps, take less than 8 MB."""

from pathlib import Path

import numpy as np
import pytest
import torch
from scipy.ndimage import gaussian_filter, zoom
from small_comparison import PROVENANCE

from pnpct.comparison import Case, ComparedMethod, Comparison, StoredImage, write_comparison
from pnpct.comparison.image_hash import image_sha256
from pnpct.files import write_image
from pnpct.geometry import ImageGrid
from pnpct.report import write_report
from pnpct.units import from_hu

SIZE = 512
GRID = ImageGrid(SIZE, SIZE, spacing=0.7)
# Noise in the body in HU, and the blur in pixels that gives it the grain of such a method: as at the lowest doses.
NOISES = {
    "fbp": (120, 0.6),
    "blurred": (30, 1.5),
    "tv": (12, 1.0),
    "supervised": (20, 0.8),
    "n2n": (20, 0.8),
    "pnp-supervised": (20, 1.0),
    "pnp": (20, 1.0),
}
GIVEN = {"reference": (30, 0.6), "truth": (0, 1.0)}


@pytest.mark.slow  # a second for each of 27 images and as many maps
def test_a_page_of_seven_methods_and_three_cases_with_all_maps_is_below_8_megabytes(tmp_path):
    methods = tuple(ComparedMethod(name, name, "compared") for name in NOISES)
    cases = tuple(_case(tmp_path, f"case-{seed}", np.random.default_rng(seed)) for seed in range(3))
    write_comparison(tmp_path, Comparison(PROVENANCE, {}, methods, cases))
    assert write_report(tmp_path, tmp_path / "report.html") == 0
    assert 4e6 < (tmp_path / "report.html").stat().st_size < 8e6


def _case(folder: Path, name: str, generator: np.random.Generator) -> Case:
    x, y = np.meshgrid(np.linspace(-1, 1, SIZE), np.linspace(-1, 1, SIZE))
    body = x**2 + (1.4 * y) ** 2 < 0.8
    organs = 60 * zoom(generator.normal(size=(16, 16)), SIZE / 16, order=1) * body
    truth = np.where(body, 40.0 + np.rint(organs / 20) * 20, -1000.0)

    def stored(what: str, image: np.ndarray) -> StoredImage:
        made = torch.from_numpy(image).float()
        write_image(folder / f"{name}-{what}.h5", made, GRID, provenance=PROVENANCE)
        return StoredImage(f"{name}-{what}.h5", image_sha256(made, GRID))

    def grain(spread: float, blur: float) -> np.ndarray:
        noise = gaussian_filter(generator.normal(size=truth.shape), blur)
        return spread / noise.std() * noise

    hu = {what: truth + grain(*noise) * np.where(body, 1.0, 0.5) for what, noise in {**NOISES, **GIVEN}.items()}
    images = {what: stored(what, from_hu(torch.from_numpy(each)).numpy()) for what, each in hu.items()}
    # Sums over discs of 8 mm, as the score test has them; 0 outside the body.
    maps = {what: {"t": stored(f"{what}-t", grain(1.0, 4.0) * body)} for what in NOISES}
    verifiable = stored("verifiable", np.where(body, 60.0 - 30 * (x**2 + y**2), 0.0))
    maps = {what: {**of, "verifiable_hu": verifiable} for what, of in maps.items()}
    maps["pnp"]["difference_hu"] = stored("difference", grain(8.0, 4.0) * body)
    return Case(name, name, 40.0, 120.0, GRID, "", (), images, maps)
