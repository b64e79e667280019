"""Procedural patients: regions of the body as solids of tissue, painted slice by slice."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pnpct.simulation.anatomy.abdomen import abdomen_body
from pnpct.simulation.anatomy.chest import chest_body
from pnpct.simulation.anatomy.head import head_body
from pnpct.simulation.anatomy.painted_body import PaintedBody
from pnpct.simulation.anatomy.pelvis import pelvis_body


@dataclass(frozen=True)
class Anatomy:
    """A region of the body for procedural patients.

    Args:
        build: Makes a patient.
        field_of_view: Width of the field of view that covers all of it, mm.
        height: z to look at first, mm.
    """

    build: Callable[[np.random.Generator], PaintedBody]
    field_of_view: float
    height: float = 0.0


ANATOMIES: dict[str, Anatomy] = {
    "abdomen": Anatomy(abdomen_body, 450.0, height=40.0),
    "chest": Anatomy(chest_body, 450.0),
    "head": Anatomy(head_body, 250.0, height=70.0),
    "pelvis": Anatomy(pelvis_body, 450.0),
}
"""The regions of the body, by name."""

__all__ = ["ANATOMIES", "Anatomy", "PaintedBody", "abdomen_body", "chest_body", "head_body", "pelvis_body"]
