"""Our simulator against CatSim: how far apart they are, and how long both take.

    python benchmarks/simulator.py [--rows 32]        (needs pip install 'pnpct[catsim]')

Prints four tables. The first compares noise-free line integrals, and the mean and the variance of noisy ones as they
follow from the moments, with CatSim on the mini fixture (80, 100, 120 kVp) and, where it is present, on a chest of
984 x 900 rays. The second times both on one slice of our own chest, 512 x 512 pixels and 20 energy bins, in turns;
CatSim with one sample of everything, its cheapest. Seconds are those of the clock; ours has two threads, CatSim's
projector for voxels one. The third times a detector of many rows, which CatSim is quicker at for each slice, and the
drawing of noise. Slices are painted before.
"""

import argparse
import statistics
import sys
import time
from pathlib import Path

import numpy as np
import torch

from pnpct.evaluation import soft_tissue_mask
from pnpct.geometry import ImageGrid
from pnpct.operators import Projector
from pnpct.physics import Moments, take_log
from pnpct.reconstruction import fbp
from pnpct.simulation import (
    ANATOMIES,
    SLICE_THICKNESS,
    Body,
    Phantom,
    Sampling,
    as_exposure,
    catsim_moments,
    clinical_fan_beam,
    moments_behind,
    relative_attenuation,
    scanner_beam,
    simulate_moments,
    truth,
)
from reference_scans import FOLDER

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
CURRENTS_MA = (40.0, 100.0, 800.0)


def compare(name: str, ours: Moments, theirs: Moments, views: int) -> None:
    """Print one row for each tube current, over the rays with more than 50 quanta."""
    line_integrals, expected = (-torch.log(each.signal_mean / each.air_mean) for each in (ours, theirs))
    thin = (expected < 5) & (expected > 0.02)
    clean = (line_integrals - expected)[thin].norm() / expected[thin].norm()
    for current in CURRENTS_MA:
        noisy = []
        for moments in (ours, theirs):
            dose = current / views
            quanta = dose * moments.signal_mean**2 / moments.signal_variance
            electronic = moments.electronic_noise / (dose * moments.signal_mean)
            variance = 1 / quanta + electronic**2
            # To second order in the noise the logarithm's mean is p + var/2.
            noisy.append((quanta, -torch.log(moments.signal_mean / moments.air_mean) + variance / 2, variance))
        (_, mean, variance), (quanta, their_mean, their_variance) = noisy
        ample = (quanta > 50) & (expected > 0.02)
        of_mean = (mean - their_mean)[ample].norm() / their_mean[ample].norm()
        of_variance = 100 * ((variance / their_variance)[ample] - 1)
        print(
            f"{name:28} {current:5.0f} mA   clean {100 * clean:5.2f} %   mean {100 * of_mean:5.2f} %   "
            f"variance {of_variance.mean():+5.2f} % (rms {of_variance.square().mean().sqrt():.2f} %)"
        )


def mini() -> None:
    """Compare on the slice that ships with the tests."""
    from fixtures.make_catsim_mini import read_catsim_mini

    scanned = read_catsim_mini()
    for voltage, theirs in scanned.moments.items():
        beam = scanner_beam(scanned.geometry, tube_voltage_kvp=float(voltage))
        (ours,) = simulate_moments(scanned.phantom, scanned.geometry, [beam])
        compare(f"mini, {voltage} kVp", ours, theirs, scanned.geometry.views)


def chest() -> None:
    """Compare on a chest that CatSim has scanned with its blur: 2 samples of cells, views, and the spot's sides."""
    folder = FOLDER / "catsim" / "chest"
    with np.load(folder / "truth.npz") as true:
        image = torch.from_numpy(true["mu"] / true["mu_water"])
    bone = ((image - 1.1) / 1.3).clamp(0, 1)
    water_70, bone_70 = relative_attenuation(("water", "cortical bone"), np.array([70.0]))[:, 0].tolist()
    fractions = torch.stack([(1 - bone) * image, bone * image * (water_70 / bone_70)]).float()
    grid, fan = ImageGrid(*image.shape, spacing=450 / 512), clinical_fan_beam()
    with np.load(folder / "signal_mean_800mA.npz") as s1, np.load(folder / "signal_var_800mA.npz") as s2:
        scale = fan.views / 800
        parts = [torch.from_numpy(scale * each) for each in (s1["S1"], s2["S2"], s1["air_S1"], s2["air_S2"])]
    theirs = Moments(*parts, electronic_noise=3500 / 17)
    beam = scanner_beam(fan)
    for name, sampling in (("chest, one sample", Sampling()), ("chest, blurred", Sampling(2, (2, 2), 2))):
        samples = []
        for each in sampling.geometries(fan):
            paths = Projector(grid, each, mu_water=1.0)(fractions)
            samples.append(moments_behind(paths, ("water", "cortical bone"), beam))
        mean, variance = (
            torch.stack([getattr(sample, part) for sample in samples]).mean(0)
            for part in ("signal_mean", "signal_variance")
        )
        ours = Moments(mean, variance, samples[0].air_mean, samples[0].air_variance, samples[0].electronic_noise)
        compare(name, ours, theirs, fan.views)


