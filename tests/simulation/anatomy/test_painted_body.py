import math

import numpy as np
import pytest
import torch

from pnpct.geometry import ImageGrid
from pnpct.simulation.anatomy.painted_body import Layer, PaintedBody
from pnpct.simulation.anatomy.shapes import Shape, ellipsoid
from pnpct.simulation.anatomy.texture import Texture
from pnpct.simulation.anatomy.tissues import Tissue, blood

WATER, MUSCLE, AIR = (Tissue({name: 1.0}) for name in ("water", "muscle", "air"))


def ball(radius: float, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Shape:
    return ellipsoid((x, y, z), (radius, radius, radius))


def body(*layers: Layer, bending: dict[float, float] | None = None, seed: int = 0) -> PaintedBody:
    return PaintedBody(layers, -50.0, 50.0, seed, bending=bending or {})


def test_what_is_painted_last_lies_on_top_and_fractions_sum_to_1() -> None:
    both = Tissue({"water": 0.25, "muscle": 0.75})
    painted = body(Layer(ball(15.3), both), Layer(ball(5.2), WATER), Layer(ball(2.0, y=8.0), AIR, opacity=0.5))
    phantom = painted.slice(0.0, ImageGrid(40, 40, spacing=1.0))
    assert phantom.materials == ("air", "water", "muscle")
    assert phantom.fractions[:, 20, 20].tolist() == [0.0, 1.0, 0.0]
    assert phantom.fractions[:, 20, 30].tolist() == [0.0, 0.25, 0.75]
    assert phantom.fractions[:, 12, 20].tolist() == pytest.approx([0.5, 0.125, 0.375])
    assert phantom.fractions.sum(0).sub(1).abs().max() < 1e-6


@pytest.mark.parametrize(("z", "radius"), [(0.0, 10.0), (6.0, 8.0), (-8.0, 6.0), (10.5, 0.0)])
def test_slices_of_a_ball_are_discs(z: float, radius: float) -> None:
    phantom = body(Layer(ball(10.0), WATER)).slice(z, ImageGrid(100, 100, spacing=0.25))
    index = phantom.materials.index("water")
    assert phantom.fractions[index].sum().item() * 0.25**2 == pytest.approx(math.pi * radius**2, rel=0.01, abs=1e-6)


def test_what_is_outside_the_grid_is_not_painted() -> None:
    phantom = body(Layer(ball(5.0, x=100.0), WATER)).slice(0.0, ImageGrid(10, 10, spacing=1.0))
    assert phantom.fractions[1].sum() == 0


def test_slices_outside_the_extent_are_refused() -> None:
    with pytest.raises(ValueError, match="reaches from z = -50 to 50 mm, got 51"):
        body(Layer(ball(5.0), WATER)).slice(51.0, ImageGrid(10, 10, spacing=1.0))


def test_textures_have_their_variance_and_their_correlation_length_in_all_directions() -> None:
    grid = ImageGrid(400, 400, spacing=1.0)
    field = Texture(3, 0.0, grid).field(3.0)
    assert field.std() == pytest.approx(1.0, abs=0.05)
    # A kernel of s.d. σ gives the correlation exp(−d² / 4σ²).
    assert np.mean(field[:, 6:] * field[:, :-6]) == pytest.approx(math.exp(-1), abs=0.05)
    above = Texture(3, 6.0, grid).field(3.0)
    assert np.mean(above * field) == pytest.approx(math.exp(-1), abs=0.06)


def test_textures_are_the_same_on_every_grid_and_differ_by_seed_and_number() -> None:
    fine = Texture(1, 2.0, ImageGrid(400, 400, spacing=0.5)).field(4.0)
    coarse = Texture(1, 2.0, ImageGrid(200, 200, spacing=1.0)).field(4.0)
    between = fine.reshape(200, 2, 200, 2).mean(axis=(1, 3))
    assert np.corrcoef(coarse.ravel(), between.ravel())[0, 1] > 0.99
    grid = ImageGrid(200, 200, spacing=2.0)
    for other in (Texture(2, 2.0, grid).field(4.0), Texture(1, 2.0, grid).field(4.0, which=1)):
        assert abs(np.corrcoef(Texture(1, 2.0, grid).field(4.0).ravel(), other.ravel())[0, 1]) < 0.1


def test_bending_moves_outlines_by_the_given_distance() -> None:
    half = Shape(lambda x, y, z: x + 0 * y, (-200.0, -200.0, -1.0), (0.0, 200.0, 1.0))
    bent = body(Layer(half, WATER), bending={15.0: 2.0}).slice(0.0, ImageGrid(200, 200, spacing=2.0))
    edge = bent.fractions[1].sum(1).numpy() * 2.0
    assert 1.5 < edge.std() < 2.5


def test_a_tissue_varies_around_its_mean_and_its_fractions_sum_to_1() -> None:
    grid = ImageGrid(100, 100, spacing=1.0)
    phantom = body(Layer(ball(500.0), blood(0.4))).slice(0.0, grid)
    iodinated = phantom.fractions[phantom.materials.index("iodinated blood")]
    assert iodinated.mean().item() == pytest.approx(0.4, abs=0.005)
    assert 0.005 < iodinated.std().item() < 0.03
    torch.testing.assert_close(phantom.fractions.sum(0), torch.ones(grid.shape))


def test_gravity_makes_the_back_denser() -> None:
    lung = Tissue({"lung": 1.0}, {"air": 1.0}, share=0.4, gravity=0.001)
    phantom = body(Layer(ball(500.0), lung)).slice(0.0, ImageGrid(200, 4, spacing=1.0))
    air = phantom.fractions[0].mean(1)
    torch.testing.assert_close(air[[0, -1]], torch.tensor([0.4995, 0.3005]), rtol=0, atol=1e-4)
