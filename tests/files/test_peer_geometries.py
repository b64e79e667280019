"""Each peer's geometry is proved by the chords of a disc off the centre, from the rays that its own words give."""

import math

import numpy as np
import pytest

from pnpct.files import FileFormatError, read_geometry

ANGLES = [-0.3, 0.4, 1.9, 4.0]
BINS, WIDTH, SOURCE, BEYOND, DISC, RADIUS = 40, 8.0, 500.0, 400.0, np.array([60.0, 35.0]), 30.0
ASTRA = {
    "type": "fanflat",
    "DetectorWidth": WIDTH,
    "DetectorCount": BINS,
    "ProjectionAngles": ANGLES,
    "DistanceOriginSource": SOURCE,
    "DistanceOriginDetector": BEYOND,
}
ODL = {"src_radius": SOURCE, "det_radius": BEYOND, "angles": ANGLES, "dpart": [-140, 180, BINS]}
TIGRE = {
    "DSO": SOURCE,
    "DSD": SOURCE + BEYOND,
    "nDetector": [1, BINS],
    "dDetector": [1, WIDTH],
    "angles": ANGLES,
    "offDetector": [0, 12.0],
    "COR": -3.0,
}
LEAP = {
    "sod": SOURCE,
    "sdd": SOURCE + BEYOND,
    "numCols": BINS,
    "pixelWidth": WIDTH,
    "centerCol": 17.25,
    "phis": np.degrees(ANGLES).tolist(),
    "tau": 2.0,
}


def _chords(source, cell):
    """Chords of the disc along the lines from the source to the cells."""
    along = cell - source
    beside = (DISC - source)[..., 0] * along[..., 1] - (DISC - source)[..., 1] * along[..., 0]
    distance = beside / np.hypot(along[..., 0], along[..., 1])
    return 2 * np.sqrt(np.maximum(RADIUS**2 - distance**2, 0))


def _of_fan(content):
    written = read_geometry(content)
    fan = written.geometry
    assert fan.detector == "flat"
    chords = _chords(fan.focal_spots()[:, None], fan.detector_points(fan.fan_angles))
    assert np.count_nonzero(chords) > 10
    return chords[:, ::-1] if written.bins_reversed else chords


def _lines(source, cell):
    """Chords from a source and cells, complex numbers that turn with the angle: shapes (1) and (bins)."""
    turn = np.exp(1j * np.array(ANGLES))[:, None]
    source, cell = source * turn, cell * turn
    return _chords(np.stack([source.real, source.imag], -1), np.stack([cell.real, cell.imag], -1))


CENTRED = np.arange(BINS) - (BINS - 1) / 2


def test_astra_begins_at_the_bottom_and_turns_counter_clockwise():
    assert _of_fan(ASTRA) == pytest.approx(_lines(-1j * SOURCE, 1j * BEYOND + WIDTH * CENTRED), abs=1e-6)


def test_odl_is_as_astra_with_a_partition_of_the_detector():
    cells = -140 + 8 * (np.arange(BINS) + 0.5)
    assert _of_fan(ODL) == pytest.approx(_lines(-1j * SOURCE, 1j * BEYOND + cells), abs=1e-6)
    turned = _of_fan({**ODL, "src_to_det_init": [-2, 0]})
    assert turned == pytest.approx(_lines(SOURCE, -BEYOND + 1j * cells), abs=1e-6)


def test_tigre_begins_at_plus_x_and_shifts_source_and_detector_together():
    expected = _lines(SOURCE - 3j, -BEYOND + 1j * (WIDTH * CENTRED + 12 - 3))
    assert _of_fan(TIGRE) == pytest.approx(expected, abs=1e-6)


def test_leap_has_its_formula():
    """f(Rθ − τθ⊥ − l (θ − uθ⊥) / √(1 + u²)), θ at φ − 90 degrees."""
    slope = (np.arange(BINS) - 17.25) * WIDTH / (SOURCE + BEYOND)
    source = SOURCE - 2j
    expected = _lines(-1j * source, -1j * (source - (SOURCE + BEYOND) * (1 - 1j * slope)))
    assert _of_fan(LEAP) == pytest.approx(expected, abs=1e-6)


