"""The scans that the benchmarks reconstruct; they are not part of the project.

PNPCT_TEST_DATA names their folder: `catsim/chest`, a chest through CatSim, and `htc2022`, a measured scan of the
Helsinki Tomography Challenge.
"""

import json
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from pnpct.arrays import Image
from pnpct.files import scan_from_arrays
from pnpct.geometry import ImageGrid
from pnpct.physics import Scan

FOLDER = Path(os.environ.get("PNPCT_TEST_DATA", Path(__file__).parents[2] / "shared" / "data"))


@dataclass(frozen=True, eq=False)
class Reference:
    """A scan with what is known about its object."""

    scan: Scan
    grid: ImageGrid
    truth: Image | None


def chest(name: str, tube_current_ma: float) -> Reference:
    """Read one of the chest's scans: "clean", "mA800_r0", "mA40_r0" or "mA40_r1"."""
    folder = FOLDER / "catsim" / "chest"
    truth = np.load(folder / "truth.npz")
    mean = np.load(folder / "signal_mean_800mA.npz")["air_S1"]
    second = np.load(folder / "signal_var_800mA.npz")["air_S2"]
    made = json.loads((folder / "geometry.json").read_text())
    kev_per_quantum = float((second / mean).mean())
    scan = scan_from_arrays(
        np.load(folder / f"prep_{name}.npz")["prep"],
        folder / "geometry.json",
        kind="line-integrals",
        incident=(mean**2 / second * tube_current_ma / 800).astype(np.float32),
        electronic_noise=made["eNoise_e"] / made["gain_e_per_keV"] / kev_per_quantum,
        mu_water=float(truth["mu_water"]),
        beam_hardening=np.load(folder / "bhc_poly.npz")["coef"],
    )
    image = torch.from_numpy(truth["mu"] / float(truth["mu_water"])).float()
    return Reference(scan, ImageGrid(512, 512, spacing=float(truth["fov_mm"]) / 512), image)


def helsinki() -> Reference:
    """Read the measured disc with holes: 549 views at half a degree, with gaps, on a flat detector."""
    with np.load(FOLDER / "htc2022" / "htc2022_tb_stitched_549views.npz") as file:
        line_integrals, angles, made = file["sino"], file["angles_deg"], json.loads(str(file["meta"]))["geometry"]
        meta = json.loads(str(file["meta"]))
    assert "flat" in made
    geometry = {
        "view_angles_deg": [float(angle) for angle in angles],
        "source_to_isocenter_mm": meta["SOD_mm"],
        "source_to_detector_mm": meta["SDD_mm"],
        "bins": meta["n_detectors"],
        "bin_width_mm": meta["detector_pixel_mm"],
        "detector": "flat",
        "source_at_zero_angle": "+x",
        "bin_direction": -1,
    }
    scan = scan_from_arrays(
        line_integrals,
        geometry,
        kind="line-integrals",
        incident=1e5,  # not recorded
        electronic_noise=0.0,
        mu_water=0.025,  # acrylic at 45 kV is about as dense; it only sets the grey scale
    )
    return Reference(scan, ImageGrid(512, 512, spacing=80.0 / 512), None)
