"""A network sees images mirrored in turn, with a little total variation behind it; other denoisers are left alone."""

import itertools

import pytest
import torch
from torch import nn

from pnpct.denoisers import AcrossSlices, Denoise, Gaussian, LearnedDenoiser, TotalVariation
from pnpct.reconstruction.around_network import MIRRORS, around_network
from pnpct.reconstruction.starting import proximal_total_variation

NOISE = torch.tensor([[100.0]])
HARDLY_ANY = torch.tensor([[1e9]])


class AddRamps(nn.Module):
    """Adds what rises from the first row to the last, and half as much from the first column: no mirror keeps it."""

    def forward(self, images: torch.Tensor) -> torch.Tensor:
        rows, cols = (torch.linspace(0, 1, count) for count in images.shape[-2:])
        return images + rows[:, None] + cols / 2


class Unchanged(nn.Module):
    def forward(self, images: torch.Tensor) -> torch.Tensor:
        return images


def looped(denoise: Denoise, noise: torch.Tensor = HARDLY_ANY) -> Denoise:
    return around_network(denoise, sigma_v=60.0, noise=noise)


@pytest.mark.parametrize("denoise", [Gaussian(1.0), TotalVariation(0.03), AcrossSlices(Gaussian(1.0)), torch.clone])
def test_other_denoisers_stay_as_they_are(denoise: Denoise) -> None:
    assert looped(denoise) is denoise


@pytest.mark.parametrize("across", [False, True])
def test_what_mirrors_do_not_share_averages_out(across: bool, generator: torch.Generator) -> None:
    network = LearnedDenoiser(AddRamps())
    denoise = looped(AcrossSlices(network, agreement_hu=0.0) if across else network)
    image = torch.randn(2, 9, 8, generator=generator)
    added = [denoise(image) - image for _ in range(2 * len(MIRRORS))]
    torch.testing.assert_close(added[0], network(image) - image, rtol=0, atol=1e-5)
    assert all((one - other).abs().max() > 0.3 for one, other in itertools.pairwise(added))
    mean = torch.stack(added[: len(MIRRORS)]).mean(0)
    torch.testing.assert_close(mean, torch.full_like(mean, 0.75), rtol=0, atol=1e-5)
    torch.testing.assert_close(torch.stack(added[len(MIRRORS) :]), torch.stack(added[: len(MIRRORS)]))


def test_a_map_of_noise_levels_keeps_its_place() -> None:
    class AddLevel(nn.Module):
        noise_input = True

        def forward(self, images: torch.Tensor, levels: torch.Tensor) -> torch.Tensor:
            return images + levels

    levels = torch.arange(12.0).reshape(3, 4)
    denoise = looped(LearnedDenoiser(AddLevel(), noise_level=levels))
    for _ in MIRRORS:
        torch.testing.assert_close(denoise(torch.ones(3, 4)), 1 + levels, rtol=0, atol=1e-4)


def test_a_little_total_variation_is_behind_it(disk: torch.Tensor, generator: torch.Generator) -> None:
    image = disk + 0.03 * torch.randn(disk.shape, generator=generator)
    flat = proximal_total_variation(0.1, torch.tensor(60.0), NOISE)
    torch.testing.assert_close(looped(LearnedDenoiser(Unchanged()), NOISE)(image), flat(image))
    assert not torch.equal(flat(image), image)
