import json
import zipfile

import numpy as np
import pytest

from pnpct.files import FileFormatError, FractionMap, read_xcist_phantom, write_xcist_phantom
from pnpct.geometry import ImageGrid

DESCRIPTION = {
    "n_materials": 2,
    "mat_name": ["ncat_water", "ncat_muscle"],
    "volumefractionmap_filename": ["body.density_0", "body.density_1"],
    "volumefractionmap_datatype": ["int8", "float"],
    "cols": [5, 3],
    "rows": [4, 2],
    "slices": [3, 1],
    "x_size": [0.5, 0.5],
    "y_size": [0.5, 0.5],
    "z_size": [2.0, 2.0],
    "x_offset": [1.0, 2.0],
    "y_offset": [4.0, 1.5],
    "z_offset": [2.0, 1.0],
}
WATER = np.random.default_rng(0).integers(0, 2, (3, 4, 5)).astype(np.int8)
MUSCLE = np.random.default_rng(1).uniform(0, 1, (1, 2, 3)).astype(np.float32)


class Body:
    """A small phantom as XCIST writes them, in a folder or packed into an archive."""

    def __init__(self, folder):
        self.folder = folder
        self.path = folder / "body.json"
        WATER.tofile(folder / "body.density_0")
        MUSCLE.tofile(folder / "body.density_1")
        self.describe()

    def describe(self, **changes):
        entries = {key: value for key, value in {**DESCRIPTION, **changes}.items() if value is not None}
        self.path.write_text(json.dumps(entries))
        return self.path

    def archive(self, *, inside="Body_5x4x3/", extra=(), leave_out=()):
        path = self.folder / "body.zip"
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            for file in ("body.json", "body.density_0", "body.density_1"):
                if file not in leave_out:
                    archive.write(self.folder / file, inside + file)
            for name in extra:
                archive.writestr(name, "{}")
        return path


@pytest.fixture
def body(tmp_path):
    return Body(tmp_path)


def test_voxels_lie_where_xcist_counts_them(body):
    water, muscle = read_xcist_phantom(body.path)
    assert (water.material, muscle.material) == ("ncat_water", "ncat_muscle")
    np.testing.assert_array_equal(water.fractions, WATER)
    np.testing.assert_array_equal(muscle.fractions, MUSCLE)
    # The isocentre is in column 1 from the left, row 4 from the bottom (the top one) and slice 2 from below.
    assert water.grid.x[0] == 0.0
    assert water.grid.y[0] == 0.0
    assert water.extent == (-3.0, 3.0)
    # The isocentre is in the second column, on the line between both rows.
    np.testing.assert_allclose(muscle.grid.x, [-0.5, 0.0, 0.5])
    np.testing.assert_allclose(muscle.grid.y, [0.25, -0.25])
    assert muscle.extent == (-1.0, 1.0)


def test_rows_are_counted_from_the_bottom_and_slices_from_below(body):
    water, _ = read_xcist_phantom(body.describe(y_offset=[1.0, 1.5], z_offset=[1.0, 1.0]))
    assert water.grid.y[-1] == 0.0
    assert water.extent == (-1.0, 5.0)


@pytest.mark.parametrize("shadows", [(), ("__MACOSX/Body_5x4x3/._body.json",)])
@pytest.mark.parametrize("inside", ["", "Body_5x4x3/"])
def test_an_archive_is_read_as_the_files_in_it(body, inside, shadows):
    packed = read_xcist_phantom(body.archive(inside=inside, extra=shadows))
    for of, expected in zip(packed, read_xcist_phantom(body.path), strict=True):
        np.testing.assert_array_equal(of.fractions, expected.fractions)
        assert (of.material, of.grid, of.extent) == (expected.material, expected.grid, expected.extent)


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("int8", "i1"),
        ("int16", "i2"),
        ("int", "i4"),
        ("uint32", "u4"),
        ("float", "f4"),
        ("single", "f4"),
        ("double", "f8"),
    ],
)
def test_each_type_of_xcist_is_understood(body, name, kind):
    WATER.astype(f"<{kind}").tofile(body.folder / "body.density_0")
    water, _ = read_xcist_phantom(body.describe(volumefractionmap_datatype=[name, "float"]))
    np.testing.assert_array_equal(water.fractions, WATER)


def test_the_density_scale_multiplies_the_fractions(body):
    water, muscle = read_xcist_phantom(body.describe(density_scale=[0.25, 1.0]))
    np.testing.assert_array_equal(water.fractions, 0.25 * WATER)
    np.testing.assert_array_equal(muscle.fractions, MUSCLE)


def test_what_is_written_is_read_again(tmp_path):
    grid = ImageGrid(2, 3, spacing=0.7, center=(11.3, -7.9))
    maps = (
        FractionMap("water", MUSCLE.repeat(4, axis=0), grid, slice_thickness=0.625, center_z=-3.1),
        FractionMap("ncat_lung", WATER, ImageGrid(4, 5, spacing=0.7), slice_thickness=0.625),
    )
    write_xcist_phantom(tmp_path / "own.json", maps)
    for of, expected in zip(read_xcist_phantom(tmp_path / "own.json"), maps, strict=True):
        assert (of.material, of.slice_thickness) == (expected.material, expected.slice_thickness)
        assert of.grid.shape == expected.grid.shape
        assert of.grid.center == pytest.approx(expected.grid.center, abs=1e-9)
        assert of.center_z == pytest.approx(expected.center_z)
        np.testing.assert_array_equal(of.fractions, expected.fractions)
        assert of.fractions.dtype == np.float32


