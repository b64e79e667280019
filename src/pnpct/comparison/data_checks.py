"""What the data say of the images of one case: residuals, the score test, unseen views, and a weaker prior."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial

import torch
from jaxtyping import Float
from torch import Tensor

from pnpct.arrays import Image
from pnpct.comparison.methods import Candidate, Candidates
from pnpct.comparison.schema import Check, StoredImage, Verdict
from pnpct.comparison.stored_images import ImageFolder
from pnpct.comparison.study import Study
from pnpct.evaluation import (
    Consistency,
    Finding,
    Mask,
    ScoreTest,
    body_mask,
    consistency,
    prior_sweep,
    score_test,
    split_views,
)
from pnpct.evaluation.data.consistency import CORRELATED
from pnpct.evaluation.data.disc_information import disc_information
from pnpct.geometry.short_repr import short_repr
from pnpct.operators import Projector
from pnpct.physics import Sinogram

DISC = 8.0
"""Diameter of the discs of the score test, mm."""

LARGEST_T = 5.0
"""|T| that an independent truth exceeds somewhere once in twenty scans of one energy. What beam hardening and pixels
add at a place, up to 30 at the edges of bones, is known from the truth and taken off. An image that was fitted to the
data stays far below this limit, so it finds gross errors only; `score_threshold` has the limit of one method, at forty
times the time."""

LARGEST_HELD_OUT_T = math.sqrt(2) * LARGEST_T
"""The same for an image from other views: its own noise adds to that of the data, as much again where a reconstruction
makes the best of its half."""

WEAKER = 0.1
"""Share of the penalty that the sweep towards no prior goes down to."""

Maps = dict[str, dict[str, StoredImage]]


@dataclass(frozen=True, eq=False)
class Evidence:
    """What the checks of one case are made of.

    Args:
        case: Its name.
        sinogram: Its data.
        projector: A.
        truth: The object; None if it is not known.
        fbp: The image that says where the body is if the truth is not known.
        methods: The methods that are compared.
        study: What is asked of them.
        folder: Where its images are stored.
    """

    case: str
    sinogram: Sinogram
    projector: Projector
    truth: Image | None
    fbp: Image
    methods: Candidates
    study: Study
    folder: ImageFolder

    __repr__ = short_repr

    @cached_property
    def body(self) -> Mask:
        """Where T is looked at."""
        return body_mask(self.fbp if self.truth is None else self.truth)

    @cached_property
    def trusted(self) -> Consistency | None:
        """The residual of the truth: what beam hardening and pixels leave even there; None if it is not known."""
        return None if self.truth is None else consistency(self.truth, self.sinogram, self.projector)

    @property
    def floor(self) -> float:
        """Its chi-square; 1, as if nothing was left, if it is not known."""
        return 1.0 if self.trusted is None else self.trusted.chi2

    @property
    def disc(self) -> float:
        """Diameter of the discs, mm: coarse images have none as small as `DISC`."""
        return max(DISC, 2 * self.projector.grid.spacing)

    @cached_property
    def information(self) -> Float[Tensor, "_ _"]:
        """What the data say of every disc, the same for all images."""
        return disc_information(self.sinogram.weights, self.projector, self.disc)

    @cached_property
    def score(self) -> Float[Tensor, "_ _"]:
        """|T| of the truth; 0 if it is not known."""
        return _score_of_truth(self, self.sinogram, self.projector, self.information)


def judge(evidence: Evidence, images: Mapping[str, Image]) -> tuple[Maps, tuple[Check, ...]]:
    """Test every image against the data; return the maps, and the verdicts.

    Maps are 0 outside the body, where nobody asks, and where no disc fits. Without a truth nothing is judged: beam
    hardening leaves residuals in the best of images, of a size that nobody knows then.
    """
    if not bool(evidence.body.any()):
        says = "There is no body in the image, and nothing to ask the data about."
        return {}, (Check("largest score", evidence.case, None, None, None, None, "not judged", says),)
    checks: list[Check] = []
    maps: Maps = {}
    of_all: StoredImage | None = None
    settings: dict[str, object] = {"disc": evidence.disc, "outside": 0.0}
    for name, image in images.items():
        checks += _residual(evidence, name, image)
        test = score_test(
            image,
            evidence.sinogram,
            evidence.projector,
            diameter=evidence.disc,
            floor=evidence.floor,
            information=evidence.information,
        )
        checks.append(_largest(evidence, name, _beyond(test, evidence.score).strongest_within(evidence.body)))
        shown = evidence.body & test.verifiable_hu.isfinite()
        t, verifiable_hu = (torch.where(shown, values, 0.0) for values in (test.t, test.verifiable_hu))
        of_image = {**settings, "image": dict(evidence.methods[name].settings)}
        of_all = of_all or evidence.folder.get("maps/verifiable_hu", verifiable_hu.float, settings)[1]
        maps[name] = {"t": evidence.folder.get(f"maps/{name}-t", t.float, of_image)[1], "verifiable_hu": of_all}
    return maps, tuple(checks)


def cross_view(evidence: Evidence) -> Iterator[Check]:
    """Reconstruct by every method from the even views, and yield what the odd ones, unseen noise, say of it.

    It takes another half of the time of all reconstructions, so it is left out where a lesion is (`Study.lesion_hu`).
    """
    if evidence.study.lesion_hu == 0 or not bool(evidence.body.any()):
        return
    even, odd = split_views(evidence.sinogram, evidence.projector)
    information = disc_information(odd.sinogram.weights, odd.projector, evidence.disc)
    of_truth = _score_of_truth(evidence, odd.sinogram, odd.projector, information)
    for method in evidence.methods:
        make, settings = partial(method.make, even.sinogram, even.projector), {**method.settings, "views": "even"}
        image, _ = evidence.folder.get(f"half-of-views/{method.name}", make, settings)
        test = score_test(
            image, odd.sinogram, odd.projector, diameter=evidence.disc, floor=evidence.floor, information=information
        )
        found = _beyond(test, of_truth).strongest_within(evidence.body)
        says = f"Made from every second view and tested on the others: {_in_words(evidence, found)}"
        most = LARGEST_HELD_OUT_T
        verdict = _verdict(evidence, abs(found.t) <= most)
        yield Check("cross-view score", evidence.case, method.name, found.t, -most, most, verdict, says)


def weaker_prior(evidence: Evidence, images: Mapping[str, Image]) -> tuple[Maps, tuple[Check, ...]]:
    """Show what the images of swept methods have only because their priors are strong; it is for readers to judge.

    Where the change is below what the data can tell, only the prior vouches for it; where it is above, they could have
    confirmed it, and the scores say whether they do.
    """
    if not bool(evidence.body.any()):
        return {}, ()
    found = {method.name: _sweep(evidence, method, images[method.name]) for method in evidence.methods.of("swept")}
    return {name: {"difference_hu": stored} for name, (stored, _) in found.items()}, tuple(c for _, c in found.values())


def _sweep(evidence: Evidence, method: Candidate, image: Image) -> tuple[StoredImage, Check]:
    """What changes with less of one method's prior."""
    weak = method.weakened(WEAKER)
    sinogram, A, disc = evidence.sinogram, evidence.projector, evidence.disc
    make = partial(weak.make, sinogram, A)
    weaker, _ = evidence.folder.get(f"maps/{weak.name}-weak-prior", make, weak.settings)
    test = score_test(image, sinogram, A, diameter=disc, floor=evidence.floor, information=evidence.information)
    (found,) = prior_sweep({WEAKER: weaker, 1.0: image}, test, mask=evidence.body)
    difference = torch.where(evidence.body, found.difference_hu, 0.0)
    settings = {"disc": disc, "outside": 0.0, "image": dict(weak.settings), "share_of_penalty": WEAKER}
    _, stored = evidence.folder.get(f"maps/{weak.name}-difference_hu", difference.float, settings)
    says = (
        f"With a tenth of the penalty a disc of {disc:g} mm changes by {-found.change_hu:+.0f} HU at most, "
        f"{found.largest:.2f} times what the data can tell there: "
        + ("the scores say whether they want it." if found.largest > 1 else "only the prior vouches for it.")
    )
    check = Check("prior-off sweep", evidence.case, weak.name, found.largest, None, None, "not judged", says)
    return stored, check


