"""Compiled loops of the sparse Cholesky factor: weights sorted by pixel, small matrices, small solutions."""

import math
from typing import Any

import numpy as np
from numba import njit

_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "cache": True}


@njit(**_OPTIONS)
def sort_by_pixel(lines, measured, parts, cells, bins, shape, turn, mu_water, first, weights, fill):
    """Note the first bin that sees each pixel, or, to fill, add up the weights of the bins from there on."""
    edge, slope, width, widening, length = lines
    rows, cols = shape if turn == 0 else (shape[1], shape[0])
    for cell in range(cells[0], cells[1]):
        number = measured[cell, 0] % bins
        for strip in range(cell * parts, (cell + 1) * parts):
            for row in range(rows):
                at = np.float32(row) - np.float32(rows - 1) / 2
                left, wide = edge[strip] + slope[strip] * at, width[strip] + widening[strip] * at
                wide = max(wide, np.float32(1e-6))
                column = math.floor(left)
                while column < left + wide:
                    if 0 <= column < cols:
                        pixel = row * shape[1] + column if turn == 0 else (shape[0] - 1 - column) * shape[1] + row
                        if fill:
                            under = min(left + wide, np.float32(column + 1)) - max(left, np.float32(column))
                            weights[pixel, number - first[pixel]] += mu_water * length[strip] * under / wide
                        else:
                            first[pixel] = min(first[pixel], number)
                    column += 1


@njit(**_OPTIONS)
def list_members(order, rank, reach, starts, sizes, members):
    """Count the members of each column, and write them if there is room."""
    rows, cols = rank.shape
    for column in range(order.size):
        pixel = order[column]
        row, col, distance = pixel // cols, pixel % cols, int(reach[pixel])
        count = 0
        for i in range(max(0, row - distance), min(rows, row + distance + 1)):
            for j in range(max(0, col - distance), min(cols, col + distance + 1)):
                near = (i - row) ** 2 + (j - col) ** 2 <= reach[pixel] ** 2
                if near and rank[i, j] > column:
                    count += 1
                    if members.size:
                        members[starts[column] + count] = i * cols + j
        if members.size:
            members[starts[column]] = pixel
        sizes[column + 1] = count + 1


@njit(fastmath=True, **_OPTIONS)
def add_view(bins_from, shares, weights, starts, members, blocks, packed, first, last):
    """Add one view's Σ w a_j a_k to the lower triangles of the columns' matrices."""
    width = shares.shape[1]
    for column in range(first, last):
        at = blocks[column]
        for a in range(starts[column], starts[column + 1]):
            j = members[a]
            for b in range(starts[column], a + 1):
                k = members[b]
                low = max(bins_from[j], bins_from[k])
                high = min(min(bins_from[j], bins_from[k]) + width, weights.size)
                total = np.float32(0)
                for number in range(low, high):
                    total += weights[number] * shares[j, number - bins_from[j]] * shares[k, number - bins_from[k]]
                packed[at] += total
                at += 1


@njit(**_OPTIONS)
def factorise(packed, beta, starts, blocks, values, first, last):
    """Write each column, M⁻¹ e₁ / √(e₁ᵀ M⁻¹ e₁) of its small matrix M = U D Uᵀ: that is U⁻ᵀ e₁ / √d₁.

    Where rounding made M indefinite, it keeps the diagonal alone. (`np.linalg.solve` would take 10 s to compile.)
    """
    for column in range(first, last):
        start, size = starts[column], starts[column + 1] - starts[column]
        lower = np.zeros((size, size))  # of M; then D, and Uᵀ below it
        at = blocks[column]
        for a in range(size):
            for b in range(a + 1):
                lower[a, b] = packed[at]
                at += 1
            lower[a, a] += beta
        solution, alone, definite = np.zeros(size), lower[0, 0], True
        for k in range(size - 1, -1, -1):
            definite &= lower[k, k] > 0
            for a in range(k):
                share = lower[k, a] / lower[k, k]
                for b in range(a + 1):
                    lower[a, b] -= share * lower[k, b]
            for a in range(k):
                lower[k, a] /= lower[k, k]
        solution[0] = 1.0
        if definite:
            for k in range(1, size):
                for a in range(k):
                    solution[k] -= lower[k, a] * solution[a]
        scale = np.sqrt(lower[0, 0] if definite else alone)
        for k in range(size):
            values[start + k] = solution[k] / scale
