"""What every method of training has: a schedule, and the plan that it makes."""

from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from typing import Any

from pnpct.training.schedule import BATCH, LEARNING_RATE
from pnpct.training.two_stage import Epoch


@dataclass(frozen=True, eq=False)
class TrainingPlan:
    """The training of one network, ready to begin.

    Args:
        epochs: From the epoch to continue `after`, if any, to those that follow; the weights of the network change.
        total: How many epochs there are.
        validate: Returns how far the network is from references now, HU, for inputs of FBP and of the loop, and images
            around it from the truth if that is asked for; nothing where no reference is known.
        finest_pixel: Smallest pixels of the images that it learns from, mm; None where that is not known.
    """

    epochs: Callable[..., Iterator[Epoch]]
    total: int
    validate: Callable[[], dict[str, float]]
    finest_pixel: float | None = None


@dataclass(frozen=True, kw_only=True)
class Schedule:
    """The schedule of training, for every method.

    Args:
        epochs: Epochs of Noise2Noise, or of the only stage.
        pairs_per_epoch: Pairs in an epoch, a multiple of the batch size.
        batch: Batch size, pairs per optimizer step.
        side: Rows and columns of the patches; None takes whole images.
        learning_rate: Highest learning rate of AdamW; it rises to that, then falls to zero.
        micro_batch: Pairs that pass through the network together; None takes one whole image, or all patches of a
            batch.
        bfloat16: Whether networks compute in bfloat16 where that is accurate enough.
        seed: Seed of all pairs and examples.
    """

    epochs: int = 40
    pairs_per_epoch: int = 64
    batch: int = BATCH
    side: int | None = None
    learning_rate: float = LEARNING_RATE
    micro_batch: int | None = None
    bfloat16: bool = False
    seed: int = 0

    def settings(self) -> dict[str, Any]:
        """Return all options that the weights depend on, beyond rounding, as plain values."""
        settings = asdict(self)
        del settings["micro_batch"]
        return settings

    def steps(self) -> dict[str, Any]:
        """The options of `train`."""
        names = ("pairs_per_epoch", "batch", "learning_rate")
        # Patches are small; whole images fill the memory one by one.
        micro_batch = (1 if self.side is None else self.batch) if self.micro_batch is None else self.micro_batch
        return {**{name: getattr(self, name) for name in names}, "micro_batch": micro_batch}
