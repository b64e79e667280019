from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.ndimage import gaussian_filter

from pnpct.evaluation import (
    FEATURES,
    GLCMSpec,
    Patch,
    TextureChange,
    oversmoothing_warnings,
    rank_by_closeness,
    texture_change,
    texture_features,
)
from pnpct.evaluation.texture.oversmoothing import GROWS_WITH_SMOOTHING, overshoots

SPEC = GLCMSpec(patch=32, levels=64)
BLURS = (0.7, 0.8, 1.0, 1.5, 2.0, 4.0)


def scans(spread: float, *, seed: int) -> list[np.ndarray]:
    """The same five patients each time, with noise of their own."""
    anatomy, noise = np.random.default_rng(1), np.random.default_rng(seed)
    tissue = [100 * gaussian_filter(anatomy.normal(size=(32, 32)), 4) for _ in range(5)]
    return [1.03 + (each + spread * noise.normal(size=(32, 32))) / 1000 for each in tissue]


def compare(method: list[np.ndarray]) -> TextureChange:
    of_method, of_fbp, of_reference = (
        [texture_features(torch.from_numpy(image), [Patch(0, 0)], spec=SPEC) for image in images]
        for images in (method, scans(45.0, seed=2), scans(14.0, seed=3))
    )
    return texture_change(of_method, of_fbp, of_reference, generator=np.random.default_rng(4), resamples=100)


@pytest.fixture(scope="module")
def changes() -> dict[str, TextureChange]:
    fbp = scans(45.0, seed=2)
    blurred = {f"blur {blur}": compare([gaussian_filter(image, blur) for image in fbp]) for blur in BLURS}
    return {"constant": compare([np.full((32, 32), 1.04)] * 5), **blurred, "fbp": compare(fbp)}


def test_a_constant_and_a_blurred_fbp_are_never_first(changes: dict[str, TextureChange]) -> None:
    assert rank_by_closeness(changes)[0] == "fbp"
    better = {**changes, "good": compare(scans(18.0, seed=5))}
    assert rank_by_closeness(better)[:2] == ("good", "fbp")
    # Closeness alone would not do: a blur that is matched in noise comes nearer than FBP.
    assert max(changes, key=lambda name: changes[name].closeness) == "blur 0.7"


def test_a_constant_and_a_blurred_fbp_are_warned_of_and_nothing_else_is(changes: dict[str, TextureChange]) -> None:
    for name, change in changes.items():
        assert bool(oversmoothing_warnings(change)) == (name != "fbp"), name
    assert oversmoothing_warnings(compare(scans(18.0, seed=5))) == ()
    assert oversmoothing_warnings(compare(scans(70.0, seed=6))) == (), "noisier than FBP is not over-smoothed"
    assert any("homogeneity is 1, beyond" in warning for warning in oversmoothing_warnings(changes["constant"]))


def test_a_blur_moves_every_feature_to_its_smooth_side(changes: dict[str, TextureChange]) -> None:
    assert tuple(GROWS_WITH_SMOOTHING) == FEATURES
    for feature, grows in GROWS_WITH_SMOOTHING.items():
        weak, strong = (changes[name][feature].method for name in ("fbp", "blur 2.0"))
        assert (strong > weak) == grows


def test_only_beyond_the_reference_on_the_smooth_side_is_overshoot(changes: dict[str, TextureChange]) -> None:
    homogeneity = changes["blur 2.0"]["homogeneity"]
    assert overshoots(homogeneity)
    assert not overshoots(replace(homogeneity, closeness=0.1))
    assert not overshoots(replace(homogeneity, closeness=None))
    assert not overshoots(replace(homogeneity, method=0.0))
    assert not overshoots(replace(homogeneity, reference=None))


def test_one_case_has_no_closeness_and_is_still_warned_of() -> None:
    fbp, reference = (
        [texture_features(torch.from_numpy(scans(spread, seed=2)[0]), [Patch(0, 0)], spec=SPEC)]
        for spread in (45.0, 14.0)
    )
    flat = [texture_features(torch.ones(32, 32), [Patch(0, 0)], spec=SPEC)]
    constant, itself = (
        texture_change(method, fbp, reference, generator=np.random.default_rng(1)) for method in (flat, fbp)
    )
    assert "contrast is below" in oversmoothing_warnings(constant)[0]
    assert rank_by_closeness({"constant": constant, "fbp": itself})[0] == "fbp"
