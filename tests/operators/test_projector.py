import copy
import gc
import math
import weakref
from dataclasses import replace

import numpy as np
import pytest
import torch

from pnpct.geometry import FanBeam, ImageGrid, evenly_spaced_views
from pnpct.operators import LinearOperator, Projector, cpu_projector
from pnpct.operators.ray_lines import ray_lines
from pnpct.operators.torch_projector import TorchProjector

FAN = FanBeam(
    view_angles=evenly_spaced_views(24),
    bins=45,
    source_to_isocenter=541.0,
    source_to_detector=949.0,
    bin_width=20.0,
)
GRID = ImageGrid(28, 28, spacing=16.0)

WORLDS = {
    "arc": (FAN, GRID),
    "quarter offset": (replace(FAN, detector_offset=0.25), GRID),
    "flat": (replace(FAN, detector="flat"), GRID),
    "flat, offset": (replace(FAN, detector="flat", detector_offset=-3.3), GRID),
    "odd views": (replace(FAN, view_angles=evenly_spaced_views(23)), GRID),
    "odd pixels": (FAN, ImageGrid(27, 27, spacing=16.0)),
    "wide": (FAN, ImageGrid(20, 28, spacing=16.0)),
    "tall, odd": (FAN, ImageGrid(28, 19, spacing=16.0)),
    "off centre": (FAN, ImageGrid(20, 20, spacing=12.0, center=(40.0, -25.0))),
    "short scan": (replace(FAN, view_angles=evenly_spaced_views(16, span=math.radians(240))), GRID),
    "gaps": (replace(FAN, view_angles=[a for n, a in enumerate(evenly_spaced_views(36)) if n % 9 > 2]), GRID),
    "repeated views": (replace(FAN, view_angles=(0.3, 0.3, 0.3 + math.pi / 2, 4.0)), GRID),
    "zoomed": (FAN, ImageGrid(28, 28, spacing=2.0)),
    "coarse": (FAN, ImageGrid(5, 5, spacing=90.0)),
    "moving focal spot": (
        replace(FAN, focal_spot_shifts=[(2.0 * (n % 2), 1.0) for n in range(24)]),
        GRID,
    ),
    "one bin": (replace(FAN, bins=1), GRID),
}


@pytest.fixture(params=WORLDS)
def world(request) -> tuple[FanBeam, ImageGrid]:
    return WORLDS[request.param]


def inner(a: torch.Tensor, b: torch.Tensor) -> float:
    return float((a.double() * b.double()).sum())


@pytest.mark.parametrize("method", ["distance-driven", "joseph"])
@pytest.mark.parametrize("batch", [(), (3, 2)])
def test_the_adjoint_has_the_weights_of_the_projector(world, method, batch, generator):
    geometry, grid = world
    A = Projector(grid, geometry, method=method)
    x = torch.randn(*batch, *grid.shape, generator=generator)
    y = torch.randn(*batch, *geometry.shape, generator=generator)
    Ax, Aty = A(x), A.T(y)
    assert Ax.shape == y.shape
    assert Aty.shape == x.shape
    assert abs(inner(Ax, y) - inner(x, Aty)) <= 1e-6 * float(Ax.norm() * y.norm())


@pytest.mark.parametrize("method", ["distance-driven", "joseph"])
def test_compiled_kernels_equal_plain_torch(world, method, generator):
    geometry, grid = world
    A = Projector(grid, geometry, method=method, mu_water=1.0)
    plain = TorchProjector(
        ray_lines(grid, geometry, method), grid.shape, geometry.views * geometry.bins, torch.device("cpu")
    )
    x = torch.rand(2, *grid.shape, generator=generator)
    y = torch.rand(2, *geometry.shape, generator=generator)
    # float32 sums of hundreds of terms, in another order
    torch.testing.assert_close(A(x).flatten(1), plain.project(x), rtol=1e-4, atol=1e-4 * float(A(x).max()))
    torch.testing.assert_close(A.T(y), plain.back_project(y.flatten(1)), rtol=1e-4, atol=1e-5 * float(A.T(y).max()))
    squares = A.gram_diagonal(y)
    torch.testing.assert_close(
        squares, plain.back_project(y.flatten(1), squared=True), rtol=1e-4, atol=1e-5 * float(squares.max())
    )


def test_the_gram_diagonal_is_that_of_the_matrix(generator):
    geometry, grid = WORLDS["quarter offset"]
    A = Projector(grid, geometry)
    weights = torch.rand(geometry.shape, generator=generator)
    points = torch.eye(grid.rows * grid.cols).reshape(-1, *grid.shape)
    expected = (A(points).square() * weights).sum((-2, -1)).reshape(grid.shape)
    torch.testing.assert_close(A.gram_diagonal(weights), expected, rtol=1e-4, atol=1e-5)


