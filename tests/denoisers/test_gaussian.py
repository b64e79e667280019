import pytest
import torch
from scipy.ndimage import gaussian_filter

from pnpct.denoisers import Gaussian


@pytest.mark.parametrize("strength", [0.4, 1.0, 2.3, 9.0])
def test_scipy_agrees_also_where_the_kernel_is_larger_than_the_image(
    strength: float, generator: torch.Generator
) -> None:
    image = torch.randn(2, 12, 19, generator=generator, dtype=torch.float64)
    radius = -(-4 * strength // 1)
    expected = gaussian_filter(image.numpy(), sigma=(0, strength, strength), radius=(0, int(radius), int(radius)))
    torch.testing.assert_close(Gaussian(strength)(image), torch.from_numpy(expected))


def test_the_mean_stays(disk: torch.Tensor) -> None:
    assert Gaussian(3.0)(disk).mean().item() == pytest.approx(disk.mean().item(), rel=1e-6)


def test_white_noise_falls_by_twice_the_width_times_root_pi(generator: torch.Generator) -> None:
    noise = torch.randn(400, 400, generator=generator)
    expected = 1 / (2 * 2.0 * torch.pi**0.5)
    assert Gaussian(2.0)(noise).std().item() == pytest.approx(expected, rel=0.03)


def test_strength_0_changes_nothing(disk: torch.Tensor) -> None:
    assert torch.equal(Gaussian(0.0)(disk), disk)


def test_a_negative_strength_is_refused() -> None:
    with pytest.raises(ValueError, match="standard deviation in pixels"):
        Gaussian(-1.0)
