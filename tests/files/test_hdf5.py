"""What stands in an HDF5 file is checked before it is used."""

import h5py
import numpy as np
import pytest
import torch

from pnpct.files import FileFormatError, Provenance, describe_file, read_scan, write_scan
from pnpct.physics import Scan


@pytest.fixture
def path(geometry, tmp_path):
    scan = Scan(torch.full((60, 48), 500.0), torch.tensor(1000.0), 3.0, geometry, mu_water=0.02)
    write_scan(tmp_path / "scan.h5", scan, provenance=Provenance([], "0"))
    return tmp_path / "scan.h5"


def with_attribute(place, **attributes):
    return lambda file: file[place].attrs.update(attributes)


def with_dataset(name, data=None, **options):
    def change(file):
        if name in file:
            del file[name]
        file.create_dataset(name, data=data, **options)

    return change


BOMB = {"shape": (1 << 20, 1 << 20), "dtype": "f4", "chunks": True, "compression": "gzip"}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            with_attribute("geometry", source_to_isocenter_mm=np.inf),
            "isocenter_mm of /geometry must be a finite .* inf",
        ),
        (with_attribute("geometry", bins=np.inf), "bins of /geometry must be a finite number, got inf"),
        (with_attribute("geometry", bins=47.5), "bins of /geometry must be a whole number, got 47.5"),
        (with_attribute("geometry", bins=10**15), "at most 1000000 bins and rows"),
        (with_attribute("geometry", detector=7), "detector of /geometry must be text, got .*7"),
        (with_attribute("geometry", detector="m" * 60_000), "the detector is .arc. or .flat., got 'mmm"),
        (with_attribute("/", mu_water_per_mm="0.02"), "mu_water_per_mm of / must be a finite number, got '0.02'"),
        (with_attribute("/", mu_water_per_mm=np.inf), "mu_water_per_mm of / must be a finite number, got inf"),
        (with_dataset("geometry/view_angles", np.zeros(1_000_001)), "at most 1000000 views, got 1000001"),
        (with_dataset("geometry/focal_spot_shifts", np.float64(1.0)), r"got \(60,\), \(0,\) and \(\)"),
        (with_dataset("counts", h5py.Empty("f4")), "/counts is empty"),
        (with_dataset("counts", **BOMB), r"/counts declares 1099511627776 numbers, which cannot be in the .* bytes"),
    ],
)
def test_what_cannot_be_is_one_short_sentence(path, change, message):
    with h5py.File(path, "r+") as file:
        change(file)
    with pytest.raises(FileFormatError, match=f"^{path}: .*{message}") as raised:
        read_scan(path)
    assert "\n" not in str(raised.value)
    assert len(str(raised.value)) < 500


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (with_attribute("/", description=7), "description of / must be text, got .*7"),
        (with_attribute("/", provenance=7), "provenance of / must be text, got .*7"),
        (with_attribute("/", provenance="[" * 10_000), "A provenance is written in JSON"),
        (lambda file: file.attrs.pop("provenance"), "provenance of / is missing"),
    ],
)
def test_a_file_that_cannot_say_what_it_is_is_not_described(path, change, message):
    with h5py.File(path, "r+") as file:
        change(file)
    with pytest.raises(FileFormatError, match=message):
        describe_file(path)


def test_an_empty_data_space_is_described(path):
    with h5py.File(path, "r+") as file:
        file["nothing"] = h5py.Empty("f4")
    assert describe_file(path)["arrays"]["nothing"]["shape"] == ()


def test_constant_images_are_not_taken_for_bombs(path):
    with h5py.File(path, "r+") as file:
        counts = np.full((60, 48), 7.0, "f4")
        with_dataset("counts", counts, chunks=(60, 48), compression="gzip", compression_opts=9, shuffle=True)(file)
        file.create_dataset("large", data=np.ones((2048, 2048), "f4"), compression="gzip", compression_opts=9)
        assert file["large"].nbytes < 1100 * file["large"].id.get_storage_size()
    assert float(read_scan(path).counts.mean()) == 7.0
