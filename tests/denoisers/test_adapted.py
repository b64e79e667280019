from pathlib import Path
from types import SimpleNamespace

import pytest
import torch
from torch import Tensor, nn

from pnpct.denoisers import AdaptedNetwork, LearnedDenoiser, estimated_noise
from pnpct.units import to_hu


class Seen(nn.Module):
    """Returns what it is given, and remembers all of it."""

    def forward(self, *given: Tensor) -> Tensor:
        self.given = given
        return given[0]


@pytest.fixture
def images(generator: torch.Generator) -> Tensor:
    return 1 + 0.1 * torch.randn(3, 12, 14, generator=generator)


@pytest.mark.parametrize("range_hu", [(0.0, 1.0), (-1000.0, 0.0), (-1024.0, 3071.0)])
@pytest.mark.parametrize("channel", [True, False])
def test_a_network_is_given_its_own_range_and_shape_and_gives_them_back(range_hu, channel, images):
    seen = Seen()
    given_back = AdaptedNetwork(seen, range_hu=range_hu, channel=channel)(images)
    torch.testing.assert_close(given_back, images, rtol=0, atol=1e-5)
    assert seen.given[0].shape == ((3, 1, 12, 14) if channel else (3, 12, 14))
    low, high = range_hu
    torch.testing.assert_close(
        seen.given[0].reshape(images.shape) * (high - low) + low, to_hu(images), rtol=0, atol=0.1
    )


@pytest.mark.parametrize(("sigma", "shape"), [("image", (3,)), ("pixel", (3, 1, 12, 14))])
def test_the_noise_level_comes_in_the_unit_and_shape_of_the_network(sigma, shape, images):
    seen, levels = Seen(), torch.tensor([0.01, 0.02, 0.03])[:, None, None]
    network = AdaptedNetwork(seen, range_hu=(-1000, 1000), sigma=sigma)
    assert network.noise_input
    network(images, levels.expand(images.shape))
    torch.testing.assert_close(
        seen.given[1],
        (levels / 2).expand(3, 12, 14).mean((1, 2)) if sigma == "image" else (levels / 2).expand(3, 12, 14)[:, None],
    )
    assert seen.given[1].shape == shape


def test_an_adapted_network_is_trained_through(images):
    network = AdaptedNetwork(nn.Conv2d(1, 1, 3, padding=1), range_hu=(-1024, 3071))
    network(images).square().sum().backward()
    assert all(bool(parameter.grad.abs().sum() > 0) for parameter in network.parameters())


def test_a_function_is_adapted_too(images):
    denoise = LearnedDenoiser(AdaptedNetwork(lambda hu: hu - 5, range_hu=(0, 1)))
    torch.testing.assert_close(to_hu(denoise(images)), to_hu(images) - 5, rtol=0, atol=1e-2)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"range_hu": (0.0, 0.0)}, "the first below the second"),
        ({"range_hu": (0.0, float("inf"))}, "the first below the second"),
    ],
)
def test_what_no_network_has_is_refused(options, words):
    with pytest.raises(ValueError, match=words):
        AdaptedNetwork(Seen(), **options)


def test_a_network_that_returns_another_shape_is_refused(images):
    with pytest.raises(ValueError, match=r"\(3, 1, 12, 14\), and this one returned \(3, 1, 10, 12\)"):
        AdaptedNetwork(nn.Conv2d(1, 1, 3))(images)


class LikeDRUNet(nn.Module):
    """Called as deepinv's DRUNet: sigma, for each image, becomes a channel of its own."""

    def __init__(self, in_channels: int, out_channels: int) -> None:
        super().__init__()
        self.layers = nn.Conv2d(in_channels + 1, out_channels, 1, bias=False)
        nn.init.ones_(self.layers.weight)

    def forward(self, x: Tensor, sigma: Tensor) -> Tensor:
        assert x.ndim == 4
        assert sigma.shape == x.shape[:1]
        return self.layers(torch.cat([x, sigma.view(-1, 1, 1, 1).expand(-1, 1, *x.shape[2:])], 1))


def test_the_line_of_the_guide_takes_a_denoiser_of_deepinv(images):
    guide = Path(__file__).parents[2] / "docs/guide-own-denoiser.md"
    (line,) = (row for row in guide.read_text(encoding="utf-8").splitlines() if "deepinv.models.DRUNet(" in row)
    known = {"AdaptedNetwork": AdaptedNetwork, "LearnedDenoiser": LearnedDenoiser}
    exec(line, known | {"deepinv": SimpleNamespace(models=SimpleNamespace(DRUNet=LikeDRUNet))}, found := {})
    torch.testing.assert_close(found["denoise"](images), images + 0.04)


def test_white_noise_is_estimated_and_ramps_and_air_are_not(generator):
    noise = torch.randn(2, 200, 200, generator=generator) * torch.tensor([0.02, 0.1])[:, None, None]
    ramp = torch.linspace(0.9, 1.1, 200)[:, None] + torch.linspace(0, 0.3, 200)
    image = (ramp + noise).where(torch.arange(200) > 120, 0.0)  # more than half is air without noise
    found = estimated_noise(image)
    assert found.shape == (2, 1, 1)
    torch.testing.assert_close(found.flatten(), torch.tensor([0.02, 0.1]), rtol=0.03, atol=0)
    torch.testing.assert_close(found[1], estimated_noise(image[1]), rtol=0, atol=0)


def test_a_noise_level_may_be_asked_of_each_image(images):
    class Less(nn.Module):
        noise_input = True

        def forward(self, image: Tensor, level: Tensor) -> Tensor:
            return image - level

    denoise = LearnedDenoiser(Less(), noise_level=estimated_noise)
    torch.testing.assert_close(denoise(images), images - estimated_noise(images))
    assert denoise.settings["noise_level_hu"] == "estimated_noise"
    levels = iter([0.05, 0.01])
    falling = LearnedDenoiser(Less(), noise_level=lambda image: next(levels))
    torch.testing.assert_close(falling(falling(images)), images - 0.06)
    with pytest.raises(ValueError, match="a standard deviation from 0 up, got -1 to -1"):
        LearnedDenoiser(Less(), noise_level=lambda image: -1.0)(images)
