"""The methods that are compared, found by name and by role: those of the paper, their controls, and anybody's."""

import pickle
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeAlias

from pnpct.arrays import Image
from pnpct.comparison.schema import ComparedMethod, Role
from pnpct.denoisers import Gaussian
from pnpct.files import load_denoiser
from pnpct.operators import Kernel, Projector
from pnpct.physics import Sinogram
from pnpct.reconstruction import FBP, TVPWLS, DenoisedFBP, PlugAndPlay, Reconstruction

Reconstruct: TypeAlias = Callable[[Sinogram, Projector], Reconstruction | Image]
"""From a sinogram and the projector of its rays to an image, or a batch to a batch: a method of
`pnpct.reconstruction`, or any function."""

RESERVED = ("reference", "repeat", "truth")
"""What a case has besides its methods."""


@dataclass(frozen=True)
class Candidate:
    """A method under a name, with its role.

    Args:
        name: What it is called in all tables, and its images in the folder: letters, digits, and any of "-._+".
        label: What readers see.
        role: What it is there for; only plug-and-play can be swept.
        method: The method.

    Raises:
        ValueError: If it cannot have this name or role.
    """

    name: str
    label: str
    role: Role
    method: Reconstruct

    def __post_init__(self) -> None:
        if not re.fullmatch(r"[\w.+-]+", self.name) or self.name in RESERVED:
            raise ValueError(
                f'A method is called by letters, digits and any of "-._+", and not {", ".join(RESERVED)}; got '
                f'"{self.name}".'
            )
        if self.role == "baseline" and not isinstance(self.method, FBP):
            raise ValueError(f'Methods are measured against FBP, and the baseline "{self.name}" is none.')
        if self.role == "swept" and not isinstance(self.method, PlugAndPlay):
            raise ValueError(f'Only the prior of plug-and-play can be weakened, and "{self.name}" is none.')

    @property
    def settings(self) -> Mapping[str, Any]:
        """All that its images depend on besides the data; of a callable without `settings` its qualified name."""
        known = getattr(self.method, "settings", None)
        if isinstance(known, Mapping):
            return known
        named = self.method if hasattr(self.method, "__qualname__") else type(self.method)
        return {"method": f"{named.__module__}.{named.__qualname__}"}

    @property
    def described(self) -> ComparedMethod:
        """What it is, as plain values."""
        return ComparedMethod(self.name, self.label, self.role, self.settings)

    def make(self, sinogram: Sinogram, A: Projector) -> Image:
        """Return its image; any batch of sinograms gives a batch of images."""
        made = self.method(sinogram, A)
        return made.image if isinstance(made, Reconstruction) else made

    def packed(self) -> bytes:
        """Return what gives the method to other processes.

        Raises:
            ValueError: If it is not made of values, classes and functions of modules, which alone can be sent.
        """
        try:
            return pickle.dumps(self)
        except (pickle.PicklingError, AttributeError, TypeError) as error:
            raise ValueError(
                f'The method "{self.name}" cannot be given to other processes: define its classes and functions at the '
                f"top level of a module, or compare in one process ({error})."
            ) from error

    def weakened(self, share: float) -> "Candidate":
        """Return a swept method with a share of its penalty."""
        it = self.method
        assert isinstance(it, PlugAndPlay)  # as a swept method is
        return replace(self, method=replace(it, sigma_v=it.sigma_v / share**0.5))


@dataclass(frozen=True)
class Candidates:
    """The methods of a comparison.

    Args:
        all: In the order in which they are shown.

    Raises:
        ValueError: If two have one name, or there is not one baseline.
    """

    all: tuple[Candidate, ...]

    def __post_init__(self) -> None:
        names = [each.name for each in self.all]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"Two methods are called {twice[0]}; tables would not tell them apart.")
        if len(self.of("baseline")) != 1:
            raise ValueError(f"A comparison needs one baseline, got {len(self.of('baseline'))}.")

    def __iter__(self) -> Iterator[Candidate]:
        return iter(self.all)

    def __getitem__(self, name: str) -> Candidate:
        """Return the method of a name."""
        return {each.name: each for each in self.all}[name]

    @property
    def baseline(self) -> Candidate:
        """The FBP that the others are measured against."""
        return self.of("baseline")[0]

    def of(self, *roles: Role) -> tuple[Candidate, ...]:
        """Return the methods that have one of the roles."""
        return tuple(each for each in self.all if each.role in roles)

    def with_methods(self, methods: Mapping[str, Reconstruct]) -> "Candidates":
        """Return these and more methods; the priors of those that are plug-and-play are swept.

        Raises:
            ValueError: If one cannot be compared, or its name is taken.
        """
        more = (
            Candidate(name, name, "swept" if isinstance(method, PlugAndPlay) else "compared", method)
            for name, method in methods.items()
        )
        return Candidates((*self.all, *more))


