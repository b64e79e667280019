"""Where an image lacks or has invented a disc, as the data say; the truth is not needed."""

import math
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from pnpct.arrays import Image
from pnpct.evaluation.data.disc_information import disc_information, disc_template, sum_around
from pnpct.evaluation.data.realisations import Reconstruct, check_corrected, parametric_bootstrap
from pnpct.evaluation.image.regions import Mask
from pnpct.geometry import ImageGrid
from pnpct.geometry.short_repr import short_repr
from pnpct.operators import Projector
from pnpct.physics import Sinogram

VERIFIABLE = 4.0
"""Contrast, in standard deviations, that stands out from the noise anywhere in an image."""


@dataclass(frozen=True)
class Finding:
    """The place of an image that the data object to most.

    Args:
        t: Of the score test there, standard deviations.
        missing_hu: Contrast of the disc that the image lacks there, HU; negative if it has too much.
        verifiable_hu: The least contrast that the data can tell there, HU.
        position: x and y of the place, mm.
    """

    t: float
    missing_hu: float
    verifiable_hu: float
    position: tuple[float, float]


@dataclass(frozen=True, eq=False)
class ScoreTest:
    """Maps of what discs the image lacks; every pixel is the centre of one.

    Args:
        t: T, standard normal for the truth; 0 where the disc is not wholly on the image or no ray goes.
        missing_hu: Contrast that the data want to be added, HU: positive where structure was removed, negative
            where it was invented; 0 as above.
        verifiable_hu: The least contrast that the data can confirm or deny, HU; infinite where T is 0 as above.
        diameter: Of the disc, mm.
        grid: Where the pixels are.
    """

    t: Float[Tensor, "rows cols"]
    missing_hu: Float[Tensor, "rows cols"]
    verifiable_hu: Float[Tensor, "rows cols"]
    diameter: float
    grid: ImageGrid

    __repr__ = short_repr

    @property
    def strongest(self) -> Finding:
        """Where |T| is largest in the whole image."""
        return self.strongest_within(torch.ones_like(self.t, dtype=torch.bool))

    def strongest_within(self, mask: Mask) -> Finding:
        """Return where |T| is largest within a mask.

        Raises:
            ValueError: If the mask is for other pixels or empty.
        """
        if mask.shape != self.t.shape or not bool(mask.any()):
            raise ValueError(
                f"A mask of {tuple(self.t.shape)} pixels with at least one that counts is needed, got "
                f"{tuple(mask.shape)} with {int(mask.sum())}."
            )
        row, col = divmod(int(torch.where(mask, self.t.abs(), -1.0).argmax()), self.grid.cols)
        t, missing, verifiable = (float(each[row, col]) for each in (self.t, self.missing_hu, self.verifiable_hu))
        return Finding(t, missing, verifiable, position=(float(self.grid.x[col]), float(self.grid.y[row])))


def score_test(
    image: Float[Tensor, "rows cols"],
    sinogram: Sinogram,
    projector: Projector,
    *,
    diameter: float = 8.0,
    floor: float = 1.0,
    information: Float[Tensor, "_ _"] | None = None,
) -> ScoreTest:
    """Ask the data, at every pixel, whether a disc should be added to the image there or taken away.

    With s a disc of 1 HU, q = A s and r = y − A x,

        T = qᵀW r / √(qᵀW q),     missing = qᵀW r / qᵀW q,     verifiable = 4 / √(qᵀW q).

    For the truth T is standard normal at each place; its largest value in an image is then about 4, and rarely above
    5. For an image that was made from the same data T is smaller, since the fit follows the noise: get its threshold
    from `score_threshold`, or reconstruct one half of the views and test on the other (`split_views`). There the noise
    of the image adds to that of the data, and T is larger.

    It is evidence against discs of one size that were added or removed, not a proof that nothing else was. Below the
    verifiable contrast the data neither confirm nor deny a disc: show that map with every image. Test 4, 8 and 12 mm.

    Args:
        image: One slice, attenuation relative to water.
        sinogram: Its data; weights are inverse variances, or `floor` says how far they are from it.
        projector: A.
        diameter: Of the disc, mm, at least one pixel.
        floor: chi2 of a trusted image on the same data, see `consistency`; the noise is taken to be √floor larger.
        information: qᵀW q as `disc_information` gives it for the same data and disc; computed if None. It takes most
            of the time, and many images of one scan can share it.

    Returns:
        The maps. qᵀW r is exact, qᵀW q within 6 % (see `disc_information`), so T and the contrasts within 3 %. It
        takes about 7 s on one core for 512 × 512 pixels, 984 views and 900 bins.

    Raises:
        ValueError: If the image or the information is not on the projector's grid, there are several slices, or a
            number is out of its range.

    References:
        Rao, Proc. Camb. Philos. Soc. 44 (1948) 50: score tests.
    """
    _check(image, sinogram, projector, diameter, floor)
    if information is None:
        information = disc_information(sinogram.weights, projector, diameter)
    elif information.shape != image.shape:
        raise ValueError(
            f"The information needs a number for each of {tuple(image.shape)} pixels, got {tuple(information.shape)}."
        )
    return _scored(image, sinogram, projector, information / floor, diameter=diameter, floor=floor)


