"""One run of CatSim, in a process of its own: python catsim_worker.py FOLDER [SEED].

CatSim prints, keeps its phantom and its random numbers in globals, and looks for files in the working folder; so
it gets a process and a folder for every run. FOLDER/run.cfg is its configuration. Without a seed the noise-free
moments of the signal go to FOLDER/moments.npz; with one, FOLDER/run.scan and FOLDER/run.air are CatSim's own.
"""

import importlib
import sys
import types
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Moments = NDArray[np.float32]


class EnergyMoments:
    """A detection callback that keeps Σ λ E and Σ λ E² of every view instead of drawing photons.

    It stands in for CatSim's Detection_EI and agrees with it in the mean.
    """

    def __init__(self) -> None:
        self._feval = _from_catsim("CommonTools", "feval")
        self._attenuation = _from_catsim("GetMu", "GetMu")
        self._photons: Any = 0.0
        self.air: list[Moments] = []
        self.views: list[Moments] = []

    def __call__(self, cfg: Any, view: int, subview: int) -> Any:
        """Take the photons of one part of a view; CatSim calls it."""
        energies = cfg.sim.Evec
        if view == cfg.sim.startViewId and subview == 0:
            depth = 0.1 * cfg.scanner.detectorDepth / np.cos(cfg.det.betas)
            absorbed = -np.expm1(-depth * self._attenuation(cfg.scanner.detectorMaterial, energies))
            self._efficiency = self._feval(cfg.physics.prefilterCallback, cfg) * absorbed
        photons = cfg.thisSubView * self._efficiency
        self._photons = photons if subview == 0 else self._photons + photons
        if subview == cfg.sim.subViewCount - 1:
            # CatSim numbers its cells column by column.
            shape = (cfg.scanner.detectorColCount, cfg.scanner.detectorRowCount)
            signal = [self._photons @ energies.astype(np.float64) ** power for power in (1, 2)]
            moments = np.stack([sums.reshape(shape).T for sums in signal]).astype(np.float32)
            (self.air if cfg.sim.isAirScan else self.views).append(moments)
            cfg.thisView = signal[0].astype(np.float32)
        return cfg


def run(folder: Path, seed: int | None) -> None:
    """Scan air and phantom.

    Args:
        folder: Where run.cfg is and the results go.
        seed: Of CatSim's noise; None for the moments without noise.
    """
    catsim = importlib.import_module("gecatsim").CatSim(str(folder / "run.cfg"))
    catsim.resultsName = str(folder / "run")
    # CatSim reads raw maps into a tuple of Python's floats, 32 bytes each.
    phantoms = importlib.import_module("gecatsim.pyfiles.Phantom_Voxelized")
    phantoms.rawread = lambda name, *_: np.fromfile(name, "<f4")  # type: ignore[attr-defined]
    moments = EnergyMoments()
    if seed is None:
        # CatSim imports a callback as the module of its name.
        sys.modules["energy_moments"] = types.ModuleType("energy_moments")
        sys.modules["energy_moments"].energy_moments = moments  # type: ignore[attr-defined]
        catsim.scanner.detectionCallback = "energy_moments"
    else:
        _from_catsim("set_rndseed", "set_rndseed")(catsim.cfg, seed)
        np.random.seed(seed)  # noqa: NPY002  # the electronic noise comes from numpy's global state
    catsim.air_scan()
    catsim.phantom_scan()
    if seed is None:
        np.savez(folder / "moments.npz", air=moments.air[0], views=np.stack(moments.views))


def _from_catsim(module: str, name: str) -> Any:
    return getattr(importlib.import_module(f"gecatsim.pyfiles.{module}"), name)


if __name__ == "__main__":
    run(Path(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else None)
