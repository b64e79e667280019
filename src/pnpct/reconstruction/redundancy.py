"""The angle that each ray represents in filtered back-projection, for any set of views.

With f the filtered rays, FBP is an integral over all view angles β, in which every line appears twice, as the ray
(β, γ) and as the ray (β + π + 2γ, −γ). It is exact for every share that divides a line between its two rays:

    image(x) = ∮ dβ f[share · y](β, γ(x)) / L²,     share(β, γ) + share(β + π + 2γ, −γ) = 1

A ray that was not measured is taken from the nearest view, at the same γ. The integral then is a sum over views, in
which the ray γ of a view weighs the integral of its share over the angles that are nearest to it,

    weight(view, γ) = ∫ share(β, γ) dβ   from half-way to the view before to half-way to the view after.

With the share 1/2 these are the two halves of two gaps, whatever the order, spacing and number of the views. The
nearest view errs with the width of the gap; where the same lines were measured more finely from the opposite side,
the share passes to that side instead. It must do so smoothly, since the filter answers to every step: q is how deep
a ray lies inside what was measured, how far from the nearest gap times how far from the end of the detector, and

    share = sin²(π/2 · q / (q + q′)),     q′ of the other ray.

It is 1/2 over a full rotation, Parker's weights in a short scan, and Wang's on a detector that is moved far aside.

References:
    Parker, Med. Phys. 9 (1982) 254; Wang, Med. Phys. 29 (2002) 1634.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pnpct.geometry import FanBeam

Array = NDArray[np.float64]

TURN = 2 * math.pi

SAME_ANGLE = 2e-6
"""Views closer than this, rad, are one view measured several times."""

FINER, MUCH_FINER = 3.0, 9.0
"""A gap begins to leave its lines to the opposite side where the steps there are so much finer on average, and leaves
all of them from the second number on. Jittered, interleaved, dropped and random views stay below the first."""

PIECE = math.radians(0.25)
"""The share is integrated over such pieces of a gap."""

NEAR = math.radians(45.0)
"""A gap changes the shares of rays within this distance, if it is not longer itself: other gaps may be farther away."""

_NOWHERE = 1e-9
"""Of the middle of a gap: lines that no ray measured are shared evenly by the nearest views."""


def ray_weights(geometry: FanBeam) -> Array:
    """Return the angle that each ray represents, rad: (views, bins).

    For lines that were measured, the weights of their rays add up to the step between views.
    """
    circle = _Circle.of(geometry)
    ordinary = np.where(circle.emptiness > 0, 0.0, circle.gaps) / 2
    weight = (ordinary + np.roll(ordinary, 1))[:, None] * _share(geometry, circle, circle.angles)
    for gap in np.flatnonzero(circle.emptiness):
        pieces = 2 * math.ceil(circle.gaps[gap] / 2 / PIECE)
        width = circle.gaps[gap] / pieces
        share = _share(geometry, circle, circle.angles[gap] + (np.arange(pieces) + 0.5) * width)
        weight[gap] += width * share[: pieces // 2].sum(0)
        weight[(gap + 1) % len(weight)] += width * share[pieces // 2 :].sum(0)
    result: Array = (weight / circle.repeats[:, None])[circle.number]
    return result


@dataclass(frozen=True, eq=False)
class _Circle:
    """The distinct views around the circle.

    Args:
        angles: View angles from 0 to 2π, rising.
        gaps: Angle from each to the next.
        emptiness: For each gap how far it leaves its lines to the opposite side, from 0 to 1.
        number: For each view of the geometry its place among the distinct ones.
        repeats: How often each was measured.
    """

    angles: Array
    gaps: Array
    emptiness: Array
    number: NDArray[np.int64]
    repeats: NDArray[np.int64]

    @classmethod
    def of(cls, geometry: FanBeam) -> "_Circle":
        """Sort the views."""
        # Angles a rounding error below a full rotation belong to its beginning.
        beta = np.mod(np.asarray(geometry.view_angles) + SAME_ANGLE, TURN)
        order = np.argsort(beta, kind="stable")
        new = np.diff(beta[order], prepend=-1.0) > SAME_ANGLE
        angles = beta[order][new] - SAME_ANGLE
        number = np.empty(geometry.views, np.int64)
        number[order] = np.cumsum(new) - 1
        gaps = np.diff(angles, append=angles[0] + TURN)
        finer = gaps / _steps_opposite(geometry, angles, gaps)
        emptiness = np.clip((finer - FINER) / (MUCH_FINER - FINER), 0.0, 1.0)
        return cls(angles, gaps, emptiness, number, np.bincount(number))

    def surrounded(self, beta: Array) -> Array:
        """Return how well an angle is surrounded by measured ones: 0 in a gap, 1 far from any.

        It rises over the length of the gap, and over no less than `NEAR`. A gap begins half a step beyond its view. It
        counts as much as it is empty.
        """
        empty = np.flatnonzero(self.emptiness)
        half = np.minimum(np.roll(self.gaps, 1), self.gaps / 2)[empty] / 2
        after = np.minimum(np.roll(self.gaps, -1), self.gaps / 2)[empty] / 2
        begin, length = self.angles[empty] + half, self.gaps[empty] - half - after
        end, reach = begin + length, np.maximum(length, NEAR)
        table = np.mod(np.concatenate([np.linspace(0, TURN, 2048), begin, end, begin - reach, end + reach]), TURN)
        beyond = np.mod(table[:, None] - begin, TURN) - length
        distance = np.maximum(np.minimum(beyond, TURN - length - beyond), 0.0)
        surrounded = 1 - self.emptiness[empty] * (1 - np.minimum(distance / reach, 1.0))
        answer: Array = np.interp(beta, table, surrounded.min(1, initial=1.0), period=TURN)
        return np.maximum(answer, _NOWHERE)


def _steps_opposite(geometry: FanBeam, angles: Array, gaps: Array) -> Array:
    """Return for each gap the mean step between views at the other rays of its lines, rad."""
    low, high = geometry.fan_angle_edges[[0, -1]]
    fan_angles = np.linspace(-1, 1, 33) * max(min(-low, high), 0.0)
    # The integral of the step at an angle over the angle is linear between views.
    places = angles[0] + np.concatenate([[0.0], np.cumsum(np.tile(gaps, 4))])
    integral = np.concatenate([[0.0], np.cumsum(np.tile(gaps**2, 4))])
    begin = angles[0] + np.mod(angles[:, None] - angles[0] + math.pi + 2 * fan_angles, TURN)
    steps = np.interp(begin + gaps[:, None], places, integral) - np.interp(begin, places, integral)
    mean: Array = steps.mean(1) / gaps
    return mean


def _share(geometry: FanBeam, circle: _Circle, beta: Array) -> Array:
    """Return the shares of the rays at the view angles β: (angles, bins)."""
    gamma = geometry.fan_angles
    here = circle.surrounded(beta)[:, None] * _depth_in_fan(geometry, gamma)
    there = circle.surrounded(beta[:, None] + math.pi + 2 * gamma) * _depth_in_fan(geometry, -gamma)
    share: Array = np.sin(math.pi / 2 * here / (here + there)) ** 2
    return share


def _depth_in_fan(geometry: FanBeam, fan_angles: Array) -> Array:
    """Return how far inside the detector a fan angle is, rad; 0 beside it."""
    low, high = geometry.fan_angle_edges[[0, -1]]
    depth: Array = np.maximum(np.minimum(fan_angles - low, high - fan_angles), 0.0)
    return depth
