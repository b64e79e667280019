"""`pnpct demo`: the other commands in turn."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional

from pnpct.cli.app import run
from pnpct.cli.artefact import NUMBERS, PICTURES, check_output, finish
from pnpct.cli.image_input import truth_of
from pnpct.cli.parsing import given_options, option
from pnpct.cli.scores import say_scores, write_scores
from pnpct.cli.terminal import say, working
from pnpct.comparison import Detail
from pnpct.evaluation import evaluate
from pnpct.files import Provenance, read_image, record_run
from pnpct.geometry import DEFAULT_SIZE
from pnpct.report import PanelRow, write_panels
from pnpct.simulation import BINS, TUBE_CURRENT_MA, VIEWS

METHODS = {
    "fbp-hann": "--method fbp --kernel hann",
    "fbp-soft": "--method fbp --kernel soft",
    "tv": "--method tv",
    "pnp": "--method pnp",
}

WINDOW = (30.0, 400.0)
"""Level and width of the picture, HU."""

_USUAL = {"views": VIEWS, "size": DEFAULT_SIZE, "bins": BINS}


@dataclass(frozen=True)
class Demo:
    """Simulate, reconstruct and evaluate one low-dose slice, in minutes.

    A chest is reconstructed by filtered back-projection with two kernels, by penalised weighted least squares with
    total variation, and by plug-and-play ADMM with the two-stage network. comparison.png shows the truth beside the
    better of the two FBP images and the other two.

    Args:
        folder: Output folder; it is created if need be.
        quick: Half as many views, detector cells, rows and columns: takes less than a minute.
        tube_current_ma: Tube current, mA.
        views: Views of the scan.
        size: Rows and columns of the images.
        seed: Random seed of the patient and of the noise.
    """

    folder: Positional[Path] = Path("demo")
    quick: bool = False
    tube_current_ma: float = TUBE_CURRENT_MA
    views: Annotated[int | None, option(default=f"{VIEWS}, or {VIEWS // 2} with --quick")] = None
    size: Annotated[int | None, option(default=f"{DEFAULT_SIZE}, or {DEFAULT_SIZE // 2} with --quick")] = None
    seed: int = 0

    def run(self, command: Sequence[str]) -> None:
        """Run the commands, and write numbers and a picture."""
        self.folder.mkdir(exist_ok=True)
        scan, numbers, picture = (self.folder / name for name in ("scan.h5", "metrics.json", "comparison.png"))
        check_output(numbers, NUMBERS)
        check_output(picture, PICTURES)
        usual = {name: number // 2 if self.quick else number for name, number in _USUAL.items()}
        given = {**usual, **given_options(self, ("views", "size", "tube_current_ma")), "seed": self.seed}
        options = " ".join(f"--{name.replace('_', '-')} {value}" for name, value in given.items())
        _call("simulate scan", scan, options=options)
        files = {name: self.folder / f"{name}.h5" for name in METHODS}
        for name, options in METHODS.items():
            _call("reconstruct", scan, files[name], options=options)
        provenance = record_run(command, inputs=[scan, *files.values()], seed=self.seed)
        _score(scan, files, numbers=numbers, picture=picture, provenance=provenance)
        finish(numbers, provenance, summary="how far each image is from the truth")
        finish(picture, provenance, summary="the truth, the better FBP image, total variation and plug-and-play")


def _call(command: str, *files: Path, options: str) -> None:
    say(f"\n$ pnpct {command} {' '.join(map(str, files))} {options}")
    run([*command.split(), *map(str, files), *options.split()])


def _score(scan: Path, files: Mapping[str, Path], *, numbers: Path, picture: Path, provenance: Provenance) -> None:
    """Evaluate the images, write the numbers, and draw the truth, the best FBP image and the others."""
    truth, _ = truth_of(scan)
    images = {name: read_image(file)[0] for name, file in files.items()}
    with working("Measuring"):
        scores = {name: evaluate(image, truth) for name, image in images.items()}
    say_scores(scores)
    write_scores(numbers, scores)
    errors = {name: values["soft_tissue_rmse_hu"] for name, values in scores.items()}
    best_fbp = min((name for name in errors if name.startswith("fbp")), key=errors.__getitem__)
    shown = [best_fbp, *(name for name in errors if not name.startswith("fbp"))]
    titles = {f"{name}: {errors[name]:.1f} HU RMS error in soft tissue": images[name] for name in shown}
    third = len(truth) // 3
    row = PanelRow("", {"truth": truth, **titles}, [Detail(third, third, len(truth) - 2 * third)])
    write_panels(picture, [row], provenance=provenance, window=WINDOW)
