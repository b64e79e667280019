"""CT series in DICOM: an image or a volume becomes a folder of single images."""

import hashlib
import json
import math
import sys
import warnings
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path, PureWindowsPath
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from pydicom import Dataset, dcmread
from pydicom.dataset import FileMetaDataset
from pydicom.errors import InvalidDicomError
from pydicom.uid import CTImageStorage, ExplicitVRLittleEndian

from pnpct.arrays import Image, Volume
from pnpct.files.atomic import atomic_folder
from pnpct.files.dicom_elements import WRITER, body_part_code, code, dataset_of, decimal, uid_of
from pnpct.files.dicom_source import SourceSeries
from pnpct.files.errors import PathLike
from pnpct.files.image_series import LOWEST_HU
from pnpct.files.provenance import Provenance, record_run
from pnpct.geometry import Grid, VolumeGrid
from pnpct.units import to_hu

_HIGHEST_HU = 32767
_LONG_STRING, _SHORT_TEXT = 64, 1024
_PROCESSING = ("109102", "Processing Equipment")

_FICTITIOUS = {
    "PatientName": "Fictitious^Patient",
    "PatientComments": "Patient, study and date are fictitious: the input of this series names none.",
    "PatientIdentityRemoved": "YES",
    "DeidentificationMethod": "Patient, study and date are fictitious: the input names none",
    "StudyDate": "20000101",
    "StudyTime": "000000",
    "StudyID": "1",
}
_EMPTY_UNLESS_KNOWN = (
    *("PatientName", "PatientID", "PatientBirthDate", "PatientSex"),
    *("StudyDate", "StudyTime", "ReferringPhysicianName", "StudyID", "AccessionNumber"),
    *("PositionReferenceIndicator", "AcquisitionNumber", "KVP", "SliceThickness"),
)
_EVERY_SLICE = {
    "SpecificCharacterSet": "ISO_IR 192",
    "SOPClassUID": CTImageStorage,
    "Modality": "CT",
    "Manufacturer": "pnpct",
    "ManufacturerModelName": "pnpct",
    "PatientPosition": "HFS",
    "BurnedInAnnotation": "NO",
    "LossyImageCompression": "00",
    "SamplesPerPixel": 1,
    "PhotometricInterpretation": "MONOCHROME2",
    "BitsAllocated": 16,
    "BitsStored": 16,
    "HighBit": 15,
    "PixelRepresentation": 1,
    "RescaleIntercept": 0,
    "RescaleSlope": 1,
    "RescaleType": "HU",
    "WindowCenter": [40, -600],
    "WindowWidth": [400, 1500],
    "WindowCenterWidthExplanation": ["SOFT TISSUE", "LUNG"],
}


def write_dicom_series(
    folder: PathLike,
    image: Image | Volume,
    place: Grid | SourceSeries,
    *,
    provenance: Provenance | None = None,
    body_part: str | None = None,
    slice_thickness: float | None = None,
    patient: Mapping[str, Any] | None = None,
) -> None:
    """Write an image or a volume as a CT series, one file per slice, from the feet to the head.

    HU are rounded to whole numbers and cut off below -1024 and above 32767. FBP alone is an ORIGINAL image, all
    else DERIVED, with its settings and the SHA-256 of its input. The UIDs follow from the provenance and the pixels:
    the same image made in the same way has the same ones, and other settings make another series. An image without
    height is at z = 0, of unknown thickness.

    Args:
        folder: Folder to write. One that is empty, or holds nothing but a series that this function wrote, is replaced.
        image: The image or volume, relative to water.
        place: Where its pixels are: a grid; or the series that it was made of, whose patient, study, frame of reference
            and positions it takes over. With a grid the patient is fictitious, and the series says so.
        provenance: How it was made; if None, by the program that is running.
        body_part: Body part examined, such as "CHEST", if the source does not say it: letters, digits, spaces.
        slice_thickness: Thickness of a slice, mm, if it is not the distance between slices.
        patient: Elements of patient and study, from `read_patient`, instead of the fictitious ones of a grid; and those
            of the acquisition that are known.

    Raises:
        OSError: If the folder cannot be written, or something else is in it.
        ValueError: If the image does not fit its place or is not finite, there is a batch, the body part has other
            characters, or a patient is given where the source has one.

    References:
        DICOM PS3.3, A.3 (CT image); PS3.5, B.2 (UIDs derived from a UUID).
    """
    check_replaceable(folder)
    if tuple(image.shape) != place.shape:
        raise ValueError(f"A DICOM series holds one image or volume, here {place.shape}, got {tuple(image.shape)}.")
    if not image.isfinite().all():
        raise ValueError(f"{folder} was not written: the image holds values that are not finite.")
    if patient and isinstance(place, SourceSeries):
        raise ValueError("A series that is made of another one is of that one's patient; leave out the patient.")
    stated = _stated(body_part, slice_thickness)
    images = _images(_whole_hu(image), place, provenance or record_run(sys.argv), stated, patient or {})
    with warnings.catch_warnings(), atomic_folder(folder) as temporary:
        warnings.simplefilter("ignore")  # pydicom's, of values in the source that are against the standard
        for number, one in enumerate(images, start=1):
            one.save_as(temporary / f"{number:04d}.dcm", enforce_file_format=True)


