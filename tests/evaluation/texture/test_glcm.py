import json
import math
from dataclasses import asdict, replace

import numpy as np
import pytest
import torch
from scipy.ndimage import gaussian_filter
from skimage.feature import graycomatrix, graycoprops

from pnpct.evaluation import FEATURES, GLCMSpec, Patch, texture_features, texture_patches
from pnpct.units import from_hu

CORNER = (Patch(0, 0),)


def noisy(spread_hu: float, *, size: int = 64, seed: int = 1) -> torch.Tensor:
    return from_hu(30 + spread_hu * torch.from_numpy(np.random.default_rng(seed).normal(size=(size, size))))


def by_hand(levels: np.ndarray, spec: GLCMSpec) -> dict[str, float]:
    """All features from their sums, with matrices counted pair by pair."""
    features: dict[str, list[float]] = {name: [] for name in FEATURES}
    i, j = np.indices((256, 256))
    for down, right in ((0, 1), (1, 1), (1, 0), (1, -1)):
        p = np.zeros((256, 256))
        a = levels[: len(levels) - down, max(0, -right) : len(levels) - max(0, right)]
        b = levels[down:, max(0, right) : len(levels) + min(0, right)]
        np.add.at(p, (a.ravel(), b.ravel()), 1)
        p = (p + p.T) / (2 * a.size)
        mean, variance = (p * i).sum(), (p * (i - (p * i).sum()) ** 2).sum()
        features["contrast"].append((p * (i - j) ** 2).sum())
        features["dissimilarity"].append((p * abs(i - j)).sum())
        features["homogeneity"].append((p / (1 + (i - j) ** 2)).sum())
        features["asm"].append((p**2).sum())
        features["energy"].append(math.sqrt((p**2).sum()))
        features["correlation"].append((p * (i - mean) * (j - mean)).sum() / variance)
        features["entropy"].append(-(p[p > 0] * np.log2(p[p > 0])).sum())
    return {name: float(np.mean(values)) for name, values in features.items()}


@pytest.mark.parametrize(
    ("distance", "angle", "contrast"),
    [(1, 0.0, 7 / 12), (1, math.pi / 2, 1.0), (2, 0.0, 1.25), (2, math.pi / 2, 2.75)],
)
def test_haralicks_toy_has_its_printed_contrast(distance: int, angle: float, contrast: float) -> None:
    """The toy image of 4 × 4 pixels with which Haralick explains the matrix."""
    toy = torch.tensor([[0, 0, 1, 1], [0, 0, 1, 1], [0, 2, 2, 2], [2, 2, 3, 3]], dtype=torch.float64)
    spec = GLCMSpec(window=(0.0, 4.0), levels=4, distances=(distance,), angles=(angle,), patch=4)
    assert texture_features(from_hu(toy + 0.5), CORNER, spec=spec).contrast == pytest.approx(contrast, abs=1e-12)


def test_the_features_are_their_sums_by_hand() -> None:
    hu = 1000 * (noisy(35.0) - 1).numpy()
    levels = np.minimum(np.floor(np.clip((hu + 120) / 300, 0, 1) * 256), 255).astype(int)
    measured = texture_features(noisy(35.0), CORNER)
    for name, value in by_hand(levels, GLCMSpec()).items():
        assert getattr(measured, name) == pytest.approx(value, rel=1e-6), name


def test_scikit_image_agrees_patch_by_patch() -> None:
    image, patches = noisy(25.0, size=128), (Patch(0, 0), Patch(10, 60))
    measured = texture_features(image, patches)
    values: dict[str, list[float]] = {name: [] for name in FEATURES[:-1]}
    for patch in patches:
        hu = 1000 * (image.numpy()[patch.row : patch.row + 64, patch.col : patch.col + 64] - 1)
        levels = np.clip(np.floor((hu + 120) / 300 * 256), 0, 255).astype(np.uint8)
        pairs = graycomatrix(levels, [1], list(GLCMSpec().angles), levels=256, symmetric=True, normed=True)
        for name in values:
            values[name].append(graycoprops(pairs, "ASM" if name == "asm" else name).mean())
    for name, of_patches in values.items():
        assert getattr(measured, name) == pytest.approx(np.mean(of_patches), abs=1e-6), name


