"""`pnpct info`: what is in a file."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tyro.conf import Positional

from pnpct.cli.coverage import in_words
from pnpct.cli.terminal import say, shortened
from pnpct.files import SCAN, describe_file, read_scan, read_scan_geometry
from pnpct.geometry import ConeBeam
from pnpct.physics import dead_cells


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
        rays = _of_rays(self.file) if content["format"] == "pnpct-scan" else None
        say(f"{self.file}: {content['format']}, version {content['format_version']}")
        if content["description"]:
            say(content["description"])
        _say_section("all of it", content["attributes"].pop("/", {}))
        _say_section("made by", {**content["provenance"], "command": " ".join(content["provenance"]["command"])})
        if content["format"] == SCAN and isinstance(geometry := read_scan_geometry(self.file), ConeBeam):
            _say_section("covers", in_words(geometry))
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
        if rays is not None:
            _say_section("rays", rays)


def _of_rays(file: Path) -> Mapping[str, str]:
    """How many rays of a scan were not measured, and which cells seem to be dead."""
    scan = read_scan(file)
    measured = scan.measured.expand(scan.geometry.shape)
    missing = int((~measured).sum())
    dead = [str(cell) for cell in dead_cells(scan.counts.numpy(), measured.numpy(), scan.electronic_noise)]
    return {
        "not measured": f"{missing} of {measured.numel()}" if missing else "",
        "seem dead": f"bins {', '.join(dead)} count nothing in any view; import them with --mask" if dead else "",
    }


def _say_section(title: str, values: Mapping[str, Any]) -> None:
    lines = [f"  {name}: {shortened(str(value))}" for name, value in values.items() if value not in ("", None, {}, [])]
    if lines:
        say("\n".join(["", title, *lines]))
