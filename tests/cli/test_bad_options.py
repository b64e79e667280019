"""Whatever is wrong on the command line and where it writes: exit status 2, one line that says it, no trace left."""

import os

import pytest
from mistakes import Case, check, contents, cut, with_folder, with_link, with_text

from pnpct.cli import main

GOOD = "reconstruct {made}/scan.h5 {here}/out.h5"
ELSEWHERE = "reconstruct {made}/scan.h5 {here}/"
DATASET = "simulate dataset {here}/set --cases 1 --rows 1 --size 16 --views 4 --bins 8 --processes 1"
SIMULATE = "simulate scan {here}/out.h5 --size 16 --views 4 --bins 8"
HEAD = SIMULATE + " --anatomy head"

OPTIONS = [
    Case("an unknown denoiser", GOOD + " --denoiser bm3d", "denoiser bm3d tv nonlocal-means gaussian"),
    Case("an unknown kernel", GOOD + " --method fbp --kernel sharp", "--kernel sharp ram-lak hann"),
    Case("an unknown solver", GOOD + " --solver lu", "--solver lu fourier cholesky"),
    Case("an unknown method", GOOD + " --method mlem", "--method mlem fbp pnp tv"),
    Case("an unknown rule", GOOD + " --stop soon", "--stop soon relative paper never"),
    Case("a negative strength", GOOD + " --denoiser tv --strength -1", "strength from 0 up -1"),
    Case("a negative strength of tv", GOOD + " --method tv --strength -1", "strength from 0 up -1"),
    Case("a strength that is no number", GOOD + " --denoiser tv --strength nan", "strength from 0 up nan"),
    Case("a negative sigma_v", GOOD + " --sigma-v -20", "sigma_v positive HU -20"),
    Case("more damping than there is", GOOD + " --damping 1.5", "damping fraction from 0 to 1 1.5"),
    Case("damping for tv", GOOD + " --method tv --damping 0.5", "--damping no effect tv pnp"),
    Case("a sigma_v of 0", GOOD + " --sigma-v 0", "sigma_v positive 0"),
    Case("no iterations", GOOD + " --iterations 0", "at least one iteration 0"),
    Case("no inner iterations", GOOD + " --inner-iterations 0", "at least one inner iteration 0"),
    Case("inner steps of a direct solver", GOOD + " --solver fbp-blend --inner-iterations 3", "fbp-blend no inner"),
    Case("a dense factor too large", GOOD + " --solver dense-cholesky --size 129", "at most 16384 pixels 129 x 129"),
    Case("a kernel for pnp", GOOD + " --kernel hann", "--kernel no effect pnp fbp"),
    Case("iterations for fbp", GOOD + " --method fbp --iterations 3", "--iterations no effect fbp pnp or tv"),
    Case("sigma_v for tv", GOOD + " --method tv --sigma-v 20", "--sigma-v no effect tv pnp"),
    Case("a solver for tv", GOOD + " --method tv --solver cg", "--solver no effect tv pnp"),
    Case("a size of 0", GOOD + " --size 0", "at least one pixel 0"),
    Case("half a pixel", GOOD + " --size 1.5", "--size whole number 1.5 reconstruct --help"),
    Case("a size without number", GOOD + " --size", "--size value"),
    Case("a size beyond all memory", GOOD + " --method fbp --size 300000", "memory fewer pixels"),
    Case("a negative field of view", GOOD + " --field-of-view -450", "field of view positive mm -450"),
    Case("a field of view in cm", GOOD + " --field-of-view 5", "5 mm fan sees cm or m --insist"),
    Case("the focal spot in the image", GOOD + " --field-of-view 2000", "circle of the focal spot"),
    Case("no CUDA device", GOOD + " --device cuda", "--device cuda none --device cpu"),
    Case("an unknown option", GOOD + " --iteration 3", "--iteration reconstruct --help"),
    Case("a third path", GOOD + " {here}/more.h5", "more.h5"),
    Case("no output", "reconstruct {made}/scan.h5", "missing IMAGE reconstruct --help"),
    Case(
        "an unknown command", "reconstuct {made}/scan.h5 {here}/out.h5", "no command reconstuct you mean reconstruct?"
    ),
    Case("an unknown import", "import dicom {here}", "no command import dicom import arrays import catsim"),
    Case("no current", HEAD + " --tube-current-ma 0", "tube_current_ma positive mA 0"),
    Case("a negative current", HEAD + " --tube-current-ma -40", "tube_current_ma positive mA -40"),
    Case("a voltage of mammography", HEAD + " --tube-voltage-kvp 28", "70 to 140 kVp 28"),
    Case("a voltage in V", HEAD + " --tube-voltage-kvp 120000", "70 to 140 kVp 120000"),
    Case("no views", HEAD + " --views 0", "at least one view 0"),
    Case("no bins", HEAD + " --bins 0", "bins at least 1 0"),
    Case("a patient without pixels", HEAD + " --size 0", "size at least 1 0"),
    Case("a negative seed", HEAD + " --seed -1", "seed 0 -1"),
    Case("a seed that is no number", HEAD + " --seed one", "--seed whole number one"),
    Case("an unknown anatomy", SIMULATE + " --anatomy tail", "no anatomy tail abdomen, chest, head, pelvis"),
    Case("a height above the head", HEAD + " --z 900", "reaches z = 0 900"),
    Case("crosstalk above a third", HEAD + " --crosstalk 0.4", "Crosstalk 0.3 0.4"),
    Case("a body that is not there", SIMULATE + " --body {here}/no.zip", "no.zip no file"),
    Case("a body of text", SIMULATE + " --body {here}/notes.txt", "notes.txt DICOM XCIST", with_text("notes.txt", "")),
    Case("noise of a phantom", SIMULATE + " --body {here}/a.zip --noise-hu 20", "no noise", with_text("a.zip", "")),
    Case("an empty folder as body", SIMULATE + " --body {here}/empty", "empty DICOM", with_folder("empty")),
    Case("an unknown simulation", "simulate dose {here}", "no command simulate dose simulate scan, simulate dataset"),
    Case("noise without a series", SIMULATE + " --noise-hu 20", "--noise-hu --body 20"),
    Case("two patients", SIMULATE + " --anatomy head --body {here}/a.zip", "--anatomy --body", with_text("a.zip", "")),
    Case("a series in .npy", SIMULATE + " --body {here}/a.npy", "a.npy .npz", with_text("a.npy", "")),
    Case("noise of procedural patients", DATASET + " --noise-hu 20", "noise needs such a series"),
    Case("a share that is no number", DATASET + " --validation nan", "fractions"),
    Case("no cases", DATASET + " --cases 0", "needs patients"),
    Case("no rows", DATASET + " --rows 0", "rows at least 1 0"),
    Case("an unknown part of the body", DATASET + " --anatomy head,tail", "no anatomy tail"),
    Case("voltages of mammography", DATASET + " --tube-voltages-kvp 28 30", "70 to 140 kVp"),
    Case("nobody to train on", DATASET + " --validation 0.8 --test 0.5", "validation testing exceed 1"),
    Case("no processes", DATASET + " --processes 0", "at least one process 0"),
    Case("an unknown simulator", DATASET + " --simulator gate", "--simulator gate own catsim"),
    Case("more rows than the head is high", DATASET + " --anatomy head --rows 2000", "2000 rows need"),
    Case("a scan of a scan", "simulate draw {made}/scan.h5 {here}/out.h5", "pnpct-scan pnpct-exposures"),
]

