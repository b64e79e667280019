"""`pnpct train`: from a data set, or from one scan, to the weights of a denoiser."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import torch
from torch import nn
from tyro.conf import Positional

from pnpct.cli.artefact import check_output
from pnpct.cli.devices import DeviceName, choose_device
from pnpct.cli.parsing import option
from pnpct.cli.seeds import check_seed
from pnpct.cli.terminal import say, track
from pnpct.cli.training_curves import training_curves
from pnpct.cli.training_options import TrainingOptions
from pnpct.cli.training_setup import from_first, joined_processes
from pnpct.denoisers import RDNCBAM, REDCNN, SIZES
from pnpct.files import load_network, network_file, sha256_of
from pnpct.files.checkpoint import SUFFIX, save_network
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
        size: Size of the paper's network, or red-cnn; that of --begin-with is its own.
        noise_input: Make a network that is told the noise level, HU of an FBP image with the sharpest kernel.
        begin_with: Network whose weights it begins with, by name or file; those of chance if none is given.
        epochs: Epochs of noise to noise, or of the only stage.
        pairs_per_epoch: Pairs in an epoch, a multiple of the batch.
        batch: Pairs of one step.
        side: Rows and columns of squares that are cut out; whole images if it is not given.
        learning_rate: Of Adam, in the first epoch.
        decay: Factor of the learning rate after each epoch.
        at_once: Pairs that go through the network together: quicker, but all their memory at once.
        bfloat16: Compute in bfloat16 where that is exact enough.
        seed: Of the weights and of all pairs.
        licence: Under which the network may be used, to be noted beside it.
        tensorboard: Folder for TensorBoard, where it is installed.
        device: Where to compute; auto takes a CUDA device if there is one.
    """

    data: Positional[Path]
    network: Positional[Path]
    size: Annotated[Literal["small", "medium", "original", "red-cnn"] | None, option(default="small")] = None
    noise_input: bool = False
    begin_with: str | None = None
    epochs: int = 40
    pairs_per_epoch: int = 64
    batch: int = 8
    side: int | None = None
    learning_rate: float = 1e-4
    decay: float = 0.99
    at_once: Annotated[int | None, option(default="1 for whole images, else all of a batch")] = None
    bfloat16: bool = False
    seed: int = 0
    licence: str | None = None
    tensorboard: Path | None = None
    device: DeviceName = "auto"

    def run(self, command: Sequence[str]) -> None:
        """Train, or go on with training, and write the network."""
        method, device = self.chosen_method(), choose_device(self.device)
        kept = self._checked()
        with joined_processes(device) as rank, training_curves(self.tensorboard if rank == 0 else None) as draw:
            network = self._network().to(device)
            settings = {**self._settings(), **method.settings(), "data": method.digest(self.data)}
            state = from_first(lambda: read_training(kept, settings=settings) if kept.exists() else {})
            after, losses = (Epoch(**state["epoch"]), state["losses"]) if state else (None, [])
            shared: dict[str, Any] = {"seed": self.seed, "side": self.side, "bfloat16": self.bfloat16, "device": device}
            lesson = method.lesson(self.data, epochs=self.epochs, **shared)
            epochs = lesson.epochs(network, after=after, **self._steps())
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
                    "licence": self.licence,
                    "command": list(command),
                    "settings": settings,
                }
                save_network(self.network, network.cpu(), about=about)
                say(f"Wrote {self.network}: a network after {lesson.total} epochs.")

    def _checked(self) -> Path:
        """Check what can be checked before the work; return where the state of training is kept."""
        check_seed(self.seed)
        if self.begin_with is not None and (self.size is not None or self.noise_input):
            option = "--noise-input" if self.noise_input else "--size"
            raise ValueError(f"{option} has no effect beside --begin-with, whose network is as it is; leave out one.")
        if self.noise_input and self.size == "red-cnn":
            raise ValueError("--noise-input has no effect on red-cnn, which has no such input; leave it out.")
        if self.noise_input and self.method == "single-scan":
            raise ValueError(
                "--noise-input needs pairs that say how noisy they are, as a single scan does not; leave it out."
            )
        if self.network.suffix != SUFFIX:
            raise ValueError(f"{self.network}: the name of a network must end in {SUFFIX}.")
        begun_with = [network_file(name) for name in (self.begin_with, self.loop_denoiser) if name is not None]
        check_output(self.network, (SUFFIX,), inputs=[self.data, *begun_with])
        kept = self.network.with_suffix(".training")
        if kept.is_dir():
            raise IsADirectoryError(f"{kept} is a folder, but the state of training is to be kept there.")
        return kept

    def _network(self) -> nn.Module:
        if self.begin_with is not None:
            network = load_network(network_file(self.begin_with))
        else:
            torch.manual_seed(self.seed)
            size = self.size or "small"
            network = REDCNN() if size == "red-cnn" else RDNCBAM(SIZES[size], noise_input=self.noise_input)
        network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]  # quicker on processors
        return network

    def _settings(self) -> dict[str, Any]:
        """All that the weights depend on beyond rounding, besides the options of the method and its data."""
        names = ["method", "epochs", "pairs_per_epoch", "batch", "side", "learning_rate", "decay", "bfloat16", "seed"]
        begin_with = self.begin_with and sha256_of(network_file(self.begin_with))
        size = None if begin_with else self.size or "small"
        network = {"size": size, "noise_input": self.noise_input, "begin_with": begin_with}
        return {**{name: getattr(self, name) for name in names}, **network}

    def _steps(self) -> dict[str, Any]:
        names = ("pairs_per_epoch", "batch", "learning_rate", "decay", "bfloat16")
        # Squares are small; whole images fill the memory one by one.
        at_once = (1 if self.side is None else self.batch) if self.at_once is None else self.at_once
        return {**{name: getattr(self, name) for name in names}, "at_once": at_once}
