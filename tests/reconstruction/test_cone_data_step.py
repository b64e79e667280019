import torch

from cone_worlds import HELIX, PLANE
from pnpct.geometry import VolumeGrid
from pnpct.operators import ConeProjector
from pnpct.physics import DiagonalWeights
from pnpct.reconstruction.normal_equations import NormalOperator, conjugate_gradient


def test_the_normal_equations_of_a_volume_are_solved_by_conjugate_gradients(generator):
    A = ConeProjector(VolumeGrid(PLANE, 10, 7.0), HELIX)
    weights = torch.rand(A.range_shape, generator=generator) + 0.1
    W = DiagonalWeights(weights, A.range_shape)
    beta = A.T(W(A(torch.ones(A.domain_shape)))).mean()
    H = NormalOperator(A, W, beta)
    volume = torch.rand(A.domain_shape, generator=generator)
    b, nothing = H(volume), torch.zeros(A.domain_shape)
    diagonal = A.gram_diagonal(weights) + beta
    plain, _ = conjugate_gradient(H, b, nothing, nothing, iterations=10)
    preconditioned, _ = conjugate_gradient(
        H, b, nothing, nothing, iterations=10, precondition=lambda image: image / diagonal
    )
    torch.testing.assert_close(plain, volume, rtol=0, atol=0.02)
    torch.testing.assert_close(preconditioned, volume, rtol=0, atol=0.02)
