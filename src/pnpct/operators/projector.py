"""The projector of a fan beam: line integrals of an image, their exact adjoint, and gradients through both."""

from functools import partial
from typing import final

import torch
from torch import Tensor
from typing_extensions import override

from pnpct.arrays import Image, Rays, Support
from pnpct.geometry import Geometry, ImageGrid, require_fan_beam
from pnpct.operators.cpu_projector import CpuProjector
from pnpct.operators.gradients import linear
from pnpct.operators.kernels import Kernels, triton_runs_on
from pnpct.operators.linear_operator import LinearOperator
from pnpct.operators.ray_lines import Method, check_reach, ray_lines
from pnpct.operators.support import check_support, supported
from pnpct.operators.torch_projector import TorchProjector
from pnpct.units import MU_WATER_70_KEV


@final
class Projector(LinearOperator):
    """Line integrals of an image along all rays of a fan beam; the adjoint has the very same weights.

    On each row that a ray crosses (column, where it is flat) its cell casts a strip. The distance-driven method takes
    the mean of the pixels under the strip, Joseph's interpolates between the two pixels next to the ray; both
    multiply by the path through the row and sum:

        (A x)_i = mu_water Σ_rows length_i · mean_i,row(x)

    It computes in float32 and answers in the precision it was asked in. Autograd works through both directions, any
    number of times. On a CPU the kernels are compiled at their first use, once per machine, and use as many threads
    as PyTorch; the result does not depend on that number. On a CUDA device Triton's kernels do the same, compiled at
    their first use too; on other devices plain torch operations.

    Args:
        grid: Where the pixels are.
        geometry: Where the rays are: a fan beam; `ConeProjector` is that of a cone beam.
        mu_water: Attenuation of water at the effective energy, 1/mm, > 0; 1 gives path lengths in mm.
        method: "distance-driven", free of aliasing at every pixel size, or "joseph", a little faster.
        support: Pixels that count, those of an object and some air around it. Whatever an image has elsewhere no ray
            meets, and the adjoint is 0 there, which saves time. None for all.

    Raises:
        ValueError: If no ray meets the image, the focal spot would be inside it, `mu_water` is not positive, the
            support has another shape, or the geometry is a cone beam.

    References:
        De Man and Basu, Phys. Med. Biol. 49 (2004) 2463; Joseph, IEEE Trans. Med. Imaging 1 (1982) 192.

    Example:
        >>> from pnpct.geometry import FanBeam, evenly_spaced_views
        >>> geometry = FanBeam(evenly_spaced_views(4), bins=3, source_to_isocenter=500.0, source_to_detector=1000.0,
        ...                    bin_width=20.0)
        >>> projector = Projector(ImageGrid(64, 64, spacing=1.0), geometry, mu_water=0.02)
        >>> round(projector(torch.ones(64, 64))[0, 1].item(), 3)  # 64 mm of water
        1.28
    """

    def __init__(
        self,
        grid: ImageGrid,
        geometry: Geometry,
        *,
        mu_water: float = MU_WATER_70_KEV,
        method: Method = "distance-driven",
        support: Support | None = None,
    ) -> None:
        if not 0 < mu_water < float("inf"):
            raise ValueError(f"The attenuation of water must be positive, in 1/mm, got {mu_water}.")
        if method not in ("distance-driven", "joseph"):
            raise ValueError(f'The projector method is "distance-driven" or "joseph", got "{method}".')
        self.grid, self.geometry, self.mu_water, self.method = grid, require_fan_beam(geometry), mu_water, method
        self.domain_shape, self.range_shape = grid.shape, geometry.shape
        check_support(support, grid.shape)
        self.support = support
        check_reach(grid, self.geometry)
        self._made: dict[torch.device, Kernels] = {}

    def __deepcopy__(self, _memo: object) -> "Projector":
        return self  # it never changes, and its tables are large

    @override
    def forward(self, x: Image) -> Rays:
        """Return the line integrals of an image relative to water; dimensionless."""
        return linear(x, partial(self._apply, transpose=False), self.adjoint)

    @override
    def adjoint(self, y: Rays) -> Image:
        """Return Aᵀ y."""
        return linear(y, partial(self._apply, transpose=True), self.forward)

    def gram_diagonal(self, weights: Rays) -> Image:
        """Return the diagonal of Aᵀ diag(weights) A: Σᵢ a²ᵢⱼ wᵢ. It has no gradient."""
        return self._apply(weights.detach(), transpose=True, squared=True)

    def to(self, device: torch.device | str) -> "Projector":
        """Prepare the projector on a device, and return it; each array is projected where it lies in any case."""
        self._kernels(torch.device(device))
        return self

    def on(self, plane: ImageGrid, support: Support | None = None) -> "Projector":
        """Return the projector of the same rays onto other pixels."""
        return Projector(plane, self.geometry, mu_water=self.mu_water, method=self.method, support=support)

    def _apply(self, array: Tensor, *, transpose: bool, squared: bool = False) -> Tensor:
        """Run the kernels for the device on a batch, in units of water."""
        slices = array.reshape(-1, *array.shape[-2:]).float()
        slices = (slices if transpose else supported(slices, self.support)).contiguous()
        kernels = self._kernels(array.device)
        result = kernels.back_project(slices.flatten(1), squared=squared) if transpose else kernels.project(slices)
        answer = result * (self.mu_water**2 if squared else self.mu_water)
        shape = self.domain_shape if transpose else self.range_shape
        answer = answer.reshape(*array.shape[:-2], *shape).to(array.dtype)
        return supported(answer, self.support) if transpose else answer

    def _kernels(self, device: torch.device) -> Kernels:
        if device not in self._made:
            self._made[device] = self._make_kernels(device)
        return self._made[device]

    def _make_kernels(self, device: torch.device) -> Kernels:
        what = (
            ray_lines(self.grid, self.geometry, self.method),
            self.grid.shape,
            self.geometry.views * self.geometry.bins,
        )
        if device.type == "cpu":
            return CpuProjector(*what, self.support)
        if triton_runs_on(device):
            from pnpct.operators.triton_projector import TritonProjector

            return TritonProjector(*what, device)
        return TorchProjector(*what, device)
