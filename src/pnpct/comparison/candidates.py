"""The methods that are compared: those of the paper, and what they must be better than."""

from collections.abc import Callable
from dataclasses import dataclass

from pnpct.arrays import Image
from pnpct.comparison.results import Method
from pnpct.denoisers import Denoise, Gaussian
from pnpct.operators import Kernel, Projector
from pnpct.physics import Sinogram
from pnpct.reconstruction import (
    DAMPING,
    STOP_RULES,
    ADMMState,
    fbp,
    last_iterate,
    mean_iterate,
    reconstruct,
    tv_pwls,
    until,
)
from pnpct.reconstruction.pnp_admm import BETA
from pnpct.reconstruction.reconstruct import ITERATIONS
from pnpct.reconstruction.tv_pwls import STRENGTH


@dataclass(frozen=True)
class Candidate:
    """A method, and how it makes an image.

    Args:
        method: What it is.
        make: From a sinogram and a projector to an image; any batch of sinograms gives a batch of images.
    """

    method: Method
    make: Callable[[Sinogram, Projector], Image]


def filtered(kernel: Kernel = "hann") -> Candidate:
    """Return filtered back-projection."""
    method = Method("fbp", f"FBP, {kernel}", "fbp", {"kernel": kernel})
    return Candidate(method, lambda sinogram, A: fbp(sinogram.line_integrals, A, kernel=kernel))


def blurred(pixels: float = 1.5) -> Candidate:
    """Return the control: sharp FBP, blurred by a Gaussian of this standard deviation. It must never win."""
    blur = Gaussian(pixels)
    method = Method("blurred-fbp", f"FBP, blurred by {pixels:g} pixels", "control", {"blur_pixels": pixels})
    return Candidate(method, lambda sinogram, A: blur(_sharp(sinogram, A)))


def total_variation(strength_hu: float = 1000 * STRENGTH) -> Candidate:
    """Return weighted least squares with total variation."""
    method = Method("tv-pwls", "TV-PWLS", "iterative", {"strength_hu_pixel": strength_hu, "iterations": ITERATIONS})

    def make(sinogram: Sinogram, A: Projector) -> Image:
        start = ADMMState.start(fbp(sinogram.line_integrals, A, kernel="soft"))
        states = tv_pwls(sinogram, A, start, strength=strength_hu / 1000)
        return last_iterate(until(states, start, iterations=ITERATIONS, stop=STOP_RULES["relative"]))

    return Candidate(method, make)


def denoised(name: str, label: str, denoise: Denoise, settings: dict[str, str]) -> Candidate:
    """Return a denoiser alone, on sharp FBP, which is what it was trained on."""
    method = Method(name, label, "denoiser", settings)
    return Candidate(method, lambda sinogram, A: denoise(_sharp(sinogram, A)))


def plug_and_play(
    name: str,
    label: str,
    denoise: Denoise,
    settings: dict[str, str],
    *,
    beta: float = BETA,
    iterations: int = ITERATIONS,
) -> Candidate:
    """Return plug-and-play ADMM around a trained denoiser."""
    loop = {"beta": beta, "damping": DAMPING, "iterations": iterations, "result": "mean"}
    method = Method(name, label, "plug-and-play", {**settings, **loop})

    def make(sinogram: Sinogram, A: Projector) -> Image:
        return reconstruct(sinogram, A, denoise, beta=beta, damping=DAMPING, iterations=iterations, result=mean_iterate)

    return Candidate(method, make)


def _sharp(sinogram: Sinogram, A: Projector) -> Image:
    return fbp(sinogram.line_integrals, A, kernel="ram-lak")
