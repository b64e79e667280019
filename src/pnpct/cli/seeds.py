"""From `--seed` to random number generators."""

import numpy as np
import torch


def generators(seed: int) -> tuple[np.random.Generator, torch.Generator]:
    """Return a NumPy and a PyTorch generator, for different uses.

    Raises:
        ValueError: If the seed is not from 0 to 2^63 - 1.
    """
    check_seed(seed)
    return np.random.default_rng(seed), torch.Generator().manual_seed(seed)


def check_seed(seed: int) -> None:
    """Check that a number is a valid seed.

    Raises:
        ValueError: If it is not from 0 to 2^63 - 1.
    """
    if not 0 <= seed < 2**63:
        raise ValueError(f"A seed is a whole number from 0 to 2^63 - 1, got {seed}.")
