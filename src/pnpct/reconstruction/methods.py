"""The methods: frozen values that turn a sinogram into an image.

Their fields are the options, and the only place of their defaults: the command line, comparisons, benchmarks and a
user's three lines of Python read them here, and give the same image.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, is_dataclass, replace
from typing import Any, Literal, Protocol, TypeAlias, runtime_checkable

import torch

from pnpct.arrays import Image
from pnpct.denoisers import DENOISERS, Denoise, LearnedDenoiser, TotalVariation
from pnpct.operators import Kernel, Projector
from pnpct.physics import Sinogram
from pnpct.reconstruction.fbp import fbp
from pnpct.reconstruction.normal_equations import INNER_ITERATIONS, beta_from_sigma_v, sigma_v_from_beta
from pnpct.reconstruction.pnp_admm import BETA, ADMMState, pnp_admm
from pnpct.reconstruction.reconstructed import Reconstruction
from pnpct.reconstruction.solvers import ITERATIVE, SolverName, solver_by_name
from pnpct.reconstruction.starting import starting_state
from pnpct.reconstruction.stopping import RuleName, until
from pnpct.reconstruction.whole_object import beyond_fan, beyond_image

ITERATIONS = 20

DAMPING = 0.5
"""With a network: what u has collected counts for half in the next iteration, for a quarter in the one after.

