"""A modern CT scanner: its geometry, and the polychromatic scans it makes."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from pnpct.geometry import FanBeam, ImageGrid, evenly_spaced_views
from pnpct.operators import Projector
from pnpct.physics import Exposure, Moments
from pnpct.simulation.beam import Beam, effective_mu_water, hardening_correction, scanner_beam
from pnpct.simulation.phantom import Phantom, relative_attenuation

VIEWS = 984
"""Views of a rotation."""
BINS = 900
"""Detector cells along the arc."""
TUBE_CURRENT_MA = 40.0
"""Of a low-dose scan, mA, at a rotation time of one second."""
SLICE_THICKNESS = 0.625
"""Distance of the slices of neighbouring detector rows at the isocentre, mm."""
_CHUNK = 16
"""Views with signals that are summed together: few enough for the cache of a CPU."""


@dataclass(frozen=True)
class Sampling:
    """How finely the scanner's blur is sampled: each sample is a projection of its own.

    Intensities are averaged over the samples, not line integrals. 1 everywhere is a point source and a gantry
    that stands still during a view; a cell then averages the line integrals over its width.

    Args:
        columns: Parts of a detector cell along the fan.
        focal_spot: Points of the focal spot across the fan and along the tube's anode, which a fan sees as
            depth.
        views: Angles within the rotation from one view to the next.
        width: Width of the focal spot across the fan, mm, ≥ 0.
        length: Length of the focal spot as it looks from the isocentre, along z, mm, ≥ 0.
        anode_angle: Between the anode's face and the fan, rad; the focal spot is length / tan(angle) deep.

    Raises:
        ValueError: If a number is out of range.
    """

    columns: int = 1
    focal_spot: tuple[int, int] = (1, 1)
    views: int = 1
    width: float = 1.0
    length: float = 1.0
    anode_angle: float = math.radians(7.0)

    def __post_init__(self) -> None:
        if min(self.columns, *self.focal_spot, self.views) < 1:
            raise ValueError("A scan needs at least one sample of cells, focal spot and views.")
        if not (self.width >= 0 and self.length >= 0 and 0 < self.anode_angle < math.pi / 2):
            raise ValueError(
                "A focal spot has a width and a length from 0 up, in mm, and an anode angle between 0 and π/2 rad."
            )

    def geometries(self, geometry: FanBeam) -> Iterator[FanBeam]:
        """Yield the geometry of each sample; their detectors have `columns` times the bins."""
        across, along = self.focal_spot
        angles = np.asarray(geometry.view_angles)
        step = 2 * math.pi / geometry.views if geometry.views < 3 else float(np.median(np.diff(angles)))
        shifts = np.asarray(geometry.focal_spot_shifts or [(0.0, 0.0)] * geometry.views)
        for turn in _middles(self.views) * step:
            for sideways in _middles(across) * self.width:
                for deep in _middles(along) * self.length / math.tan(self.anode_angle):
                    moved = shifts + np.array([sideways, deep])
                    yield replace(
                        geometry,
                        view_angles=tuple((angles + turn).tolist()),
                        bins=geometry.bins * self.columns,
                        bin_width=geometry.bin_width / self.columns,
                        detector_offset=geometry.detector_offset * self.columns,
                        focal_spot_shifts=tuple(map(tuple, moved.tolist())) if moved.any() else (),
                    )


BLURRED = Sampling(columns=2, focal_spot=(2, 2), views=2)
"""The blur of the scanner, where scans are to have it: eight projections in place of one."""


def _middles(parts: int) -> np.ndarray:
    """Middles of even parts of the interval from −1/2 to 1/2."""
    return (np.arange(parts) + 0.5) / parts - 0.5


def clinical_fan_beam(*, views: int = VIEWS, bins: int = BINS) -> FanBeam:
    """Return the geometry of CatSim's default scanner, with its full fan of 56 degrees.

    541 mm from the focal spot to the isocentre, 949 mm to the detector, an arc of 921.5 mm shifted by a
    quarter of a cell, one full rotation.

    Args:
        views: Views per rotation, at least 1.
        bins: Detector cells along the arc, at least 1; 900 cells are 1.0239 mm wide.

    Example:
        >>> clinical_fan_beam().bin_width
        1.0239
    """
    return FanBeam(
        view_angles=evenly_spaced_views(views),
        bins=bins,
        source_to_isocenter=541.0,
        source_to_detector=949.0,
        bin_width=1.0239 * BINS / max(bins, 1),  # FanBeam says what is wrong with less than one
        detector_offset=0.25,
    )


def simulate_moments(
    phantom: Phantom,
    geometry: FanBeam,
    beams: Sequence[Beam],
    *,
    sampling: Sampling | None = None,
    crosstalk: float = 0.0,
) -> tuple[Moments, ...]:
    """Return the noise-free signal of polychromatic scans, and its variance, for 1 mAs per view.

    One projection of the phantom serves all beams.

    Args:
        phantom: The object.
        geometry: The scanner.
        beams: What its detector absorbs without object, of the same number of bins.
        sampling: Blur by cells, focal spot and rotation; None is `Sampling()`, one sample of each.
        crosstalk: Fraction of a cell's x-rays that is detected in each of its two neighbours, 0 to 0.3.

    Returns:
        Moments for each beam in the unit of its response, on the phantom's device.

    Raises:
        ValueError: If a beam has another number of bins, the phantom is out of the field of view, or crosstalk is
            out of range.
    """
    for beam in beams:
        if len(beam.photons) != geometry.bins:
            raise ValueError(f"The beam is for {len(beam.photons)} bins, the geometry has {geometry.bins}.")
    if not 0 <= crosstalk <= 0.3:
        raise ValueError(f"Crosstalk to each neighbour must be a fraction from 0 to 0.3, got {crosstalk}.")
    sampling = sampling or Sampling()
    solid = [
        index for index, share in enumerate(phantom.fractions) if phantom.materials[index] != "air" and share.any()
    ] or [0]  # air alone is as good as nothing
    materials, fractions = tuple(phantom.materials[index] for index in solid), phantom.fractions[solid]
    samples: list[list[Moments]] = []
    for each in sampling.geometries(geometry):
        paths = _projector(phantom.grid, each)(fractions)
        samples.append([moments_behind(paths, materials, beam) for beam in beams])
    return tuple(_averaged(of_beam, crosstalk) for of_beam in zip(*samples, strict=True))


def _averaged(samples: Sequence[Moments], crosstalk: float) -> Moments:
    """Average the intensities of samples, and share them with the neighbours."""
    mean = torch.stack([sample.signal_mean for sample in samples]).mean(dim=0)
    variance = torch.stack([sample.signal_variance for sample in samples]).mean(dim=0)
    air = samples[0]
    mean, variance, air_mean, air_variance = (
        _spread(each, crosstalk) for each in (mean, variance, air.air_mean, air.air_variance)
    )
    return Moments(mean, variance, air_mean, air_variance, electronic_noise=air.electronic_noise)


@lru_cache(maxsize=8)  # as many as `BLURRED` has; each takes 0.2 GB
def _projector(grid: ImageGrid, geometry: FanBeam) -> Projector:
    """The slices of a body share their projectors, which take longer to make than to use."""
    return Projector(grid, geometry, mu_water=1.0)


def _spread(signal: Float[Tensor, "*any"], crosstalk: float) -> Float[Tensor, "*any"]:
    """Share the signal with the neighbours; the outermost cells keep what would leave the detector."""
    if not crosstalk:
        return signal
    left = torch.cat([signal[..., :1], signal[..., :-1]], dim=-1)
    right = torch.cat([signal[..., 1:], signal[..., -1:]], dim=-1)
    return (1 - 2 * crosstalk) * signal + crosstalk * (left + right)


def moments_behind(paths: Float[Tensor, "materials views samples"], materials: tuple[str, ...], beam: Beam) -> Moments:
    """Return the moments of a polychromatic scan behind paths of known length in each material.

        S₁ = Σ_E photons(E) r(E) exp(−Σ_m (μ_m(E) − μ_air(E)) path_m),  S₂ with r(E)²,

    where r is the response of the beam.

    Args:
        paths: Length of each ray in each material, mm; several neighbouring rays for each bin of the beam if
            cells are sampled; their signals are averaged.
        materials: Names in `MATERIALS`.
        beam: What the detector absorbs without object.

    Returns:
        Moments in the unit of the response, with the electronic noise of one count, on the paths' device.

    Raises:
        ValueError: If a material is unknown, or the rays do not share out evenly among the beam's bins.
    """
    bins = len(beam.photons)
    _, views, rays = paths.shape
    if rays % bins:
        raise ValueError(f"{rays} rays a view cannot be shared out among the {bins} bins of the beam.")
    mu = relative_attenuation(materials, beam.energies).tolist()
    signal = (beam.photons * beam.response).to(paths)
    responses = beam.response.tolist()
    mean, variance = torch.zeros(2, views, bins, dtype=paths.dtype, device=paths.device)
    for first in range(0, views, _CHUNK):
        chunk = paths[:, first : first + _CHUNK]
        for energy, response in enumerate(responses):
            line_integrals = torch.zeros_like(chunk[0])
            for of_material, length in zip(mu, chunk, strict=True):
                line_integrals.add_(length, alpha=-of_material[energy])
            transmitted = line_integrals.exp_().unflatten(-1, (bins, -1))
            transmitted = transmitted.mean(dim=-1) if rays > bins else transmitted[..., 0]
            mean[first : first + _CHUNK].addcmul_(transmitted, signal[:, energy])
            variance[first : first + _CHUNK].addcmul_(transmitted, signal[:, energy], value=response)
    air_variance = (beam.photons * beam.response**2).sum(dim=1).to(paths)
    return Moments(mean, variance, signal.sum(dim=1), air_variance, electronic_noise=beam.electronic_noise)


def expose(
    phantom: Phantom,
    geometry: FanBeam,
    beam: Beam | None = None,
    *,
    sampling: Sampling | None = None,
    crosstalk: float = 0.0,
) -> Exposure:
    """Return the exposure of a phantom in a scanner; `Exposure.scan` draws scans at any tube current from it.

    Args:
        phantom: The object.
        geometry: The scanner; see `clinical_fan_beam`.
        beam: Tube, filters and detector; `scanner_beam(geometry)` if None.
        sampling: Blur by cells, focal spot and rotation; None is one sample of each.
        crosstalk: Fraction of a cell's x-rays that is detected in each of its two neighbours, 0 to 0.3.

    Returns:
        The moments, with the water correction to the beam's effective energy.

    Raises:
        ValueError: If the beam has another number of bins, the phantom is out of the field of view, or crosstalk is
            out of range.

    Example:
        >>> phantom = Phantom(("water",), torch.ones(1, 8, 8), ImageGrid(8, 8, spacing=10.0))
        >>> exposure = expose(phantom, clinical_fan_beam(views=4, bins=16))
        >>> scan = exposure.scan(tube_current_ma=40.0, generator=torch.Generator().manual_seed(0))
        >>> scan.counts.shape
        torch.Size([4, 16])
    """
    beam = beam or scanner_beam(geometry)
    (moments,) = simulate_moments(phantom, geometry, [beam], sampling=sampling, crosstalk=crosstalk)
    return as_exposure(moments, geometry, beam)


def as_exposure(moments: Moments, geometry: FanBeam, beam: Beam) -> Exposure:
    """Return moments of a beam, from any simulator, with what a scan needs to know of the beam."""
    return Exposure(moments, geometry, effective_mu_water(beam), hardening_correction(beam))
