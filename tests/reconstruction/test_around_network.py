"""A network sees images mirrored in turn, with a little total variation behind it; other denoisers are left alone."""

import itertools

import pytest
import torch
from torch import nn

from pnpct.denoisers import AcrossSlices, Denoise, Gaussian, LearnedDenoiser, TotalVariation
from pnpct.reconstruction import around_network as module
from pnpct.reconstruction.around_network import COARSE_MM, LITTLE, MIRRORS, MOST, around_network


class AddRamps(nn.Module):
    """Adds what rises from the first row to the last, and half as much from the first column: no mirror keeps it."""

    def forward(self, images: torch.Tensor) -> torch.Tensor:
        rows, cols = (torch.linspace(0, 1, count) for count in images.shape[-2:])
        return images + rows[:, None] + cols / 2


class Unchanged(nn.Module):
    def forward(self, images: torch.Tensor) -> torch.Tensor:
        return images


@pytest.fixture
def mirrors_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "LITTLE", 0.0)


@pytest.mark.parametrize("denoise", [Gaussian(1.0), TotalVariation(0.03), AcrossSlices(Gaussian(1.0)), torch.clone])
def test_other_denoisers_stay_as_they_are(denoise: Denoise) -> None:
    assert around_network(denoise, COARSE_MM) is denoise


@pytest.mark.parametrize("across", [False, True])
@pytest.mark.usefixtures("mirrors_alone")
def test_what_mirrors_do_not_share_averages_out(across: bool, generator: torch.Generator) -> None:
    network = LearnedDenoiser(AddRamps())
    denoise = around_network(AcrossSlices(network, agreement_hu=0.0) if across else network, COARSE_MM)
    image = torch.randn(2, 9, 8, generator=generator)
    added = [denoise(image) - image for _ in range(2 * len(MIRRORS))]
    torch.testing.assert_close(added[0], network(image) - image, rtol=0, atol=1e-5)
    assert all((one - other).abs().max() > 0.3 for one, other in itertools.pairwise(added))
    mean = torch.stack(added[: len(MIRRORS)]).mean(0)
    torch.testing.assert_close(mean, torch.full_like(mean, 0.75), rtol=0, atol=1e-5)
    torch.testing.assert_close(torch.stack(added[len(MIRRORS) :]), torch.stack(added[: len(MIRRORS)]))


@pytest.mark.usefixtures("mirrors_alone")
def test_a_map_of_noise_levels_keeps_its_place() -> None:
    class AddLevel(nn.Module):
        noise_input = True

        def forward(self, images: torch.Tensor, levels: torch.Tensor) -> torch.Tensor:
            return images + levels

    levels = torch.arange(12.0).reshape(3, 4)
    denoise = around_network(LearnedDenoiser(AddLevel(), noise_level=levels), COARSE_MM)
    for _ in MIRRORS:
        torch.testing.assert_close(denoise(torch.ones(3, 4)), 1 + levels, rtol=0, atol=1e-4)


@pytest.mark.parametrize(("spacing", "times"), [(1.8, 1.0), (COARSE_MM, 1.0), (COARSE_MM / 2, 4.0), (0.2, MOST)])
def test_a_little_total_variation_is_behind_it_and_more_of_it_in_small_pixels(
    spacing: float, times: float, disk: torch.Tensor, generator: torch.Generator
) -> None:
    image = disk + 0.03 * torch.randn(disk.shape, generator=generator)
    flat = TotalVariation(times * LITTLE, tolerance=1e-5)(image)
    behind = around_network(LearnedDenoiser(Unchanged()), spacing)(image)
    torch.testing.assert_close(behind, flat, rtol=0, atol=5e-4)
    assert 5e-4 < float((flat - image).abs().max()) < 0.01 * times
