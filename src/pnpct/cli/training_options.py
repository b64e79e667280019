"""The options of `pnpct train` that choose and tune the method."""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Literal

from pnpct.cli.options import check_effect
from pnpct.cli.parsing import given_options, option
from pnpct.training import (
    METHODS,
    Form,
    ImagePairs,
    NeighbouringSlices,
    Reference,
    SingleScan,
    Supervised,
    TwoStage,
)


@dataclass(frozen=True, kw_only=True)
class TrainingOptions:
    """The method and its options; None where not given, for options that have no effect on some methods.

    Args:
        method: two-stage is Noise2Noise, then fine-tuning on dose pairs; supervised has dose pairs alone; single-scan
            is Noise2Inverse between subsets of the views of one scan; image-pairs takes images of your own patients at
            low and at high dose, neighbouring-slices low-dose series of theirs alone.
        epochs: Epochs of Noise2Noise, or of the only stage.
        pairs_per_epoch: Pairs in an epoch, a multiple of the batch size.
        batch: Batch size, pairs per optimizer step.
        side: Rows and columns of the patches; whole images if not given.
        learning_rate: Highest learning rate; it rises to that in the first steps, then falls to zero.
        micro_batch: Pairs that pass through the network together; more are faster, but take more memory.
        bfloat16: Compute in bfloat16 where that is accurate enough.
        seed: Seed of the weights and of all pairs.
        parts: Subsets that the views are divided into, for single-scan; each has at least 30 views.
        low: Name of the low-dose images in the folder of each patient, for image-pairs and neighbouring-slices: a
            folder of a DICOM series, or a file (.h5, .nii, .nii.gz, .npz, .npy) by its name without the suffix.
        high: Name of the high-dose images, for image-pairs.
        validation: Patients to validate on, by the names of their folders; a fifth of them, drawn, if not given.
        also: Further data sets to train on.
        loop_denoiser: Network in the ADMM loop that half of the noisy images are taken from; total variation of random
            strength if not given.
        loop_iterations: Maximum number of iterations of that loop.
        loop_images: Images taken from each loop; more cost little time.
        fine_tuning_epochs: Epochs of the second stage, for two-stage.
        losses: Loss of the second stage: corrected, or as printed in the paper, which cannot reach its goal.
        texture_weight: Weight of the texture term in that loss, (HU / 1000)².
        contrast_weight: Weight of its contrast term, (HU / 1000)².
        examples: Slices that are scanned and reconstructed, before they are repeated with other augmentations.
        cache: Folder where their images are cached, for this and other trainings; each of 512 x 512 pixels takes 5 MB,
            and 2 MB for each further image of its loop.
        lowest_ma: Lowest tube current of low-dose scans, mA.
        highest_ma: Highest tube current of low-dose scans, mA.
        reference: Target of the dose pairs: FBP images of reference scans at this tube current, mA; noise-free, each
            image as it would be without noise, equally blurred; or truth, the phantom itself.
        discount: Power of the noise that noisy pairs are down-weighted by, 0 to 4; 0 weighs all pairs alike.
        reconstructed: Slices of the patients for validation that are reconstructed around the network after each epoch;
            their error says what single images cannot, how the network works in the loop.
    """

    method: Literal["two-stage", "supervised", "single-scan", "image-pairs", "neighbouring-slices"] = "two-stage"
    epochs: int = TwoStage.epochs
    pairs_per_epoch: int = TwoStage.pairs_per_epoch
    batch: int = TwoStage.batch
    side: int | None = None
    learning_rate: float = TwoStage.learning_rate
    micro_batch: Annotated[int | None, option(default="1 for whole images, else all of a batch")] = None
    bfloat16: bool = TwoStage.bfloat16
    seed: int = TwoStage.seed
    parts: Annotated[int | None, option(default=SingleScan.parts)] = None
    low: Annotated[str | None, option(default=ImagePairs.low)] = None
    high: Annotated[str | None, option(default=ImagePairs.high)] = None
    validation: tuple[str, ...] | None = None
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
    reference: Annotated[Reference | None, option(default=TwoStage.reference)] = None
    discount: Annotated[float | None, option(default=TwoStage.discount)] = None
    reconstructed: Annotated[int | None, option(default=TwoStage.reconstructed)] = None

    def chosen_method(self) -> Supervised | SingleScan | NeighbouringSlices:
        """Return the method with the options that were given.

        Raises:
            ValueError: If an option has no effect on it.
        """
        given = given_options(self, [field.name for field in fields(TrainingOptions) if field.name != "method"])
        check_effect(given, self.method, {name: {f.name for f in fields(of)} for name, of in METHODS.items()})
        return METHODS[self.method](**given)
