"""The methods: frozen values that turn a sinogram into an image.

Their fields are the options, and the only place of their defaults: the command line, comparisons, benchmarks and a
user's three lines of Python read them here, and give the same image.
"""

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

from torch import Tensor

from pnpct.arrays import Image
from pnpct.denoisers import Denoise, TotalVariation, denoiser_settings
from pnpct.operators import AnyProjector, ConeProjector, Kernel, Projector
from pnpct.operators.support import supported
from pnpct.physics import Sinogram
from pnpct.reconstruction.around_network import around_network, iterates_in_image
from pnpct.reconstruction.bone import corrected_for_bone
from pnpct.reconstruction.dead_modules import filled_from_image
from pnpct.reconstruction.fbp import fbp
from pnpct.reconstruction.fdk import about_filtered_cone, circle_volume
from pnpct.reconstruction.finer_pixels import on_finer_pixels
from pnpct.reconstruction.iterated import iterated
from pnpct.reconstruction.iteration_schedule import enough_iterations, falling
from pnpct.reconstruction.normal_equations import INNER_ITERATIONS, balanced_sigma_v, penalty_of
from pnpct.reconstruction.pnp_admm import SIGMA_V, ADMMState, check_damping, pnp_admm
from pnpct.reconstruction.reconstructed import Progress, Reconstruction, unwatched
from pnpct.reconstruction.solvers import ITERATIVE, SolverName, check_in_space, solver_by_name
from pnpct.reconstruction.starting import STRENGTH, around_total_variation, far_apart, possible, starting_state
from pnpct.reconstruction.stopping import RuleName
from pnpct.reconstruction.tilted_volume import StartingImage, tilted_volume
from pnpct.reconstruction.whole_object import Whole, beyond_fan, beyond_image, lines_left_out
from pnpct.reconstruction.whole_volume import WholeVolume, corrected_for_bone_in, whole_volume
from pnpct.reconstruction.without_air import inside, without_air, without_air_of

AMONG_STREAKS = 0.5
"""σ_v where views are far apart over that elsewhere: what it lets into x + u are streaks, which networks keep."""


@dataclass(frozen=True)
class FBP:
    """Filtered back-projection: of a cone beam that of Feldkamp on a circle, and that of tilted planes on a helix.

    Args:
        kernel: "ram-lak", "shepp-logan", "hann" or "soft", from sharp to smooth.
    """

    kernel: Kernel = "hann"

    @property
    def settings(self) -> Mapping[str, Any]:
        """All that the image depends on besides the data, as plain values."""
        return {"method": "fbp", **asdict(self)}

    def __call__(self, sinogram: Sinogram, A: AnyProjector, *, progress: Progress = unwatched) -> Reconstruction:
        """Reconstruct; there are no iterates to watch."""
        del progress
        if isinstance(A, ConeProjector):
            helix = A.geometry.trajectory.feed
            volume, notes = (tilted_volume(sinogram, A, self), ()) if helix else circle_volume(sinogram, A, self.kernel)
            return Reconstruction(volume, self.settings, notes=(*notes, about_filtered_cone(A.geometry, A.grid)))
        whole = beyond_fan(_corrected(sinogram, A), A)
        image = fbp(whole.sinogram.line_integrals, whole.A, kernel=self.kernel)
        return Reconstruction(image, self.settings, notes=(*whole.notes, *lines_left_out(sinogram, A.geometry)))


@dataclass(frozen=True)
class DenoisedFBP:
    """A denoiser alone, on filtered back-projection.

    Args:
        denoise: The denoiser.
        kernel: Kernel of FBP; pnpct's networks expect the sharpest.
    """

    denoise: Denoise
    kernel: Kernel = "ram-lak"

    @property
    def settings(self) -> Mapping[str, Any]:
        """All that the image depends on besides the data, as plain values."""
        return {"method": "denoised-fbp", "kernel": self.kernel, **denoiser_settings(self.denoise)}

    def __call__(self, sinogram: Sinogram, A: AnyProjector, *, progress: Progress = unwatched) -> Reconstruction:
        """Reconstruct; there are no iterates to watch."""
        del progress
        made = FBP(self.kernel)(sinogram, A)
        return replace(made, image=self.denoise(made.image), settings=self.settings)


