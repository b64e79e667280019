"""Time the projector of a cone beam against those of peers, on all cores.

    python benchmarks/cone_peers.py [--rounds 3]

Timed are 512 x 512 x 32 voxels, 32 rows of 900 bins on an arc, and part of the 984 views of a turn at rest: seconds on
the clock per slice for the whole turn, minima of rounds in which the packages alternate, tables and compiled code made
before. Each peer has the voxels that it wants, and pnpct the same ones: mbirjax cubes of 0.977 mm, LEAP voxels
that look as wide as a cell, 0.584 x 0.584 x 0.625 mm, which its fast code on a CPU needs. mbirjax is in the extra
"peers". LEAP is not on PyPI: its folder `src`, with `libleapct.so` in it, goes into PYTHONPATH. A peer that is not
there is left out, and said to be.
"""

import argparse
import time
from collections.abc import Callable

import numpy as np
import torch

from cone import DETECTOR, TURN
from pnpct.geometry import ConeBeam, ImageGrid, Trajectory, VolumeGrid
from pnpct.operators import ConeProjector

SOURCE_TO_ISOCENTER, SOURCE_TO_DETECTOR = 541.0, 949.0
SIZE, SLICES = 512, 32
OURS, THEIRS = 164, 24
"""Views that are timed: pnpct needs many to work as it does on a turn."""

Pair = tuple[Callable[[], object], Callable[[], object]]


def of_turn(views: int) -> ConeBeam:
    """Some of the views of a turn."""
    numbers = np.linspace(0, len(TURN), views, endpoint=False).astype(int)
    return ConeBeam(Trajectory(TURN)[numbers], DETECTOR, SOURCE_TO_ISOCENTER, SOURCE_TO_DETECTOR)


def pnpct(spacing: float, height: float) -> Pair:
    grid = VolumeGrid(ImageGrid(SIZE, SIZE, spacing=spacing), SLICES, height)
    A = ConeProjector(grid, of_turn(OURS), mu_water=1.0)
    x, y = torch.rand(A.domain_shape), torch.rand(A.range_shape)
    return lambda: A(x), lambda: A.T(y)


def mbirjax(spacing: float, _height: float) -> Pair:
    import mbirjax as package

    geometry = of_turn(THEIRS)
    shape = (THEIRS, DETECTOR.rows, DETECTOR.bins)
    angles = np.asarray(geometry.trajectory.angles, np.float32)
    model = package.ConeBeamModel(shape, angles, SOURCE_TO_DETECTOR, SOURCE_TO_ISOCENTER, use_curved_detector=True)
    model.set_params(
        delta_det_channel=DETECTOR.bin_width,
        delta_det_row=DETECTOR.row_height,
        delta_voxel=spacing,
        recon_shape=(SIZE, SIZE, SLICES),
        no_warning=True,
    )
    x, y = np.random.default_rng(1).random((SIZE, SIZE, SLICES), np.float32), np.ones(shape, np.float32)
    return lambda: np.asarray(model.forward_project(x)), lambda: np.asarray(model.back_project(y))


def leap(spacing: float, height: float) -> Pair:
    from leapctype import tomographicModels

    geometry = of_turn(THEIRS)
    model = tomographicModels()
    model.set_conebeam(
        THEIRS,
        DETECTOR.rows,
        DETECTOR.bins,
        DETECTOR.row_height,
        DETECTOR.bin_width,
        (DETECTOR.rows - 1) / 2,
        (DETECTOR.bins - 1) / 2 + DETECTOR.offset,
        np.degrees(np.asarray(geometry.trajectory.angles)).astype(np.float32),
        SOURCE_TO_ISOCENTER,
        SOURCE_TO_DETECTOR,
    )
    model.set_curvedDetector()
    model.set_volume(SIZE, SIZE, SLICES, spacing, height)
    rays, volume = model.allocate_projections(1.0), model.allocate_volume(1.0)
    return lambda: model.project(rays, volume), lambda: model.backproject(rays, volume)


AS_WIDE_AS_A_CELL = DETECTOR.bin_width * SOURCE_TO_ISOCENTER / SOURCE_TO_DETECTOR
PEERS = {"mbirjax": (mbirjax, 500 / SIZE, 500 / SIZE), "LEAP": (leap, AS_WIDE_AS_A_CELL, 0.625)}


def seconds(pair: Pair, views: int) -> np.ndarray:
    """What forward and adjoint take per slice and turn."""
    clock = [time.perf_counter()]
    for call in pair:
        call()
        clock.append(time.perf_counter())
    return np.diff(clock) * 984 / views / SLICES


def compare(name: str, rounds: int) -> None:
    make, *voxel = PEERS[name]
    try:
        theirs = make(*voxel)
    except ImportError as error:
        print(f"| {name} | is not there: {error} |")
        return
    ours = pnpct(*voxel)
    seconds(ours, OURS), seconds(theirs, THEIRS)
    times = np.array([[seconds(ours, OURS), seconds(theirs, THEIRS)] for _ in range(rounds)]).min(0)
    for who, (forward, adjoint) in zip(("pnpct", name), times, strict=True):
        pair, ratio = forward + adjoint, (forward + adjoint) / times[0].sum()
        voxels = " x ".join(f"{side:.3f}" for side in voxel)
        print(f"| {who} | {voxels} | {forward:.3f} | {adjoint:.3f} | {pair:.3f} | {ratio:.1f} |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    print("| s per slice | voxels, mm | forward | adjoint | pair | pair / pnpct |\n|---|---|---|---|---|---|")
    for name in PEERS:
        compare(name, options.rounds)


if __name__ == "__main__":
    main()
