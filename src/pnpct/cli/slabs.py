"""A volume, slab by slab, from which an interrupted command goes on."""

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import torch

from pnpct.arrays import Volume
from pnpct.cli.devices import on_device
from pnpct.cli.terminal import say, track
from pnpct.files import Provenance, SlabFolder, read_scan, sole_writer
from pnpct.geometry import VolumeGrid
from pnpct.physics import Sinogram, take_log
from pnpct.reconstruction import SLAB, Slab


@dataclass(frozen=True)
class RaysOfFile:
    """The line integrals of some views of a scan, which are read when they are asked for, by other processes too.

    Args:
        scan: The file.
        device: Where they shall be.
    """

    scan: Path
    device: torch.device

    def __call__(self, views: Sequence[int]) -> Sinogram:
        """Return those of the views with these numbers."""
        first = min(views)
        part = read_scan(self.scan, views=slice(first, max(views) + 1))
        return take_log(on_device(part[[view - first for view in views]], self.device))


@contextmanager
def volume_of_slabs(
    slabs: Callable[[int], Iterator[Slab]],
    output: Path,
    grid: VolumeGrid,
    provenance: Provenance,
    *,
    together: int = SLAB,
) -> Iterator[Volume]:
    """Have what is missing of a volume made and stored, and give all of it; then the stored slabs are removed.

    Args:
        slabs: Makes the slabs from the slice of this number on.
        output: Where the volume will be.
        grid: Its slices.
        provenance: How it is made.
        together: Slices of a slab.

    Yields:
        The volume.

    Raises:
        OSError: If a slab cannot be written or read, or another process makes the same volume.
        ValueError: If the slabs that are stored are of another volume.
    """
    with sole_writer(output):
        folder = SlabFolder.beside(output, provenance)
        done = folder.slices
        if done:
            say(f"{done} of {grid.slices} slices are done already, in {folder.path}.")
        for slab in track(slabs(done), total=math.ceil((grid.slices - done) / together), of="Slabs"):
            folder.write(slab.first, slab.image)
        yield folder.read()
        folder.remove()
