"""FBP where source and detector are shifted beside the axis of rotation, as by TIGRE's COR and LEAP's tau."""

import numpy as np
import pytest
import torch

from pnpct.files import read_geometry
from pnpct.geometry import ImageGrid
from pnpct.operators import Projector
from pnpct.reconstruction import fbp

BINS, WIDTH, SOURCE, BEYOND, MU = 240, 1.6, 500.0, 400.0, 0.02
DISC, RADIUS = 60 + 35j, 30.0
GRID = ImageGrid(240, 240, spacing=0.8)


def tigre(shift: float, angles: np.ndarray):
    """Its words, and its source at angle 0 at +x with the cells, complex numbers."""
    words = {"DSO": SOURCE, "DSD": SOURCE + BEYOND, "nDetector": [1, BINS], "dDetector": [1, WIDTH]}
    cells = -BEYOND + 1j * (WIDTH * (np.arange(BINS) - (BINS - 1) / 2) + shift)
    return {**words, "angles": angles.tolist(), "offDetector": [0, 0.0], "COR": shift}, SOURCE + 1j * shift, cells


def leap(shift: float, angles: np.ndarray):
    """Likewise; source and cells are those of its formula, f(Rθ − τθ⊥ − l (θ − uθ⊥) / √(1 + u²))."""
    words = {"sod": SOURCE, "sdd": SOURCE + BEYOND, "numCols": BINS, "pixelWidth": WIDTH, "centerCol": (BINS - 1) / 2}
    slope = (np.arange(BINS) - (BINS - 1) / 2) * WIDTH / (SOURCE + BEYOND)
    source = SOURCE - 1j * shift
    cells = source - (SOURCE + BEYOND) * (1 - 1j * slope)
    return {**words, "phis": np.degrees(angles).tolist(), "tau": shift}, -1j * source, -1j * cells


def image_of(words, source, cells, angles: np.ndarray) -> np.ndarray:
    """FBP of the line integrals of a disc of water."""
    turn = np.exp(1j * angles)[:, None]
    along = (cells - source) * turn
    beside = np.imag(np.conj(along) * (DISC - source * turn)) / np.abs(along)
    line_integrals = 2 * MU * np.sqrt(np.maximum(RADIUS**2 - beside**2, 0))
    written = read_geometry(words)
    line_integrals = line_integrals[:, ::-1].copy() if written.bins_reversed else line_integrals
    A = Projector(GRID, written.geometry, mu_water=MU)
    return fbp(torch.tensor(line_integrals, dtype=torch.float32), A).numpy()


@pytest.mark.parametrize("peer", [tigre, leap])
@pytest.mark.parametrize("shift", [0.0, 3.0, -8.0])
@pytest.mark.parametrize("degrees", [360, 240])
def test_a_disc_is_where_it_was(peer, shift, degrees):
    """The wrong shift only blurs the disc in a full turn, and displaces it in a part of one."""
    angles = np.radians(np.arange(0, degrees, 2) + 17)
    image = image_of(*peer(shift, angles), angles)
    place = GRID.x[None] + 1j * GRID.y[:, None]
    disc = np.clip(image, 0.2, 0.8) - 0.2
    centre = (disc * place).sum() / disc.sum()
    assert abs(centre - DISC) < 0.1, centre
    inside = 1000 * (image[np.abs(place - DISC) < 0.8 * RADIUS] - 1)
    assert abs(inside.mean()) < 5
    assert inside.std() < 15
