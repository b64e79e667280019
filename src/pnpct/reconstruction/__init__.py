"""From a sinogram to an image: the methods, plug-and-play ADMM and its solvers, filtered back-projection."""

from pnpct.reconstruction.fbp import fbp
from pnpct.reconstruction.methods import (
    FBP,
    METHODS,
    TVPWLS,
    DenoisedFBP,
    Method,
    PlugAndPlay,
    Progress,
    Reconstruction,
    denoiser_settings,
    reconstruct,
)
from pnpct.reconstruction.normal_equations import mean_diagonal
from pnpct.reconstruction.pnp_admm import ADMMState, pnp_admm
from pnpct.reconstruction.solvers import SolverName, solver_by_name
from pnpct.reconstruction.starting import starting_state
from pnpct.reconstruction.stopping import STOP_RULES, RuleName, change, paper_rule, relative_rule, until

__all__ = [
    "FBP",
    "METHODS",
    "STOP_RULES",
    "TVPWLS",
    "ADMMState",
    "DenoisedFBP",
    "Method",
    "PlugAndPlay",
    "Progress",
    "Reconstruction",
    "RuleName",
    "SolverName",
    "change",
    "denoiser_settings",
    "fbp",
    "mean_diagonal",
    "paper_rule",
    "pnp_admm",
    "reconstruct",
    "relative_rule",
    "solver_by_name",
    "starting_state",
    "until",
]
