"""Rays that were not measured, transmissions, and line integrals whose counts nobody knows: HU that are right."""

import numpy as np
import pytest
import torch
from disc_scans import BINS, GEOMETRY, MU, RIGHT, VIEWS, chords

from pnpct.cli import main
from pnpct.files import Provenance, import_arrays, read_scan, scan_from_arrays, write_scan
from pnpct.geometry import ImageGrid
from pnpct.operators import Projector
from pnpct.physics import MOST_QUANTA, Scan, estimate_incident, take_log
from pnpct.reconstruction import fbp


@pytest.fixture(scope="module")
def line_integrals():
    return chords()


def hu_of(scan):
    """Mean HU in water and in the two inserts of an FBP image, and its extremes within the water."""
    grid = ImageGrid(140, 140, 2.0)
    image = fbp(take_log(scan).line_integrals, Projector(grid, scan.geometry, mu_water=MU), kernel="hann")
    hu = 1000 * (image.double().numpy() - 1)
    x, y = np.meshgrid(grid.x, grid.y)
    means = [hu[np.hypot(x - at[0], y - at[1]) < at[2]].mean() for at in ((0, -60, 20), (60, 0, 8), (-50, -10, 9))]
    inside = hu[np.hypot(x, y) < 100]
    return np.array(means), (inside.min(), inside.max())


def test_transmissions_are_recognised_by_their_size(line_integrals):
    made = import_arrays(np.exp(-line_integrals), GEOMETRY, kind="counts", incident=1.0, mu_water=MU)
    assert hu_of(made.scan)[0] == pytest.approx(RIGHT, abs=5)
    assert "taken for transmissions" in made.notes[0]
    assert "incident quanta were" in made.notes[1]


def test_transmissions_of_known_incident_counts_are_counts(line_integrals):
    transmissions = np.random.default_rng(3).poisson(1e4 * np.exp(-line_integrals)) / 1e4
    made = import_arrays(transmissions, GEOMETRY, kind="counts", incident=1e4, mu_water=MU)
    assert made.scan.counts.numpy() == pytest.approx(1e4 * transmissions, rel=1e-6)
    assert len(made.notes) == 1


@pytest.mark.parametrize("incident", [None, 1.0])
def test_line_integrals_need_no_counts_for_fbp(line_integrals, incident):
    made = import_arrays(line_integrals, GEOMETRY, incident=incident, mu_water=MU)
    assert hu_of(made.scan)[0] == pytest.approx(RIGHT, abs=5)
    assert "incident quanta were" in made.notes[0]


@pytest.mark.parametrize("incident", [10.0, 100.0])
def test_counts_that_the_noise_denies_are_scaled_to_it(line_integrals, incident):
    given = incident * np.linspace(0.5, 1.5, GEOMETRY["bins"])
    made = import_arrays(line_integrals, GEOMETRY, incident=given, mu_water=MU)
    assert hu_of(made.scan)[0] == pytest.approx(RIGHT, abs=5)
    assert [sentence in note for sentence, note in zip(["far less noise", "were assumed"], made.notes, strict=True)]
    ratio = made.scan.incident.numpy() / given
    assert ratio == pytest.approx(ratio.mean(), rel=1e-6)
    insisted = import_arrays(line_integrals, GEOMETRY, incident=given, mu_water=MU, insist=True)
    assert insisted.scan.incident.numpy() == pytest.approx(given)
    assert insisted.notes == ()


@pytest.mark.parametrize("most", [5.0, 100.0])
def test_counts_without_the_noise_of_so_few_are_scaled_too(line_integrals, most):
    """Transmissions in percent, say; those of at most 5 gave -450 HU."""
    made = import_arrays(most * np.exp(-line_integrals), GEOMETRY, kind="counts", incident=most, mu_water=MU)
    assert hu_of(made.scan)[0] == pytest.approx(RIGHT, abs=5)
    assert "far less noise" in made.notes[0]


def test_line_integrals_are_no_counts(line_integrals):
    """They gave -600 HU."""
    with pytest.raises(ValueError, match="as line integrals have; set kind to line-integrals"):
        import_arrays(line_integrals, GEOMETRY, kind="counts", incident=1e5, mu_water=MU)


@pytest.mark.parametrize("incident", [300.0, 1e5])
def test_counts_that_fit_the_noise_are_taken_as_they_are(line_integrals, incident):
    counts = np.random.default_rng(2).poisson(incident * np.exp(-line_integrals)).clip(0.5)
    made = import_arrays(-np.log(counts / incident), GEOMETRY, incident=incident, mu_water=MU)
    assert made.notes == ()
    assert made.scan.incident.item() == incident


