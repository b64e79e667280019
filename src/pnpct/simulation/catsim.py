"""Scans by CatSim (GE's XCIST, the package gecatsim), an independent simulator, of the phantoms of this package.

CatSim sees the same compositions as pnpct's own simulator: its material files are written from `MATERIALS`. It
scans in a vacuum, while the attenuation here is relative to air, which a body displaces. So air is left out of its
phantom and each density is lowered by the share that air has of the attenuation at 70 keV, by 0.11 % in water
and 0.42 % in lung. Its tube, filters, detector, cross sections and projector are its own.
"""

import math
from dataclasses import dataclass

import numpy as np
import torch

from pnpct.geometry import FanBeam, ImageGrid
from pnpct.physics import TUBE_VOLTAGE_KVP, Moments
from pnpct.simulation.body import Body
from pnpct.simulation.catsim_job import Settings, catsim_results, require_catsim
from pnpct.simulation.phantom import Phantom
from pnpct.simulation.scanner import SLICE_THICKNESS

_SLAB = 2000.0  # mm: no ray that meets a row of the detector leaves it at the top
GAIN, ELECTRONIC_NOISE = 17.0, 3500.0
"""Electrons for each keV, and standard deviation of the electronic noise in electrons."""
VOLTAGES = (70, 80, 90, 100, 110, 120, 130, 140)
"""Tube voltages that CatSim has spectra for, kVp."""


@dataclass(frozen=True)
class CatSimSampling:
    """How finely CatSim samples what moves or has a size; with 1 everywhere it is fastest.

    Detector cells need no sampling: the projector for voxels averages over their width and height.

    Args:
        focal_spot: Points across the focal spot (1 mm wide) and along it (1 mm long, 8 mm deep on the slanted
            target); one is a point without size.
        views: Positions of the gantry during a view.

    Raises:
        ValueError: If a number is below 1.
    """

    focal_spot: tuple[int, int] = (1, 1)
    views: int = 1

    def __post_init__(self) -> None:
        if min(*self.focal_spot, self.views) < 1:
            raise ValueError(f"CatSim needs at least one sample of everything, got {self}.")


FASTEST = CatSimSampling()


def catsim_moments(
    body: Phantom | Body,
    geometry: FanBeam,
    *,
    tube_voltage_kvp: float = TUBE_VOLTAGE_KVP,
    rows: int = 1,
    z: float = 0.0,
    grid: ImageGrid | None = None,
    sampling: CatSimSampling = FASTEST,
    energy_bins: int = 20,
) -> tuple[Moments, ...]:
    """Scan an object with CatSim; return the noise-free signal and its variance for 1 mAs per view.

    This is `simulate_moments` by another simulator, for each row of a detector: `physics.scan_from_moments`
    draws scans of any tube current from it. Scatter, crosstalk and lag are left out.

    A phantom is a slab, the same at every z; so is the slice of a body that a single row sees. Several rows see
    a body in slices of 0.625 mm, which are all held in memory, up to the height h above and below z that the
    cone reaches in the pixel farthest from the axis, at the distance r:

        h = rows/2 · 0.625 mm · (R + r) / R,   R = source_to_isocenter.

    Args:
        body: The object.
        geometry: An arc detector, and a full rotation of evenly spaced views.
        tube_voltage_kvp: Peak tube voltage, 70 to 140 kVp in steps of 10.
        rows: Number of detector rows, each 0.625 mm high at the isocentre, at least 1.
        z: Height in the body of the middle of all rows, mm.
        grid: Pixels of a body's slices; 1024 × 1024 over 450 mm if None. A phantom has its own.
        sampling: How finely CatSim samples focal spot and views.
        energy_bins: Number of photon energies, at least 1.

    Returns:
        Moments in keV and keV² for each row, the lowest z first, with the electronic noise of CatSim's detector
        (3500 electrons, at 17 electrons per keV).

    Raises:
        ImportError: If CatSim is not installed.
        OSError: If CatSim fails, or there is no room for its files.
        ValueError: If CatSim cannot take the geometry or an argument, or the body is not known far enough.
    """
    require_catsim()
    settings = _settings(geometry, tube_voltage_kvp, rows, sampling)
    settings["physics"] |= {"energyCount": energy_bins, "enableQuantumNoise": 0, "enableElectronicNoise": 0}
    # 1 mAs in each of the views that share one second.
    settings["protocol"]["mA"] = float(geometry.views)
    if energy_bins < 1:
        raise ValueError(f"CatSim needs at least one energy bin, got {energy_bins}.")
    slices = _slices(body, geometry, rows=rows, z=z, grid=grid)
    thickness = SLICE_THICKNESS if len(slices) > 1 else _SLAB
    with (
        catsim_results(slices, slice_thickness=thickness, settings=settings, seed=None) as folder,
        np.load(folder / "moments.npz", allow_pickle=False) as results,
    ):
        views, air = torch.from_numpy(results["views"]), torch.from_numpy(results["air"])
    return tuple(
        Moments(
            signal_mean=views[:, 0, row].clone(),
            signal_variance=views[:, 1, row].clone(),
            air_mean=air[0, row].clone(),
            air_variance=air[1, row].clone(),
            electronic_noise=ELECTRONIC_NOISE / GAIN,
        )
        for row in range(rows)
    )


