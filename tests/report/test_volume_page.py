"""A volume as a page: what it holds, and in a browser what it shows."""

import base64
import hashlib
import re
from importlib.resources import files

import nibabel as nib
import numpy as np
import pytest
import torch
from browser_page import settle

from pnpct.cli import main
from pnpct.files import Provenance, write_dicom_series, write_image
from pnpct.geometry import ImageGrid, VolumeGrid
from pnpct.report import write_volume_page
from pnpct.units import to_hu

GRID = VolumeGrid(ImageGrid(32, 32, spacing=4.0, center=(10.0, -20.0)), slices=12, slice_spacing=5.0, z=100.0)
FINER = VolumeGrid(ImageGrid(64, 64, spacing=2.0, center=(10.0, -20.0)), slices=24, slice_spacing=2.5, z=100.0)


@pytest.fixture(scope="module")
def volume() -> torch.Tensor:
    """Every voxel tells where it is."""
    z, y, x = (torch.arange(size, dtype=torch.float32) for size in GRID.shape)
    return 1 + (z[:, None, None] * 50 + y[:, None] + x / 32 - 300) / 1000


@pytest.fixture(scope="module")
def page_path(volume, tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "page.html"
    finer = volume.repeat_interleave(2, 0).repeat_interleave(2, 1).repeat_interleave(2, 2) + 0.1
    write_volume_page(path, {"coarse <b>": (volume, GRID), "fine": (finer, FINER)})
    return path


def test_the_bundle_is_the_one_that_its_page_describes():
    folder = files("pnpct.report") / "niivue"
    content = (folder / "niivue.umd.js").read_bytes()
    assert hashlib.sha256(content).hexdigest() in (folder / "README.md").read_text()
    assert b"</script" not in content.lower()
    assert "BSD 2-Clause" in (folder / "LICENSE.txt").read_text()


def test_the_page_holds_the_volumes_where_they_are_and_nothing_from_elsewhere(volume, page_path, tmp_path):
    text = page_path.read_text()
    assert "coarse &lt;b&gt;" in text
    assert "<b>" not in text.split("<script>", 1)[0]
    for number, spacing in ((0, 4.0), (1, 2.0)):
        packed = re.search(f'id="volume-{number}">([^<]+)<', text)[1]
        (tmp_path / "one.nii.gz").write_bytes(base64.b64decode(packed))
        nifti = nib.load(tmp_path / "one.nii.gz")
        assert np.diag(nifti.affine)[:2] == pytest.approx(spacing)
    write_volume_page(tmp_path / "page.html", {"one": (volume, GRID)})
    packed = re.search('id="volume-0">([^<]+)<', (tmp_path / "page.html").read_text())[1]
    (tmp_path / "one.nii.gz").write_bytes(base64.b64decode(packed))
    held = nib.load(tmp_path / "one.nii.gz")
    assert np.asarray(held.dataobj).dtype == np.int16
    assert np.array_equal(np.asarray(held.dataobj)[::-1, ::-1].transpose(2, 1, 0), np.rint(to_hu(volume).numpy()))


def test_what_is_no_one_or_two_volumes(volume, tmp_path):
    with pytest.raises(ValueError, match="shows one volume or two, got 0"):
        write_volume_page(tmp_path / "page.html", {})
    with pytest.raises(ValueError, match="width"):
        write_volume_page(tmp_path / "page.html", {"one": (volume, GRID)}, window=(40.0, 0.0))


def test_volumes_that_no_browser_holds(volume, tmp_path, monkeypatch):
    monkeypatch.setattr("pnpct.report.volumes._LARGEST", 100)
    with pytest.raises(ValueError, match=r"up to 0 MB of volumes, .* show fewer slices, or larger pixels"):
        write_volume_page(tmp_path / "page.html", {"one": (volume, GRID)})


def test_the_command_shows_files_and_series(volume, tmp_path, capsys):
    write_image(tmp_path / "a.nii.gz", volume, GRID, provenance=Provenance(["pnpct"], "0.1.0"))
    write_dicom_series(tmp_path / "b", volume, GRID)
    words = ["view", str(tmp_path / "a.nii.gz"), str(tmp_path / "page.html")]
    assert main([*words, "--beside", str(tmp_path / "b")]) == 0
    assert "a page of" in capsys.readouterr().out
    assert (tmp_path / "page.html.json").exists()
    write_image(tmp_path / "slice.h5", volume[0], GRID.plane, provenance=Provenance(["pnpct"], "0.1.0"))
    for other, complaint in (
        (["--beside", str(tmp_path / "slice.h5")], "slice.h5 holds no volume: several slices are needed"),
        (["--beside", str(tmp_path / "a.nii.gz")], "--beside needs another volume"),
        (["--series", "1.2"], "--series chooses a series in a folder"),
        (["--window", "40", "0"], "width"),
    ):
        assert main([*words, *other]) == 2
        err = capsys.readouterr().err
        assert complaint in err
        assert err.count("\n") == 1


@pytest.fixture
def page(open_page, page_path):
    return open_page(page_path, width=1200)


def said(page) -> list[float]:
    settle(page)
    texts = [page.locator(f'[data-hu="{number}"]').text_content() for number in (0, 1)]
    return [float(text.removesuffix(" HU").replace("−", "-")) for text in texts]


def place(page) -> list[float]:
    numbers = re.findall(r"[xyz] (\S+) mm", page.locator("#place").text_content().replace("−", "-"))
    return [float(number) for number in numbers]


@pytest.mark.slow
def test_both_volumes_are_scrolled_and_read_together(page, volume):
    page.get_by_role("button", name="Axial").click()
    box = page.locator("#canvas-0").bounding_box()
    page.mouse.move(box["x"] + 0.4 * box["width"], box["y"] + 0.6 * box["height"])
    x, y, z = place(page)
    before = said(page)
    col, row = np.abs(GRID.plane.x - x).argmin(), np.abs(GRID.plane.y - y).argmin()
    layer = np.abs(GRID.heights - z).argmin()
    expected = float(to_hu(volume[layer, row, col]))
    assert before[0] == pytest.approx(expected, abs=51.1)  # between two slices it is one of them
    assert abs((before[0] - expected + 25) % 50 - 25) < 1.6
    assert before[1] == pytest.approx(before[0] + 100, abs=51.1)
    for _ in range(2):
        page.mouse.wheel(0, 100)
    settle(page)
    moved = place(page)[2] - z
    assert abs(moved) > 4.0
    after = said(page)
    assert after[0] - after[1] == pytest.approx(-100, abs=51.1)
    page.get_by_role("button", name="Lung").click()
    assert page.locator("#level").input_value() == "-600"
    assert page.get_by_role("button", name="Lung").get_attribute("aria-pressed") == "true"
