import pytest
import torch

from pnpct.denoisers import NonlocalMeans


def test_noise_falls_and_the_edge_stays(disk: torch.Tensor, generator: torch.Generator) -> None:
    noise = 0.05 * torch.randn(disk.shape, generator=generator)
    left = NonlocalMeans(0.05)(disk + noise) - disk
    assert left.std() < 0.5 * noise.std()


def test_scarcely_any_noise_means_scarcely_any_change(disk: torch.Tensor, generator: torch.Generator) -> None:
    image = disk + 0.2 * torch.randn(disk.shape, generator=generator)
    torch.testing.assert_close(NonlocalMeans(1e-3)(image), image, rtol=0, atol=1e-4)


def test_a_batch_is_its_slices_in_the_type_of_the_input(disk: torch.Tensor, generator: torch.Generator) -> None:
    denoise = NonlocalMeans(0.05)
    batch = disk + 0.05 * torch.randn(2, *disk.shape, generator=generator)
    result = denoise(batch)
    assert result.dtype == torch.float32
    assert torch.equal(result, torch.stack([denoise(batch[0]), denoise(batch[1])]))


def test_strength_0_changes_nothing(disk: torch.Tensor) -> None:
    assert torch.equal(NonlocalMeans(0.0)(disk), disk)


def test_numbers_outside_their_range_are_refused() -> None:
    with pytest.raises(ValueError, match=r"noise s\.d\."):
        NonlocalMeans(-0.1)
    with pytest.raises(ValueError, match="at least one pixel"):
        NonlocalMeans(0.1, patch=0)
    with pytest.raises(ValueError, match="cutoff"):
        NonlocalMeans(0.1, cutoff=0.0)
