"""From noisy images to the weights of a denoiser."""

from pnpct.training.losses import (
    Form,
    LossTerm,
    contrast_loss,
    mean_squared_error,
    ssim_loss,
    stage_one_loss,
    stage_two_loss,
    texture_loss,
)

__all__ = [
    "Form",
    "LossTerm",
    "contrast_loss",
    "mean_squared_error",
    "ssim_loss",
    "stage_one_loss",
    "stage_two_loss",
    "texture_loss",
]
