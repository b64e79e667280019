"""Poisson and Gaussian numbers, one stream for each ray: the same whatever thread draws them."""

import math

import numba
import numpy as np

_STEP = np.uint64(0x9E3779B97F4A7C15)
_FIRST, _SECOND = np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
_TO_UNIT, _HALF_TO_UNIT = 1.0 / (1 << 53), 1.0 / (1 << 32)
_LOW_HALF = np.uint64(0xFFFFFFFF)


@numba.njit(inline="always")
def _mixed(state):
    """Return 64 bits that depend on all bits of the state (splitmix64 of Steele, Lea and Flood, 2014)."""
    state = (state ^ (state >> np.uint64(30))) * _FIRST
    state = (state ^ (state >> np.uint64(27))) * _SECOND
    return state ^ (state >> np.uint64(31))


@numba.njit(inline="always")
def _unit(state):
    """Return a number strictly between 0 and 1."""
    return (np.float64(_mixed(state) >> np.uint64(11)) + 0.5) * _TO_UNIT


@numba.njit(inline="always")
def _counted_down(mean, state):
    """Draw a small Poisson number from the products of uniform ones; return it and the state of the stream."""
    floor, product, count = math.exp(-mean), 1.0, -1
    while product > floor or count < 0:
        state += _STEP
        product *= _unit(state)
        count += 1
    return float(count), state


@numba.njit(inline="always")
def _rejected(mean, state):
    """Draw a Poisson number of mean 10 or more by transformed rejection (Hörmann 1993, algorithm PTRS)."""
    root = math.sqrt(mean)
    b = 0.931 + 2.53 * root
    a = -0.059 + 0.02483 * b
    surely = 0.9277 - 3.6224 / (b - 2)
    while True:
        state += _STEP
        both = _mixed(state)
        u = (np.float64(both >> np.uint64(32)) + 0.5) * _HALF_TO_UNIT - 0.5
        v = (np.float64(both & _LOW_HALF) + 0.5) * _HALF_TO_UNIT
        left = 0.5 - abs(u)
        count = math.floor((2 * a / left + b) * u + mean + 0.43)
        if left >= 0.07 and v <= surely:
            return count, state
        if count < 0 or (left < 0.013 and v > left):
            continue
        inverse_alpha = 1.1239 + 1.1328 / (b - 3.4)
        bound = count * math.log(mean) - mean - math.lgamma(count + 1)
        if math.log(v * inverse_alpha / (a / (left * left) + b)) <= bound:
            return count, state


@numba.njit(inline="always")
def _normal(unit):
    """Return the quantile of the normal distribution (Wichura 1988, AS 241, PPND7: seven digits)."""
    from_middle = unit - 0.5
    if abs(from_middle) <= 0.425:
        r = 0.180625 - from_middle * from_middle
        above = ((59.10937472 * r + 159.29113202) * r + 50.434271938) * r + 3.3871327179
        return from_middle * above / (((67.1875636 * r + 78.757757664) * r + 17.895169469) * r + 1.0)
    r = math.sqrt(-math.log(min(unit, 1.0 - unit)))
    if r <= 5.0:
        r -= 1.6
        above = ((0.17023821103 * r + 1.3067284816) * r + 2.75681539) * r + 1.4234372777
        value = above / ((0.12021132975 * r + 0.7370016425) * r + 1.0)
    else:
        r -= 5.0
        above = ((0.017337203997 * r + 0.42868294337) * r + 3.081226386) * r + 6.657905115
        value = above / ((0.012258202635 * r + 0.24197894225) * r + 1.0)
    return value if from_middle > 0 else -value


@numba.njit(nogil=True, cache=True)
def draw_counts(mean, size, deviation, seed, counts, first, last):
    """Fill counts[first:last] with size · Poisson(mean) + Normal(0, deviation²).

    Sizes and deviations may be for all rays or for the last few that repeat.
    """
    for ray in range(first, last):
        state = _mixed(seed + _mixed(np.uint64(ray) * _STEP))
        if mean[ray] >= 10.0:
            count, state = _rejected(np.float64(mean[ray]), state)
        else:
            count, state = _counted_down(np.float64(mean[ray]), state)
        noise = deviation[ray % deviation.size]
        value = size[ray % size.size] * count
        if noise > 0:
            state += _STEP
            value += noise * _normal(_unit(state))
        counts[ray] = value
