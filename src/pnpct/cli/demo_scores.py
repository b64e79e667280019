"""The images of `pnpct demo` against the truth: a table, its file, and a picture."""

from collections.abc import Mapping
from pathlib import Path

from pnpct.cli.scores import say_scores, write_scores
from pnpct.cli.terminal import working
from pnpct.cli.truth import truth_of
from pnpct.comparison import Detail
from pnpct.evaluation import evaluate
from pnpct.files import Provenance, read_image
from pnpct.report import PanelRow, write_panels

WINDOW = (30.0, 400.0)
"""Level and width of the picture, HU."""


def score_images(
    scan: Path, files: Mapping[str, Path], *, numbers: Path, picture: Path, provenance: Provenance
) -> None:
    """Evaluate images, print and write the numbers, and draw some images beside the truth.

    Args:
        scan: The scan with the truth inside.
        files: The images by name. Of those with names that begin with fbp only the best is drawn.
        numbers: File for the numbers, .json.
        picture: File for the picture, .png.
        provenance: How all this was made.

    Raises:
        OSError: If a file cannot be read or written.
        ValueError: If a file is not what it should be.
    """
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
