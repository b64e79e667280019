"""Reconstruct the measured Helsinki scan by FBP and by plug-and-play ADMM, side by side in one picture.

    python benchmarks/helsinki.py OUT.png

The disc is of one plastic: prints how even it and its holes are, and how wide its edges.
"""

import sys
import time
from pathlib import Path

import torch
from PIL import Image as Picture

from pnpct.denoisers import TotalVariation
from pnpct.operators import Projector
from pnpct.physics import take_log
from pnpct.reconstruction import fbp, reconstruct
from reference_scans import helsinki

SCALE = 255 / 1.6


def main() -> None:
    reference = helsinki()
    sinogram = take_log(reference.scan)
    A = Projector(reference.grid, reference.scan.geometry, mu_water=reference.scan.mu_water)
    images = {}
    for kernel in ("ram-lak", "hann"):
        began = time.perf_counter()
        images[f"fbp {kernel}"] = fbp(sinogram.line_integrals, A, kernel=kernel)
        print(f"fbp {kernel}: {time.perf_counter() - began:.1f} s")
    began = time.perf_counter()
    images["pnp tv"] = reconstruct(sinogram, A, TotalVariation(0.05))
    print(f"pnp tv: {time.perf_counter() - began:.1f} s")
    print("| image | plastic: mean | s.d. | air: mean | s.d. | steepest tenth of edges, per pixel |")
    print("|---|---|---|---|---|---|")
    disc = images["pnp tv"] > 0.5
    plastic, air = eroded(disc, 8), eroded(~disc, 8) & within(A)
    for name, image in images.items():
        rise = torch.hypot(*torch.gradient(image))[~eroded(disc, 3) & ~eroded(~disc, 3)]
        print(
            f"| {name} | {image[plastic].mean():.3f} | {image[plastic].std():.3f} | {image[air].mean():.3f} "
            f"| {image[air].std():.3f} | {rise.quantile(0.9):.3f} |"
        )
    rows = [(image * SCALE).clamp(0, 255).byte().numpy() for image in images.values()]
    Picture.fromarray(torch.cat([torch.from_numpy(row) for row in rows], dim=1).numpy()).save(Path(sys.argv[1]))


def eroded(mask: torch.Tensor, pixels: int) -> torch.Tensor:
    """Return what is at least so many pixels inside."""
    outside = (~mask).float()[None]
    return torch.nn.functional.max_pool2d(outside, 2 * pixels + 1, stride=1, padding=pixels)[0] == 0


def within(A: Projector) -> torch.Tensor:
    x, y = torch.from_numpy(A.grid.x), torch.from_numpy(A.grid.y)[:, None]
    return torch.hypot(x + 0 * y, y + 0 * x) < 0.95 * A.geometry.field_of_view_radius


if __name__ == "__main__":
    main()
