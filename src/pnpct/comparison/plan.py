"""What is compared, under which settings; plain values that travel between processes."""

from dataclasses import dataclass

from pnpct.comparison.candidates import (
    Candidate,
    blurred,
    denoised,
    filtered,
    plug_and_play,
    total_variation,
)
from pnpct.files import load_denoiser
from pnpct.operators import Kernel
from pnpct.reconstruction import FBP, TVPWLS, PlugAndPlay
from pnpct.reconstruction.pnp_admm import BETA


@dataclass(frozen=True, kw_only=True)
class Plan:
    """The methods of the paper, total variation and the control, with their settings.

    Args:
        kernel: Of FBP that all methods are measured against.
        blur_pixels: Standard deviation of the blurred FBP, the control, pixels.
        tv_strength: Strength of total variation, HU times pixel.
        supervised: Network that was trained on dose pairs alone, by name or file.
        two_stage: Network that was trained in two stages, by name or file.
        beta: Penalty of plug-and-play ADMM.
        iterations: Its most iterations.
        lesion_hu: Contrast of a lesion that is put into each case, HU; 0 puts none, and takes half the time.
        lesion_diameter: Its diameter, mm.
        seed: Of everything that is drawn.
    """

    kernel: Kernel = FBP.kernel
    blur_pixels: float = 1.5
    tv_strength: float = TVPWLS.strength
    supervised: str = "supervised"
    two_stage: str = "n2n"
    beta: float = BETA
    iterations: int = PlugAndPlay.iterations
    lesion_hu: float = -40.0
    lesion_diameter: float = 12.0
    seed: int = 0

    def candidates(self) -> tuple[Candidate, ...]:
        """Return the methods, FBP first.

        Raises:
            OSError: If a network cannot be read.
            ValueError: If it is none, or a setting is out of its range.
        """
        made = [filtered(FBP(self.kernel)), blurred(self.blur_pixels), total_variation(TVPWLS(self.tv_strength))]
        networks = {"supervised": ("supervised", self.supervised), "two-stage": ("two-stage", self.two_stage)}
        for words, (name, weights) in networks.items():
            denoise = load_denoiser(weights)
            loop = PlugAndPlay(denoise, beta=self.beta, iterations=self.iterations)
            made.append(denoised(name, f"{words} denoiser", denoise))
            made.append(plug_and_play(f"pnp-{name}", f"PnP, {words}", loop))
        order = ("fbp", "blurred-fbp", "tv-pwls", "supervised", "two-stage", "pnp-supervised", "pnp-two-stage")
        return tuple(sorted(made, key=lambda candidate: order.index(candidate.name)))
