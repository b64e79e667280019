import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from pnpct.geometry import FanBeam, ImageGrid, evenly_spaced_views
from pnpct.operators import FanBackprojector, Projector
from pnpct.reconstruction import fbp
from pnpct.units import to_hu

FAN = FanBeam(
    view_angles=evenly_spaced_views(984),
    bins=900,
    source_to_isocenter=541.0,
    source_to_detector=949.0,
    bin_width=1.0239,
    detector_offset=0.25,
)
HALF_FAN = math.degrees(FAN.fan_angle_edges[-1])
MU_WATER = 0.02

SCANS = {
    "arc, full turn": FAN,
    "flat, full turn": replace(FAN, detector="flat", bin_width=1.1),
    "views not divisible by four": replace(FAN, view_angles=evenly_spaced_views(985)),
    "short scan": replace(FAN, view_angles=evenly_spaced_views(656, span=math.radians(181 + 2 * HALF_FAN))),
    "more than a short scan": replace(FAN, view_angles=evenly_spaced_views(820, span=math.radians(300))),
    "flat, short scan": replace(
        FAN,
        detector="flat",
        bin_width=1.1,
        view_angles=evenly_spaced_views(656, span=math.radians(186 + 2 * HALF_FAN)),
    ),
    "detector moved aside": replace(FAN, bins=520, detector_offset=200.25),
    "flat, moved aside": replace(FAN, bins=520, detector_offset=-200.25, detector="flat"),
    "gaps": replace(FAN, view_angles=[a for a in evenly_spaced_views(984) if not 0.7 < a % 1.0 <= 1.0 or a > 2.0]),
    "any order, from 1 rad": replace(FAN, view_angles=evenly_spaced_views(984, start=1.0)[::-1]),
    "flying focal spot": replace(FAN, focal_spot_shifts=[(0.4 * (n % 2) - 0.2, 5.45 * (n % 2)) for n in range(984)]),
    "flying focal spot, flat, short scan": replace(
        FAN,
        detector="flat",
        bin_width=1.1,
        view_angles=evenly_spaced_views(656, span=math.radians(186 + 2 * HALF_FAN)),
        focal_spot_shifts=[(1.2 * (n // 2 % 2), 3.0 * (n % 2)) for n in range(656)],
    ),
    "two turns": replace(FAN, view_angles=evenly_spaced_views(1968, span=4 * math.pi)),
}


def water_disc(geometry: FanBeam, center=(0.0, 0.0), radius=100.0) -> torch.Tensor:
    """Exact line integrals of a disc of water."""
    spots = geometry.focal_spots()[:, None]
    towards = geometry.detector_points(geometry.fan_angles) - spots
    towards /= np.linalg.norm(towards, axis=-1, keepdims=True)
    apart = np.asarray(center) - spots
    aside = apart[..., 0] * towards[..., 1] - apart[..., 1] * towards[..., 0]
    return torch.from_numpy(MU_WATER * 2 * np.sqrt(np.maximum(radius**2 - aside**2, 0))).float()


@pytest.mark.parametrize("name", SCANS)
def test_a_water_disc_is_zero_hu_in_air_of_minus_a_thousand(name):
    geometry = SCANS[name]
    grid = ImageGrid(128, 128, spacing=500 / 128)
    center = (0.0, 0.0) if "order" in name else (40.0, -25.0)
    image_hu = to_hu(fbp(water_disc(geometry, center), Projector(grid, geometry, mu_water=MU_WATER))).numpy()
    from_center = np.hypot(grid.x[None] - center[0], grid.y[:, None] - center[1])
    from_axis = np.hypot(grid.x[None], grid.y[:, None])
    inside, outside = image_hu[from_center < 95], image_hu[(from_center > 106) & (from_axis < 235)]
    assert abs(inside.mean()) < 0.5
    assert abs(outside.mean() + 1000) < 1
    assert inside.std() < 1.5  # ringing at the edge
    # Rings: the mean at every radius, edge excluded.
    radii = from_center[from_center < 90]
    rings = [image_hu[from_center < 90][(radii >= r) & (radii < r + 10)].mean() for r in range(0, 90, 10)]
    assert np.abs(rings).max() < 0.5


@pytest.mark.parametrize("kernel", ["ram-lak", "shepp-logan", "hann", "soft"])
def test_every_kernel_keeps_the_mean(kernel):
    geometry = replace(FAN, view_angles=evenly_spaced_views(240))
    grid = ImageGrid(128, 128, spacing=2.0)
    image_hu = to_hu(fbp(water_disc(geometry), Projector(grid, geometry, mu_water=MU_WATER), kernel=kernel))
    inside = np.hypot(grid.x[None], grid.y[:, None]) < 90
    assert abs(float(image_hu[torch.from_numpy(inside)].mean())) < 0.5


def test_turned_lanes_and_plain_torch_give_the_same_backprojection(generator):
    for name in ("arc, full turn", "flat, short scan"):
        few = replace(SCANS[name], view_angles=SCANS[name].view_angles[::41], bins=90, bin_width=10.0)
        for grid in (ImageGrid(30, 30, spacing=14.0), ImageGrid(21, 30, spacing=10.0, center=(20.0, 5.0))):
            rays = torch.rand(2, *few.shape, generator=generator)
            back_project = FanBackprojector(grid, few)
            expected = back_project._anywhere(rays)
            torch.testing.assert_close(back_project(rays), expected, rtol=1e-4, atol=1e-4 * float(expected.max()))


def few_rays(name: str) -> FanBeam:
    geometry = SCANS[name]
    shifts = geometry.focal_spot_shifts and geometry.focal_spot_shifts[::41]
    coarse = {"bins": round(0.1 * geometry.bins), "bin_width": 10.0, "detector_offset": 0.1 * geometry.detector_offset}
    return replace(geometry, view_angles=geometry.view_angles[::41], focal_spot_shifts=shifts, **coarse)


@pytest.mark.parametrize("name", SCANS)
def test_the_gradient_of_fbp_is_its_transpose_and_the_gradient_of_that_is_fbp(name, generator):
    geometry, grid = few_rays(name), ImageGrid(24, 20, spacing=16.0, center=(20.0, 5.0))
    A = Projector(grid, geometry, mu_water=MU_WATER)
    y = torch.randn(2, *geometry.shape, generator=generator).requires_grad_()
    x = torch.randn(2, *grid.shape, generator=generator).requires_grad_()
    image = fbp(y, A, kernel="hann")
    (gradient,) = torch.autograd.grad((image * x).sum(), y, create_graph=True)
    inner, scale = (image * x).sum().item(), (image.norm() * x.norm()).item()
    assert abs((gradient * y).sum().item() - inner) < 1e-5 * scale
    (again,) = torch.autograd.grad((gradient * y.detach()).sum(), x)
    torch.testing.assert_close(again, image.detach(), rtol=1e-4, atol=1e-5 * float(image.detach().abs().max()))


def test_back_projection_has_an_adjoint_on_every_grid(generator):
    for name in ("arc, full turn", "flat, short scan"):  # a square grid takes turned lanes where it can
        for grid in (ImageGrid(30, 30, spacing=14.0), ImageGrid(21, 30, spacing=10.0, center=(20.0, 5.0))):
            back_project = FanBackprojector(grid, few_rays(name))
            q = torch.randn(3, *back_project.domain_shape, generator=generator)
            g = torch.randn(3, *grid.shape, generator=generator)
            image = back_project @ q
            difference = (image * g).sum() - (q * (back_project.T @ g)).sum()
            assert abs(difference.item()) < 1e-5 * (image.norm() * g.norm()).item()


def test_what_fbp_cannot_do_is_said():
    moving = replace(FAN, view_angles=(0.0, 1.0), focal_spot_shifts=[(1.0, 0.0), (0.0, 0.0)])
    with pytest.raises(ValueError, match="focal spot that stays in place"):
        FanBackprojector(ImageGrid(8, 8, spacing=10.0), moving)
    wide = replace(FAN, bin_width=2.0, view_angles=(0.0, 1.0))
    with pytest.raises(ValueError, match="at most 45 degrees on a side, got 54"):
        fbp(torch.zeros(wide.shape), Projector(ImageGrid(8, 8, spacing=10.0), wide))
