import math

import pytest
import torch

from pnpct.physics import BandedWeights, DiagonalWeights

VIEWS, BINS = 3, 7


@pytest.fixture
def covariance(generator):
    """Crosstalk of 10 % into each neighbour; what lies beyond the last bin is not a number."""
    mix = torch.eye(BINS, dtype=torch.float64) * 0.8 + 0.1 * (
        torch.ones(BINS - 1, dtype=torch.float64).diag(1) + torch.ones(BINS - 1, dtype=torch.float64).diag(-1)
    )
    counts = 10 + 90 * torch.rand(VIEWS, BINS, generator=generator, dtype=torch.float64)
    dense = mix @ torch.diag_embed(counts) @ mix.T + 9.0 * torch.eye(BINS, dtype=torch.float64)
    bands = torch.full((VIEWS, 3, BINS), math.nan, dtype=torch.float64)
    for band in range(3):
        bands[:, band, : BINS - band] = dense.diagonal(band, -2, -1)
    return dense, bands


@pytest.fixture(params=["diagonal", "banded"])
def weights(request, covariance, generator):
    if request.param == "banded":
        return BandedWeights(covariance[1])
    return DiagonalWeights(torch.rand(VIEWS, BINS, generator=generator, dtype=torch.float64))


@pytest.fixture
def rays(generator):
    return torch.randn(2, VIEWS, BINS, generator=generator, dtype=torch.float64)


def test_weights_are_their_own_adjoint(weights, rays):
    x, y = rays
    torch.testing.assert_close((weights(x) * y).sum(), (x * weights.T(y)).sum())
    torch.testing.assert_close(weights.adjoint(y), weights(y))
    assert weights.T.T is weights


def test_whitening_twice_is_weighting(weights, rays):
    x, y = rays
    torch.testing.assert_close((weights.whiten(x) * weights.whiten(y)).sum(), (x * weights(y)).sum())


def test_the_diagonal_is_what_unit_rays_feel(weights):
    units = torch.eye(VIEWS * BINS, dtype=torch.float64).reshape(-1, VIEWS, BINS)
    felt = (weights(units) * units).sum(0)
    torch.testing.assert_close(weights.diagonal, felt)


def test_a_batch_of_rays_is_weighted_slice_by_slice(weights, rays):
    torch.testing.assert_close(weights(rays[None]), torch.stack([weights(x) for x in rays])[None])


def test_single_precision_stays_single(weights, rays):
    assert weights.whiten(rays.float()).shape == rays.shape
    torch.testing.assert_close(weights(rays.float()).double(), weights(rays), rtol=1e-4, atol=1e-5)


def test_rays_of_another_detector_are_refused(weights):
    with pytest.raises(ValueError, match=r"end in \(3, 7\), got \(3, 6\)"):
        weights(torch.ones(VIEWS, BINS - 1))


def test_diagonal_weights_multiply_and_keep_their_diagonal(rays):
    values = torch.rand(2, VIEWS, BINS, dtype=torch.float64)
    weights = DiagonalWeights(values)
    torch.testing.assert_close(weights(rays), values * rays)
    assert weights.diagonal is values


def test_a_diagonal_weight_of_zero_leaves_its_ray_out():
    weights = DiagonalWeights(torch.tensor([[0.0, 2.0]]))
    assert weights(torch.full((1, 2), 5.0)).tolist() == [[0.0, 10.0]]


def test_banded_weights_are_the_dense_inverse(covariance, rays):
    dense, bands = covariance
    expected = torch.linalg.solve(dense, rays[..., None])[..., 0]
    torch.testing.assert_close(BandedWeights(bands)(rays), expected)


@pytest.mark.parametrize("bands", [1, 2, BINS])
def test_banded_weights_are_right_with_any_number_of_bands(generator, bands):
    root = torch.randn(VIEWS, BINS, BINS, generator=generator, dtype=torch.float64)
    dense = (root @ root.mT + BINS**2 * torch.eye(BINS, dtype=torch.float64)).triu(1 - bands).tril(bands - 1)
    packed = torch.zeros(VIEWS, bands, BINS, dtype=torch.float64)
    for band in range(bands):
        packed[:, band, : BINS - band] = dense.diagonal(band, -2, -1)
    weights = BandedWeights(packed)
    torch.testing.assert_close(weights.diagonal, torch.linalg.inv(dense).diagonal(dim1=-2, dim2=-1))
    rays = torch.randn(VIEWS, BINS, generator=generator, dtype=torch.float64)
    torch.testing.assert_close(weights(rays), torch.linalg.solve(dense, rays[..., None])[..., 0])


def test_whitened_noise_has_covariance_one(covariance, generator):
    dense, bands = covariance
    noise = torch.randn(20_000, VIEWS, BINS, generator=generator, dtype=torch.float64)
    coloured = (torch.linalg.cholesky(dense) @ noise[..., None])[..., 0]
    white = BandedWeights(bands).whiten(coloured)
    for view in range(VIEWS):
        torch.testing.assert_close(white[:, view].T.cov(), torch.eye(BINS, dtype=torch.float64), rtol=0, atol=0.05)


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ([[1.0, -1.0]], "1 of 2 are not"),
        ([[math.nan, math.inf]], "2 of 2 are not"),
        ([[0.0, 0.0]], "all are zero"),
    ],
)
def test_weights_that_weigh_nothing_are_refused(values, sentence):
    with pytest.raises(ValueError, match=sentence):
        DiagonalWeights(torch.tensor(values))


def test_a_covariance_that_is_not_positive_definite_is_refused_with_its_view(covariance):
    bands = covariance[1].clone()
    bands[1, 1, 4] = 1e3
    with pytest.raises(ValueError, match="that of view 1 is not, from bin 5 on"):
        BandedWeights(bands)


def test_broken_covariances_are_refused(covariance):
    bands = covariance[1].clone()
    bands[0, 0, 0] = math.inf
    with pytest.raises(ValueError, match="must be finite"):
        BandedWeights(bands)
    with pytest.raises(ValueError, match="2 bins has 1 to 2 bands, got 3"):
        BandedWeights(torch.ones(1, 3, 2))
