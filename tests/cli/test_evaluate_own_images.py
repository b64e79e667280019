"""`pnpct evaluate` on images of one's own: arrays, other units, and texture that cannot be measured."""

from pathlib import Path

import numpy as np
import pytest
import torch

from pnpct.files import write_image
from pnpct.geometry import ImageGrid, VolumeGrid
from pnpct.units import from_hu


@pytest.fixture
def image_hu() -> np.ndarray:
    image_hu = np.random.default_rng(0).normal(40, 10, (2, 24, 24)).astype(np.float32)
    image_hu[:, :4] = -1000
    return image_hu


def saved(path: Path, image_hu: np.ndarray) -> Path:
    np.savez(path, hu=image_hu, z_mm=[-1.0, 1.0], spacing_mm=0.8)
    return path


def test_an_array_with_its_places_is_compared_with_any_other_image(tmp_path: Path, image_hu, run) -> None:
    array, truth = saved(tmp_path / "mine.npz", image_hu + 5), tmp_path / "truth.nii.gz"
    write_image(truth, from_hu(torch.from_numpy(image_hu)), VolumeGrid(ImageGrid(24, 24, 0.8), 2, 2.0))
    status, out, err = run("evaluate", array, truth)
    assert (status, err) == (0, "")
    (rmse,) = [line.split()[1] for line in out.splitlines() if line.split()[:1] == ["rmse_hu"]]
    assert float(rmse) == pytest.approx(5, abs=0.01)
    assert "No texture: patches have 64 x 64 pixels, the images only 24 x 24." in out
    assert "?" not in out


def test_an_image_in_another_unit_is_measured_and_named(tmp_path: Path, image_hu, run) -> None:
    truth, stored = saved(tmp_path / "truth.npz", image_hu), saved(tmp_path / "stored.npz", image_hu + 1024)
    status, out, _ = run("evaluate", stored, truth)
    assert status == 0
    assert out.count("?") == 1
    assert f"{stored}: values from 24 to " in out
    assert "are they stored values, without the intercept of -1024?" in out


def test_an_array_without_places_is_refused_with_what_to_save(tmp_path: Path, image_hu, run) -> None:
    np.save(tmp_path / "mine.npy", image_hu)
    status, _, err = run("evaluate", tmp_path / "mine.npy", saved(tmp_path / "truth.npz", image_hu))
    assert status == 2
    assert err.endswith("mine.npy does not say where its pixels are; save hu, z_mm and spacing_mm by numpy.savez.\n")
