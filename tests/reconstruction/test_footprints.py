import numpy as np
import pytest
import torch

from pnpct.geometry import FanBeam, ImageGrid, evenly_spaced_views
from pnpct.operators import Projector
from pnpct.physics import DiagonalWeights, Sinogram
from pnpct.reconstruction.factor_kernels import factorise
from pnpct.reconstruction.footprints import Footprints
from pnpct.reconstruction.one_step import normal_matrix
from pnpct.reconstruction.sparse_cholesky import inverse_factor

FAN = FanBeam(evenly_spaced_views(12), 45, source_to_isocenter=541.0, source_to_detector=949.0, bin_width=20.0)


@pytest.mark.parametrize("method", ["distance-driven", "joseph"])
@pytest.mark.parametrize(
    "grid",
    [
        ImageGrid(24, 24, spacing=16.0),
        ImageGrid(15, 22, spacing=12.0, center=(30.0, -9.0)),
        ImageGrid(9, 9, spacing=2.0),
    ],
)
def test_footprints_are_the_columns_of_the_projector(grid, method, generator):
    A = Projector(grid, FAN, method=method)
    x = torch.rand(grid.shape, generator=generator)
    expected = A(x).numpy()
    footprints = Footprints(A)
    for view in (0, 3, 7):
        first, weights = footprints.of_view(view)
        seen = np.zeros(FAN.bins + footprints.width)
        np.add.at(seen, first[:, None] + np.arange(footprints.width), weights * x.numpy().reshape(-1, 1))
        np.testing.assert_allclose(seen[: FAN.bins], expected[view], rtol=1e-4, atol=1e-4)


def test_a_wide_enough_factor_is_the_exact_inverse(generator):
    """With a radius beyond the image nothing is left out."""
    A = Projector(ImageGrid(8, 8, spacing=40.0), FAN)
    weights = 1 + torch.rand(FAN.shape, generator=generator)
    sinogram = Sinogram(torch.zeros(FAN.shape), DiagonalWeights(weights))
    beta = 50.0
    factor = inverse_factor(sinogram, A, beta, radius=20.0).toarray()
    matrix = normal_matrix(sinogram, A).numpy() + beta * np.eye(64)
    np.testing.assert_allclose(factor @ factor.T @ matrix, np.eye(64), atol=2e-3)


def test_a_narrow_factor_is_sparse_and_close(generator):
    A = Projector(ImageGrid(16, 16, spacing=24.0), FAN)
    sinogram = Sinogram(torch.zeros(FAN.shape), DiagonalWeights(torch.ones(FAN.shape)))
    matrix = normal_matrix(sinogram, A).numpy()
    beta = 0.3 * matrix.diagonal().mean()
    matrix += beta * np.eye(256)
    factor = inverse_factor(sinogram, A, float(beta))
    assert factor.nnz < 0.1 * matrix.size
    scaled = np.linalg.eigvalsh(factor.T @ matrix @ factor.toarray())
    assert scaled[-1] / scaled[0] < 0.2 * np.linalg.cond(matrix)


def test_of_a_matrix_that_is_not_positive_definite_the_diagonal_is_taken():
    matrices, values = (
        np.array([4.0, 6.0, 4.0, 4.0, 2.0, 4.0], np.float32),
        np.full(4, np.nan),
    )  # [4 6; 6 4], [4 2; 2 4]
    factorise(matrices, 0.0, np.array([0, 2, 4]), np.array([0, 3, 6]), values, 0, 2)
    np.testing.assert_allclose(values, [0.5, 0.0, 3**-0.5, -0.5 * 3**-0.5])


def test_a_radius_that_reaches_no_neighbour_is_refused():
    A = Projector(ImageGrid(8, 8, spacing=40.0), FAN)
    sinogram = Sinogram(torch.zeros(FAN.shape), DiagonalWeights(torch.ones(FAN.shape)))
    with pytest.raises(ValueError, match=r"at least 1, got 0.5"):
        inverse_factor(sinogram, A, 1.0, radius=0.5)