class Painted(Body):
    """A body whose slices are there already, those that the cone of CatSim's detector needs included."""

    def __init__(self, body: Body, grid: ImageGrid, rows: int) -> None:
        numbers = range(-rows, 2 * rows)
        heights = [SLICE_THICKNESS * (number - (rows - 1) / 2) for number in numbers if abs(number - rows / 2) < rows]
        self._body, self._grid = body, grid
        self._slices = {round(z, 6): body.slice(z, grid) for z in heights}

    @property
    def extent(self) -> tuple[float, float]:
        return self._body.extent

    def slice(self, z: float, grid: ImageGrid) -> Phantom:
        assert grid == self._grid
        return self._slices[round(z, 6)]


def hounsfield() -> None:
    """Print how far FBP of noise-free scans is from the truth at the effective energy, in soft tissue."""
    fan = clinical_fan_beam(views=492, bins=450)
    beams = [scanner_beam(fan, tube_voltage_kvp=voltage) for voltage in (80.0, 100.0, 120.0)]
    for name, anatomy in ANATOMIES.items():
        grid, fine = (ImageGrid(size, size, anatomy.field_of_view / size) for size in (256, 512))
        phantom = anatomy.build(np.random.default_rng(2)).slice(anatomy.height, fine)
        errors = []
        for beam, moments in zip(beams, simulate_moments(phantom, fan, beams), strict=True):
            scan = as_exposure(moments, fan, beam).scan(tube_current_ma=200.0, generator=None)
            projector = Projector(grid, fan, mu_water=scan.mu_water)
            image = fbp(take_log(scan).line_integrals, projector, kernel="ram-lak")
            known = truth(phantom, grid, energy=beam.effective_energy)
            errors.append(1000 * float((image - known)[soft_tissue_mask(known, margin=2)].mean()))
        print(f"{name:8} soft tissue at 80, 100, 120 kVp: " + ", ".join(f"{error:+.1f} HU" for error in errors))


def timing(rows: int) -> None:
    """Time both simulators in turns."""
    fan = clinical_fan_beam()
    beam = scanner_beam(fan)
    grid = ImageGrid(512, 512, spacing=450 / 512)
    body = ANATOMIES["chest"].build(np.random.default_rng(1))
    phantom = body.slice(0.0, grid)
    simulate_moments(phantom, fan, [beam])  # compiles, and makes the projector's tables
    ours, theirs = [], []
    for _ in range(3):
        ours.append(clocked(lambda: simulate_moments(phantom, fan, [beam])))
        theirs.append(clocked(lambda: catsim_moments(phantom, fan)))
    mine, other = (statistics.median(seconds) for seconds in (ours, theirs))
    materials = sum(bool(share.any()) for share in phantom.fractions) - 1
    print(f"one slice, {materials} materials: {mine:.2f} s, CatSim {other:.1f} s: {other / mine:.0f} times faster")
    painted = Painted(body, grid, rows)
    slices = [painted.slice(SLICE_THICKNESS * (row - (rows - 1) / 2), grid) for row in range(rows)]
    mine = clocked(lambda: [simulate_moments(each, fan, [beam]) for each in slices])
    other = clocked(lambda: catsim_moments(painted, fan, rows=rows, grid=grid))
    print(f"{rows} rows: {mine / rows:.2f} s a slice, CatSim {other / rows:.2f} s: {other / mine:.1f} times faster")
    exposure = as_exposure(*simulate_moments(phantom, fan, [beam]), fan, beam)
    generator = torch.Generator().manual_seed(0)
    draws = [clocked(lambda: exposure.scan(tube_current_ma=40.0, generator=generator)) for _ in range(9)]
    print(f"noise of {fan.views} x {fan.bins} rays: {1000 * statistics.median(draws):.0f} ms")


def clocked(work) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--rows", type=int, default=32)
    options = arguments.parse_args()
    mini()
    if FOLDER.exists():
        chest()
    hounsfield()
    timing(options.rows)


if __name__ == "__main__":
    main()
