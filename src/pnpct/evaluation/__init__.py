"""What an image is worth: distances from a reference, texture, noise, sharpness, and how well lesions are found.

Leading dimensions of an image are realisations or objects that have nothing to do with each other; measures of a single
image average over them, and `repeats` or `pairs` in a shape says where they are compared.
"""

from pnpct.evaluation.data.consistency import Consistency, Verdict, consistency
from pnpct.evaluation.data.prior_sweep import PriorDriven, prior_sweep
from pnpct.evaluation.data.realisations import (
    HalfScan,
    Realisation,
    Reconstruct,
    parametric_bootstrap,
    redraw,
    split_views,
)
from pnpct.evaluation.data.score_test import Finding, ScoreTest, score_test, score_threshold
from pnpct.evaluation.image.errors import METRICS, WINDOWS, Metric, bias_hu, evaluate, psnr, rmse_hu, ssim
from pnpct.evaluation.image.one_grid import on_one_grid
from pnpct.evaluation.image.patches import Patch, patches_in_square, tile_patches
from pnpct.evaluation.image.published_scores import (
    psnr_ldctbench,
    psnr_lodopab,
    psnr_lodopab_fr,
    ssim_ldctbench,
    ssim_lodopab,
    ssim_lodopab_fr,
)
from pnpct.evaluation.image.regions import Mask, body_mask, soft_tissue_mask
from pnpct.evaluation.image.tissue_errors import TISSUES, TissueError, errors_by_tissue
from pnpct.evaluation.intervals import Interval, bootstrap
from pnpct.evaluation.observers.detectability_by_dose import (
    InsertDetectability,
    InsertScans,
    detectability_by_dose,
    dose_curves,
)
from pnpct.evaluation.observers.dose import (
    DoseCurve,
    DoseReduction,
    EqualDose,
    PowerLaw,
    best_references,
    dose_reduction,
)
from pnpct.evaluation.observers.eye_filter import EyeFilter, Spectrum
from pnpct.evaluation.observers.lesion_recovery import LesionRecovery, insert_lesion, lesion_recovery
from pnpct.evaluation.observers.matched_filter import matched_filter_d_prime
from pnpct.evaluation.observers.model_observers import (
    Detectability,
    channelised_hotelling,
    laguerre_gauss_channels,
    matched_filter,
)
from pnpct.evaluation.observers.noise_power import NoisePower, RadialPower, noise_power_of_one, noise_power_of_repeats
from pnpct.evaluation.observers.phantom_figures import PhantomFigures, measure_phantom
from pnpct.evaluation.observers.task_transfer import TaskTransfer, task_transfer
from pnpct.evaluation.texture.change import FeatureChange, TextureChange, texture_change
from pnpct.evaluation.texture.glcm import FEATURES, GLCMSpec, Texture, texture_features, texture_patches
from pnpct.evaluation.texture.histogram import (
    earth_movers_distance,
    gray_histogram,
    repeat_scan_floor,
)
from pnpct.evaluation.texture.oversmoothing import oversmoothing_warnings, rank_by_closeness

__all__ = [
    "FEATURES",
    "METRICS",
    "TISSUES",
    "WINDOWS",
    "Consistency",
    "Detectability",
    "DoseCurve",
    "DoseReduction",
    "EqualDose",
    "EyeFilter",
    "FeatureChange",
    "Finding",
    "GLCMSpec",
    "HalfScan",
    "InsertDetectability",
    "InsertScans",
    "Interval",
    "LesionRecovery",
    "Mask",
    "Metric",
    "NoisePower",
    "Patch",
    "PhantomFigures",
    "PowerLaw",
    "PriorDriven",
    "RadialPower",
    "Realisation",
    "Reconstruct",
    "ScoreTest",
    "Spectrum",
    "TaskTransfer",
    "Texture",
    "TextureChange",
    "TissueError",
    "Verdict",
    "best_references",
    "bias_hu",
    "body_mask",
    "bootstrap",
    "channelised_hotelling",
    "consistency",
    "detectability_by_dose",
    "dose_curves",
    "dose_reduction",
    "earth_movers_distance",
    "errors_by_tissue",
    "evaluate",
    "gray_histogram",
    "insert_lesion",
    "laguerre_gauss_channels",
    "lesion_recovery",
    "matched_filter",
    "matched_filter_d_prime",
    "measure_phantom",
    "noise_power_of_one",
    "noise_power_of_repeats",
    "on_one_grid",
    "oversmoothing_warnings",
    "parametric_bootstrap",
    "patches_in_square",
    "prior_sweep",
    "psnr",
    "psnr_ldctbench",
    "psnr_lodopab",
    "psnr_lodopab_fr",
    "rank_by_closeness",
    "redraw",
    "repeat_scan_floor",
    "rmse_hu",
    "score_test",
    "score_threshold",
    "soft_tissue_mask",
    "split_views",
    "ssim",
    "ssim_ldctbench",
    "ssim_lodopab",
    "ssim_lodopab_fr",
    "task_transfer",
    "texture_change",
    "texture_features",
    "texture_patches",
    "tile_patches",
]
