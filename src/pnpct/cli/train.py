"""`pnpct train`: from a data set to the weights of a denoiser."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any, Literal

import torch
from torch import nn
from tyro.conf import Positional

from pnpct.cli.artefact import check_output
from pnpct.cli.devices import DeviceName, choose_device
from pnpct.cli.terminal import say, track
from pnpct.cli.training_curves import training_curves
from pnpct.cli.training_setup import examples_of, joined_processes, validate
from pnpct.denoisers import RDNCBAM, REDCNN, SIZES
from pnpct.files import MANIFEST, load_network, network_file, sha256_of
from pnpct.files.checkpoint import save_network
from pnpct.files.training_file import read_training, write_training
from pnpct.training import Epoch, Examples, Pairs, mean_squared_error, train, two_stage


@dataclass(frozen=True)
class Train:
    """Train a denoiser on a data set, in the two stages of the paper or on dose pairs alone.

    After each epoch the state is kept beside the network, in .training; a run that was killed goes on from there.
    Several processes that torchrun has started share each batch.

    Args:
        dataset: Folder that `pnpct simulate dataset` has made.
        network: Where the trained network shall be, .safetensors.
        method: two-stage begins with noise to noise and ends with dose pairs; supervised has dose pairs alone.
        size: Size of the paper's network, or red-cnn.
        begin_with: Network whose weights it begins with, by name or file; those of chance if none is given.
        loop_denoiser: Network that denoises in the loop of ADMM, from which half of the noisy images come; total
            variation of random strength if none is given.
        loop_iterations: Most iterations of that loop.
        epochs: Epochs of noise to noise, or of supervised training.
        fine_tuning_epochs: Epochs of the second stage.
        pairs_per_epoch: Pairs in an epoch, a multiple of the batch.
        batch: Pairs of one step.
        examples: Slices that are scanned and reconstructed, before they come again with other changes.
        kept: Folder that their images are kept in, for this and other trainings; about 5 MB for each of 512 x 512.
        side: Rows and columns of squares that are cut out; whole images if it is not given.
        learning_rate: Of Adam, in the first epoch.
        decay: Factor of the learning rate after each epoch.
        lowest_ma: Lowest tube current of low-dose scans, mA.
        highest_ma: Highest tube current of low-dose scans, mA.
        bfloat16: Compute in bfloat16 where that is exact enough.
        seed: Of the weights and of all pairs.
        tensorboard: Folder for TensorBoard, where it is installed.
        device: Where to compute; auto takes a CUDA device if there is one.
    """

    dataset: Positional[Path]
    network: Positional[Path]
    method: Literal["two-stage", "supervised"] = "two-stage"
    size: Literal["small", "medium", "original", "red-cnn"] = "small"
    begin_with: str | None = None
    loop_denoiser: str | None = None
    loop_iterations: int = 3
    epochs: int = 40
    fine_tuning_epochs: int = 20
    pairs_per_epoch: int = 64
    batch: int = 8
    examples: int = 1000
    kept: Path | None = None
    side: int | None = None
    learning_rate: float = 1e-4
    decay: float = 0.99
    lowest_ma: float = 20.0
    highest_ma: float = 200.0
    bfloat16: bool = False
    seed: int = 0
    tensorboard: Path | None = None
    device: DeviceName = "auto"

    def run(self, command: Sequence[str]) -> None:
        """Train, or go on with training, and write the network."""
        check_output(self.network, (".safetensors",))
        device = choose_device(self.device)
        with joined_processes(device) as rank, training_curves(self.tensorboard if rank == 0 else None) as draw:
            network, settings = self._network().to(device), self._settings()
            kept = self.network.with_suffix(".training")
            state = read_training(kept, settings=settings) if kept.exists() else {}
            after, losses = (Epoch(**state["epoch"]), state["losses"]) if state else (None, [])
            if after is not None:
                network.load_state_dict(after.weights)
            validation = self._examples("validation", device)
            total = self.epochs + (self.fine_tuning_epochs if self.method == "two-stage" else 0)
            for epoch in track(self._epochs(network, after), total=total, of="Training"):
                if rank > 0:
                    continue
                figures = {"loss": epoch.loss, **validate(network, validation)}
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
                say(f"Wrote {self.network}: a network of the size {self.size} after {total} epochs.")

    def _network(self) -> nn.Module:
        if self.begin_with is not None:
            network = load_network(network_file(self.begin_with))
        else:
            torch.manual_seed(self.seed)
            network = REDCNN() if self.size == "red-cnn" else RDNCBAM(SIZES[self.size])
        network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]  # quicker on processors
        return network

    def _settings(self) -> dict[str, Any]:
        """All that the weights depend on."""
        elsewhere = ("dataset", "network", "kept", "tensorboard", "device")
        settings = {key: value for key, value in asdict(self).items() if key not in elsewhere}
        for name in ("begin_with", "loop_denoiser"):
            settings[name] = settings[name] and sha256_of(network_file(settings[name]))
        return {**settings, "data": sha256_of(self.dataset / MANIFEST)}

    def _examples(self, split: Literal["train", "validation"], device: torch.device) -> Examples:
        return examples_of(
            self.dataset,
            split,
            loop_denoiser=self.loop_denoiser,
            loop_iterations=self.loop_iterations,
            bfloat16=self.bfloat16,
            device=device,
            seed=self.seed,
            tube_currents_ma=(self.lowest_ma, self.highest_ma),
            kept=self.kept,
        )

    def _epochs(self, network: nn.Module, after: Epoch | None) -> Iterator[Epoch]:
        device = next(network.parameters()).device
        pairs = partial(Pairs, self._examples("train", device), distinct=self.examples, side=self.side)
        options: dict[str, Any] = {
            "pairs_per_epoch": self.pairs_per_epoch,
            "batch": self.batch,
            # Squares are small; whole images fill the memory of a processor one by one.
            "at_once": 1 if self.side is None and device.type == "cpu" else self.batch,
            "learning_rate": self.learning_rate,
            "decay": self.decay,
            "bfloat16": self.bfloat16,
            "after": after,
        }
        dosed = pairs(kind="dose", seed=self.seed + 1)
        if self.method == "supervised":
            return train(network, dosed, stage="supervised", loss=mean_squared_error, epochs=self.epochs, **options)
        epochs = self.epochs, self.fine_tuning_epochs
        return two_stage(network, pairs(kind="noisy", seed=self.seed), dosed, epochs=epochs, **options)
