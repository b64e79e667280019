import json
from collections.abc import Callable
from dataclasses import asdict, replace

import numpy as np
import pytest
import torch
from scipy.ndimage import gaussian_filter

from pnpct.evaluation import FEATURES, GLCMSpec, Patch, Texture, TextureChange, texture_change, texture_features

SPEC = GLCMSpec(patch=32, levels=64)


def scans(spread: float, *, seed: int, blur: float = 0.0) -> list[np.ndarray]:
    """The same five patients each time, with noise of their own."""
    anatomy, noise = np.random.default_rng(1), np.random.default_rng(seed)
    images = []
    for _ in range(5):
        tissue = gaussian_filter(anatomy.normal(size=(32, 32)), 4) * 100
        images.append(1.03 + (tissue + gaussian_filter(spread * noise.normal(size=(32, 32)), blur)) / 1000)
    return images


def measured(images: list[np.ndarray]) -> list[Texture]:
    return [texture_features(torch.from_numpy(image), [Patch(0, 0)], spec=SPEC) for image in images]


def compare(method: list[np.ndarray], reference: list[np.ndarray] | None = None) -> TextureChange:
    fbp = measured(scans(45.0, seed=2))
    references = measured(scans(14.0, seed=3) if reference is None else reference)
    return texture_change(measured(method), fbp, references, generator=np.random.default_rng(4), resamples=100)


@pytest.fixture(scope="module")
def changes() -> dict[str, TextureChange]:
    fbp = scans(45.0, seed=2)
    return {
        "near the reference": compare(scans(15.0, seed=5)),
        "constant": compare([np.full((32, 32), 1.04)] * 5),
        "blurred": compare([gaussian_filter(image, 2.0) for image in fbp]),
        "very blurred": compare([gaussian_filter(image, 4.0) for image in fbp]),
        "fbp": compare(fbp),
    }


def test_percentages_follow_from_the_printed_means(changes: dict[str, TextureChange]) -> None:
    """To 1e-9, from textures written as JSON with its hash."""
    for change in changes.values():
        printed = json.loads(json.dumps(asdict(change)))
        assert printed["spec_hash"] == SPEC.hash
        assert [feature["feature"] for feature in printed["features"]] == list(FEATURES)
        for feature in printed["features"]:
            again = 100 * (feature["method"] / feature["fbp"] - 1)
            assert feature["ratio_of_means"] == pytest.approx(again, rel=1e-9, abs=1e-9)
            assert feature["interval"]["estimate"] == feature["ratio_of_means"]


def test_neither_a_constant_nor_a_blur_is_ranked_first(changes: dict[str, TextureChange]) -> None:
    best = max(changes, key=lambda name: changes[name].closeness)
    assert best == "near the reference"
    assert changes[best].closeness > 0.8


def test_percentages_would_have_ranked_the_constant_first(changes: dict[str, TextureChange]) -> None:
    assert min(changes, key=lambda name: changes[name]["contrast"].ratio_of_means) == "constant"
    assert max(changes, key=lambda name: changes[name]["energy"].ratio_of_means) == "constant"


def test_only_what_overshoots_the_reference_is_called_oversmoothed(changes: dict[str, TextureChange]) -> None:
    assert {name for name, change in changes.items() if change.oversmoothed} == {"constant", "blurred", "very blurred"}


def test_fbp_has_no_change_and_the_reference_is_closest_to_itself(changes: dict[str, TextureChange]) -> None:
    for feature in FEATURES:
        assert changes["fbp"][feature].ratio_of_means == 0.0
        assert changes["fbp"][feature].closeness in (None, 0.0)
    itself = compare(scans(14.0, seed=3))
    assert itself.closeness == 1.0


def test_an_fbp_that_is_the_reference_leaves_closeness_undefined() -> None:
    change = compare(scans(10.0, seed=6), reference=scans(45.0, seed=7))
    assert change["contrast"].closeness is None
    assert change.oversmoothed


def test_without_references_or_with_one_case_there_is_no_closeness() -> None:
    method, fbp = measured(scans(15.0, seed=5)), measured(scans(45.0, seed=2))
    generator = np.random.default_rng(4)
    alone = texture_change(method, fbp, None, generator=generator, resamples=50)
    assert alone.closeness is None
    assert alone["contrast"].reference is None
    assert alone["contrast"].interval is not None
    one = texture_change(method, fbp, measured(scans(14.0, seed=3)), generator=generator, cases=["a"] * 5)
    assert one.closeness is None
    assert one["contrast"].interval is None


def test_fewer_than_five_patients_have_a_change_but_no_interval() -> None:
    method, fbp = measured(scans(15.0, seed=5)), measured(scans(45.0, seed=2))
    for patients, known in ((["a", "b", "c", "d", "d"], False), (["a", "b", "c", "d", "e"], True)):
        change = texture_change(
            method, fbp, measured(scans(14.0, seed=3)), generator=np.random.default_rng(4), cases=patients, resamples=50
        )
        assert (change["contrast"].interval is not None) == known
        assert change.closeness > 0.5


def test_means_of_ratios_that_one_image_decides_are_flagged() -> None:
    method, fbp = measured(scans(15.0, seed=5)), measured(scans(45.0, seed=2))
    even = texture_change(method, fbp, None, generator=np.random.default_rng(4), resamples=50)
    assert not even["contrast"].images_disagree
    odd = [replace(fbp[0], contrast=1.0), *fbp[1:]]
    uneven = texture_change(method, odd, None, generator=np.random.default_rng(4), resamples=50)
    assert uneven["contrast"].images_disagree


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda fbp: fbp[:2], "same images"),
        (lambda fbp: [replace(one, spec_hash="other") for one in fbp], "different definitions"),
        (lambda fbp: [replace(one, patches=(Patch(1, 0),)) for one in fbp], "different patches"),
        (lambda fbp: [replace(one, contrast=0.0) for one in fbp], "other than 0"),
    ],
)
def test_textures_that_do_not_belong_together_are_refused(
    change: Callable[[list[Texture]], list[Texture]], message: str
) -> None:
    fbp = measured(scans(45.0, seed=2))
    with pytest.raises(ValueError, match=message):
        texture_change(fbp, change(fbp), None, generator=np.random.default_rng(4))