def test_gradients_are_the_adjoint_and_the_projector(generator):
    geometry, grid = WORLDS["odd views"]
    A = Projector(grid, geometry)
    x = torch.rand(2, *grid.shape, generator=generator).requires_grad_()
    y = torch.rand(2, *geometry.shape, generator=generator).requires_grad_()
    (gradient,) = torch.autograd.grad((A(x) * y).sum(), x, create_graph=True)
    torch.testing.assert_close(gradient, A.T(y))
    (again,) = torch.autograd.grad((gradient * x.detach()).sum(), y)  # through the backward pass
    torch.testing.assert_close(again, A(x.detach()))
    (of_adjoint,) = torch.autograd.grad((A.T(y) * x.detach()).sum(), y)
    torch.testing.assert_close(of_adjoint, A(x.detach()))


def test_a_projector_is_a_layer_that_follows_its_input(generator):
    A = Projector(GRID, FAN)
    x = torch.rand(GRID.shape, generator=generator)
    assert A.to("cpu") is A
    assert torch.equal(A @ x, A(x))
    assert torch.equal(A.T @ (A @ x), A.T(A(x)))
    layer = torch.nn.Module()
    layer.A = A
    torch.testing.assert_close(copy.deepcopy(layer).to(torch.float64).A @ x, A(x))  # as training copies networks
    with pytest.raises(ValueError, match="Projector takes arrays that end in"):
        A @ (A @ x)


def test_what_nobody_holds_is_freed_at_once():
    A = Projector(GRID, FAN)
    A(torch.zeros(GRID.shape))
    kernels = weakref.ref(A._kernels(torch.device("cpu")))
    gc.disable()  # reference cycles stay, with all arrays, until it is their turn
    try:
        del A
        assert kernels() is None
    finally:
        gc.enable()


def test_a_batch_is_its_slices(world, generator):
    geometry, grid = world
    A = Projector(grid, geometry)
    x = torch.rand(5, *grid.shape, generator=generator)
    together = A(x)
    for one, image in zip(together, x, strict=True):
        torch.testing.assert_close(A(image), one, rtol=1e-5, atol=1e-4)


def test_the_result_does_not_depend_on_threads_or_on_what_was_before(generator, monkeypatch):
    geometry, grid = WORLDS["quarter offset"]
    A = Projector(grid, geometry)
    x = torch.rand(2, *grid.shape, generator=generator)
    first, first_adjoint = A(x), A.T(A(x))  # so small that no other thread takes part
    monkeypatch.setattr(cpu_projector, "SMALL", 0)
    threads = torch.get_num_threads()
    try:
        for number in (1, 2):
            torch.set_num_threads(number)
            assert torch.equal(A(x), first)
            assert torch.equal(A.T(A(x)), first_adjoint)
    finally:
        torch.set_num_threads(threads)


def test_double_precision_comes_back_as_double_precision(generator):
    A = Projector(GRID, FAN)
    x = torch.rand(GRID.shape, generator=generator, dtype=torch.float64)
    assert A(x).dtype == torch.float64
    assert A.T(A(x)).dtype == torch.float64


def chords(geometry: FanBeam, center: tuple[float, float], axes: tuple[float, float]) -> np.ndarray:
    """Lengths of the central rays in an ellipse, mm."""
    spots = (geometry.focal_spots()[:, None] - center) / axes
    towards = geometry.detector_points(geometry.fan_angles) - geometry.focal_spots()[:, None]
    length = np.linalg.norm(towards, axis=-1)
    towards = towards / axes
    a, b = (towards**2).sum(-1), (spots * towards).sum(-1)
    inside = b**2 - a * ((spots**2).sum(-1) - 1)
    return 2 * np.sqrt(np.maximum(inside, 0)) / a * length


@pytest.mark.parametrize("method", ["distance-driven", "joseph"])
@pytest.mark.parametrize("detector", ["arc", "flat"])
@pytest.mark.parametrize(("center", "axes"), [((0.0, 0.0), (100.0, 100.0)), ((40.0, -30.0), (90.0, 50.0))])
def test_chords_of_discs_and_ellipses_are_those_of_geometry(method, detector, center, axes):
    geometry = FanBeam(
        view_angles=evenly_spaced_views(41, start=0.1),
        bins=225,
        source_to_isocenter=541.0,
        source_to_detector=949.0,
        bin_width=4.0956,
        detector_offset=0.25,
        detector=detector,
    )
    grid = ImageGrid(256, 256, spacing=1.2)
    fine = 8
    x = (np.arange(256 * fine) - (256 * fine - 1) / 2) * 1.2 / fine
    inside = ((x[None] - center[0]) / axes[0]) ** 2 + ((-x[:, None] - center[1]) / axes[1]) ** 2 < 1
    image = torch.from_numpy(inside.reshape(256, fine, 256, fine).mean((1, 3))).float()
    expected = chords(geometry, center, axes)
    projected = Projector(grid, geometry, mu_water=1.0, method=method)(image).numpy()
    well_inside = expected > 0.5 * expected.max()
    assert np.abs(projected - expected)[well_inside].max() < 0.6  # half a pixel
    assert abs((projected - expected)[well_inside].mean()) < 0.03  # a cell is 2.3 mm wide, a chord bends
    assert projected.sum() == pytest.approx(expected.sum(), rel=1e-3)


