"""Folders of projections that are not one whole scan, and files that are damaged, are refused in one sentence."""

import shutil

import ct_pd_views as writer
import pytest
from ct_pd_views import write_folder

from pnpct.files import FileFormatError, projection_files, read_slabs, read_views, series_of


def read(folder):
    series = series_of(folder, [view for view in read_views(projection_files(folder)) if view])
    for _ in read_slabs(series):
        pass


def of_view(number, **values):
    """A change of one view, by keywords."""

    def change(view, at):
        if at == number:
            for name, value in values.items():
                setattr(view, name, value)

    return change


def private(number, tag, value):
    """A change of a private value, in one view or, where it is None, in all of them."""

    def change(view, at):
        if number in (None, at):
            view[tag].value = value

    return change


def without(*tags):
    def change(view, at):
        for tag in tags:
            del view[tag]

    return change


CHANGES = {
    "two series": (
        of_view(3, SeriesInstanceUID="2.25.7"),
        r"2 series, .* 2.25.2000 \(11 views\), 2.25.7 \(1 view",
    ),
    "two spectra": (private(3, 0x70331063, 2), "mixes the spectra 1, 2"),
    "another detector": (private(3, 0x70311003, 570.0), r"3\.dcm does not fit .* radius is 570.0, .* 595.0"),
    "several frames": (of_view(0, NumberOfFrames=2), "several views; only files of one view"),
    "another shape": (private(0, 0x7029100B, "FLAT"), "CYLINDRICAL detector is needed, got 'FLAT'"),
    "intensities": (private(0, 0x70391009, "NO"), "intensities"),
    "no rows": (without(0x70291010), "NumberofDetectorRows must be one number .* none"),
    "no angle": (without(0x70311001), "DetectorFocalCenterAngularPosition must be one number"),
    "no number": (without("InstanceNumber"), "InstanceNumber must be one number"),
    "not finite": (private(2, 0x70311002, float("nan")), "AxialPosition must be finite, got nan"),
    "a central column": (private(2, 0x70311033, 13.0), "DetectorCentralElement must be two numbers, got 1"),
    "other pixels": (of_view(4, Rows=writer.COLUMNS + 1), "25 x 8 pixels, but its detector has 24 columns and 8 rows"),
    "few pixels": (of_view(4, PixelData=b"\0\0" * 10), r"4\.dcm holds 10 pixels, .* copy it again"),
    "a checksum": (of_view(4, LargestImagePixelValue=3), "largest pixel value should be 3, got"),
    "a slope": (of_view(4, RescaleSlope="1"), "cannot be; its rescale slope is 1"),
    "no slope": (without("RescaleSlope"), "RescaleSlope must be one number"),
    "a signed pixel": (of_view(4, PixelRepresentation=1), "16 bits without a sign"),
    "a turned spot": (private(1, 0x7033100B, 0.66), "turns by 0.66 rad"),
    "no water": (without(0x70411001), r"attenuation of water; give it in 1/mm \(--mu-water\)"),
    "no photons": (without(0x70331065), r"PhotonStatistics\); give them \(--incident\)"),
    "negative photons": (private(None, 0x70331065, [-1.0]), r"positive .* each of the 24 columns, got 1 from -1"),
    "a few photons": (private(None, 0x70331065, [1.0, 2.0]), "each of the 24 columns, got 2"),
    "a jump of the table": (
        lambda view, at: private(None, 0x70311002, 0.3 * at + 20 * (at > 5))(view, at),
        r"table jumps from z = 1.5 to 21.8 mm between the views 506 and 507; .* of its own",
    ),
    "an uneven angle": (private(6, 0x70311001, writer.angle_of(6) + 0.08), "numbers 506 and 507 are 10.3.* degrees"),
}


@pytest.mark.parametrize(("change", "message"), CHANGES.values(), ids=CHANGES)
def test_what_is_not_one_whole_scan_is_one_sentence(tmp_path, change, message):
    folder = write_folder(tmp_path / "scan", explicit=True, change=change)
    with pytest.raises(FileFormatError, match=message) as raised:
        read(folder)
    assert str(tmp_path) in str(raised.value)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("removed", "message"),
    [
        ([3], r"the views 501 to 512 these are missing: 504 \(1 in all\); copy"),
        ([3, 4, 7], r"these are missing: 504 to 505, 508 \(3 in all\);"),
        ([1, 3, 5, 7, 9], "missing: 502, 504, 506, 508, 510 "),
    ],
)
def test_missing_views_are_named(tmp_path, removed, message):
    folder = write_folder(tmp_path / "scan")
    for view in removed:
        (path,) = folder.glob(f"*.{view}.dcm")
        path.unlink()
    with pytest.raises(FileFormatError, match=message):
        read(folder)


def test_a_view_that_comes_twice_is_named_with_both_files(tmp_path):
    folder = write_folder(tmp_path / "scan")
    (path,) = folder.glob("*.3.dcm")
    shutil.copy(path, folder / "copy of it.dcm")
    with pytest.raises(FileFormatError, match=r"come twice \(1 in all\), such as number 504 in .*copy of it\.dcm"):
        read(folder)


def test_a_file_that_was_cut_is_named(tmp_path):
    folder = write_folder(tmp_path / "scan")
    (path,) = folder.glob("*.3.dcm")
    path.write_bytes(path.read_bytes()[:-20])
    with pytest.raises(FileFormatError, match=r"3\.dcm"):
        read(folder)


def test_other_files_are_passed_over(tmp_path):
    folder = write_folder(tmp_path / "scan")
    (folder / "LICENSE").write_text("CC BY 4.0")
    (folder / "inside").mkdir()
    read(folder)


def test_folders_without_projections_are_refused(tmp_path):
    with pytest.raises(NotADirectoryError, match="is no folder"):
        projection_files(tmp_path / "scan")
    (tmp_path / "1.000000-Full Dose Projections").mkdir()
    with pytest.raises(FileFormatError, match=r"holds no file; .* such as 1.000000-Full Dose Projections"):
        projection_files(tmp_path)
    (tmp_path / "note.txt").write_text("nothing")
    with pytest.raises(FileFormatError, match="no projections in DICOM-CT-PD"):
        read(tmp_path)
