import importlib.util
import math
import sys
import tempfile
from dataclasses import dataclass, replace

import numpy as np
import pytest
import torch

from pnpct.files import scan_from_catsim
from pnpct.geometry import FanBeam, ImageGrid, evenly_spaced_views
from pnpct.simulation import Phantom, scanner_beam, simulate_moments
from pnpct.simulation.catsim import _SLAB, FASTEST, CatSimSampling, _settings, catsim_moments
from pnpct.simulation.catsim_job import catsim_results

GRID = ImageGrid(64, 64, spacing=4.0)
GEOMETRY = FanBeam(
    evenly_spaced_views(24),
    bins=48,
    source_to_isocenter=541.0,
    source_to_detector=949.0,
    bin_width=12.0,
    detector_offset=0.25,
)
needs_catsim = pytest.mark.skipif(importlib.util.find_spec("gecatsim") is None, reason="CatSim is not installed")


def disc(radius=80.0, *, grid=GRID, center=(20.0, -10.0), material="water"):
    x, y = torch.from_numpy(grid.x)[None, :], torch.from_numpy(grid.y.copy())[:, None]
    inside = ((x - center[0]) ** 2 + (y - center[1]) ** 2 < radius**2).float()
    return Phantom(("air", material), torch.stack([1 - inside, inside]), grid)


def by_ours(phantom, geometry, **options):
    return simulate_moments(phantom, geometry, [scanner_beam(geometry, **options)])[0]


def line_integrals(moments):
    return -torch.log(moments.signal_mean / moments.air_mean)


@dataclass(frozen=True)
class Steps:
    """A body that is a wide disc of water below z = 2 mm and a narrow one of bone above."""

    extent: tuple[float, float] = (-20.0, 30.0)

    def slice(self, z, grid):
        return disc(80.0, grid=grid) if z < 2.0 else disc(50.0, grid=grid, material="cortical bone")


