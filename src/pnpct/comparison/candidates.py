"""The methods that are compared: those of the paper, and what they must be better than."""

from dataclasses import dataclass
from typing import Literal

from pnpct.arrays import Image
from pnpct.comparison.results import Method as Described
from pnpct.denoisers import Denoise, Gaussian
from pnpct.operators import Projector
from pnpct.physics import Sinogram
from pnpct.reconstruction import FBP, TVPWLS, DenoisedFBP, Method, PlugAndPlay


@dataclass(frozen=True)
class Candidate:
    """A method under a name.

    Args:
        name: What it is called in all tables.
        label: What readers see.
        kind: What it is for.
        made_by: The method.
    """

    name: str
    label: str
    kind: Literal["fbp", "control", "denoiser", "iterative", "plug-and-play"]
    made_by: Method

    @property
    def method(self) -> Described:
        """What it is, as plain values."""
        return Described(self.name, self.label, self.kind, self.made_by.settings)

    def make(self, sinogram: Sinogram, A: Projector) -> Image:
        """Return its image; any batch of sinograms gives a batch of images."""
        return self.made_by(sinogram, A).image


def filtered(method: FBP) -> Candidate:
    """Return filtered back-projection."""
    return Candidate("fbp", f"FBP, {method.kernel}", "fbp", method)


def blurred(pixels: float) -> Candidate:
    """Return the control: sharp FBP, blurred by a Gaussian of this standard deviation. It must never win."""
    return Candidate("blurred-fbp", f"FBP, blurred by {pixels:g} pixels", "control", DenoisedFBP(Gaussian(pixels)))


def total_variation(method: TVPWLS) -> Candidate:
    """Return weighted least squares with total variation."""
    return Candidate("tv-pwls", "TV-PWLS", "iterative", method)


def denoised(name: str, label: str, denoise: Denoise) -> Candidate:
    """Return a denoiser alone, on sharp FBP, which is what it was trained on."""
    return Candidate(name, label, "denoiser", DenoisedFBP(denoise))


def plug_and_play(name: str, label: str, method: PlugAndPlay) -> Candidate:
    """Return plug-and-play ADMM around a trained denoiser."""
    return Candidate(name, label, "plug-and-play", method)
