"""How far a network is from its targets, on examples that are held out."""

import copy
from collections.abc import Callable
from statistics import median

import torch
from torch import nn

from pnpct.denoisers.noise_level import is_noise_conditioned
from pnpct.training.examples import Example
from pnpct.units import to_hu

VALIDATION_EXAMPLES = 8
"""Examples for validation; always the same."""


def validate(D: nn.Module, examples: Callable[[int], Example]) -> dict[str, float]:
    """Return how far the network's outputs are from the references, for inputs of FBP and of the loop.

    Returns:
        The RMS difference, HU, of the pair in the middle: the noise of one reference must not decide.
    """
    device = next(D.parameters()).device
    D = copy.deepcopy(D).eval()  # a network in training mode would learn from what it is measured by
    errors: dict[str, list[float]] = {"fbp": [], "loop": []}
    with torch.no_grad():
        for number in range(VALIDATION_EXAMPLES):
            example = examples(number)
            images = example.low[0], *example.others
            names = ["fbp", *len(example.others) * ["loop"]]
            for name, image, reference in zip(names, images, example.references, strict=True):
                level = [torch.tensor(example.noise_level, device=device)] if is_noise_conditioned(D) else []
                output = D(image[None].to(device), *level)[0].float().cpu()
                errors[name].append(float((to_hu(output) - to_hu(reference)).square().mean()))
    return {name: median(squares) ** 0.5 for name, squares in errors.items()}
