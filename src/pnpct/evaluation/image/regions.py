"""Where in an image the errors are counted."""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
import torch
from jaxtyping import Bool
from numpy.typing import NDArray
from scipy import ndimage
from torch import Tensor

from pnpct.arrays import Image
from pnpct.units import to_hu

Mask: TypeAlias = Bool[Tensor, "*batch rows cols"]
"""True where a pixel counts."""


def body_mask(reference: Image, *, threshold_hu: float = -500.0, opening: int = 3) -> Mask:
    """Return the mask of the patient: what is denser than lung, in one piece, with its holes filled.

    In each slice the pixels above the threshold are opened, so that a table that touches the skin comes off;
    the largest connected piece and everything it encloses (lungs, bowel gas) is the body.

    Args:
        reference: Attenuation relative to water; the truth, or the best image there is.
        threshold_hu: Between air and fat, HU.
        opening: Radius of the opening disc in pixels, ≥ 0; thinner things are no body.

    Returns:
        The mask; empty in slices where nothing is above the threshold.

    Example:
        >>> body_mask(torch.ones(8, 8), opening=0).all()
        tensor(True)
    """
    return _slice_by_slice(lambda hu: _largest_piece(_opened(hu > threshold_hu, opening)), reference)


def soft_tissue_mask(reference: Image, *, low_hu: float = -200.0, high_hu: float = 200.0, margin: int = 3) -> Mask:
    """Return the mask of fat, muscle, blood and organs in the body, away from edges to lung, air and bone.

    A pixel counts if it is in the body and everything nearer than `margin` pixels is between the limits:
    partial volume and ringing at the large edges are another quantity than the error in the tissue. Edges
    between soft tissues stay in. A noisy reference should be smoothed before: noise that reaches the limits
    eats holes.

    Args:
        reference: Attenuation relative to water; the truth, or the best image there is.
        low_hu: Lower limit, HU; fat is at −100.
        high_hu: Upper limit, HU; trabecular bone begins here.
        margin: Distance from what is outside the limits, pixels, ≥ 0.

    Returns:
        The mask; empty where there is no such tissue.
    """

    def soft(hu: NDArray[np.float64]) -> NDArray[np.bool_]:
        between = (hu > low_hu) & (hu < high_hu)
        deep: NDArray[np.bool_] = ndimage.distance_transform_edt(between) > margin
        return deep & between

    inside = _slice_by_slice(soft, reference)
    return inside & body_mask(reference)


def _slice_by_slice(region: Callable[[NDArray[np.float64]], NDArray[np.bool_]], reference: Image) -> Mask:
    slices = to_hu(reference.detach().double()).reshape(-1, *reference.shape[-2:]).cpu().numpy()
    masks = np.stack([region(one) for one in slices])
    return torch.from_numpy(masks).reshape(reference.shape).to(reference.device)


def _opened(mask: NDArray[np.bool_], radius: int) -> NDArray[np.bool_]:
    offsets = np.arange(-radius, radius + 1)
    disc = offsets[:, None] ** 2 + offsets**2 <= radius**2
    # The image continues as it is at its border: a patient who reaches it is not eroded there.
    padded = np.pad(mask, radius, mode="edge")
    opened: NDArray[np.bool_] = ndimage.binary_opening(np.pad(padded, radius, mode="edge"), disc)
    inner = slice(2 * radius, -2 * radius or None)
    return opened[inner, inner]


def _largest_piece(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    pieces, found = ndimage.label(mask)
    if found == 0:
        return mask
    largest = 1 + int(np.argmax(np.bincount(pieces.ravel())[1:]))
    filled: NDArray[np.bool_] = ndimage.binary_fill_holes(pieces == largest)
    return filled
