"""How far from the truth plug-and-play ends around a network: what its validation on single images cannot say.

In the loop a network is given what it has made itself. One that is level with another on held-out images may sharpen
its own work from iteration to iteration.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import torch
from torch import nn

from pnpct.arrays import Image
from pnpct.denoisers import LearnedDenoiser
from pnpct.evaluation import body_mask, rmse_hu, soft_tissue_mask
from pnpct.files import read_exposure
from pnpct.operators import Projector
from pnpct.physics import Sinogram, take_log
from pnpct.reconstruction import PlugAndPlay


@dataclass(frozen=True, eq=False)
class ClosedLoop:
    """Scans that are reconstructed around a network while it learns, the same ones each time.

    Args:
        files: Files of exposures, one scan of each.
        tube_currents_ma: Lowest and highest tube current, mA; from file to file they go from one to the other.
        seed: Seed of the noise.

    Raises:
        ValueError: If there is no file.
    """

    files: Sequence[Path]
    tube_currents_ma: tuple[float, float]
    seed: int = 0

    def __post_init__(self) -> None:
        if not self.files:
            raise ValueError("A network is tried in the loop on at least one scan, got none.")

    @cached_property
    def scans(self) -> tuple[tuple[Sinogram, Projector, Image], ...]:
        """The line integrals, the projector and the truth of each."""
        currents = np.geomspace(*self.tube_currents_ma, len(self.files))
        return tuple(self._scan(*each) for each in zip(range(len(self.files)), self.files, currents, strict=True))

    def _scan(self, number: int, file: Path, current: float) -> tuple[Sinogram, Projector, Image]:
        exposed = read_exposure(file)
        if exposed.grid is None or exposed.truth is None:
            raise ValueError(f"{file} does not say where the pixels of the truth are.")
        generator = torch.Generator().manual_seed(1000 * self.seed + number)
        scan = exposed.exposure.scan(tube_current_ma=float(current), generator=generator)
        return take_log(scan), Projector(exposed.grid, scan.geometry, mu_water=scan.mu_water), exposed.truth

    def __call__(self, D: nn.Module) -> dict[str, float]:
        """Return the RMSE of plug-and-play in soft tissue and in the body, HU: the root mean square over the scans.

        What no scan shows is left out.

        Raises:
            ValueError: If the network is noise-conditioned, or a file does not say where the pixels of its truth are.
        """
        method = PlugAndPlay(LearnedDenoiser(D))
        images = [method(sinogram, A).image for sinogram, A, _ in self.scans]
        found: dict[str, float] = {}
        for tissue, mask_of in (("soft", soft_tissue_mask), ("body", body_mask)):
            errors = [
                rmse_hu(image, truth, mask=mask)
                for image, (_, _, truth) in zip(images, self.scans, strict=True)
                if (mask := mask_of(truth)).any()
            ]
            if errors:
                found[f"reconstructed_{tissue}"] = float(np.sqrt(np.square(errors).mean()))
        return found
