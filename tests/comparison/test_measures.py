import numpy as np
import pytest
import torch

from pnpct.comparison import fidelity_values, histogram_values, texture_values
from pnpct.comparison.measures import PUBLISHED, score_definitions
from pnpct.evaluation import FEATURES, METRICS, WINDOWS, body_mask, psnr, ssim, texture_features, texture_patches

GENERATOR = np.random.default_rng(1)


def body(size: int = 64) -> torch.Tensor:
    """A disc of water in air."""
    y, x = np.mgrid[:size, :size] - (size - 1) / 2
    return torch.from_numpy(np.where(np.hypot(x, y) < 0.45 * size, 1.0, 0.0))


def noisy(image: torch.Tensor) -> torch.Tensor:
    return image + 0.03 * torch.from_numpy(GENERATOR.normal(size=image.shape))


def test_scores_count_in_the_body_and_in_the_window_of_their_name() -> None:
    truth, image = body(), noisy(body())
    values = fidelity_values(image, truth)
    for words, window in (("40_400", (-160.0, 240.0)), ("30_300", (-120.0, 180.0))):
        assert window in WINDOWS.values()
        assert values[f"psnr_{words}"] == psnr(image, truth, window=window, mask=body_mask(truth))
        assert values[f"ssim_{words}"] == ssim(image, truth, window=window, mask=body_mask(truth))
        assert values[f"psnr_{words}"] < psnr(image, truth, window=window), "air would raise it"


def test_every_ratio_and_similarity_says_what_it_is() -> None:
    scores = {name for name in (*METRICS, *PUBLISHED) if name.startswith(("psnr", "ssim"))}
    assert set(score_definitions()) == scores
    assert {"psnr", "ssim"}.isdisjoint(fidelity_values(body(), body()))
    for name, about in score_definitions().items():
        assert about["mask"] == ("body" if name in METRICS else "whole slice")
        assert ("surroundings" in about) == name.startswith("ssim")


@pytest.mark.parametrize("name", ["psnr_ldctbench_chest", "psnr_ldctbench_abdomen", "psnr_ldctbench_head"])
def test_the_window_that_is_said_is_the_one_that_is_taken(name: str) -> None:
    low, high = score_definitions()[name]["window_hu"]
    below, inside, above = (
        1 + torch.full((8, 8), hu, dtype=torch.float64) / 1000 for hu in (low - 1, low + 1, high + 1)
    )
    assert PUBLISHED[name](below - 1, below) == float("inf")
    assert PUBLISHED[name](above + 1, above) == float("inf")
    assert PUBLISHED[name](inside, below) == pytest.approx(20 * np.log10(score_definitions()[name]["data_range_hu"]))


def test_what_the_truth_has_no_tissue_for_has_no_number() -> None:
    air = torch.zeros(64, 64, dtype=torch.float64)
    air[0, 0] = 0.1  # the scores of LoDoPaB need a range
    values = fidelity_values(noisy(air), air)
    absent = {name for name, value in values.items() if value is None and name not in PUBLISHED}
    assert absent == {name for name in METRICS if name.startswith(("body_", "soft_tissue_", "psnr", "ssim"))}
    assert histogram_values(air, air) == {"emd": None, "emd_hu": None}
    assert fidelity_values(body(), body())["psnr_40_400"] is None  # infinite


def test_texture_of_a_volume_is_the_mean_over_the_slices_that_have_any() -> None:
    truth = torch.stack([torch.ones(70, 70, dtype=torch.float64)] * 2 + [torch.zeros(70, 70, dtype=torch.float64)])
    image = noisy(truth)
    patches = texture_patches(truth[0])
    alone = [texture_features(one, patches) for one in image[:2]]
    found = texture_values(image, truth)
    assert found == {f"glcm_{name}": np.mean([getattr(each, name) for each in alone]) for name in FEATURES}
    assert texture_values(image[0], truth[0])["glcm_contrast"] == alone[0].contrast


def test_texture_without_a_patch_is_said_not_to_exist() -> None:
    for truth in (torch.zeros(70, 70), torch.ones(30, 30)):
        assert texture_values(truth, truth) == {f"glcm_{name}": None for name in FEATURES}
