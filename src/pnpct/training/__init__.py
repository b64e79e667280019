"""From noisy images to the weights of a denoiser."""

from pnpct.training.examples import Example, Examples, MakeImages, Reference
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
from pnpct.training.pairs import Pair, Pairs
from pnpct.training.single_scan import SplitViewPairs
from pnpct.training.two_stage import Epoch, Stage, train, two_stage

__all__ = [
    "CONTRAST_WEIGHT",
    "TEXTURE_WEIGHT",
    "Epoch",
    "Example",
    "Examples",
    "Form",
    "LossTerm",
    "MakeImages",
    "Pair",
    "Pairs",
    "Reference",
    "SplitViewPairs",
    "Stage",
    "contrast_loss",
    "mean_squared_error",
    "ssim_loss",
    "stage_one_loss",
    "stage_two_loss",
    "texture_loss",
    "train",
    "two_stage",
]
