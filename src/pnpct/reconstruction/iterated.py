"""From the iterates of a method to its image."""

from collections import deque
from collections.abc import Iterator, Mapping
from typing import Any, Protocol, runtime_checkable

import torch

from pnpct.arrays import Image, Volume
from pnpct.operators import AnyProjector
from pnpct.physics import Sinogram
from pnpct.reconstruction.pnp_admm import ADMMState
from pnpct.reconstruction.reconstructed import Progress, Reconstruction
from pnpct.reconstruction.stopping import RuleName, until
from pnpct.reconstruction.whole_object import Whole
from pnpct.reconstruction.whole_volume import WholeVolume


@runtime_checkable
class Iterative(Protocol):
    """A method with iterates."""

    @property
    def iterations(self) -> int:
        """Maximum number of iterations."""
        ...

    @property
    def stop(self) -> RuleName:
        """The rule that may end them earlier."""
        ...

    @property
    def settings(self) -> Mapping[str, Any]:
        """All that the image depends on besides the data, as plain values."""
        ...

    def states(self, sinogram: Sinogram, A: AnyProjector, start: ADMMState) -> Iterator[ADMMState]:
        """Yield the iterates from a state on, for ever."""
        ...


def iterated(
    method: Iterative, whole: Whole | WholeVolume, start: ADMMState, progress: Progress, *, mean_of: int = 1
) -> Reconstruction:
    """Iterate until the rule of the method ends it.

    Args:
        method: The method.
        whole: What is reconstructed.
        start: The state to begin from.
        progress: What watches the iterates.
        mean_of: The image is the mean of so many of the last iterates v, at least 1.

    Raises:
        ValueError: If no iteration is allowed.
    """
    sinogram, A = whole.sinogram, whole.A
    states = until(method.states(sinogram, A, start), start, A, iterations=method.iterations, stop=method.stop)
    done, last = 0, deque[Image | Volume](maxlen=mean_of)
    with torch.no_grad():
        for state in progress(states, method.iterations):
            done += 1
            last.append(state.v)
    if not done:
        raise ValueError("ADMM has no image without an iteration.")
    stopped_by = method.stop if done < method.iterations else "iterations"
    return Reconstruction(whole.cut_out(torch.stack([*last]).mean(0)), method.settings, done, stopped_by, whole.notes)
