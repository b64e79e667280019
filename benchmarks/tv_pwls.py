"""Time TV-PWLS to convergence against svmbir's own reconstruction, interleaved, at 512 x 512, 984 views x 900 bins.

    python benchmarks/tv_pwls.py [ROUNDS]

The object is the CatSim chest, projected anew into the geometry of projector.py, so that svmbir's system matrix is the
one that was built there; 35 000 quanta per ray. svmbir (`pip install 'pnpct[peers]'`) runs with its defaults. Its prior
is q-GGMRF, not total variation, and it stops by its own rule; pnpct stops by the relative rule. Set-up of pnpct (log,
tables, preconditioner) is counted.
"""

import importlib.util
import math
import statistics
import sys
import time

import numpy as np
import torch

from pnpct.evaluation import rmse_hu, soft_tissue_mask
from pnpct.operators import Projector
from pnpct.physics import Scan, simulate_counts, take_log
from pnpct.reconstruction import TVPWLS
from pnpct.units import MU_WATER_70_KEV
from projector import FULL_TURN, GRID, SIZE, SPACING, VIEWS
from reference_scans import chest


def main() -> None:
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 2
    truth = chest("clean", 800).truth
    assert truth is not None
    mask = soft_tissue_mask(truth)
    exact = Projector(GRID, FULL_TURN)(truth)
    incident = torch.tensor(35_000.0)
    counts = simulate_counts(exact, incident, electronic_noise=2.75, generator=torch.Generator().manual_seed(0))
    scan = Scan(counts, incident, 2.75, geometry=FULL_TURN, mu_water=MU_WATER_70_KEV)

    def ours() -> float:
        sinogram, A = take_log(scan), Projector(GRID, FULL_TURN)
        return rmse_hu(TVPWLS(iterations=60)(sinogram, A).image, truth, mask=mask)

    def svmbir() -> float:
        import svmbir as package

        sinogram = take_log(scan)
        image = package.recon(
            sinogram.line_integrals.numpy()[:, None],
            np.linspace(0, 2 * math.pi, VIEWS, endpoint=False),
            weights=sinogram.weights.diagonal.numpy()[:, None],
            geometry="fan-curved",
            dist_source_detector=949.0,
            magnification=949.0 / 541.0,
            delta_channel=1.0239,
            delta_pixel=SPACING,
            roi_radius=250.0,
            num_rows=SIZE,
            num_cols=SIZE,
            num_threads=torch.get_num_threads(),
            verbose=0,
        )
        # Its orientation is its own: take the turn or flip that fits best.
        candidates = [np.rot90(side, turn) for side in (image[0], image[0].T) for turn in range(4)]
        return min(rmse_hu(torch.from_numpy(c.copy()) / MU_WATER_70_KEV, truth, mask=mask) for c in candidates)

    methods = {"pnpct TVPWLS": ours}
    if importlib.util.find_spec("svmbir"):
        methods["svmbir recon"] = svmbir
    seconds: dict[str, list[float]] = {name: [] for name in methods}
    errors = {}
    for _ in range(rounds):
        for name, method in methods.items():
            began = time.perf_counter()
            errors[name] = method()
            seconds[name].append(time.perf_counter() - began)
    print("| method | seconds, minimum | median | RMSE in soft tissue, HU |\n|---|---|---|---|")
    for name, times in seconds.items():
        print(f"| {name} | {min(times):.1f} | {statistics.median(times):.1f} | {errors[name]:.1f} |")


if __name__ == "__main__":
    main()
