"""The projector's and FBP's inner loops on a GPU, compiled by Triton.

An image is [row][column][lane] and rays are [strip][lane] as on a CPU: one index and one weight serve all lanes, and
the lanes of a strip are read together. The transpose gathers: each pixel looks for the strips that may touch it, gives
each the very weight that it has in the forward projection, and adds in the order of the table: no two runs differ.
"""

import triton
import triton.language as tl

from pnpct.operators.ray_lines import LEFT, NARROWEST

SLACK = 0.01
"""Columns by which a pixel is taken for wider when strips are looked for: more than float32 is off."""

HORIZON = 1e-3
"""Rows. So near to the focal spot, beside the image, strips have no order any more."""

_LEFT, _NARROWEST = tl.constexpr(LEFT), tl.constexpr(NARROWEST)
_SLACK, _HORIZON = tl.constexpr(SLACK), tl.constexpr(HORIZON)


@triton.jit
def _on_row(edge, slope, width, widening, from_middle):
    """Left edge and width of strips on a row, and the inverse of the width."""
    wide = tl.maximum(width + widening * from_middle, _NARROWEST)
    return edge + slope * from_middle, wide, 1.0 / wide


@triton.jit
def _right_of(distance, wide, per_column):
    """Part of a strip right of a place, from which its left edge is as far to the right as `distance` says."""
    return tl.minimum(tl.maximum((distance + wide) * per_column, 0.0), 1.0)


@triton.jit
def project(
    image, edge, slope, width, widening, sums, strips, rows, cols, stride, SIZE: tl.constexpr, STRIPS: tl.constexpr
):
    """Sum the image [row][1 + column + 3][lane] along the strips into sums [strip][lane]; `stride` is of its rows."""
    strip = tl.program_id(0) * STRIPS + tl.arange(0, STRIPS)
    lane = tl.arange(0, SIZE)
    there = strip < strips
    edges, slopes = tl.load(edge + strip, there, 0.0), tl.load(slope + strip, there, 0.0)
    widths, widenings = tl.load(width + strip, there, 0.0), tl.load(widening + strip, there, 0.0)
    total = tl.full((STRIPS, SIZE), 0.0, tl.float32)
    from_middle = (1 - rows) * 0.5
    for _ in range(rows):
        left, wide, per_column = _on_row(edges, slopes, widths, widenings, from_middle)
        column = tl.minimum(tl.maximum(tl.floor(left), -_LEFT), cols)
        second = _right_of(left - (column + 1), wide, per_column)
        third = _right_of(left - (column + 2), wide, per_column)
        place = image + ((column.to(tl.int32) + _LEFT) * SIZE)[:, None] + lane[None, :]
        total += (1 - second)[:, None] * tl.load(place)
        total += (second - third)[:, None] * tl.load(place + SIZE)
        total += third[:, None] * tl.load(place + 2 * SIZE, (third > 0)[:, None], 0.0)
        image += stride
        from_middle += 1.0
    tl.store(sums + (strip.to(tl.int64) * SIZE)[:, None] + lane[None, :], total, there[:, None])


