"""A Dask cluster on this machine: work that others do, and what is said where there is none."""

import builtins
import math
import os
import signal
from pathlib import Path
from typing import Any

import h5py
import pytest
import torch
from cone_scans import HELIX, EndsItsWorker, scan_of_water
from numpy.testing import assert_equal

from pnpct.cli.slabs import RaysOfFile
from pnpct.comparison import Study, compare
from pnpct.files import Provenance, write_scan
from pnpct.geometry import ImageGrid, VolumeGrid
from pnpct.operators.processes import side_by_side
from pnpct.reconstruction import FBP, TVPWLS, reconstruct_volume
from pnpct.simulation import Recipe, simulate_dataset

GRID = VolumeGrid(ImageGrid(24, 24, spacing=10.0), slices=12, slice_spacing=0.5, z=25.0)


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    distributed = pytest.importorskip("distributed", reason="Dask is not installed (pip install 'pnpct[cluster]')")
    from dask import config

    settings = {"temporary-directory": str(tmp_path_factory.mktemp("dask")), "distributed.dashboard.enabled": False}
    with (
        config.set(settings),
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
    ):
        yield cluster.scheduler_address


@pytest.fixture
def scan(tmp_path):
    write_scan(tmp_path / "scan.h5", scan_of_water(HELIX), provenance=Provenance(["pnpct"], "0.1.0"))
    return tmp_path / "scan.h5"


def volume(rays, method, **workers) -> torch.Tensor:
    slabs = reconstruct_volume(rays, HELIX, GRID, method, mu_water=0.02, **workers)
    return torch.cat([slab.image for slab in slabs])


def contents(path: Path) -> dict[str, Any]:
    """What an HDF5 file holds; HDF5 may lay the same out otherwise."""
    found: dict[str, Any] = {}
    with h5py.File(path) as file:
        found |= {f"/{name}": value for name, value in file.attrs.items()}
        file.visititems(lambda name, item: found.update({f"{name}/{key}": value for key, value in item.attrs.items()}))
        file.visititems(lambda name, item: found.update({name: item[()]}) if isinstance(item, h5py.Dataset) else None)
    return found


SLOW = pytest.mark.slow  # workers take their time on a busy machine


@SLOW
@pytest.mark.parametrize("method", [FBP(), TVPWLS(iterations=2)], ids=["FBP", "TV"])
def test_a_worker_that_dies_costs_its_task_and_not_the_volume(address, scan, tmp_path, monkeypatch, method):
    monkeypatch.chdir(tmp_path)
    rays = RaysOfFile(scan.relative_to(tmp_path), torch.device("cpu"))
    ended = tmp_path / "ended"
    made = volume(EndsItsWorker(rays, ended), method, cluster=address)
    assert ended.exists()
    assert torch.equal(made, volume(rays, method))


@SLOW
def test_a_data_set_and_a_comparison_are_those_of_processes_of_one_thread(address, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    recipe = Recipe(("head",), cases=2, rows=1, tube_voltages_kvp=(120.0,), views=24, bins=30, size=16)
    study = Study(tube_currents_ma=(50.0,), lesion_hu=0.0, phantom_repeats=0)
    for name, workers in (("here", {"processes": torch.get_num_threads()}), ("others", {"cluster": address})):
        scanned = list(simulate_dataset(Path(name), recipe, **workers))
        scans = [Path(name) / file for scan in scanned for file in scan.files]
        compare(Path(f"{name} compared"), sorted(scans), {"sharp": FBP("ram-lak")}, study=study, **workers)
    made = [path.relative_to("here") for path in Path("here").rglob("*.h5")]
    assert len(made) == 2
    for path in made:
        assert_equal(contents("others" / path), contents("here" / path))
    tables = [Path(f"{name} compared", "metrics.csv").read_text().splitlines() for name in ("here", "others")]
    one, others = ([row for row in rows if not row.endswith("/seconds")] for rows in tables)
    assert one == others


@SLOW
def test_what_ends_every_worker_is_said(address):
    with pytest.raises(OSError, match="A task has ended several workers one after the other, for lack of memory"):
        list(side_by_side(signal.raise_signal, [(signal.SIGKILL,)], processes=1, cluster=address))
    assert list(side_by_side(math.sqrt, [(4.0,)], processes=1, cluster=address)) == [2.0]


@SLOW
def test_a_folder_that_workers_lack_is_said(address, tmp_path, monkeypatch):
    here = tmp_path / "here"
    here.mkdir()
    monkeypatch.chdir(here)
    monkeypatch.setattr("pathlib.Path.cwd", lambda: tmp_path / "elsewhere")
    with pytest.raises(OSError, match=r"A worker has no folder .*elsewhere; a cluster needs a folder that all its"):
        list(side_by_side(os.getpid, [()], processes=1, cluster=address))


@SLOW
def test_another_version_on_a_worker_is_said(address, monkeypatch):
    monkeypatch.setattr("pnpct.operators.cluster.version", lambda _: "9.9")
    with pytest.raises(ValueError, match=r"A worker has version \S+ of pnpct, and 9\.9 is needed"):
        list(side_by_side(os.getpid, [()], processes=1, cluster=address))


@pytest.mark.parametrize("address", ["", "nonsense", "tcp://127.0.0.1:x", "tcp://127.0.0.1:1"])
def test_where_there_is_no_scheduler(monkeypatch, address):
    pytest.importorskip("distributed", reason="Dask is not installed (pip install 'pnpct[cluster]')")
    monkeypatch.setattr("pnpct.operators.cluster._PATIENCE", 0.2)
    with pytest.raises(OSError, match=f"There is no Dask scheduler at {address}; start one"):
        list(side_by_side(os.getpid, [()], processes=1, cluster=address))


def test_without_dask_it_is_said_how_to_install_it(monkeypatch):
    load = builtins.__import__

    def without(name, *arguments, **options):
        if name.startswith("distributed"):
            raise ModuleNotFoundError(name)
        return load(name, *arguments, **options)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(ModuleNotFoundError, match=r"pip install 'pnpct\[cluster\]'"):
        list(side_by_side(os.getpid, [()], processes=1, cluster="tcp://127.0.0.1:8786"))
