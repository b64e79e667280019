"""What an image is worth: distances from a reference, texture, noise, sharpness, and how well lesions are found."""

from pnpct.evaluation.detectability import (
    Detectability,
    channelised_hotelling,
    laguerre_gauss_channels,
    matched_filter,
)
from pnpct.evaluation.fidelity import METRICS, WINDOWS, Metric, bias_hu, evaluate, psnr, rmse_hu, ssim
from pnpct.evaluation.histogram import earth_movers_distance, gray_histogram, histogram_entropy, repeat_scan_floor
from pnpct.evaluation.intervals import Interval, bootstrap
from pnpct.evaluation.noise_power import NoisePower, RadialPower, noise_power_of_one, noise_power_of_repeats
from pnpct.evaluation.patches import Patch, tile_patches
from pnpct.evaluation.regions import Mask, body_mask, soft_tissue_mask
from pnpct.evaluation.resolution import TaskTransfer, task_transfer
from pnpct.evaluation.texture import FEATURES, GLCMSpec, Texture, texture_features, texture_patches
from pnpct.evaluation.texture_change import FeatureChange, TextureChange, texture_change
from pnpct.evaluation.visual_task import DiscTask, EyeFilter, Spectrum, spectral_detectability

__all__ = [
    "FEATURES",
    "METRICS",
    "WINDOWS",
    "Detectability",
    "DiscTask",
    "EyeFilter",
    "FeatureChange",
    "GLCMSpec",
    "Interval",
    "Mask",
    "Metric",
    "NoisePower",
    "Patch",
    "RadialPower",
    "Spectrum",
    "TaskTransfer",
    "Texture",
    "TextureChange",
    "bias_hu",
    "body_mask",
    "bootstrap",
    "channelised_hotelling",
    "earth_movers_distance",
    "evaluate",
    "gray_histogram",
    "histogram_entropy",
    "laguerre_gauss_channels",
    "matched_filter",
    "noise_power_of_one",
    "noise_power_of_repeats",
    "psnr",
    "repeat_scan_floor",
    "rmse_hu",
    "soft_tissue_mask",
    "spectral_detectability",
    "ssim",
    "task_transfer",
    "texture_change",
    "texture_features",
    "texture_patches",
    "tile_patches",
]