def _residual(evidence: Evidence, name: str, image: Image) -> Iterator[Check]:
    """Size of the residual, and whether neighbours in it are alike, against those of the truth.

    What the reconstruction has fitted of the noise is not known, so there are upper ends only.
    """
    trusted = evidence.trusted
    found = consistency(image, evidence.sinogram, evidence.projector, floor=evidence.floor)
    high = None if trusted is None else found.largest_ratio
    says = (
        f"The residual's chi-square is {found.ratio:.3f}; without a trusted image its due size is not known."
        if trusted is None
        else f"The residual's chi-square is {found.ratio:.3f} times that of the truth."
    )
    verdict = _verdict(evidence, high is None or found.ratio <= high)
    yield Check("residual chi-square", evidence.case, name, found.ratio, None, high, verdict, says)
    for along in ("views", "bins"):
        value: float = getattr(found, f"along_{along}")
        says = f"Residuals of neighbouring {along} correlate by {value:+.2f}"
        if trusted is not None:
            due: float = getattr(trusted, f"along_{along}")
            high = CORRELATED + max(0.0, due)
            says += f", those of the truth by {due:+.2f}"
        verdict = _verdict(evidence, high is None or value <= high)
        says += "; structure that the image lacks or invents makes them alike."
        yield Check(f"residual correlation along {along}", evidence.case, name, value, None, high, verdict, says)


def _largest(evidence: Evidence, name: str, found: Finding) -> Check:
    says = _in_words(evidence, found)
    beyond = abs(found.t) > LARGEST_T
    if not beyond:
        says += " A small score says little: the image was fitted to these very data."
    verdict: Verdict = _verdict(evidence, False) if beyond else "not judged"
    return Check("largest score", evidence.case, name, found.t, -LARGEST_T, LARGEST_T, verdict, says)


def _score_of_truth(evidence: Evidence, sinogram: Sinogram, A: Projector, information: Tensor) -> Tensor:
    """|T| that beam hardening, pixels and noise leave at each place even for the truth."""
    if evidence.truth is None:
        return torch.zeros_like(information)
    test = score_test(
        evidence.truth, sinogram, A, diameter=evidence.disc, floor=evidence.floor, information=information
    )
    return test.t.abs()


def _beyond(test: ScoreTest, of_truth: Tensor) -> ScoreTest:
    return replace(test, t=test.t.sign() * (test.t.abs() - of_truth).clamp(min=0.0))


def _in_words(evidence: Evidence, found: Finding) -> str:
    taken_off = "" if evidence.truth is None else " The score of the truth at the same place is taken off."
    return (
        f"At ({found.position[0]:.0f}, {found.position[1]:.0f}) mm the data want {found.missing_hu:+.0f} HU more in a "
        f"disc of {evidence.disc:g} mm; they can tell {found.verifiable_hu:.0f} HU there.{taken_off}"
    )


def _verdict(evidence: Evidence, passes: bool) -> Verdict:
    """Without a trusted image nothing is judged."""
    if evidence.trusted is None:
        return "not judged"
    return "pass" if passes else "fail"
