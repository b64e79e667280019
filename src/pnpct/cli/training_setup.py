"""What `pnpct train` learns from, and how the processes of one run find each other."""

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from statistics import median
from typing import Any, Literal, TypeAlias, TypeVar, cast

import torch
from torch import distributed, nn

from pnpct.cli.training_images import QUIET_MA, LoopImages, fbp_image, unchanged
from pnpct.denoisers import LearnedDenoiser
from pnpct.denoisers.noise_level import is_noise_conditioned
from pnpct.files import MANIFEST, Split, load_network, network_file, read_manifest, sha256_of
from pnpct.reconstruction import DAMPING
from pnpct.training import Examples, Reference
from pnpct.units import to_hu

State = TypeVar("State")

ReferenceName: TypeAlias = Reference | Literal["noise-free"]
"""As of `Examples`, or what each image would be without its noise, with the same blur."""

VALIDATION_PAIRS = 8
"""Pairs that the progress of training is judged by; always the same."""


def examples_of(
    datasets: Sequence[Path],
    split: Split,
    *,
    loop_denoiser: str | None,
    loop_iterations: int,
    loop_images: int,
    bfloat16: bool,
    device: torch.device,
    reference: ReferenceName,
    **options: Any,
) -> Examples:
    """Return the examples of one part of data sets, as images of FBP and of the loop of ADMM.

    Args:
        datasets: Folders that `pnpct simulate dataset` has made.
        split: Which part of them.
        loop_denoiser: Network that denoises in the loop, by name or file; total variation if None.
        loop_iterations: Most iterations of the loop.
        loop_images: How many of their images are in each example.
        bfloat16: Whether that network computes in bfloat16.
        device: Where it computes.
        reference: What is learnt towards.
        **options: As for `Examples`.

    Raises:
        OSError: If a file cannot be read.
        ValueError: If the part is empty, there is no iteration or image of one, or the network of the loop is told
            the noise level.
    """
    if loop_iterations < 1:
        raise ValueError(f"The loop needs at least one iteration, got {loop_iterations}.")
    if not 1 <= loop_images <= loop_iterations:
        raise ValueError(f"{loop_iterations} iterations give 1 to {loop_iterations} images, not {loop_images}.")
    files = [dataset / name for dataset in datasets for name in read_manifest(dataset).files(split)]
    if not files:
        raise ValueError(f"{datasets[0]} has no patients for {split}; simulate more of them.")
    loop = LoopImages(iterations=loop_iterations, number=loop_images)
    if loop_denoiser is not None:
        path = network_file(loop_denoiser)
        network = load_network(path).to(device)
        if is_noise_conditioned(network):
            raise ValueError(f"{loop_denoiser} is told the noise level, which the loop of training does not know.")
        name = f"{sha256_of(path)}{' in bfloat16' if bfloat16 else ''}"
        loop = LoopImages(LearnedDenoiser(network, bfloat16=bfloat16), name, loop_iterations, loop_images, DAMPING)
    towards: dict[str, Any] = {"reference": reference}
    if reference == "noise-free":
        perfect = replace(loop, denoiser=unchanged, name="none")
        towards = {"reference": QUIET_MA, "make_references": (fbp_image, perfect)}
    return Examples(files, fbp_image, (loop,), source=" ".join(manifests_of(datasets)), **towards, **options)


def manifests_of(datasets: Sequence[Path]) -> list[str]:
    """Return the SHA-256 of the manifest of each data set."""
    return [sha256_of(dataset / MANIFEST) for dataset in datasets]


def validate(D: nn.Module, examples: Callable[[int], Any]) -> dict[str, float]:
    """Return how far the network's outputs are from the references, by what its input was.

    The number is the RMS difference, HU, of the pair in the middle: the noise of one reference must not decide.
    """
    device = next(D.parameters()).device
    errors: dict[str, list[float]] = {"fbp": [], "loop": []}
    with torch.no_grad():
        for number in range(VALIDATION_PAIRS):
            example = examples(number)
            images = example.low[0], *example.others
            names = ["fbp", *len(example.others) * ["loop"]]
            for name, image, reference in zip(names, images, example.references, strict=True):
                level = [torch.tensor(example.noise_level, device=device)] if is_noise_conditioned(D) else []
                output = D(image[None].to(device), *level)[0].float().cpu()
                errors[name].append(float((to_hu(output) - to_hu(reference)).square().mean()))
    return {name: median(squares) ** 0.5 for name, squares in errors.items()}


@contextmanager
def joined_processes(device: torch.device) -> Iterator[int]:
    """Join the other processes that torchrun has started, if it has, and yield the rank of this one."""
    if "RANK" not in os.environ or int(os.environ.get("WORLD_SIZE", "1")) == 1:
        yield 0
        return
    if device.type == "cuda":
        torch.cuda.set_device(int(os.environ.get("LOCAL_RANK", "0")))
    distributed.init_process_group("nccl" if device.type == "cuda" else "gloo")
    try:
        yield distributed.get_rank()
    finally:
        distributed.destroy_process_group()


def from_first(read: Callable[[], State]) -> State:
    """Read something in the first process, and return it in all: the others may not see the file, or an older one."""
    if not distributed.is_initialized():
        return read()
    found = [read() if distributed.get_rank() == 0 else None]
    distributed.broadcast_object_list(found)
    return cast("State", found[0])
