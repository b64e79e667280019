"""From scans to the weights of a denoiser: what it learns from, the losses, and the methods."""

from pnpct.training.cached_examples import CachedExamples
from pnpct.training.closed_loop import ClosedLoop
from pnpct.training.curves import training_curves
from pnpct.training.examples import Example, Examples, Reference
from pnpct.training.images import FBPImages, LoopImages, MakeImages, view_subset_images
from pnpct.training.losses import (
    CONTRAST_WEIGHT,
    TEXTURE_WEIGHT,
    Form,
    LossTerm,
    contrast_loss,
    mean_squared_error,
    ssim_loss,
    stage_one_loss,
    stage_two_loss,
    texture_loss,
)
from pnpct.training.methods import METHODS, SingleScan, Supervised, TwoStage
from pnpct.training.own_images import ImagePairs, NeighbouringSlices, SlicePairs
from pnpct.training.pairs import Pair, Pairs
from pnpct.training.pairwise import on_pairs
from pnpct.training.plan import Schedule, TrainingPlan
from pnpct.training.processes import from_first, joined_processes
from pnpct.training.single_scan import SplitViewPairs
from pnpct.training.through_loop import ThroughLoop
from pnpct.training.two_stage import Epoch, Stage, train, two_stage
from pnpct.training.validation import validate

__all__ = [
    "CONTRAST_WEIGHT",
    "METHODS",
    "TEXTURE_WEIGHT",
    "CachedExamples",
    "ClosedLoop",
    "Epoch",
    "Example",
    "Examples",
    "FBPImages",
    "Form",
    "ImagePairs",
    "LoopImages",
    "LossTerm",
    "MakeImages",
    "NeighbouringSlices",
    "Pair",
    "Pairs",
    "Reference",
    "Schedule",
    "SingleScan",
    "SlicePairs",
    "SplitViewPairs",
    "Stage",
    "Supervised",
    "ThroughLoop",
    "TrainingPlan",
    "TwoStage",
    "contrast_loss",
    "from_first",
    "joined_processes",
    "mean_squared_error",
    "on_pairs",
    "ssim_loss",
    "stage_one_loss",
    "stage_two_loss",
    "texture_loss",
    "train",
    "training_curves",
    "two_stage",
    "validate",
    "view_subset_images",
]