def check_replaceable(folder: PathLike) -> None:
    """Check that a folder, if it is there, holds nothing but a series that `write_dicom_series` wrote.

    Raises:
        OSError: If something else is in it, or it cannot be read.
    """
    if not Path(folder).is_dir():
        return
    for path in Path(folder).iterdir():
        if not (path.suffix == ".dcm" and path.is_file() and _is_ours(path)):
            raise FileExistsError(
                f"{folder} cannot be replaced: {path.name} in it is not of a series that pnpct wrote; give the name of "
                "a new folder."
            )


def _is_ours(path: Path) -> bool:
    try:
        meta = dcmread(path, stop_before_pixels=True, specific_tags=["SOPClassUID"]).file_meta
    except (InvalidDicomError, OSError, ValueError):
        return False
    return bool(meta.get("ImplementationClassUID") == WRITER)


def _whole_hu(image: Image | Volume) -> NDArray[np.int16]:
    slices = image.detach().cpu().reshape(-1, *image.shape[-2:])
    hu = np.empty(tuple(slices.shape), dtype=np.int16)
    for index, one in enumerate(slices):
        hu[index] = torch.round(to_hu(one.double())).clamp(LOWEST_HU, _HIGHEST_HU).to(torch.int16).numpy()
    return hu


def _images(
    hu: NDArray[np.int16],
    place: Grid | SourceSeries,
    provenance: Provenance,
    more: dict[str, Any],
    patient: Mapping[str, Any],
) -> Iterator[Dataset]:
    """The images, one after the other."""
    source = place if isinstance(place, SourceSeries) else None
    where = place.uid if isinstance(place, SourceSeries) else repr(place)
    pixels, hashes = hashlib.sha256(hu.tobytes()).hexdigest(), sorted(provenance.inputs.values())
    how = [
        provenance.version,
        provenance.seed,
        provenance.settings,
        hashes,
        where,
        more,
        {name: str(value) for name, value in patient.items()},
    ]
    series_uid = uid_of("series", json.dumps(how, sort_keys=True), pixels)
    # Whatever is made of the same input belongs together, in one study and at the same place.
    identity = hashes or [pixels]
    shared = {
        **_EVERY_SLICE,
        **_made_by(provenance, source),
        "StudyInstanceUID": uid_of("study", *identity),
        "SeriesInstanceUID": series_uid,
        "FrameOfReferenceUID": uid_of("frame of reference", *identity),
    }
    known = place.elements() if isinstance(place, SourceSeries) else _elements_of(place, identity, patient)
    for index, of_slice in enumerate(known):
        elements = dict.fromkeys(_EMPTY_UNLESS_KNOWN, "") | {"InstanceNumber": index + 1} | shared | of_slice | more
        elements["SOPInstanceUID"] = uid_of("image", series_uid, str(index))
        if not elements.get("BodyPartExamined"):
            elements.setdefault("Laterality", "")  # needed where the body part may be one of a pair
        stored = source.as_stored(hu[index]) if source else hu[index]
        elements |= {"Rows": stored.shape[0], "Columns": stored.shape[1], "PixelData": stored.astype("<i2").tobytes()}
        yield _file(elements)


