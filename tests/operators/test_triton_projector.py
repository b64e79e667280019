"""The kernels of a GPU, on one where there is one, and in Triton's interpreter otherwise."""

import math
import os
import subprocess
import sys
from dataclasses import replace
from importlib.util import find_spec
from types import SimpleNamespace

import pytest
import torch

from pnpct.geometry import FanBeam, ImageGrid, evenly_spaced_views
from pnpct.operators import FanBackprojector, Projector
from pnpct.operators.ray_lines import ray_lines
from pnpct.operators.torch_projector import TorchProjector

pytestmark = pytest.mark.skipif(
    find_spec("triton") is None, reason="needs Triton: PyTorch for CUDA brings it, and on Linux the extra `dev`"
)

FAN = FanBeam(
    view_angles=evenly_spaced_views(8),
    bins=30,
    source_to_isocenter=541.0,
    source_to_detector=949.0,
    bin_width=30.0,
)
GRID = ImageGrid(18, 18, spacing=25.0)

WORLDS = {
    "arc": (FAN, GRID, "distance-driven"),
    "joseph": (FAN, GRID, "joseph"),
    "flat, offset": (replace(FAN, detector="flat", detector_offset=-3.3), GRID, "distance-driven"),
    "odd views": (replace(FAN, view_angles=evenly_spaced_views(5)), GRID, "distance-driven"),
    "odd views, joseph": (replace(FAN, view_angles=evenly_spaced_views(5)), GRID, "joseph"),
    "wide": (FAN, ImageGrid(12, 18, spacing=25.0), "distance-driven"),
    "tall, odd": (FAN, ImageGrid(18, 13, spacing=25.0), "distance-driven"),
    "short scan": (replace(FAN, view_angles=evenly_spaced_views(6, span=math.radians(240))), GRID, "distance-driven"),
    "small pixels": (FAN, ImageGrid(16, 16, spacing=5.0, center=(40.0, -25.0)), "distance-driven"),
    "moving focal spot": (
        replace(FAN, focal_spot_shifts=[(2.0 * (n % 2), 1.0) for n in range(8)]),
        GRID,
        "distance-driven",
    ),
    "one bin": (replace(FAN, bins=1), GRID, "joseph"),
}

DEVICE = torch.device("cuda" if torch.cuda.is_available() else "cpu")


@pytest.fixture(scope="module")
def on_gpu():
    """The modules of the kernels, with programs so large that the interpreter has few of them."""
    with pytest.MonkeyPatch.context() as patch:
        if DEVICE.type == "cpu":
            patch.setenv("TRITON_INTERPRET", "1")
        from pnpct.operators import triton_backprojector, triton_projector

        if DEVICE.type == "cpu":
            patch.setattr(triton_projector, "NUMBERS", 1 << 13)
        yield SimpleNamespace(
            TritonProjector=triton_projector.TritonProjector, back_project_fan=triton_backprojector.back_project_fan
        )
    for name in ("triton_kernels", "triton_projector", "triton_backprojector"):
        del sys.modules[f"pnpct.operators.{name}"]


@pytest.mark.parametrize("world", WORLDS)
def test_triton_equals_plain_torch_and_has_an_exact_adjoint(world, on_gpu, generator):
    geometry, grid, method = WORLDS[world]
    what = ray_lines(grid, geometry, method), grid.shape, geometry.views * geometry.bins, DEVICE
    plain, fast = TorchProjector(*what), on_gpu.TritonProjector(*what)
    slices = 3 if world in ("arc", "odd views") else 1
    x = torch.rand(slices, *grid.shape, generator=generator).to(DEVICE)
    y = torch.rand(slices, geometry.views * geometry.bins, generator=generator).to(DEVICE)
    Ax, Aty = fast.project(x), fast.back_project(y)
    for ours, theirs in (
        (Ax, plain.project(x)),
        (Aty, plain.back_project(y)),
        (fast.back_project(y, squared=True), plain.back_project(y, squared=True)),
    ):
        torch.testing.assert_close(ours, theirs, rtol=1e-5, atol=2e-6 * float(theirs.max()))
    gap = (Ax.double() * y).sum() - (x * Aty.double()).sum()
    assert abs(float(gap)) <= 1e-6 * float(Ax.norm() * y.norm())


