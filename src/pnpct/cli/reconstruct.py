"""`pnpct reconstruct`: from a scan to an image."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional

from pnpct.cli.artefact import IMAGES, check_output, finish
from pnpct.cli.devices import DeviceName, choose_device, on_device
from pnpct.cli.grids import grid_for
from pnpct.cli.options import MethodOptions
from pnpct.cli.parsing import option
from pnpct.cli.terminal import say, track, working
from pnpct.files import read_scan, record_run, write_image
from pnpct.operators import Projector
from pnpct.physics import take_log
from pnpct.reconstruction import ADMMState

_OF_TRUTH = "that of the truth in the scan; without one,"


@dataclass(frozen=True)
class Reconstruct(MethodOptions):
    """Reconstruct the image of a scan.

    Args:
        scan: The scan, .h5.
        image: Output file: .h5 for further processing, .nii or .nii.gz (HU) for viewers, .png to look at.
        size: Rows and columns of the image.
        field_of_view: Width of the image, mm.
        insist: Take a field of view that looks like a mistake of units.
        device: Where to compute; auto takes a CUDA device if there is one.
    """

    scan: Positional[Path]
    image: Positional[Path]
    size: Annotated[int | None, option(default=f"{_OF_TRUTH} 512")] = None
    field_of_view: Annotated[float | None, option(default=f"{_OF_TRUTH} the diameter that the fan covers")] = None
    insist: bool = False
    device: DeviceName = "auto"

    def run(self, command: Sequence[str]) -> None:
        """Reconstruct, and write the image."""
        check_output(self.image, IMAGES, inputs=[self.scan])
        device = choose_device(self.device)
        method = self.chosen_method(device)
        scan = on_device(read_scan(self.scan), device)
        if scan.counts.ndim > len(scan.geometry.shape) and ".nii" in self.image.suffixes:
            raise ValueError(f"{self.scan} holds several scans, and NIfTI one image; write .h5.")
        grid = grid_for(self.scan, scan.geometry, size=self.size, field_of_view=self.field_of_view, insist=self.insist)
        with working("Preparing"):
            projector = Projector(grid, scan.geometry, mu_water=scan.mu_water)
            sinogram = take_log(scan)
        made = method(sinogram, projector, progress=_shown)
        ended = {"iterations_done": made.iterations, "stopped_by": made.stopped_by} if made.iterations else {}
        if made.notes:
            ended["notes"] = list(made.notes)
        settings = {**made.settings, **ended, "grid": asdict(grid), "device": device.type}
        provenance = record_run(command, inputs=[self.scan], settings=settings)
        write_image(self.image, made.image, grid, provenance=provenance)
        finish(self.image, provenance, summary=f"{grid.rows} x {grid.cols} pixels of {grid.spacing:.4g} mm")
        for note in made.notes:
            say(note)


def _shown(states: Iterator[ADMMState], most: int) -> Iterable[ADMMState]:
    return track(states, total=most, of="ADMM")
