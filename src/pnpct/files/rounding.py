"""Numbers with fewer bits, which compress better."""

import numpy as np
import torch
from torch import Tensor

_BITS_OF_FLOAT32 = 23


def rounded(values: Tensor, *, bits: int) -> Tensor:
    """Round to so many bits after the leading one; the error is at most 2^−(bits + 1) of each value.

    Args:
        values: Finite numbers far from the largest of float32.
        bits: 1 to 22.

    Returns:
        float32 on the CPU.

    Example:
        >>> rounded(torch.tensor([1.0, 1.3]), bits=2).tolist()
        [1.0, 1.25]
    """
    dropped = _BITS_OF_FLOAT32 - bits
    whole = values.detach().cpu().float().contiguous().numpy().view(np.uint32)
    fewer = (whole + np.uint32(1 << (dropped - 1))) >> np.uint32(dropped) << np.uint32(dropped)
    return torch.from_numpy(fewer.view(np.float32))
