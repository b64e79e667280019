import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from pnpct.evaluation import (
    DoseCurve,
    InsertDetectability,
    InsertScans,
    detectability_by_dose,
    dose_curves,
)
from pnpct.geometry import FanBeam, ImageGrid, Insert
from pnpct.operators import Projector
from pnpct.physics import Exposure, Moments, Sinogram
from pnpct.reconstruction import fbp
from pnpct.simulation import low_contrast_phantom, truth
from pnpct.units import MU_WATER_70_KEV

INSERTS = (
    Insert(diameter=40.0, contrast_hu=-60.0, center=(-46.0, 42.0)),
    Insert(diameter=30.0, contrast_hu=70.0, center=(45.0, -38.0)),
)
GRID = ImageGrid(40, 40, spacing=6.0)


def exposure(inserts: tuple[Insert, ...], geometry: FanBeam) -> Exposure:
    """A beam of one energy that detects 4000 quanta per mAs and view."""
    fine = ImageGrid(120, 120, spacing=2.0)
    projector = Projector(fine, geometry)
    counts = 4000 * torch.exp(-projector(truth(low_contrast_phantom(fine, inserts=inserts), fine)))
    air = torch.full((geometry.bins,), 4000.0)
    return Exposure(Moments(counts, counts, air, air), geometry, MU_WATER_70_KEV, None)


@pytest.fixture(scope="module")
def scans(geometry: FanBeam) -> InsertScans:
    return InsertScans(exposure(INSERTS, geometry), exposure((), geometry), INSERTS, GRID)


def judge(scans: InsertScans, **options) -> list[InsertDetectability]:
    projector = Projector(scans.grid, scans.present.geometry)

    def reconstruct(sinogram: Sinogram) -> torch.Tensor:
        return fbp(sinogram.line_integrals, projector)

    defaults = {
        "tube_currents_ma": [100.0, 400.0], "generator": torch.Generator().manual_seed(5), "pairs": 60, "batch": 16,
    }  # fmt: skip
    return list(detectability_by_dose(reconstruct, scans, **{**defaults, **options}))


@pytest.fixture(scope="module")
def found(scans: InsertScans) -> list[InsertDetectability]:
    return judge(scans)


def test_each_dose_gives_a_record_of_each_insert(found: list[InsertDetectability]) -> None:
    order = [(record.tube_current_ma, record.insert) for record in found]
    assert order == [(dose, insert) for dose in (100.0, 400.0) for insert in INSERTS]
    assert all(record.hotelling.pairs == record.npwe.pairs == 60 for record in found)


def test_contrast_and_noise_are_those_of_the_scans(found: list[InsertDetectability]) -> None:
    for record in found:
        assert record.contrast_hu == pytest.approx(record.insert.contrast_hu, rel=0.25)
    assert found[0].noise_hu / found[2].noise_hu == pytest.approx(2, rel=0.05)


def test_four_times_the_dose_doubles_what_every_observer_finds(found: list[InsertDetectability]) -> None:
    for low, high in zip(found[:2], found[2:], strict=True):
        for observer in ("hotelling", "npwe"):
            few, many = (getattr(record, observer).d_prime for record in (low, high))
            ratio = many.estimate / few.estimate
            error = ratio * math.hypot(few.standard_error / few.estimate, many.standard_error / many.estimate)
            assert ratio == pytest.approx(2, abs=3 * error)


def test_an_eye_that_sees_every_frequency_finds_a_large_disc_as_theory_says(scans: InsertScans) -> None:
    # Of white noise it would be the contrast over the noise times the root of the pixels; a ramp has less noise
    # at the low frequencies of a disc, so it must find more than that, and the best observer hardly more than it.
    record = judge(scans, tube_currents_ma=[100.0], eye=np.ones_like)[0]
    pixels = math.pi * record.insert.diameter**2 / 4 / GRID.spacing**2
    assert record.npwe.d_prime.estimate > abs(record.contrast_hu) / record.noise_hu * math.sqrt(pixels)
    assert record.hotelling.d_prime.estimate < 1.5 * record.npwe.d_prime.estimate


