"""The projector in plain torch operations: for any device, and the reference for the compiled kernels."""

from collections.abc import Iterator, Sequence

import torch
from torch import Tensor
from torch.nn.functional import pad

from pnpct.operators.ray_lines import LEFT, NARROWEST, RIGHT, TAPS, RayLines

_ELEMENTS = 1 << 23
"""Numbers in the largest temporary array."""


class TorchProjector:
    """Forward and transpose of the same strips, for tensors [slice][row][col] and [slice][ray].

    Slower than compiled kernels by one to two orders of magnitude. On a GPU the transpose adds in no fixed order, so
    that two runs differ by rounding.
    """

    def __init__(
        self, tables: Sequence[RayLines], image_shape: tuple[int, int], rays: int, device: torch.device
    ) -> None:
        self._tables, self._image_shape, self._rays = tables, image_shape, rays
        self._lines = [
            [torch.from_numpy(values).to(device) for values in (t.edge, t.slope, t.width, t.widening, t.length)]
            for t in tables
        ]
        self._measured = [torch.from_numpy(t.measured).to(device, torch.int64) for t in tables]

    def project(self, images: Tensor) -> Tensor:
        """Return the sums along all rays."""
        rays = images.new_empty(images.shape[0], self._rays + 1)  # the last one stands for what was not measured
        for number, table in enumerate(self._tables):
            pixels = pad(turned(images, table), (0, 0, LEFT, RIGHT)).flatten(1, 2)
            for measured, place, weights in self._pieces(number, images.shape[0]):
                taps = [(pixels[:, place + t] * weights[t][..., None]).sum(2) for t in range(TAPS)]
                rays[:, measured] = sum(taps[1:], taps[0]).unflatten(1, (-1, table.parts)).sum(2)
        return rays[:, :-1].contiguous()

    def back_project(self, rays: Tensor, *, squared: bool = False) -> Tensor:
        """Return the transpose of `project`, or of the same map with each weight squared."""
        padded = pad(rays, (0, 1))
        images = rays.new_zeros(rays.shape[0], *self._image_shape)
        for number, table in enumerate(self._tables):
            pixels = rays.new_zeros(rays.shape[0], table.rows * (LEFT + table.cols + RIGHT), len(table.turns))
            for measured, place, weights in self._pieces(number, rays.shape[0]):
                values = padded[:, measured].repeat_interleave(table.parts, 1)[:, :, None]
                for tap in range(TAPS):
                    weight = weights[tap] ** 2 if squared else weights[tap]
                    pixels.index_add_(1, (place + tap).flatten(), (values * weight[..., None]).flatten(1, 2))
            inside = pixels.unflatten(1, (table.rows, -1))[:, :, LEFT : LEFT + table.cols]
            images += turned_back(inside, table, self._image_shape)
        return images

    def _pieces(self, number: int, slices: int) -> Iterator[tuple[Tensor, Tensor, list[Tensor]]]:
        """Yield, for some cells at a time, their rays, the first pixel on each row, and the weights of the taps."""
        table, measured = self._tables[number], self._measured[number]
        step = max(1, _ELEMENTS // (slices * len(table.turns) * table.rows * table.parts))
        rows = torch.arange(table.rows, device=measured.device)
        from_middle = rows - (table.rows - 1) / 2
        for first in range(0, measured.shape[0], step):
            cells = slice(first, first + step)
            strips = slice(first * table.parts, (first + step) * table.parts)
            edge, slope, width, widening, length = (line[strips, None] for line in self._lines[number])
            left, wide = edge + slope * from_middle, (width + widening * from_middle).clamp(min=NARROWEST)
            column = left.floor().clamp(-LEFT, table.cols)
            shares = [((left + wide - column - tap) / wide).clamp(0, 1) for tap in range(1, TAPS)]
            falling = [torch.ones_like(left), *shares, torch.zeros_like(left)]
            weights = [(falling[tap] - falling[tap + 1]) * length for tap in range(TAPS)]
            place = rows * (LEFT + table.cols + RIGHT) + column.long() + LEFT
            yield measured[cells], place, weights


def turned(images: Tensor, table: RayLines) -> Tensor:
    """Return [slice][row][col][turn]: the images after each of the turns, in the square that several need."""
    if len(table.turns) > 1:
        beside, above = ((table.rows - side) // 2 for side in (images.shape[2], images.shape[1]))
        images = pad(images, (beside, beside, above, above))
    return torch.stack([torch.rot90(images, -turn, (1, 2)) for turn in table.turns], dim=-1)


def turned_back(pixels: Tensor, table: RayLines, shape: tuple[int, int]) -> Tensor:
    """Return the transpose of `turned`: the sum over the turns of the images, each turned back."""
    back = [torch.rot90(pixels[..., lane], turn, (1, 2)) for lane, turn in enumerate(table.turns)]
    above, beside = ((have - want) // 2 for have, want in zip(back[0].shape[1:], shape, strict=True))
    return sum(back[1:], back[0])[:, above : above + shape[0], beside : beside + shape[1]]
