"""A volume as one HTML page: three planes, slice by slice, by NiiVue, which the page holds."""

import base64
import hashlib
import json
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path

import numpy as np
from markupsafe import Markup

from pnpct.arrays import Volume
from pnpct.files import atomic_path, check_window, packed_nifti
from pnpct.geometry import VolumeGrid
from pnpct.report.environment import environment, text_of
from pnpct.report.viewer import PRESETS
from pnpct.units import to_hu

NIIVUE = "0.69.0"
"""Version of NiiVue."""

PLANES = ("Three planes", "Axial", "Coronal", "Sagittal")

_LARGEST = 400_000_000
"""Characters of a page: browsers hold no longer text than about 500 million."""


def write_volume_page(
    path: Path, volumes: Mapping[str, tuple[Volume, VolumeGrid]], *, window: tuple[float, float] = (40.0, 400.0)
) -> None:
    """Write one volume, or two beside each other, as an HTML page that needs nothing else, not even a network.

    Two volumes are scrolled together, by millimetres; their grids may differ. HU are rounded to whole numbers.

    Args:
        path: Where the page shall be, .html.
        volumes: One or two volumes, relative to water, and their slices, by what the page calls them.
        window: Level and width at first, HU.

    Raises:
        OSError: If the page cannot be written.
        ValueError: If there are no or more volumes, they are too large for a page, or the window has no width.
    """
    check_window(window)
    if len(volumes) not in (1, 2):
        raise ValueError(f"A page shows one volume or two, got {len(volumes)}.")
    packed = {
        label: base64.b64encode(packed_nifti(to_hu(volume).numpy().astype(np.float64), grid)).decode("ascii")
        for label, (volume, grid) in volumes.items()
    }
    if (length := sum(map(len, packed.values()))) > _LARGEST:
        raise ValueError(
            f"A page holds up to {_LARGEST / 1e6:.0f} MB of volumes, and this would have {length / 1e6:.0f} MB; show "
            "fewer slices, or larger pixels."
        )
    niivue, script = text_of("niivue.umd.js", "niivue"), text_of("volume.js", "volume_page")
    style_sheet = text_of("volume.css", "volume_page")
    facts = json.dumps({"volumes": list(volumes), "window": window}, separators=(",", ":")).replace("<", "\\u003c")
    page = (
        environment()
        .get_template("volume.html.j2")
        .render(
            volumes=[{"label": label, "text": text} for label, text in packed.items()],
            facts=Markup(facts),
            planes=PLANES,
            presets=PRESETS,
            niivue=Markup(niivue),
            niivue_hash=_hash(niivue),
            niivue_version=NIIVUE,
            script=Markup(script),
            script_hash=_hash(script),
            style_sheet=Markup(style_sheet),
            style_hash=_hash(style_sheet),
            version=version("pnpct"),
        )
    )
    with atomic_path(path) as temporary:
        temporary.write_text(page, encoding="utf-8")


def _hash(text: str) -> str:
    """As a page's policy names what may run and what may style it."""
    return base64.b64encode(hashlib.sha256(text.encode()).digest()).decode("ascii")