@triton.jit
def back_project(
    image,
    edge,
    slope,
    width,
    widening,
    rays,
    pencils,
    ends,
    starts,
    count,
    apex_width,
    rows,
    cols,
    SIZE: tl.constexpr,
    PARTS: tl.constexpr,
    DOWN: tl.constexpr,
    ACROSS: tl.constexpr,
    GRAINS: tl.constexpr,
    SQUARED: tl.constexpr,
):
    """Transpose of `project`, with weights squared or not, of rays [strip / PARTS][lane] to image [row][column][lane].

    A program has DOWN × ACROSS pixels. Of each pencil it knows where the edges of its strips meet, and `starts` says
    for GRAINS slopes which strip is the first with a right edge of that slope or more. The next ones follow it.
    """
    pixel = tl.arange(0, DOWN * ACROSS)
    lane = tl.arange(0, SIZE)
    top, side = tl.program_id(1) * DOWN, tl.program_id(0) * ACROSS
    bottom = tl.minimum(top + DOWN, rows) - 1
    row, column = top + pixel // ACROSS, side + pixel % ACROSS
    middle = (rows - 1) * 0.5
    from_middle = row - middle
    total = tl.full((DOWN * ACROSS, SIZE), 0.0, tl.float32)
    for pencil in range(count):
        apex_column, apex_row = tl.load(pencils + 8 * pencil), tl.load(pencils + 8 * pencil + 1)
        down = tl.load(pencils + 8 * pencil + 2)
        least, lowest = tl.load(pencils + 8 * pencil + 3), tl.load(pencils + 8 * pencil + 4)
        highest, grains = tl.load(pencils + 8 * pencil + 5), tl.load(pencils + 8 * pencil + 6)
        density = tl.load(pencils + 8 * pencil + 7)
        begin, end = tl.load(ends + pencil), tl.load(ends + pencil + 1)

        # A line that meets column c on a row `depth` from the apex has the slope (c − apex) / depth.
        one, other = down * (top - middle - apex_row), down * (bottom - middle - apex_row)
        nearest = 1.0 / tl.maximum(tl.minimum(one, other), _HORIZON)
        farthest = 1.0 / tl.maximum(tl.maximum(one, other), _HORIZON)
        before, behind = side - _SLACK - apex_width - apex_column, side + ACROSS + _SLACK - apex_column
        meets = (tl.maximum(one, other) > 0) & (tl.maximum(behind * nearest, behind * farthest) > least)
        meets &= tl.minimum(before * nearest, before * farthest) < highest
        most = (nearest * (1 + 2 * _SLACK + apex_width) + 1.5 / grains) * density + 2
        most = tl.where(meets, tl.minimum(most, end - begin), 0.0).to(tl.int32)

        depth = down * (from_middle - apex_row)
        slowest = (column - _SLACK - apex_width - apex_column) / tl.maximum(depth, _HORIZON)
        grain = tl.minimum(tl.maximum((slowest - lowest) * grains, 0.0), GRAINS - 1.0)
        strip = tl.load(starts + pencil * GRAINS + grain.to(tl.int32))
        for _ in range(most):
            there = (strip < end) & (depth > 0)
            left, wide, per_column = _on_row(
                tl.load(edge + strip, there, 0.0),
                tl.load(slope + strip, there, 0.0),
                tl.load(width + strip, there, 0.0),
                tl.load(widening + strip, there, 0.0),
                from_middle,
            )
            weight = _right_of(left - column, wide, per_column) - _right_of(left - (column + 1), wide, per_column)
            weight = tl.where(there, weight, 0.0)
            place = rays + ((strip // PARTS).to(tl.int64) * SIZE)[:, None] + lane[None, :]
            value = tl.load(place, (weight > 0)[:, None], 0.0)
            if SQUARED:
                weight = weight * weight
            total += weight[:, None] * value
            strip += 1
    place = image + ((row.to(tl.int64) * cols + column) * SIZE)[:, None] + lane[None, :]
    tl.store(place, total, ((row < rows) & (column < cols))[:, None])


@triton.jit
def _arctangent(z):
    """Arctangent for |z| ≤ 1 to 8e-8, by the fit that the compiled kernels have."""
    u = z * z
    high = 0.099060969 + u * (-0.0593671008 + u * (0.0241661895 + u * -0.00466877331))
    low = 0.199692354 + u * (-0.14016585 + u * high)
    return z * (0.999999898 + u * (-0.333319597 + u * low))


@triton.jit
def back_project_fan(
    image,
    views,
    cosines,
    sines,
    count,
    x0,
    y0,
    spacing,
    distance,
    bins,
    scale,
    offset,
    rows,
    cols,
    ARC: tl.constexpr,
    SIZE: tl.constexpr,
    DOWN: tl.constexpr,
    ACROSS: tl.constexpr,
):
    """Sum the filtered views [view][1 + bin + 1][lane] into the image [row][column][lane], as on a CPU."""
    pixel = tl.arange(0, DOWN * ACROSS)
    lane = tl.arange(0, SIZE)
    row, column = tl.program_id(1) * DOWN + pixel // ACROSS, tl.program_id(0) * ACROSS + pixel % ACROSS
    x, y = x0 + column * spacing, y0 - row * spacing
    total = tl.full((DOWN * ACROSS, SIZE), 0.0, tl.float32)
    for view in range(count):
        cosine, sine = tl.load(cosines + view), tl.load(sines + view)
        depth, across = distance + x * sine - y * cosine, x * cosine + y * sine
        tangent = tl.minimum(tl.maximum(across / depth, -1.0), 1.0)
        squared = depth * depth
        if ARC:
            tangent = _arctangent(tangent)
            squared += across * across
        number = tl.minimum(tl.maximum(scale * tangent + offset + 1, 0.0), bins + 1.0)
        lower = tl.minimum(number.to(tl.int32), bins)
        place = views + (lower * SIZE)[:, None] + lane[None, :]
        below, above = tl.load(place), tl.load(place + SIZE)
        value = below + (number - lower)[:, None] * (above - below)
        total += (1 / squared)[:, None] * value
        views += (bins + 2) * SIZE
    place = image + ((row.to(tl.int64) * cols + column) * SIZE)[:, None] + lane[None, :]
    tl.store(place, total, ((row < rows) & (column < cols))[:, None])