Undamped, the noise of x + u grows until networks take it for anatomy."""

ResultName: TypeAlias = Literal["last", "mean"]

Progress: TypeAlias = Callable[[Iterator[ADMMState], int], Iterable[ADMMState]]
"""From the iterates of a method, and their maximum number, to the same iterates, displayed or recorded as they pass."""


@runtime_checkable
class Method(Protocol):
    """From a sinogram, and the projector of its rays, to an image; any batch of sinograms gives a batch of images."""

    @property
    def settings(self) -> Mapping[str, Any]:
        """All that the image depends on besides the data, as plain values."""
        ...

    def __call__(self, sinogram: Sinogram, A: Projector, *, progress: Progress = ...) -> Reconstruction:
        """Reconstruct."""
        ...


def unwatched(states: Iterator[ADMMState], _most: int) -> Iterable[ADMMState]:
    """Let the iterates pass."""
    return states


@dataclass(frozen=True)
class FBP:
    """Filtered back-projection.

    Args:
        kernel: "ram-lak", "shepp-logan", "hann" or "soft", from sharp to smooth.
    """

    kernel: Kernel = "hann"

    @property
    def settings(self) -> Mapping[str, Any]:
        """All that the image depends on besides the data, as plain values."""
        return {"method": "fbp", **asdict(self)}

    def __call__(self, sinogram: Sinogram, A: Projector, *, progress: Progress = unwatched) -> Reconstruction:
        """Reconstruct; there are no iterates to watch."""
        del progress
        whole = beyond_fan(sinogram, A)
        image = fbp(whole.sinogram.line_integrals, whole.A, kernel=self.kernel)
        return Reconstruction(image, self.settings, notes=whole.notes)


@dataclass(frozen=True)
class DenoisedFBP:
    """A denoiser alone, on filtered back-projection.

    Args:
        denoise: The denoiser.
        kernel: Kernel of FBP; pnpct's networks expect the sharpest.
    """

    denoise: Denoise
    kernel: Kernel = "ram-lak"

    @property
    def settings(self) -> Mapping[str, Any]:
        """All that the image depends on besides the data, as plain values."""
        return {"method": "denoised-fbp", "kernel": self.kernel, **denoiser_settings(self.denoise)}

    def __call__(self, sinogram: Sinogram, A: Projector, *, progress: Progress = unwatched) -> Reconstruction:
        """Reconstruct; there are no iterates to watch."""
        del progress
        made = FBP(self.kernel)(sinogram, A)
        return replace(made, image=self.denoise(made.image), settings=self.settings)


@dataclass(frozen=True)
class TVPWLS:
    """Penalised weighted least squares with total variation: the baseline that learned priors have to beat.

    It converges to the minimiser of ½ ‖A x − y‖²_W / d + strength · TV(x), d the mean diagonal of AᵀWA, so that one
    strength serves every dose and geometry. The iterates are those of ADMM with the proximal map of total variation at
    strength/β, from a smooth FBP image on: with a convex prior the limit does not depend on β.

    Args:
        strength: λ ≥ 0, HU × pixel.
        beta: Penalty of ADMM, > 0: only the speed depends on it.
        iterations: Maximum number of iterations, at least 1.
        stop: Stopping rule that may end the iterations earlier.

    References:
        Sidky and Pan, Phys. Med. Biol. 53 (2008) 4777; Fessler, IEEE Trans. Image Process. 3 (1994) 290.
    """

    strength: float = DENOISERS["tv"].usual * BETA
    beta: float = BETA
    iterations: int = ITERATIONS
    stop: RuleName = "relative"

    def __post_init__(self) -> None:
        if not 0 <= self.strength < float("inf"):
            raise ValueError(f"The strength of total variation is HU × pixel from 0 up, got {self.strength:g}.")
        if not 0 < self.beta < float("inf"):
            raise ValueError(f"beta must be a positive number, got {self.beta}.")

    @property
    def settings(self) -> Mapping[str, Any]:
        """All that the image depends on besides the data, as plain values."""
        return {"method": "tv", **asdict(self)}

    def states(self, sinogram: Sinogram, A: Projector, start: ADMMState) -> Iterator[ADMMState]:
        """Yield the iterates from a state on, for ever."""
        return pnp_admm(sinogram, A, TotalVariation(self.strength / 1000 / self.beta), start, beta=self.beta)

    def __call__(self, sinogram: Sinogram, A: Projector, *, progress: Progress = unwatched) -> Reconstruction:
        """Reconstruct."""
        whole = beyond_image(beyond_fan(sinogram, A))
        sinogram, A = whole.sinogram, whole.A
        start = ADMMState.start(fbp(sinogram.line_integrals, A, kernel="soft"))
        states = until(self.states(sinogram, A, start), start, A, iterations=self.iterations, stop=self.stop)
        image, done = _image_of(progress(states, self.iterations), "last")
        return Reconstruction(whole.cut_out(image), self.settings, done, _stopped_by(self, done), whole.notes)


@dataclass(frozen=True)
class PlugAndPlay:
    """Plug-and-play ADMM, from `starting_state` on.

    With a trained network ADMM is damped and the image is the mean of its iterates, unless set otherwise.
    Networks are the proximal maps of no function: where the iterates should settle, they go on wandering and lose some
    of the finest detail, and their mean does less of both. Other denoisers have a limit, and the last iterate is
    nearest to it.

    Args:
        denoise: D, with its strength inside.
        beta: Penalty in mean diagonals of AᵀWA, > 0; `BETA` if neither this nor `sigma_v` is given.
        sigma_v: The penalty in HU, instead of `beta`: standard deviation that the denoised image is trusted to, > 0.
        damping: Fraction of u that each iteration drops, 0 to 1; the paper's ADMM has 0.
        iterations: Maximum number of iterations, at least 1.
        stop: Stopping rule that may end the iterations earlier.
        solver: Solver of the data step.
        inner_iterations: Minimum steps of an iterative solver in each iteration; its own default if None.
        result: The image that is returned: the "last" of the denoised iterates v, or the "mean" of them all.

    Raises:
        ValueError: If an option is out of range, or both penalties are given.

    References:
        The paper, Eqs. (4) to (6); He and Yuan, SIAM J. Numer. Anal. 50 (2012) 700, for the mean.
    """

    denoise: Denoise
    beta: float | None = None
    sigma_v: float | None = None
    damping: float | None = None
    iterations: int = ITERATIONS
    stop: RuleName = "relative"
    solver: SolverName = "fourier"
    inner_iterations: int | None = None
    result: ResultName | None = None

    def __post_init__(self) -> None:
        if self.beta is not None and self.sigma_v is not None:
            raise ValueError("beta and sigma_v are one penalty in two units; give one of them.")
        solver_by_name(self.solver, inner_iterations=self.inner_iterations)

    @property
    def settings(self) -> Mapping[str, Any]:
        """All that the image depends on besides the data, as plain values."""
        damping, result = self._suited()
        penalty = {"beta": BETA if self.beta is None else self.beta}
        return {
            "method": "pnp",
            **denoiser_settings(self.denoise),
            **(penalty if self.sigma_v is None else {"sigma_v_hu": self.sigma_v}),
            "damping": damping,
            "iterations": self.iterations,
            "stop": self.stop,
            "solver": self.solver,
            "inner_iterations": self.inner_iterations or (INNER_ITERATIONS if self.solver in ITERATIVE else None),
            "result": result,
        }

    def states(self, sinogram: Sinogram, A: Projector, start: ADMMState) -> Iterator[ADMMState]:
        """Yield the iterates from a state on, for ever."""
        beta, (damping, _) = self._beta(sinogram, A), self._suited()
        solver = solver_by_name(self.solver, inner_iterations=self.inner_iterations)
        return pnp_admm(sinogram, A, self.denoise, start, beta=beta, damping=damping, solver=solver)

    def __call__(self, sinogram: Sinogram, A: Projector, *, progress: Progress = unwatched) -> Reconstruction:
        """Reconstruct."""
        whole = beyond_image(beyond_fan(sinogram, A))
        sinogram, A = whole.sinogram, whole.A
        beta = self._beta(sinogram, A)
        start = starting_state(sinogram, A)
        states = until(self.states(sinogram, A, start), start, A, iterations=self.iterations, stop=self.stop)
        image, done = _image_of(progress(states, self.iterations), self._suited()[1])
        settings = {**self.settings, "beta": beta, "sigma_v_hu": sigma_v_from_beta(beta, sinogram, A)}
        return Reconstruction(whole.cut_out(image), settings, done, _stopped_by(self, done), whole.notes)

    def _suited(self) -> tuple[float, ResultName]:
        """Damping and result: what suits the denoiser, where not set."""
        learned = isinstance(self.denoise, LearnedDenoiser)
        damping = DAMPING if learned else 0.0
        return damping if self.damping is None else self.damping, self.result or ("mean" if learned else "last")

    def _beta(self, sinogram: Sinogram, A: Projector) -> float:
        if self.sigma_v is not None:
            return beta_from_sigma_v(self.sigma_v, sinogram, A)
        return BETA if self.beta is None else self.beta


METHODS: dict[str, type[FBP | TVPWLS | PlugAndPlay]] = {"fbp": FBP, "pnp": PlugAndPlay, "tv": TVPWLS}
"""The methods that `pnpct reconstruct` offers."""


def reconstruct(sinogram: Sinogram, A: Projector, denoise: Denoise, **options: Any) -> Image:
    """Reconstruct by plug-and-play ADMM.

    Args:
        sinogram: Line integrals and weights.
        A: The projector.
        denoise: Denoiser, with its strength inside.
        **options: As for `PlugAndPlay`.

    Returns:
        The image, relative to water.

    Raises:
        ValueError: If an option is out of range.
    """
    return PlugAndPlay(denoise, **options)(sinogram, A).image


def denoiser_settings(denoise: Denoise) -> dict[str, Any]:
    """Return what is known of a denoiser, as plain values: its name, and its fields or `settings` where it has them."""
    if isinstance(denoise, LearnedDenoiser):
        return denoise.settings
    known: Any = denoise
    fields = asdict(known) if is_dataclass(known) and not isinstance(known, type) else {}
    name = getattr(known, "__qualname__", type(known).__qualname__)
    return {"denoiser": name, **{f"denoiser_{field}": value for field, value in fields.items()}}


def _image_of(states: Iterable[ADMMState], result: ResultName) -> tuple[Image, int]:
    """The last of the denoised iterates or their mean, and how many there were."""
    image: Image | None = None
    done = 0
    for done, state in enumerate(states, start=1):
        image = state.v if image is None or result == "last" else torch.lerp(image, state.v, 1 / done)
    if image is None:
        raise ValueError("ADMM has no image without an iteration.")
    return image, done


def _stopped_by(method: TVPWLS | PlugAndPlay, done: int) -> str:
    return method.stop if done < method.iterations else "iterations"
