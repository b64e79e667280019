import json
from dataclasses import replace

import pytest
import torch
from small_phantoms import EDGE, INSERTS, METHODS, PHANTOMS, STUDY

from pnpct.comparison import Comparison, Study
from pnpct.comparison.dose_tasks import with_phantoms
from pnpct.files import Provenance
from pnpct.geometry import ImageGrid, Insert


def test_inserts_are_looked_for_beyond_the_full_dose() -> None:
    assert Study(tube_currents_ma=(100.0, 40.0, 200.0)).doses_ma == (20.0, 40.0, 100.0, 200.0, 400.0)


@pytest.mark.parametrize(
    ("values", "names"),
    [
        ({"phantom_repeats": 1}, "two repeats of the phantoms or more, or 0 for none: 1"),
        ({"detectability_pairs": 10}, "40 pairs of scans or more, or 0 for none: 10"),
        ({"detectability_pairs": -40}, "40 pairs"),
        (
            {"detectability_pairs": 40, "tube_currents_ma": (200.0, 20.0)},
            "besides 20, 200, 400 mA, which it adds itself; got 200, 20",
        ),
        ({"detectability_pairs": 40, "tube_currents_ma": ()}, "got none"),
        ({"tube_currents_ma": (40.0, -1.0)}, "must be positive, in mA, got 40, -1"),
        ({"tube_currents_ma": (float("nan"),)}, "must be positive"),
        ({"seed": -1}, "A seed is a whole number from 0, got -1"),
        ({"size": 0}, "one row and column or more"),
    ],
)
def test_numbers_are_refused_before_any_work(values: dict, names: str) -> None:
    with pytest.raises(ValueError, match=names):
        Study(**values)


def test_phantoms_that_cannot_be_measured_are_refused() -> None:
    with pytest.raises(ValueError, match="at least one insert"):
        replace(PHANTOMS, inserts=())
    for edge in (Insert(30.0, -120.0, (0.0, 0.0)), Insert(40.0, -120.0, (70.0, 0.0))):
        with pytest.raises(ValueError, match="radius of 4 pixels, and as much around it"):
            replace(PHANTOMS, edge=edge)
    with pytest.raises(ValueError, match="radius of 4 pixels"):
        replace(PHANTOMS, grid=ImageGrid(16, 16, spacing=4.5))


def test_the_scan_of_the_phantom_shows_its_inserts() -> None:
    present, absent = (PHANTOMS.exposure(inserts, 120.0).moments.signal_mean for inserts in (INSERTS, ()))
    assert torch.isfinite(present).all()
    assert (present >= absent * (1 - 1e-6)).all(), "dark inserts let more through"
    assert (present > 1.001 * absent).any()


def described(study: Study):
    empty = Comparison(Provenance([], "0"), {}, (), ())
    return with_phantoms(empty, (), METHODS, study).definitions.get("phantoms")


def test_all_that_the_numbers_depend_on_is_described() -> None:
    found = described(replace(STUDY, phantom_repeats=4))
    assert found == json.loads(json.dumps(found))
    assert (found["radius_mm"], found["views"], found["rows"], found["spacing_mm"]) == (100.0, 60, 48, 4.5)
    curves, tasks = found["noise and sharpness"], found["detectability"]
    assert curves["edge"] == {"diameter_mm": 40.0, "contrast_hu": EDGE.contrast_hu, "center_mm": [0.0, 0.0]}
    assert (curves["repeats"], curves["tube_current_ma"]) == (4, 100.0)
    assert tasks["inserts"]["20 mm, −60 HU"]["center_mm"] == [45.0, 45.0]
    assert (tasks["pairs"], tasks["tube_currents_ma"]) == (40, [20.0, 60.0, 200.0, 400.0])
    assert tasks["eye of NPWE"] == {"distance_mm": 500.0, "zoom": 1.0, "decay": 0.98}
    assert tasks["reference"] == {"kernels": ["ram-lak", "hann", "soft"], "tube_current_ma": 200.0}
    assert described(replace(STUDY, detectability_pairs=0)) is None
