"""Reconstruct the reference chest of 32 detector rows by filtered back-projection of planes, and measure what is lost.

    python benchmarks/helical.py [--plane-spacing 0.3125] [--no-noise] [--axial]

The line integrals are those of 69 keV without noise, the kernel is hann. Printed are

- the error of soft tissue (-100 to 150 HU over five slices, five pixels from anything else) against the truth, of the
  helix by tilted planes and by single-slice rebinning, and of the axial scan (alone with --axial) by the distance from
  its middle, by horizontal planes and by Feldkamp's method;
- peak, width and place along z of discs of 800 HU, 0.625 mm thick, at three distances from the axis;
- the standard deviation of the noise at 100 mA in the rays of planes, each over the one that its weight says.
"""

import argparse
import math
import time
from collections.abc import Callable

import numpy as np
import torch
from scipy.ndimage import binary_erosion

from pnpct.geometry import ConeBeam, TiltedPlanes, VolumeGrid
from pnpct.operators import ConeProjector
from pnpct.physics import DiagonalWeights, Sinogram
from pnpct.reconstruction import FBP, covered_slices, rebin, reconstruct_volume
from reference_scans import ReferenceCone, chest_rows

MARGIN = 5
"""Pixels between soft tissue and anything else."""


def covered(reference: ReferenceCone, rebinning: str) -> tuple[VolumeGrid, np.ndarray]:
    """The slices of the truth that are covered, and their numbers in it."""
    low, high = covered_slices(TiltedPlanes(reference.geometry, rebinning), reference.grid.plane)
    numbers = np.flatnonzero((reference.grid.heights >= low) & (reference.grid.heights <= high))
    z = float(reference.grid.heights[numbers].mean())
    return VolumeGrid(reference.grid.plane, len(numbers), reference.grid.slice_spacing, z), numbers


def volume_hu(reference: ReferenceCone, grid: VolumeGrid, **options: object) -> np.ndarray:
    slabs = reconstruct_volume(
        uniform(reference.line_integrals), reference.geometry, grid, FBP("hann"), mu_water=reference.mu_water, **options
    )
    return torch.cat([slab.image for slab in slabs]).sub(1).mul(1000).numpy()


def uniform(line_integrals: torch.Tensor) -> Callable[[list[int]], Sinogram]:
    def rays(views: list[int]) -> Sinogram:
        values = line_integrals[views]
        return Sinogram(values, DiagonalWeights(torch.ones_like(values), tuple(values.shape)))

    return rays


def soft_tissue_errors(reference: ReferenceCone, image_hu: np.ndarray, numbers: np.ndarray) -> np.ndarray:
    """Root mean square of each slice, HU."""
    soft = (reference.truth_hu > -100) & (reference.truth_hu < 150)
    errors = []
    for image, number in zip(image_hu, numbers, strict=True):
        mask = binary_erosion(soft[max(number - 2, 0) : number + 3].all(0), iterations=MARGIN)
        errors.append(math.sqrt(np.square(image - reference.truth_hu[number])[mask].mean()))
    return np.array(errors)


def discs(reference: ReferenceCone, **options: object) -> None:
    """Print the profiles along z of the thin discs, sampled five times as finely as the slices of the truth."""
    plane, spacing = reference.grid.plane, reference.grid.slice_spacing
    for x, y, z, _, _, radius, _ in reference.content["modules"]:
        grid = VolumeGrid(plane, 49, spacing / 5, float(z))
        inside = np.hypot(plane.x[None] - x, plane.y[:, None] - y) < radius - 3
        profile = volume_hu(reference, grid, **options)[:, inside].mean(1)
        away = grid.heights - z
        profile -= np.median(profile[np.abs(away) > 2])
        fine = np.linspace(away[0], away[-1], 10001)
        above = fine[np.interp(fine, away, profile) > profile.max() / 2]
        print(
            f"| {math.hypot(x, y):.0f} mm | {profile.max():.0f} | {np.ptp(above):.2f} "
            f"| {(profile * away).sum() / profile.sum():.3f} |"
        )


