from pathlib import Path

import h5py
import pytest
import torch

from pnpct.files import ExposedSlice, FileFormatError, Provenance, read_exposure, tube_voltages, write_exposures
from pnpct.geometry import FanBeam, ImageGrid, evenly_spaced_views
from pnpct.physics import BeamHardening, BoneHardening, Exposure, Moments

FAN = FanBeam(evenly_spaced_views(6), 10, 541.0, 949.0, 90.0)
GRID = ImageGrid(4, 4, spacing=50.0)
PROVENANCE = Provenance(["pnpct", "simulate", "dataset"], "0.1.0", seed=1)


def exposed(scale: float) -> ExposedSlice:
    generator = torch.Generator().manual_seed(0)
    mean = scale * (1 + torch.rand(FAN.shape, generator=generator))
    moments = Moments(mean, 70 * mean, 2 * scale * torch.ones(10), 130 * scale * torch.ones(10), electronic_noise=3.5)
    bone = BoneHardening(torch.arange(6.0)[None] / 100, compact=2.5)
    hardening = BeamHardening(torch.tensor([[0.01, 1.0, 0.0]], dtype=torch.float64), bone)
    return ExposedSlice(Exposure(moments, FAN, 0.0195, hardening), torch.rand(4, 4, generator=generator), GRID)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    write_exposures(tmp_path / "slice.h5", {80.0: exposed(1e3), 120.0: exposed(5e3)}, provenance=PROVENANCE)
    return tmp_path / "slice.h5"


def test_what_is_written_is_read_within_the_precision_that_is_stated(path: Path) -> None:
    assert tube_voltages(path) == (80.0, 120.0)
    for voltage, wanted in ((80.0, exposed(1e3)), (120.0, exposed(5e3))):
        found = read_exposure(path, tube_voltage_kvp=voltage)
        assert found.grid == GRID
        assert found.exposure.geometry == FAN
        assert found.exposure.mu_water == 0.0195
        assert found.exposure.moments.electronic_noise == 3.5
        torch.testing.assert_close(found.truth, wanted.truth)
        for part in ("signal_mean", "signal_variance", "air_mean", "air_variance"):
            mine, theirs = getattr(found.exposure.moments, part), getattr(wanted.exposure.moments, part)
            torch.testing.assert_close(mine, theirs, rtol=6.2e-5, atol=0)
        assert found.exposure.beam_hardening is not None
        assert found.exposure.beam_hardening.coefficients.tolist() == [[0.01, 1.0, 0.0]]
        assert found.exposure.beam_hardening.bone is not None
        assert found.exposure.beam_hardening.bone.compact == 2.5
        torch.testing.assert_close(found.exposure.beam_hardening.bone.coefficients, torch.arange(6.0)[None] / 100)


def test_a_scan_can_be_drawn_from_what_is_read(path: Path) -> None:
    exposure = read_exposure(path).exposure
    first, again, other = (
        exposure.scan(tube_current_ma=100.0, generator=torch.Generator().manual_seed(seed)) for seed in (1, 1, 2)
    )
    assert torch.equal(first.counts, again.counts)
    assert not torch.equal(first.counts, other.counts)


def test_the_same_exposures_are_the_same_bytes(path: Path, tmp_path: Path) -> None:
    write_exposures(tmp_path / "again.h5", {80.0: exposed(1e3), 120.0: exposed(5e3)}, provenance=PROVENANCE)
    assert (tmp_path / "again.h5").read_bytes() == path.read_bytes()


def test_a_voltage_that_is_not_there_is_named_with_those_that_are(path: Path) -> None:
    with pytest.raises(FileFormatError, match="no exposure at 90 kVp in this file; there are 120 kVp, 80 kVp"):
        read_exposure(path, tube_voltage_kvp=90.0)


def test_files_that_are_not_whole_are_refused(path: Path, tmp_path: Path) -> None:
    short = tmp_path / "short.h5"
    short.write_bytes(path.read_bytes()[:-500])
    with pytest.raises(FileFormatError):
        read_exposure(short)
    with h5py.File(path, "a") as file:
        del file["120 kVp/signal_mean"]
    with pytest.raises(FileFormatError, match="signal_mean is missing"):
        read_exposure(path)


def test_exposures_of_two_geometries_do_not_share_a_file(tmp_path: Path) -> None:
    other = exposed(1.0)
    moved = FanBeam(FAN.view_angles, 10, 541.0, 949.0, 80.0)
    exposure = Exposure(other.exposure.moments, moved, 0.02, None)
    with pytest.raises(ValueError, match="one geometry, got 2"):
        write_exposures(tmp_path / "two.h5", {80.0: exposed(1.0), 120.0: ExposedSlice(exposure)}, provenance=PROVENANCE)
    assert not list(tmp_path.iterdir())
