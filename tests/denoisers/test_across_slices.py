"""A denoiser that looks at neighbouring slices averages what they agree about, and nothing else."""

import pytest
import torch

from pnpct.denoisers import AcrossSlices, Gaussian, TotalVariation, denoiser_settings


def unchanged(image: torch.Tensor) -> torch.Tensor:
    return image


def test_slices_that_are_equal_stay_as_they_are(disk: torch.Tensor) -> None:
    volume = disk.expand(4, *disk.shape)
    torch.testing.assert_close(AcrossSlices(Gaussian(1.0))(volume), Gaussian(1.0)(volume))


@pytest.mark.parametrize(("reach", "slices"), [(1, [2, 3, 3, 3, 2]), (2, [3, 4, 5, 4, 3]), (9, [5, 5, 5, 5, 5])])
def test_noise_falls_as_that_of_a_mean(reach: int, slices: list[int], generator: torch.Generator) -> None:
    noise = 0.001 * torch.randn(5, 100, 100, generator=generator)
    left = AcrossSlices(unchanged, reach=reach)(1 + noise).sub(1).div(0.001).std(dim=(-2, -1))
    expected = torch.tensor(slices).rsqrt()
    torch.testing.assert_close(left, expected, rtol=0.03, atol=0)


def test_what_has_moved_stays_where_each_slice_has_it() -> None:
    volume = torch.ones(3, 40, 40)
    for number, slice_ in enumerate(volume):
        slice_[:, 10 + 8 * number :] = 0.2  # the border of a lung
    torch.testing.assert_close(AcrossSlices(unchanged)(volume), volume, rtol=0, atol=1e-6)


def test_contrast_of_one_slice_stays_if_it_exceeds_the_agreement() -> None:
    volume = torch.ones(3, 40, 40)
    volume[1] += 0.030
    kept = AcrossSlices(unchanged, agreement_hu=30.0)(volume)[1].mean().item() - 1
    assert 0.5 * 0.030 > kept > 0.4 * 0.030  # 1 / (1 + 2 exp(-1/2)) = 0.45
    assert AcrossSlices(unchanged, agreement_hu=10.0)(volume)[1].mean().item() - 1 > 0.95 * 0.030


@pytest.mark.parametrize("denoise", [AcrossSlices(Gaussian(1.0), agreement_hu=0.0), AcrossSlices(Gaussian(1.0))])
def test_one_slice_is_denoised_on_its_own(denoise: AcrossSlices, disk: torch.Tensor) -> None:
    for image in (disk, disk[None], disk[None, None]):
        torch.testing.assert_close(denoise(image), Gaussian(1.0)(image))


def test_without_agreement_each_slice_is_on_its_own(generator: torch.Generator) -> None:
    volume = torch.randn(3, 12, 16, generator=generator)
    torch.testing.assert_close(AcrossSlices(Gaussian(1.0), 0.0)(volume), Gaussian(1.0)(volume))


def test_volumes_of_a_batch_do_not_see_one_another(generator: torch.Generator) -> None:
    volumes = 1 + 0.01 * torch.randn(2, 3, 12, 16, generator=generator)
    denoise = AcrossSlices(Gaussian(1.0))
    torch.testing.assert_close(denoise(volumes), torch.stack([denoise(volume) for volume in volumes]))


def test_it_says_what_it_depends_on() -> None:
    of_slices = denoiser_settings(TotalVariation(0.03))
    assert denoiser_settings(AcrossSlices(TotalVariation(0.03), 20.0)) == {
        **of_slices,
        "slice_agreement_hu": 20.0,
        "slice_reach": 1,
    }


def test_a_negative_agreement_is_refused() -> None:
    with pytest.raises(ValueError, match="a difference in HU from 0 up, got -1"):
        AcrossSlices(unchanged, -1.0)
    with pytest.raises(ValueError, match="at least one neighbour"):
        AcrossSlices(unchanged, reach=0)