@pytest.mark.parametrize("quanta", [1e3, 1e4, 1e5])
def test_the_incident_counts_follow_from_the_noise(line_integrals, quanta):
    counts = np.random.default_rng(1).poisson(quanta * np.exp(-line_integrals / 3)).clip(1)
    assert estimate_incident(-np.log(counts / quanta)) == pytest.approx(quanta, rel=0.15)
    assert estimate_incident(np.zeros((4, 9))) == MOST_QUANTA


def dead_cell(counts):
    counts[:, 150] = np.nan
    return {}


def silent_cell(counts):
    counts[:, 150] = 0
    return {}


def noisy_cell(counts):
    counts[:, 150] = 10 * np.random.default_rng(4).standard_normal(VIEWS)
    return {"electronic_noise": 10.0}


def without_incident(counts):
    return {"incident": np.where(np.arange(BINS) == 150, 0.0, 1e5)}


def masked(counts):
    counts[:, 150] = 7e5
    return {"mask": np.arange(BINS) != 150}


def stuck_high(counts):
    counts[:, 150:154] = 65535.0
    return {}


def stuck_low(counts):
    counts[:, 150] = 3.0
    return {}


def dead_views(counts):
    counts[[20, 21, 22, 90]] = 0


def lost_rays(counts):
    counts[np.random.default_rng(5).random(counts.shape) < 0.02] = 0


@pytest.mark.parametrize(("lose", "said"), [(dead_views, "4 views in which"), (lost_rays, "were left out as lost")])
def test_views_and_rays_without_counts_leave_no_streaks(line_integrals, lose, said):
    """The largest value was 3688 HU, and four dead views of 180 made everything 13 to 20 HU darker."""
    counts = 1e5 * np.exp(-line_integrals)
    lose(counts)
    made = import_arrays(counts, GEOMETRY, kind="counts", incident=1e5, mu_water=MU)
    means, (least, most) = hu_of(made.scan)
    assert means == pytest.approx(RIGHT, abs=5)
    assert least > -200
    assert most < 900
    assert any(said in note for note in made.notes)


def test_few_counts_behind_metal_are_measurements(line_integrals):
    """There they are 0 by chance, and so are their neighbours."""
    counts = np.random.default_rng(6).poisson(30 * np.exp(-line_integrals))
    counts[:, 100:104] = 0
    counts[50, 102] = 1
    made = import_arrays(counts, GEOMETRY, kind="counts", incident=30.0, mu_water=MU)
    lost = ~made.scan.measured.expand(VIEWS, BINS).numpy()
    assert lost.sum() == 3 * VIEWS  # the cells that are dead
    assert not lost[:, 102].any()


def test_transmissions_are_no_line_integrals(line_integrals):
    """They gave -1100 HU."""
    transmissions = np.exp(-line_integrals)
    with pytest.raises(ValueError, match="as counts or transmissions counts/incident are; set kind to counts"):
        import_arrays(transmissions, GEOMETRY, mu_water=MU)
    assert import_arrays(transmissions, GEOMETRY, mu_water=MU, insist=True).scan.geometry.views == VIEWS
    with pytest.raises(ValueError, match="steady at both ends of the fan"):
        import_arrays(5 * transmissions, GEOMETRY, mu_water=MU)
    small = line_integrals / line_integrals.max()
    assert import_arrays(small, GEOMETRY, mu_water=MU).scan.geometry.views == VIEWS


@pytest.mark.parametrize("lose", [dead_cell, silent_cell, noisy_cell, without_incident, masked, stuck_high])
def test_a_dead_cell_leaves_no_ring(line_integrals, lose):
    counts = 1e5 * np.exp(-line_integrals)
    options = {"incident": 1e5, **lose(counts)}
    made = import_arrays(counts, GEOMETRY, kind="counts", mu_water=MU, **options)
    means, (least, most) = hu_of(made.scan)
    assert means == pytest.approx(RIGHT, abs=5)
    assert least > -200
    assert most < 900
    assert f"{(~made.scan.measured).sum() * VIEWS} of {VIEWS * BINS} rays were not measured" in made.notes[-1]
    sinogram = take_log(made.scan)
    assert not sinogram.weights.diagonal[:, 150].any()
    assert bool(sinogram.line_integrals.isfinite().all())


