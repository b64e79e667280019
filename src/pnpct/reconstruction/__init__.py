"""From a sinogram to an image: the methods, plug-and-play ADMM and its solvers, filtered back-projection."""

from pnpct.reconstruction.fbp import fbp
from pnpct.reconstruction.methods import (
    DAMPING,
    FBP,
    METHODS,
    TVPWLS,
    DenoisedFBP,
    Method,
    PlugAndPlay,
    Progress,
    ResultName,
    denoiser_settings,
    reconstruct,
)
from pnpct.reconstruction.normal_equations import beta_from_sigma_v, mean_diagonal, sigma_v_from_beta
from pnpct.reconstruction.pnp_admm import ADMMState, pnp_admm
from pnpct.reconstruction.reconstructed import Reconstruction
from pnpct.reconstruction.solvers import SolverName, solver_by_name
from pnpct.reconstruction.starting import starting_state
from pnpct.reconstruction.stopping import STOP_RULES, RuleName, change, paper_rule, relative_rule, until

__all__ = [
    "DAMPING",
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
    "ResultName",
    "RuleName",
    "SolverName",
    "beta_from_sigma_v",
    "change",
    "denoiser_settings",
    "fbp",
    "mean_diagonal",
    "paper_rule",
    "pnp_admm",
    "reconstruct",
    "relative_rule",
    "sigma_v_from_beta",
    "solver_by_name",
    "starting_state",
    "until",
]
