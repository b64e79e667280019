"""Data sets: many patients under one scanner, every slice a file of its own, split by patient.

Noise, tube current and tube voltage are not fixed in it: scans are drawn from the moments when they are needed.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from pnpct.files import (
    MANIFEST,
    ExposedSlice,
    ListedScan,
    Manifest,
    Provenance,
    read_manifest,
    sha256_of,
    sole_writer,
    write_exposures,
    write_manifest,
)
from pnpct.geometry import FanBeam
from pnpct.operators.processes import side_by_side
from pnpct.physics import Moments
from pnpct.simulation.anatomy import ANATOMIES
from pnpct.simulation.beam import scanner_beam
from pnpct.simulation.catsim import CatSimSampling, catsim_moments, cone_slices
from pnpct.simulation.catsim_job import require_catsim
from pnpct.simulation.phantom import truth
from pnpct.simulation.recipe import Recipe, Station, plan
from pnpct.simulation.scanner import (
    BLURRED,
    SLICE_THICKNESS,
    Sampling,
    as_exposure,
    clinical_fan_beam,
    simulate_moments,
)
from pnpct.simulation.sources import Source, fingerprint, from_files, is_phantom, procedural_patient


def simulate_dataset(
    folder: Path, recipe: Recipe, *, processes: int = 1, cluster: str | None = None
) -> Iterator[ListedScan]:
    """Make a data set, or what is missing of it, and yield each axial scan when its files are there.

    After every scan the manifest lists it with the hashes of its files. If it is killed and started again, it
    continues, and the files are the same bytes as those of an uninterrupted run on the same machine.

    Args:
        folder: Output folder; it is created.
        recipe: What it depends on; the same as that of an unfinished data set in the folder.
        processes: Scans that are simulated in parallel.
        cluster: Address of the scheduler of a Dask cluster, whose workers take the place of processes.

    Yields:
        First what earlier runs have made, then each scan when it is done.

    Raises:
        OSError: If a file cannot be read or written, another process writes there, or a process dies.
        ValueError: If the folder holds something else, or the data set of another recipe; or a body cannot be
            scanned.
    """
    if processes < 1:
        raise ValueError(f"A data set needs at least one process, got {processes}.")
    if recipe.simulator == "catsim":
        require_catsim()
    inputs = {path: fingerprint(Path(path)) for path in recipe.bodies}
    if len(set(inputs.values())) < len(recipe.bodies):
        raise ValueError("One body is given twice; its slices would be in training and in testing.")
    settings: dict[str, Any] = json.loads(json.dumps(asdict(recipe) | {"inputs": inputs, "pnpct": version("pnpct")}))
    stations = plan(recipe)
    done = _earlier(folder, settings, stations)
    for station in {station.source: station for station in stations}.values():
        _heights(recipe, _source(recipe, station), station)
    folder.mkdir(parents=True, exist_ok=True)
    with sole_writer(folder):
        # Before any file of a scan, so that no other recipe takes it for its own.
        write_manifest(folder, Manifest(settings, list(done.values())))
        yield from done.values()
        calls = [(folder, recipe, station) for station in stations if station.name not in done]
        with closing(side_by_side(_scan, calls, processes=processes, cluster=cluster)) as made:
            for scanned in made:
                done[scanned.name] = scanned
                listed = [done[station.name] for station in stations if station.name in done]
                write_manifest(folder, Manifest(settings, listed))
                yield scanned


def _heights(recipe: Recipe, source: Source, station: Station) -> tuple[float, ...]:
    """Where the rows of a station are, mm."""
    lowest, highest = source.body.extent
    cone = cone_slices(_geometry(recipe), source.grid, recipe.rows) if recipe.simulator == "catsim" else 0
    needed = (recipe.rows - 1 + 2 * cone) * SLICE_THICKNESS
    if highest - lowest < needed:
        raise ValueError(
            f"{station.source} is known over {highest - lowest:g} mm, but {recipe.rows} rows need {needed:g} mm."
        )
    bottom = lowest + cone * SLICE_THICKNESS + station.share * (highest - lowest - needed)
    return tuple(bottom + row * SLICE_THICKNESS for row in range(recipe.rows))


def _geometry(recipe: Recipe) -> FanBeam:
    return clinical_fan_beam(views=recipe.views, bins=recipe.bins)


def _scan(folder: Path, recipe: Recipe, station: Station) -> ListedScan:
    """Scan a station and write its files."""
    source = _source(recipe, station)
    z = _heights(recipe, source, station)
    files = {}
    names = _files_of(station, recipe.rows)
    for name, slices, height in zip(names, _exposed(recipe, source, z), z, strict=True):
        settings = asdict(recipe) | {"station": asdict(station), "z_mm": height}
        command = ["pnpct", "simulate", "dataset"]
        provenance = Provenance(command, version("pnpct"), seed=recipe.seed, settings=settings)
        description = f"{station.source}, z = {height:.3f} mm, for 1 mAs in each view"
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        write_exposures(folder / name, slices, provenance=provenance, description=description)
        files[name] = sha256_of(folder / name)
    return ListedScan(station.name, station.source, station.patient, station.split, z, files)


def _source(recipe: Recipe, station: Station) -> Source:
    if station.own:
        path = Path(station.source)
        source = from_files(path, size=recipe.size, noise_hu=0.0 if is_phantom(path) else recipe.noise_hu)
    else:
        source = _procedural(station.source, station.patient, recipe.seed, recipe.size)
    side = source.grid.spacing * recipe.size
    scale = min(station.scale, max(1.0, 2 * _geometry(recipe).field_of_view_radius / side))
    return source if scale == 1 else source.resized(scale)


@lru_cache(maxsize=len(ANATOMIES))  # the first of each anatomy is looked at before the work, others have stations
def _procedural(anatomy: str, patient: int, seed: int, size: int) -> Source:
    return procedural_patient(anatomy, np.random.default_rng([seed, patient, *anatomy.encode()]), size=size)


def _exposed(recipe: Recipe, source: Source, z: tuple[float, ...]) -> Iterator[dict[float, ExposedSlice]]:
    """Yield each row's exposures by tube voltage."""
    geometry, grid = _geometry(recipe), source.grid.halved
    beams = {voltage: scanner_beam(geometry, tube_voltage_kvp=voltage) for voltage in recipe.tube_voltages_kvp}
    sampling = BLURRED if recipe.blur else Sampling()
    by_catsim: dict[float, Sequence[Moments]] = {}
    if recipe.simulator == "catsim":
        middle = (z[0] + z[-1]) / 2
        by_catsim = {
            voltage: catsim_moments(
                source.body,
                geometry,
                tube_voltage_kvp=voltage,
                rows=len(z),
                z=middle,
                grid=grid,
                sampling=CatSimSampling(sampling.focal_spot, sampling.views),
            )
            for voltage in beams
        }
    for row, height in enumerate(z):
        phantom = source.body.slice(height, grid)
        moments = [of[row] for of in by_catsim.values()] or simulate_moments(
            phantom, geometry, [*beams.values()], sampling=sampling
        )
        slices = {}
        for (voltage, beam), each in zip(beams.items(), moments, strict=True):
            image = truth(phantom, source.grid, energy=beam.effective_energy)
            slices[voltage] = ExposedSlice(as_exposure(each, geometry, beam), image, source.grid)
        yield slices


