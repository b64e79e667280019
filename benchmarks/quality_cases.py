"""The scans that `quality.py` judges denoisers by; none took part in training."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from scipy import ndimage

from pnpct.arrays import Image
from pnpct.evaluation import soft_tissue_mask
from pnpct.files import ExposedSlice, read_exposure, record_run, write_exposures
from pnpct.geometry import ImageGrid, Lesion
from pnpct.physics import Exposure, Moments
from pnpct.simulation import (
    BLURRED,
    Sampling,
    as_exposure,
    clinical_fan_beam,
    procedural_patient,
    scanner_beam,
    simulate_moments,
    truth,
    with_lesions,
)
from pnpct.units import to_hu
from reference_scans import FOLDER, chest

PATIENTS = 900
"""Seed of the procedural patients that the networks were chosen by."""

DIAMETER_MM, CONTRAST_HU = 12.0, -40.0

RESIZED = {"large-abdomen": ("abdomen", 1.2), "child": ("abdomen", 0.7)}
"""The same patients in another size."""

WIDEST_MM = 500.0
"""Field of view of the scanner."""


@dataclass(frozen=True, eq=False)
class QualityCase:
    """An object, and the same with a lesion.

    Args:
        name: Of the case.
        plain: Without the lesion.
        lesion: With it; None where it cannot be put in.
        core: Pixels in the middle of the lesion.
        uniform: Pixels of soft tissue without structure.
    """

    name: str
    plain: ExposedSlice
    lesion: ExposedSlice | None
    core: torch.Tensor
    uniform: torch.Tensor


def cases(folder: Path, names: list[str], patients: int = PATIENTS, *, blur: bool = False) -> Iterator[QualityCase]:
    """Yield the cases, made or read from the folder; "catsim-chest" is the chest through CatSim, always the same.

    Args:
        folder: Of the cases, which are made once.
        names: Of the cases.
        patients: Seed of the procedural ones.
        blur: Whether focal spot, cells and rotation blur their scans, as they do those of CatSim.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        if name == "catsim-chest":
            plain = _catsim_chest()
            uniform, _ = _uniform(plain.truth, plain.grid)
            yield QualityCase(name, plain, None, torch.zeros_like(uniform), uniform)
            continue
        files = [folder / f"{name}-{kind}.h5" for kind in ("plain", "lesion")]
        if not all(file.exists() for file in files):
            _make(name, files, patients, BLURRED if blur else Sampling())
        plain, lesion = (read_exposure(file) for file in files)
        change = to_hu(lesion.truth) - to_hu(plain.truth)
        uniform, _ = _uniform(plain.truth, plain.grid)
        middle = ndimage.center_of_mass((change < CONTRAST_HU / 2).numpy())
        rows, cols = np.mgrid[: change.shape[0], : change.shape[1]]
        away = np.hypot(rows - middle[0], cols - middle[1]) * plain.grid.spacing
        yield QualityCase(name, plain, lesion, torch.from_numpy(away < 0.3 * DIAMETER_MM), uniform)


def _make(name: str, files: list[Path], patients: int, sampling: Sampling) -> None:
    anatomy, scale = RESIZED.get(name, (name, 1.0))
    source = procedural_patient(anatomy, np.random.default_rng([patients, *anatomy.encode()])).resized(scale)
    grid, geometry = source.grid, clinical_fan_beam()
    grid = replace(grid, spacing=min(grid.spacing, WIDEST_MM / grid.cols))
    beam = scanner_beam(geometry, tube_voltage_kvp=120.0)
    image = truth(source.body.slice(source.height, grid.halved), grid, energy=beam.effective_energy)
    _, (x, y) = _uniform(image, grid)
    marked = with_lesions(source.body, [Lesion((x, y, source.height), DIAMETER_MM / 2, CONTRAST_HU)])
    for file, body in zip(files, (source.body, marked), strict=True):
        phantom = body.slice(source.height, grid.halved)
        (moments,) = simulate_moments(phantom, geometry, [beam], sampling=sampling)
        image = truth(phantom, grid, energy=beam.effective_energy)
        exposed = ExposedSlice(as_exposure(moments, geometry, beam), image, grid)
        write_exposures(file, {120.0: exposed}, provenance=record_run(["benchmarks/quality.py"], seed=patients))


def _uniform(image: Image, grid: ImageGrid) -> tuple[torch.Tensor, tuple[float, float]]:
    """Soft tissue in surroundings of 12 mm that vary least, and the place (x, y) whose 24 mm vary least."""
    hu = to_hu(image).double().numpy()
    soft = soft_tissue_mask(image).numpy()

    def around(diameter: float) -> tuple[np.ndarray, np.ndarray]:
        side = round(diameter / grid.spacing)
        mean = ndimage.uniform_filter(hu, side)
        spread = np.sqrt(np.maximum(ndimage.uniform_filter(hu**2, side) - mean**2, 0.0))
        inside = ndimage.minimum_filter(soft, side) & (mean > 0) & (mean < 120)
        return spread, inside

    spread, inside = around(24.0)
    row, col = np.unravel_index(np.argmin(np.where(inside, spread, np.inf)), hu.shape)
    spread, inside = around(12.0)
    quiet = inside & (spread <= np.quantile(spread[inside], 0.25))
    return torch.from_numpy(quiet), (float(grid.x[col]), float(grid.y[row]))


def _catsim_chest() -> ExposedSlice:
    reference = chest("mA800_r0", 800.0)
    folder = FOLDER / "catsim" / "chest"
    mean, variance = (np.load(folder / f"signal_{kind}_800mA.npz") for kind in ("mean", "var"))
    share = reference.scan.geometry.views / 800.0  # the file is for 800 mA over a second, exposures for 1 mAs a view
    parts = (mean["S1"], variance["S2"], mean["air_S1"], variance["air_S2"])
    tensors = [torch.from_numpy(np.asarray(part, np.float32) * np.float32(share)) for part in parts]
    moments = Moments(*tensors, electronic_noise=3500.0 / 17.0)
    scan = reference.scan
    exposure = Exposure(moments, scan.geometry, scan.mu_water, scan.beam_hardening)
    return ExposedSlice(exposure, reference.truth, reference.grid)