def _settings(geometry: FanBeam, voltage: float, rows: int, sampling: CatSimSampling) -> Settings:
    """CatSim's settings for a geometry, by its own groups and names."""
    if voltage not in VOLTAGES:
        raise ValueError(f"CatSim has spectra for 70 to 140 kVp in steps of 10, got {voltage} kVp.")
    if rows < 1:
        raise ValueError(f"A detector needs at least one row, got {rows}.")
    direction = _rotation_direction(geometry)
    across, along = sampling.focal_spot
    return {
        "scanner": {
            "sid": geometry.source_to_isocenter,
            "sdd": geometry.source_to_detector,
            "detectorColCount": geometry.bins,
            "detectorColsPerMod": 1,  # wider modules are flat
            "detectorColSize": geometry.bin_width,
            "detectorColOffset": geometry.detector_offset,
            "detectorRowCount": rows,
            "detectorRowsPerMod": rows,
            "detectionGain": GAIN,
            "eNoise": ELECTRONIC_NOISE,
            "detectorRowSize": SLICE_THICKNESS * geometry.source_to_detector / geometry.source_to_isocenter,
        },
        "protocol": {
            "viewsPerRotation": geometry.views,
            "viewCount": geometry.views,
            "startViewId": 0,
            "stopViewId": geometry.views - 1,
            "startAngle": math.degrees(geometry.view_angles[0]),
            "rotationDirection": direction,
            "rotationTime": 1.0,
            "spectrumFilename": f"tungsten_tar7.0_{voltage:.0f}_filt.dat",
            "bowtie": "large.txt",
            "flatFilter": ["Al", 3.0],
        },
        "physics": {
            "colSampleCount": 1,
            "rowSampleCount": 1,
            "srcXSampleCount": across,
            "srcYSampleCount": along,
            "viewSampleCount": sampling.views,
        },
    }


def _rotation_direction(geometry: FanBeam) -> int:
    """1 if the views turn counter-clockwise, −1 if clockwise; what CatSim's scanner cannot do is refused."""
    if geometry.detector != "arc":
        raise ValueError("CatSim is set up for arc detectors here, this one is flat.")
    if geometry.focal_spot_shifts:
        raise ValueError("CatSim is set up for a focal spot that stays in its place, this geometry shifts it.")
    angles = np.asarray(geometry.view_angles)
    turn = 2 * math.pi * np.arange(geometry.views) / geometry.views
    for direction in (1, -1):
        error = angles - angles[0] - direction * turn
        if np.abs(error - 2 * math.pi * np.round(error / (2 * math.pi))).max() < 1e-6:
            return direction
    raise ValueError("CatSim needs the evenly spaced views of one full rotation, this geometry has others.")


def _slices(body: Phantom | Body, geometry: FanBeam, *, rows: int, z: float, grid: ImageGrid | None) -> list[Phantom]:
    """The slices that the cone of the rows passes, or the one slice that stands for a slab."""
    if isinstance(body, Phantom):
        if z != 0 or grid is not None:
            raise ValueError("A phantom is the same at every z and has pixels of its own; leave z and grid out.")
        _check_reach(body.grid, geometry)
        return [body]
    grid = grid or ImageGrid(1024, 1024, spacing=450 / 1024)
    _check_reach(grid, geometry)
    beyond = cone_slices(geometry, grid, rows)
    heights = [z + (number - (rows - 1) / 2) * SLICE_THICKNESS for number in range(-beyond, rows + beyond)]
    low, high = body.extent
    if not (low <= heights[0] and heights[-1] <= high):
        raise ValueError(
            f"{rows} detector rows at z = {z:.6g} mm need the body from {heights[0]:.6g} to {heights[-1]:.6g} mm, "
            f"but it is known from {low:.6g} to {high:.6g} mm."
        )
    return [body.slice(height, grid) for height in heights]


def cone_slices(geometry: FanBeam, grid: ImageGrid, rows: int) -> int:
    """Return how many slices the cone of a detector needs below its lowest row, and above its highest."""
    return math.ceil(rows / 2 * grid.radius / geometry.source_to_isocenter) if rows > 1 else 0


def _check_reach(grid: ImageGrid, geometry: FanBeam) -> None:
    if grid.radius >= geometry.source_to_isocenter:
        raise ValueError(
            f"The pixels reach {grid.radius:.6g} mm from the axis of rotation, as far as the focal spot at "
            f"{geometry.source_to_isocenter:.6g} mm; take a smaller grid."
        )
