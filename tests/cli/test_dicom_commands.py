"""CT series in DICOM at the command line: in and out of folders."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import torch
from mistakes import Case, check
from pydicom import Dataset, dcmread

from pnpct.denoisers import make_denoiser
from pnpct.files import Provenance, read_image, read_scan, read_source_series, write_dicom_series, write_scan
from pnpct.geometry import ImageGrid, VolumeGrid

STACK = VolumeGrid(ImageGrid(24, 20, spacing=2.0, center=(3.0, -1.0)), slices=3, slice_spacing=2.5, z=80.0)


def images(folder: Path) -> list[Dataset]:
    return [dcmread(path) for path in sorted(folder.iterdir())]


def changed(folder: Path, **changes: object) -> Path:
    """Make a series look like that of a hospital."""
    for number, path in enumerate(sorted(folder.iterdir())):
        image = dcmread(path)
        image.PatientName, image.PatientID = "Doe^Jane", "4711"
        for name in ("PatientComments", "PatientIdentityRemoved", "DeidentificationMethod"):
            image.pop(name, None)
        for name, value in changes.items():
            setattr(image, name, value[number] if isinstance(value, tuple) else value)
        image.file_meta.ImplementationClassUID = "1.2.3"
        image.save_as(path)
    return folder


@pytest.fixture(scope="module")
def series(tmp_path_factory) -> Path:
    """A folder with a series of three slices, not of pnpct."""
    folder = tmp_path_factory.mktemp("hospital") / "series"
    noise = 0.02 * torch.randn(3, 24, 20, generator=torch.Generator().manual_seed(1))
    write_dicom_series(folder, 1 + noise, STACK, provenance=Provenance(["pnpct"], "0.1.0"), body_part="CHEST")
    return changed(folder, StudyInstanceUID="1.2.77", FrameOfReferenceUID="1.2.78", Manufacturer="ACME")


@pytest.mark.parametrize("name", ["out", "out.2026/"])
def test_a_reconstruction_is_a_series(name, run, made, tmp_path):
    status, out, err = run("reconstruct", made / "scan.h5", f"{tmp_path}/{name}", "--method", "fbp")
    folder = tmp_path / name
    assert (status, err) == (0, "")
    assert out == f"Wrote {folder}: 64 x 64 pixels of 3.906 mm, as a DICOM series of a fictitious patient.\n"
    (one,) = images(folder)
    image, _ = read_image(made / "image.h5")
    np.testing.assert_array_equal(one.pixel_array, np.rint(1000 * (image.double().numpy() - 1)).clip(-1024))
    assert (one.ImageType[0], one.BodyPartExamined, one.ConvolutionKernel) == ("ORIGINAL", "HEAD", "HANN")
    assert Provenance.from_json(folder.with_name(folder.name + ".json").read_text()).settings["method"] == "fbp"
    before = (folder / "0001.dcm").read_bytes()
    assert run("reconstruct", made / "scan.h5", f"{tmp_path}/{name}", "--method", "fbp")[0] == 0
    assert (folder / "0001.dcm").read_bytes() == before
    words = ["--method", "tv", "--iterations", "2", "--body-part", "skull"]
    assert run("reconstruct", made / "scan.h5", f"{tmp_path}/{name}", *words)[0] == 0
    (other,) = images(folder)
    assert other.SeriesInstanceUID != one.SeriesInstanceUID
    assert other.StudyInstanceUID == one.StudyInstanceUID
    assert (other.ImageType[0], other.BodyPartExamined) == ("DERIVED", "SKULL")
    assert "method tv" in other.DerivationDescription


def test_a_series_is_denoised_for_the_same_patient(run, series, tmp_path):
    status, out, err = run("denoise", series, tmp_path / "out", "--denoiser", "tv")
    assert (status, err) == (0, "")
    assert out.endswith("3 slices of 24 x 20 pixels of 2 mm, as a DICOM series of its source's patient and study.\n")
    expected = make_denoiser("tv")(read_source_series(series).image)
    for old, new, image in zip(images(series), images(tmp_path / "out"), expected, strict=True):
        for name in ("PatientName", "PatientID", "StudyInstanceUID", "FrameOfReferenceUID", "ImagePositionPatient"):
            assert new[name].value == old[name].value
        np.testing.assert_allclose(new.pixel_array, 1000 * (image.numpy() - 1), atol=0.51)
        assert "denoiser TotalVariation" in new.DerivationDescription
    status, out, _ = run("evaluate", tmp_path / "out", series, tmp_path / "numbers.json")
    assert status == 0
    assert 15 < json.loads((tmp_path / "numbers.json").read_text())["rmse_hu"] < 25


def test_a_series_becomes_a_volume_where_it_is(run, series, tmp_path):
    assert run("denoise", series, tmp_path / "out.nii.gz", "--denoiser", "tv")[0] == 0
    _, grid = read_image(tmp_path / "out.nii.gz")
    assert grid.heights.tolist() == STACK.heights.tolist()
    assert (*grid.plane.center, grid.plane.spacing) == pytest.approx((3.0, -1.0, 2.0))
    assert run("evaluate", tmp_path / "out.nii.gz", series)[0] == 0


def test_a_volume_becomes_a_series(run, series, tmp_path):
    assert run("denoise", series, tmp_path / "volume.h5", "--denoiser", "tv", "--strength", "0")[0] == 0
    words = ["--denoiser", "tv", "--strength", "0", "--body-part", "abdomen"]
    assert run("denoise", tmp_path / "volume.h5", tmp_path / "out", *words)[0] == 0
    for old, new in zip(images(series), images(tmp_path / "out"), strict=True):
        np.testing.assert_array_equal(new.pixel_array, old.pixel_array)
        assert new.ImagePositionPatient == pytest.approx(old.ImagePositionPatient)
        assert (new.PatientName, new.BodyPartExamined) == ("Fictitious^Patient", "ABDOMEN")


def test_a_series_takes_the_patient_of_another_folder(run, series, made, tmp_path):
    (series.parent / "notes.txt").write_text("no DICOM")
    for command, name, *words in (("reconstruct", "scan.h5", "--method", "fbp"), ("denoise", "image.h5")):
        words += ["--denoiser", "tv"] if command == "denoise" else []
        status, out, err = run(command, made / name, tmp_path / "out", *words, "--patient-of", series)
        assert (status, err) == (0, "")
        assert f"of the patient and study of {series}.\n" in out
        (one,) = images(tmp_path / "out")
        assert (one.PatientName, one.PatientID, one.StudyInstanceUID) == ("Doe^Jane", "4711", "1.2.77")
        assert "fictitious" not in str(one)
        # The isocentre of a scan is not the origin of the scanner's own images.
        assert one.FrameOfReferenceUID != "1.2.78"


def test_a_scan_that_knows_its_patient_gives_a_series_of_that_patient(run, made, tmp_path):
    dicom = {"PatientName": "Müller^Änne", "PatientID": "7", "StudyInstanceUID": "1.2.9", "PatientPosition": "FFS"}
    dicom |= {"KVP": "no number", "FrameOfReferenceUID": "1.2.10", "BodyPartExamined": "CHEST", "PixelSpacing": "3"}
    scan = read_scan(made / "scan.h5")
    provenance = Provenance(["pnpct"], "0.1.0", settings={"dicom": {**dicom, "StudyID": 3}})
    write_scan(tmp_path / "scan.h5", scan, provenance=provenance)
    status, out, err = run("reconstruct", tmp_path / "scan.h5", tmp_path / "out", "--method", "fbp", "--size", "16")
    assert (status, err) == (0, "")
    assert "as a DICOM series of its source's patient and study.\nThe patient lay FFS, not HFS: left and right" in out
    (one,) = images(tmp_path / "out")
    for name in ("PatientName", "PatientID", "StudyInstanceUID", "PatientPosition", "BodyPartExamined"):
        assert one[name].value == dicom[name]
    assert one.FrameOfReferenceUID != "1.2.10"
    assert (one.KVP, one.StudyID) == (None, "")
    assert "fictitious" not in str(one)


@pytest.fixture
def two_series(series, tmp_path) -> Path:
    folder = tmp_path / "two"
    shutil.copytree(series, folder)
    changed(folder, SeriesInstanceUID="1.2.3")
    for path in sorted(series.iterdir()):
        shutil.copy(path, folder / f"other-{path.name}")
    return folder


def test_one_of_two_series_is_chosen(run, series, two_series, tmp_path):
    other = images(series)[0].SeriesInstanceUID
    for words in (
        ("denoise", two_series, tmp_path / "out", "--denoiser", "tv"),
        ("evaluate", two_series, series),
        ("evaluate", series, two_series, "--series", other),
        ("simulate", "scan", tmp_path / "scan.h5", "--body", two_series),
    ):
        status, _, err = run(*words)
        assert status == 2
        assert "holds 2 CT series; choose one with --series" in err
        assert other in err
    assert run("denoise", two_series, tmp_path / "out", "--denoiser", "tv", "--series", "1.2.3")[0] == 0
    assert run("evaluate", two_series, two_series, "--series", "1.2.3", "--truth-series", other)[0] == 0
    words = ["--body", two_series, "--series", other, *["--size", "24", "--views", "12", "--bins", "16"]]
    assert run("simulate", "scan", tmp_path / "scan.h5", *words)[0] == 0


def test_what_was_resampled_is_said(run, series, tmp_path):
    tilted, uneven = tmp_path / "tilted", tmp_path / "uneven"
    shutil.copytree(series, tilted)
    changed(tilted, ImageOrientationPatient=[1, 0, 0, 0, 0.9848078, 0.1736482])
    shutil.copytree(series, uneven)
    changed(uneven, ImagePositionPatient=tuple([0.0, 0.0, z] for z in (0.0, 2.0, 7.0)))
    for folder, words in (
        (tilted, "The gantry was tilted by 10.0 degrees"),
        (uneven, "The slices are 2 to 5 mm apart"),
    ):
        status, out, err = run("denoise", folder, tmp_path / "out.nii", "--denoiser", "tv")
        assert (status, err) == (0, "")
        assert out.startswith(words)
        # From series to series every slice stays in its plane, and nothing is resampled.
        status, out, _ = run("denoise", folder, tmp_path / f"{folder.name}-out", "--denoiser", "tv")
        assert out.startswith("Wrote ")
        for old, new in zip(images(folder), images(tmp_path / f"{folder.name}-out"), strict=True):
            assert new.ImagePositionPatient == old.ImagePositionPatient
            assert new.ImageOrientationPatient == old.ImageOrientationPatient


def with_folder(here: Path, made: Path) -> None:
    (here / "mine").mkdir()
    (here / "mine" / "thesis.txt").write_text("years of work")


MISTAKES = [
    Case("somebody's folder", "reconstruct {made}/scan.h5 {here}/mine", "thesis.txt new folder", with_folder),
    Case("somebody's folder to denoise", "denoise {made}/image.h5 {here}/mine", "thesis.txt new folder", with_folder),
    Case("input over output", "denoise {here}/mine {here}/mine", "mine is an input", with_folder),
    Case("no images in it", "denoise {here}/mine {here}/out", "mine holds no CT image", with_folder),
    Case("no images to evaluate", "evaluate {here}/mine {made}/image.h5", "mine holds no CT image", with_folder),
    Case("no folder", "denoise {here}/absent {here}/out", "absent"),
    Case(
        "a body part of a file", "reconstruct {made}/scan.h5 {here}/a.h5 --body-part CHEST", "--body-part a.h5 folder"
    ),
    Case(
        "a patient of a file", "reconstruct {made}/scan.h5 {here}/a.h5 --patient-of {made}", "--patient-of a.h5 folder"
    ),
    Case("no patient", "reconstruct {made}/scan.h5 {here}/out --patient-of {made}", "no DICOM file study folder"),
    Case("no folder of a patient", "denoise {made}/image.h5 {here}/out --patient-of {here}/no", "no is no folder"),
    Case(
        "two patients", "denoise {here}/mine {here}/out --patient-of {here}/mine", "--patient-of no effect", with_folder
    ),
    Case("no body part", "reconstruct {made}/scan.h5 {here}/out --body-part ?!", "body part CHEST ?!"),
    Case("a series of a file", "denoise {made}/image.h5 {here}/out --series 1.2", "--series image.h5 no folder"),
    Case("a series of no body", "simulate scan {here}/a.h5 --series 1.2", "--series --body"),
    Case("a folder in no folder", "denoise {made}/image.h5 {here}/no/out", "no folder make it first"),
]


@pytest.mark.parametrize("case", MISTAKES, ids=lambda case: case.name)
def test_a_mistake_with_a_folder_gets_one_line_and_leaves_nothing_behind(case, run, made, tmp_path):
    check(case, run, made, tmp_path)
