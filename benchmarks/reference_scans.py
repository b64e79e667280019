"""The scans that the benchmarks reconstruct; they are not part of the project.

PNPCT_TEST_DATA names their folder: `catsim/chest`, a chest through CatSim, `volumes`, another one scanned with 32
detector rows, and `htc2022`, a measured scan of the Helsinki Tomography Challenge.
"""

import json
import os
import runpy
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from pnpct.arrays import ConeRays, Image
from pnpct.files import scan_from_arrays
from pnpct.geometry import ConeBeam, Detector, ImageGrid, Trajectory, VolumeGrid
from pnpct.physics import BeamHardening, Scan

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


@dataclass(frozen=True, eq=False)
class ReferenceCone:
    """A scan of several detector rows without noise, its object, and how its noise is drawn.

    Args:
        line_integrals: At one energy.
        geometry: Where the rays are.
        mu_water: Attenuation of water at that energy, 1/mm.
        truth_hu: The object: (slices, rows, cols).
        grid: Where its pixels are.
        content: All that the file holds.
        reader: The functions that read it.
    """

    line_integrals: ConeRays
    geometry: ConeBeam
    mu_water: float
    truth_hu: np.ndarray
    grid: VolumeGrid
    content: dict[str, Any]
    reader: dict[str, Any]

    def scan(self, tube_current_ma: float, seed: int) -> Scan:
        """Draw the polychromatic scan of a tube current, with the water correction that goes with it."""
        content, rng = self.content, np.random.default_rng(seed)
        quantum = content["air_S2"] / content["air_S1"]
        share = tube_current_ma * float(content["rotation_s"]) / int(content["views_per_turn"])
        incident = torch.from_numpy(content["air_S1"] / quantum * share).float()
        draw = self.reader["line_integrals"]
        counts = torch.empty(self.geometry.shape)
        for view in range(self.geometry.views):
            counts[view] = incident * torch.from_numpy(-draw(content, view, tube_current_ma, rng)).exp()
        return Scan(
            counts=counts,
            incident=incident,
            electronic_noise=float((content["electronic_noise_kev"] / quantum).mean()),
            geometry=self.geometry,
            mu_water=self.mu_water,
            beam_hardening=BeamHardening(torch.from_numpy(content["water_correction"]).float()),
        )


def chest_rows(name: str) -> ReferenceCone:
    """Read the chest of 32 detector rows: "helical" or "axial"."""
    folder = FOLDER / "volumes"
    reader = runpy.run_path(str(folder / "read_scan.py"))
    content = reader["read"](folder / f"chest_{name}.h5")
    lengths = {key: float(content[key]) for key in ("column_mm", "column_offset", "row_mm", "row_offset", "sid", "sdd")}
    detector = Detector(
        bins=int(content["columns"]),
        bin_width=lengths["column_mm"],
        offset=lengths["column_offset"],
        rows=int(content["rows"]),
        row_height=lengths["row_mm"],
        row_offset=lengths["row_offset"],
    )
    geometry = ConeBeam(Trajectory(content["beta"], content["z"]), detector, lengths["sid"], lengths["sdd"])
    z, truth_hu = content["truth_z"], content["truth_hu"]
    plane = ImageGrid(*truth_hu.shape[1:], spacing=float(content["truth_pixel_mm"]))
    return ReferenceCone(
        line_integrals=torch.from_numpy(content["mono"]).float(),
        geometry=geometry,
        mu_water=float(content["mu_water"]),
        truth_hu=truth_hu,
        grid=VolumeGrid(plane, len(z), float(np.diff(z).mean()), float(z.mean())),
        content=content,
        reader=reader,
    )


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
