"""From a sinogram to an image: the methods, plug-and-play ADMM and its solvers, filtered back-projection."""

from pnpct.reconstruction.bone import corrected_for_bone
from pnpct.reconstruction.cone_volume import reconstruct_cone_volume, slice_distance, slices_together
from pnpct.reconstruction.covered import check_covered, covered_grid, covered_slices, plane_distance, planes_of_a_row
from pnpct.reconstruction.fbp import fbp
from pnpct.reconstruction.fdk import about_filtered_cone, fdk
from pnpct.reconstruction.methods import (
    FBP,
    METHODS,
    TVPWLS,
    DenoisedFBP,
    PlugAndPlay,
    reconstruct,
)
from pnpct.reconstruction.normal_equations import mean_diagonal
from pnpct.reconstruction.plane_images import RaysOfViews
from pnpct.reconstruction.pnp_admm import ADMMState, pnp_admm
from pnpct.reconstruction.reconstructed import Method, Progress, Reconstruction
from pnpct.reconstruction.solvers import SolverName, solver_by_name
from pnpct.reconstruction.starting import starting_state
from pnpct.reconstruction.stopping import STOP_RULES, RuleName, change, paper_rule, relative_rule, until
from pnpct.reconstruction.tilted_slices import rebin
from pnpct.reconstruction.volume import SLAB, Slab, reconstruct_volume

__all__ = [
    "FBP",
    "METHODS",
    "SLAB",
    "STOP_RULES",
    "TVPWLS",
    "ADMMState",
    "DenoisedFBP",
    "Method",
    "PlugAndPlay",
    "Progress",
    "RaysOfViews",
    "Reconstruction",
    "RuleName",
    "Slab",
    "SolverName",
    "about_filtered_cone",
    "change",
    "check_covered",
    "corrected_for_bone",
    "covered_grid",
    "covered_slices",
    "fbp",
    "fdk",
    "mean_diagonal",
    "paper_rule",
    "plane_distance",
    "planes_of_a_row",
    "pnp_admm",
    "rebin",
    "reconstruct",
    "reconstruct_cone_volume",
    "reconstruct_volume",
    "relative_rule",
    "slice_distance",
    "slices_together",
    "solver_by_name",
    "starting_state",
    "until",
]
