import math

import pytest
import torch
from scipy.interpolate import CubicSpline

from pnpct.operators import ramp_filter

BINS = 301


def respond(frequency: float, kernel: str) -> float:
    """Amplification of a wave of the given frequency, cycles per bin, far from the ends."""
    wave = torch.cos(2 * math.pi * frequency * (torch.arange(BINS) - BINS // 2)).double()
    wave *= torch.hann_window(BINS, periodic=False, dtype=torch.float64)
    out = ramp_filter(wave[None], spacing=1.0, equiangular=False, kernel=kernel)
    return float(out[0, BINS // 2] / wave[BINS // 2])


@pytest.mark.parametrize(
    ("kernel", "window"),
    [
        ("ram-lak", lambda f: 1.0),
        ("shepp-logan", lambda f: math.sin(math.pi * f) / (math.pi * f)),
        ("hann", lambda f: math.cos(math.pi * f) ** 2),
        ("soft", {0.125: 0.815, 0.25: 0.4564, 0.375: 0.1636}.get),
    ],
)
@pytest.mark.parametrize("frequency", [0.125, 0.25, 0.375])
def test_each_kernel_is_the_ramp_times_its_window(kernel, window, frequency):
    assert respond(frequency, kernel) == pytest.approx(frequency * window(frequency), rel=0.02)


def test_a_constant_far_from_the_ends_is_filtered_away():
    out = ramp_filter(torch.ones(1, 2001), spacing=0.5, equiangular=False, kernel="ram-lak")
    assert abs(float(out[0, 1000])) < 1e-3


def test_a_small_fan_angle_is_a_length():
    y = torch.rand(3, 40, generator=torch.Generator().manual_seed(0))
    as_angle = ramp_filter(y, spacing=1e-5, equiangular=True, kernel="hann")
    as_length = ramp_filter(y, spacing=1e-5, equiangular=False, kernel="hann")
    torch.testing.assert_close(as_angle, as_length, rtol=1e-5, atol=1e-2)


def test_a_batch_is_its_slices():
    y = torch.rand(2, 5, 7, 33, generator=torch.Generator().manual_seed(0))
    together = ramp_filter(y, spacing=0.1, equiangular=True, kernel="soft")
    alone = ramp_filter(y[1, 4], spacing=0.1, equiangular=True, kernel="soft")
    torch.testing.assert_close(together[1, 4], alone)


def test_the_soft_kernel_is_the_spline_through_its_points() -> None:
    points = (1.0, 0.815, 0.4564, 0.1636, 0.0)
    spline = CubicSpline(torch.linspace(0, 1, 5), points, bc_type=((1, 0.0), "not-a-knot"))
    for frequency in (0.07, 0.2, 0.3, 0.42):
        window = respond(frequency, "soft") / respond(frequency, "ram-lak")
        assert window == pytest.approx(spline(2 * frequency), abs=2e-3)
