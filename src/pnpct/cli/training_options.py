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
    ThroughLoop,
    TwoStage,
)


@dataclass(frozen=True, kw_only=True)
class TrainingOptions:
    """The method and its options; None where not given, for options that have no effect on some methods.

    Args:
        method: two-stage is Noise2Noise, then fine-tuning on dose pairs; supervised uses dose pairs alone; through-loop
            goes on with a trained network by the images that plug-and-play ends with around it; single-scan is
            Noise2Inverse between subsets of the views of one scan; image-pairs uses low- and high-dose images of
            your own patients, neighbouring-slices their low-dose series alone.
        epochs: Epochs of Noise2Noise, or of the only stage.
        pairs_per_epoch: Pairs per epoch, a multiple of the batch size; slices, for through-loop.
        batch: Batch size: pairs per optimizer step.
        side: Rows and columns of the patches.
        learning_rate: Peak learning rate, after a warm-up; from there it falls to zero along a cosine.
        micro_batch: Pairs that go through the network at once; more is faster, and takes more memory.
        bfloat16: Compute in bfloat16 where that is accurate enough.
        seed: Random seed of the weights and of the pairs.
        parts: Number of subsets of the views, for single-scan; each needs at least 30 views.
        low: Name of the low-dose images in each patient's folder, for image-pairs and neighbouring-slices: a folder
            with a DICOM series, or a file (.h5, .nii, .nii.gz, .npz, .npy) without its suffix.
        high: Name of the high-dose images, for image-pairs.
        validation: Patients held out for validation, by the names of their folders.
        also: Further data sets to train on.
        loop_denoiser: Denoiser of the ADMM loop from which half of the noisy images are taken.
        loop_iterations: Maximum number of iterations of that loop.
        loop_images: Images taken from each loop; more of them cost little time.
        fine_tuning_epochs: Epochs of the second stage, for two-stage.
        losses: Loss of the second stage: corrected, or as printed in the paper, where it cannot reach its own minimum.
        texture_weight: Weight of its texture term, (HU / 1000)².
        contrast_weight: Weight of its contrast term, (HU / 1000)².
        examples: Number of slices that are scanned and reconstructed; after these they are repeated with other
            augmentations.
        cache: Folder in which their images are cached, for this and later trainings; one slice of 512 x 512 pixels
            takes 5 MB, plus 2 MB for each further image of its loop.
        lowest_ma: Lowest tube current of the low-dose scans, mA.
        highest_ma: Highest tube current of the low-dose scans, mA.
        reference: Target of the dose pairs: a tube current in mA for FBP images of a scan at that dose; noise-free for
            the same image without noise, equally sharp; or truth for the phantom itself.
        discount: Noisy pairs are weighted by the inverse of their noise to this power, 0 to 4; 0 weights all pairs
            alike.
        reconstructed: Number of validation slices that are reconstructed around the network after each epoch, which
            shows how it works in the loop.
    """

    method: Literal["two-stage", "supervised", "through-loop", "single-scan", "image-pairs", "neighbouring-slices"] = (
        "two-stage"
    )
    epochs: int = TwoStage.epochs
    pairs_per_epoch: int = TwoStage.pairs_per_epoch
    batch: int = TwoStage.batch
    side: Annotated[int | None, option(default="whole images")] = None
    learning_rate: float = TwoStage.learning_rate
    micro_batch: Annotated[int | None, option(default="1 for whole images, else all of a batch")] = None
    bfloat16: bool = TwoStage.bfloat16
    seed: int = TwoStage.seed
    parts: Annotated[int | None, option(default=SingleScan.parts)] = None
    low: Annotated[str | None, option(default=ImagePairs.low)] = None
    high: Annotated[str | None, option(default=ImagePairs.high)] = None
    validation: Annotated[tuple[str, ...] | None, option(default="a fifth of them, drawn at random")] = None
    also: Annotated[tuple[Path, ...] | None, option(default="none")] = None
    loop_denoiser: Annotated[str | None, option(default="total variation of random strength")] = None
    loop_iterations: Annotated[int | None, option(default=TwoStage.loop_iterations)] = None
    loop_images: Annotated[int | None, option(default=TwoStage.loop_images)] = None
    fine_tuning_epochs: Annotated[int | None, option(default=TwoStage.fine_tuning_epochs)] = None
    losses: Annotated[Form | None, option(default=TwoStage.losses)] = None
    texture_weight: Annotated[float | None, option(default=TwoStage.texture_weight)] = None
    contrast_weight: Annotated[float | None, option(default=TwoStage.contrast_weight)] = None
    examples: Annotated[int | None, option(default=f"{TwoStage.examples}; through-loop: {ThroughLoop.examples}")] = None
    cache: Annotated[Path | None, option(default="not cached")] = None
    lowest_ma: Annotated[
        float | None, option(default=f"{TwoStage.lowest_ma}; through-loop: {ThroughLoop.lowest_ma}")
    ] = None
    highest_ma: Annotated[
        float | None, option(default=f"{TwoStage.highest_ma}; through-loop: {ThroughLoop.highest_ma}")
    ] = None
    reference: Annotated[Reference | None, option(default=TwoStage.reference)] = None
    discount: Annotated[float | None, option(default=TwoStage.discount)] = None
    reconstructed: Annotated[int | None, option(default=TwoStage.reconstructed)] = None

    def chosen_method(self) -> Supervised | ThroughLoop | SingleScan | NeighbouringSlices:
        """Return the method with the options that were given.

        Raises:
            ValueError: If an option has no effect on it.
        """
        given = given_options(self, [field.name for field in fields(TrainingOptions) if field.name != "method"])
        check_effect(given, self.method, {name: {f.name for f in fields(of)} for name, of in METHODS.items()})
        return METHODS[self.method](**given)