@dataclass(frozen=True)
class TVPWLS:
    """Penalised weighted least squares with total variation: the baseline that learned priors have to beat.

    It converges to the minimiser of ½ ‖A x − y‖²_W + λ · TV(x), λ = strength / σ, σ being the standard deviation to
    which the data alone determine a pixel. What total variation should take away grows with the noise, and the weights
    with its inverse square, so one strength serves every dose and geometry. The iterates are those of ADMM around the
    proximal map of total variation, from `starting_state` on.

    Args:
        strength: Of total variation over the noise, pixels, ≥ 0.
        across: Weight of differences between neighbouring slices, ≥ 0, where the last dimension of the batch is that of
            slices; of total variation in space, pixel spacing over slice spacing, which None is for a cone beam, with
            `IN_SPACE` of the strength. 0 leaves each slice on its own, as None does in a fan beam.
        iterations: Maximum number of iterations, at least 1.
        stop: Stopping rule that may end the iterations earlier.

    References:
        Sidky and Pan, Phys. Med. Biol. 53 (2008) 4777; Fessler, IEEE Trans. Image Process. 3 (1994) 290.
    """

    strength: float = STRENGTH
    across: float | None = None
    iterations: int = 12
    stop: RuleName = "relative"

    def __post_init__(self) -> None:
        if not 0 <= self.strength < float("inf"):
            raise ValueError(f"The strength of total variation is pixels from 0 up, got {self.strength:g}.")
        TotalVariation(self.strength, across=self.across or 0.0)

    @property
    def settings(self) -> Mapping[str, Any]:
        """All that the image depends on besides the data, as plain values."""
        return {"method": "tv", **asdict(self)}

    def states(self, sinogram: Sinogram, A: AnyProjector, start: ADMMState) -> Iterator[ADMMState]:
        """Yield the iterates from a state on, for ever."""
        return around_total_variation(sinogram, A, start, strength=self.strength, across=self.across)

    def __call__(self, sinogram: Sinogram, A: AnyProjector, *, progress: Progress = unwatched) -> Reconstruction:
        """Reconstruct."""
        if isinstance(A, ConeProjector):
            return self._iterated(*_in_space(sinogram, A), progress)
        whole, smooth = without_air(_whole(sinogram, A))
        return self._iterated(whole, starting_state(whole.sinogram, whole.A, smooth), progress)

    def _iterated(self, whole: Whole | WholeVolume, start: ADMMState, progress: Progress) -> Reconstruction:
        states, stop = self.states(whole.sinogram, whole.A, start), self.stop
        return iterated(states, whole, start, progress, iterations=self.iterations, stop=stop, settings=self.settings)