def test_a_pixel_on_the_right_is_seen_at_positive_fan_angles_from_the_top():
    image = torch.zeros(GRID.shape)
    image[14, 24] = 1.0  # x > 0
    from_top = Projector(GRID, replace(FAN, view_angles=(0.0,)))(image)[0]
    assert FAN.fan_angles[int(from_top.argmax())] > 0
    image = torch.zeros(GRID.shape)
    image[2, 14] = 1.0  # y > 0; seen from the left, +γ points up
    from_left = Projector(GRID, replace(FAN, view_angles=(math.pi / 2,)))(image)[0]
    assert FAN.fan_angles[int(from_left.argmax())] > 0


def test_smooth_images_need_no_fine_pixels(generator):
    """Distance-driven sums of a coarse constant are free of ripple: each pixel is seen as much as its neighbours."""
    geometry = replace(FAN, bins=450, bin_width=2.0, view_angles=evenly_spaced_views(8))
    grid = ImageGrid(24, 24, spacing=9.0)
    seen = Projector(grid, geometry).T(torch.ones(geometry.shape))[8:16, 8:16]
    assert float(seen.std() / seen.mean()) < 5e-3


@pytest.mark.parametrize(
    ("grid", "change", "words"),
    [
        (ImageGrid(10, 10, spacing=100.0), {}, "farthest corner is 707.1 mm from the isocentre, the focal spot 541.0"),
        (ImageGrid(10, 10, spacing=1.0, center=(300.0, 0.0)), {}, "No ray meets the image"),
    ],
)
def test_images_that_no_fan_can_see_are_refused(grid, change, words):
    with pytest.raises(ValueError, match=words):
        Projector(grid, replace(FAN, **change))


def test_a_wrong_shape_is_refused_with_both_shapes():
    A = Projector(GRID, FAN)
    with pytest.raises(ValueError, match=r"takes arrays that end in \(28, 28\), got \(28, 27\)"):
        A(torch.zeros(28, 27))
    with pytest.raises(ValueError, match=r"end in \(24, 45\)"):
        A.T(torch.zeros(28, 28))


def test_options_are_checked():
    with pytest.raises(ValueError, match="attenuation of water must be positive"):
        Projector(GRID, FAN, mu_water=0.0)


def test_the_adjoint_of_the_adjoint_is_the_projector():
    A = Projector(GRID, FAN)
    assert A.T.T is A


def test_the_dimensions_of_images_and_rays_are_counted_from_the_last():
    class SumOverSlices(LinearOperator):
        domain_shape, range_shape = (3, 4, 5), (4, 5)

        def forward(self, x):
            return x.sum(-3)

        def adjoint(self, y):
            return y.unsqueeze(-3).expand(*y.shape[:-2], *self.domain_shape)

    A = SumOverSlices()
    assert (A.domain_dims, A.range_dims) == ((-3, -2, -1), (-2, -1))
    assert (A.T.domain_dims, A.T.range_dims) == (A.range_dims, A.domain_dims)
    assert torch.ones(2, *A.domain_shape).sum(A.domain_dims).tolist() == [60.0, 60.0]


def test_strips_have_a_width_wherever_their_rays_run():
    # In so wide a fan some rays begin beside the image and run away from its middle row.
    wide = FanBeam(evenly_spaced_views(15), 55, 508.0, 980.0, bin_width=64.0, detector="flat")
    away = 0
    for table in ray_lines(ImageGrid(19, 19, spacing=35.9), wide, "distance-driven"):
        _, apex_row, down = np.repeat(table.apex[table.pencil], table.parts, axis=0).T
        from_middle = np.arange(table.rows)[:, None] - (table.rows - 1) / 2
        in_front = (from_middle - apex_row) * down > 0.1
        assert (table.width + table.widening * from_middle)[in_front].min() > 0
        away += int((in_front.any(0) & (apex_row * down > 0)).sum())
    assert away > 0
