"""Objects that reach beyond the fan or the image: what the rays see is reconstructed whole."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from pnpct.cli import main
from pnpct.denoisers import TotalVariation
from pnpct.files import Provenance, read_image, write_scan
from pnpct.geometry import FanBeam, ImageGrid, evenly_spaced_views
from pnpct.operators import Projector
from pnpct.physics import BandedWeights, Scan, Sinogram, take_log
from pnpct.reconstruction import FBP, TVPWLS, DenoisedFBP, PlugAndPlay, fbp
from pnpct.reconstruction import whole_object as module
from pnpct.reconstruction.whole_object import beyond_fan, beyond_image

MU = 0.0192587
WHOLE = FanBeam(evenly_spaced_views(120), 128, source_to_isocenter=570.0, source_to_detector=1040.0, bin_width=4.0)
CUT_OFF = replace(WHOLE, bins=64)  # of 70 mm radius
FLAT = replace(WHOLE, detector="flat")
BODY = ((5.0, 0.0, 100.0, 1.0), (30.0, 0.0, 14.0, 0.8), (-25.0, -10.0, 16.0, -0.09))  # water, +800 HU, -90 HU
PLACES, RIGHT = ((30, 0), (-25, -10), (0, 40)), [800, -90, 0]
SMALL = ImageGrid(50, 50, 2.0)
PNP = PlugAndPlay(TotalVariation(0.02), iterations=12)
ITERATIVE = [TVPWLS(), PNP]


def scan_of(geometry, quanta=1e5, generator=None):
    """Chords of three discs, as counts."""
    spots, points = geometry.focal_spots(), geometry.detector_points(geometry.fan_angles)
    along = points - spots[:, None]
    along /= np.linalg.norm(along, axis=-1, keepdims=True)
    p = np.zeros(geometry.shape)
    for x, y, radius, relative in BODY:
        off = (x - spots[:, :1]) * along[..., 1] - (y - spots[:, 1:]) * along[..., 0]
        p += relative * MU * 2 * np.sqrt(np.maximum(radius**2 - off**2, 0))
    counts = torch.from_numpy(quanta * np.exp(-p)).float()
    if generator is not None:
        counts = torch.poisson(counts, generator=generator)
    return Scan(counts, torch.tensor(quanta), 0.0, geometry, mu_water=MU)


def hu_at_places(image, grid):
    x, y = np.meshgrid(grid.x, grid.y)
    return [float(1000 * (image.numpy()[np.hypot(x - at[0], y - at[1]) < 8].mean() - 1)) for at in PLACES]


def position(grid):
    return torch.from_numpy(np.stack(np.meshgrid(grid.x, grid.y)))


def prepared(geometry, grid=SMALL, **options):
    return take_log(scan_of(geometry, **options)), Projector(grid, geometry, mu_water=MU)


@pytest.mark.parametrize("method", ITERATIVE)
@pytest.mark.parametrize("center", [(0.0, 0.0), (10.0, -6.0)])
def test_a_part_of_an_image_is_that_part_of_the_whole_image(method, center):
    sinogram, A = prepared(WHOLE, replace(SMALL, center=center))
    made, whole = method(sinogram, A), beyond_image(beyond_fan(sinogram, A))
    assert whole.A.grid.shape != A.grid.shape
    for axis in (0, 1):
        assert whole.cut_out(position(whole.A.grid)[axis]).numpy() == pytest.approx(position(A.grid)[axis].numpy())
    assert torch.equal(made.image, whole.cut_out(method(sinogram, whole.A).image))
    assert hu_at_places(made.image, A.grid) == pytest.approx(RIGHT, abs=25)
    assert "miss the image" in made.notes[0]


@pytest.mark.parametrize("geometry", [WHOLE, FLAT, replace(WHOLE, bins=80, detector_offset=24.0), WHOLE[range(70)]])
@pytest.mark.parametrize("quanta", [100.0, 1e5])
def test_what_holds_the_object_stays_as_it_is(geometry, quanta, generator):
    sinogram, A = prepared(geometry, ImageGrid(54, 54, 4.0), quanta=quanta, generator=generator)
    whole = beyond_image(beyond_fan(sinogram, A))
    assert whole.sinogram is sinogram
    assert whole.A is A
    assert whole.notes == ()
    assert torch.equal(FBP()(sinogram, A).image, fbp(sinogram.line_integrals, A, kernel="hann"))


@pytest.mark.parametrize("detector", ["arc", "flat"])
def test_projections_that_are_cut_off_are_continued(detector):
    sinogram, A = prepared(replace(CUT_OFF, detector=detector))
    made = FBP()(sinogram, A)
    assert hu_at_places(made.image, A.grid) == pytest.approx(RIGHT, abs=8)
    rim = hu_at_places(fbp(sinogram.line_integrals, A, kernel="hann"), A.grid)
    assert min(np.subtract(rim, RIGHT)) > 100
    assert "beyond the fan in 100% of the views" in made.notes[0]
    assert DenoisedFBP(TotalVariation(0.02))(sinogram, A).notes == made.notes


def test_a_detector_that_is_moved_aside_is_continued_on_its_longer_side_alone():
    aside = replace(CUT_OFF, bins=44, detector_offset=10.0)
    sinogram, A = prepared(aside)
    whole = beyond_fan(sinogram, A)
    assert whole.A.geometry.fan_angle_edges[0] == pytest.approx(aside.fan_angle_edges[0])
    assert whole.A.geometry.bins > aside.bins
    assert hu_at_places(FBP()(sinogram, A).image, A.grid) == pytest.approx(RIGHT, abs=8)


@pytest.mark.parametrize("method", ITERATIVE)
def test_iterative_methods_have_pixels_for_what_is_beyond_the_fan(method, generator):
    sinogram, A = prepared(CUT_OFF, generator=generator)
    made = method(sinogram, A)
    assert hu_at_places(made.image, A.grid) == pytest.approx(RIGHT, abs=30)
    assert len(made.notes) == 2


def test_rays_that_were_added_have_no_weight():
    sinogram, A = prepared(CUT_OFF)
    whole = beyond_fan(sinogram, A).sinogram
    added = (whole.line_integrals.shape[1] - 64) // 2
    assert torch.equal(whole.line_integrals[:, added:-added], sinogram.line_integrals)
    assert torch.equal(whole.weights.diagonal[:, added:-added], sinogram.weights.diagonal)
    assert not whole.weights.diagonal[:, :added].any()
    assert float(whole.line_integrals[:, [0, -1]].max()) == 0


def test_each_of_a_batch_is_continued_as_if_alone():
    scans = [scan_of(CUT_OFF), scan_of(CUT_OFF, quanta=1e3, generator=torch.Generator().manual_seed(1))]
    A = Projector(SMALL, CUT_OFF, mu_water=MU)
    both = take_log(replace(scans[0], counts=torch.stack([scan.counts / scan.incident * 1e5 for scan in scans])))
    images = FBP()(both, A).image
    for number, image in enumerate(images):
        alone = take_log(replace(scans[0], counts=scans[number].counts / scans[number].incident * 1e5))
        torch.testing.assert_close(image, FBP()(alone, A).image, rtol=0, atol=1e-5)


def test_correlated_noise_is_left_as_it_is():
    sinogram, A = prepared(CUT_OFF)
    correlated = Sinogram(sinogram.line_integrals, BandedWeights(torch.ones(120, 1, 64)))
    assert beyond_fan(correlated, A).sinogram is correlated


def test_an_object_of_too_many_pixels_is_refused(monkeypatch):
    monkeypatch.setattr(module, "LARGEST", 90**2)
    with pytest.raises(ValueError, match=r"An object of .* mm needs an image of .* ask for larger pixels, or for FBP"):
        PNP(*prepared(WHOLE))


def test_the_command_says_what_was_done_and_notes_it(tmp_path, capsys):
    scan, out = tmp_path / "scan.h5", tmp_path / "out.h5"
    write_scan(scan, scan_of(WHOLE), provenance=Provenance([], "0"))
    words = ["--method", "tv", "--size", "50", "--field-of-view", "100", "--iterations", "2"]
    assert main(["reconstruct", str(scan), str(out), *words]) == 0
    made = TVPWLS(iterations=2)(*prepared(WHOLE))
    assert torch.equal(read_image(out)[0], made.image)
    assert made.notes[0] in capsys.readouterr().out
    notes = Provenance.from_json(out.with_name("out.h5.json").read_text()).settings["notes"]
    assert tuple(notes) == made.notes


@pytest.mark.parametrize("method", [TVPWLS(iterations=1), PlugAndPlay(TotalVariation(0.02), iterations=1)])
@pytest.mark.parametrize("size", [1, 2, 3])
def test_an_image_of_a_few_large_pixels_is_made_or_refused_in_a_sentence(method, size):
    """No view sees the whole of any pixel."""
    sinogram = take_log(scan_of(WHOLE))
    projector = Projector(ImageGrid(size, size, 440.0 / size), WHOLE, mu_water=MU)
    if size == 1:
        with pytest.raises(ValueError, match="focal spot"):
            method(sinogram, projector)
    else:
        assert bool(method(sinogram, projector).image.isfinite().all())


@pytest.mark.parametrize(("views", "missing"), [(7, 153), (21, 90)])
def test_filtered_back_projection_says_which_directions_are_missing(views, missing):
    geometry = replace(WHOLE, view_angles=evenly_spaced_views(80))[range(views)]
    (note,) = FBP()(*prepared(geometry)).notes
    assert f"leave out {missing} of 180 degrees" in note


@pytest.mark.parametrize("views", [120, 80])
@pytest.mark.parametrize("aside", [0.25, 24.0, -24.0])
def test_a_detector_that_is_moved_aside_needs_a_full_turn(views, aside):
    geometry = replace(WHOLE, bins=80 if abs(aside) > 1 else 128, detector_offset=aside)[range(views)]
    notes = FBP()(*prepared(geometry)).notes
    assert notes == () or "the views leave out 123 degrees: lines through the object" in notes[0]
    assert bool(notes) == (views == 80 and abs(aside) > 1)