@dataclass(frozen=True)
class PlugAndPlay:
    """Plug-and-play ADMM, from `starting_state` on.

    σ_v is larger in the first iterations (`falling`), so that the edges come from the data, quickly; what it ends with
    decides how noisy the image is. ADMM is damped: what u collects is mostly noise, and networks, the proximal maps of
    no function, would take it for anatomy. On a limited angle the image has no negative attenuation (`possible`). A
    network sees the image mirrored in turn, a little total variation is behind it, and the image is the mean of the
    last two iterates (`around_network`). Where the pixels are large, the noise low and the network knows smaller ones,
    the iterates have pixels of half the size (`on_finer_pixels`).

    Args:
        denoise: D, with its strength inside.
        sigma_v: Standard deviation to which the denoised image is trusted in the end, HU, > 0; far below that of the
            data it is not reached. The default suits all doses and patients. Where views are far apart, half is taken.
        damping: Fraction of u that each iteration drops, 0 to 1; the paper's ADMM has 0.
        iterations: Maximum number of iterations, at least 1; None for what the noise of each image needs, from `FEWEST`
            to `MOST` (`enough_iterations`).
        stop: Stopping rule that may end the iterations earlier.
        solver: Solver of the data step.
        inner_iterations: Minimum steps of an iterative solver in each iteration; its own default if None.

    Raises:
        ValueError: If an option is out of range.

    References:
        The paper, Eqs. (4) to (6).
    """

    denoise: Denoise
    sigma_v: float = SIGMA_V
    damping: float = 0.5
    iterations: int | None = None
    stop: RuleName = "relative"
    solver: SolverName = "fourier"
    inner_iterations: int | None = None

    def __post_init__(self) -> None:
        penalty_of(self.sigma_v)
        check_damping(self.damping)
        solver_by_name(self.solver, inner_iterations=self.inner_iterations)

    @property
    def settings(self) -> Mapping[str, Any]:
        """All that the image depends on besides the data, as plain values."""
        return {
            "method": "pnp",
            **denoiser_settings(self.denoise),
            "sigma_v_hu": self.sigma_v,
            "damping": self.damping,
            "iterations": self.iterations,
            "stop": self.stop,
            "solver": self.solver,
            "inner_iterations": self.inner_iterations or (INNER_ITERATIONS if self.solver in ITERATIVE else None),
        }

    def _last(self, A: AnyProjector) -> float:
        """What σ_v ends with, HU."""
        return self.sigma_v * (AMONG_STREAKS if far_apart(A) else 1.0)

    def states(self, sinogram: Sinogram, A: AnyProjector, start: ADMMState) -> Iterator[ADMMState]:
        """Yield the iterates from a state on, for ever."""
        return self._states(sinogram, A, start, balanced_sigma_v(sinogram, A, start.v))

    def _states(self, sinogram: Sinogram, A: AnyProjector, start: ADMMState, balanced: Tensor) -> Iterator[ADMMState]:
        return pnp_admm(
            sinogram,
            A,
            possible(around_network(self.denoise, A.grid.plane.spacing), A),
            start,
            sigma_v=falling(balanced, self._last(A)),
            damping=self.damping,
            solver=solver_by_name(self.solver, inner_iterations=self.inner_iterations),
        )

    def __call__(self, sinogram: Sinogram, A: AnyProjector, *, progress: Progress = unwatched) -> Reconstruction:
        """Reconstruct."""
        if isinstance(A, ConeProjector):
            check_in_space(self.solver)
            return self._iterated(*_in_space(sinogram, A), progress)
        divided = on_finer_pixels(_whole(sinogram, A), self.denoise)
        if far_apart(divided.A):
            said = f"Views are far apart: it began with total variation, and σ_v falls to {self._last(divided.A):g} HU."
            divided = replace(divided, notes=(*divided.notes, said))
        smooth = None
        if self.solver in ITERATIVE:  # direct solvers are for what was asked for
            divided, smooth = without_air(divided)
        return self._iterated(divided, starting_state(divided.sinogram, divided.A, smooth), progress)

    def _iterated(self, whole: Whole | WholeVolume, start: ADMMState, progress: Progress) -> Reconstruction:
        balanced = balanced_sigma_v(whole.sinogram, whole.A, start.v)
        enough = enough_iterations(balanced / self.sigma_v) if self.iterations is None else self.iterations
        states = self._states(whole.sinogram, whole.A, start, balanced)
        return iterated(
            states,
            whole,
            start,
            progress,
            iterations=enough,
            stop=self.stop,
            settings=self.settings,
            mean_of=iterates_in_image(self.denoise),
        )


METHODS: dict[str, type[FBP | TVPWLS | PlugAndPlay]] = {"fbp": FBP, "pnp": PlugAndPlay, "tv": TVPWLS}
"""The methods that `pnpct reconstruct` offers."""


def reconstruct(sinogram: Sinogram, A: Projector, denoise: Denoise, **options: Any) -> Image:
    """Reconstruct by plug-and-play ADMM.

    Args:
        sinogram: Line integrals and weights.
        A: The projector.
        denoise: Denoiser, with its strength inside.
        **options: As for `PlugAndPlay`.

    Returns:
        The image, relative to water.

    Raises:
        ValueError: If an option is out of range.
    """
    return PlugAndPlay(denoise, **options)(sinogram, A).image


def _whole(sinogram: Sinogram, A: Projector) -> Whole:
    return beyond_image(beyond_fan(_corrected(sinogram, A), A))


def _corrected(sinogram: Sinogram, A: Projector) -> Sinogram:
    """What first images show: what dead modules would have measured, and what line integrals lack behind bone."""
    return corrected_for_bone(filled_from_image(sinogram, A), A)


def _in_space(sinogram: Sinogram, A: ConeProjector) -> tuple[WholeVolume, ADMMState]:
    """Return the rays of a volume, and the state to begin from: that of planes on a helix, of the cone on a circle."""
    whole = whole_volume(sinogram, A)
    if A.geometry.trajectory.feed:
        row = A.geometry.row_height_at_isocenter
        start = tilted_volume(sinogram, whole.A, StartingImage(), plane_spacing=row)
        whole = without_air_of(start, corrected_for_bone_in(start, whole))
        return whole, ADMMState.start(supported(inside(start, whole.A.grid.plane), whole.A.support).contiguous())
    first, _ = circle_volume(sinogram, whole.A, "soft")
    whole = without_air_of(first, corrected_for_bone_in(first, whole))
    return whole, starting_state(whole.sinogram, whole.A)
