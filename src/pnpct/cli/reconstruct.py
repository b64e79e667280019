"""`pnpct reconstruct`: from a scan to an image or a volume."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

import torch
from tyro.conf import Positional

from pnpct.arrays import Image
from pnpct.cli.devices import DeviceName, choose_device, on_device
from pnpct.cli.grids import grid_for
from pnpct.cli.image_output import ImageOptions, names_folder
from pnpct.cli.options import MethodOptions
from pnpct.cli.parsing import option
from pnpct.cli.slabs import RaysOfFile, volume_of_slabs
from pnpct.cli.terminal import say, track, working
from pnpct.cli.volume_options import VolumeOptions
from pnpct.files import read_scan, read_scan_geometry, record_run
from pnpct.files.plausible import doubt_of_object
from pnpct.geometry import DEFAULT_SIZE, ConeBeam, ImageGrid, TiltedPlanes, VolumeGrid
from pnpct.operators import Projector
from pnpct.operators.same_bytes import compute_same_bytes
from pnpct.physics import Scan, take_log, unmeasured_and_dead
from pnpct.reconstruction import (
    FBP,
    SLAB,
    ADMMState,
    Method,
    Slab,
    about_filtered_cone,
    check_covered,
    reconstruct_cone_volume,
    reconstruct_volume,
    slices_together,
)

_OF_TRUTH = "that of the truth in the scan; without one,"


@dataclass(frozen=True)
class Reconstruct(ImageOptions, VolumeOptions, MethodOptions):
    """Reconstruct the image of a scan, or the volume of a scan with several detector rows.

    Finished slices of a volume are kept in a folder beside the output, which becomes the output in the end. When an
    interrupted command is started again, it goes on from there.

    Args:
        scan: The scan, .h5.
        image: Output: .h5 for further processing, .nii or .nii.gz (HU) for viewers, .png to look at. A name without a
            suffix, or one that ends with a slash, is a folder for a DICOM series.
        size: Rows and columns of the image.
        field_of_view: Width of the image, mm.
        center: Centre of the image, x and y in mm, and optionally z for a volume.
        insist: Accept a field of view that looks like a mistake of units.
        device: Where to compute; auto uses a CUDA device if there is one.
    """

    scan: Positional[Path]
    image: Positional[Path]
    size: Annotated[int | None, option(default=f"{_OF_TRUTH} {DEFAULT_SIZE}")] = None
    field_of_view: Annotated[float | None, option(default=f"{_OF_TRUTH} the diameter that the fan covers")] = None
    center: Annotated[tuple[float, ...] | None, option(default=f"{_OF_TRUTH} 0 0, and all slices")] = None
    insist: bool = False
    device: DeviceName = "auto"

    def run(self, command: Sequence[str]) -> None:
        """Reconstruct, and write the image."""
        self.check_image(self.image, command, inputs=[self.scan])
        device = choose_device(self.device)
        method = self.chosen_method(device)
        geometry = read_scan_geometry(self.scan)
        # Of several rows only a few views at a time are in memory.
        scan = read_scan(self.scan, views=slice(1) if isinstance(geometry, ConeBeam) else slice(None))
        if scan.counts.ndim > len(scan.geometry.shape) and (
            ".nii" in self.image.suffixes or names_folder(self.image, command)
        ):
            raise ValueError(f"{self.scan} holds several scans, and NIfTI or DICOM one image; write .h5.")
        if isinstance(geometry, ConeBeam):
            self._volume(geometry, method, device, command, mu_water=scan.mu_water)
            return
        self.check_one_plane()
        image, grid, settings = self._image(on_device(scan, device), method)
        provenance = record_run(command, inputs=[self.scan], settings={**settings, "device": device.type})
        self.finish_image(self.image, image, grid, provenance=provenance, scan=self.scan)
        _, dead = unmeasured_and_dead([scan])
        if dead.size:
            bins = ", ".join(map(str, dead))
            say(f"Bins {bins} count nothing in any view, which makes rings; import them with --mask.")
        if doubt := doubt_of_object(image):
            say(f"This is {doubt}")
        for note in settings.get("notes", ()):
            say(note)

    def _image(self, scan: Scan, method: Method) -> tuple[Image, ImageGrid, dict[str, Any]]:
        grid = grid_for(
            self.scan,
            scan.geometry,
            size=self.size,
            field_of_view=self.field_of_view,
            center=self.center,
            insist=self.insist,
        )
        with ExitStack() as preparing:
            preparing.enter_context(working("Preparing"))
            projector = Projector(grid, scan.geometry, mu_water=scan.mu_water)

            def shown(states: Iterator[ADMMState], most: int) -> Iterable[ADMMState]:
                preparing.close()  # a terminal shows one thing at a time
                return track(states, total=most, of="ADMM")

            made = method(take_log(scan), projector, progress=shown)
        ended = {"iterations_done": made.iterations, "stopped_by": made.stopped_by} if made.iterations else {}
        if made.notes:
            ended["notes"] = list(made.notes)
        return made.image, grid, {**made.settings, **ended, "grid": asdict(grid)}

    def _volume(
        self, geometry: ConeBeam, method: Method, device: torch.device, command: Sequence[str], *, mu_water: float
    ) -> None:
        compute_same_bytes()  # whoever goes on with an interrupted volume ends with the same bytes
        options = self.of_planes()
        planes = TiltedPlanes(geometry, options.get("rebinning", TiltedPlanes.rebinning))
        grid = self.volume_grid(
            self.scan, planes, size=self.size, field_of_view=self.field_of_view, center=self.center, insist=self.insist
        )
        check_covered(planes, grid, self.thickness or 0.0)
        method = self.across_slices(method, planes, grid)
        in_space = self.geometry == "cone"
        of_beam: dict[str, Any] = {"geometry": "cone"} if in_space else {}
        together = slices_together(grid, geometry) if in_space else SLAB
        if in_space and isinstance(method, FBP):
            of_beam["notes"] = [about_filtered_cone(geometry, grid)]
        settings = {**method.settings, **of_beam, **options, "grid": asdict(grid), "device": device.type}
        provenance = record_run(command, inputs=[self.scan], settings=settings)

        rays, workers = RaysOfFile(self.scan, device), self.workers()

        def slabs(first: int) -> Iterator[Slab]:
            reconstruct = reconstruct_cone_volume if in_space else reconstruct_volume
            return reconstruct(rays, geometry, grid, method, mu_water=mu_water, first=first, **options, **workers)

        with volume_of_slabs(slabs, self.image, grid, provenance, together=together) as volume:
            self.finish_image(
                self.image,
                volume,
                grid,
                provenance=provenance,
                scan=self.scan,
                slice_thickness=self.thickness,
                also="" if in_space else _of_the_cone(planes, grid),
            )
        for note in settings.get("notes", ()):
            say(note)


def _of_the_cone(planes: TiltedPlanes, grid: VolumeGrid) -> str:
    """What an axial scan loses away from its middle, in words."""
    if planes.feed:
        return ""
    leaves = max(planes.leaves(float(z), grid.plane.radius) for z in grid.heights[[0, -1]])
    return (
        f"; an axial scan: at the border of the field of view the rays leave the outermost slices by {leaves:.2g} mm, "
        "and edges along z are blurred by as much"
    )
