"""The projector of a cone beam: line integrals of a volume, their exact adjoint, and gradients through both."""

from dataclasses import replace
from functools import partial
from typing import Any, final

import torch
from torch import Tensor
from typing_extensions import override

from pnpct.arrays import ConeRays, Support, Volume
from pnpct.geometry import ConeBeam, ImageGrid, VolumeGrid
from pnpct.operators.cone.cone_lines import check_volume
from pnpct.operators.cone.cpu_cone_projector import CpuConeProjector
from pnpct.operators.cone.torch_cone_projector import TorchConeProjector
from pnpct.operators.gradients import linear
from pnpct.operators.linear_operator import LinearOperator
from pnpct.operators.support import check_support, supported
from pnpct.units import MU_WATER_70_KEV


@final
class ConeProjector(LinearOperator):
    """Line integrals of a volume along all rays of a cone beam; the adjoint has the very same weights.

    On each row of pixels that a ray crosses (column, where it is flat) its cell casts a strip in the plane and an
    interval along z. The ray takes the mean of the voxels under both, times the path through the row, and sums:

        (A x)_i = mu_water Σ_rows length_i · mean_i,row(x)

    Outside the volume there is air. The trajectory may be a circle, a helix, or any other, and the focal spot may move
    from view to view. Rows of pixels over which a ray rises by less than a third of a detector row share one height.

    It computes in float32 and answers in the precision it was asked in. Autograd works through both directions, any
    number of times. On a CPU the kernels are compiled at their first use, once per machine, and use as many threads
    as PyTorch; the result does not depend on that number. On other devices plain torch operations do the same.

    Args:
        grid: Where the voxels are.
        geometry: Where the rays are.
        mu_water: Attenuation of water at the effective energy, 1/mm, > 0; 1 gives path lengths in mm.
        support: Pixels that count, the same in each slice, as of `Projector`. None for all.

    Raises:
        ValueError: If no ray meets the volume, the focal spot would be inside it, `mu_water` is not positive, the
            support has another shape, or the detector rows have no height.

    References:
        De Man and Basu, Phys. Med. Biol. 49 (2004) 2463; Long, Fessler and Balter, IEEE Trans. Med. Imaging 29 (2010)
        1839.

    Example:
        >>> from pnpct.geometry import Detector, ImageGrid, Trajectory
        >>> detector = Detector(bins=3, bin_width=20.0, rows=2, row_height=4.0)
        >>> geometry = ConeBeam(Trajectory((0.0, 1.0)), detector, source_to_isocenter=500.0, source_to_detector=1000.0)
        >>> projector = ConeProjector(VolumeGrid(ImageGrid(64, 64, spacing=1.0), 8, 1.0), geometry, mu_water=0.02)
        >>> projector(torch.ones(8, 64, 64))[0, 0, 1].item()  # 64 mm of water
        1.28...
    """

    def __init__(
        self,
        grid: VolumeGrid,
        geometry: ConeBeam,
        *,
        mu_water: float = MU_WATER_70_KEV,
        support: Support | None = None,
    ) -> None:
        if not 0 < mu_water < float("inf"):
            raise ValueError(f"The attenuation of water must be positive, in 1/mm, got {mu_water}.")
        check_volume(grid, geometry)
        self.grid, self.geometry, self.mu_water = grid, geometry, mu_water
        self.domain_shape, self.range_shape = grid.shape, geometry.shape
        check_support(support, grid.shape)
        self.support = support
        self._made: dict[torch.device, CpuConeProjector | TorchConeProjector] = {}

    def __deepcopy__(self, _memo: object) -> "ConeProjector":
        return self  # it never changes, and its tables are large

    @override
    def forward(self, x: Volume) -> ConeRays:
        """Return the line integrals of a volume relative to water; dimensionless."""
        return linear(x, partial(self._apply, transpose=False), self.adjoint)

    @override
    def adjoint(self, y: ConeRays) -> Volume:
        """Return Aᵀ y."""
        return linear(y, partial(self._apply, transpose=True), self.forward)

    def gram_diagonal(self, weights: ConeRays) -> Volume:
        """Return the diagonal of Aᵀ diag(weights) A: Σᵢ a²ᵢⱼ wᵢ. It has no gradient.

        Where strips are wider than two pixels it is too small: they are cut into parts, and a² is summed over these.
        """
        return self._apply(weights.detach(), transpose=True, squared=True)

    def on(self, plane: ImageGrid, support: Support | None = None) -> "ConeProjector":
        """Return the projector of the same rays onto slices of other pixels."""
        grid = replace(self.grid, plane=plane)
        return ConeProjector(grid, self.geometry, mu_water=self.mu_water, support=support)

    def _apply(self, array: Tensor, *, transpose: bool, squared: bool = False) -> Tensor:
        """Run the kernels for the device on each of a batch, in units of water."""
        kernels = self._kernels(array.device)
        scale = self.mu_water**2 if squared else self.mu_water
        given, shape = (self.range_shape, self.domain_shape) if transpose else (self.domain_shape, self.range_shape)
        answer = array.new_empty((*array.shape[: array.ndim - 3], *shape))
        for source, target in zip(array.reshape(-1, *given), answer.view(-1, *shape), strict=True):
            source = source if transpose else supported(source, self.support)
            values: Any = source.float().contiguous()
            values = values.numpy() if isinstance(kernels, CpuConeProjector) else values
            result = kernels.back_project(values, squared=squared) if transpose else kernels.project(values)
            torch.mul(torch.as_tensor(result), scale, out=target)
        return supported(answer, self.support) if transpose else answer

    def _kernels(self, device: torch.device) -> CpuConeProjector | TorchConeProjector:
        if device not in self._made:
            self._made[device] = self._make_kernels(device)
        return self._made[device]

    def _make_kernels(self, device: torch.device) -> CpuConeProjector | TorchConeProjector:
        if device.type == "cpu":
            return CpuConeProjector(self.grid, self.geometry, self.support)
        return TorchConeProjector(self.grid, self.geometry, device)
