"""The solvers of the data step, by name."""

from collections.abc import Callable
from functools import partial
from typing import Literal

from pnpct.reconstruction.fourier import fourier
from pnpct.reconstruction.normal_equations import MakeSolver, Solve, plain
from pnpct.reconstruction.one_step import dense_cholesky, fbp_blend
from pnpct.reconstruction.sparse_cholesky import cholesky

SolverName = Literal["fourier", "cholesky", "cg", "dense-cholesky", "fbp-blend"]
"""Solvers of the data step: three iterative ones, an exact one for small images, and the one step of the paper."""

ITERATIVE: dict[str, Callable[..., Solve]] = {"fourier": fourier, "cholesky": cholesky, "cg": plain}
"""Solvers that take a few steps from the last x; they have `inner_iterations`."""

DIRECT: dict[str, Callable[..., Solve]] = {"dense-cholesky": dense_cholesky, "fbp-blend": fbp_blend}
"""Solvers without iterations."""


IN_SPACE: tuple[SolverName, ...] = ("fourier", "cg")
"""Those that solve for volumes too."""


def check_in_space(name: SolverName) -> None:
    """Check that a solver is one for volumes.

    Raises:
        ValueError: If it is not.
    """
    if name not in IN_SPACE:
        raise ValueError(f"The solver {name} is for images of a fan beam; in a cone beam take {' or '.join(IN_SPACE)}.")


def solver_by_name(name: str, *, inner_iterations: int | None = None) -> MakeSolver:
    """Return the solver of that name.

    Args:
        name: "fourier", "cholesky", "cg", "dense-cholesky" or "fbp-blend".
        inner_iterations: Minimum steps of an iterative solver in each data step; its own default if None.

    Raises:
        ValueError: If there is no such solver, or it takes no inner iterations.
    """
    if name in DIRECT:
        if inner_iterations is not None:
            raise ValueError(f"The solver {name} is direct and takes no inner iterations.")
        return DIRECT[name]
    if name not in ITERATIVE:
        known = ", ".join([*ITERATIVE, *DIRECT])
        raise ValueError(f'There is no solver "{name}"; the solvers are {known}.')
    if inner_iterations is None:
        return ITERATIVE[name]
    if inner_iterations < 1:
        raise ValueError(f"A solver needs at least one inner iteration, got {inner_iterations}.")
    return partial(ITERATIVE[name], inner_iterations=inner_iterations)
