"""What the benchmarks time: projector, adjoint and FBP of pnpct and of named peers, each set up as its authors advise.

One scan for all: a full turn, rays and pixels in the proportions of 984 views, 900 bins and 512 x 512 pixels over 500
mm. astra-toolbox has no arc and one thread on a CPU, and no fan-beam FBP there; svmbir takes an arc, keeps its system
matrix on disk (a quarter of an hour to build for 512 x 512) and reads it at each call; torchtomo is flat and licensed
for non-commercial use; deepinv is flat, sums without the length of path in a pixel or the width of a bin, and its FBP,
which has no weights of a fan, is not timed; mbirjax takes an arc as one row of a cone beam, its FBP is FDK. LEAP is not
on PyPI.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, Literal

import numpy as np
import torch

from pnpct.geometry import FanBeam, ImageGrid, evenly_spaced_views
from pnpct.operators import Projector
from pnpct.reconstruction import fbp

SOURCE_TO_ISOCENTER, SOURCE_TO_DETECTOR = 541.0, 949.0

Call = Callable[[], object]
Parts = Mapping[str, Call]


@dataclass(frozen=True)
class World:
    """A scan and the image of it.

    Args:
        size: Rows and columns.
        slices: Images that are treated together.
        field: Width of the image, mm.
        views: Over the full turn; in proportion to the size if None.
        bins: Of the detector; in proportion to the size if None.
    """

    size: int = 512
    slices: int = 1
    field: float = 500.0
    views: int | None = None
    bins: int | None = None

    @property
    def spacing(self) -> float:
        return self.field / self.size

    @property
    def bin_width(self) -> float:
        return 1.0239 * self.field / 500 * 900 / self.geometry_shape[1]

    @property
    def geometry_shape(self) -> tuple[int, int]:
        return self.views or 4 * (246 * self.size // 512), self.bins or 900 * self.size // 512

    @property
    def angles(self) -> np.ndarray:
        return np.linspace(0, 2 * math.pi, self.geometry_shape[0], endpoint=False)

    @cached_property
    def grid(self) -> ImageGrid:
        return ImageGrid(self.size, self.size, spacing=self.spacing)

    def geometry(self, detector: Literal["arc", "flat"] = "arc") -> FanBeam:
        views, bins = self.geometry_shape
        return FanBeam(
            evenly_spaced_views(views),
            bins,
            source_to_isocenter=SOURCE_TO_ISOCENTER,
            source_to_detector=SOURCE_TO_DETECTOR,
            bin_width=self.bin_width,
            detector=detector,
        )

    def random(self) -> tuple[np.ndarray, np.ndarray]:
        """Return an image [slice][row][column] and rays [slice][view][bin] of numbers from 0 to 1."""
        generator = np.random.default_rng(0)
        return (
            generator.random((self.slices, self.size, self.size), np.float32),
            generator.random((self.slices, *self.geometry_shape), np.float32),
        )


@dataclass(frozen=True)
class Contender:
    """A package's way of projecting.

    Args:
        module: What is imported.
        distribution: What is installed.
        make: Makes the parts that are timed: some of "forward", "adjoint" and "fbp".
        remark: What differs from pnpct.
        gigabytes: Memory that it needs in a world of 512 x 512, a slice; it grows with the third power of the size.
    """

    module: str
    distribution: str
    make: Callable[[World], Parts]
    remark: str = ""
    gigabytes: float = 0.1


def pnpct(world: World, method: Any = "distance-driven") -> Parts:
    A = Projector(world.grid, world.geometry(), method=method)
    x, y = map(torch.from_numpy, world.random())
    return {"forward": lambda: A(x), "adjoint": lambda: A.T(y), "fbp": lambda: fbp(y, A)}


def astra(world: World, kind: str) -> Parts:
    import astra as toolbox

    # In pixels, as ASTRA wants them for a volume of unit pixels.
    to_detector = (SOURCE_TO_DETECTOR - SOURCE_TO_ISOCENTER) / world.spacing
    volume = toolbox.create_vol_geom(world.size, world.size)
    bins, width = world.geometry_shape[1], world.bin_width / world.spacing
    at = (world.angles, SOURCE_TO_ISOCENTER / world.spacing, to_detector)
    rays = toolbox.create_proj_geom("fanflat", width, bins, *at)
    operator = toolbox.OpTomo(toolbox.create_projector(kind, rays, volume))
    (x,), (y,) = world.random()
    return {"forward": lambda: operator.FP(x), "adjoint": lambda: operator.BP(y)}


def svmbir_options(world: World, geometry: str) -> dict[str, Any]:
    return {
        "geometry": geometry,
        "dist_source_detector": SOURCE_TO_DETECTOR,
        "magnification": SOURCE_TO_DETECTOR / SOURCE_TO_ISOCENTER,
        "delta_channel": world.bin_width,
        "delta_pixel": world.spacing,
        "roi_radius": world.field / 2,
        "num_threads": torch.get_num_threads(),
        "verbose": 0,
    }


def svmbir(world: World) -> Parts:
    import svmbir as package

    fan, bins = svmbir_options(world, "fan-curved"), world.geometry_shape[1]
    x, y = world.random()
    y, shape = np.ascontiguousarray(y.transpose(1, 0, 2)), {"num_rows": world.size, "num_cols": world.size}
    return {
        "forward": lambda: package.project(x, world.angles, bins, **fan),
        "adjoint": lambda: package.backproject(y, world.angles, **shape, **fan),
    }


def torchtomo(world: World) -> Parts:
    import torchtomo as package

    peer = package.FanBeam(
        img_size=world.size,
        n_angles=world.geometry_shape[0],
        n_det=world.geometry_shape[1],
        src_dist=SOURCE_TO_ISOCENTER / world.spacing,
        det_dist=(SOURCE_TO_DETECTOR - SOURCE_TO_ISOCENTER) / world.spacing,
        det_spacing=world.bin_width / world.spacing,
        backend="torch",
    )
    x, y = (torch.from_numpy(each)[:, None] for each in world.random())
    return {"forward": lambda: peer(x), "adjoint": lambda: peer.adjoint(y), "fbp": lambda: peer.fbp(y)}


def imported_deepinv() -> Any:
    """Import deepinv, beside the torchvision of PyPI too: that is for CUDA, and a PyTorch for CPUs cannot load it.

    Then torchvision lacks its operators and stumbles over two of them, which nothing here uses.
    """
    try:
        import deepinv
    except RuntimeError:
        for name in ("nms", "qnms"):
            torch.library.define(f"torchvision::{name}", "(Tensor boxes, Tensor scores, float threshold) -> Tensor")
        import deepinv
    return deepinv


def deepinv_physics(world: World) -> Any:
    """Its fan beam: the square of the image is [−1, 1] between the middles of the outer pixels."""
    fan = {
        "pixel_spacing": world.spacing * (world.size - 1) / world.size,
        "source_radius": SOURCE_TO_ISOCENTER,
        "detector_radius": SOURCE_TO_DETECTOR - SOURCE_TO_ISOCENTER,
        "n_detector_pixels": world.geometry_shape[1],
        "detector_spacing": world.bin_width,
    }
    options = {"circle": True, "parallel_computation": False, "normalize": False}
    angles = torch.from_numpy(np.degrees(world.angles)).float()
    return imported_deepinv().physics.Tomography(angles, world.size, fan_beam=True, fan_parameters=fan, **options)


def deepinv(world: World) -> Parts:
    physics = deepinv_physics(world)
    x, y = (torch.from_numpy(each)[:, None] for each in world.random())
    y = y.transpose(-1, -2).contiguous()

    @torch.no_grad()
    def forward() -> torch.Tensor:
        return physics.A(x)

    return {"forward": forward, "adjoint": lambda: physics.A_adjoint(y)}


def mbirjax(world: World) -> Parts:
    import mbirjax as package

    views, bins = world.geometry_shape
    distances = (SOURCE_TO_DETECTOR, SOURCE_TO_ISOCENTER)
    model = package.ConeBeamModel((views, 1, bins), world.angles, *distances, use_curved_detector=True)
    model.set_params(
        delta_det_channel=world.bin_width,
        delta_det_row=world.bin_width,
        delta_voxel=world.spacing,
        recon_shape=(world.size, world.size, 1),
        no_warning=True,
    )
    (x,), (y,) = world.random()
    x, y = x[..., None], y[:, None]
    return {
        "forward": lambda: np.asarray(model.forward_project(x)),
        "adjoint": lambda: np.asarray(model.back_project(y)),
        "fbp": lambda: np.asarray(model.direct_recon(y)),
    }


def only(make: Callable[[World], Parts], *parts: str) -> Callable[[World], Parts]:
    return lambda world: {part: call for part, call in make(world).items() if part in parts}


OURS = Contender("pnpct", "pnpct", pnpct)

_TORCHTOMO = Contender("torchtomo", "torchtomo", only(torchtomo, "forward", "adjoint"), "flat", gigabytes=18.0)

PEERS = {
    "astra line_fanflat": Contender("astra", "astra-toolbox", partial(astra, kind="line_fanflat"), "flat, 1 thread"),
    "astra strip_fanflat": Contender("astra", "astra-toolbox", partial(astra, kind="strip_fanflat"), "flat, 1 thread"),
    "svmbir fan-curved": Contender("svmbir", "svmbir", svmbir, "matrix built before, read at each call", gigabytes=4.0),
    "torchtomo": _TORCHTOMO,
    "torchtomo FBP": replace(_TORCHTOMO, make=only(torchtomo, "fbp"), gigabytes=0.4),
    "deepinv": Contender("deepinv", "deepinv", deepinv, "flat, no length of path", gigabytes=9.0),
    "mbirjax": Contender("mbirjax", "mbirjax", mbirjax, "one row of a cone", gigabytes=1.5),
}
"""The peers that can be installed from PyPI; `pip install 'pnpct[peers]'` has them all."""
