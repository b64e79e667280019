"""From a sinogram to an image: filtered back-projection, plug-and-play ADMM and its solvers, and baselines."""

from pnpct.reconstruction.fbp import fbp
from pnpct.reconstruction.normal_equations import beta_from_sigma_v, mean_diagonal, sigma_v_from_beta
from pnpct.reconstruction.pnp_admm import DAMPING, ADMMState, pnp_admm
from pnpct.reconstruction.reconstruct import RESULTS, Result, ResultName, last_iterate, mean_iterate, reconstruct
from pnpct.reconstruction.solvers import SolverName, solver_by_name
from pnpct.reconstruction.starting import starting_state
from pnpct.reconstruction.stopping import STOP_RULES, RuleName, change, paper_rule, relative_rule, until
from pnpct.reconstruction.tv_pwls import tv_pwls

__all__ = [
    "DAMPING",
    "RESULTS",
    "STOP_RULES",
    "ADMMState",
    "Result",
    "ResultName",
    "RuleName",
    "SolverName",
    "beta_from_sigma_v",
    "change",
    "fbp",
    "last_iterate",
    "mean_diagonal",
    "mean_iterate",
    "paper_rule",
    "pnp_admm",
    "reconstruct",
    "relative_rule",
    "sigma_v_from_beta",
    "solver_by_name",
    "starting_state",
    "tv_pwls",
    "until",
]
