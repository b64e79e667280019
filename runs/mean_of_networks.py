"""Write the network whose parameters are the means of those of others: python runs/mean_of_networks.py OUT IN IN ...

The networks have one size, and were trained from the same beginning: then their mean does what they have in common, and
less of what each has learnt of its own examples by heart (Wortsman et al., ICML 2022, "Model soups"). Beside it stands
what is known about each of them; the data are those of the last.
"""

import json
import sys
from pathlib import Path

import torch

from pnpct.files import load_network, sha256_of
from pnpct.files.checkpoint import save_network


def main() -> None:
    """Read the networks, and write their mean."""
    out, *paths = sys.argv[1:]
    if len(paths) < 2:
        sys.exit("Give the file to be written, and those of at least two networks.")
    networks = [load_network(path) for path in paths]
    parameters = [network.state_dict() for network in networks]
    networks[0].load_state_dict(
        {name: torch.stack([each[name] for each in parameters]).mean(0) for name in parameters[0]}
    )
    said = [json.loads(Path(f"{path}.json").read_text(encoding="utf-8"))["about"] for path in paths]
    (licence,) = {about["licence"] for about in said}
    about = {
        "command": ["python", "runs/mean_of_networks.py", out, *paths],
        "finest_pixel_mm": max(about.get("finest_pixel_mm") or 0.0 for about in said) or None,  # known to all of them
        "licence": licence,
        "manifest_sha256": said[-1]["manifest_sha256"],
        "metrics": None,
        "seed": None,
        "mean_of": [{"sha256": sha256_of(path), **about} for path, about in zip(paths, said, strict=True)],
    }
    save_network(out, networks[0], about=about)


if __name__ == "__main__":
    main()
