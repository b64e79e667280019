"""Reconstruct the CatSim chest every way there is, and compare with the truth.

    python benchmarks/chest.py OUT_FOLDER

Prints RMSE and bias in soft tissue, HU, for each FBP kernel, for FBP blurred by the best Gaussian (a control: what
plain smoothing gives), for TV-PWLS and for plug-and-play ADMM, with the time and the number of iterations; writes a
picture of each. The strengths are those with the least RMSE on this very scan: an oracle, for all alike.
"""

import sys
import time
from pathlib import Path

import torch

from pnpct.arrays import Image
from pnpct.denoisers import Gaussian, TotalVariation
from pnpct.evaluation import bias_hu, rmse_hu, soft_tissue_mask
from pnpct.files import record_run, write_image
from pnpct.operators import Projector
from pnpct.physics import take_log
from pnpct.reconstruction import TVPWLS, Method, PlugAndPlay, fbp
from reference_scans import Reference, chest

KERNELS = ("ram-lak", "shepp-logan", "hann", "soft")


class Table:
    """Rows of a Markdown table about one scan."""

    def __init__(self, reference: Reference, folder: Path, label: str) -> None:
        assert reference.truth is not None
        self.reference, self.folder, self.label, self.truth = reference, folder, label, reference.truth
        self.mask = soft_tissue_mask(reference.truth)

    def rmse(self, image: Image) -> float:
        return rmse_hu(image, self.truth, mask=self.mask)

    def row(self, name: str, image: Image, seconds: float, note: str = "") -> None:
        bias = bias_hu(image, self.truth, mask=self.mask)
        print(f"| {self.label} | {name} | {self.rmse(image):.1f} | {bias:+.2f} | {seconds:.1f} | {note} |", flush=True)
        path = self.folder / f"{self.label}-{name}.png".replace(" ", "_").replace(",", "")
        write_image(path, image, self.reference.grid, provenance=record_run(sys.argv), window=(30.0, 400.0))


def compare(table: Table, *, iterative: bool) -> None:
    scan, grid = table.reference.scan, table.reference.grid
    began = time.perf_counter()
    sinogram = take_log(scan)
    A = Projector(grid, scan.geometry, mu_water=scan.mu_water)
    images = {}
    for kernel in KERNELS:
        began = time.perf_counter()
        images[kernel] = fbp(sinogram.line_integrals, A, kernel=kernel)
        table.row(f"fbp {kernel}", images[kernel], time.perf_counter() - began)
    if not iterative:
        return
    blurred = {width / 4: Gaussian(width / 4)(images["ram-lak"]) for width in range(2, 13)}
    width = min(blurred, key=lambda width: table.rmse(blurred[width]))
    table.row("fbp ram-lak blurred", blurred[width], 0.0, f"s.d. {width} pixels")
    methods: dict[str, dict[str, Method]] = {
        "tv-pwls": {f"{pixels:g} pixels": TVPWLS(pixels, iterations=40) for pixels in (0.8, 1.4, 2.0)},
        "pnp tv": {
            f"{hu:g} HU x pixel": PlugAndPlay(TotalVariation(hu / 1000), iterations=40) for hu in (40.0, 70.0, 100.0)
        },
    }
    for name, choices in methods.items():
        results = []
        for strength, method in choices.items():
            began = time.perf_counter()
            made = method(sinogram, A)
            results.append((table.rmse(made.image), strength, made, time.perf_counter() - began))
        _, strength, made, seconds = min(results, key=lambda result: result[0])
        table.row(name, made.image, seconds, f"strength {strength}, {made.iterations} iterations")


def main() -> None:
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    torch.manual_seed(0)
    print("| scan | method | RMSE | bias | seconds | |\n|---|---|---|---|---|---|")
    for label, name, current in (("noise-free", "clean", 800), ("800 mA", "mA800_r0", 800), ("40 mA", "mA40_r0", 40)):
        compare(Table(chest(name, current), folder, label), iterative=name == "mA40_r0")


if __name__ == "__main__":
    main()
