"""What a reconstruction must do to shifted values and turned objects, whatever its prior."""

from functools import partial

import pytest
import torch
from low_dose_slice import low_dose_slice

from pnpct.denoisers import TotalVariation
from pnpct.evaluation import Reconstruct, parametric_bootstrap
from pnpct.physics import DiagonalWeights, Sinogram
from pnpct.reconstruction import fbp, reconstruct

SLICE = low_dose_slice()
DATA = SLICE.sinogram()
DEEP = SLICE.inside & (torch.nn.functional.avg_pool2d(SLICE.inside.float()[None], 9, 1, 4)[0] == 1)
"""Inside the body, away from its skin."""


def by_fbp(sinogram: Sinogram) -> torch.Tensor:
    return fbp(sinogram.line_integrals, SLICE.projector, kernel="soft")


def by_tv(sinogram: Sinogram) -> torch.Tensor:
    denoise = TotalVariation(strength=0.02)
    return reconstruct(sinogram, SLICE.projector, denoise, iterations=6, stop="never")


each = partial(pytest.mark.parametrize, "of", [by_fbp, by_tv])


@each()
def test_20_hu_more_in_the_body_are_20_hu_more_in_the_image(of: Reconstruct) -> None:
    """The projection of 20 HU over the whole body comes back as 20 HU."""
    body = (SLICE.truth > 0).float()
    offset = Sinogram(DATA.line_integrals + SLICE.projector(0.02 * body), DATA.weights)
    assert 1000 * float((of(offset) - of(DATA))[DEEP].mean()) == pytest.approx(20.0, abs=1.0)


@each()
def test_a_turned_object_gives_the_turned_image(of: Reconstruct) -> None:
    """Views begun a quarter of a turn later are the scan of an object that is turned back by as much.

    The difference stays below half the standard deviation of the image.
    """
    quarter = SLICE.projector.geometry.views // 4
    turned = Sinogram(DATA.line_integrals.roll(-quarter, 0), DiagonalWeights(DATA.weights.diagonal.roll(-quarter, 0)))
    image = of(DATA)
    difference = (of(turned) - torch.rot90(image, -1))[torch.rot90(DEEP, -1)]
    draws = parametric_bootstrap(
        of, image, DATA, SLICE.projector, realisations=3, generator=torch.Generator().manual_seed(1)
    )
    noise = torch.stack([draw.image for draw in draws]).var(dim=0)[DEEP].mean().sqrt()
    assert float(difference.square().mean().sqrt()) <= float(noise) / 2
