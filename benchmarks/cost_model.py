"""What each part costs, what the machine could do, and a model of the projector's time; all on one thread.

    python benchmarks/cost_model.py [--quick]

A strip meets the rows of a block as T = 2 or 3 taps in each of the L lanes of a tile. With N(T) the (strip, row) pairs
of a scan, n tiles, and g(T, L) the time of a pair whose weights are given, forward or adjoint takes

    t = a · n Σ_T g(T, L) N(T)  +  b · n Σ_T N(T)  +  c · n L (pixels + rays)  +  d:

loads and multiply-adds; columns and weights, which all lanes share; changes of layout; the call. g is measured in the
same run, so that a should be 1; a to d are fitted, not negative, to the relative deviations over all slices, views and
pixels. Times are seconds of the processor.
"""

import argparse
import json
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from scipy.optimize import nnls

import micro_kernels as micro
from contenders import World
from interleaved import number, table
from pnpct.operators import Projector
from pnpct.operators.lane_kernels import aligned
from pnpct.operators.ray_lines import LEFT, RIGHT, RayLines, ray_lines
from pnpct.operators.strip_kernels import BLOCK, CHUNK, back_project, project, rows_together
from pnpct.operators.support import reach_of_blocks, reach_of_rows
from pnpct.operators.tiles import tile

DIRECTIONS = ("forward", "adjoint")


@dataclass(frozen=True)
class Work:
    """What one call has to do.

    Args:
        tiles: Passes over the strips.
        lanes: Numbers that each pixel of a tile has.
        slices: Images.
        two: (strip, row) pairs of a pass with two taps.
        three: The same with three.
        cells: Pixels and rays of a slice.
    """

    tiles: int
    lanes: int
    slices: int
    two: int
    three: int
    cells: int

    @property
    def taps(self) -> int:
        """Loads and multiply-adds of one number."""
        return self.tiles * self.lanes * (2 * self.two + 3 * self.three)

    @property
    def steps(self) -> int:
        """Columns and weights."""
        return self.tiles * (self.two + self.three)

    def terms(self, pair: tuple[float, float]) -> tuple[float, ...]:
        """Return what a, b, c and d of the model multiply; `pair` is g of two and three taps."""
        given = self.tiles * (pair[0] * self.two + pair[1] * self.three)
        return given, float(self.steps), float(self.tiles * self.lanes * self.cells), 1.0


