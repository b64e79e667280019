"""What each part of a reconstruction costs a slice, on one thread: operations, bytes, seconds, and the machine's limit.

Operations are multiply-adds, or those of Fourier transforms, 5 n log2 n for one of n complex numbers and half of that
for real ones. Bytes are what has to come from memory and go there at least once, for slices that share a tile.
"""

import math
import time
from collections import defaultdict
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch

import torch

from contenders import World
from cost_model import processor_seconds, work_of
from interleaved import number, table
from pnpct.denoisers import LearnedDenoiser, TotalVariation
from pnpct.denoisers.network_cost import network_cost
from pnpct.operators import Projector
from pnpct.operators.fan_backprojector import FanBackprojector
from pnpct.operators.ramp_filter import ramp_filter
from pnpct.reconstruction import PlugAndPlay
from pnpct.reconstruction.fourier import LEVELS, fourier_preconditioner
from pnpct.reconstruction.normal_equations import penalty_of
from pnpct.reconstruction.pnp_admm import SIGMA_V
from tasks import Task, write_scan

MULTIPLY_ADDS, TRANSFORMS, CONVOLUTIONS = "multiply-adds", "transforms", "convolution"
"""Kinds of operations; the machine's rates begin with them."""


def measure(quick: bool) -> dict[str, Any]:
    """Measure the parts of eight slices, and where the time of a whole plug-and-play goes."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        with TemporaryDirectory() as folder:
            world = World(64 if quick else 512)
            write_scan(world, Path(folder) / "scan.npz")
            task = Task.read(world, str(Path(folder) / "scan.npz"))
        return {"parts": _parts(World(world.size, 8), task, 2 if quick else 3), "pnp": _profile(task)}
    finally:
        torch.set_num_threads(threads)


def _parts(world: World, task: Task, rounds: int) -> list[dict[str, Any]]:
    A, geometry, work = Projector(world.grid, world.geometry()), world.geometry(), work_of(world)
    x, y = map(torch.from_numpy, world.random())
    pixels, (views, bins) = world.size**2, world.geometry_shape
    rays, tables = views * bins, 5 * 4 * views * bins / 4 / world.slices
    back, length = FanBackprojector(world.grid, geometry), 2 * bins
    precondition = fourier_preconditioner(task.sinogram, task.projector)(penalty_of(SIGMA_V).reshape(1, 1))
    spacing, taps = float(geometry.fan_angles[1] - geometry.fan_angles[0]), work.taps / world.slices
    filtered = lambda: ramp_filter(y, spacing=spacing, equiangular=True, kernel="hann")  # noqa: E731
    network = network_cost(task.denoise.network, world.size, world.size)
    image = task.truth
    known: list[tuple[str, str, float, float, Callable[[], object], int]] = [
        ("forward", MULTIPLY_ADDS, taps, 4 * (pixels + rays) + tables, lambda: A(x), world.slices),
        ("adjoint", MULTIPLY_ADDS, taps, 4 * (pixels + rays) + tables, lambda: A.T(y), world.slices),
        ("ramp filter", TRANSFORMS, 5 * views * length * math.log2(length), 8 * rays, filtered, world.slices),
        (
            "back-projection of FBP",
            MULTIPLY_ADDS,
            2 * views * pixels,
            4 * (pixels + rays),
            lambda: back(y),
            world.slices,
        ),
        (
            f"preconditioner, {LEVELS} levels",
            TRANSFORMS,
            LEVELS * 5 * pixels * math.log2(pixels),
            (4 * LEVELS + 3) * 4 * pixels,
            lambda: precondition(image),
            1,
        ),
        (
            "network `n2n`",
            CONVOLUTIONS,
            float(network.multiply_adds),
            4 * (2 * pixels + network.parameters),
            lambda: task.denoise(image),
            1,
        ),
    ]
    return [
        {"part": part, "kind": kind, "operations": float(operations), "bytes": float(moved), "seconds": seconds}
        for part, kind, operations, moved, call, slices in known
        if (seconds := processor_seconds(call, rounds) / slices)
    ]


def _profile(task: Task) -> dict[str, Any]:
    """Return calls and seconds of the parts of a whole plug-and-play, and of all."""
    seconds, calls = defaultdict[str, float](float), defaultdict[str, int](int)

    def watched(name: Callable[..., str], original: Any) -> Any:
        def run(*arguments: Any, **options: Any) -> Any:
            began = time.process_time()
            result = original(*arguments, **options)
            seconds[name(*arguments, **options)] += time.process_time() - began
            calls[name(*arguments, **options)] += 1
            return result

        return run

    def projection(A: Projector, *_: Any, transpose: bool, squared: bool = False) -> str:
        kind = "diagonal of AᵀWA" if squared else "adjoint" if transpose else "forward"
        return kind if A.grid.rows == task.world.size else f"{kind}, {A.grid.rows} × {A.grid.cols}"

    names: list[tuple[type, str, Callable[..., str]]] = [
        (Projector, "_apply", projection),
        (FanBackprojector, "_sum", lambda *_, **__: "back-projection of FBP"),
        (LearnedDenoiser, "__call__", lambda *_, **__: "network `n2n`"),
        (TotalVariation, "__call__", lambda *_, **__: "total variation"),
    ]
    method = PlugAndPlay(task.denoise)
    method(task.sinogram, task.projector)
    with ExitStack() as stack:
        for owner, attribute, name in names:
            stack.enter_context(patch.object(owner, attribute, watched(name, getattr(owner, attribute))))
        began = time.process_time()
        made = method(task.sinogram, task.projector)
        whole = time.process_time() - began
    rest = {"the rest: transforms and sums": (1, whole - sum(seconds.values()))}
    found = {name: (calls[name], taken) for name, taken in seconds.items()} | rest
    return {"seconds": whole, "iterations": made.iterations, "parts": found, "size": task.world.size}


def tables(found: dict[str, Any], limits: dict[str, float]) -> str:
    """Return the parts, and where the time of plug-and-play goes, as Markdown."""

    def rate(kind: str) -> float:
        return next(rate for name, rate in limits.items() if name.startswith(kind))

    rows = []
    for part in found["parts"]:
        least = max(part["operations"] / rate(part["kind"]), part["bytes"] / rate("copy"))
        rows.append(
            (
                part["part"],
                f"{number(part['operations'] / 1e9)} · 10⁹ {part['kind']}",
                number(part["bytes"] / 1e6),
                number(1000 * least),
                number(1000 * part["seconds"]),
                f"{least / part['seconds']:.0%}",
            )
        )
    head = ("part, per slice", "operations", "bytes, 10⁶", "the machine's rate allows, ms", "takes, ms", "reached")
    pnp = found["pnp"]
    shares = [
        (name, str(calls), number(seconds), f"{seconds / pnp['seconds']:.0%}")
        for name, (calls, seconds) in sorted(pnp["parts"].items(), key=lambda each: -each[1][1])
    ]
    whole = f"plug-and-play, {pnp['size']} × {pnp['size']}, {pnp['iterations']} iterations"
    shares.append((whole, "1", number(pnp["seconds"]), "100%"))
    return table(head, rows) + "\n" + table(("part", "calls", "s", "of all"), shares)
