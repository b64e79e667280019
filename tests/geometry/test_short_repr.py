"""What a notebook prints of a value: a line or a few, whatever it holds."""

import ast
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from torch import nn

import pnpct
from pnpct.geometry import ConeBeam, Detector, FanBeam, ImageGrid, Trajectory, evenly_spaced_views
from pnpct.geometry.short_repr import short_repr
from pnpct.operators import Projector

ARRAYS = re.compile(r"\b(Image|Volume|Rays|ConeRays|Tensor|NDArray|Array|Module)\b")
COMPUTED = {"operators", "reconstruction/moving_spot.py", "simulation/anatomy/folds.py", "simulation/anatomy/room.py"}
"""Tables of kernels and of painting, which nobody is handed."""


@dataclass
class Held:
    value: Any
    __repr__ = short_repr


@pytest.mark.parametrize(
    ("value", "says"),
    [
        (torch.linspace(-2, 5, 12).reshape(3, 4), "float32[3, 4] from -2 to 5"),
        (np.arange(6), "int64[6] from 0 to 5"),
        (torch.zeros(0, 4), "float32[0, 4]"),
        (torch.tensor([1.0, torch.nan]), "float32[2] from nan to nan"),
        (torch.ones(2, dtype=torch.bool), "bool[2]"),
        (nn.Linear(3, 4), "Linear of 16 weights"),
        ([ImageGrid(2, 2, 1.0)] * 9, "9 ImageGrid"),
        (0.1 + 0.2, "0.3"),
        ({"kernel": "soft"}, "{'kernel': 'soft'}"),
        (np.hypot, "hypot"),
    ],
)
def test_an_array_is_its_type_shape_and_range_and_much_is_counted(value, says):
    assert repr(Held(value)) == f"Held(value={says})"


def test_a_geometry_says_views_cells_and_distances():
    fan = FanBeam(evenly_spaced_views(984), 900, 541.0, 949.0, 1.024, detector_offset=0.25)
    assert repr(fan) == (
        "<FanBeam: 984 views from 0° to 359.6°; 900 bins on an arc, cells of 1.024 mm, offset 0.25; focal spot to axis "
        "541 mm, to detector 949 mm; sees 252.6 mm around the axis>"
    )


@pytest.mark.parametrize("direction", [1, -1])
def test_a_helix_says_feed_and_pitch(direction):
    turned = np.linspace(0, 4 * np.pi, 401)
    helix = ConeBeam(
        Trajectory(direction * turned, z=20 * turned / (2 * np.pi), focal_spot_shifts=[(0.1, 0.0, 0.0)] * 401),
        Detector(900, 1.024, rows=32, row_height=1.096),
        541.0,
        949.0,
    )
    assert repr(helix).startswith(
        f"<ConeBeam: 401 views from 0° to {direction * 720}°, "
        "a moving focal spot, z = 0 to 40 mm, 20 mm a turn (pitch 1); "
        "32 rows of 900 bins on an arc, cells of 1.024 x 1.096 mm;"
    )


def test_views_in_any_order_say_so():
    assert repr(Trajectory((0.0, 2.0, 1.0), z=(3.0,) * 3)) == (
        "<Trajectory: 3 views from 0° to 114.6° in any order, z = 3 mm>"
    )


def test_an_operator_says_from_where_to_where():
    A = Projector(ImageGrid(8, 6, 9.0), FanBeam(evenly_spaced_views(5), 7, 541.0, 949.0, 20.0), mu_water=0.02)
    assert repr(A.T) == "<Projector from (8, 6) to (5, 7)>.T"


def test_whatever_holds_arrays_has_a_short_repr():
    root = Path(pnpct.__file__).parent
    missing = []
    for path in root.rglob("*.py"):
        place = path.relative_to(root).as_posix()
        if "@dataclass" not in (text := path.read_text()) or any(place.startswith(each) for each in COMPUTED):
            continue
        for node in ast.parse(text).body:
            if not (isinstance(node, ast.ClassDef) and node.decorator_list) or node.name.startswith("_"):
                continue
            fields = [ast.unparse(each) for each in node.body if isinstance(each, ast.AnnAssign)]
            own = any("__repr__" in ast.unparse(each).partition("\n")[0] for each in node.body)
            if not own and any(ARRAYS.search(each) and not re.search("Callable|repr=False", each) for each in fields):
                missing.append(f"{place}: {node.name}")
    assert missing == []