def _earlier(folder: Path, settings: Mapping[str, Any], stations: Sequence[Station]) -> dict[str, ListedScan]:
    """What an earlier run has made and is still intact."""
    if not folder.exists() or not (found := {path.name for path in folder.iterdir() if path.name[0] != "."}):
        return {}
    if MANIFEST not in found:
        raise ValueError(f"{folder} holds something that is not a data set; choose another folder.")
    manifest = read_manifest(folder)
    if manifest.recipe != settings:
        differing = ", ".join(sorted(key for key in settings if manifest.recipe.get(key) != settings[key]))
        raise ValueError(f"{folder} holds a data set of another recipe ({differing}); choose another folder.")
    wanted = {_files_of(station, settings["rows"]): station for station in stations}
    listed = {tuple(scan.files): scan for scan in manifest.scans}
    return {
        station.name: listed[files]
        for files, station in wanted.items()
        if files in listed and listed[files].name == station.name and _whole(folder, listed[files])
    }


def _files_of(station: Station, rows: int) -> tuple[str, ...]:
    return tuple(f"{station.split}/{station.name}-row{row:02d}.h5" for row in range(rows))


def _whole(folder: Path, scan: ListedScan) -> bool:
    files = scan.files.items()
    return all((folder / name).exists() and sha256_of(folder / name) == digest for name, digest in files)
