import torch

from pnpct.comparison.candidates import plug_and_play
from pnpct.denoisers import TotalVariation
from pnpct.geometry import FanBeam, ImageGrid
from pnpct.operators import Projector
from pnpct.physics import DiagonalWeights, Sinogram
from pnpct.reconstruction import DAMPING, last_iterate, mean_iterate, reconstruct


def test_plug_and_play_is_the_mean_of_the_iterates_and_says_so(disk: torch.Tensor, grid: ImageGrid, geometry: FanBeam):
    A, denoise = Projector(grid, geometry), TotalVariation(0.05)
    y = A(disk)
    sinogram = Sinogram(y, DiagonalWeights(torch.exp(-y)))
    candidate = plug_and_play("pnp", "PnP", denoise, {}, iterations=3)
    mean, last = (
        reconstruct(sinogram, A, denoise, damping=DAMPING, iterations=3, result=each)
        for each in (mean_iterate, last_iterate)
    )
    assert torch.equal(candidate.make(sinogram, A), mean)
    assert not torch.allclose(mean, last, rtol=0, atol=1e-4)
    assert candidate.method.settings["result"] == "mean"
    assert candidate.method.settings["damping"] == DAMPING
