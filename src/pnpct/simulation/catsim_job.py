"""A run of CatSim: its phantom and materials on disk, its process, and what went wrong in it."""

import importlib.util
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import xraydb
from numpy.typing import NDArray

from pnpct.files import FractionMap, write_xcist_phantom
from pnpct.geometry import ImageGrid
from pnpct.simulation.materials import MATERIALS, attenuation
from pnpct.simulation.phantom import Phantom

Settings = dict[str, dict[str, Any]]
"""CatSim's settings by its own groups and names."""

_QUIET = {"MPLBACKEND": "Agg", "OMP_NUM_THREADS": "1", "PYTHONWARNINGS": "ignore"}


def require_catsim() -> None:
    """Find CatSim before work begins.

    Raises:
        ImportError: If it is not installed.
    """
    if importlib.util.find_spec("gecatsim") is None:
        raise ModuleNotFoundError("CatSim is not installed; install it with: pip install 'pnpct[catsim]'.")


@contextmanager
def catsim_results(
    slices: Sequence[Phantom], *, slice_thickness: float, settings: Settings, seed: int | None
) -> Iterator[Path]:
    """Run CatSim in a process and a folder of its own; give the folder while its results are there.

    Args:
        slices: Slices of the phantom on one grid, the lowest first, the middle of all at z = 0.
        slice_thickness: Height of a slice, mm, > 0.
        settings: What differs from CatSim's defaults.
        seed: Of CatSim's own noise; None for moments without noise instead.

    Yields:
        The folder of `catsim_worker`, which is removed in the end.

    Raises:
        OSError: If CatSim fails, or there is no room for its files.
    """
    with tempfile.TemporaryDirectory(prefix="pnpct-catsim-") as name:
        folder = Path(name)
        write_xcist_phantom(folder / "phantom.json", [*_maps(slices, slice_thickness, folder)])
        groups = {**settings, "phantom": {"filename": str(folder / "phantom.json")}}
        # What JSON writes is Python too, and has no names of numpy in it.
        lines = [
            f"{group}.{key} = {json.dumps(value, default=lambda number: number.item(), ensure_ascii=False)}"
            for group, values in groups.items()
            for key, value in values.items()
        ]
        (folder / "run.cfg").write_text("\n".join(lines), encoding="utf-8")
        _run_worker(folder, [] if seed is None else [str(seed)])
        yield folder


def _maps(slices: Sequence[Phantom], slice_thickness: float, folder: Path) -> Iterator[FractionMap]:
    """The materials other than air, and a file of CatSim for each."""
    solid = dict.fromkeys(name for phantom in slices for name in phantom.materials if name != "air")
    for number, material in enumerate(solid or ["water"]):
        fractions = np.stack([_fractions(phantom, material) for phantom in slices])
        file = folder / f"material_{number}"
        file.write_text(_material_file(material), encoding="utf-8")
        yield _cropped(FractionMap(str(file), fractions, slices[0].grid, slice_thickness))


def _fractions(phantom: Phantom, material: str) -> NDArray[np.float32]:
    chosen = [index for index, name in enumerate(phantom.materials) if name == material]
    fractions: NDArray[np.float32] = phantom.fractions[chosen].sum(dim=0).float().cpu().numpy()
    return fractions


def _material_file(material: str) -> str:
    """The composition in CatSim's format, its density lowered by the air that it displaces."""
    of, middle = MATERIALS[material], np.array([70.0])
    displaced = float(attenuation("air", middle)[0] / attenuation(material, middle)[0])
    # CatSim scales the mass fractions to a sum of 1; we do not.
    density = of.density * sum(of.mass_fractions.values()) * (1 - displaced)
    lines = [f"{xraydb.atomic_number(element)} {share:.9f}" for element, share in of.mass_fractions.items()]
    return "\n".join([f"# {material}", str(len(lines)), f"{density:.9f}", *lines, ""])


def _cropped(of: FractionMap) -> FractionMap:
    """The box of voxels that are not empty: CatSim's time goes with the size of the boxes."""
    windows, shifts = [], []
    for axis, voxels in enumerate(of.fractions.shape):
        used = np.flatnonzero(of.fractions.any(axis=tuple({0, 1, 2} - {axis})))
        first, last = (int(used[0]), int(used[-1])) if len(used) else (0, 0)
        windows.append(slice(first, last + 1))
        shifts.append((first + last + 1 - voxels) / 2)
    fractions, spacing, (x, y) = of.fractions[tuple(windows)], of.grid.spacing, of.grid.center
    center = (x + shifts[2] * spacing, y - shifts[1] * spacing)
    _, rows, cols = fractions.shape
    grid = ImageGrid(rows, cols, spacing=spacing, center=center)
    return FractionMap(of.material, fractions, grid, of.slice_thickness, of.center_z + shifts[0] * of.slice_thickness)


def _run_worker(folder: Path, options: list[str]) -> None:
    # Not as a module: that would import this whole package in the new process.
    worker = Path(__file__).with_name("catsim_worker.py")
    done = subprocess.run(
        [sys.executable, "-P", str(worker), str(folder), *options],
        cwd=folder,
        env={**os.environ, **_QUIET},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        check=False,
    )
    lines = [line.strip() for line in done.stdout.decode(errors="replace").splitlines() if line.strip()]
    # CatSim's library reports a lack of memory in words and goes on.
    errors = [line for line in lines if "*** Error" in line]
    if done.returncode == 0 and not errors:
        return
    reason = (errors or lines or ["it gave no reason"])[-1]
    if done.returncode < 0:
        reason = f"its process was ended by signal {-done.returncode}, perhaps for lack of memory"
    raise ChildProcessError(f"CatSim failed: {reason.rstrip('.')}.")
