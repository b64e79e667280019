"""Time the projector of a cone beam against a plain loop.

    python benchmarks/cone.py [--views 164] [--rounds 5]

Timed are 512 x 512 pixels over 500 mm, 32 slices of 0.625 mm, 32 rows of 900 bins, and part of the 984 views of a turn
at rest, on one thread: seconds of the processor's time per slice for the whole turn, medians of interleaved rounds. The
plain loop is compiled by numba too, and has the same strips, ray by ray and voxel by voxel; it goes over four of the
views. The tables of rays, which are made once, are not timed.
"""

import argparse
import math
import statistics
import time

import numpy as np
import torch
from numba import njit

from pnpct.geometry import ConeBeam, Detector, ImageGrid, Trajectory, VolumeGrid, evenly_spaced_views
from pnpct.operators import ConeProjector
from pnpct.operators.cone.cone_lines import cone_lines, view_heights

DETECTOR = Detector(bins=900, bin_width=1.0239, offset=0.25, rows=32, row_height=0.625 * 949 / 541)
TURN = evenly_spaced_views(984)
GRID = VolumeGrid(ImageGrid(512, 512, spacing=500 / 512), 32, 0.625)


@njit(fastmath=True)
def plain(volume, lines, cells, heights, rows, rays, transpose):
    """Sum every ray [view][row][bin] over rows of a volume [row][column][slice], or the transpose."""
    edge, slope, width, widening, length = lines
    number, view, part, change, nearness = cells
    low, rise, step, above = heights
    height, cols, slices = volume.shape
    bins = rays.shape[2]
    for strip in range(len(edge)):
        seen, cell_bin = view[strip], number[strip] % bins
        for row in range(rows):
            rising = above[seen, row] * nearness[strip]
            path = length[strip] * math.sqrt(1 + rising * rising)
            total, value = np.float32(0), rays[seen, row, cell_bin] * path
            for line in range(height):
                from_middle = np.float32(line - (height - 1) / 2)
                left = edge[strip] + slope[strip] * from_middle
                wide = max(width[strip] + widening[strip] * from_middle, np.float32(1e-6))
                t = part[strip] + change[strip] * from_middle
                bottom = low[seen] + t * (rise[seen] + row * step)
                tall = t * step
                first, last = max(math.floor(left), 0), min(math.floor(left + wide), cols - 1)
                lowest, highest = max(math.floor(bottom), 0), min(math.floor(bottom + tall), slices - 1)
                for col in range(first, last + 1):
                    across = min(left + wide, col + 1) - max(left, col)
                    for z in range(lowest, highest + 1):
                        up = min(bottom + tall, z + 1) - max(bottom, z)
                        share = np.float32(across * up / (wide * tall))
                        if transpose:
                            volume[line, col, z] += share * value
                        else:
                            total += share * volume[line, col, z]
            if not transpose:
                rays[seen, row, cell_bin] = total * path


def plain_pair(geometry: ConeBeam, volume: np.ndarray, rays: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    heights = view_heights(GRID, geometry)
    volume = np.ascontiguousarray(np.moveaxis(volume, 0, -1))
    projected, back = np.zeros(geometry.shape, np.float32), np.zeros_like(volume)
    for table in cone_lines(GRID, geometry):
        strips = table.strips
        lines = (strips.edge, strips.slope, strips.width, strips.widening, strips.length)
        cells = (strips.measured[:, 0], table.view, table.part, table.change, table.nearness)
        levels = (heights.low, heights.rise, heights.step, heights.cells)
        turn = strips.turns[0]
        turned = np.rot90(volume, -turn)
        plain(turned, lines, cells, levels, geometry.rows, projected, False)
        plain(np.rot90(back, -turn), lines, cells, levels, geometry.rows, rays, True)
    return projected, np.moveaxis(back, -1, 0)


def seconds(call) -> float:
    began = time.process_time()
    call()
    return time.process_time() - began


def compare(views: int, rounds: int) -> None:
    torch.set_num_threads(1)
    numbers = np.linspace(0, 984, views, endpoint=False).astype(int)
    geometry = ConeBeam(Trajectory(TURN)[numbers], DETECTOR, 541.0, 949.0)
    few = geometry[:: max(1, views // 4)]
    A, B = ConeProjector(GRID, geometry, mu_water=1.0), ConeProjector(GRID, few, mu_water=1.0)
    x, y = torch.rand(A.domain_shape), torch.rand(A.range_shape)
    few_y = torch.rand(few.shape)
    projected, back = plain_pair(few, x.numpy(), few_y.numpy())
    for ours, theirs in ((B(x), projected), (B.T(few_y), back)):
        difference = (ours - torch.from_numpy(theirs.copy())).norm() / ours.norm()
        print(f"Difference from the plain loop: {float(difference):.1e}")
    A(x), A.T(y)
    times: dict[str, list[float]] = {"forward": [], "adjoint": [], "plain pair": []}
    for _ in range(rounds):
        times["forward"].append(seconds(lambda: A(x)) * 984 / views / GRID.slices)
        times["plain pair"].append(seconds(lambda: plain_pair(few, x.numpy(), few_y.numpy())) * 984 / few.views / 32)
        times["adjoint"].append(seconds(lambda: A.T(y)) * 984 / views / GRID.slices)
    median = {name: statistics.median(values) for name, values in times.items()}
    pair = median["forward"] + median["adjoint"]
    print("| forward | adjoint | pair | plain pair | plain / this |\n|---|---|---|---|---|")
    print(
        f"| {median['forward']:.3f} | {median['adjoint']:.3f} | {pair:.3f} | {median['plain pair']:.1f} "
        f"| {median['plain pair'] / pair:.0f} |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--views", type=int, default=164)
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    compare(options.views, options.rounds)


if __name__ == "__main__":
    main()
