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
from pnpct.cli.terminal import say, track
from pnpct.cli.training_images import data_step_image, fbp_image
from pnpct.denoisers import RDNCBAM, REDCNN, SIZES
from pnpct.files import MANIFEST, read_manifest, sha256_of
from pnpct.files.checkpoint import save_network
from pnpct.files.training_file import read_training, write_training
from pnpct.training import Epoch, Pairs, mean_squared_error, train, two_stage


@dataclass(frozen=True)
class Train:
    """Train a denoiser on a data set, in the two stages of the paper or on dose pairs alone.

    After each epoch the state is kept beside the network, in .training; a run that was killed goes on from there.

    Args:
        dataset: Folder that `pnpct simulate dataset` has made.
        network: Where the trained network shall be, .safetensors.
        method: two-stage begins with noise to noise and ends with dose pairs; supervised has dose pairs alone.
        size: Size of the paper's network, or red-cnn.
        epochs: Epochs of noise to noise, or of supervised training.
        fine_tuning_epochs: Epochs of the second stage.
        pairs_per_epoch: Pairs in an epoch, a multiple of the batch.
        batch: Pairs of one step.
        learning_rate: Of Adam, in the first epoch.
        decay: Factor of the learning rate after each epoch.
        lowest_ma: Lowest tube current of low-dose scans, mA.
        highest_ma: Highest tube current of low-dose scans, mA.
        bfloat16: Compute in bfloat16 where that is exact enough.
        seed: Of the weights and of all pairs.
    """

    dataset: Positional[Path]
    network: Positional[Path]
    method: Literal["two-stage", "supervised"] = "two-stage"
    size: Literal["small", "medium", "original", "red-cnn"] = "small"
    epochs: int = 40
    fine_tuning_epochs: int = 20
    pairs_per_epoch: int = 64
    batch: int = 8
    learning_rate: float = 1e-4
    decay: float = 0.99
    lowest_ma: float = 20.0
    highest_ma: float = 200.0
    bfloat16: bool = False
    seed: int = 0

    def run(self, command: Sequence[str]) -> None:
        """Train, or go on with training, and write the network."""
        check_output(self.network, (".safetensors",))
        manifest = self.dataset / MANIFEST
        settings = {key: value for key, value in asdict(self).items() if key not in ("dataset", "network")}
        settings["data"] = sha256_of(manifest)
        torch.manual_seed(self.seed)
        network = REDCNN() if self.size == "red-cnn" else RDNCBAM(SIZES[self.size])
        kept = self.network.with_suffix(".training")
        state = read_training(kept, settings=settings) if kept.exists() else {}
        after, losses = (Epoch(**state["epoch"]), state["losses"]) if state else (None, [])
        if after is not None:
            network.load_state_dict(after.weights)
        total = self.epochs + (self.fine_tuning_epochs if self.method == "two-stage" else 0)
        for epoch in track(self._epochs(network, after), total=total, of="Training"):
            losses = [*losses, epoch.loss]
            write_training(kept, {"epoch": vars(epoch), "losses": losses}, settings=settings)
            say(f"{epoch.stage} {epoch.number}: loss {epoch.loss:.6f}")
        about = {
            "manifest_sha256": settings["data"],
            "seed": self.seed,
            "metrics": {"losses": losses},
            "licence": "Apache-2.0",
            "command": list(command),
        }
        save_network(self.network, network, about=about)
        say(f"Wrote {self.network}: a network of the size {self.size} after {total} epochs.")

    def _epochs(self, network: nn.Module, after: Epoch | None) -> Iterator[Epoch]:
        files = [self.dataset / name for name in read_manifest(self.dataset).files("train")]
        currents = (self.lowest_ma, self.highest_ma)
        images = (fbp_image, data_step_image)
        pairs = partial(Pairs, files, images, tube_currents_ma=currents)
        options: dict[str, Any] = {
            "pairs_per_epoch": self.pairs_per_epoch,
            "batch": self.batch,
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
