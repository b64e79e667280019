"""From a folder of clinical projections to an image: every variant of the format gives that of the native scan."""

from itertools import product

import ct_pd_views as writer
import numpy as np
import pytest
from ct_pd_views import native_scan, write_folder

from pnpct.files import Provenance, read_image, write_scan

MODES, VENDORS = ("FFSNONE", "FFSZ", "FFSXY", "FFSXYZ"), ("SIEMENS", "GE MEDICAL SYSTEMS")
VARIANTS = list(product(MODES, (8, 10), VENDORS, (True, False)))
QUICK = [("FFSZ", 8, VENDORS[1], True), ("FFSXYZ", 10, VENDORS[0], False)]
"""Each dictionary, vendor and layout is in one of them."""
VIEWS, FEED = 70, 0.3
FBP = ["--method", "fbp", "--size", "32", "--field-of-view", "200", "--slices", "2"]


@pytest.fixture(scope="module")
def native_image(tmp_path_factory):
    """From the mode of the focal spot to the image of the scan that was never in DICOM."""
    from pnpct.cli import main

    folder, images = tmp_path_factory.mktemp("native"), {}

    def image(mode: str):
        if mode not in images:
            scan = folder / f"{mode}.h5"
            write_scan(scan, native_scan(VIEWS, mode, FEED), provenance=Provenance(["pnpct"], "0.1.0"))
            assert main(["reconstruct", str(scan), str(folder / f"{mode} image.h5"), *FBP]) == 0
            images[mode] = read_image(folder / f"{mode} image.h5")
        return images[mode]

    return image


@pytest.mark.parametrize(
    ("mode", "version", "vendor", "by_columns"),
    [variant if variant in QUICK else pytest.param(*variant, marks=pytest.mark.slow) for variant in VARIANTS],
)
def test_every_variant_has_the_image_of_the_native_scan(run, tmp_path, native_image, mode, version, vendor, by_columns):
    options = {"mode": mode, "version": version, "vendor": vendor, "by_columns": by_columns}
    options |= {"explicit": version == 8, "scale_per_view": by_columns, "views": VIEWS, "feed": FEED}
    write_folder(tmp_path / "views", **options)
    assert run("import", "dicom-ct-pd", tmp_path / "views", tmp_path / "scan.h5")[0] == 0
    assert run("reconstruct", tmp_path / "scan.h5", tmp_path / "image.h5", *FBP)[0] == 0
    image, grid = read_image(tmp_path / "image.h5")
    native, of_native = native_image(mode)
    assert grid.heights == pytest.approx(of_native.heights, abs=1e-3)
    assert 1000 * float((image - native).abs().max()) < 0.5
    # The ball is at its place: x to the right, y up.
    x, y = np.meshgrid(grid.plane.x, grid.plane.y)
    ball = image[0].numpy() * (np.hypot(x - writer.BALL[0], y - writer.BALL[1]) < 60)
    assert [(ball * along).sum() / ball.sum() for along in (x, y)] == pytest.approx(writer.BALL[:2], abs=0.5)