def test_half_the_noise_has_a_quarter_of_the_contrast_unless_each_patch_is_stretched() -> None:
    """Within 5 %, and the trap of stretching each patch to its own range."""
    loud, quiet = noisy(20.0), noisy(10.0)
    ratio = texture_features(quiet, CORNER).contrast / texture_features(loud, CORNER).contrast
    assert ratio == pytest.approx(0.25, rel=0.05)
    stretched = GLCMSpec(quantisation="roi_minmax")
    assert texture_features(quiet, CORNER, spec=stretched).contrast == pytest.approx(
        texture_features(loud, CORNER, spec=stretched).contrast, rel=0.01
    )


@pytest.mark.parametrize("quantisation", ["fixed", "roi_minmax"])
def test_a_constant_image_has_no_texture(quantisation: str) -> None:
    texture = texture_features(torch.full((64, 64), 1.04), CORNER, spec=GLCMSpec(quantisation=quantisation))
    assert [getattr(texture, name) for name in FEATURES] == [0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 0.0]


def test_the_hash_stands_for_every_part_of_the_definition() -> None:
    changes = {
        "window": (-160.0, 240.0),
        "levels": 128,
        "distances": (2,),
        "angles": (0.0,),
        "symmetric": False,
        "quantisation": "roi_minmax",
        "patch": 32,
        "stride": 32,
        "margin": 4,
        "tissue": (-200.0, 300.0),
        "spread": 50.0,
        "smoothing": 4.0,
    }
    assert changes.keys() == asdict(GLCMSpec()).keys()
    hashes = {GLCMSpec().hash, *(replace(GLCMSpec(), **{name: value}).hash for name, value in changes.items())}
    assert len(hashes) == 1 + len(changes)
    assert json.loads(GLCMSpec().canonical_json)["entropy_base"] == 2


def test_the_hash_of_the_default_definition_stays() -> None:
    assert GLCMSpec().hash == "99bf53f16b45"


def test_results_written_as_json_have_the_hash() -> None:
    texture = texture_features(noisy(20.0), CORNER)
    assert json.loads(json.dumps(asdict(texture)))["spec_hash"] == GLCMSpec().hash


@pytest.fixture(scope="module")
def patient() -> torch.Tensor:
    """A disc of tissue in air, one half of it bone."""
    y, x = np.mgrid[:384, :384] - 191.5
    body = np.hypot(x, y) < 180
    return torch.from_numpy(np.where(body, np.where(x > 64, 1.7, 1.04), 0.0))


def test_patches_are_of_soft_tissue_deep_in_the_body(patient: torch.Tensor) -> None:
    patches = texture_patches(patient)
    assert patches
    for patch in patches:
        assert patch.col + 64 <= 256
        corners = np.array([[patch.row, patch.row + 63], [patch.col, patch.col + 63]]) - 191.5
        assert np.hypot(*np.abs(corners).max(axis=1)) < 175
    assert texture_patches(torch.zeros(128, 128)) == ()


def test_smoothing_lets_a_noisy_reference_choose_the_patches(patient: torch.Tensor) -> None:
    noise = torch.from_numpy(np.random.default_rng(2).normal(scale=0.1, size=(384, 384)))
    assert texture_patches(patient + noise) == ()
    chosen = texture_patches(patient + noise, spec=GLCMSpec(smoothing=4.0))
    assert set(chosen) <= set(texture_patches(patient))
    assert chosen


def test_what_varies_too_much_is_no_patch() -> None:
    waves = from_hu(torch.from_numpy(100 * np.sign(gaussian_filter(np.random.default_rng(3).normal(size=(64, 64)), 3))))
    assert texture_patches(waves) == ()
    assert texture_patches(waves, spec=GLCMSpec(spread=150.0)) == CORNER


@pytest.mark.parametrize(
    "wrong",
    [
        {"levels": 1},
        {"levels": 512},
        {"distances": (0,)},
        {"distances": (64,)},
        {"angles": ()},
        {"stride": 0},
        {"margin": -1},
        {"spread": 0.0},
        {"smoothing": math.inf},
        {"window": (5.0, 5.0)},
    ],
)
def test_impossible_definitions_are_refused(wrong: dict) -> None:
    with pytest.raises(ValueError, match="got"):
        GLCMSpec(**wrong)
