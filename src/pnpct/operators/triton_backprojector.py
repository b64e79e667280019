"""Weighted back-projection of filtered fan-beam views on a GPU."""

import torch
from torch import Tensor
from torch.nn.functional import pad

from pnpct.geometry import FanBeam, ImageGrid
from pnpct.operators import triton_kernels as kernels
from pnpct.operators.tiles import tile
from pnpct.operators.triton_projector import block


def back_project_fan(rays: Tensor, grid: ImageGrid, geometry: FanBeam, bins: tuple[float, float]) -> Tensor:
    """Return [slice][row][column]: the sum over the views as `FanBackprojector` defines it.

    Args:
        rays: Filtered float32 rays [slice][view][bin].
        grid: Where the pixels are.
        geometry: Where the rays are.
        bins: Scale and offset from γ on an arc, or tan γ on a flat detector, to the number of the bin.
    """
    size, _ = tile(len(rays), 1)
    down, across = block(size)
    angles = torch.tensor(geometry.view_angles, dtype=torch.float64, device=rays.device)
    images = []
    for some in rays.split(size):
        views = pad(some, (1, 1, 0, 0, 0, size - len(some))).permute(1, 2, 0).contiguous()
        image = rays.new_empty(*grid.shape, size)
        with torch.cuda.device_of(rays):
            kernels.back_project_fan[(-(-grid.cols // across), -(-grid.rows // down))](
                image,
                views,
                angles.cos().float(),
                angles.sin().float(),
                geometry.views,
                float(grid.x[0]),
                float(grid.y[0]),
                grid.spacing,
                geometry.source_to_isocenter,
                geometry.bins,
                *map(float, bins),
                grid.rows,
                grid.cols,
                ARC=geometry.detector == "arc",
                SIZE=size,
                DOWN=down,
                ACROSS=across,
            )
        images.append(image[..., : len(some)].permute(2, 0, 1))
    return torch.cat(images)
