"""The folder that a command writes: a series of CT images in DICOM."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pnpct.arrays import Image, Volume
from pnpct.cli.artefact import check_output, finish
from pnpct.cli.terminal import say, working
from pnpct.files import (
    Provenance,
    SourceSeries,
    body_part_code,
    check_replaceable,
    describe_file,
    read_patient,
    taken_from_scan,
    write_dicom_series,
)
from pnpct.files.errors import resolved
from pnpct.geometry import Grid


def check_folder(path: Path, *, inputs: Sequence[Path], body_part: str | None, patient_of: Path | None) -> None:
    """Find out before the work, not after it, whether a series can be written.

    Args:
        path: Its folder; its sidecar is <path>.json.
        inputs: Files and folders that it must not replace.
        body_part: Its body part.
        patient_of: Folder that patient and study are taken from.

    Raises:
        ValueError: If the folder is an input, or an option has no effect or cannot be used.
        OSError: If the folder or the sidecar cannot be written.
    """
    for source in (*inputs, *([patient_of] if patient_of else [])):
        if source.exists() and resolved(path) == resolved(source):
            raise ValueError(f"{path} is an input and would be replaced; choose another name for the output.")
    check_output(path.with_name(path.name + ".json"), (".json",), inputs=inputs)
    check_replaceable(path)
    if body_part:
        body_part_code(body_part)
    if patient_of and any(map(Path.is_dir, inputs)):
        raise ValueError("--patient-of has no effect on a DICOM series, which has a patient; leave it out.")
    if patient_of:
        read_patient(patient_of)


def finish_folder(
    path: Path,
    image: Image | Volume,
    place: Grid | SourceSeries,
    *,
    provenance: Provenance,
    body_part: str | None = None,
    patient_of: Path | None = None,
    scan: Path | None = None,
    slice_thickness: float | None = None,
    also: str = "",
) -> None:
    """Write a series and its sidecar, and print where it is.

    Args:
        path: Its folder.
        image: The image or volume.
        place: Where its pixels are, or the series that it was made of.
        provenance: How it was made.
        body_part: Its body part; that of the input if None.
        patient_of: Folder that patient and study are taken from.
        scan: The scan that it was made of, which may know its patient.
        slice_thickness: Over how much of z each slice is a mean, mm; the distance of the slices if None or 0.
        also: What the summary says besides.

    Raises:
        OSError: If a file cannot be read or written.
        ValueError: If the scan is not one of pnpct's files, or DICOM cannot hold the image.
    """
    source = _known_of(scan) if scan else {}
    patient: Mapping[str, Any] = source if "StudyInstanceUID" in source else {}
    of = "its source's patient and study" if patient or isinstance(place, SourceSeries) else "a fictitious patient"
    if patient_of:
        patient, of = read_patient(patient_of), f"the patient and study of {patient_of}"
    with working("Writing"):
        write_dicom_series(
            path,
            image,
            place,
            provenance=provenance,
            body_part=body_part or source.get("BodyPartExamined"),
            patient=patient,
            slice_thickness=slice_thickness or None,
        )
    finish(path, provenance, summary=f"{place}{also}, as a DICOM series of {of}")
    if (lay := patient.get("PatientPosition", "HFS")) != "HFS":
        say(f"The patient lay {lay}, not HFS: left and right are uncertain; compare with the scanner's images.")


def _known_of(scan: Path) -> dict[str, str]:
    """What a scan knows of its patient, study and acquisition, by DICOM keyword."""
    settings = describe_file(scan)["provenance"]["settings"]
    imported = settings.get("dicom")
    known = {"BodyPartExamined": settings.get("body_part"), **(imported if isinstance(imported, dict) else {})}
    return taken_from_scan({name: value for name, value in known.items() if value and isinstance(value, str)})
