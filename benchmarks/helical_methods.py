"""Reconstruct the reference helix at low dose by every method, and measure error and bias slice by slice.

    python benchmarks/helical_methods.py [--doses 40,100] [--slices 8] [--seed 1] [--methods "FBP;PnP n2n"]

Methods are FBP with four kernels and total variation with five strengths, each without and with neighbouring planes:
the best of each in this very scan is an oracle, chosen by soft tissue; and plug-and-play with n2n at the defaults of
`pnpct reconstruct`, in planes and on the cone. Errors are in HU, in soft tissue (-100 to 150 HU over five slices, five
pixels from anything else) and in the body, the mean over the slices and the worst one over the oracle's same slice. The
bias and the standard deviation are those of the modules of 43 HU, away from the discs in their middles; peak and full
width at half maximum along z are those of the discs of 800 HU, 0.625 mm thick, straight between the slices. Bias,
deviation and discs are given once more after a blur along z that makes every disc 0.95 mm wide or wider.
"""

import argparse
import itertools
from dataclasses import replace

import numpy as np
import torch
from scipy.ndimage import binary_fill_holes, gaussian_filter1d, label

from helical import soft_tissue_errors
from pnpct.denoisers import AcrossSlices
from pnpct.files import load_denoiser
from pnpct.geometry import TiltedPlanes, VolumeGrid
from pnpct.physics import take_log
from pnpct.reconstruction import (
    FBP,
    TVPWLS,
    Method,
    PlugAndPlay,
    plane_distance,
    planes_of_a_row,
    reconstruct_cone_volume,
    reconstruct_volume,
    slice_distance,
)
from reference_scans import ReferenceCone, chest_rows

WIDTH = 0.95
"""mm, to which noise is compared."""

PLANES, CONE = "PnP n2n", "PnP n2n on the cone"


def methods(reference: ReferenceCone, grid: VolumeGrid) -> dict[str, dict[str, Method]]:
    """The choices of each method; that of plug-and-play is what the command does."""
    planes = TiltedPlanes(reference.geometry)
    reach = planes_of_a_row(planes, plane_distance(planes, grid, 0.0, None))
    across_rows = planes_of_a_row(planes, slice_distance(grid, reference.geometry))
    strengths = (1.0, 1.5, 2.0, 3.0, 4.0)
    return {
        "FBP": {kernel: FBP(kernel) for kernel in ("ram-lak", "shepp-logan", "hann", "soft")},
        "TV": {f"{strength:g}": TVPWLS(strength) for strength in strengths},
        "TV over three axes": {f"{strength:g}": TVPWLS(strength, across=1.0) for strength in strengths},
        PLANES: {"defaults": PlugAndPlay(AcrossSlices(load_denoiser("n2n"), reach=reach))},
        "PnP n2n, planes alone": {"defaults": PlugAndPlay(load_denoiser("n2n"))},
        CONE: {"defaults": PlugAndPlay(AcrossSlices(load_denoiser("n2n"), reach=across_rows))},
    }


def body_errors(image_hu: np.ndarray, truth_hu: np.ndarray) -> np.ndarray:
    errors = []
    for image, truth in zip(image_hu, truth_hu, strict=True):
        parts, _ = label(binary_fill_holes(truth > -300))
        body = parts == 1 + np.argmax(np.bincount(parts.ravel())[1:])
        errors.append(float(np.sqrt(np.square(image - truth)[body].mean())))
    return np.array(errors)


def discs(reference: ReferenceCone, grid: VolumeGrid, image_hu: np.ndarray) -> list[tuple[float, float, float]]:
    """Distance from the axis, peak and width, mm and HU, of each disc that is in these slices."""
    found = []
    for x, y, z, _, _, radius, _ in reference.content["modules"]:
        away, from_axis = grid.heights - z, np.hypot(grid.plane.x[None] - x, grid.plane.y[:, None] - y)
        if abs(away).min() < grid.slice_spacing / 2 and abs(away[[0, -1]]).min() > grid.slice_spacing:
            profile = image_hu[:, from_axis < radius - 3].mean(1) - 43
            fine = np.linspace(away[0], away[-1], 10001)
            above = fine[np.interp(fine, away, profile) > profile.max() / 2]
            found.append((float(np.hypot(x, y)), float(profile.max()), float(np.ptp(above))))
    return found


