"""The images that networks learn from: of FBP, of parts of the views, and of the loop of ADMM."""

import json
from dataclasses import replace
from itertools import islice

import pytest
import torch
from torch import nn

from pnpct.denoisers import RDNCBAM, Gaussian, LearnedDenoiser, RDNSize
from pnpct.geometry import FanBeam, ImageGrid, evenly_spaced_views
from pnpct.operators import Projector
from pnpct.physics import Scan, simulate_counts, take_log
from pnpct.reconstruction import PlugAndPlay, fbp, starting_state
from pnpct.reconstruction.around_network import MIRRORS
from pnpct.training import (
    FBPImages,
    LoopImages,
    SplitViewPairs,
    mean_squared_error,
    on_pairs,
    train,
    view_subset_images,
)
from pnpct.training.images import SIGMAS_V

MU_WATER = 0.0193


def scan_of(image: torch.Tensor, grid: ImageGrid, geometry: FanBeam, *, incident: float, seed: int = 0) -> Scan:
    line_integrals = Projector(grid, geometry, mu_water=MU_WATER)(image)
    generator = torch.Generator().manual_seed(seed)
    counts = simulate_counts(line_integrals, torch.tensor(incident), generator=generator)
    return Scan(counts, torch.tensor(incident), 0.0, geometry=geometry, mu_water=MU_WATER)


@pytest.fixture(scope="module")
def fan(geometry: FanBeam) -> FanBeam:
    return replace(geometry, view_angles=evenly_spaced_views(120))


@pytest.fixture(scope="module")
def scan(disk: torch.Tensor, grid: ImageGrid, fan: FanBeam) -> Scan:
    return scan_of(disk, grid, fan, incident=2e4)


@pytest.mark.parametrize("parts", [2, 3, 4])
def test_the_mean_of_the_parts_is_the_image_of_all_views(scan: Scan, grid: ImageGrid, parts: int) -> None:
    images = view_subset_images(scan, grid, parts)
    torch.testing.assert_close(images.mean(0), FBPImages()(scan, grid), rtol=0, atol=1e-5)
    assert (images[0] - images[1]).abs().max() > 0.01


def test_a_part_knows_no_count_of_another_even_where_rays_are_starved(
    disk: torch.Tensor, grid: ImageGrid, fan: FanBeam
) -> None:
    starved = scan_of(disk, grid, fan, incident=300.0)
    images = view_subset_images(starved, grid, 3)
    counts = starved.counts.clone()
    counts[1::3] += 5.0
    changed = view_subset_images(replace(starved, counts=counts), grid, 3)
    assert torch.equal(images[0], changed[0])
    assert torch.equal(images[2], changed[2])
    assert not torch.equal(images[1], changed[1])


def test_what_is_said_of_each_view_goes_with_it_and_slices_stay_slices(scan: Scan, grid: ImageGrid) -> None:
    images = view_subset_images(scan, grid, 3)
    current = 1 + 0.5 * torch.linspace(0, 1, 120)[:, None]  # of the tube, from view to view
    modulated = replace(scan, counts=scan.counts * current, incident=scan.incident * current)
    both = replace(modulated, counts=torch.stack([modulated.counts, modulated.counts.flip(0)]))
    of_both = view_subset_images(both, grid, 3)
    assert of_both.shape == (3, 2, *grid.shape)
    torch.testing.assert_close(of_both[:, 0], images, rtol=0, atol=1e-4)


def test_parts_that_cannot_be_made_are_refused(scan: Scan, grid: ImageGrid) -> None:
    with pytest.raises(ValueError, match="at least two parts, got 1"):
        view_subset_images(scan, grid, 1)
    with pytest.raises(ValueError, match="5 parts of at least 30 views each cannot be made of 120 views"):
        view_subset_images(scan, grid, 5)


def test_a_network_that_learns_from_a_noisy_scan_alone_comes_closer_to_the_truth(grid: ImageGrid, fan: FanBeam) -> None:
    x, y = torch.from_numpy(grid.x)[None, :], torch.from_numpy(grid.y)[:, None]
    disk = torch.sigmoid((85 - torch.hypot(x, y)) / 10)  # no edges, or their errors would be above the noise
    truth = (disk + 0.2 * torch.sigmoid((25 - torch.hypot(x - 30, y - 20)) / 8)).float()
    noisy = scan_of(truth, grid, fan, incident=1e3)
    pairs = SplitViewPairs(view_subset_images(noisy, grid, 4), seed=0)
    torch.manual_seed(0)
    D = RDNCBAM(RDNSize(features=8, growth=8, blocks=1, convolutions=2))
    options = {"epochs": 1, "pairs_per_epoch": 360, "batch": 4, "micro_batch": 4, "learning_rate": 3e-3}
    list(train(D, on_pairs(pairs, mean_squared_error), stage="single-scan", **options))
    image = FBPImages()(noisy, grid)
    with torch.no_grad():
        errors = [float((each - truth).square().mean().sqrt()) for each in (image, D(image[None])[0])]
    assert errors[1] < 0.6 * errors[0], errors


