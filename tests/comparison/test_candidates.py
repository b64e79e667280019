from dataclasses import replace

import pytest
import torch
from my_methods import ONE, Smoothed, plain

from pnpct.comparison import Candidate, Candidates, PaperMethods, controls, imported_methods
from pnpct.comparison.methods import unpacked
from pnpct.denoisers import DENOISERS, Classical, Gaussian, LearnedDenoiser, TotalVariation
from pnpct.reconstruction import FBP, TVPWLS, DenoisedFBP, PlugAndPlay


def test_the_methods_of_the_paper_have_their_roles() -> None:
    found = PaperMethods(iterations=3).candidates()
    names = ["fbp", "blurred-fbp", "tv-pwls", "supervised", "two-stage", "pnp-supervised", "pnp-two-stage"]
    assert [each.name for each in found] == names
    assert found.baseline.method == FBP()
    assert {role: [each.name for each in found.of(role)] for role in ("baseline", "control", "swept")} == {
        "baseline": ["fbp"],
        "control": ["blurred-fbp"],
        "swept": ["pnp-two-stage"],
    }
    assert found["tv-pwls"].method == TVPWLS()
    swept = found["pnp-two-stage"]
    assert swept.settings == swept.described.settings == swept.method.settings
    assert (swept.settings["denoiser"], swept.settings["iterations"]) == ("n2n", 3)
    assert swept.method.denoise is found["two-stage"].method.denoise, "a network is loaded once"


def test_the_control_is_sharp_fbp_behind_a_blur() -> None:
    assert controls(blur_pixels=2.0)["blurred-fbp"].method == DenoisedFBP(Gaussian(2.0), "hann")


def test_a_denoiser_that_is_known_by_name_is_compared_in_plug_and_play(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(DENOISERS, "mine", Classical(Smoothed, "pixels", 2.0))
    found = PaperMethods(denoiser=("mine", "gaussian"), sigma_v=50.0).candidates()
    assert found["pnp-mine"].method == PlugAndPlay(Smoothed(2.0), sigma_v=50.0)
    assert [each.name for each in found.of("swept")] == ["pnp-two-stage", "pnp-mine", "pnp-gaussian"]


def test_any_methods_are_compared_with_the_controls() -> None:
    found = controls().with_methods({"mine": PlugAndPlay(TotalVariation(0.05)), "plain": plain})
    assert {each.name: each.role for each in found.of("swept", "compared")} == {"mine": "swept", "plain": "compared"}
    assert found["plain"].settings == {"method": "my_methods.plain"}
    assert found["mine"].described.label == "mine"


def test_a_weaker_prior_is_the_same_method_with_less_penalty() -> None:
    method = PlugAndPlay(Gaussian(1.0), sigma_v=50.0, iterations=3)
    found = Candidate("mine", "mine", "swept", method).weakened(0.1).method
    assert found.sigma_v == pytest.approx(50.0 * 10**0.5)
    assert replace(found, sigma_v=50.0) == method


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: controls().with_methods({"fbp": FBP()}), "Two methods are called fbp"),
        (lambda: controls().with_methods({"truth": FBP()}), 'not reference, repeat, truth; got "truth"'),
        (lambda: controls().with_methods({"a/b": FBP()}), 'got "a/b"'),
        (lambda: Candidates(controls().all[1:]), "needs one baseline, got 0"),
        (lambda: Candidate("mine", "mine", "swept", FBP()), "Only the prior of plug-and-play"),
        (lambda: Candidate("mine", "mine", "baseline", TVPWLS()), "measured against FBP"),
    ],
)
def test_what_cannot_be_compared_is_refused(make, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        make()


def test_methods_travel_to_other_processes_with_their_networks() -> None:
    network = torch.nn.Conv2d(1, 1, 3, padding=1)
    given = controls().with_methods({"mine": PlugAndPlay(LearnedDenoiser(network)), "plain": plain})
    found = Candidates(tuple(unpacked(each.packed()) for each in given))
    image = torch.rand(8, 8)
    assert torch.equal(*(each["mine"].method.denoise.network(image[None]) for each in (given, found)))
    assert found["plain"].method is plain
    with pytest.raises(ValueError, match=r'"mine" cannot be given to other processes: .* top level of a module'):
        controls().with_methods({"mine": lambda sinogram, A: None})["mine"].packed()


@pytest.mark.parametrize(
    ("path", "names"),
    [
        ("my_methods:ONE", ["ONE"]),
        ("my_methods:make_one", ["make_one"]),
        ("my_methods:SEVERAL", ["first", "second"]),
        ("my_methods:make_several", ["first", "second"]),
        ("my_methods:plain", ["plain"]),
    ],
)
def test_methods_are_imported_by_where_they_are(path: str, names: list[str]) -> None:
    found = imported_methods(path)
    assert list(found) == names
    assert found[names[0]] == (plain if path.endswith("plain") else ONE)


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ("my_methods", "is named like"),
        ("no_such_module:method", "no_such_module:method cannot be imported as a method: ModuleNotFoundError"),
        ("my_methods:absent", "AttributeError"),
        ("my_methods:broken", "cannot be imported as a method: RuntimeError, out of order"),
        ("my_methods:NUMBER", "must be a method .* got 3"),
    ],
)
def test_what_is_no_method_is_said_in_one_sentence(path: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        imported_methods(path)


def test_two_denoisers_of_one_name_are_refused() -> None:
    with pytest.raises(ValueError, match="Two denoisers would be called pnp-gaussian"):
        PaperMethods(denoiser=("gaussian", "gaussian")).candidates()
