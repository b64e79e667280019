"""What the loop asks the device for: on a GPU each answer makes the host wait."""

import torch
from torch.utils._python_dispatch import TorchDispatchMode

from pnpct.denoisers import Gaussian
from pnpct.operators import Projector
from pnpct.operators.ray_lines import ray_lines
from pnpct.operators.torch_projector import TorchProjector
from pnpct.physics import DiagonalWeights, Sinogram
from pnpct.reconstruction.methods import PlugAndPlay
from pnpct.reconstruction.pnp_admm import ADMMState
from pnpct.reconstruction.stopping import until


class Reads(TorchDispatchMode):
    """Counts the operations whose answer is a number or a size that the host needs."""

    def __init__(self):
        super().__init__()
        self.number = 0

    def __torch_dispatch__(self, function, types, args=(), kwargs=None):
        masks = function is torch.ops.aten.index.Tensor and any(
            i is not None and i.dtype is torch.bool for i in args[1]
        )
        if masks or function.overloadpacket in (
            torch.ops.aten._local_scalar_dense,
            torch.ops.aten.equal,
            torch.ops.aten.nonzero,
        ):
            self.number += 1
        return function(*args, **(kwargs or {}))


class CountingProjector(TorchProjector):
    projections = 0

    def project(self, images):
        CountingProjector.projections += 1
        return super().project(images)


def test_an_iteration_reads_a_few_numbers_from_the_device(geometry, grid, disk, generator, monkeypatch):
    what = ray_lines(grid, geometry, "distance-driven"), grid.shape, geometry.views * geometry.bins
    monkeypatch.setattr(Projector, "_make_kernels", lambda A, device: CountingProjector(*what, device))
    A = Projector(grid, geometry)
    y = A(disk)
    weights = 1e4 * torch.exp(-y)
    y = y + torch.randn(y.shape, generator=generator) / weights.sqrt()
    start = ADMMState.start(torch.zeros(grid.shape))
    states = PlugAndPlay(Gaussian(1.0)).states(Sinogram(y, DiagonalWeights(weights, geometry.shape)), A, start)
    iterates = until(states, start, A, iterations=5, stop="relative")
    next(iterates)  # prepares the solver too
    for _ in range(4):
        CountingProjector.projections = 0
        with Reads() as reads:
            next(iterates)
        # Whether σ_v is possible, and the same as before; whether the iterates are bounded, and settled; two of the
        # preconditioner and its mask, where σ_v changed; and after the second step of the solver whether to go on.
        assert reads.number <= 4 + 3 + max(CountingProjector.projections - 1, 0)
