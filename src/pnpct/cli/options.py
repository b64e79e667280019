"""The options of `pnpct reconstruct` that choose and tune the method."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, fields
from typing import Annotated, Literal

import torch

from pnpct.cli.denoiser_options import DENOISER_OPTIONS, DenoiserOptions, denoiser_with
from pnpct.cli.parsing import given_options, option
from pnpct.operators import Kernel
from pnpct.reconstruction import (
    FBP,
    METHODS,
    TVPWLS,
    Method,
    PlugAndPlay,
    RuleName,
    SolverName,
)
from pnpct.reconstruction.iteration_schedule import FEWEST, MOST
from pnpct.reconstruction.normal_equations import INNER_ITERATIONS


@dataclass(frozen=True, kw_only=True)
class MethodOptions(DenoiserOptions):
    """The method and its options; None where not given, since an option that is given must have an effect.

    Args:
        method: fbp is filtered back-projection, pnp is plug-and-play ADMM, tv is weighted least squares with total
            variation; the --strength of tv is in pixels, relative to the noise.
        kernel: Reconstruction kernel of fbp, from sharp to smooth.
        sigma_v: How closely pnp follows the denoised image, as a standard deviation in HU: smaller is smoother.
        damping: Fraction of the dual variable that pnp drops in each iteration; 0 is the paper's ADMM.
        iterations: Maximum number of iterations of pnp and tv; for pnp that depends on the noise of each slice if it is
            not given.
        solver: Solver of the data step of pnp.
        inner_iterations: Minimum number of solver steps per iteration of pnp; more are taken while the residual is
            large.
        stop: Stopping rule of pnp and tv. relative stops once x and v agree; with networks they never quite do, and all
            iterations are run. paper stops after a few iterations.
    """

    method: Literal["fbp", "pnp", "tv"] = "pnp"
    kernel: Annotated[Kernel | None, option(default=FBP.kernel)] = None
    sigma_v: Annotated[float | None, option(default=PlugAndPlay.sigma_v)] = None
    damping: Annotated[float | None, option(default=PlugAndPlay.damping)] = None
    iterations: Annotated[int | None, option(default=f"{FEWEST} to {MOST}, {TVPWLS.iterations} with tv")] = None
    solver: Annotated[SolverName | None, option(default=PlugAndPlay.solver)] = None
    inner_iterations: Annotated[int | None, option(default=INNER_ITERATIONS)] = None
    stop: Annotated[RuleName | None, option(default=TVPWLS.stop)] = None

    def chosen_method(self, device: torch.device) -> Method:
        """Return the method with the options that were given.

        Args:
            device: Where a network computes.

        Raises:
            OSError: If a network cannot be read.
            ValueError: If an option has no effect on the method, or is out of range.
        """
        known = {name: {field.name for field in fields(method)} for name, method in METHODS.items()}
        known["pnp"] |= {*DENOISER_OPTIONS}
        given = given_options(self, [field.name for field in fields(MethodOptions) if field.name != "method"])
        check_effect(given, self.method, known)
        if self.method != "pnp":
            return METHODS[self.method](**given)
        of_denoiser = {name: given.pop(name) for name in DENOISER_OPTIONS if name in given}
        return PlugAndPlay(denoiser_with(of_denoiser, device), **given)


def check_effect(options: Iterable[str], name: str, known: Mapping[str, Collection[str]]) -> None:
    """Check that the given options are those of a method.

    Args:
        options: Names of the options.
        name: Of the method.
        known: The options of each method.

    Raises:
        ValueError: If an option has no effect on this method.
    """
    for each in options:
        if each not in known[name]:
            others = " or ".join(other for other in known if each in known[other])
            spelled = each.replace("_", "-")
            raise ValueError(f"--{spelled} has no effect on --method {name}, but on {others}; leave out one of them.")