def test_where_nothing_is_nothing_is_found(scans: InsertScans) -> None:
    empty = replace(scans, present=scans.absent)
    for record in judge(empty, tube_currents_ma=[100.0]):
        for observer in (record.hotelling, record.npwe):
            assert observer.d_prime.estimate == pytest.approx(0.0, abs=3.5 * observer.d_prime.standard_error)


def test_scans_are_reconstructed_in_batches_of_the_stated_size(scans: InsertScans) -> None:
    seen: list[tuple[int, ...]] = []

    def reconstruct(sinogram: Sinogram) -> torch.Tensor:
        seen.append(tuple(sinogram.line_integrals.shape))
        return torch.randn(len(sinogram.line_integrals), *GRID.shape, generator=generator)

    generator = torch.Generator().manual_seed(1)
    records = detectability_by_dose(
        reconstruct, scans, tube_currents_ma=[10.0, 20.0], generator=torch.Generator(), pairs=40, batch=16
    )
    next(records)
    assert seen == 2 * [(16, 60, 48), (16, 60, 48), (8, 60, 48)]  # the next dose has not begun
    assert len(list(records)) == 3


def test_generators_of_one_state_give_all_methods_the_same_scans(scans: InsertScans) -> None:
    def doubled(sinogram: Sinogram) -> torch.Tensor:
        return 2 * fbp(sinogram.line_integrals, projector)

    projector = Projector(GRID, scans.present.geometry)
    few = {"pairs": 40, "tube_currents_ma": [100.0]}
    plain = judge(scans, **few)
    double = list(detectability_by_dose(doubled, scans, generator=torch.Generator().manual_seed(5), batch=16, **few))
    assert plain == judge(scans, **few)
    for one, other in zip(plain, double, strict=True):
        assert other.noise_hu == pytest.approx(2 * one.noise_hu, rel=1e-5)
        assert other.hotelling.d_prime.estimate == pytest.approx(one.hotelling.d_prime.estimate, rel=1e-3)


def test_a_patch_has_its_insert_in_the_middle(scans: InsertScans) -> None:
    assert scans.side == math.ceil(80 / 6)
    for insert in INSERTS:
        patch, (row, col) = scans.patch_grid(insert), scans.corner(insert)
        assert np.abs(np.subtract(patch.center, insert.center)).max() <= GRID.spacing / 2 + 1e-9
        assert patch.x == pytest.approx(GRID.x[col : col + scans.side])
        assert patch.y == pytest.approx(GRID.y[row : row + scans.side])


def test_curves_are_sorted_by_insert(found: list[InsertDetectability]) -> None:
    doses = [50.0, 100.0, 200.0, 400.0]
    records = [replace(record, tube_current_ma=dose) for dose in doses for record in found[:2]]
    curves = dose_curves(records)
    for number, insert in enumerate(INSERTS):
        assert curves[insert] == DoseCurve(tuple(doses), (found[number].hotelling.d_prime,) * 4)


def test_what_cannot_be_judged_is_refused(scans: InsertScans, geometry: FanBeam) -> None:
    with pytest.raises(ValueError, match="at least one insert"):
        replace(scans, inserts=())
    with pytest.raises(ValueError, match="must be inside the image"):
        replace(scans, grid=ImageGrid(20, 20, spacing=6.0))
    with pytest.raises(ValueError, match="too near"):
        replace(scans, inserts=(*INSERTS, Insert(10.0, 5.0, (30.0, -20.0))))
    with pytest.raises(ValueError, match="one geometry"):
        replace(scans, absent=exposure((), replace(geometry, detector_offset=0.0)))
    with pytest.raises(ValueError, match="40 pairs"):
        judge(scans, pairs=39)
    with pytest.raises(ValueError, match="image on the grid for each scan"):
        next(detectability_by_dose(
            lambda sinogram: torch.ones(1, *GRID.shape), scans, tube_currents_ma=[10.0], generator=torch.Generator()
        ))  # fmt: skip
