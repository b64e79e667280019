"""`pnpct demo`: the other commands in turn."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional

from pnpct.cli.app import run
from pnpct.cli.artefact import NUMBERS, PICTURES, check_output, finish
from pnpct.cli.demo_scores import score_images
from pnpct.cli.parsing import given_options, option
from pnpct.cli.terminal import say
from pnpct.files import record_run

METHODS = {
    "fbp-hann": "--method fbp --kernel hann",
    "fbp-soft": "--method fbp --kernel soft",
    "tv": "--method tv",
    "pnp": "--method pnp",
}


@dataclass(frozen=True)
class Demo:
    """Simulate, reconstruct and evaluate one low-dose slice, in minutes.

    A chest is reconstructed by filtered back-projection with two kernels, by penalised weighted least squares with
    total variation, and by plug-and-play ADMM with the network that was trained in two stages. comparison.png shows the
    truth, the better of the two FBP images, and the others.

    Args:
        folder: Output folder; it is created.
        quick: Take half of the views, detector cells, rows and columns: less than a minute.
        tube_current_ma: Tube current, mA.
        views: Views of the scan.
        size: Rows and columns of the images.
        seed: Seed of the patient and of the noise.
    """

    folder: Positional[Path] = Path("demo")
    quick: bool = False
    tube_current_ma: float = 40.0
    views: Annotated[int | None, option(default="984, or 492 with --quick")] = None
    size: Annotated[int | None, option(default="512, or 256 with --quick")] = None
    seed: int = 0

    def run(self, command: Sequence[str]) -> None:
        """Run the commands, and write numbers and a picture."""
        self.folder.mkdir(exist_ok=True)
        scan, numbers, picture = (self.folder / name for name in ("scan.h5", "metrics.json", "comparison.png"))
        check_output(numbers, NUMBERS)
        check_output(picture, PICTURES)
        usual = {"views": 492, "size": 256, "bins": 450} if self.quick else {"views": 984, "size": 512}
        given = {**usual, **given_options(self, ("views", "size", "tube_current_ma")), "seed": self.seed}
        options = " ".join(f"--{name.replace('_', '-')} {value}" for name, value in given.items())
        _call("simulate scan", scan, options=options)
        files = {name: self.folder / f"{name}.h5" for name in METHODS}
        for name, options in METHODS.items():
            _call("reconstruct", scan, files[name], options=options)
        provenance = record_run(command, inputs=[scan, *files.values()], seed=self.seed)
        score_images(scan, files, numbers=numbers, picture=picture, provenance=provenance)
        finish(numbers, provenance, summary="how far each image is from the truth")
        finish(picture, provenance, summary="the truth, the better FBP image, total variation and plug-and-play")


def _call(command: str, *files: Path, options: str) -> None:
    say(f"\n$ pnpct {command} {' '.join(map(str, files))} {options}")
    run([*command.split(), *map(str, files), *options.split()])