WRITING = [
    Case("no such folder", ELSEWHERE + "no/out.h5", "no/out.h5 there is no folder"),
    Case("a folder for the image", ELSEWHERE + "a.h5", "a.h5 is a folder", with_folder("a.h5")),
    Case("a folder for the sidecar", GOOD, "out.h5.json is a folder", with_folder("out.h5.json")),
    Case("a link to nothing", "info {here}/a.h5", "symbolic link no file", with_link("a.h5", "a.h5")),
    Case("a device for the image", ELSEWHERE + "a.h5", "a.h5 not an ordinary file", with_link("a.h5", "/dev/full")),
    Case("an unknown format", ELSEWHERE + "out.tiff", "out.tiff .h5 .nii .nii.gz .png"),
    Case("a scan as a picture", "simulate scan {here}/out.png", "out.png .h5"),
    Case("numbers as text", "evaluate {made}/image.h5 {made}/scan.h5 {here}/out.txt", "out.txt .json"),
    Case("output over input", "reconstruct {here}/bad.h5 {here}/bad.h5", "bad.h5 is an input", cut(1.0)),
    Case(
        "a sidecar over an input",
        "import arrays {made}/counts.npy {here}/out.h5.json {here}/out.h5 --incident 1",
        "out.h5.json is an input",
        with_text("out.h5.json", "{}"),
    ),
    Case("a file for the folder of the demo", "demo {here}/a", "a: File exists", with_text("a", "")),
]


@pytest.mark.parametrize("case", [*OPTIONS, *WRITING], ids=lambda case: case.name)
def test_a_mistake_gets_one_line_and_leaves_nothing_behind(case, run, made, tmp_path, monkeypatch):
    monkeypatch.setattr("torch.cuda.is_available", lambda: False)
    check(case, run, made, tmp_path)


def test_an_older_image_survives_a_mistake(run, made, tmp_path):
    (tmp_path / "out.h5").write_text("older")
    status, _, _ = run("reconstruct", made / "scan.h5", tmp_path / "out.h5", "--sigma-v", "-1")
    assert status == 2
    assert contents(tmp_path) == {str(tmp_path / "out.h5"): b"older"}


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_that_is_not_writable_is_found_before_the_work(run, made, tmp_path):
    tmp_path.chmod(0o500)
    status, _, err = run("reconstruct", made / "scan.h5", tmp_path / "out.h5")
    assert status == 2
    assert "not writable" in err


@pytest.mark.usefixtures("full_disk")
def test_a_full_disk_gets_one_line_and_leaves_nothing_behind(run, made, tmp_path):
    status, _, err = run("reconstruct", made / "scan.h5", tmp_path / "out.h5", "--method", "fbp")
    assert status == 2
    assert err.count("\n") == 1
    assert f"{tmp_path / 'out.h5'} was not written: the disk is full" in err
    assert contents(tmp_path) == {}


def test_a_bug_shows_where_it_is(monkeypatch):
    def broken(*_, **__):
        raise RuntimeError("a bug")

    monkeypatch.setattr("pnpct.cli.parsing.parse", broken)
    with pytest.raises(RuntimeError, match="a bug"):
        main(["info", "file.h5"])
