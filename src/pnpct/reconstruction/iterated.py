"""From the iterates of a method to its image."""

from collections import deque
from collections.abc import Iterator, Mapping
from typing import Any

import torch
from torch import Tensor

from pnpct.arrays import Image, Volume
from pnpct.reconstruction.pnp_admm import ADMMState
from pnpct.reconstruction.reconstructed import Progress, Reconstruction
from pnpct.reconstruction.stopping import RuleName, until
from pnpct.reconstruction.whole_object import Whole
from pnpct.reconstruction.whole_volume import WholeVolume


def iterated(
    states: Iterator[ADMMState],
    whole: Whole | WholeVolume,
    start: ADMMState,
    progress: Progress,
    *,
    iterations: int | Tensor,
    stop: RuleName,
    settings: Mapping[str, Any],
    mean_of: int = 1,
) -> Reconstruction:
    """Iterate until a rule ends it.

    Args:
        states: The iterates.
        whole: What is reconstructed.
        start: The state they begin from.
        progress: What watches the iterates.
        iterations: Maximum number of them, of all images or of each, in which case it broadcasts to them: an image is
            what its own number of iterations makes of it, whichever images are beside it.
        stop: Name of the rule.
        settings: Of the method.
        mean_of: The image is the mean of so many of the last iterates v, at least 1.

    Raises:
        ValueError: If no iteration is allowed.
    """
    each = torch.as_tensor(iterations, device=start.v.device)
    done, most, image, last = 0, int(each.max()), start.v, deque[Image | Volume](maxlen=mean_of)
    with torch.no_grad():
        for state in progress(until(states, start, whole.A, iterations=most, stop=stop), most):
            done += 1
            last.append(state.v)
            image = torch.where(each < done, image, torch.stack([*last]).mean(0))
    if not done:
        raise ValueError("ADMM has no image without an iteration.")
    stopped_by = stop if done < most else "iterations"
    return Reconstruction(whole.cut_out(image), settings, done, stopped_by, whole.notes)
