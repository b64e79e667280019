import re

import numpy as np
import pytest
import torch
from dicom_images import STANDARD, dicom, save
from pydicom import Dataset, dcmread

from pnpct.files import (
    FileFormatError,
    Provenance,
    read_dicom_series,
    read_source_series,
    write_dicom_series,
)
from pnpct.files import dicom_writer as writer
from pnpct.geometry import ImageGrid, VolumeGrid

PLANE = ImageGrid(5, 7, spacing=0.7, center=(3.0, -5.0))
STACK = VolumeGrid(PLANE, slices=3, slice_spacing=2.5, z=100.0)
HASH = "ab" * 32
FBP = Provenance(["pnpct"], "0.1.0", inputs={"scan.h5": HASH}, settings={"method": "fbp", "kernel": "hann"})
PNP = Provenance(["pnpct"], "0.1.0", inputs={"scan.h5": HASH}, settings={"method": "pnp", "denoiser": "n2n", "beta": 2})

# Attributes of type 1 (a value is needed) and of type 2 (may be empty) in the mandatory modules of a CT image: DICOM
# PS3.3, table A.3-1 and C.7.1.1, C.7.2.1, C.7.3.1, C.7.4.1, C.7.5.1, C.7.6.1 to 3, C.8.2.1, C.12.1; of the conditional
# ones those whose condition holds here.
TYPE_1 = """
StudyInstanceUID Modality SeriesInstanceUID PatientPosition FrameOfReferenceUID ImageType PixelSpacing
ImageOrientationPatient ImagePositionPatient SamplesPerPixel PhotometricInterpretation Rows Columns BitsAllocated
BitsStored HighBit PixelRepresentation PixelData RescaleIntercept RescaleSlope RescaleType SOPClassUID
SOPInstanceUID SpecificCharacterSet WindowWidth
"""
TYPE_2 = """
PatientName PatientID PatientBirthDate PatientSex StudyDate StudyTime ReferringPhysicianName StudyID
AccessionNumber SeriesNumber PositionReferenceIndicator Manufacturer AcquisitionNumber InstanceNumber
SliceThickness KVP
"""


@pytest.fixture
def noise(generator) -> torch.Tensor:
    return 1 + 0.3 * torch.randn(3, 5, 7, generator=generator)


def images(folder) -> list[Dataset]:
    return [dcmread(path) for path in sorted(folder.iterdir())]


@pytest.mark.parametrize("provenance", [FBP, PNP])
@pytest.mark.parametrize("grid", [PLANE, STACK])
def test_everything_that_the_mandatory_modules_need_is_there(tmp_path, noise, grid, provenance):
    image = noise if grid == STACK else noise[0]
    write_dicom_series(tmp_path / "out", image, grid, provenance=provenance)
    for one in images(tmp_path / "out"):
        assert [name for name in TYPE_1.split() if one.get(name) in (None, "", [])] == []
        assert [name for name in TYPE_2.split() if name not in one] == []
        assert ("BodyPartExamined" in one) != ("Laterality" in one)
        assert one.file_meta.MediaStorageSOPInstanceUID == one.SOPInstanceUID
        (equipment,) = one.ContributingEquipmentSequence
        assert (equipment.Manufacturer, equipment.PurposeOfReferenceCodeSequence[0].CodeValue) == ("pnpct", "109102")
        assert HASH in equipment.ContributionDescription


def test_hu_and_positions_come_back(tmp_path, noise):
    write_dicom_series(tmp_path / "out", noise, STACK, provenance=PNP, body_part="chest")
    series = read_dicom_series(tmp_path / "out")
    np.testing.assert_array_equal(series.image_hu, np.rint(1000 * (noise.double().numpy() - 1)))
    assert series.z == tuple(STACK.heights)
    assert series.plane.center == pytest.approx(PLANE.center, abs=1e-12)
    assert (series.plane.spacing, series.slice_thickness, series.grid.z) == (0.7, 2.5, 100.0)
    assert series.description.startswith("CT, CHEST")


def test_our_axes_are_those_of_the_patient(tmp_path, noise):
    write_dicom_series(tmp_path / "out", noise, STACK, provenance=PNP)
    for one, z in zip(images(tmp_path / "out"), (97.5, 100.0, 102.5), strict=True):
        # By hand: the first of 5 x 7 pixels is 3 pixels to the right of x = 3 and 2 to the front of y = -5.
        assert one.ImagePositionPatient == pytest.approx([3.0 - 3 * 0.7, 5.0 - 2 * 0.7, z])
        assert one.ImageOrientationPatient == STANDARD
        assert (one.SliceLocation, one.PixelSpacing, one.PatientPosition) == (z, [0.7, 0.7], "HFS")
        assert (one.SpacingBetweenSlices, one.SliceThickness) == (2.5, 2.5)
    write_dicom_series(tmp_path / "thick", noise, STACK, provenance=PNP, slice_thickness=5.0)
    assert images(tmp_path / "thick")[0].SliceThickness == 5.0


