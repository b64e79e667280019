"""The state of training on disk, so that a run that was killed can resume."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch

from pnpct.files.atomic import atomic_path
from pnpct.files.errors import FileFormatError, PathLike, existing_file

FORMAT = "pnpct-training"


def write_training(path: PathLike, state: Mapping[str, Any], *, settings: Mapping[str, Any]) -> None:
    """Write the state of training.

    Args:
        path: File to write; an existing one is replaced.
        state: "epoch", the fields of a `pnpct.training.Epoch`, and "losses", a list of figures for each epoch.
        settings: All that the training depends on, in plain values.

    Raises:
        OSError: If the file cannot be written.
    """
    with atomic_path(path) as temporary:
        torch.save({"format": FORMAT, "settings": dict(settings), "state": dict(state)}, temporary)


def read_training(path: PathLike, *, settings: Mapping[str, Any]) -> dict[str, Any]:
    """Read the state of training; nothing in the file is executed.

    Args:
        path: The file.
        settings: What the training depends on now.

    Raises:
        OSError: If there is no such file or it cannot be read.
        FileFormatError: If it is incomplete, or of training with other settings.
    """
    path = Path(existing_file(path))
    try:
        content = torch.load(path, weights_only=True, map_location="cpu")
        made, state = dict(content["settings"]), dict(content["state"])
        whole = _is_whole(state)
    except Exception as error:  # whatever a damaged archive makes of the reader
        raise FileFormatError(f"{path} is not a state of training; remove it to start again.") from error
    if not whole:
        raise FileFormatError(f"{path} is not a state of training; remove it to start again.")
    if made != dict(settings):
        differing = ", ".join(sorted(key for key in settings if made.get(key) != settings[key]))
        raise FileFormatError(f"{path} is of training with other settings ({differing}); remove it to start again.")
    return state


def _is_whole(state: Mapping[str, Any]) -> bool:
    epoch, losses = state["epoch"], state["losses"]
    return (
        set(epoch) == {"stage", "number", "loss", "weights", "latest", "optimizer"}
        and isinstance(epoch["stage"], str)
        and type(epoch["number"]) is int
        and epoch["number"] >= 1
        and isinstance(epoch["loss"], float)
        and all(isinstance(value, torch.Tensor) for of in ("weights", "latest") for value in epoch[of].values())
        and isinstance(epoch["optimizer"], dict)
        and isinstance(losses, list)
        and all(isinstance(figures, dict) for figures in losses)
    )
