"""Linear operators: the projectors with their exact adjoints, and the two steps of filtered back-projection."""

from typing import TypeAlias

from pnpct.operators.cone.cone_backprojector import ConeBackprojector
from pnpct.operators.cone.cone_projector import ConeProjector
from pnpct.operators.fan_backprojector import FanBackprojector
from pnpct.operators.linear_operator import LinearOperator
from pnpct.operators.projector import Projector
from pnpct.operators.ramp_filter import Kernel, ramp_filter
from pnpct.operators.ray_lines import Method

AnyProjector: TypeAlias = Projector | ConeProjector
"""Of a fan beam and an image, or of a cone beam and a volume."""

__all__ = [
    "AnyProjector",
    "ConeBackprojector",
    "ConeProjector",
    "FanBackprojector",
    "Kernel",
    "LinearOperator",
    "Method",
    "Projector",
    "ramp_filter",
]