def test_the_loop_shows_the_denoiser_what_admm_would(scan: Scan, grid: ImageGrid) -> None:
    """After some iterations the image is x + u of plug-and-play with the same denoiser, of the next one."""
    denoise, given = Gaussian(0.8), []
    drawn = LoopImages(denoise, "blur", iterations=3, number=2)
    for seed in range(4):
        images = drawn(scan, grid, torch.Generator().manual_seed(seed))
        sigma_v, iterations = _sigma_v_and_iterations(seed)
        A = Projector(grid, scan.geometry, mu_water=scan.mu_water)
        sinogram = take_log(scan)

        def watched(shown: torch.Tensor) -> torch.Tensor:
            given.append(shown)
            return denoise(shown)

        given.clear()
        for _ in islice(PlugAndPlay(watched, sigma_v=sigma_v).states(sinogram, A, starting_state(sinogram, A)), 3):
            pass
        torch.testing.assert_close(images, torch.stack([given[k] for k in iterations]), rtol=0, atol=1e-4)


def test_around_a_network_the_loop_is_that_of_plug_and_play(scan: Scan, grid: ImageGrid) -> None:
    class Seeing(nn.Module):
        def forward(self, images: torch.Tensor) -> torch.Tensor:
            seen.append(images.reshape(grid.shape))
            return 0.9 * images

    seen: list[torch.Tensor] = []
    network = LearnedDenoiser(Seeing())
    images = LoopImages(network, "seeing", iterations=3, number=3)(scan, grid, torch.Generator().manual_seed(5))
    seen.clear()
    strength_and_sigma_v = torch.rand(2, generator=torch.Generator().manual_seed(5))
    sigma_v = SIGMAS_V[0] * (SIGMAS_V[1] / SIGMAS_V[0]) ** float(strength_and_sigma_v[1])
    A = Projector(grid, scan.geometry, mu_water=scan.mu_water)
    sinogram = take_log(scan)
    states = PlugAndPlay(network, sigma_v=sigma_v).states(sinogram, A, starting_state(sinogram, A))
    for _ in islice(states, 3):
        pass
    mirrored_back = [image.flip(axes) for image, axes in zip(seen, MIRRORS, strict=False)]
    torch.testing.assert_close(images, torch.stack(mirrored_back), rtol=0, atol=1e-4)


def test_around_what_changes_nothing_the_loop_goes_from_fbp_towards_what_the_rays_say(
    disk: torch.Tensor, grid: ImageGrid, fan: FanBeam
) -> None:
    quiet = scan_of(disk, grid, fan, incident=1e9)
    images = LoopImages(iterations=9, number=9).undisturbed()(quiet, grid, torch.Generator().manual_seed(2))[[0, 2, 8]]
    blurred = fbp(take_log(quiet).line_integrals, Projector(grid, fan, mu_water=MU_WATER), kernel="soft")
    errors = [float((image - disk).square().mean()) for image in (blurred, *images)]
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] < 0.2 * errors[0]


def _sigma_v_and_iterations(seed: int) -> tuple[float, list[int]]:
    """What is drawn, in its order: strength, penalty, two of three iterations."""
    generator = torch.Generator().manual_seed(seed)
    torch.rand((), generator=generator)
    share = float(torch.rand((), generator=generator))
    low, high = SIGMAS_V
    return low * (high / low) ** share, sorted(torch.randperm(3, generator=generator)[:2].tolist())


def test_the_settings_of_images_tell_apart_what_makes_them() -> None:
    loop = LoopImages()
    ways = [
        FBPImages(),
        FBPImages("soft"),
        loop,
        loop.undisturbed(),
        replace(loop, denoiser=Gaussian(0.8), name="blur"),
        replace(loop, iterations=4),
        replace(loop, iterations=4, number=2),
    ]
    assert len({json.dumps(way.settings) for way in ways}) == len(ways)


@pytest.mark.parametrize("images", [0, 4])
def test_a_loop_has_as_many_images_as_iterations(images: int) -> None:
    with pytest.raises(ValueError, match=f"3 iterations give 1 to 3 images, not {images}"):
        LoopImages(number=images)
    with pytest.raises(ValueError, match="at least one iteration, got 0"):
        LoopImages(iterations=0)
