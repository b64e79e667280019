"""`pnpct train`: from a data set, one scan, or images of patients, to the weights of a denoiser."""

import json
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias

import torch
from torch import nn
from tyro.conf import Positional

from pnpct.cli.artefact import check_output
from pnpct.cli.devices import DeviceName, choose_device
from pnpct.cli.grids import grid_for
from pnpct.cli.parsing import option
from pnpct.cli.seeds import check_seed
from pnpct.cli.terminal import say, track, working
from pnpct.cli.training_options import TrainingOptions
from pnpct.denoisers import RDNCBAM, REDCNN, SIZES
from pnpct.files import (
    MANIFEST,
    is_import_path,
    network_file,
    read_network,
    read_scan,
    save_network,
    sha256_of,
    sole_writer,
)
from pnpct.files.checkpoint import SUFFIX
from pnpct.files.training_file import read_training, write_training
from pnpct.training import (
    Epoch,
    NeighbouringSlices,
    SingleScan,
    Supervised,
    ThroughLoop,
    TrainingPlan,
    from_first,
    joined_processes,
    training_curves,
)

Method: TypeAlias = Supervised | ThroughLoop | SingleScan | NeighbouringSlices


@dataclass(frozen=True)
class Train(TrainingOptions):
    """Train a denoiser on a simulated data set, on a single scan, or on images of your own patients.

    On a data set it is trained in the two stages of the paper, or on dose pairs alone. After each epoch the state is
    saved beside the network, in .training; a run that was killed resumes from there. Several processes started by
    torchrun share each batch.

    Args:
        data: Folder of a data set made by `pnpct simulate dataset`; for single-scan, a scan (.h5); for image-pairs and
            neighbouring-slices, a folder with one folder per patient.
        network: File for the trained network, .safetensors.
        size: Size of the paper's network, or red-cnn; not with --begin-with, which has its own.
        noise_input: Make the network noise-conditioned: it is given the noise of FBP with the sharpest kernel
            (ram-lak), HU.
        begin_with: Network to start from, by name or file, or one of your own as my_package.module:name.
        licence: Licence of the network, recorded beside it.
        tensorboard: Folder for TensorBoard logs, if TensorBoard is installed.
        device: Where to compute; auto uses a CUDA device if there is one.
    """

    data: Positional[Path]
    network: Positional[Path]
    size: Annotated[Literal["small", "medium", "original", "red-cnn"] | None, option(default="small")] = None
    noise_input: bool = False
    begin_with: Annotated[str | None, option(default="one of the paper's with random weights")] = None
    licence: Annotated[str | None, option(default="none")] = None
    tensorboard: Path | None = None
    device: DeviceName = "auto"

    def run(self, command: Sequence[str]) -> None:
        """Train, or resume training, and write the network."""
        method, device, state_file = self.chosen_method(), choose_device(self.device), self._checked()
        with (
            joined_processes(device) as rank,
            sole_writer(self.network) if rank == 0 else nullcontext(),
            training_curves(self.tensorboard if rank == 0 else None) as draw,
        ):
            network = self._network().to(device)
            settings = {**method.settings(), **self._settings(method)}
            state = from_first(lambda: read_training(state_file, settings=settings) if state_file.exists() else {})
            after, losses = (Epoch(**state["epoch"]), state["losses"]) if state else (None, [])
            plan = self._plan(method, network)
            for epoch in track(plan.epochs(after=after), total=plan.total, of="Training"):
                if rank > 0:
                    continue
                figures = {"loss": epoch.loss, **plan.validate()}
                losses = [*losses, {"stage": epoch.stage, "epoch": epoch.number, **figures}]
                write_training(state_file, {"epoch": vars(epoch), "losses": losses}, settings=settings)
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
                    "finest_pixel_mm": plan.finest_pixel,
                }
                save_network(self.network, network.cpu(), about=about)
                say(f"Wrote {self.network}: a network after {plan.total} epochs.")

    def _checked(self) -> Path:
        """Check what can be checked before the work; return where the state of training is written."""
        check_seed(self.seed)
        if self.begin_with is not None and (self.size is not None or self.noise_input):
            option = "--noise-input" if self.noise_input else "--size"
            raise ValueError(f"{option} has no effect beside --begin-with, which gives the network; leave out one.")
        if self.noise_input and self.size == "red-cnn":
            raise ValueError("--noise-input has no effect on red-cnn, which has no such input; leave it out.")
        if self.network.suffix != SUFFIX:
            raise ValueError(f"{self.network}: the name of a network must end in {SUFFIX}.")
        named = [name for name in (self.begin_with, self.loop_denoiser) if name is not None]
        begun_with = [network_file(name) for name in named if not is_import_path(name)]
        check_output(self.network, (SUFFIX,), inputs=[self.data, *begun_with])
        state_file = self.network.with_suffix(".training")
        if state_file.is_dir():
            raise IsADirectoryError(f"{state_file} is a folder, but the state of training is written there.")
        return state_file

    def _network(self) -> nn.Module:
        torch.manual_seed(self.seed)
        if self.begin_with is not None:
            network, _ = read_network(self.begin_with)
        else:
            size = self.size or "small"
            network = REDCNN() if size == "red-cnn" else RDNCBAM(SIZES[size], noise_input=self.noise_input)
        network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]  # faster on CPUs
        return network

    def _settings(self, method: Method) -> dict[str, Any]:
        """All that the weights depend on besides the options of the method."""
        begin_with = self.begin_with
        if begin_with and not is_import_path(begin_with):
            begin_with = sha256_of(network_file(begin_with))
        size = None if begin_with else self.size or "small"
        network = {"size": size, "noise_input": self.noise_input, "begin_with": begin_with}
        return {"method": self.method, **network, **self._fingerprints(method)}

    def _fingerprints(self, method: Method) -> dict[str, Any]:
        """What the data are: of a folder of patients the SHA-256 of each, those of all, and who is held out."""
        if not isinstance(method, NeighbouringSlices):
            return {"data": self._fingerprint(method)}
        if not self.data.is_dir():
            raise ValueError(
                f"{self.data} is no folder; --method {self.method} needs one with a folder for each patient."
            )
        with working("Reading"):
            patients = method.fingerprints(self.data)
        return {"data": sha256(json.dumps(patients).encode()).hexdigest(), "patients": patients}

    def _fingerprint(self, method: Supervised | ThroughLoop | SingleScan) -> str:
        """The SHA-256 of the data set's manifest, or of the scan."""
        if isinstance(method, SingleScan):
            if self.data.is_dir():
                raise ValueError(f"{self.data} is a folder, but --method single-scan needs the file of a scan.")
            return sha256_of(self.data)
        if self.data.is_file():
            raise ValueError(
                f"{self.data} is a file, but a data set's folder is needed; --method single-scan learns from a scan."
            )
        if self.data.is_dir() and not (self.data / MANIFEST).exists():
            raise ValueError(f"{self.data} holds no data set; make one by pnpct simulate dataset.")
        return sha256_of(self.data / MANIFEST)

    def _plan(self, method: Method, network: nn.Module) -> TrainingPlan:
        if isinstance(method, NeighbouringSlices):
            with working("Reading"):
                return method.plan(network, self.data)
        if not isinstance(method, SingleScan):
            return method.plan(network, self.data)
        scan = read_scan(self.data)
        grid = grid_for(self.data, scan.geometry, size=None, field_of_view=None)
        with working("Reconstructing the parts of the scan"):
            return method.plan(network, scan, grid)
