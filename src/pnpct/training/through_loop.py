"""Training through plug-and-play: what a network learns from is the image that the whole loop ends with.

    L = ½ log E_soft + ½ log E_body + 0.05 log E_all,     E = mean of (image − truth)² over a tissue

A fifth of the same loss of the network alone, on an image of filtered back-projection, is added.

In the loop a network is given its own work. One that comes nearer to its targets on single images may end farther from
the truth: what it does to an image has consequences in the data steps and in the iterations that follow, and single
images say nothing of them. Here the gradient passes through them, back to each time that the network was applied.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn
from torch.utils.checkpoint import checkpoint
from typing_extensions import override

from pnpct.arrays import Image
from pnpct.denoisers.learned import DENSEST
from pnpct.denoisers.noise_level import is_noise_conditioned
from pnpct.evaluation import body_mask, soft_tissue_mask
from pnpct.files import MANIFEST, exposure_pixel, read_manifest, sha256_of
from pnpct.reconstruction import PlugAndPlay
from pnpct.reconstruction.around_network import MIRRORS_IN_IMAGE, mirrored
from pnpct.reconstruction.iteration_schedule import MOST, enough_iterations
from pnpct.reconstruction.normal_equations import balanced_sigma_v
from pnpct.training.closed_loop import ClosedLoop
from pnpct.training.loop_scans import LoopScan, LoopScans
from pnpct.training.plan import Schedule, TrainingPlan
from pnpct.training.two_stage import train

SIGMAS_V = (50.0, 72.0)
"""Lowest and highest σ_v of a loop, HU, drawn evenly in its logarithm."""

LONG = 0.25
"""Share of the loops that are longer than the noise needs, up to `MOST` iterations: a network must not need the end."""

THROUGH = 3
"""Of the last so many iterations the gradient is known."""

ALONE = 0.2
"""Weight of the loss of the network alone on an image of FBP, over that of the loop."""

EVERYWHERE = 0.05
"""Weight of the air around the patient, where nothing else says what a network should do."""


@dataclass(frozen=True, kw_only=True)
class ThroughLoop(Schedule):
    """Train a network that removes noise already by the images that plug-and-play ends with around it.

    A pair is a slice here, scanned at two doses, with the truth.

    Args:
        also: Folders of further data sets to train on.
        examples: Slices that are scanned, before the same scans are repeated; they are kept in memory.
        lowest_ma: Lowest tube current, mA, at 120 kVp.
        highest_ma: Highest tube current, mA, at 120 kVp.
        reconstructed: Slices of the patients for validation that are reconstructed around the network after each epoch.

    Raises:
        ValueError: If there are no slices, or an option is given that has no effect on whole ones.
    """

    also: tuple[Path, ...] = ()
    examples: int = 100
    lowest_ma: float = 15.0
    highest_ma: float = 280.0
    reconstructed: int = 0

    def __post_init__(self) -> None:
        if self.examples < 1 or self.reconstructed < 0:
            raise ValueError(
                f"Scans are made of at least one slice, and none or more are reconstructed, got {self.examples} and "
                f"{self.reconstructed}."
            )
        if self.side is not None or self.micro_batch is not None or self.bfloat16:
            raise ValueError(
                "Through the loop a network learns from whole slices, one after another: side, micro_batch and "
                "bfloat16 have no effect."
            )

    @override
    def settings(self) -> dict[str, Any]:
        settings = super().settings()
        del settings["reconstructed"]
        return {**settings, "also": [sha256_of(folder / MANIFEST) for folder in self.also]}

    def plan(self, network: nn.Module, data: Path) -> TrainingPlan:
        """Return the training of a network on a data set.

        Args:
            network: The network, on its device; the rays stay on the CPU.
            data: Folder of the data set, as `simulate_dataset` makes it.

        Raises:
            OSError: If a file cannot be read.
            ValueError: If there are no patients to train on, or the network is noise-conditioned.
        """
        if is_noise_conditioned(network):
            raise ValueError("In the loop the noise level is not known; train a network without that input.")
        datasets, currents = (data, *self.also), (self.lowest_ma, self.highest_ma)
        files = [dataset / name for dataset in datasets for name in read_manifest(dataset).files("train")]
        if not files:
            raise ValueError(f"{data} has no patients for train; simulate more of them.")
        # Whole slices pass through it faster so.
        network.to(memory_format=torch.contiguous_format)  # type: ignore[call-overload]  # its types do not know it
        drawn = cache(LoopScans(files, currents, self.seed))
        options = {"stage": "through-loop", "epochs": self.epochs, **self.steps()}
        held_out = [data / name for name in read_manifest(data).files("validation")][: self.reconstructed]
        tried = partial(ClosedLoop(held_out, currents, self.seed), network) if held_out else dict
        pixels = [pixel for file in files if (pixel := exposure_pixel(file)) is not None]
        losses = partial(through_loop_losses, lambda number: drawn(number % self.examples), self.seed)
        return TrainingPlan(
            partial(train, network, losses, **options), self.epochs, tried, finest_pixel=min(pixels, default=None)
        )


def through_loop_losses(scans: Callable[[int], LoopScan], seed: int, D: nn.Module, numbers: Sequence[int]) -> Tensor:
    """Return the loss of a network on the scans of each number.

    Args:
        scans: Scans by number.
        seed: Seed of σ_v and of how long the loops are.
        D: The network.
        numbers: The numbers.
    """
    losses = []
    for number in numbers:
        draw, scan = np.random.default_rng([seed, number]), scans(number)
        sigma_v = float(np.exp(draw.uniform(*np.log(SIGMAS_V))))
        # As many as the noisier scan needs: the other one's loop is longer than it need be.
        enough = int(enough_iterations(balanced_sigma_v(scan.sinogram, scan.A, scan.start.v) / sigma_v).max())
        iterations = int(draw.integers(enough, MOST, endpoint=True)) if draw.random() < LONG else enough
        images = reconstructed_around(D, scan, sigma_v=sigma_v, iterations=iterations)
        alone = denoised_by(D, scan.filtered[number % len(scan.filtered)])
        in_loop = torch.stack([relative_loss(image, scan.truth) for image in images]).mean()
        losses.append(in_loop + ALONE * relative_loss(alone, scan.truth))
    return torch.stack(losses)


def reconstructed_around(D: nn.Module, scan: LoopScan, *, sigma_v: float, iterations: int) -> Image:
    """Return the images of plug-and-play, as `PlugAndPlay` makes them, with the gradient of the last iterations.

    Args:
        D: The network.
        scan: What is reconstructed.
        sigma_v: As of `PlugAndPlay`.
        iterations: Number of iterations.
    """
    method = PlugAndPlay(mirrored(partial(denoised_by, D), scan.A.grid.spacing), sigma_v=sigma_v)
    states = method.states(scan.sinogram, scan.A, scan.start)
    images = []
    for iteration in range(iterations):
        with torch.set_grad_enabled(iteration >= iterations - THROUGH):
            images.append(next(states).v)
    return torch.stack(images[-MIRRORS_IN_IMAGE:]).mean(0)


def denoised_by(D: nn.Module, images: Image) -> Image:
    """Return images that a network has denoised as `LearnedDenoiser` lets it, with the gradient of its weights.

    Args:
        D: The network.
        images: One image or several, relative to water.
    """
    seen = images.clamp(max=DENSEST)
    slices = seen.reshape(-1, 1, *seen.shape[-2:]).to(next(D.parameters()).device)
    # One slice after another, each computed again for its gradient: memory is that of one pass of one slice.
    denoised = torch.cat([checkpoint(D, each, use_reentrant=False) for each in slices])
    return denoised.reshape(images.shape).to(images) + (images - seen)


def relative_loss(image: Image, truth: Image) -> Tensor:
    """Return the loss of an image: a percent less error is the same at every dose and in every tissue.

    A tissue that the slice does not have is left out.

    Args:
        image: The image, relative to water.
        truth: What it should be.
    """
    squares = (image - truth).square()
    everywhere = torch.ones_like(truth, dtype=torch.bool)
    terms = [(0.5, soft_tissue_mask(truth)), (0.5, body_mask(truth)), (EVERYWHERE, everywhere)]
    return torch.stack([weight * squares[mask].mean().log() for weight, mask in terms if bool(mask.any())]).sum()