def _made_by(provenance: Provenance, source: SourceSeries | None) -> dict[str, Any]:
    """What made the images, and of which kind they are."""
    settings, words, how = provenance.settings, f"pnpct {provenance.version}", _in_words(provenance)
    original = settings.get("method") == "fbp" and source is None
    equipment = {
        "Manufacturer": "pnpct",
        "ManufacturerModelName": "pnpct",
        "SoftwareVersions": words,
        "ContributionDescription": how,
        "PurposeOfReferenceCodeSequence": [code(*_PROCESSING)],
    }
    names = [PureWindowsPath(str(settings[key])).name for key in ("method", "kernel", "denoiser") if settings.get(key)]
    return {
        "ImageType": ["ORIGINAL" if original else "DERIVED", "PRIMARY", "AXIAL"],
        "SeriesDescription": " ".join(["pnpct", *names])[:_LONG_STRING],
        "SoftwareVersions": words,
        "ContributingEquipmentSequence": [*(source.scanner if source else []), dataset_of(equipment)],
        **({"ConvolutionKernel": str(settings["kernel"]).upper()} if original and settings.get("kernel") else {}),
        **({} if original else {"DerivationDescription": how}),
    }


def _in_words(provenance: Provenance) -> str:
    """Version, input and settings in words; what is longer than the standard allows is cut off at its end."""
    hashes = [f"SHA-256 of the input {digest}" for digest in sorted(provenance.inputs.values())]
    plain = {name: value for name, value in provenance.settings.items() if not isinstance(value, Mapping | list)}
    settings = [f"{name} {value}" for name, value in plain.items() if value is not None]
    return "; ".join([f"pnpct {provenance.version}", *hashes, *settings])[:_SHORT_TEXT]


def _stated(body_part: str | None, slice_thickness: float | None) -> dict[str, Any]:
    """The elements that the caller gives."""
    known = {} if body_part is None else {"BodyPartExamined": body_part_code(body_part)}
    if slice_thickness is not None:
        if not 0 < slice_thickness < math.inf:
            raise ValueError(f"The thickness of a slice must be a positive length in mm, got {slice_thickness:g}.")
        known["SliceThickness"] = decimal(slice_thickness)
    return known


def _elements_of(grid: Grid, identity: Sequence[str], patient: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """Patient and position of each slice on a grid."""
    plane = grid.plane if isinstance(grid, VolumeGrid) else grid
    heights, thickness = ([0.0], "")
    if isinstance(grid, VolumeGrid):
        heights, thickness = grid.heights.tolist(), decimal(grid.slice_spacing)
    shared = {
        **(patient or {**_FICTITIOUS, "PatientID": f"PNPCT-{uid_of('patient', *identity)[-12:]}"}),
        "SeriesNumber": 1,
        "ImageOrientationPatient": [1, 0, 0, 0, 1, 0],
        "PixelSpacing": [decimal(plane.spacing)] * 2,
        "ReconstructionDiameter": decimal(plane.spacing * max(plane.shape)),
        "SliceThickness": thickness,
        **({"SpacingBetweenSlices": thickness} if thickness else {}),
    }
    for z in heights:
        # Our x grows to the patient's left as DICOM's does, our y to the front where DICOM's grows to the back.
        position = [decimal(plane.x[0]), decimal(-plane.y[0]), decimal(z)]
        yield {**shared, "ImagePositionPatient": position, "SliceLocation": decimal(z)}


def _file(elements: Mapping[str, Any]) -> Dataset:
    one = dataset_of(elements)
    one.file_meta = FileMetaDataset()
    one.file_meta.MediaStorageSOPClassUID = CTImageStorage
    one.file_meta.MediaStorageSOPInstanceUID = one.SOPInstanceUID
    one.file_meta.TransferSyntaxUID = ExplicitVRLittleEndian
    one.file_meta.ImplementationClassUID = WRITER
    one.file_meta.ImplementationVersionName = "PNPCT"
    return one