def as_wide(reference: ReferenceCone, grid: VolumeGrid, image_hu: np.ndarray, width: float) -> np.ndarray:
    """Blur along z by a Gaussian until every disc is as wide as `width`, mm, or wider."""
    for sigma in np.arange(0.0, 2.0, 0.02):
        blurred = gaussian_filter1d(image_hu, sigma, axis=0, mode="nearest") if sigma else image_hu
        if all(disc[2] >= width for disc in discs(reference, grid, blurred)):
            break
    return blurred


def module_values(reference: ReferenceCone, grid: VolumeGrid, image_hu: np.ndarray) -> str:
    """Bias and standard deviation of each module, and peak and width of each disc, that are in these slices."""
    bias, deviation = [], []
    for x, y, z, radius, height, _, _ in reference.content["modules"]:
        away, from_axis = grid.heights - z, np.hypot(grid.plane.x[None] - x, grid.plane.y[:, None] - y)
        near = (np.abs(away) < height / 2 - 1.5) & (np.abs(away) > 1.5)
        if near.any():
            values = image_hu[near][:, from_axis < radius - 4]
            bias.append(f"{values.mean() - 43:+.1f}")
            deviation.append(f"{values.std(1).mean():.2f}")
    seen = (
        f"{from_axis:.0f} mm: {peak:.0f} HU, {width:.2f} mm"
        for from_axis, peak, width in discs(reference, grid, image_hu)
    )
    return f"{', '.join(bias)} | {', '.join(deviation)} | {'; '.join(seen)}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--doses", default="40,100")
    parser.add_argument("--slices", type=int, default=8)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--methods", default=None, help="their names with semicolons between them; all by default")
    options = parser.parse_args()
    reference = chest_rows("helical")
    middle = len(reference.grid.heights) // 2
    numbers = np.arange(middle - options.slices // 2, middle - options.slices // 2 + options.slices)
    z = float(reference.grid.heights[numbers].mean())
    grid = replace(reference.grid, slices=options.slices, z=z)
    for dose in map(float, options.doses.split(",")):
        scan = reference.scan(dose, options.seed)
        print(
            f"\n{dose:g} mA\n\n| method | choice | soft, worst | body, worst | bias of modules | s.d. | discs |\n"
            "|---|---|---|---|---|---|---|",
            flush=True,
        )
        best: dict[str, tuple[np.ndarray, np.ndarray]] = {}
        for name, choices in methods(reference, grid).items():
            if options.methods and name not in options.methods.split(";"):
                continue
            rows = []
            for choice, method in choices.items():
                slabs = (reconstruct_cone_volume if name == CONE else reconstruct_volume)(
                    lambda views, scan=scan: take_log(scan[views]), scan.geometry, grid, method, mu_water=scan.mu_water
                )
                image_hu = torch.cat([slab.image for slab in slabs]).sub(1).mul(1000).numpy()
                soft = soft_tissue_errors(reference, image_hu, numbers)
                rows.append((soft, body_errors(image_hu, reference.truth_hu[numbers]), choice, image_hu))
            soft, body, choice, image_hu = min(rows, key=lambda row: row[0].mean())
            best[name] = soft, body
            errors = " | ".join(f"{values.mean():.1f}, {values.max():.1f}" for values in (soft, body))
            print(f"| {name} | {choice} | {errors} | {module_values(reference, grid, image_hu)} |", flush=True)
            if not discs(reference, grid, image_hu):
                continue
            wide = as_wide(reference, grid, image_hu, WIDTH)
            print(f"| as wide as {WIDTH} mm | | | | {module_values(reference, grid, wide)} |", flush=True)
        for name, other in itertools.product((PLANES, CONE), ("FBP", "TV", "TV over three axes", PLANES)):
            if name != other and {name, other} <= best.keys():
                soft, body = (ours / theirs for ours, theirs in zip(best[name], best[other], strict=True))
                print(f"{name} over {other}, worst slice: soft {soft.max():.2f}, body {body.max():.2f}", flush=True)


if __name__ == "__main__":
    main()
