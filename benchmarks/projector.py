"""Time the projector and FBP against named peers, interleaved in one process.

    python benchmarks/projector.py [--rounds 5] [--skip svmbir torchtomo ...]

512 x 512 pixels over 500 mm, 900 bins, 984 views, float32; milliseconds per slice, the minimum and the median over the
rounds, changes of layout and new output arrays included. Peers: astra-toolbox (flat detector: it has no arc, and one
thread: its CPU code has no more), svmbir (arc; its system matrix is built before, and read from disk at each call),
torchtomo (flat; FBP through its CPU path). `pip install 'pnpct[peers]'` has them; a peer that is missing is left out.
Ratios are of minima, pair of forward and adjoint against ours.
"""

import argparse
import importlib.util
import math
import resource
import statistics
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import torch

from pnpct.geometry import FanBeam, ImageGrid, evenly_spaced_views
from pnpct.operators import Projector
from pnpct.reconstruction import fbp

SIZE, SPACING, BINS, VIEWS = 512, 500 / 512, 900, 984
DISTANCES = {"source_to_isocenter": 541.0, "source_to_detector": 949.0, "bin_width": 1.0239}
GRID = ImageGrid(SIZE, SIZE, spacing=SPACING)
FULL_TURN = FanBeam(evenly_spaced_views(VIEWS), BINS, **DISTANCES)
SCANS = {
    "arc": FULL_TURN,
    "985 views": FanBeam(evenly_spaced_views(985), BINS, **DISTANCES),
    "986 views": FanBeam(evenly_spaced_views(986), BINS, **DISTANCES),
    "short scan": FanBeam(FULL_TURN.view_angles[:660], BINS, **DISTANCES),
    "gaps": FanBeam([a for n, a in enumerate(FULL_TURN.view_angles) if n % 100 < 80], BINS, **DISTANCES),
}

Call = Callable[[], object]


def ours(scan: str, slices: int, threads: int, method: Any = "distance-driven") -> tuple[Call, Call]:
    A = Projector(GRID, SCANS[scan], method=method)
    x, y = torch.rand(slices, SIZE, SIZE), torch.rand(slices, *A.range_shape)

    def on_threads(call: Call) -> Call:
        def run() -> None:
            torch.set_num_threads(threads)
            call()

        return run

    return on_threads(lambda: A(x)), on_threads(lambda: A.T(y))


def astra(kind: str) -> tuple[Call, Call]:
    import astra as toolbox

    # In pixels, as ASTRA wants them for a volume of unit pixels.
    distance, to_detector = (length / SPACING for length in (541.0, 949.0 - 541.0))
    volume = toolbox.create_vol_geom(SIZE, SIZE)
    angles = np.linspace(0, 2 * math.pi, VIEWS, endpoint=False)
    rays = toolbox.create_proj_geom("fanflat", 1.0239 / SPACING, BINS, angles, distance, to_detector)
    operator = toolbox.OpTomo(toolbox.create_projector(kind, rays, volume))
    x = np.random.default_rng(0).random((SIZE, SIZE), np.float32)
    y = np.random.default_rng(1).random((VIEWS, BINS), np.float32)
    return lambda: operator.FP(x), lambda: operator.BP(y)


def svmbir() -> tuple[Call, Call]:
    import svmbir as package

    angles = np.linspace(0, 2 * math.pi, VIEWS, endpoint=False)
    fan = {
        "geometry": "fan-curved",
        "dist_source_detector": 949.0,
        "magnification": 949.0 / 541.0,
        "delta_channel": 1.0239,
        "delta_pixel": SPACING,
        "roi_radius": 250.0,
        "num_threads": torch.get_num_threads(),
        "verbose": 0,
    }
    x = np.random.default_rng(0).random((1, SIZE, SIZE), np.float32)
    y = np.random.default_rng(1).random((VIEWS, 1, BINS), np.float32)
    return (
        lambda: package.project(x, angles, BINS, **fan),
        lambda: package.backproject(y, angles, num_rows=SIZE, num_cols=SIZE, **fan),
    )


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
    if available("astra", skip):
        contenders["astra line_fanflat"] = (1, *astra("line_fanflat"))
        contenders["astra strip_fanflat"] = (1, *astra("strip_fanflat"))
    if available("svmbir", skip):
        contenders["svmbir fan-curved"] = (1, *svmbir())
    results = measure(contenders, rounds)
    peers = [name for name in results if not name.startswith("pnpct")]
    print("| projector | forward | adjoint | pair | median pair |" + "".join(f" {peer} / this |" for peer in peers))
    print("|---|" + "---|" * (4 + len(peers)))
    for name, (forward, adjoint, median) in results.items():
        pair = forward + adjoint
        ratios = "".join(f" {sum(results[peer][:2]) / pair:.0f} |" for peer in peers)
        print(f"| {name} | {forward:.1f} | {adjoint:.1f} | {pair:.1f} | {median:.1f} |{ratios}")


def compare_fbp(rounds: int, skip: list[str]) -> None:
    A = Projector(GRID, FULL_TURN)
    calls: dict[str, tuple[int, Call, Call]] = {}
    for slices in (1, 8):
        y = torch.rand(slices, VIEWS, BINS)
        calls[f"pnpct fbp, {slices} slices"] = (slices, lambda y=y: fbp(y, A), lambda: None)
    if available("torchtomo", skip):
        calls["torchtomo fbp, 8 slices"] = (8, torchtomo_fbp(8), lambda: None)
    torch.set_num_threads(2)
    results = measure(calls, rounds)
    print("\n| FBP, 2 threads | ms per slice | median | torchtomo / this |\n|---|---|---|---|")
    peer = results.get("torchtomo fbp, 8 slices")
    for name, (best, _, median) in results.items():
        print(f"| {name} | {best:.1f} | {median:.1f} | {peer[0] / best if peer else math.nan:.1f} |")


def torchtomo_fbp(slices: int) -> Call:
    import torchtomo

    peer = torchtomo.FanBeam(
        img_size=SIZE,
        n_angles=VIEWS,
        n_det=BINS,
        src_dist=541.0 / SPACING,
        det_dist=408.0 / SPACING,
        det_spacing=1.0239 / SPACING,
        backend="torch",
    )
    y = torch.rand(slices, 1, VIEWS, BINS)
    return lambda: peer.fbp(y)


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
