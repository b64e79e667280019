"""Whatever is wrong in the files a user gives: exit status 2, one line that says it, and no trace on the disk."""

import numpy as np
import pytest
from mistakes import (
    Case,
    check,
    cut,
    with_array,
    with_attributes,
    with_catsim,
    with_count,
    with_counts,
    with_dataset,
    with_geometry,
    with_text,
    without,
)

ARRAYS = (
    "import arrays {made}/counts.npy {made}/geometry.json {here}/out.h5 --kind counts --incident {made}/incident.npy"
)
BAD_ARRAY = ARRAYS.replace("{made}/counts.npy", "{here}/bad.npy")
BAD_GEOMETRY = ARRAYS.replace("{made}/geometry.json", "{here}/bad.json")
CATSIM = "import catsim {here}/raw {here}/out.h5 --configuration {here}/raw.json"
BAD = "reconstruct {here}/bad.h5 {here}/out.h5"
EVALUATE = "evaluate {here}/bad.h5 {made}/scan.h5 {here}/out.json"
AGAINST = "evaluate {made}/image.h5 {here}/bad.h5 {here}/out.json"

IMPORTING = [
    Case("transposed counts", BAD_ARRAY, "(100, 60) 60 views 100 bins transpose", with_counts(np.transpose)),
    Case("counts of another shape", BAD_ARRAY, "(60, 80) 60 views 100 bins", with_counts(lambda a: a[:, :80])),
    Case("counts with infinity", BAD_ARRAY, "bad.npy not finite", with_counts(lambda a: np.where(a > 5e3, np.inf, a))),
    Case("counts that are all NaN", BAD_ARRAY, "No ray was measured", with_counts(lambda a: a * np.nan)),
    Case("negative counts", BAD_ARRAY, "lowest count -1000", with_counts(lambda a: a - a.min() - 1000)),
    Case("counts as line integrals", ARRAYS + " --kind line-integrals", "no line integral counts"),
    Case("no array", BAD_ARRAY, "There is no file bad.npy"),
    Case("text for an array", BAD_ARRAY, "bad.npy not a complete .npy", with_text("bad.npy", "1, 2, 3")),
    Case(
        "no such member", BAD_ARRAY.replace("bad.npy", "a.npz:b"), "a.npz no array b", with_array("a.npz", np.ones(3))
    ),
    Case("no geometry", BAD_GEOMETRY, "There is no file bad.json"),
    Case("broken JSON", BAD_GEOMETRY, "bad.json not JSON", with_text("bad.json", '{"bins": ')),
    Case("unknown keys", BAD_GEOMETRY, "bad.json unknown keys binz", with_geometry(binz=225)),
    Case("missing keys", BAD_GEOMETRY, "bad.json missing keys bin_width_mm", with_geometry(drop="bin_width_mm")),
    Case("detector too near", BAD_GEOMETRY, "beyond the isocentre 500", with_geometry(source_to_detector_mm=500)),
    Case("a bin width in metres", BAD_GEOMETRY, "90 degrees mm", with_geometry(bin_width_mm=1000)),
    Case("no incident counts", ARRAYS.split(" --incident")[0], "Counts need their incident counts"),
    Case("incident of 0", ARRAYS.replace("{made}/incident.npy", "0"), "incident counts positive"),
    Case("mu_water of 0", ARRAYS + " --mu-water 0", "mu_water positive 1/mm"),
    Case("mu_water in 1/cm", ARRAYS + " --mu-water 0.19", "0.19/mm usual 1/cm --insist"),
    Case("negative noise", ARRAYS + " --electronic-noise -1", "electronic_noise not negative -1"),
    Case("a quantum of 0", ARRAYS + " --signal-per-quantum 0", "signal_per_quantum positive"),
    Case("a quantum of next to nothing", ARRAYS + " --signal-per-quantum 1e-307", "counts of up to got inf"),
    Case(
        "a correction for other bins",
        ARRAYS + " --beam-hardening {here}/bad.npy",
        "80 bins 100",
        with_array("bad.npy", np.tile([1.0, 0.0], (80, 1))),
    ),
    Case("no configuration of CatSim", CATSIM, "There is no file raw.json"),
    Case("no raw file", CATSIM, "There is no file raw.scan", with_catsim(0, 3)),
    Case("no air scan", CATSIM, "There is no file raw.air", with_catsim(6, 0)),
    Case("a raw file truncated", CATSIM, "raw.scan truncated", with_catsim(5, 3)),
    Case("an air scan truncated", CATSIM, "raw.air 8 bytes truncated", with_catsim(6, 2)),
    Case("no such detector row", CATSIM + " --detector-row 3", "rows 0 to 0 row 3", with_catsim(6, 3)),
]