def test_a_chest_of_xcist_is_read(shared_data):
    maps = read_xcist_phantom(next((shared_data / "phantoms").glob("*.zip")))
    assert {of.material for of in maps} >= {"ncat_lung", "ncat_dry_spine", "ncat_heart"}
    where = {of.material: of.grid.center for of in maps}
    assert where["ncat_heart"][0] > 5  # to the patient's left
    assert where["ncat_dry_spine"][1] < -50  # at the back
    assert all(of.extent == (-25.0, 25.0) for of in maps)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"rows": None, "z_size": None}, r"body.json: missing keys: rows, z_size\.$"),
        ({"n_materials": 3}, "mat_name must be a list with one entry for each of the 3 materials"),
        ({"n_materials": 10**18}, "mat_name must be a list with one entry for each of the 1000000000000000000"),
        ({"volumefractionmap_filename": ["../body.density_0", "b"]}, "it names '../body.density_0', which is not in"),
        ({"volumefractionmap_filename": ["/dev/zero", "b"]}, "it names '/dev/zero', which is not in its own folder"),
        ({"n_materials": True}, "n_materials must be a whole number of at least 1, got True"),
        ({"cols": [5]}, "cols must be a list with one entry for each of the 2 materials"),
        ({"slices": 3}, "slices must be a list with one entry"),
        ({"cols": [2.5, 3]}, "cols must hold a whole number of at least 1, got 2.5"),
        ({"rows": [0, 2]}, "rows must hold a whole number of at least 1, got 0"),
        ({"rows": [-4, 2]}, "rows must hold a whole number of at least 1, got -4"),
        ({"x_size": [0.5, 0.0]}, "x_size must hold a positive number, got 0.0"),
        ({"z_offset": [float("nan"), 1]}, "z_offset must hold a finite number, got nan"),
        ({"mat_name": ["water", 3]}, "mat_name must hold a name, got 3"),
        ({"volumefractionmap_datatype": ["int8", "half"]}, "must hold one of int8, int16, .*, got 'half'"),
        ({"y_size": [0.5, 0.6]}, 'pixels must be square, those of "ncat_muscle" have 0.5 mm in x and 0.6 mm in y'),
        ({"slices": [2, 1]}, "body.density_0 has 60 bytes, but 40 were needed .* truncated or of another"),
        ({"volumefractionmap_filename": ["body.density_0", "no"]}, "there is no map no beside the description"),
        ({"density_scale": [1.0, 3.0]}, 'The volume fractions of "ncat_muscle" must be from 0 to 1, got .* to [12]'),
    ],
)
def test_what_is_wrong_in_a_description_is_one_sentence(body, changes, message):
    with pytest.raises(FileFormatError, match=message):
        read_xcist_phantom(body.describe(**changes))


@pytest.mark.parametrize("wrong", [-0.1, 1.01, np.nan])
def test_impossible_fractions_are_refused(body, wrong):
    muscle = MUSCLE.copy()
    muscle[0, 1, 1] = wrong
    muscle.tofile(body.folder / "body.density_1")
    with pytest.raises(FileFormatError, match='fractions of "ncat_muscle" must be from 0 to 1'):
        read_xcist_phantom(body.path)


def test_what_is_no_phantom_is_refused(body):
    body.path.write_text("not JSON")
    with pytest.raises(FileFormatError, match=r"body\.json: this is not JSON"):
        read_xcist_phantom(body.path)
    body.path.write_text("[1]")
    with pytest.raises(FileFormatError, match="a JSON object with named values was needed"):
        read_xcist_phantom(body.path)
    with pytest.raises(FileNotFoundError, match="There is no file"):
        read_xcist_phantom(body.folder / "other.json")


def test_an_archive_must_have_one_description_and_all_its_maps(body):
    with pytest.raises(FileFormatError, match=r"exactly one \.json file was needed, this one has 2"):
        read_xcist_phantom(body.archive(extra=("other.json",)))
    with pytest.raises(FileFormatError, match=r"exactly one \.json file was needed, this one has 0"):
        read_xcist_phantom(body.archive(leave_out=("body.json",)))
    with pytest.raises(FileFormatError, match=r"the map body\.density_1 is not in the archive"):
        read_xcist_phantom(body.archive(leave_out=("body.density_1",)))
    body.describe(slices=[4, 1])
    with pytest.raises(FileFormatError, match=r"body\.density_0 has 60 bytes, but 80 were needed"):
        read_xcist_phantom(body.archive())


def test_a_damaged_archive_is_one_sentence(body):
    path = body.archive()
    content = bytearray(path.read_bytes())
    content[content.index(b"Body_5x4x3/body.density_0") + 40] ^= 0xFF
    path.write_bytes(content)
    with pytest.raises(FileFormatError, match=r"body\.zip: the archive cannot be unpacked"):
        read_xcist_phantom(path)


def test_maps_that_do_not_fit_are_refused(tmp_path):
    grid = ImageGrid(2, 3, spacing=1.0)
    with pytest.raises(ValueError, match=r"\(rows, cols\) = \(2, 3\), got \(1, 3, 2\)"):
        FractionMap("water", np.zeros((1, 3, 2)), grid, slice_thickness=1.0)
    with pytest.raises(ValueError, match="positive thickness"):
        FractionMap("water", np.zeros((1, 2, 3)), grid, slice_thickness=0.0)
    with pytest.raises(ValueError, match="at least one material"):
        write_xcist_phantom(tmp_path / "none.json", ())
    with pytest.raises(ValueError, match=r"ends in \.json, got body\.vp"):
        write_xcist_phantom(tmp_path / "body.vp", (FractionMap("water", np.zeros((1, 2, 3)), grid, 1.0),))
