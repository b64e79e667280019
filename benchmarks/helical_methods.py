"""Reconstruct the reference helix at low dose by every method, and measure error and bias slice by slice.

    python benchmarks/helical_methods.py [--doses 40,100] [--slices 8] [--seed 1]

Methods are FBP with four kernels and total variation with five strengths, each without and with neighbouring planes:
the best of each in this very scan is an oracle, chosen by soft tissue; and plug-and-play with n2n at the defaults of
`pnpct reconstruct`. Errors are in HU, in soft tissue (-100 to 150 HU over five slices, five pixels from anything else)
and in the body, the mean over the slices and the worst one over the oracle's same slice. The bias is that of the
modules of 43 HU, away from the discs in their middles.
"""

import argparse
from dataclasses import replace

import numpy as np
import torch
from scipy.ndimage import binary_fill_holes, label

from helical import soft_tissue_errors
from pnpct.denoisers import AcrossSlices
from pnpct.files import load_denoiser
from pnpct.geometry import TiltedPlanes, VolumeGrid
from pnpct.physics import take_log
from pnpct.reconstruction import FBP, TVPWLS, Method, PlugAndPlay, plane_distance, planes_of_a_row, reconstruct_volume
from reference_scans import ReferenceCone, chest_rows


def methods(reference: ReferenceCone, grid: VolumeGrid) -> dict[str, dict[str, Method]]:
    """The choices of each method; that of plug-and-play is what the command does."""
    planes = TiltedPlanes(reference.geometry)
    reach = planes_of_a_row(planes, plane_distance(planes, grid, 0.0, None))
    strengths = (1.0, 1.5, 2.0, 3.0, 4.0)
    return {
        "FBP": {kernel: FBP(kernel) for kernel in ("ram-lak", "shepp-logan", "hann", "soft")},
        "TV": {f"{strength:g}": TVPWLS(strength) for strength in strengths},
        "TV over three axes": {f"{strength:g}": TVPWLS(strength, across=1.0) for strength in strengths},
        "PnP n2n": {"defaults": PlugAndPlay(AcrossSlices(load_denoiser("n2n"), reach=reach))},
        "PnP n2n, planes alone": {"defaults": PlugAndPlay(load_denoiser("n2n"))},
    }


def body_errors(image_hu: np.ndarray, truth_hu: np.ndarray) -> np.ndarray:
    errors = []
    for image, truth in zip(image_hu, truth_hu, strict=True):
        parts, _ = label(binary_fill_holes(truth > -300))
        body = parts == 1 + np.argmax(np.bincount(parts.ravel())[1:])
        errors.append(float(np.sqrt(np.square(image - truth)[body].mean())))
    return np.array(errors)


def biases(reference: ReferenceCone, grid: VolumeGrid, image_hu: np.ndarray) -> list[float]:
    found = []
    for x, y, z, radius, height, _, _ in reference.content["modules"]:
        inside = np.hypot(grid.plane.x[None] - x, grid.plane.y[:, None] - y) < radius - 4
        near = (np.abs(grid.heights - z) < height / 2 - 1.5) & (np.abs(grid.heights - z) > 2.5)
        if near.any():
            found.append(float(image_hu[near][:, inside].mean() - 43.0))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--doses", default="40,100")
    parser.add_argument("--slices", type=int, default=8)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    reference = chest_rows("helical")
    middle = len(reference.grid.heights) // 2
    numbers = np.arange(middle - options.slices // 2, middle - options.slices // 2 + options.slices)
    z = float(reference.grid.heights[numbers].mean())
    grid = replace(reference.grid, slices=options.slices, z=z)
    for dose in map(float, options.doses.split(",")):
        scan = reference.scan(dose, options.seed)
        print(
            f"\n{dose:g} mA\n\n| method | choice | soft | body | bias of modules |\n|---|---|---|---|---|", flush=True
        )
        best: dict[str, tuple[np.ndarray, np.ndarray]] = {}
        for name, choices in methods(reference, grid).items():
            rows = []
            for choice, method in choices.items():
                slabs = reconstruct_volume(
                    lambda views, scan=scan: take_log(scan[views]), scan.geometry, grid, method, mu_water=scan.mu_water
                )
                image_hu = torch.cat([slab.image for slab in slabs]).sub(1).mul(1000).numpy()
                soft = soft_tissue_errors(reference, image_hu, numbers)
                rows.append((soft, body_errors(image_hu, reference.truth_hu[numbers]), choice, image_hu))
            soft, body, choice, image_hu = min(rows, key=lambda row: row[0].mean())
            best[name] = soft, body
            bias = ", ".join(f"{each:+.1f}" for each in biases(reference, grid, image_hu))
            print(f"| {name} | {choice} | {soft.mean():.1f} | {body.mean():.1f} | {bias} |", flush=True)
        for other in ("FBP", "TV", "TV over three axes"):
            ratios = [ours / theirs for ours, theirs in zip(best["PnP n2n"], best[other], strict=True)]
            print(
                f"PnP n2n over {other}, worst slice: soft {ratios[0].max():.2f}, body {ratios[1].max():.2f}", flush=True
            )


if __name__ == "__main__":
    main()
