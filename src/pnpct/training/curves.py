"""The curves of a training in TensorBoard, if asked for."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

Draw = Callable[[str, int, Mapping[str, float]], None]
"""From a stage, the number of epochs done and its figures to points in the curves."""


@contextmanager
def training_curves(folder: Path | None) -> Iterator[Draw]:
    """Yield what draws an epoch's figures; it draws nothing without a folder.

    Raises:
        ValueError: If TensorBoard is asked for and not installed.
    """
    if folder is None:
        yield lambda *_: None
        return
    try:
        from torch.utils.tensorboard import SummaryWriter
    except ImportError as error:
        raise ValueError("Curves of training need the package tensorboard: pip install tensorboard.") from error
    with SummaryWriter(str(folder)) as writer:

        def draw(stage: str, epochs: int, figures: Mapping[str, float]) -> None:
            for name, value in figures.items():
                writer.add_scalar(f"{stage}/{name}", value, epochs)

        yield draw
