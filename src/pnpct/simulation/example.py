"""A scan to begin with."""

import numpy as np
import torch

from pnpct.arrays import Image
from pnpct.geometry import DEFAULT_SIZE, ImageGrid
from pnpct.physics import Scan
from pnpct.simulation.beam import scanner_beam
from pnpct.simulation.phantom import truth
from pnpct.simulation.scanner import BINS, TUBE_CURRENT_MA, VIEWS, clinical_fan_beam, expose
from pnpct.simulation.sources import procedural_patient


def example_scan(
    anatomy: str = "chest",
    *,
    size: int = DEFAULT_SIZE // 2,
    views: int = VIEWS // 2,
    bins: int = BINS // 2,
    tube_current_ma: float = TUBE_CURRENT_MA,
    seed: int = 0,
) -> tuple[Scan, Image, ImageGrid]:
    """Simulate a low-dose scan of a slice of a procedural patient, as `pnpct simulate scan` does.

    Args:
        anatomy: Body region, one of `ANATOMIES`.
        size: Rows and columns of the truth.
        views: Views per rotation.
        bins: Detector cells along the arc.
        tube_current_ma: Tube current, mA, at a rotation time of one second.
        seed: Seed of the patient and of the noise.

    Returns:
        The scan, the truth relative to water, and the pixels of the truth.

    Raises:
        ValueError: If there is no such anatomy, or a number is out of range.

    Example:
        >>> scan, image, grid = example_scan(size=32, views=24, bins=40)
        >>> scan.counts.shape, image.shape
        (torch.Size([24, 40]), torch.Size([32, 32]))
    """
    source = procedural_patient(anatomy, np.random.default_rng(seed), size=size)
    grid = source.grid
    geometry = clinical_fan_beam(views=views, bins=bins)
    beam = scanner_beam(geometry)
    phantom = source.body.slice(source.height, grid.halved)
    exposure = expose(phantom, geometry, beam)
    scan = exposure.scan(tube_current_ma=tube_current_ma, generator=torch.Generator().manual_seed(seed))
    return scan, truth(phantom, grid, energy=beam.effective_energy), grid