@pytest.fixture
def temporary(tmp_path, monkeypatch):
    """Where temporary folders go during a test."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path


@pytest.fixture(scope="module")
def of_disc():
    return catsim_moments(disc(), GEOMETRY)[0]


@needs_catsim
def test_air_and_line_integrals_of_water_are_those_of_our_simulator(of_disc):
    ours = by_ours(disc(), GEOMETRY)
    torch.testing.assert_close(of_disc.air_mean.double(), ours.air_mean.double(), rtol=0.02, atol=0)
    torch.testing.assert_close(of_disc.quantum.double(), ours.quantum.double(), rtol=0.02, atol=0)
    assert of_disc.electronic_noise == pytest.approx(ours.electronic_noise, rel=1e-3)
    theirs, expected = line_integrals(of_disc), line_integrals(ours)
    assert expected.max() > 3
    assert (theirs - expected).norm() < 0.004 * expected.norm()
    torch.testing.assert_close(theirs, expected, rtol=0, atol=0.03)


@needs_catsim
def test_views_of_lung_may_turn_clockwise_from_any_angle():
    geometry = replace(GEOMETRY, view_angles=[0.7 - 2 * math.pi * view / 8 for view in range(8)], detector_offset=-1.25)
    phantom = disc(
        50.0, grid=ImageGrid(50, 64, spacing=4.0, center=(12.0, -31.0)), center=(45.0, -60.0), material="lung"
    )
    ours = by_ours(phantom, geometry, tube_voltage_kvp=80.0)
    theirs = catsim_moments(phantom, geometry, tube_voltage_kvp=80.0)[0]
    difference = line_integrals(theirs) - line_integrals(ours)
    assert difference.norm() < 0.006 * line_integrals(ours).norm()


@needs_catsim
@pytest.mark.slow
def test_all_rows_see_a_slab_alike(of_disc):
    geometry = replace(GEOMETRY, view_angles=evenly_spaced_views(1))
    for row in catsim_moments(disc(), geometry, rows=2):
        torch.testing.assert_close(line_integrals(row), line_integrals(of_disc)[:1], rtol=0, atol=1e-4)


@needs_catsim
def test_rows_see_the_slices_of_a_body_from_the_lowest_up(temporary, capfd):
    geometry = replace(GEOMETRY, view_angles=evenly_spaced_views(2))
    rows = catsim_moments(Steps(), geometry, rows=8, z=2.0, grid=GRID)
    below, above = (line_integrals(by_ours(Steps().slice(z, GRID), geometry)) for z in (0.0, 4.0))
    # The row that touches the step sees both of its sides where the fan is not yet, or no longer, at the isocentre.
    for row, expected in ((0, below), (1, below), (2, below), (5, above), (6, above), (7, above)):
        assert (line_integrals(rows[row]) - expected).norm() < 0.006 * expected.norm()
    assert capfd.readouterr() == ("", "")
    assert list(temporary.iterdir()) == []


@needs_catsim
@pytest.mark.slow
def test_an_object_of_air_is_the_air_scan():
    air = Phantom(("air",), torch.ones(1, 64, 64), GRID)
    moments = catsim_moments(air, replace(GEOMETRY, view_angles=(0.0,)))[0]
    torch.testing.assert_close(moments.signal_mean[0], moments.air_mean, rtol=1e-6, atol=0)


@needs_catsim
def test_samples_blur_and_energy_bins_refine(of_disc):
    sharp = line_integrals(of_disc)[::6]
    geometry = replace(GEOMETRY, view_angles=GEOMETRY.view_angles[::6])
    for refined in ({"sampling": CatSimSampling((2, 2), 3)}, {"energy_bins": 4}):
        other = line_integrals(catsim_moments(disc(), geometry, **refined)[0])
        assert 1e-4 < (other - sharp).norm() / sharp.norm() < 0.1


def scan_of_seed(seed):
    """A scan of 20 mAs with the noise that CatSim draws itself, photon by photon in each energy bin."""
    settings = _settings(GEOMETRY, 120.0, 1, FASTEST)
    settings["physics"] |= {"energyCount": 20, "enableQuantumNoise": 1, "enableElectronicNoise": 1}
    settings["protocol"] |= {"mA": 40.0, "rotationTime": 0.5}
    with catsim_results([disc()], slice_thickness=_SLAB, settings=settings, seed=seed) as folder:
        return scan_from_catsim(folder / "run", configuration=folder / "run.cfg")


@needs_catsim
@pytest.mark.slow
def test_one_seed_is_one_scan_of_catsim():
    first, again = scan_of_seed(5), scan_of_seed(5)
    assert torch.equal(first.counts, again.counts)


@needs_catsim
def test_the_noise_of_catsim_follows_its_seed_and_the_moments(of_disc):
    first, other = scan_of_seed(5), scan_of_seed(6)
    np.testing.assert_allclose(first.geometry.view_angles, GEOMETRY.view_angles, atol=1e-6)
    dose = 40.0 * 0.5 / GEOMETRY.views
    deviation = (dose * of_disc.signal_variance + of_disc.electronic_noise**2).sqrt()
    torch.testing.assert_close(first.incident * 70.0, dose * of_disc.air_mean, rtol=1e-4, atol=0)
    scores = torch.stack([(scan.counts * 70.0 - dose * of_disc.signal_mean) / deviation for scan in (first, other)])
    rays = scores[0].numel()
    assert scores.mean(dim=(1, 2)).abs().max() < 4 / math.sqrt(rays)
    torch.testing.assert_close(scores.var(dim=(1, 2)), torch.ones(2), rtol=0, atol=4 * math.sqrt(2 / rays))
    assert abs(float((scores[0] * scores[1]).mean())) < 4 / math.sqrt(rays)


def test_without_catsim_one_sentence_says_how_to_get_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "gecatsim", None)
    with pytest.raises(
        ImportError, match=r"^CatSim is not installed; install it with: pip install 'pnpct\[catsim\]'\.$"
    ):
        catsim_moments(disc(), GEOMETRY)


@pytest.fixture
def catsim_that(tmp_path_factory, monkeypatch):
    """Put a package in CatSim's place that does something else when it is imported."""

    def install(does):
        folder = tmp_path_factory.mktemp("packages")
        (folder / "gecatsim").mkdir()
        (folder / "gecatsim" / "__init__.py").write_text(does)
        monkeypatch.setenv("PYTHONPATH", str(folder))
        monkeypatch.syspath_prepend(folder)

    return install


