"""The options of `pnpct reconstruct` for scans with several detector rows, and the slices that they choose."""

from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Annotated, Any, Literal

from pnpct.cli.grids import plane_for
from pnpct.cli.parsing import given_options, option
from pnpct.cli.workers import Cluster, chosen_workers
from pnpct.denoisers import AcrossSlices
from pnpct.files import read_truth
from pnpct.geometry import Rebinning, TiltedPlanes, VolumeGrid
from pnpct.reconstruction import (
    TVPWLS,
    Method,
    PlugAndPlay,
    covered_grid,
    plane_distance,
    planes_of_a_row,
    slice_distance,
)

_COVERED = "as many as the scan covers"


@dataclass(frozen=True, kw_only=True)
class VolumeOptions:
    """Slices of a scan with several detector rows; None where not given, since an option that is given has an effect.

    Args:
        geometry: tilted reconstructs planes that are tilted with the helix, each on its own, and slices between them;
            cone takes all rays as they are: pnp and tv fit volumes to them, and fbp of an axial scan is Feldkamp's.
        slices: Number of slices.
        slice_spacing: Distance between the centres of neighbouring slices, mm.
        thickness: Slice thickness, mm: each slice is the mean over it; 0 is as thin as the detector rows allow.
        plane_spacing: Largest distance between the planes that are reconstructed, from which the slices are
            interpolated, mm: twice the distance takes half the time, and costs resolution along z.
        rebinning: tilted planes, which follow the helix, or horizontal ones (single-slice), from which it departs
            further, as a control.
        slice_agreement_hu: Neighbouring planes within one detector row are averaged by the prior of pnp where they
            agree to this difference, HU; 0 denoises each plane on its own.
        across: Weight of differences between neighbouring planes or slices in the total variation of tv, relative
            to those between neighbouring pixels.
        processes: Number of processes that share the planes, or the slabs of a cone, and the cores.
        cluster: Address of the scheduler of a Dask cluster, whose workers reconstruct these.
    """

    geometry: Annotated[Literal["cone", "tilted"] | None, option(default="tilted")] = None
    slices: Annotated[int | None, option(default=_COVERED)] = None
    slice_spacing: Annotated[float | None, option(default="that of the truth, or the height of a row")] = None
    thickness: Annotated[float | None, option(default=0)] = None
    plane_spacing: Annotated[float | None, option(default="half the height of a row, or all for thick slices")] = None
    rebinning: Annotated[Rebinning | None, option(default="tilted")] = None
    slice_agreement_hu: Annotated[float | None, option(default=AcrossSlices.agreement_hu)] = None
    across: Annotated[float | None, option(default="0; with --geometry cone that of space")] = None
    processes: Annotated[int | None, option(default=1)] = None
    cluster: Cluster = None

    def check_one_plane(self) -> None:
        """Check that none is given, for a scan of one plane.

        Raises:
            ValueError: If one is.
        """
        for name in given_options(self, VOLUME_OPTIONS):
            raise ValueError(
                f"--{name.replace('_', '-')} is for scans with several detector rows, and this scan is of one plane; "
                "leave it out."
            )

    def of_planes(self) -> dict[str, Any]:
        """Return the given options of `reconstruct_volume`, or of `reconstruct_cone_volume`.

        Raises:
            ValueError: If one is of planes, and there are none.
        """
        options = given_options(self, ("thickness", "plane_spacing", "rebinning"))
        for name in (*options,) if self.geometry == "cone" else ():
            if name != "thickness":
                raise ValueError(
                    f"--{name.replace('_', '-')} is of planes, and --geometry cone has none; leave it out."
                )
        return options

    def across_slices(self, method: Method, planes: TiltedPlanes, grid: VolumeGrid) -> Method:
        """Return the method as it suits a volume: the prior sees the planes or slices within one detector row.

        Args:
            method: For one plane.
            planes: The planes.
            grid: The slices.

        Raises:
            ValueError: If an option is given for another method, or is out of range.
        """
        suits = {"slice_agreement_hu": PlugAndPlay, "across": TVPWLS}
        for name in given_options(self, suits):
            if not isinstance(method, suits[name]):
                wanted = {PlugAndPlay: "pnp", TVPWLS: "tv"}[suits[name]]
                raise ValueError(f"--{name.replace('_', '-')} has an effect on --method {wanted} alone; leave it out.")
        if isinstance(method, PlugAndPlay):
            given = self.slice_agreement_hu
            agreement_hu = AcrossSlices.agreement_hu if given is None else given
            distance = plane_distance(planes, grid, self.thickness or 0.0, self.plane_spacing)
            distance = slice_distance(grid, planes.geometry) if self.geometry == "cone" else distance
            reach = planes_of_a_row(planes, distance)
            return replace(method, denoise=AcrossSlices(method.denoise, agreement_hu, reach))
        return replace(method, across=self.across) if isinstance(method, TVPWLS) and self.across is not None else method

    def workers(self) -> dict[str, Any]:
        """Return who reconstructs the planes, as options of `reconstruct_volume`.

        Raises:
            ValueError: If both processes and a cluster are given.
        """
        return chosen_workers(self.processes, self.cluster, usual=1)

    def volume_grid(
        self,
        scan: Path,
        planes: TiltedPlanes,
        *,
        size: int | None,
        field_of_view: float | None,
        center: tuple[float, ...] | None,
        insist: bool = False,
    ) -> VolumeGrid:
        """Return the slices to reconstruct; what is not given is that of the truth, as far as the scan covers it.

        Args:
            scan: File of the scan.
            planes: Its planes.
            size: Rows and columns.
            field_of_view: Side of a slice, mm.
            center: Middle of the volume: x and y, mm, and perhaps z.
            insist: Whether a field of view is taken that looks like a mistake of units.

        Raises:
            OSError: If the scan cannot be read.
            ValueError: If a number is out of range, or the scan does not cover that.
        """
        known = read_truth(scan)
        truth = known[1] if known and isinstance(known[1], VolumeGrid) else None
        plane = plane_for(
            known[1] if known else None,
            planes.geometry,
            size=size,
            field_of_view=field_of_view,
            center=center,
            insist=insist,
        )
        return covered_grid(
            planes,
            plane,
            thickness=self.thickness or 0.0,
            slices=self.slices,
            slice_spacing=self.slice_spacing,
            z=center[2] if center is not None and len(center) == 3 else None,
            known=truth,
        )


VOLUME_OPTIONS = tuple(field.name for field in fields(VolumeOptions))
