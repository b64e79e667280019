"""Planes of a volume that other processes make."""

import gc

import pytest
import torch
from cone_scans import HELIX, scan_of_water

from pnpct.geometry import ImageGrid, VolumeGrid
from pnpct.operators import Projector, processes
from pnpct.physics import Scan, take_log
from pnpct.reconstruction import FBP, reconstruct_volume
from pnpct.reconstruction.parts import _unpacked

GRID = VolumeGrid(ImageGrid(24, 24, spacing=10.0), slices=5, slice_spacing=1.0, z=25.0)


class RaysOfScan:
    def __init__(self, scan: Scan):
        self.scan = scan

    def __call__(self, views):
        return take_log(self.scan[views])


@pytest.fixture(scope="module")
def rays():
    return RaysOfScan(scan_of_water(HELIX))


@pytest.fixture(autouse=True)
def here(monkeypatch):
    """Do all in this process, as if in others: with what is packed and unpacked."""
    this_process = processes.worker_processes
    monkeypatch.setattr(processes, "worker_processes", lambda _: this_process(1))
    _unpacked.cache_clear()
    yield
    _unpacked.cache_clear()


def volume(rays, **workers) -> torch.Tensor:
    slabs = reconstruct_volume(rays, HELIX, GRID, FBP(), mu_water=0.02, slab=2, **workers)
    return torch.cat([slab.image for slab in slabs])


def test_they_are_those_of_one_process_and_a_process_unpacks_once(rays):
    assert torch.equal(volume(rays, processes=2), volume(rays))
    assert _unpacked.cache_info().misses == 1
    assert _unpacked.cache_info().hits > 3


def test_no_projector_of_a_volume_outlives_it(rays):
    gc.collect()
    gc.disable()  # reference cycles stay, with all arrays, until it is their turn
    try:
        before = projectors()
        volume(rays)
        assert projectors() <= before
    finally:
        gc.enable()


def projectors() -> int:
    return sum(type(each) is Projector for each in gc.get_objects())


def test_what_cannot_be_given_to_other_processes_is_said(rays):
    with pytest.raises(ValueError, match="at the top level of a module, or reconstruct in one process"):
        volume(lambda views: rays(views), processes=2)
    with pytest.raises(ValueError, match="at least one process, got 0"):
        volume(rays, processes=0)
