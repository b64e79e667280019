from pnpct.geometry import FanBeam, evenly_spaced_views


def test_the_repr_of_many_views_is_short_and_that_of_few_can_be_evaluated():
    fan = FanBeam(evenly_spaced_views(984), 900, 541.0, 949.0, 1.0, focal_spot_shifts=[(0.1, 0.0)] * 984)
    for geometry in (fan, fan.cone_beam, fan.cone_beam.trajectory):
        assert len(repr(geometry)) < 500
        assert "..." in repr(geometry)
    few = FanBeam((0.0, 1.0), 3, 541.0, 949.0, 1.0, detector_offset=0.25)
    assert eval(repr(few)) == few
    assert "view_angles=(0.0, 1.0), bins=3" in repr(few)