def test_lengths_have_all_the_digits_that_dicom_has(tmp_path, noise):
    grid = VolumeGrid(ImageGrid(5, 7, 500 / 511, (1 / 3, 0.1 + 0.2)), 3, 1 / 3, z=1e3 / 7)
    write_dicom_series(tmp_path / "out", noise, grid, provenance=PNP)
    series = read_dicom_series(tmp_path / "out")
    assert series.grid.plane.x == pytest.approx(grid.plane.x, abs=1e-11)
    assert series.grid.plane.y == pytest.approx(grid.plane.y, abs=1e-11)
    assert series.grid.heights == pytest.approx(grid.heights, abs=1e-11)


def test_values_that_16_bits_cannot_hold_are_cut_off(tmp_path):
    image = torch.tensor([[-3.0, 0.0, 1.0004, 1.0006, 50.0]])
    write_dicom_series(tmp_path / "out", image, ImageGrid(1, 5, 1.0), provenance=PNP)
    assert images(tmp_path / "out")[0].pixel_array.tolist() == [[-1024, -1000, 0, 1, 32767]]


def test_what_has_a_prior_is_derived(tmp_path, noise):
    write_dicom_series(tmp_path / "fbp", noise, STACK, provenance=FBP)
    write_dicom_series(tmp_path / "pnp", noise, STACK, provenance=PNP)
    fbp, pnp = images(tmp_path / "fbp")[0], images(tmp_path / "pnp")[0]
    assert fbp.ImageType == ["ORIGINAL", "PRIMARY", "AXIAL"]
    assert fbp.ConvolutionKernel == "HANN"
    assert "DerivationDescription" not in fbp
    assert pnp.ImageType == ["DERIVED", "PRIMARY", "AXIAL"]
    assert pnp.DerivationDescription == f"pnpct 0.1.0; SHA-256 of the input {HASH}; method pnp; denoiser n2n; beta 2"
    assert (pnp.SoftwareVersions, pnp.SeriesDescription) == ("pnpct 0.1.0", "pnpct pnp n2n")


def test_uids_follow_from_what_was_made_of_what(tmp_path, noise):
    elsewhere = Provenance(["pnpct", "elsewhere"], "0.1.0", inputs={"other.h5": HASH}, settings=PNP.settings)
    other_scan = Provenance(["pnpct"], "0.1.0", inputs={"scan.h5": "cd" * 32}, settings=PNP.settings)
    made = {}
    for name, provenance, image, grid in (
        ("pnp", PNP, noise, STACK),
        ("again", elsewhere, noise, STACK),
        ("fbp", FBP, noise, STACK),
        ("scan", other_scan, noise, STACK),
        ("pixels", PNP, noise + 0.01, STACK),
        ("grid", PNP, noise, VolumeGrid(PLANE, 3, 2.5, z=0.0)),
    ):
        write_dicom_series(tmp_path / name, image, grid, provenance=provenance)
        made[name] = images(tmp_path / name)
    for first, second in zip(made["pnp"], made["again"], strict=True):
        assert (first.SeriesInstanceUID, first.SOPInstanceUID) == (second.SeriesInstanceUID, second.SOPInstanceUID)
    series = {name: of[0].SeriesInstanceUID for name, of in made.items() if name != "again"}
    every = [one.SOPInstanceUID for name in series for one in made[name]]
    assert len({*series.values()}) == len(series)
    assert len({*every}) == len(every)
    assert all(re.fullmatch(r"2\.25\.\d{1,39}", uid) for uid in (*series.values(), *every))
    # All of one scan is of one study in one frame of reference, and of no other.
    for uid in ("StudyInstanceUID", "FrameOfReferenceUID", "PatientID"):
        assert {made[name][0][uid].value for name in ("pnp", "fbp", "pixels", "grid")} == {made["pnp"][0][uid].value}
        assert made["scan"][0][uid].value != made["pnp"][0][uid].value


def test_a_patient_who_is_fictitious_is_said_to_be(tmp_path, noise):
    write_dicom_series(tmp_path / "out", noise, STACK, provenance=PNP)
    one = images(tmp_path / "out")[0]
    assert one.PatientName == "Fictitious^Patient"
    assert "fictitious" in one.PatientComments
    assert one.PatientIdentityRemoved == "YES"


OF_PATIENT = {
    "SpecificCharacterSet": "ISO_IR 100",
    "PatientName": "Müller^Änne",
    "PatientID": "4711",
    "PatientBirthDate": "19500102",
    "PatientSex": "F",
    "StudyInstanceUID": "1.2.77",
    "StudyDate": "20200304",
    "StudyDescription": "Thorax nüchtern",
    "FrameOfReferenceUID": "1.2.78",
    "SeriesNumber": 4,
    "BodyPartExamined": "CHEST",
    "SliceThickness": "3.0",
    "XRayTubeCurrent": 40,
    "StudyID": "",
}
KEPT = (*OF_PATIENT, *("ImagePositionPatient", "ImageOrientationPatient", "PixelSpacing", "InstanceNumber", "KVP"))