def noise_scores(reference: ReferenceCone, tube_current_ma: float = 100.0, draws: int = 2) -> tuple[float, float]:
    """Standard deviation of the noise over the expected one, with the weights carried and with interpolated ones."""
    content, reader, rng = reference.content, reference.reader, np.random.default_rng(1)
    planes = TiltedPlanes(reference.geometry)
    stack = planes.stack_at(0.2)
    views = planes.views(stack)
    cone: ConeBeam = reference.geometry[views]
    variance = torch.from_numpy(np.stack([reader["variance"](content, view, tube_current_ma) for view in views]))
    clean = np.stack([content["clean"][view] for view in views])
    noise = [
        np.stack([reader["line_integrals"](content, view, tube_current_ma, rng) for view in views]) - clean
        for _ in range(draws)
    ]
    noisy = torch.from_numpy(np.stack(noise)).float()
    rays = rebin(Sinogram(noisy, DiagonalWeights(1 / variance.float(), cone.shape)), cone, stack.planes)
    interpolated = rebin(
        Sinogram(variance.float(), DiagonalWeights(torch.ones(cone.shape), cone.shape)), cone, stack.planes
    )
    measured = rays.weights.diagonal > 0
    scores = rays.weights.whiten(rays.line_integrals)[..., measured]
    naive = (rays.line_integrals / interpolated.line_integrals.sqrt())[..., measured]
    return float(scores.std()), float(naive.std())


def axial_scan() -> None:
    """Print errors of an axial scan by the distance from its middle, mean and worst slice, and peaks of thin discs."""
    axial = chest_rows("axial")
    grid, numbers = covered(axial, "tilted")
    began = time.process_time()
    planes = volume_hu(axial, grid)
    between = time.process_time()
    A = ConeProjector(grid, axial.geometry, mu_water=axial.mu_water)
    feldkamp = (FBP("hann")(uniform(axial.line_integrals)(range(axial.geometry.views)), A).image - 1).mul(1000).numpy()
    seconds = (between - began, time.process_time() - between)
    errors = [soft_tissue_errors(axial, image_hu, numbers) for image_hu in (planes, feldkamp)]
    print("| axial scan, mm from the middle | planes, HU: mean, worst slice | Feldkamp |\n|---|---|---|")
    for low in range(0, 10, 2):
        ring = (np.abs(grid.heights) >= low) & (np.abs(grid.heights) < low + 2)
        if ring.any():
            print(f"| {low} to {low + 2} |" + "".join(f" {e[ring].mean():.1f}, {e[ring].max():.1f} |" for e in errors))
    for x, y, z, _, height, radius, _ in axial.content["modules"]:
        inside = np.hypot(grid.plane.x[None] - x, grid.plane.y[:, None] - y) < radius - 3
        of_module = np.abs(grid.heights - z) < height / 2 - 1
        profiles = [image_hu[of_module][:, inside].mean(1) for image_hu in (planes, feldkamp)]
        peaks = "".join(f" {profile.max() - np.median(profile):.0f} |" for profile in profiles)
        print(f"| disc at {math.hypot(x, y):.0f} mm, z = {z:.1f} mm: peak of 800 HU |{peaks}")
    print("| CPU s per slice |" + "".join(f" {total / grid.slices:.2f} |" for total in seconds))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--plane-spacing", type=float)
    parser.add_argument("--no-noise", action="store_true")
    parser.add_argument("--axial", action="store_true")
    options = parser.parse_args()
    if options.axial:
        axial_scan()
        return
    spacing = {"plane_spacing": options.plane_spacing}
    helix = chest_rows("helical")
    print("| helix | slices | soft tissue: mean of their errors, HU | smallest to largest | CPU s per slice |")
    print("|---|---|---|---|---|")
    for rebinning in ("tilted", "single-slice"):
        grid, numbers = covered(helix, rebinning)
        began = time.process_time()
        image_hu = volume_hu(helix, grid, rebinning=rebinning, **spacing)
        seconds = (time.process_time() - began) / grid.slices
        errors = soft_tissue_errors(helix, image_hu, numbers)
        print(
            f"| {rebinning} | {grid.slices} | {errors.mean():.2f} | {errors.min():.1f} to {errors.max():.1f} "
            f"| {seconds:.2f} |"
        )
    print("\n| disc at | peak of 800 HU | full width at half maximum, mm | shift, mm |\n|---|---|---|---|")
    discs(helix, **spacing)
    if not options.no_noise:
        carried, naive = noise_scores(helix)
        print(f"\nNoise at 100 mA over the expected: {carried:.3f}; with interpolated variances {naive:.3f}")
    del helix
    print()
    axial_scan()


if __name__ == "__main__":
    main()
