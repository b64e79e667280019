"""Draw two scans at 20 mA by several methods: python docs/images/make_quality.py FOLDER.

FOLDER is that of benchmarks/quality.py, after a run with the cases abdomen and pelvis. Writes quality.png beside this
file.
"""

import sys
from pathlib import Path

from PIL import Image as Picture

from pnpct.comparison import Detail
from pnpct.files import read_image, record_run
from pnpct.report import PanelRow, write_panels

HERE = Path(__file__).parent
COLUMNS = {
    "TV-PWLS": "20mA-TV-PWLS",
    "two-stage denoiser": "20mA-two-stage",
    "PnP, two-stage": "20mA-PnP-two-stage",
    "truth": "truth",
}
DETAILS = {"abdomen": Detail(180, 120, 110), "pelvis": Detail(180, 200, 110)}


def main() -> None:
    """Read the images and draw them."""
    folder, path = Path(sys.argv[1]), HERE / "quality.png"
    rows = [
        PanelRow(
            f"{case}, 20 mA",
            {label: read_image(folder / f"{case}-{name}.h5")[0] for label, name in COLUMNS.items()},
            [detail],
        )
        for case, detail in DETAILS.items()
    ]
    write_panels(path, rows, provenance=record_run(sys.argv), window=(30.0, 400.0))
    with Picture.open(path) as picture:
        width, height = picture.size
        small = picture.convert("L").resize((1400, round(1400 * height / width)), Picture.Resampling.LANCZOS)
    small.quantize(32, dither=Picture.Dither.NONE).save(path, optimize=True)


if __name__ == "__main__":
    main()
