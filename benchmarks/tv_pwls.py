"""Time TV-PWLS to convergence against svmbir's own reconstruction, interleaved, on the CatSim chest at 40 mA.

    python benchmarks/tv_pwls.py [ROUNDS]

svmbir (`pip install 'pnpct[peers]'`) runs with its defaults for curved fans, its system matrix built before (the first,
uncounted round builds it: a quarter of an hour). Its prior is q-GGMRF, not total variation, and it stops by its own
rule; pnpct stops by the relative rule. Set-up of pnpct (log, tables, preconditioner) is counted.
"""

import importlib.util
import statistics
import sys
import time

import numpy as np

from pnpct.evaluation import rmse_hu, soft_tissue_mask
from pnpct.operators import Projector
from pnpct.physics import take_log
from pnpct.reconstruction import ADMMState, fbp, tv_pwls, until
from reference_scans import chest


def main() -> None:
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 3
    reference = chest("mA40_r0", 40)
    truth, scan, grid = reference.truth, reference.scan, reference.grid
    assert truth is not None
    mask = soft_tissue_mask(truth)
    sinogram = take_log(scan)

    def ours() -> float:
        A = Projector(grid, scan.geometry, mu_water=scan.mu_water)
        sinogram = take_log(scan)
        start = ADMMState.start(fbp(sinogram.line_integrals, A, kernel="soft"))
        *_, last = until(tv_pwls(sinogram, A, start), start, iterations=60)
        return rmse_hu(last.v, truth, mask=mask)

    def svmbir() -> float:
        import svmbir as package
        import torch

        image = package.recon(
            sinogram.line_integrals.numpy()[:, None],
            np.asarray(scan.geometry.view_angles),
            weights=sinogram.weights.diagonal.numpy()[:, None],
            geometry="fan-curved",
            dist_source_detector=scan.geometry.source_to_detector,
            magnification=scan.geometry.source_to_detector / scan.geometry.source_to_isocenter,
            delta_channel=scan.geometry.bin_width,
            delta_pixel=grid.spacing,
            center_offset=-scan.geometry.detector_offset,
            num_rows=grid.rows,
            num_cols=grid.cols,
            num_threads=torch.get_num_threads(),
            verbose=0,
        )
        # Its orientation is its own: take the turn or flip that fits best.
        candidates = [np.rot90(side, turn) for side in (image[0], image[0].T) for turn in range(4)]
        scaled = [torch.from_numpy(c.copy()) / scan.mu_water for c in candidates]
        return min(rmse_hu(c, truth, mask=mask) for c in scaled)

    methods = {"pnpct tv_pwls": ours}
    if importlib.util.find_spec("svmbir"):
        methods["svmbir recon"] = svmbir
    seconds: dict[str, list[float]] = {name: [] for name in methods}
    errors = {}
    for number in range(rounds + 1):
        for name, method in methods.items():
            began = time.perf_counter()
            errors[name] = method()
            if number:
                seconds[name].append(time.perf_counter() - began)
    print("| method | seconds, minimum | median | RMSE in soft tissue, HU |\n|---|---|---|---|")
    for name, times in seconds.items():
        print(f"| {name} | {min(times):.1f} | {statistics.median(times):.1f} | {errors[name]:.1f} |")


if __name__ == "__main__":
    main()
