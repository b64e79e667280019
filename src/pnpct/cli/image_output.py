"""The image that a command writes: a file, or a folder with a series of CT images in DICOM."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from pnpct.arrays import Image, Volume
from pnpct.cli.artefact import IMAGES, check_output, finish
from pnpct.cli.parsing import given_options, option
from pnpct.files import WINDOW, Provenance, check_window, write_image
from pnpct.geometry import Grid


@dataclass(frozen=True, kw_only=True)
class ImageOptions:
    """What only some kinds of output need to know.

    Args:
        window: Level and width of the window of a PNG, HU.
        body_part: Body part to state in a DICOM series, such as CHEST.
        patient_of: Folder of DICOM files, such as the scanner's own images, whose patient and study a DICOM series
            takes.
    """

    window: Annotated[tuple[float, float] | None, option(default="{:g} {:g}".format(*WINDOW))] = None
    body_part: Annotated[str | None, option(default="that of the input, if it is known")] = None
    patient_of: Annotated[Path | None, option(default="a fictitious patient, where the input has none")] = None

    def check_image(self, path: Path, command: Sequence[str], *, inputs: Sequence[Path]) -> None:
        """Find out before the work, not after it, whether an image can be written.

        Args:
            path: Its path; its sidecar is <path>.json.
            command: The command line, word by word.
            inputs: Files and folders that it must not replace.

        Raises:
            ValueError: If the name has another ending, or is that of an input, or an option has no effect or cannot be
                used.
            OSError: If the file, the folder or the sidecar cannot be written.
        """
        if self.window is not None:
            if path.suffix.lower() != ".png":
                raise ValueError(f"--window is for .png, and {path} holds HU without one; leave it out.")
            check_window(self.window)
        if names_folder(path, command):
            from pnpct.cli.dicom_output import check_folder

            check_folder(path, inputs=inputs, body_part=self.body_part, patient_of=self.patient_of)
            return
        for name in given_options(self, ("body_part", "patient_of")):
            spelled = name.replace("_", "-")
            raise ValueError(f"--{spelled} is for DICOM series, and {path} is a file; name a folder instead.")
        check_output(path, IMAGES, inputs=inputs)

    def finish_image(
        self,
        path: Path,
        image: Image | Volume,
        grid: Grid,
        *,
        provenance: Provenance,
        scan: Path | None = None,
        slice_thickness: float | None = None,
        also: str = "",
    ) -> None:
        """Write an image and its sidecar, and print where it is.

        Args:
            path: File, or folder for a DICOM series.
            image: The image or volume.
            grid: Where its pixels are.
            provenance: How it was made; its command line says whether the path is a folder.
            scan: The scan that it was made of, which may know its patient.
            slice_thickness: Over how much of z each slice is a mean, mm; the distance of the slices if None or 0.
            also: What the summary says besides.

        Raises:
            OSError: If a file cannot be written.
            ValueError: If the format cannot hold the image.
        """
        if names_folder(path, provenance.command):
            from pnpct.cli.dicom_output import finish_folder

            finish_folder(
                path,
                image,
                grid,
                provenance=provenance,
                body_part=self.body_part,
                patient_of=self.patient_of,
                scan=scan,
                slice_thickness=slice_thickness,
                also=also,
            )
            return
        write_image(path, image, grid, provenance=provenance, window=self.window or WINDOW)
        finish(path, provenance, summary=f"{grid}{also}")


def names_folder(path: Path, command: Sequence[str]) -> bool:
    """Return whether an output is a folder: it has no suffix, was written with a slash, or is there as one."""
    slash = any(word.endswith("/") and Path(word) == path for word in command)
    return slash or not path.suffix or (path.is_dir() and not path.name.lower().endswith(IMAGES))