READING = [
    *(Case(f"a scan cut to {share}", BAD, "bad.h5", cut(share)) for share in (0.0, 0.001, 0.3, 0.9, 0.999)),
    Case("no scan", BAD, "There is no file bad.h5"),
    Case("a folder for a scan", "reconstruct {made} {here}/out.h5", "is a folder file is needed"),
    Case("text for a scan", BAD, "bad.h5 not an HDF5 file", with_text("bad.h5", "a scan")),
    Case("an image for a scan", "reconstruct {made}/image.h5 {here}/out.h5", "image.h5 pnpct-image pnpct-scan needed"),
    Case("a foreign HDF5 file", BAD, "bad.h5 not one of pnpct's", with_attributes("/", format=3)),
    Case("a newer version", BAD, "bad.h5 version 99 newer update", with_attributes("/", format_version=np.int64(99))),
    Case("a scan without counts", BAD, "bad.h5 /counts is missing", without("counts")),
    Case("a scan without geometry", BAD, "bad.h5 /geometry is missing", without("geometry")),
    Case("a scan with NaN", BAD, "bad.h5 /counts not finite", with_count(np.nan)),
    Case("a scan with a negative count", BAD, "bad.h5 lowest count -1e+06", with_count(-1e6)),
    Case("counts that do not fit", BAD, "bad.h5 counts (3, 4) (60, 100)", with_dataset("counts", 3, 4)),
    Case("incident that does not fit", BAD, "bad.h5 incident (60, 100) (7,)", with_dataset("incident", 7)),
    Case(
        "an image that no ray meets",
        BAD,
        "ray",
        with_attributes("truth/image", center_xy_mm=(400.0, 0.0), spacing_mm=0.5),
    ),
    Case("an image far away", BAD, "circle of the focal spot", with_attributes("truth/image", center_xy_mm=(9e3, 0.0))),
    Case("info on text", "info {here}/bad.h5", "bad.h5 not an HDF5 file", with_text("bad.h5", "text")),
    Case("info on nothing", "info {here}/bad.h5", "There is no file bad.h5"),
]

COMPARING = [
    Case(
        "an image of another size",
        EVALUATE,
        "10 x 10 pixels 64 x 64",
        with_dataset("image", 10, 10, of="image.h5", rows=10, cols=10),
    ),
    Case("other pixels", EVALUATE, "3.6 mm 3.90625 mm", with_attributes("image", of="image.h5", spacing_mm=3.6)),
    Case("an image aside", EVALUATE, "(1, 0) (0, 0)", with_attributes("image", of="image.h5", center_xy_mm=(1.0, 0.0))),
    Case("a batch", EVALUATE, "one shape (2, 64, 64)", with_dataset("image", 2, 64, 64, of="image.h5")),
    Case("an image truncated", EVALUATE, "bad.h5 truncated", cut(0.9, of="image.h5")),
    Case("a picture for an image", "evaluate {here}/a.png {made}/scan.h5", "a.png 256 greys", with_text("a.png", "")),
    Case("a scan for an image", "evaluate {made}/scan.h5 {made}/scan.h5", "pnpct-scan pnpct-image needed"),
    Case("a scan without truth", AGAINST, "bad.h5 without its truth", without("truth")),
    Case("a constant truth", AGAINST, "reference constant no range", with_dataset("truth/image", 64, 64, value=0.0)),
    Case("NIfTI truncated", "evaluate {here}/a.nii {made}/scan.h5", "a.nii complete NIfTI", with_text("a.nii", "n+1")),
    Case("no truth", "evaluate {made}/image.h5", "missing TRUTH"),
]


@pytest.mark.parametrize("case", [*IMPORTING, *READING, *COMPARING], ids=lambda case: case.name)
def test_a_bad_file_gets_one_line_and_leaves_nothing_behind(case, run, made, tmp_path):
    check(case, run, made, tmp_path)