def score_threshold(
    reconstruct: Reconstruct,
    image: Float[Tensor, "rows cols"],
    sinogram: Sinogram,
    projector: Projector,
    *,
    generator: torch.Generator,
    diameter: float = 8.0,
    mask: Mask | None = None,
    realisations: int = 40,
    level: float = 0.95,
) -> float:
    """Return the |T| that this reconstruction exceeds somewhere with a small probability if its image is right.

    Data are drawn as if the image were the object, reconstructed again and tested (`parametric_bootstrap`). Above the
    threshold, the image has left the data where this reconstruction usually does not.

    Args:
        reconstruct: The reconstruction that made the image.
        image: One slice, attenuation relative to water.
        sinogram: Its data, with inverse variances as weights.
        projector: A.
        generator: Source of the noise, on the device of the image.
        diameter: Of the disc, mm.
        mask: Where |T| is looked at; everywhere if None.
        realisations: At least 2; each costs a reconstruction. The 95 % quantile needs 40 or more.
        level: Probability to stay below, between 0 and 1.

    Returns:
        The quantile of max |T|.

    Raises:
        ValueError: If a number is out of its range, the mask is empty, or the noise of the rays is correlated.
    """
    _check(image, sinogram, projector, diameter, 1.0)
    if realisations < 2 or not 0 < level < 1:
        raise ValueError(
            f"A threshold needs two realisations or more and a level between 0 and 1, got {realisations} and {level}."
        )
    mask = torch.ones_like(image, dtype=torch.bool) if mask is None else mask
    information = disc_information(sinogram.weights, projector, diameter)
    draws = parametric_bootstrap(
        reconstruct, image, sinogram, projector, realisations=realisations, generator=generator
    )
    largest = []
    for draw in draws:
        test = _scored(draw.image, draw.sinogram, projector, information, diameter=diameter, floor=1.0)
        largest.append(abs(test.strongest_within(mask).t))
    return float(np.quantile(largest, level))


def _check(image: Image, sinogram: Sinogram, projector: Projector, diameter: float, floor: float) -> None:
    if tuple(image.shape) != projector.grid.shape or sinogram.line_integrals.ndim != 2:
        raise ValueError(
            f"One slice of {projector.grid.shape} pixels and its data are tested, got {tuple(image.shape)} pixels and "
            f"rays of the shape {tuple(sinogram.line_integrals.shape)}."
        )
    if not (math.isfinite(diameter) and diameter >= projector.grid.spacing):
        raise ValueError(
            f"The disc needs a diameter of at least one pixel ({projector.grid.spacing:g} mm), got {diameter} mm."
        )
    if not (math.isfinite(floor) and floor > 0):
        raise ValueError(f"The floor is the chi2 of a trusted image, a positive number, got {floor}.")


def _scored(
    image: Tensor, sinogram: Sinogram, projector: Projector, information: Tensor, *, diameter: float, floor: float
) -> ScoreTest:
    check_corrected(sinogram)
    grid = projector.grid
    back = projector.T(sinogram.weights(sinogram.line_integrals - projector(image)))
    score = sum_around(back, disc_template(diameter, grid.spacing)) / 1000 / floor
    seen = information > 0
    deviation = torch.where(seen, information, 1.0).rsqrt()
    return ScoreTest(
        t=torch.where(seen, score * deviation, 0.0),
        missing_hu=torch.where(seen, score * deviation.square(), 0.0),
        verifiable_hu=torch.where(seen, VERIFIABLE * deviation, torch.inf),
        diameter=diameter,
        grid=grid,
    )