def work_of(world: World) -> Work:
    """Count the work of a full turn of views a quarter turn apart."""
    (lines,) = ray_lines(world.grid, world.geometry(), "distance-driven")
    lanes, slices = tile(world.slices, len(lines.turns))
    two, three = met(lines, lanes)
    cells = world.size**2 + math.prod(world.geometry_shape)
    return Work(-(-world.slices // slices), lanes, world.slices, two, three, cells)


def met(lines: RayLines, lanes: int) -> tuple[int, int]:
    """Count (strip, row) pairs of blocks that a strip meets, with two and with three taps, as the kernel decides it."""
    rows, counts = rows_together(lanes), [0, 0]
    for row in range(0, lines.rows, rows):
        top = row - (lines.rows - 1) / 2
        left, wide = (
            [at + change * edge for edge in (top, top + rows - 1)]
            for at, change in ((lines.edge, lines.slope), (lines.width, lines.widening))
        )
        right = np.maximum(left[0] + wide[0], left[1] + wide[1])
        inside = (right > 0) & (np.minimum(*left) < lines.cols)
        broad = np.maximum(*wide) > 1
        counts[0] += rows * int((inside & ~broad).sum())
        counts[1] += rows * int((inside & broad).sum())
    return counts[0], counts[1]


@dataclass(frozen=True)
class Fit:
    """The model with its coefficients, and how far each measurement is from it."""

    coefficients: tuple[float, ...]
    deviations: tuple[float, ...]

    @property
    def worst(self) -> float:
        return max(map(abs, self.deviations))


def fitted(terms: Sequence[Sequence[float]], seconds: Sequence[float]) -> Fit:
    """Fit seconds = Σ coefficient · term with coefficients ≥ 0, least squares of the relative deviations."""
    rows = np.asarray(terms, float) / np.asarray(seconds, float)[:, None]
    scale = rows.max(axis=0)
    scale[scale == 0] = 1.0
    found, _ = nnls(rows / scale, np.ones(len(rows)))
    return Fit(tuple(found / scale), tuple(rows @ (found / scale) - 1))


def processor_seconds(call: Callable[[], object], rounds: int, least: float = 0.1) -> float:
    """Return the shortest time of a call after one to warm up, s of the processor; more rounds until `least`."""
    call()
    taken: list[float] = []
    while len(taken) < rounds or (sum(taken) < least and len(taken) < 50):
        began = time.process_time()
        call()
        taken.append(time.process_time() - began)
    return min(taken)


def limits() -> dict[str, float]:
    """Measure multiply-adds in registers, bytes copied, and operations of transforms and convolutions; each 1/s."""
    rates = {}
    for lanes in (8, 16):
        values, times = np.full(micro.CHAINS * lanes, 0.5, np.float32), 20_000
        seconds = processor_seconds(lambda v=values, n=lanes: micro.multiply_adds(v, 20_000, (0.0,) * n), 3)
        rates[lanes] = times * micro.CHAINS * micro.REPEATS * lanes / seconds
    source = torch.zeros(2**26)
    target, image = torch.zeros_like(source), torch.rand(512, 512)
    features, weights = (
        torch.rand(shape).to(memory_format=torch.channels_last) for shape in ((1, 32, 512, 512), (32, 32, 3, 3))
    )
    copy = processor_seconds(lambda: target.copy_(source), 3)
    there_and_back = processor_seconds(lambda: torch.fft.irfft2(torch.fft.rfft2(image), s=image.shape), 5)
    with torch.no_grad():
        convolution = processor_seconds(lambda: torch.nn.functional.conv2d(features, weights, padding=1), 3)
    return {
        "multiply-adds in registers, 1/s": max(rates.values()),
        "copy, bytes read and written, 1/s": 2 * 4 * source.numel() / copy,
        "transforms of 512 × 512, operations, 1/s": 5 * image.numel() * math.log2(image.numel()) / there_and_back,
        "convolution 32 to 32, 3 × 3, multiply-adds, 1/s": weights.numel() * image.numel() / convolution,
    }


def kernels(world: World, rounds: int) -> dict[str, dict[str, Any]]:
    """Time the kernels without changes of layout, and the same step with weights given; s per tile, one thread."""
    (lines,) = ray_lines(world.grid, world.geometry(), "distance-driven")
    work = work_of(world)
    columns = tuple(map(_aligned, (lines.edge, lines.slope, lines.width, lines.widening, lines.length)))
    image = aligned((-(-lines.rows // BLOCK) * BLOCK, LEFT + lines.cols + RIGHT, work.lanes))
    rays, zeros = aligned((lines.strips, work.lanes)), (0.0,) * work.lanes
    image[:], rays[:] = 1e-3, 1e-3
    reach = reach_of_blocks(reach_of_rows(lines, None), len(image), rows_together(work.lanes))
    shape = (lines.rows, lines.cols, reach)
    own: Mapping[str, Callable[[], object]] = {
        "forward": lambda: project(image, columns, rays, *shape, zeros, 0, lines.strips),
        "adjoint": lambda: back_project(image, columns, rays, *shape, (0.0,), zeros, 0, len(image)),
    }
    *arrays, shift, turnaround = micro.given(
        lines.cols, float(lines.width.mean()), float(np.abs(lines.slope).mean()), work.lanes
    )
    chunks = max(1, lines.strips // CHUNK // 8)
    pairs = chunks * CHUNK * len(arrays[0])
    found = {}
    for direction, inner in zip(DIRECTIONS, (micro.gather_given, micro.scatter_given), strict=True):
        per_pair = [
            processor_seconds(
                lambda w=wide, run=inner: run(*arrays, chunks, shift, turnaround, w, zeros), rounds, least=0.4
            )
            / pairs
            for wide in (False, True)
        ]
        limit = work.two * per_pair[0] + work.three * per_pair[1]
        kernel = processor_seconds(own[direction], rounds)
        found[direction] = {"kernel": kernel, "weights given": limit, "pair": tuple(per_pair)}
    return found


def _aligned(values: np.ndarray) -> np.ndarray:
    copy = aligned(values.shape)
    copy[:] = values
    return copy


def sweeps(quick: bool) -> dict[str, list[World]]:
    """Return the worlds in which one of slices, views and pixels changes over two octaves and more."""
    size, slices = (64, 4) if quick else (512, 8)
    whole = World(size, slices)
    views, bins = whole.geometry_shape
    return {
        "slices": [World(size, number) for number in (1, 2, 4, 8, *(() if quick else (16, 32, 64)))],
        "views": [World(size, slices, views=views // part // 4 * 4, bins=bins) for part in (4, 2, 1)],
        "pixels": [World(size // part, slices, views=views, bins=bins) for part in (4, 2, 1)],
    }


def timed(world: World, rounds: int) -> dict[str, float]:
    """Return the processor's seconds of a whole forward and adjoint call."""
    A = Projector(world.grid, world.geometry())
    x, y = map(torch.from_numpy, world.random())
    return {"forward": processor_seconds(lambda: A(x), rounds), "adjoint": processor_seconds(lambda: A.T(y), rounds)}


def measure(quick: bool) -> dict[str, Any]:
    """Measure everything, on one thread."""
    threads, rounds = torch.get_num_threads(), 2 if quick else 3
    torch.set_num_threads(1)
    try:
        points = [(axis, world) for axis, worlds in sweeps(quick).items() for world in worlds]
        times = [timed(world, rounds) for _, world in points]
        works = [work_of(world) for _, world in points]
        size = points[0][1].size
        per_tile = {slices: kernels(World(size, slices), rounds) for slices in (1, 2, 4, 8)}
        given = [per_tile[work.lanes // 4] for work in works]
        fits = {
            direction: fitted(
                [work.terms(tile[direction]["pair"]) for work, tile in zip(works, given, strict=True)],
                [seconds[direction] for seconds in times],
            ).__dict__
            for direction in DIRECTIONS
        }
        described = [
            {"axis": axis, **_described(world), "work": work.__dict__, "seconds": seconds}
            for (axis, world), work, seconds in zip(points, works, times, strict=True)
        ]
        return {"limits": limits(), "kernels": per_tile, "points": described, "fits": fits}
    finally:
        torch.set_num_threads(threads)


def _described(world: World) -> dict[str, int]:
    views, bins = world.geometry_shape
    return {"size": world.size, "slices": world.slices, "views": views, "bins": bins}


def tables(found: Mapping[str, Any]) -> str:
    """Return the measurements as Markdown."""
    rates = table(
        ("the machine, one thread", "10⁹"), [(name, number(rate / 1e9)) for name, rate in found["limits"].items()]
    )
    shares = []
    for slices, parts in found["kernels"].items():
        for direction, seconds in parts.items():
            own, limit = (1000 * seconds[name] / int(slices) for name in ("kernel", "weights given"))
            shares.append((f"{slices}", direction, number(own), number(limit), f"{limit / own:.0%}"))
    near = table(("slices in a tile", "direction", "kernel, ms per slice", "weights given", "reached"), shares)
    rows = []
    for index, point in enumerate(found["points"]):
        cells = [point["axis"], *(str(point[name]) for name in ("size", "slices", "views"))]
        for direction in DIRECTIONS:
            deviation = found["fits"][direction]["deviations"][index]
            cells += [number(1000 * point["seconds"][direction] / point["slices"]), f"{deviation:+.0%}"]
        rows.append(cells)
    head = ("changed", "pixels", "slices", "views", "forward, ms per slice", "model", "adjoint, ms per slice", "model")
    fits = []
    for direction in DIRECTIONS:
        fit = found["fits"][direction]
        a, b, c, d = fit["coefficients"]
        cells = [number(a), number(1e9 * b), number(1e9 * c), number(1000 * d)]
        fits.append((direction, *cells, f"{max(map(abs, fit['deviations'])):.0%}"))
    model = table(("direction", "a", "b, ns", "c, ns", "d, ms", "worst deviation"), fits)
    return "\n".join((rates, near, model, table(head, rows)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="small sizes: says that it runs, not how fast")
    parser.add_argument("--json", action="store_true", help="print the measurements, not tables")
    options = parser.parse_args()
    found = measure(options.quick)
    print(json.dumps(found) if options.json else tables(found))


if __name__ == "__main__":
    main()
