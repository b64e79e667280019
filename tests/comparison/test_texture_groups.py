import numpy as np
import pytest
import torch
from scipy.ndimage import gaussian_filter
from small_evidence import fixed, methods

from pnpct.comparison import Case, Comparison, OneScan, Study, summarise
from pnpct.evaluation import (
    GLCMSpec,
    Patch,
    Texture,
    oversmoothing_warnings,
    texture_features,
)
from pnpct.files import Provenance
from pnpct.geometry import ImageGrid

PATCHES = (Patch(0, 0), Patch(0, 64))
METHODS = ("fbp", "blurred-fbp", "tv-pwls", "pnp")


def scan(spread: float, *, patient: int, seed: int) -> np.ndarray:
    """One patient, with noise of its own."""
    anatomy, noise = (np.random.default_rng([number, patient]) for number in (1, 10 + seed))
    tissue = 100 * gaussian_filter(anatomy.normal(size=(64, 128)), 4)
    return 1.03 + (tissue + spread * noise.normal(size=(64, 128))) / 1000


def case(patient: int, current: float | None, *, spec: GLCMSpec | None = None) -> OneScan:
    """FBP has much noise, TV is a constant, the reference has some noise, and plug-and-play comes near it."""
    spec = spec or GLCMSpec()
    spread = 45.0 if current is None else 45.0 * (40.0 / current) ** 0.5
    fbp = scan(spread, patient=patient, seed=1)
    images = {"fbp": fbp, "blurred-fbp": gaussian_filter(fbp, 1.5), "tv-pwls": np.full_like(fbp, 1.04)}
    images["pnp"] = scan(16.0, patient=patient, seed=2)
    if current is not None:
        images |= {"reference": scan(14.0, patient=patient, seed=8), "truth": scan(0.0, patient=patient, seed=9)}
    texture: dict[str, Texture] = {
        name: texture_features(torch.from_numpy(image), PATCHES, spec=spec) for name, image in images.items()
    }
    name = f"{patient}-{current}"
    about = Case(name, name, current, 120.0, ImageGrid(64, 128, 1.0), "", (), {})
    return OneScan(about, f"patient {patient}", {}, texture, {}, {}, ())


@pytest.fixture(scope="module")
def comparison() -> Comparison:
    cases = [case(patient, 40.0) for patient in range(5)]
    cases += [case(patient, 100.0) for patient in (0, 0, 1)]
    cases += [case(0, None, spec=GLCMSpec(smoothing=4.0))]
    candidates = methods(*(fixed(name, torch.zeros(1, 1)) for name in METHODS[2:]))
    return summarise(cases, candidates, Study(), provenance=Provenance(["test"], "0.1.0"))


def test_a_constant_and_a_blurred_fbp_are_never_first_and_are_warned_of(comparison: Comparison) -> None:
    for words in ("40 mA", "100 mA"):
        group = comparison.texture_change[words]
        assert group.ranking[0] not in ("blurred-fbp", "tv-pwls")
        assert set(group.ranking) == set(METHODS[1:])
        for name, change in group.changes.items():
            warned = bool(oversmoothing_warnings(change))
            assert warned == (name in ("blurred-fbp", "tv-pwls")), (words, name)


def test_the_reference_is_the_scan_and_not_the_truth(comparison: Comparison) -> None:
    homogeneity = comparison.texture_change["40 mA"].changes["pnp"]["homogeneity"]
    rows = [comparison.texture[f"{patient}-40.0"] for patient in range(5)]
    assert homogeneity.feature == "homogeneity"
    assert homogeneity.reference == pytest.approx(np.mean([row["reference"]["homogeneity"] for row in rows]))
    assert homogeneity.reference < 0.5 * np.mean([row["truth"]["homogeneity"] for row in rows])


def test_each_tube_current_has_its_own_change_with_its_patients_and_patches(comparison: Comparison) -> None:
    groups = comparison.texture_change
    assert list(groups) == ["40 mA", "100 mA", "measured"]
    assert [group.patients for group in groups.values()] == [5, 2, 1]
    assert [group.patches for group in groups.values()] == [10, 6, 2]
    at_40, at_100 = (groups[words].changes["pnp"].features[0] for words in ("40 mA", "100 mA"))
    assert at_40.fbp > 1.5 * at_100.fbp, "less dose, more noise"


def test_fewer_than_five_patients_have_no_interval(comparison: Comparison) -> None:
    for words, group in comparison.texture_change.items():
        known = {each.interval is not None for change in group.changes.values() for each in change.features}
        assert known == {words == "40 mA"}


def test_measured_scans_have_a_definition_of_their_own_and_no_reference(comparison: Comparison) -> None:
    measured, drawn = (comparison.texture_change[words].changes["pnp"] for words in ("measured", "40 mA"))
    assert measured.spec_hash == GLCMSpec(smoothing=4.0).hash != drawn.spec_hash
    assert all(each.reference is None and each.closeness is None for each in measured.features)