@lru_cache(maxsize=32)
def unpacked(packed: bytes) -> Candidate:
    """Return a method that another process has packed; each process makes it once."""
    candidate: Candidate = pickle.loads(packed)
    return candidate


def controls(kernel: Kernel = FBP.kernel, blur_pixels: float = 1.5) -> Candidates:
    """Return what every method is compared with: FBP, and the same blurred by a Gaussian, which must never win.

    It has the kernel of FBP: the sharpest lets noise through that pixels are too large for and no blur takes away.

    Args:
        kernel: Of FBP.
        blur_pixels: Standard deviation of the blur, pixels.
    """
    label = f"FBP, blurred by {blur_pixels:g} pixels"
    return Candidates(
        (
            Candidate("fbp", f"FBP, {kernel}", "baseline", FBP(kernel)),
            Candidate("blurred-fbp", label, "control", DenoisedFBP(Gaussian(blur_pixels), kernel)),
        )
    )


@dataclass(frozen=True, kw_only=True)
class PaperMethods:
    """The methods of the paper, total variation and the controls, with their settings.

    Args:
        kernel: Kernel of the FBP that all methods are measured against.
        blur_pixels: Standard deviation of the blur of the control, blurred FBP, pixels.
        tv_strength: Strength of total variation, pixels, relative to the noise.
        supervised: Network trained on dose pairs alone, by name or file.
        two_stage: Network trained in two stages, by name or file.
        sigma_v: How closely plug-and-play follows the denoised image, as a standard deviation in HU.
        iterations: Maximum number of iterations of plug-and-play; None for what the noise needs.
        denoiser: Another denoiser to compare plug-and-play with: a network that comes with pnpct, the file of one, a
            classical denoiser, or "my_package.module:name".
    """

    kernel: Kernel = FBP.kernel
    blur_pixels: float = 1.5
    tv_strength: float = TVPWLS.strength
    supervised: str = "supervised"
    two_stage: str = "n2n"
    sigma_v: float = PlugAndPlay.sigma_v
    iterations: int | None = PlugAndPlay.iterations
    denoiser: tuple[str, ...] = ()

    def candidates(self) -> Candidates:
        """Return the methods.

        Raises:
            OSError: If a network cannot be read.
            ValueError: If it is none, or a setting is out of its range.
        """
        learned = {"supervised": load_denoiser(self.supervised), "two-stage": load_denoiser(self.two_stage)}
        loops = {
            name: PlugAndPlay(each, sigma_v=self.sigma_v, iterations=self.iterations) for name, each in learned.items()
        }
        names = [f"pnp-{Path(name.rpartition(':')[2]).stem}" for name in self.denoiser]
        if twice := {name for name in names if names.count(name) > 1}:
            raise ValueError(f"Two denoisers would be called {min(twice)} in the comparison; rename one.")
        further = {
            name: PlugAndPlay(load_denoiser(denoiser), sigma_v=self.sigma_v, iterations=self.iterations)
            for name, denoiser in zip(names, self.denoiser, strict=True)
        }
        of_paper = Candidates(
            (
                *controls(self.kernel, self.blur_pixels),
                Candidate("tv-pwls", "TV-PWLS", "compared", TVPWLS(self.tv_strength)),
                *(Candidate(n, f"{n} denoiser", "compared", DenoisedFBP(each)) for n, each in learned.items()),
                Candidate("pnp-supervised", "PnP, supervised", "compared", loops["supervised"]),
                Candidate("pnp-two-stage", "PnP, two-stage", "swept", loops["two-stage"]),
            )
        )
        return of_paper.with_methods(further)