def test_a_second_run_and_other_tiles_and_blocks_have_the_same_bytes(on_gpu, generator, monkeypatch):
    what = ray_lines(GRID, FAN, "distance-driven"), GRID.shape, FAN.views * FAN.bins, DEVICE
    x = torch.rand(3, *GRID.shape, generator=generator).to(DEVICE)
    y = torch.rand(3, FAN.views * FAN.bins, generator=generator).to(DEVICE)
    fast = on_gpu.TritonProjector(*what)
    Ax, Aty = fast.project(x), fast.back_project(y)
    assert torch.equal(fast.project(x), Ax)  # the transpose has left nothing behind
    assert torch.equal(fast.back_project(y), Aty)
    monkeypatch.setattr("pnpct.operators.tiles.LANES", 8)  # two slices at a time
    monkeypatch.setattr("pnpct.operators.triton_projector.NUMBERS", 1 << 10)
    assert torch.equal(fast.project(x), Ax)
    assert torch.equal(fast.back_project(y), Aty)


@pytest.mark.parametrize("world", ["arc", "flat, offset", "wide"])
def test_fbp_sums_on_a_gpu_as_on_a_cpu(world, on_gpu, generator):
    geometry, grid, _ = WORLDS[world]
    back_project = FanBackprojector(grid, geometry)
    rays = torch.rand(3, *geometry.shape, generator=generator)
    expected = back_project(rays)
    image = on_gpu.back_project_fan(rays.to(DEVICE), grid, geometry, back_project.bins)
    torch.testing.assert_close(image.cpu(), expected, rtol=1e-5, atol=2e-6 * float(expected.max()))


def test_a_cuda_device_has_the_kernels_of_triton(on_gpu, monkeypatch):
    A = Projector(GRID, FAN)
    anywhere = torch.device("meta")
    assert type(A._make_kernels(anywhere)) is TorchProjector
    monkeypatch.setattr("pnpct.operators.projector.triton_runs_on", lambda device: device is anywhere)
    assert type(A._make_kernels(anywhere)) is on_gpu.TritonProjector


def test_the_kernels_compile_for_a_gpu_that_is_not_there(tmp_path):
    """For an H100 or H200, by Triton and its assembler."""
    done = subprocess.run(
        [sys.executable, "-c", COMPILE],
        env={**os.environ, "TRITON_CACHE_DIR": str(tmp_path), "TRITON_INTERPRET": "0"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stderr == ""
    assert done.stdout.split() == ["project", "back_project", "back_project_fan"]


COMPILE = """
import triton
from triton.backends.compiler import GPUTarget
from triton.compiler import ASTSource
from pnpct.operators import triton_kernels as kernels

integers = {"strips", "rows", "cols", "stride", "count", "bins"}
numbers = {"apex_width", "x0", "y0", "spacing", "distance", "scale", "offset"}
block = {"DOWN": 2, "ACROSS": 8, "SIZE": 32}
for kernel, constants in (
    (kernels.project, {"SIZE": 32, "STRIPS": 16}),
    (kernels.back_project, {**block, "PARTS": 2, "GRAINS": 4096, "SQUARED": True}),
    (kernels.back_project_fan, {**block, "ARC": True}),
):
    types = dict.fromkeys(integers, "i32") | dict.fromkeys(numbers, "fp32") | dict.fromkeys(("ends", "starts"), "*i32")
    signature = {
        name: "constexpr" if name in constants else types.get(name, "*fp32") for name in kernel.arg_names
    }
    compiled = triton.compile(ASTSource(kernel, signature, constants), target=GPUTarget("cuda", 90, 32))
    if compiled.asm["cubin"]:
        print(kernel.__name__)
"""
