"""`pnpct info`: what is in a file."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tyro.conf import Positional

from pnpct.cli.terminal import say, shortened, track
from pnpct.files import SCAN, describe_file, read_scan, read_scan_geometry
from pnpct.geometry import ConeBeam, Coverage, Geometry
from pnpct.physics import unmeasured_and_dead

_VIEWS_AT_ONCE = 500
"""Scans may be larger than the memory."""


@dataclass(frozen=True)
class Info:
    """Describe a scan or an image of pnpct: its content, and how it was made.

    Args:
        file: The file, .h5.
    """

    file: Positional[Path]

    def run(self, command: Sequence[str]) -> None:  # noqa: ARG002 - no file is written that would record it
        """Describe the file."""
        content = describe_file(self.file)
        geometry = read_scan_geometry(self.file) if content["format"] == SCAN else None
        rays = _of_rays(self.file, geometry) if geometry else {}
        say(f"{self.file}: {content['format']}, version {content['format_version']}")
        if content["description"]:
            say(content["description"])
        _say_section("all of it", content["attributes"].pop("/", {}))
        _say_section("made by", {**content["provenance"], "command": " ".join(content["provenance"]["command"])})
        if isinstance(geometry, ConeBeam):
            _say_section("covers", Coverage(geometry).words)
        for name, array in content["arrays"].items():
            shape = " x ".join(map(str, array["shape"])) or "one number"
            _say_section(
                name,
                {
                    "holds": f"{shape}, {array['type']}",
                    "units": array["units"],
                    "is": array["description"],
                    **content["attributes"].pop(name, {}),
                },
            )
        for name, attributes in content["attributes"].items():
            _say_section(name, attributes)
        _say_section("rays", rays)


def _of_rays(file: Path, geometry: Geometry) -> Mapping[str, str]:
    """How many rays of a scan were not measured, and which bins seem to be dead."""
    begins = range(0, geometry.views, _VIEWS_AT_ONCE)
    parts = (
        read_scan(file, views=slice(first, first + _VIEWS_AT_ONCE))
        for first in track(begins, total=len(begins), of="Views")
    )
    missing, dead = unmeasured_and_dead(parts)
    bins = ", ".join(map(str, dead))
    return {
        "not measured": f"{missing} of {math.prod(geometry.shape)}" if missing else "",
        "seem dead": f"bins {bins} count nothing in any view; import them with --mask" if bins else "",
    }


def _say_section(title: str, values: Mapping[str, Any]) -> None:
    lines = [f"  {name}: {shortened(str(value))}" for name, value in values.items() if value not in ("", None, {}, [])]
    if lines:
        say("\n".join(["", title, *lines]))