def _vectors(angles=ANGLES, *, mirror=1):
    sin, cos = np.sin(angles), np.cos(angles)
    step = (mirror * WIDTH * cos, mirror * WIDTH * sin)
    return np.stack([SOURCE * sin, -SOURCE * cos, -BEYOND * sin, BEYOND * cos, *step], -1)


def test_vectors_are_the_dictionary_and_may_number_their_cells_the_other_way():
    given = {"type": "fanflat_vec", "DetectorCount": BINS}
    assert _of_fan({**given, "Vectors": _vectors().tolist()}) == pytest.approx(_of_fan(ASTRA), abs=1e-6)
    mirrored = _of_fan({**given, "Vectors": _vectors(mirror=-1).tolist()})
    assert mirrored == pytest.approx(_of_fan(ASTRA)[:, ::-1], abs=1e-6)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"DetectorCount": 2.5}, "whole number"),
        ({"DetectorWidth": "8"}, "DetectorWidth must be one"),
        ({"ProjectionAngles": [[0.0]]}, "ProjectionAngles must be"),
        ({"ProjectionAngles": []}, "every view needs"),
        ({"DetectorWidth": 0}, "longer than 0"),
        ({"Vectors": []}, "has no 'Vectors'"),
    ],
)
def test_what_cannot_be_is_refused(change, sentence):
    with pytest.raises(FileFormatError, match=sentence):
        read_geometry({**ASTRA, **change})


def test_a_missing_key_and_a_tilted_detector_are_refused():
    with pytest.raises(FileFormatError, match="LEAP needs sdd"):
        read_geometry({key: value for key, value in LEAP.items() if key != "sdd"})
    tilted = _vectors()
    tilted[0, 4:] += [0.5, 0.0]
    with pytest.raises(FileFormatError, match="changes from view to view"):
        read_geometry({"type": "fanflat_vec", "DetectorCount": BINS, "Vectors": tilted.tolist()})


def _measured(content):
    """Line integrals of the disc by the projector, with the bins in the array's order, mm."""
    import torch

    from pnpct.geometry import ImageGrid
    from pnpct.operators import Projector

    written = read_geometry(content)
    grid = ImageGrid(rows=200, cols=200, spacing=1.0)
    image = np.hypot(grid.x[None] - DISC[0], grid.y[:, None] - DISC[1]) < RADIUS
    rays = Projector(grid, written.geometry, mu_water=1.0)(torch.tensor(image, dtype=torch.float32)).numpy()
    return image.astype(np.float32), rays[:, ::-1] if written.bins_reversed else rays


def test_astra_projects_the_same_rays():
    astra = pytest.importorskip("astra", reason="ASTRA (the extra peers) is not installed")
    image, rays = _measured(ASTRA)
    fan = astra.create_proj_geom("fanflat", WIDTH, BINS, np.array(ANGLES), SOURCE, BEYOND)
    projector = astra.create_projector("line_fanflat", fan, astra.create_vol_geom(200, 200))
    number, projected = astra.create_sino(image, projector)
    astra.data2d.delete(number)
    assert np.abs(rays - projected).mean() < 0.02 * math.pi * RADIUS / 4
    assert np.abs(rays[:, ::-1] - projected).mean() > 0.2 * math.pi * RADIUS / 4


def test_odl_projects_the_same_rays():
    odl = pytest.importorskip("odl", reason="ODL is not installed")
    pytest.importorskip("astra", reason="ASTRA (the extra peers), by which ODL projects, is not installed")
    tomo = odl.tomo if hasattr(odl, "tomo") else odl.applications.tomo
    detector = odl.uniform_partition(-140, 180, BINS)
    peer = tomo.FanBeamGeometry(odl.nonuniform_partition(ANGLES), detector, SOURCE, BEYOND)
    space = odl.uniform_discr([-100, -100], [100, 100], [200, 200], dtype="float32")
    image, rays = _measured(ODL)
    first_axis_is_x = image[::-1].T.copy()
    projected = tomo.RayTransform(space, peer, impl="astra_cpu")(space.element(first_axis_is_x)).asarray()
    assert np.abs(rays - projected).mean() < 0.02 * math.pi * RADIUS / 4
    assert np.abs(rays[:, ::-1] - projected).mean() > 0.2 * math.pi * RADIUS / 4
