import numpy as np
import pytest
import torch

from pnpct.geometry import ConeBeam, Detector, FanBeam, Trajectory, evenly_spaced_views
from pnpct.physics import Scan, take_log
from pnpct.reconstruction import Reconstruction
from pnpct.report import show

FAN = FanBeam(evenly_spaced_views(9), 7, 541.0, 949.0, 60.0, detector_offset=0.25)
TURNED = np.linspace(0, 4 * np.pi, 21)
HELIX = ConeBeam(Trajectory(-TURNED, z=TURNED), Detector(7, 60.0, rows=3, row_height=9.0, kind="flat"), 541.0, 949.0)


def titles(picture):
    return [axes.get_title() for axes in picture.axes if axes.get_title()]


def measured(geometry):
    counts = 500.0 + torch.arange(np.prod(geometry.shape)).reshape(geometry.shape).float()
    return Scan(counts, torch.tensor(1000.0), electronic_noise=0.0, geometry=geometry, mu_water=0.02)


def test_a_figure_is_a_png_in_a_notebook():
    assert show(torch.ones(4, 4))._repr_png_().startswith(b"\x89PNG")


def test_images_stand_beside_each_other_under_their_names_in_hu():
    made = Reconstruction(torch.full((4, 4), 1.05), {"method": "pnp", "denoiser": "n2n", "passes": 1.0})
    picture = show({"air": torch.zeros(4, 4), "PnP": made}, window=(40, 400))
    assert titles(picture) == ["air", "PnP"]
    air, pnp = (axes.images[0] for axes in picture.axes if axes.images)
    assert pnp.get_clim() == (-160, 240)
    assert pnp.get_array().mean() == pytest.approx(50, abs=1e-3)
    assert air.get_array().mean() == -1000
    assert titles(show(made)) == ["pnp with n2n"]


def test_of_a_volume_five_slices_are_shown_from_the_lowest_to_the_highest():
    assert titles(show(torch.ones(41, 4, 4))) == [f"slice {number}" for number in (0, 10, 20, 30, 40)]
    assert titles(show({"thin": torch.ones(2, 4, 4)})) == ["thin slice 0", "thin slice 1"]


@pytest.mark.parametrize("geometry", [FAN, HELIX, HELIX[[0]]])
def test_the_geometry_is_drawn_where_it_is(geometry):
    axes, *_ = show(geometry).axes
    spots, _, end, detector = (line.get_xydata() for line in axes.lines)
    np.testing.assert_allclose(spots, geometry.focal_spots()[:, :2])
    np.testing.assert_allclose(
        detector, geometry.detector_points(np.linspace(*geometry.fan_angle_edges[[0, -1]], 100))[0, :, :2]
    )
    np.testing.assert_allclose(end, [spots[0], detector[-1]])
    assert axes.patches[0].radius == geometry.field_of_view_radius


@pytest.mark.parametrize("geometry", [FAN, HELIX])
def test_a_scan_is_its_line_integrals_over_its_angles(geometry):
    scan = measured(geometry)
    axes, *_ = show(scan).axes
    rays = take_log(scan).line_integrals
    np.testing.assert_array_equal(axes.images[0].get_array(), rays if rays.ndim == 2 else rays[:, 1])
    views = np.degrees(FAN.view_angles if geometry is FAN else HELIX.trajectory.angles)
    first, last = np.degrees(geometry.fan_angle_edges[[0, -1]])
    assert axes.images[0].get_extent() == pytest.approx([first, last, views[-1], views[0]])
    assert axes.get_xlabel() == "fan angle γ, degrees"


@pytest.mark.parametrize("scan", [measured(FAN)[[3, 0, 5]], measured(FAN)[[0]], take_log(measured(FAN))])
def test_rays_without_an_order_of_angles_are_counted(scan):
    axes, *_ = show(scan).axes
    assert axes.get_ylabel() == "view"


@pytest.mark.parametrize("unknown", [torch.ones(4), torch.ones(2, 2, 4, 4), {"number": 5}])
def test_anything_else_is_refused_with_what_can_be_shown(unknown):
    with pytest.raises(TypeError, match=r"can be shown, got (an array of [14] axes|int)"):
        show(unknown)
