"""Some fifty likely mistakes at the command line: each complaint says what to do instead."""

import numpy as np
import pytest
from mistakes import Case, check, with_array, with_geometry, with_text

IMPORT = "import arrays {made}/counts.npy {made}/geometry.json {here}/o.h5 --kind counts"
OTHER_ARRAY = "import arrays {here}/b.npy {made}/geometry.json {here}/o.h5"
OTHER_GEOMETRY = "import arrays {made}/counts.npy {here}/bad.json {here}/o.h5 --kind counts --incident 1e7"
RECONSTRUCT = "reconstruct {made}/scan.h5 {here}/o.h5"
COUNTS = " --kind counts --incident 1e7"
SIMULATE = "simulate scan {here}/o.h5 --size 16 --views 4 --bins 8"


def line_integrals(change):
    """Save line integrals, changed, as b.npy."""
    return lambda here, made: np.save(
        here / "b.npy", change(-np.log(np.load(made / "counts.npy").clip(1) / np.load(made / "incident.npy")))
    )


def counts(change):
    """Save the counts, changed, as b.npy."""
    return lambda here, made: np.save(here / "b.npy", change(np.load(made / "counts.npy")))


def two_arrays(here, _made):
    """Save two arrays in one file."""
    np.savez(here / "b.npz", p=np.zeros((60, 100)), q=np.zeros((60, 100)))


def in_metres(here, made):
    """Write the lengths of the geometry in m."""
    lengths = {"source_to_isocenter_mm": 0.541, "source_to_detector_mm": 0.949, "bin_width_mm": 0.0092}
    with_geometry(**lengths)(here, made)


def angles(unit, values):
    """Write view angles under the key of a unit."""
    return with_geometry(drop="views", **{f"view_angles_{unit}": [float(value) for value in values]})


COMMANDS = [
    Case("a command with a slip", "reconstuct a.h5 b.h5", "did you mean reconstruct?"),
    Case("a group with a slip", "simulat scan a.h5", "simulat did you mean simulate?"),
    Case("a command of a group with a slip", "import arays a.npy", "did you mean import arrays?"),
    Case("half a command", "import dicom {here}", "there are import arrays, import catsim"),
    Case("an option with a slip", RECONSTRUCT + " --iteration 3", "did you mean --iterations?"),
    Case("an option by another name", RECONSTRUCT + " --sigma-hu 3", "no option --sigma-hu; did you mean --sigma-v?"),
    Case("an option of others", RECONSTRUCT + " --beta 3", "no option --beta. See pnpct reconstruct --help."),
    Case("no output", "reconstruct {made}/scan.h5", "missing: IMAGE See pnpct reconstruct --help"),
    Case("half a number", RECONSTRUCT + " --size 512x512", "needs a whole number"),
    Case("a method of others", RECONSTRUCT + " --method sart", "'fbp', 'pnp', 'tv'"),
    Case("a denoiser of others", RECONSTRUCT + " --denoiser bm3d", "there are tv, nonlocal-means, .safetensors"),
    Case("a device by number", RECONSTRUCT + " --device cuda:0", "'auto', 'cpu', 'cuda'"),
    Case("no CUDA", RECONSTRUCT + " --device cuda", "use --device cpu"),
    Case("a kernel for pnp", RECONSTRUCT + " --kernel hann", "on fbp; leave out one of them"),
    Case("a strength for fbp", RECONSTRUCT + " --method fbp --strength 3", "on pnp or tv; leave out one of them"),
    Case("a penalty without its sense", RECONSTRUCT + " --sigma-v -40", "is a positive number of HU"),
    Case("no iterations", RECONSTRUCT + " --iterations 0", "needs at least one iteration"),
    Case("a field of view in cm", RECONSTRUCT + " --field-of-view 5", "is it in cm or m? --insist"),
    Case("a field of view in µm", RECONSTRUCT + " --field-of-view 500000", "is it in µm? --insist"),
]

