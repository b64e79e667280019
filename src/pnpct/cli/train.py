"""`pnpct train`: from a data set, or from one scan, to the weights of a denoiser."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import torch
from torch import nn
from tyro.conf import Positional

from pnpct.cli.artefact import check_output
from pnpct.cli.devices import DeviceName, choose_device
from pnpct.cli.terminal import say, track
from pnpct.cli.training_curves import training_curves
from pnpct.cli.training_options import TrainingOptions
from pnpct.cli.training_setup import joined_processes
from pnpct.denoisers import RDNCBAM, REDCNN, SIZES
from pnpct.files import load_network, network_file, sha256_of
from pnpct.files.checkpoint import save_network
from pnpct.files.training_file import read_training, write_training
from pnpct.training import Epoch


@dataclass(frozen=True)
class Train(TrainingOptions):
    """Train a denoiser on a data set, in the two stages of the paper or on dose pairs alone, or on a single scan.

    After each epoch the state is kept beside the network, in .training; a run that was killed goes on from there.
    Several processes that torchrun has started share each batch.

    Args:
        data: Folder that `pnpct simulate dataset` has made; for the method single-scan, the scan, .h5.
        network: Where the trained network shall be, .safetensors.
        size: Size of the paper's network, or red-cnn.
        begin_with: Network whose weights it begins with, by name or file; those of chance if none is given.
        epochs: Epochs of noise to noise, or of the only stage.
        pairs_per_epoch: Pairs in an epoch, a multiple of the batch.
        batch: Pairs of one step.
        side: Rows and columns of squares that are cut out; whole images if it is not given.
        learning_rate: Of Adam, in the first epoch.
        decay: Factor of the learning rate after each epoch.
        bfloat16: Compute in bfloat16 where that is exact enough.
        seed: Of the weights and of all pairs.
        tensorboard: Folder for TensorBoard, where it is installed.
        device: Where to compute; auto takes a CUDA device if there is one.
    """

    data: Positional[Path]
    network: Positional[Path]
    size: Literal["small", "medium", "original", "red-cnn"] = "small"
    begin_with: str | None = None
    epochs: int = 40
    pairs_per_epoch: int = 64
    batch: int = 8
    side: int | None = None
    learning_rate: float = 1e-4
    decay: float = 0.99
    bfloat16: bool = False
    seed: int = 0
    tensorboard: Path | None = None
    device: DeviceName = "auto"

    def run(self, command: Sequence[str]) -> None:
        """Train, or go on with training, and write the network."""
        check_output(self.network, (".safetensors",))
        method, device = self.chosen_method(), choose_device(self.device)
        with joined_processes(device) as rank, training_curves(self.tensorboard if rank == 0 else None) as draw:
            network = self._network().to(device)
            settings = {**self._settings(), **method.settings(), "data": method.digest(self.data)}
            kept = self.network.with_suffix(".training")
            state = read_training(kept, settings=settings) if kept.exists() else {}
            after, losses = (Epoch(**state["epoch"]), state["losses"]) if state else (None, [])
            if after is not None:
                network.load_state_dict(after.weights)
            shared: dict[str, Any] = {"seed": self.seed, "side": self.side, "bfloat16": self.bfloat16, "device": device}
            lesson = method.lesson(self.data, epochs=self.epochs, **shared)
            epochs = lesson.epochs(network, after=after, **self._steps(device))
            for epoch in track(epochs, total=lesson.total, of="Training"):
                if rank > 0:
                    continue
                figures = {"loss": epoch.loss, **lesson.validate(network)}
                losses = [*losses, {"stage": epoch.stage, "epoch": epoch.number, **figures}]
                write_training(kept, {"epoch": vars(epoch), "losses": losses}, settings=settings)
                draw(epoch.stage, len(losses), figures)
                say(f"{epoch.stage} {epoch.number}: " + ", ".join(f"{name} {figures[name]:.4g}" for name in figures))
            if rank == 0:
                about = {
                    "manifest_sha256": settings["data"],
                    "seed": self.seed,
                    "metrics": {"losses": losses},
                    "licence": "Apache-2.0",
                    "command": list(command),
                }
                save_network(self.network, network.cpu(), about=about)
                say(f"Wrote {self.network}: a network of the size {self.size} after {lesson.total} epochs.")

    def _network(self) -> nn.Module:
        if self.begin_with is not None:
            network = load_network(network_file(self.begin_with))
        else:
            torch.manual_seed(self.seed)
            network = REDCNN() if self.size == "red-cnn" else RDNCBAM(SIZES[self.size])
        network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]  # quicker on processors
        return network

    def _settings(self) -> dict[str, Any]:
        """All that the weights depend on, besides the options of the method and its data."""
        names = ["method", "size", "epochs", "pairs_per_epoch", "batch", "side"]
        names += ["learning_rate", "decay", "bfloat16", "seed"]
        begin_with = self.begin_with and sha256_of(network_file(self.begin_with))
        return {**{name: getattr(self, name) for name in names}, "begin_with": begin_with}

    def _steps(self, device: torch.device) -> dict[str, Any]:
        names = ("pairs_per_epoch", "batch", "learning_rate", "decay", "bfloat16")
        # Squares are small; whole images fill the memory of a processor one by one.
        at_once = 1 if self.side is None and device.type == "cpu" else self.batch
        return {**{name: getattr(self, name) for name in names}, "at_once": at_once}