@pytest.mark.parametrize(
    ("does", "message"),
    [
        ("print('noise')\nraise RuntimeError('it broke on purpose.')", r"RuntimeError: it broke on purpose\.$"),
        ("print('Error! of its own')\nraise SystemExit(1)", r"Error! of its own\.$"),
        ("raise SystemExit(3)", r"it gave no reason\.$"),
        ("print('*** Error -2: no memory!')\nprint('Simulation is done')\nraise SystemExit(0)", "Error -2: no memory!"),
    ],
)
def test_a_failure_of_catsim_is_one_sentence_and_leaves_nothing(catsim_that, temporary, capfd, does, message):
    catsim_that(does)
    with pytest.raises(ChildProcessError, match=r"^CatSim failed: .*" + message):
        catsim_moments(disc(), GEOMETRY)
    assert capfd.readouterr() == ("", "")
    assert list(temporary.iterdir()) == []


@pytest.mark.skipif(sys.platform == "win32", reason="there are no signals")
def test_a_killed_catsim_is_one_sentence(catsim_that, temporary):
    catsim_that("import os\nos.kill(os.getpid(), 9)")
    with pytest.raises(ChildProcessError, match="ended by signal 9, perhaps for lack of memory"):
        catsim_moments(disc(), GEOMETRY)
    assert list(temporary.iterdir()) == []


SHIFTS = [(0.5, 0.0)] * 24
EARLIER = (0.0, *GEOMETRY.view_angles[:-1])


@pytest.mark.parametrize(
    ("changes", "options", "message"),
    [
        ({"detector": "flat"}, {}, "arc detectors here, this one is flat"),
        ({"focal_spot_shifts": SHIFTS}, {}, "this geometry shifts it"),
        ({"view_angles": GEOMETRY.view_angles[:-1]}, {}, "evenly spaced views of one full rotation"),
        ({"view_angles": EARLIER}, {}, "evenly spaced views of one full rotation"),
        ({"source_to_isocenter": 180.0}, {}, r"reach 181\.0\d+ mm .* focal spot at 180 mm; take a smaller grid"),
        ({}, {"tube_voltage_kvp": 125.0}, r"70 to 140 kVp in steps of 10, got 125\.0 kVp"),
        ({}, {"rows": 0}, "at least one row, got 0"),
        ({}, {"energy_bins": 0}, "at least one energy bin, got 0"),
        ({}, {"z": 3.0}, "same at every z"),
        ({}, {"grid": GRID}, "same at every z"),
    ],
)
def test_what_catsim_cannot_take_is_one_sentence(catsim_that, changes, options, message):
    catsim_that("raise RuntimeError('CatSim must not be asked')")
    with pytest.raises(ValueError, match=message):
        catsim_moments(disc(), replace(GEOMETRY, **changes), **options)


def test_a_body_must_be_known_as_far_as_the_cone_reaches(catsim_that):
    catsim_that("raise RuntimeError('CatSim must not be asked')")
    asked = []

    class Short(Steps):
        def slice(self, z, grid):
            asked.append(z)
            return super().slice(z, grid)

    # Eight rows are 5 mm high at the isocentre, and the corner of the pixels is 181 mm beyond it.
    reach = 2.5 * (541 + GRID.radius) / 541
    with pytest.raises(
        ValueError, match=r"8 detector rows at z = 0 mm need the body from -3\.4\d+ to 3\.4\d+ mm, .* -3 to 3 mm"
    ):
        catsim_moments(Short((-3.0, 3.0)), GEOMETRY, rows=8, grid=GRID)
    with pytest.raises(ChildProcessError, match="CatSim must not be asked"):
        catsim_moments(Short((-20.0, 20.0)), GEOMETRY, rows=8, grid=GRID)
    assert max(asked) + 0.3125 >= reach
    np.testing.assert_allclose(np.diff(asked), 0.625)
    assert sum(asked) == pytest.approx(0.0)


@pytest.mark.parametrize("sampling", [{"focal_spot": (0, 1)}, {"views": 0}])
def test_less_than_one_sample_is_refused(sampling):
    with pytest.raises(ValueError, match="at least one sample of everything"):
        CatSimSampling(**sampling)
