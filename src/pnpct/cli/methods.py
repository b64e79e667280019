"""The methods of `pnpct reconstruct`, each with the options that have an effect on it."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any

from pnpct.arrays import Image
from pnpct.cli.denoisers import TV_STRENGTH, checked_strength, choose_denoiser
from pnpct.cli.terminal import track, working
from pnpct.denoisers import DENOISERS
from pnpct.operators import Kernel, Projector
from pnpct.physics import Sinogram
from pnpct.reconstruction import (
    RESULTS,
    STOP_RULES,
    ADMMState,
    ResultName,
    RuleName,
    SolverName,
    beta_from_sigma_v,
    fbp,
    last_iterate,
    pnp_admm,
    sigma_v_from_beta,
    solver_by_name,
    starting_state,
    tv_pwls,
    until,
)
from pnpct.reconstruction.normal_equations import INNER_ITERATIONS
from pnpct.reconstruction.pnp_admm import BETA, DAMPING
from pnpct.reconstruction.reconstruct import ITERATIONS, Result
from pnpct.reconstruction.solvers import ITERATIVE

Reconstructed = tuple[Image, dict[str, Any]]
"""An image, and the settings that mattered for it."""

Method = Callable[[Sinogram, Projector], Reconstructed]


@dataclass(frozen=True)
class FilteredBackProjection:
    """Filtered back-projection; the kernels go from sharp to smooth."""

    kernel: Kernel = "hann"

    def __call__(self, sinogram: Sinogram, projector: Projector) -> Reconstructed:
        """Return the image."""
        with working("Filtered back-projection"):
            return fbp(sinogram.line_integrals, projector, kernel=self.kernel), asdict(self)


@dataclass(frozen=True)
class PlugAndPlay:
    """Plug-and-play ADMM from `starting_state` on; `strength` is as `choose_denoiser` takes it."""

    denoiser: str = "tv"
    strength: float | None = None
    beta: float | None = None
    sigma_v: float | None = None
    damping: float | None = None
    iterations: int = ITERATIONS
    solver: SolverName = "fourier"
    inner_iterations: int | None = None
    bfloat16: bool = False
    stop: RuleName = "relative"
    result: ResultName | None = None

    def __call__(self, sinogram: Sinogram, projector: Projector) -> Reconstructed:
        """Return the image.

        Unless it is said, ADMM is damped around a network and the image the mean of its iterates; around others the
        iterates have a limit, and it is the last of them.
        """
        if self.beta is not None and self.sigma_v is not None:
            raise ValueError("--beta and --sigma-v say one thing in two units; give one of them.")
        device = sinogram.line_integrals.device
        denoise, of_denoiser = choose_denoiser(self.denoiser, self.strength, device=device, bfloat16=self.bfloat16)
        solver = solver_by_name(self.solver, inner_iterations=self.inner_iterations)
        beta = BETA if self.beta is None else self.beta
        beta = beta if self.sigma_v is None else beta_from_sigma_v(self.sigma_v, sinogram, projector)
        with working("Filtered back-projection"):
            start = starting_state(sinogram, projector)
        learnt = self.denoiser not in DENOISERS
        damping = (DAMPING if learnt else 0.0) if self.damping is None else self.damping
        states = pnp_admm(sinogram, projector, denoise, start, beta=beta, damping=damping, solver=solver)
        result = self.result or ("mean" if learnt else "last")
        image, how_far = _iterated(states, start, self.iterations, self.stop, RESULTS[result])
        settings = {**asdict(self), **how_far, **of_denoiser, "beta": beta, "damping": damping, "result": result}
        del settings["sigma_v"]
        settings["sigma_v_hu"] = sigma_v_from_beta(beta, sinogram, projector)
        if self.inner_iterations is None and self.solver in ITERATIVE:
            settings["inner_iterations"] = INNER_ITERATIONS
        return image, settings


@dataclass(frozen=True)
class TotalVariationLeastSquares:
    """Penalised weighted least squares with total variation, by ADMM from a smooth FBP image on."""

    strength: float = TV_STRENGTH
    beta: float = BETA
    iterations: int = ITERATIONS
    stop: RuleName = "relative"

    def __call__(self, sinogram: Sinogram, projector: Projector) -> Reconstructed:
        """Return the image."""
        with working("Filtered back-projection"):
            start = ADMMState.start(fbp(sinogram.line_integrals, projector, kernel="soft"))
        states = tv_pwls(sinogram, projector, start, strength=checked_strength(self.strength) / 1000, beta=self.beta)
        image, how_far = _iterated(states, start, self.iterations, self.stop, last_iterate)
        return image, {**asdict(self), **how_far}


METHODS: dict[str, type[FilteredBackProjection | PlugAndPlay | TotalVariationLeastSquares]] = {
    "fbp": FilteredBackProjection,
    "pnp": PlugAndPlay,
    "tv": TotalVariationLeastSquares,
}


def make_method(name: str, options: Mapping[str, Any]) -> Method:
    """Return a method with its options.

    Args:
        name: One of `METHODS`.
        options: The options that were given.

    Raises:
        ValueError: If an option has no effect on this method.
    """
    check_effect(options, name, METHODS)
    return METHODS[name](**options)


def check_effect(options: Iterable[str], name: str, methods: Mapping[str, type[Any]]) -> None:
    """Check that the options which were given are those of a method.

    Args:
        options: Names of the options.
        name: Of the method.
        methods: Dataclasses, whose fields are their options.

    Raises:
        ValueError: If an option has no effect on this method.
    """
    known = {each: {field.name for field in fields(method)} for each, method in methods.items()}
    for option in options:
        if option not in known[name]:
            others = " or ".join(other for other in methods if option in known[other])
            spelled = option.replace("_", "-")
            raise ValueError(f"--{spelled} has no effect on --method {name}, but on {others}; leave out one of them.")


def _iterated(
    states: Iterator[ADMMState], start: ADMMState, iterations: int, stop: RuleName, result: Result
) -> Reconstructed:
    """Iterate with a bar on the terminal; return the image, and how far it went and why no further."""
    done = 0

    def counted() -> Iterator[ADMMState]:
        nonlocal done
        stopped = until(states, start, iterations=iterations, stop=STOP_RULES[stop])
        for state in track(stopped, total=iterations, of="ADMM"):
            done += 1
            yield state

    image = result(counted())
    return image, {"iterations_done": done, "stopped_by": stop if done < iterations else "iterations"}
