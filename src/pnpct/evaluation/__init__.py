"""What an image is worth: distances from a reference, as plain functions of the two."""

from pnpct.evaluation.fidelity import METRICS, WINDOWS, Metric, bias_hu, evaluate, psnr, rmse_hu, ssim
from pnpct.evaluation.regions import Mask, body_mask, soft_tissue_mask

__all__ = [
    "METRICS",
    "WINDOWS",
    "Mask",
    "Metric",
    "bias_hu",
    "body_mask",
    "evaluate",
    "psnr",
    "rmse_hu",
    "soft_tissue_mask",
    "ssim",
]
