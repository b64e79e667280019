"""A comparison of three methods on two cases, with something in every section; all numbers are invented."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

from pnpct.arrays import Image
from pnpct.comparison import (
    Case,
    Check,
    ComparedMethod,
    Comparison,
    Curve,
    Detail,
    DosePoint,
    DoseShare,
    LeastReduction,
    StoredImage,
    Task,
    TextureGroup,
    write_comparison,
)
from pnpct.comparison.image_hash import image_sha256
from pnpct.evaluation import FEATURES, Detectability, FeatureChange, Interval, LesionRecovery, Patch, TextureChange
from pnpct.files import Provenance, read_image, write_image
from pnpct.geometry import ImageGrid, Lesion
from pnpct.units import from_hu

GRID = ImageGrid(64, 64, spacing=4.0, center=(10.0, -20.0))
PROVENANCE = Provenance(["pnpct", "compare", "scans"], "0.1.0", seed=7, inputs={"network.safetensors": "ab" * 32})
METHODS = (
    ComparedMethod("fbp", "FBP", "baseline", {"kernel": "hann"}),
    ComparedMethod("fbp-blurred", "Blurred FBP", "control", {"sigma_px": 1.25}),
    ComparedMethod("pnp", "PnP-ADMM", "swept", {"beta": 0.3, "denoiser": {"name": "rdn-cbam", "strength": 1.0}}),
)
LESION = Lesion((30.0, 0.0, 0.0), radius=6.0, contrast_hu=-40.0)
NAMES = [method.name for method in METHODS]


def images(seed: int) -> dict[str, Image]:
    """A disc of water in air with an insert, with less and less noise."""
    generator = np.random.default_rng(seed)
    x, y = GRID.x[None, :] - GRID.center[0], GRID.y[:, None] - GRID.center[1]
    truth = np.where(x**2 + y**2 < 100.0**2, 0.0, -1000.0) + np.where((x - 30) ** 2 + y**2 < 25.0**2, 60.0, 0.0)
    spreads = {"fbp": 40.0, "fbp-blurred": 15.0, "pnp": 12.0, "reference": 8.0, "truth": 0.0}
    hu = {name: truth + generator.normal(0.0, spread, truth.shape) for name, spread in spreads.items()}
    return {name: from_hu(torch.from_numpy(values)).float() for name, values in hu.items()}


def make_comparison(folder: Path) -> Comparison:
    """Write the images and `metrics.json`, and return what is in it."""
    cases = tuple(_case(folder, name, seed) for seed, name in enumerate(("chest", "head")))
    comparison = Comparison(
        provenance=PROVENANCE,
        definitions={"glcm": {"hash": "0123456789ab", "levels": 256}, "psnr_window_hu": [-160.0, 240.0]},
        methods=METHODS,
        cases=cases,
        fidelity={case.name: _fidelity(seed) for seed, case in enumerate(cases)},
        texture={case.name: _texture(seed) for seed, case in enumerate(cases)},
        texture_change={
            "40 mA": _texture_group(6, {"fbp-blurred": _changes(0.1, 0.5), "pnp": _changes(0.5, None)}),
            "60 mA": _texture_group(2, {"fbp-blurred": _changes(0.25, None), "pnp": _changes(0.6, None)}),
        },
        histogram={case.name: _histogram(seed) for seed, case in enumerate(cases)},
        curves=tuple(_curve(kind, n) for kind in ("noise-power", "transfer") for n in range(3)),
        tasks=_tasks(),
        least_reductions=tuple(
            LeastReduction(name, "channelised Hotelling", "10 mm, −15 HU", DOSES[name]) for name in DOSES
        ),
        lesions={
            "chest": {name: LesionRecovery(LESION, 1.0 - 0.21 * n, 0.031 * n, 0.42 * n) for n, name in enumerate(NAMES)}
        },
        checks=CHECKS,
    )
    write_comparison(folder, comparison)
    return comparison


CHECKS = (
    Check("residual chi-square", "chest", "pnp", 1.012, 0.9, 1.1, "pass", "The image explains the data."),
    Check("residual chi-square", "head", "pnp", 1.312, 0.9, 1.1, "fail", "The prior has overruled the data."),
    Check("largest score", "chest", "pnp", 3.2, None, 5.0, "pass", "No blob was added."),
    Check("prior-off sweep", None, None, None, None, None, "not judged", "It was not run."),
)

DOSES = {
    "fbp-blurred": DoseShare("FBP hann at 320 mA", Interval(0.97, 0.86, 1.09, 0.06, 0.95)),
    "pnp": DoseShare("FBP hann at 320 mA", Interval(0.64, 0.55, 0.73, 0.05, 0.95)),
}


def _case(folder: Path, name: str, seed: int) -> Case:
    stored = {method: _stored(folder, f"{name}-{method}", image) for method, image in images(seed).items()}
    ramp = torch.linspace(-4.0, 8.0, 64).repeat(64, 1)
    ramp[:4] = 0.0  # outside the body
    verifiable = {"verifiable_hu": _stored(folder, f"{name}-v", torch.where(ramp == 0, 0.0, 30.0 + ramp))}
    maps = {
        "fbp": {"t": _stored(folder, f"{name}-fbp-t", 0.25 * ramp), **verifiable},
        "fbp-blurred": {"t": _stored(folder, f"{name}-blurred-t", 2.0 * ramp), **verifiable},
        "pnp": {
            "t": _stored(folder, f"{name}-t", ramp),
            **verifiable,
            "difference_hu": _stored(folder, f"{name}-d", -1.5 * ramp),
        },
    }
    return Case(
        name=name,
        label=f"{name.title()}, {40 + 20 * seed} mA",
        tube_current_ma=40.0 + 20.0 * seed,
        tube_voltage_kvp=120.0,
        grid=GRID,
        geometry="984 views of 900 bins on an arc",
        details=(Detail(26, 32, 16),),
        images=stored,
        maps=maps if seed == 0 else {},
        seed=seed,
        patches=(Patch(0, 0),),
        texture_spec_hash="0123456789ab",
        disc_mm=8.0,
    )


def _stored(folder: Path, name: str, image: Image) -> StoredImage:
    write_image(folder / f"{name}.h5", image, GRID, provenance=PROVENANCE)
    return StoredImage(f"{name}.h5", image_sha256(*read_image(folder / f"{name}.h5")), seconds=1.25)


def _fidelity(seed: int) -> dict[str, Mapping[str, float | None]]:
    return {
        **{n: {"soft_tissue_rmse_hu": 41.23 / (k + 1) + seed, "psnr_40_400": 23.456 + k} for k, n in enumerate(NAMES)},
        "reference": {"soft_tissue_rmse_hu": 8.01, "psnr_40_400": None},
    }


def _texture(seed: int) -> dict[str, Mapping[str, float | None]]:
    rows = (*NAMES, "reference", "repeat", "truth")
    return {name: {f: 1234.5 / 10 ** (k + seed + n) for k, f in enumerate(FEATURES)} for n, name in enumerate(rows)}


def _histogram(seed: int) -> dict[str, Mapping[str, float | None]]:
    distances = {
        n: {
            "emd": 0.0275 / (k + 1 + seed),
            "emd_hu": 8.25 / (k + 1 + seed),
            "emd_to_truth": 0.0375 / (k + 1),
            "emd_to_truth_hu": 11.25 / (k + 1),
        }
        for k, n in enumerate(NAMES)
    }
    return {
        **distances,
        "reference": {"repeat_scan_floor": 0.0004, "emd_to_truth": 0.0101, "emd_to_truth_hu": 3.03},
        "repeat": {"emd": 0.0004, "emd_hu": 0.12, "emd_to_truth": 0.0102, "emd_to_truth_hu": 3.06},
        "truth": {"emd": 0.0101, "emd_hu": 3.03},
    }


def _texture_group(patients: int, changes: dict[str, tuple[FeatureChange, ...]]) -> TextureGroup:
    if patients < 5:
        changes = {name: tuple(replace(each, interval=None) for each in of) for name, of in changes.items()}
    of_methods = {name: TextureChange(of, "0123456789ab") for name, of in changes.items()}
    return TextureGroup(patients, 7 * patients, of_methods, ("pnp", "fbp-blurred"))


def _changes(factor: float, closeness: float | None) -> tuple[FeatureChange, ...]:
    """Contrast falls by a factor and homogeneity rises by it; 0.1 is beyond the reference."""
    changes = []
    for index, feature in enumerate(FEATURES):
        fbp, reference = (0.1, 0.3) if feature == "homogeneity" else (100.0, 30.0)
        method = 0.1 / factor if feature == "homogeneity" else 100.0 * factor
        percent = 100.0 * (method / fbp - 1.0)
        interval = None if index == 1 else Interval(percent, percent - 4.5, percent + 6.5, 2.0, 0.95)
        other = percent + (20.0 if index == 0 else 1.0)
        known = None if closeness is None else closeness - 0.25 * index
        changes.append(FeatureChange(feature, method, fbp, reference, percent, other, interval, known))
    return tuple(changes)


def _curve(kind, number: int) -> Curve:
    frequency = np.linspace(0.0, 1.0, 21)
    values = np.exp(-((frequency * (1.0 + 0.5 * number)) ** 2)) * (1.0 if kind == "transfer" else 2400.0)
    summary = {"f50_per_mm": 0.5 / (number + 1), "f10_per_mm": None} if kind == "transfer" else {}
    return Curve(kind, NAMES[number], "a disc at 100 mA", tuple(frequency.tolist()), tuple(values.tolist()), summary)


def _found(d: float) -> Detectability:
    return Detectability(Interval(d, 0.8 * d, 1.25 * d, 0.1 * d, 0.95), auc=0.5 + 0.05 * d, pairs=40)


def _tasks() -> tuple[Task, ...]:
    points = {
        name: tuple(DosePoint(current, _found(0.1 * (1 + n / 10) * current**0.5)) for current in (20.0, 80.0, 320.0))
        for n, name in enumerate(NAMES)
    }
    hotelling = [
        Task(name, "channelised Hotelling", lesion, points[name], DOSES.get(name))
        for lesion in ("10 mm, −15 HU", "5 mm, −30 HU")
        for name in NAMES
    ]
    return (*hotelling, *(Task(name, "NPWE", "10 mm, −15 HU", points[name]) for name in NAMES))
