"""A volume, slab by slab, from which an interrupted command goes on."""

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from pnpct.arrays import Volume
from pnpct.cli.terminal import say, track
from pnpct.files import Provenance, SlabFolder
from pnpct.geometry import VolumeGrid
from pnpct.reconstruction import SLAB, Slab


@contextmanager
def volume_of_slabs(
    slabs: Callable[[int], Iterator[Slab]], output: Path, grid: VolumeGrid, provenance: Provenance
) -> Iterator[Volume]:
    """Have what is missing of a volume made and stored, and give all of it; then the stored slabs are removed.

    Args:
        slabs: Makes the slabs from the slice of this number on.
        output: Where the volume will be.
        grid: Its slices.
        provenance: How it is made.

    Yields:
        The volume.

    Raises:
        OSError: If a slab cannot be written or read.
        ValueError: If the slabs that are stored are of another volume.
    """
    folder = SlabFolder.beside(output, provenance)
    done = folder.slices
    if done:
        say(f"{done} of {grid.slices} slices are done already, in {folder.path}.")
    for slab in track(slabs(done), total=math.ceil((grid.slices - done) / SLAB), of="Slabs"):
        folder.write(slab.first, slab.image)
    yield folder.read()
    folder.remove()