FILES = [
    Case("a name with a slip", "reconstruct {made}/scn.h5 {here}/o.h5", "There is no file there is scan.h5"),
    Case("a folder for a scan", "reconstruct {made} {here}/o.h5", "a file is needed"),
    Case("an array for a scan", "reconstruct {made}/counts.npy {here}/o.h5", "give a file that pnpct has written"),
    Case("an image for a scan", "reconstruct {made}/image.h5 {here}/o.h5", '"pnpct-scan" was needed; choose another'),
    Case("a scan for an image", "denoise {made}/scan.h5 {here}/o.h5", '"pnpct-image" was needed; choose another'),
    Case("a scan for exposures", "simulate draw {made}/scan.h5 {here}/o.h5", '"pnpct-exposures" was needed; choose'),
    Case("an image as DICOM", "reconstruct {made}/scan.h5 {here}/o.dcm", "must end in .h5, .nii, .nii.gz, .png"),
    Case("no folder", "reconstruct {made}/scan.h5 {here}/no/o.h5", "make it first"),
    Case("the input as output", "reconstruct {made}/scan.h5 {made}/scan.h5", "choose another name for the output"),
    Case("a folder of other files", "simulate dataset {made} --cases 1", "choose another folder"),
    Case("no data set", "train {made} {here}/n.safetensors", "make one by pnpct simulate dataset"),
    Case("a scan for a data set", "train {made}/scan.h5 {here}/n.safetensors", "folder is needed --method single-scan"),
    Case("a network as .pt", "train {made} {here}/n.pt", "must end in .safetensors"),
    Case("no scan to compare", "compare {here}/c", "needs at least one scan"),
    Case("a voltage in V", SIMULATE + " --tube-voltage-kvp 120000", "from 70 to 140 kVp"),
    Case("a series as a file", SIMULATE + " --body {made}/image.h5", "a folder of DICOM images, a volume of HU"),
]

ARRAYS = [
    Case("bins x views", OTHER_ARRAY + COUNTS, "transpose it", counts(np.transpose)),
    Case("an axis too many", OTHER_ARRAY + COUNTS, "60 views and 100 bins; correct", counts(lambda a: a[..., None])),
    Case("counts as line integrals", IMPORT.removesuffix(" --kind counts"), "set kind to counts"),
    Case("a sinogram", IMPORT.replace("--kind counts", "--kind sinogram"), "'counts', 'line-integrals'"),
    Case("ln without its minus", OTHER_ARRAY, "the wrong sign? --insist", line_integrals(np.negative)),
    Case("ln of 0", OTHER_ARRAY, "write NaN", line_integrals(lambda p: np.where(p > 1, np.inf, p))),
    Case("complex numbers", OTHER_ARRAY, "convert it", line_integrals(lambda p: p + 0j)),
    Case("text", OTHER_ARRAY, "numpy.save", with_text("b.npy", "1, 2")),
    Case("two arrays", OTHER_ARRAY.replace("b.npy", "b.npz"), "choose one b.npz:p", two_arrays),
    Case("no incident counts", IMPORT, "give incident"),
    Case("incident counts of another exposure", IMPORT + " --incident 30", "of another exposure --insist"),
    Case("a row of incident counts", IMPORT + " --incident {here}/b.npy", "(60, 1)", with_array("b.npy", np.ones(60))),
    Case("dark signal off twice", OTHER_ARRAY + COUNTS, "subtracted twice", counts(lambda a: a - a.min() - 1000)),
    Case("a mask of zeros", IMPORT + " --incident 1e7 --mask {here}/b.npy", "a 1", with_array("b.npy", np.zeros(100))),
    Case("mu_water in 1/cm", IMPORT + " --incident 1e7 --mu-water 0.19", "is it in 1/cm? --insist"),
]

GEOMETRIES = [
    Case("a key that is missing", OTHER_GEOMETRY, "bin_width_mm; add", with_geometry(drop="bin_width_mm")),
    Case("a key of others", OTHER_GEOMETRY, "unknown keys: sid; known are bin_width_mm", with_geometry(sid=541)),
    Case("lengths in m", OTHER_GEOMETRY, "is it in m? --insist", in_metres),
    Case("degrees as rad", OTHER_GEOMETRY, "view_angles_deg? --insist", angles("rad", range(0, 360, 6))),
    Case("rad as degrees", OTHER_GEOMETRY, "view_angles_rad? --insist", angles("deg", np.arange(0, 6.3, 0.106))),
    Case("a view too many", OTHER_GEOMETRY, "61 views and 100 bins; correct one", with_geometry(views=61)),
    Case("the distance behind", OTHER_GEOMETRY, "both from the focal spot", with_geometry(source_to_detector_mm=408)),
    Case("a curved detector", OTHER_GEOMETRY, "one of arc, flat", with_geometry(detector="curved")),
    Case("no JSON", OTHER_GEOMETRY, "this is not JSON", with_text("bad.json", "sid = 541")),
]

MISTAKES = [*COMMANDS, *FILES, *ARRAYS, *GEOMETRIES]


@pytest.mark.parametrize("case", MISTAKES, ids=lambda case: case.name)
def test_a_likely_mistake_is_told_its_remedy(case, run, made, tmp_path, monkeypatch):
    monkeypatch.setattr("torch.cuda.is_available", lambda: False)
    check(case, run, made, tmp_path)
