import pytest
import torch

from pnpct.denoisers import DENOISERS, Gaussian, NonlocalMeans, TotalVariation, make_denoiser


@pytest.mark.parametrize("name", DENOISERS)
def test_every_denoiser_in_the_table_smooths_and_keeps_the_shape(
    name: str, disk: torch.Tensor, generator: torch.Generator
) -> None:
    noise = 0.02 * torch.randn(3, *disk.shape, generator=generator)
    denoise = make_denoiser(name)
    result = denoise(1 + noise)
    assert result.shape == noise.shape
    assert result.std() < 0.6 * noise.std()


def test_strengths_come_in_hu_and_reach_the_denoiser_in_units_of_the_image() -> None:
    assert make_denoiser("tv", 30.0) == TotalVariation(0.03)
    assert make_denoiser("nonlocal-means", 30.0) == NonlocalMeans(0.03)
    assert make_denoiser("gaussian", 1.5) == Gaussian(1.5)


def test_an_unknown_name_is_refused_with_the_known_ones() -> None:
    with pytest.raises(ValueError, match=f'no denoiser "bm3d"; there are {", ".join(DENOISERS)}'):
        make_denoiser("bm3d", 1.0)