TILTED = [1, 0, 0, 0, 0.965926, 0.258819]


@pytest.mark.parametrize("directions", [STANDARD, [-1, 0, 0, 0, -1, 0], [0, 1, 0, -1, 0, 0], TILTED])
def test_a_series_of_a_series_keeps_patient_study_and_positions(tmp_path, directions):
    heights = (0.0, 3.0, 5.0, 13.0)
    save(
        tmp_path / "in",
        *(dicom(z, **OF_PATIENT, ImageOrientationPatient=directions, InstanceNumber=9 - int(z) // 2) for z in heights),
    )
    source = read_source_series(tmp_path / "in")
    write_dicom_series(tmp_path / "out", source.image, source, provenance=PNP)
    before, after = images(tmp_path / "in"), images(tmp_path / "out")
    for old, new in zip(before, after, strict=True):
        for name in (*KEPT, "Rows", "Columns"):
            if name not in ("SpecificCharacterSet", "SeriesNumber"):
                assert str(new[name].value) == str(old[name].value), name
        np.testing.assert_array_equal(new.pixel_array, old.pixel_array)
        assert new.SourceImageSequence[0].ReferencedSOPInstanceUID == old.SOPInstanceUID
        assert new.SeriesInstanceUID != old.SeriesInstanceUID
        assert new.SeriesNumber == 1004
        assert new.ImageType[0] == "DERIVED"
        scanner, processing = new.ContributingEquipmentSequence
        assert (scanner.Manufacturer, processing.Manufacturer) == ("ACME", "pnpct")
        assert "PatientIdentityRemoved" not in new


def test_a_source_may_lack_what_it_should_have(tmp_path):
    save(tmp_path / "in", dicom(0.0), dicom(3.0))
    source = read_source_series(tmp_path / "in")
    write_dicom_series(tmp_path / "out", source.image, source, provenance=PNP)
    for number, one in enumerate(images(tmp_path / "out"), start=1):
        assert one.InstanceNumber == number
        assert [name for name in TYPE_1.split() if one.get(name) in (None, "", [])] == []
        assert [name for name in TYPE_2.split() if name not in one] == []


def test_a_series_takes_the_place_of_a_series_and_of_nothing_else(tmp_path, noise):
    folder = tmp_path / "out"
    folder.mkdir()
    write_dicom_series(folder, noise, STACK, provenance=PNP)
    write_dicom_series(folder, noise[:2], VolumeGrid(PLANE, 2, 2.5), provenance=PNP)
    assert [path.name for path in sorted(tmp_path.rglob("*"))] == ["out", "0001.dcm", "0002.dcm"]
    save(folder, dicom(0.0))
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    with pytest.raises(FileExistsError, match=r"2\.dcm in it is not of a series that pnpct wrote"):
        write_dicom_series(folder, noise, STACK, provenance=PNP)
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before
    (tmp_path / "file").touch()
    with pytest.raises(OSError, match="it is no folder"):
        write_dicom_series(tmp_path / "file", noise, STACK, provenance=PNP)


@pytest.mark.parametrize("older", [False, True])
def test_a_series_is_whole_or_absent(tmp_path, noise, monkeypatch, older):
    if older:
        write_dicom_series(tmp_path / "out", noise, STACK, provenance=FBP)
    before = {path: path.read_bytes() for path in tmp_path.rglob("*.dcm")}
    made = writer._file

    def stopped(elements):
        if elements["InstanceNumber"] == 3:
            raise KeyboardInterrupt
        return made(elements)

    monkeypatch.setattr(writer, "_file", stopped)
    with pytest.raises(KeyboardInterrupt):
        write_dicom_series(tmp_path / "out", noise, STACK, provenance=PNP)
    assert {path: path.read_bytes() for path in tmp_path.rglob("*.dcm")} == before
    assert len([*tmp_path.iterdir()]) == older


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"image": torch.ones(2, 3, 5, 7)}, r"holds one image or volume, here \(3, 5, 7\), got \(2, 3, 5, 7\)"),
        ({"image": torch.full((3, 5, 7), torch.inf)}, "values that are not finite"),
        ({"body_part": "left\\arm"}, "1 to 16 letters, digits and spaces"),
        ({"slice_thickness": 0.0}, "thickness of a slice must be a positive length"),
    ],
)
def test_what_cannot_be_written_is_refused(tmp_path, change, message):
    known = {"image": torch.ones(3, 5, 7), "place": STACK, "provenance": PNP}
    with pytest.raises(ValueError, match=message):
        write_dicom_series(tmp_path / "out", **{**known, **change})
    assert not (tmp_path / "out").exists()
    with pytest.raises(FileFormatError, match="holds no CT image"):
        read_source_series(tmp_path)
