"""The options of `pnpct reconstruct` that choose and tune the method."""

from dataclasses import dataclass, fields
from typing import Annotated, Any, Literal

from pnpct.cli.denoisers import CHOICES, DEFAULT_STRENGTHS, TV_STRENGTH
from pnpct.cli.methods import FilteredBackProjection, Method, PlugAndPlay, make_method
from pnpct.cli.parsing import option
from pnpct.operators import Kernel
from pnpct.reconstruction import ResultName, RuleName, SolverName
from pnpct.reconstruction.normal_equations import INNER_ITERATIONS
from pnpct.reconstruction.pnp_admm import BETA, DAMPING


@dataclass(frozen=True, kw_only=True)
class MethodOptions:
    """The method and its options, None where they were not given: only then they may have no effect.

    Args:
        method: fbp is filtered back-projection, pnp plug-and-play ADMM, tv weighted least squares with total variation.
        kernel: Filter of fbp, from sharp to smooth.
        denoiser: Denoiser of pnp: a classical one, or the file of a trained network.
        strength: How much pnp and tv smooth; in HU times pixels for tv, HU of noise for nonlocal-means and
            networks that are told it, times that other networks are applied, pixels for gaussian. It was chosen
            for a body at a low dose.
        beta: Penalty of pnp and tv, relative to the mean diagonal of the normal equations.
        sigma_v: The penalty of pnp in other words, instead of beta: how well the denoised image is known, HU.
        damping: Share of the dual variable that pnp forgets in each iteration; the paper's ADMM has 0.
        iterations: Most iterations of pnp and tv.
        solver: Solver of the data step of pnp.
        inner_iterations: Least steps of the solver in each iteration of pnp; it takes more while its residual is large.
        bfloat16: Let a network compute with fewer digits, about twice as quick on hardware made for it.
        stop: Rule that ends pnp and tv before: relative at convergence, where x and v agree, as they do not around
            the networks that come with the package; paper after a few iterations.
        result: What the image of pnp is, the last of the denoised iterates or the mean of them all.
    """

    method: Literal["fbp", "pnp", "tv"] = "pnp"
    kernel: Annotated[Kernel | None, option(default=FilteredBackProjection.kernel)] = None
    denoiser: Annotated[str | None, option(default=PlugAndPlay.denoiser, metavar=CHOICES)] = None
    strength: Annotated[float | None, option(default=f"{DEFAULT_STRENGTHS}; {TV_STRENGTH:g} for the method tv")] = None
    beta: Annotated[float | None, option(default=BETA)] = None
    sigma_v: float | None = None
    damping: Annotated[float | None, option(default=f"{DAMPING} around networks, else 0")] = None
    iterations: Annotated[int | None, option(default=PlugAndPlay.iterations)] = None
    solver: Annotated[SolverName | None, option(default=PlugAndPlay.solver)] = None
    inner_iterations: Annotated[int | None, option(default=INNER_ITERATIONS)] = None
    bfloat16: bool = False
    stop: Annotated[RuleName | None, option(default=PlugAndPlay.stop)] = None
    result: Annotated[ResultName | None, option(default="mean around networks, else last")] = None

    def chosen_method(self) -> Method:
        """Return the method with the options that were given.

        Raises:
            ValueError: If one of them has no effect on it.
        """
        values: dict[str, Any] = {field.name: getattr(self, field.name) for field in fields(MethodOptions)}
        del values["method"]
        given = {name: value for name, value in values.items() if value is not None and value is not False}
        return make_method(self.method, given)
