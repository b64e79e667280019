"""What a method is, and what it returns."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Protocol, TypeAlias, runtime_checkable

from pnpct.arrays import Image, Volume
from pnpct.geometry.short_repr import short_repr
from pnpct.operators import AnyProjector
from pnpct.physics import Sinogram
from pnpct.reconstruction.pnp_admm import ADMMState


@dataclass(frozen=True, eq=False)
class Reconstruction:
    """An image or a volume, and how it was made.

    Args:
        image: The image, relative to water.
        settings: All that it depends on besides the data, as plain values.
        iterations: How many iterations were done; 0 where there are none.
        stopped_by: What ended them: the name of a rule, or "iterations"; empty where there are none.
        notes: What readers of the image should know, in sentences.
    """

    image: Image | Volume
    settings: Mapping[str, Any]
    iterations: int = 0
    stopped_by: str = ""
    notes: tuple[str, ...] = ()

    __repr__ = short_repr


Progress: TypeAlias = Callable[[Iterator[ADMMState], int], Iterable[ADMMState]]
"""From the iterates of a method, and their maximum number, to the same iterates, displayed or recorded as they pass.

They have the pixels of the iterations: more than were asked for where the object needs them, fewer where there is air.
"""


@runtime_checkable
class Method(Protocol):
    """From a sinogram, and the projector of its rays, to an image or a volume; a batch of sinograms gives a batch."""

    @property
    def settings(self) -> Mapping[str, Any]:
        """All that the image depends on besides the data, as plain values."""
        ...

    def __call__(self, sinogram: Sinogram, A: AnyProjector, *, progress: Progress = ...) -> Reconstruction:
        """Reconstruct."""
        ...


def unwatched(states: Iterator[ADMMState], _most: int) -> Iterable[ADMMState]:
    """Let the iterates pass."""
    return states
