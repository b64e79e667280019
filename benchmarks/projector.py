"""Time the projector and FBP on full turns, short scans and uneven views against named peers, in one process.

    python benchmarks/projector.py [--rounds 5] [--skip svmbir torchtomo ...]

512 x 512 pixels over 500 mm, 900 bins, 984 views, float32; milliseconds per slice, the minimum and the median over the
rounds, changes of layout and new output arrays included. The peers are set up in `contenders.py`; one that is missing
is left out. Ratios are of minima, pair of forward and adjoint against ours. `bench.py` has more sizes and more peers.
"""

import argparse
import importlib.util
import math
import resource
import statistics
import time
from dataclasses import replace
from typing import Any

import torch

from contenders import PEERS, Call, World, pnpct
from pnpct.geometry import FanBeam, evenly_spaced_views
from pnpct.operators import Projector

WORLD = World(512)
SIZE, SPACING, VIEWS = WORLD.size, WORLD.spacing, WORLD.geometry_shape[0]
GRID = WORLD.grid
FULL_TURN = WORLD.geometry()


def with_views(angles: Any) -> FanBeam:
    return replace(FULL_TURN, view_angles=tuple(angles))


SCANS = {
    "arc": FULL_TURN,
    "985 views": with_views(evenly_spaced_views(985)),
    "986 views": with_views(evenly_spaced_views(986)),
    "short scan": with_views(FULL_TURN.view_angles[:660]),
    "gaps": with_views(a for n, a in enumerate(FULL_TURN.view_angles) if n % 100 < 80),
}


def ours(scan: str, slices: int, threads: int, method: Any = "distance-driven") -> tuple[Call, Call]:
    A = Projector(GRID, SCANS[scan], method=method)
    x, y = torch.rand(slices, SIZE, SIZE), torch.rand(slices, *A.range_shape)

    def on_threads(call: Call) -> Call:
        def run() -> None:
            torch.set_num_threads(threads)
            call()

        return run

    return on_threads(lambda: A(x)), on_threads(lambda: A.T(y))


def measure(contenders: dict[str, tuple[int, Call, Call]], rounds: int) -> dict[str, tuple[float, float, float]]:
    """Return for each contender the minimum forward, minimum adjoint and median pair, ms per slice."""
    times: dict[str, tuple[list[float], list[float]]] = {name: ([], []) for name in contenders}
    for number in range(rounds + 1):
        for name, (slices, forward, adjoint) in contenders.items():
            for call, into in zip((forward, adjoint), times[name], strict=True):
                began = time.perf_counter()
                call()
                if number:  # the first round warms up
                    into.append(1000 * (time.perf_counter() - began) / slices)
    return {
        name: (min(forward), min(adjoint), statistics.median(map(sum, zip(forward, adjoint, strict=True))))
        for name, (forward, adjoint) in times.items()
    }


def compare_projectors(rounds: int, skip: list[str]) -> None:
    contenders: dict[str, tuple[int, Call, Call]] = {}
    for method in ("distance-driven", "joseph"):
        for slices in (1, 8):
            for threads in (1, 2):
                name = f"pnpct {method}, {slices} slices, {threads} threads"
                contenders[name] = (slices, *ours("arc", slices, threads, method))
    for scan in list(SCANS)[1:]:
        for slices in (1, 8):
            contenders[f"pnpct {scan}, {slices} slices, 2 threads"] = (slices, *ours(scan, slices, 2))
    for name in ("astra line_fanflat", "astra strip_fanflat", "svmbir fan-curved"):
        if available(PEERS[name].module, skip):
            parts = PEERS[name].make(WORLD)
            contenders[name] = (1, parts["forward"], parts["adjoint"])
    results = measure(contenders, rounds)
    peers = [name for name in results if not name.startswith("pnpct")]
    print("| projector | forward | adjoint | pair | median pair |" + "".join(f" {peer} / this |" for peer in peers))
    print("|---|" + "---|" * (4 + len(peers)))
    for name, (forward, adjoint, median) in results.items():
        pair = forward + adjoint
        ratios = "".join(f" {sum(results[peer][:2]) / pair:.0f} |" for peer in peers)
        print(f"| {name} | {forward:.1f} | {adjoint:.1f} | {pair:.1f} | {median:.1f} |{ratios}")


def compare_fbp(rounds: int, skip: list[str]) -> None:
    calls: dict[str, tuple[int, Call, Call]] = {}
    for slices in (1, 8):
        calls[f"pnpct fbp, {slices} slices"] = (slices, pnpct(World(SIZE, slices))["fbp"], lambda: None)
    if available("torchtomo", skip):
        fbp = PEERS["torchtomo FBP"].make(World(SIZE, 8))["fbp"]
        calls["torchtomo fbp, 8 slices"] = (8, fbp, lambda: None)
    torch.set_num_threads(2)
    results = measure(calls, rounds)
    print("\n| FBP, 2 threads | ms per slice | median | torchtomo / this |\n|---|---|---|---|")
    peer = results.get("torchtomo fbp, 8 slices")
    for name, (best, _, median) in results.items():
        print(f"| {name} | {best:.1f} | {median:.1f} | {peer[0] / best if peer else math.nan:.1f} |")


def available(peer: str, skip: list[str]) -> bool:
    return peer not in skip and importlib.util.find_spec(peer) is not None


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--skip", nargs="*", default=[])
    options = parser.parse_args()
    compare_projectors(options.rounds, options.skip)
    own = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    print(f"\nPeak memory of this process so far, peers included: {own:.2f} GiB")
    compare_fbp(options.rounds, options.skip)


if __name__ == "__main__":
    main()
