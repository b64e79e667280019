"""The image that a command writes: a file, or a folder with a series of CT images in DICOM."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pnpct.arrays import Image, Volume
from pnpct.cli.artefact import IMAGES, check_output, finish
from pnpct.cli.parsing import given_options, option
from pnpct.cli.terminal import say
from pnpct.files import (
    Provenance,
    SourceSeries,
    body_part_code,
    check_replaceable,
    describe_file,
    read_patient,
    taken_from_scan,
    write_dicom_series,
    write_image,
)
from pnpct.files.errors import resolved
from pnpct.geometry import Grid


@dataclass(frozen=True, kw_only=True)
class SeriesOptions:
    """What only a DICOM series needs to know.

    Args:
        body_part: Body part of a DICOM series, such as CHEST.
        patient_of: Folder of DICOM files, such as the scanner's own images, from which a DICOM series takes patient and
            study.
    """

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
        given = given_options(self, ("body_part", "patient_of"))
        if not names_folder(path, command):
            for name in given:
                spelled = name.replace("_", "-")
                raise ValueError(f"--{spelled} is for DICOM series, and {path} is a file; name a folder instead.")
            check_output(path, IMAGES, inputs=inputs)
            return
        for source in (*inputs, *([self.patient_of] if self.patient_of else [])):
            if source.exists() and resolved(path) == resolved(source):
                raise ValueError(f"{path} is an input and would be replaced; choose another name for the output.")
        check_output(path.with_name(path.name + ".json"), (".json",), inputs=inputs)
        check_replaceable(path)
        if self.body_part:
            body_part_code(self.body_part)
        if self.patient_of and any(map(Path.is_dir, inputs)):
            raise ValueError("--patient-of has no effect on a DICOM series, which has a patient; leave it out.")
        if self.patient_of:
            read_patient(self.patient_of)

    def finish_image(
        self,
        path: Path,
        image: Image | Volume,
        place: Grid | SourceSeries,
        *,
        provenance: Provenance,
        source: Mapping[str, str] | None = None,
        slice_thickness: float | None = None,
        also: str = "",
    ) -> None:
        """Write an image and its sidecar, and print where it is.

        Args:
            path: File, or folder for a DICOM series.
            image: The image or volume.
            place: Where its pixels are, or for a DICOM series the one that it was made of.
            provenance: How it was made; its command line says whether the path is a folder.
            source: What the scan knows of its patient, from `source_of`.
            slice_thickness: Over how much of z each slice is a mean, mm; the distance of the slices if None or 0.
            also: What the summary says besides.

        Raises:
            OSError: If a file cannot be written.
            ValueError: If the format cannot hold the image.
        """
        if not names_folder(path, provenance.command):
            if isinstance(place, SourceSeries):
                raise ValueError(f"{path} is a file, and the slices of a series may lie anywhere; name a folder.")
            write_image(path, image, place, provenance=provenance)
            finish(path, provenance, summary=f"{place}{also}")
            return
        patient: Mapping[str, Any] = source if source and "StudyInstanceUID" in source else {}
        of = "its source's patient and study" if patient or isinstance(place, SourceSeries) else "a fictitious patient"
        if self.patient_of:
            patient, of = read_patient(self.patient_of), f"the patient and study of {self.patient_of}"
        body_part = self.body_part or (source or {}).get("BodyPartExamined")
        write_dicom_series(
            path,
            image,
            place,
            provenance=provenance,
            body_part=body_part,
            patient=patient,
            slice_thickness=slice_thickness or None,
        )
        finish(path, provenance, summary=f"{place}{also}, as a DICOM series of {of}")
        if (lay := patient.get("PatientPosition", "HFS")) != "HFS":
            say(f"The patient lay {lay}, not HFS: left and right are uncertain; compare with the scanner's images.")


def names_folder(path: Path, command: Sequence[str]) -> bool:
    """Return whether an output is a folder: it has no suffix, was written with a slash, or is there as one."""
    slash = any(word.endswith("/") and Path(word) == path for word in command)
    return slash or not path.suffix or (path.is_dir() and not path.name.lower().endswith(IMAGES))


def source_of(scan: Path) -> dict[str, str]:
    """Return what a scan knows of its patient, study and acquisition, by DICOM keyword.

    Raises:
        OSError: If the scan cannot be read.
        ValueError: If it is not one of pnpct's files.
    """
    settings = describe_file(scan)["provenance"]["settings"]
    imported = settings.get("dicom")
    known = {"BodyPartExamined": settings.get("body_part"), **(imported if isinstance(imported, dict) else {})}
    return taken_from_scan({name: value for name, value in known.items() if value and isinstance(value, str)})
