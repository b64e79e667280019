"""The options of `pnpct train` that choose and tune the method."""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Literal

from pnpct.cli.options import check_effect
from pnpct.cli.parsing import given_options, option
from pnpct.training import METHODS, Form, ReferenceName, SingleScan, Supervised, TwoStage


@dataclass(frozen=True, kw_only=True)
class TrainingOptions:
    """The method and its options; None where an option was not given that has no effect on some methods.

    Args:
        method: two-stage begins with noise to noise and ends with dose pairs; supervised has dose pairs alone;
            single-scan sets parts of the views of one scan against each other.
        epochs: Epochs of noise to noise, or of the only stage.
        pairs_per_epoch: Pairs in an epoch, a multiple of the batch.
        batch: Pairs of one step.
        side: Rows and columns of squares that are cut out; whole images if it is not given.
        learning_rate: Of Adam, in the first epoch.
        decay: Factor of the learning rate after each epoch.
        at_once: Pairs that go through the network together: quicker, but all their memory at once.
        bfloat16: Compute in bfloat16 where that is exact enough.
        seed: Of the weights and of all pairs.
        parts: Parts that the views are dealt out to, for single-scan; each of at least 30 views.
        also: Further data sets whose patients are learnt from.
        loop_denoiser: Network that denoises in the loop of ADMM, from which half of the noisy images come; total
            variation of random strength if none is given.
        loop_iterations: Most iterations of that loop.
        loop_images: Images of each loop that are learnt from; more of them take hardly more time.
        fine_tuning_epochs: Epochs of the second stage, for two-stage.
        losses: Loss of the second stage: corrected, or as the paper prints it, which cannot reach its goal.
        texture_weight: Weight of the texture term in that loss, (HU / 1000)².
        contrast_weight: Weight of its contrast term, (HU / 1000)².
        examples: Slices that are scanned and reconstructed, before they come again with other changes.
        cache: Folder that their images are cached in, for this and other trainings; each of 512 x 512 pixels takes
            5 MB, and 2 MB for each further image of its loop.
        lowest_ma: Lowest tube current of low-dose scans, mA.
        highest_ma: Highest tube current of low-dose scans, mA.
        reference: What dose pairs learn towards: FBP images of scans at this tube current, mA; noise-free, which is
            what each image would be without its noise, just as blurred; or truth, what was scanned.
        discount: Power of the noise by which noisy pairs count less, 0 to 4: 0 counts all alike, 2 much less.
    """

    method: Literal["two-stage", "supervised", "single-scan"] = "two-stage"
    epochs: int = TwoStage.epochs
    pairs_per_epoch: int = TwoStage.pairs_per_epoch
    batch: int = TwoStage.batch
    side: int | None = None
    learning_rate: float = TwoStage.learning_rate
    decay: float = TwoStage.decay
    at_once: Annotated[int | None, option(default="1 for whole images, else all of a batch")] = None
    bfloat16: bool = TwoStage.bfloat16
    seed: int = TwoStage.seed
    parts: Annotated[int | None, option(default=SingleScan.parts)] = None
    also: Annotated[tuple[Path, ...] | None, option(default="none")] = None
    loop_denoiser: str | None = None
    loop_iterations: Annotated[int | None, option(default=TwoStage.loop_iterations)] = None
    loop_images: Annotated[int | None, option(default=TwoStage.loop_images)] = None
    fine_tuning_epochs: Annotated[int | None, option(default=TwoStage.fine_tuning_epochs)] = None
    losses: Annotated[Form | None, option(default=TwoStage.losses)] = None
    texture_weight: Annotated[float | None, option(default=TwoStage.texture_weight)] = None
    contrast_weight: Annotated[float | None, option(default=TwoStage.contrast_weight)] = None
    examples: Annotated[int | None, option(default=TwoStage.examples)] = None
    cache: Path | None = None
    lowest_ma: Annotated[float | None, option(default=TwoStage.lowest_ma)] = None
    highest_ma: Annotated[float | None, option(default=TwoStage.highest_ma)] = None
    reference: Annotated[ReferenceName | None, option(default=TwoStage.reference)] = None
    discount: Annotated[float | None, option(default=TwoStage.discount)] = None

    def chosen_method(self) -> TwoStage | Supervised | SingleScan:
        """Return the method with the options that were given.

        Raises:
            ValueError: If one of them has no effect on it.
        """
        given = given_options(self, [field.name for field in fields(TrainingOptions) if field.name != "method"])
        check_effect(given, self.method, {name: {f.name for f in fields(of)} for name, of in METHODS.items()})
        return METHODS[self.method](**given)