@pytest.mark.parametrize(("change", "bins"), [(stuck_high, [150, 151, 152, 153]), (stuck_low, [150])])
@pytest.mark.parametrize("noise", [True, False])
def test_stuck_cells_are_found_and_no_others(line_integrals, change, bins, noise):
    counts = 1e5 * np.exp(-line_integrals)
    counts = np.random.default_rng(7).poisson(counts).astype(float) if noise else counts
    change(counts)
    made = import_arrays(counts, GEOMETRY, kind="counts", incident=1e5, mu_water=MU)
    assert np.flatnonzero(~made.scan.measured.numpy()).tolist() == bins
    assert f"left out as stuck: {', '.join(map(str, bins))}." in made.notes[0]


def test_a_mask_the_wrong_way_round_is_doubted(line_integrals):
    mask = np.arange(BINS) == 150
    with pytest.raises(ValueError, match="leaves 180 of 46080 rays: is it the wrong way round"):
        import_arrays(line_integrals, GEOMETRY, mask=mask, mu_water=MU)
    assert (~import_arrays(line_integrals, GEOMETRY, mask=~mask, mu_water=MU).scan.measured).sum() == 1


@pytest.mark.parametrize("value", [0.0, 300.0, 1e6])
def test_what_an_unmeasured_ray_holds_does_not_matter(geometry, generator, value):
    counts = torch.poisson(torch.full(geometry.shape, 300.0), generator=generator)
    incident = torch.full(geometry.shape, 1000.0)
    whole = take_log(Scan(counts.clone(), incident.clone(), 3.0, geometry, mu_water=0.02))
    incident[5, 7], counts[5, 7] = 0.0, value
    holed = take_log(Scan(counts, incident, 3.0, geometry, mu_water=0.02))
    assert float(holed.weights.diagonal[5, 7]) == 0.0
    beside = (holed.line_integrals[5, 6] + holed.line_integrals[5, 8]) / 2
    assert float(holed.line_integrals[5, 7]) == pytest.approx(float(beside), rel=1e-6)
    far = torch.ones(geometry.shape, dtype=torch.bool)
    far[:, 2:13] = False
    torch.testing.assert_close(holed.line_integrals[far], whole.line_integrals[far])


def test_views_without_a_ray_are_left_out(line_integrals, tmp_path):
    counts = 1e5 * np.exp(-line_integrals)
    counts[10:12] = np.nan
    made = import_arrays(counts, GEOMETRY, kind="counts", incident=1e5, mu_water=MU)
    assert made.scan.geometry.views == VIEWS - 2
    assert "2 views in which nothing was measured were left out" in made.notes[-1]
    write_scan(tmp_path / "scan.h5", made.scan, provenance=Provenance([], "0"))
    assert read_scan(tmp_path / "scan.h5").geometry == made.scan.geometry


def test_the_bins_of_a_mask_run_as_those_of_the_array(line_integrals):
    counts = 1e5 * np.exp(-line_integrals)
    made = import_arrays(
        counts[:, ::-1], GEOMETRY | {"bin_direction": -1}, kind="counts", incident=1e5, mask=np.arange(BINS) != 3
    )
    assert (~made.scan.measured).nonzero().tolist() == [[BINS - 4]]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"kind": "counts"}, "Counts need their incident counts"),
        ({"kind": "counts", "incident": 0.0}, "incident counts must be positive"),
        ({"kind": "counts", "incident": 1e5, "array": np.zeros((VIEWS, BINS))}, "No ray detected anything"),
        ({"mask": np.zeros(BINS)}, "No ray was measured"),
        ({"mask": np.zeros(3)}, "The mask must be one number or of the shape"),
    ],
)
def test_what_cannot_be_is_one_sentence(line_integrals, options, message):
    with pytest.raises(ValueError, match=message):
        scan_from_arrays(**{"array": 5 * np.exp(-line_integrals), "geometry": GEOMETRY, **options})


def test_info_counts_what_was_not_measured_and_names_dead_cells(geometry, tmp_path, capsys):
    counts, incident = torch.full(geometry.shape, 500.0), torch.full((geometry.bins,), 1000.0)
    counts[:, 3], incident[5] = 0.0, 0.0
    scan = Scan(counts, incident, 3.0, geometry, mu_water=0.02)
    write_scan(tmp_path / "scan.h5", scan, provenance=Provenance([], "0"))
    assert main(["info", str(tmp_path / "scan.h5")]) == 0
    said = capsys.readouterr().out
    assert f"not measured: {geometry.views} of {geometry.views * geometry.bins}" in said
    assert "seem dead: bins 3 count nothing in any view; import them with --mask" in said
    assert (
        main(["reconstruct", str(tmp_path / "scan.h5"), str(tmp_path / "image.h5"), "--method", "fbp", "--size", "16"])
        == 0
    )
    assert "Bins 3 count nothing in any view" in capsys.readouterr().out
