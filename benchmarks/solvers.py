"""Count the inner iterations that each solver of the data step takes.

    python benchmarks/solvers.py [--quick]

One data step (AᵀWA + β) x = AᵀW y + β v from v, with v 18 HU of white noise away from the object; iterations until x
is 1 HU rms from the exact solution (dense Cholesky at 128 x 128, else 60 preconditioned steps). β is given twice, in
mean diagonals of AᵀWA over the object, as `mean_diagonal` has it, and over the whole circle that the fan sees: there
the rays through air raise the mean. The worlds: the CatSim chest at 40 mA, 512 x 512, 984 x 900; and a pelvis of
ellipses behind a bow-tie filter, 3e4 quanta per ray, at 128 x 128.
"""

import argparse
import time

import numpy as np
import torch
from torch import Tensor

from pnpct.arrays import Image
from pnpct.geometry import FanBeam, ImageGrid, evenly_spaced_views
from pnpct.operators import Projector
from pnpct.physics import Scan, Sinogram, simulate_counts, take_log
from pnpct.reconstruction import mean_diagonal
from pnpct.reconstruction.fourier import fourier_preconditioner
from pnpct.reconstruction.normal_equations import NormalOperator, Operator, conjugate_gradient
from pnpct.reconstruction.one_step import normal_matrix
from pnpct.reconstruction.sparse_cholesky import inverse_factor
from reference_scans import chest

MOST = 60


def pelvis(size: int) -> tuple[Sinogram, Projector, Image]:
    down = 512 // size
    geometry = FanBeam(
        evenly_spaced_views(984 // down // 4 * 4),
        900 // down,
        source_to_isocenter=541.0,
        source_to_detector=949.0,
        bin_width=1.0239 * down,
        detector_offset=0.25,
    )
    grid = ImageGrid(size, size, spacing=480 / size)
    x, y = grid.x[None], grid.y[:, None]
    body = (x / 180) ** 2 + (y / 120) ** 2 < 1
    hips = ((np.abs(x) - 100) / 30) ** 2 + (y / 30) ** 2 < 1
    image = torch.from_numpy(body + 0.8 * hips).float()
    A = Projector(grid, geometry)
    bow_tie = torch.from_numpy(3e4 * np.exp(-2 * (geometry.fan_angles / geometry.fan_angles.max()) ** 2)).float()
    counts = simulate_counts(A(image), bow_tie, electronic_noise=6.0, generator=torch.Generator().manual_seed(0))
    return take_log(Scan(counts, bow_tie, 6.0, geometry=geometry, mu_water=A.mu_water)), A, image


def catsim_chest() -> tuple[Sinogram, Projector, Image]:
    reference = chest("mA40_r0", 40)
    assert reference.truth is not None
    A = Projector(reference.grid, reference.scan.geometry, mu_water=reference.scan.mu_water)
    return take_log(reference.scan), A, reference.truth


def circle_mean(sinogram: Sinogram, A: Projector) -> Tensor:
    inside = np.hypot(A.grid.x, A.grid.y[:, None]) <= A.grid.cols * A.grid.spacing / 2
    return A.gram_diagonal(sinogram.weights.diagonal)[torch.from_numpy(inside)].mean()


def count(H: Operator, b: Image, start: Image, exact: Image, precondition: Operator | None) -> int | None:
    """Return the iterations until 1 HU rms: `conjugate_gradient` again, but looking at every x."""
    x, r = start, b - H(start)
    z = precondition(r) if precondition else r
    p, rz = z, (r * z).sum()
    for iterations in range(1, MOST + 1):
        Hp = H(p)
        step = rz / (p * Hp).sum()
        x, r = x + step * p, r - step * Hp
        if 1000 * float((x - exact).square().mean().sqrt()) < 1:
            return iterations
        z = precondition(r) if precondition else r
        rz, before = (r * z).sum(), rz
        p = z + rz / before * p
    return None


def compare(world: str, beta: float, *, over: str, factor: bool, dense: bool) -> None:
    sinogram, A, image = pelvis(128) if world == "pelvis 128" else catsim_chest()
    scale = mean_diagonal(sinogram, A) if over == "object" else circle_mean(sinogram, A)
    penalty, W = (beta * scale).reshape(1, 1), sinogram.weights
    H = NormalOperator(A, W, penalty)
    v = image + 0.018 * torch.randn(image.shape, generator=torch.Generator().manual_seed(1))
    b = A.T(W(sinogram.line_integrals)) + penalty * v
    fourier = fourier_preconditioner(sinogram, A)(penalty)
    if dense:
        matrix = normal_matrix(sinogram, A) + float(penalty) * torch.eye(image.numel()).double()
        solution = torch.cholesky_solve(b.double().reshape(-1, 1), torch.linalg.cholesky(matrix))
        exact = solution.reshape(image.shape).float()
    else:
        exact, _ = conjugate_gradient(H, b, v, H(v), iterations=MOST, precondition=fourier)
    results = {"cg": count(H, b, v, exact, None), "fourier": count(H, b, v, exact, fourier)}
    if factor:
        began = time.perf_counter()
        L = inverse_factor(sinogram, A, float(penalty))
        seconds = time.perf_counter() - began
        apply = lambda r: torch.from_numpy(L @ (L.T @ r.double().numpy().ravel())).reshape(r.shape).float()  # noqa: E731
        results[f"cholesky (factor in {seconds:.0f} s)"] = count(H, b, v, exact, apply)
    counts = ", ".join(f"{name} {number or f'> {MOST}'}" for name, number in results.items())
    print(f"| {world} | {beta} of the {over} | {counts} |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="leave out the chest")
    quick = parser.parse_args().quick
    print("| world | beta | iterations to 1 HU |\n|---|---|---|")
    for over in ("object", "circle"):
        for beta in (1.2, 0.12):
            compare("pelvis 128", beta, over=over, factor=True, dense=True)
    if not quick:
        for over in ("object", "circle"):
            compare("chest 512", 1.2, over=over, factor=False, dense=False)


if __name__ == "__main__":
    main()
