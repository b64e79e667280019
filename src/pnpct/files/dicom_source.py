"""A CT series as it is in its files, from which another one is made: its pixels, and what is taken over."""

import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float32, Int16
from numpy.typing import NDArray
from pydicom import Dataset
from pydicom.errors import InvalidDicomError
from pydicom.uid import CTImageStorage
from pydicom.valuerep import PersonName

from pnpct.arrays import Volume
from pnpct.files.dicom_elements import body_part_code, code, dataset_of
from pnpct.files.dicom_image import DAMAGE, CTSlice, broken
from pnpct.files.dicom_open import dcmread_any
from pnpct.files.dicom_series import hu_of_all, read_slices
from pnpct.files.errors import FileFormatError, PathLike
from pnpct.units import from_hu

_PATIENT = (
    *("PatientName", "PatientID", "IssuerOfPatientID", "PatientBirthDate", "PatientSex", "PatientComments"),
    *("PatientIdentityRemoved", "DeidentificationMethod"),
)
_STUDY = (
    *("StudyInstanceUID", "StudyDate", "StudyTime", "StudyID", "AccessionNumber", "ReferringPhysicianName"),
    *("StudyDescription", "PatientAge", "PatientSize", "PatientWeight"),
)
_PATIENT_AND_STUDY = (*_PATIENT, *_STUDY)
_SERIES = (
    *("FrameOfReferenceUID", "PositionReferenceIndicator", "PatientPosition", "SeriesNumber", "ProtocolName"),
    *("BodyPartExamined", "Laterality"),
)
_PLANE = (
    *("PixelSpacing", "ImageOrientationPatient", "ImagePositionPatient", "SliceThickness", "SpacingBetweenSlices"),
    "SliceLocation",
)
_ACQUISITION = (
    *("AcquisitionNumber", "AcquisitionDate", "AcquisitionTime", "ContentDate", "ContentTime", "InstanceNumber"),
    *("KVP", "ScanOptions", "DataCollectionDiameter", "ReconstructionDiameter", "GantryDetectorTilt", "TableHeight"),
    *("RotationDirection", "ExposureTime", "XRayTubeCurrent", "Exposure", "FilterType", "ConvolutionKernel"),
    "ContrastBolusAgent",
)
_IMAGE = (
    *("BurnedInAnnotation", "LossyImageCompression", "LossyImageCompressionRatio", "LossyImageCompressionMethod"),
)
_TAKEN_OVER = (*_PATIENT_AND_STUDY, *_SERIES, *_PLANE, *_ACQUISITION, *_IMAGE)
_OF_SCANNER = ("Manufacturer", "ManufacturerModelName", "SoftwareVersions")
_ACQUISITION_EQUIPMENT = ("109101", "Acquisition Equipment")
_SOURCE_IMAGE = ("121322", "Source image for image processing operation")


@dataclass(frozen=True, eq=False)
class SourceSeries:
    """A CT series in its own planes, however they are tilted or spaced, with all that a new series takes over.

    Unlike an `ImageSeries` it knows who the patient is.

    Args:
        image_hu: HU, upright as those of an `ImageSeries`, from the feet to the head.
        slices: Where the images come from.
    """

    image_hu: Int16[np.ndarray, "slices rows cols"] | Float32[np.ndarray, "slices rows cols"]
    slices: tuple[CTSlice, ...]

    @property
    def shape(self) -> tuple[int, int, int]:
        """Slices, rows and columns of the upright images."""
        slices, rows, cols = self.image_hu.shape
        return slices, rows, cols

    def __str__(self) -> str:
        slices, rows, cols = self.shape
        number = f"{slices} slices" if slices > 1 else "1 slice"
        return f"{number} of {rows} x {cols} pixels of {self.slices[0].layout.spacing:.4g} mm"

    @property
    def image(self) -> Volume:
        """The images relative to water."""
        return from_hu(torch.from_numpy(self.image_hu.astype(np.float32)))

    @property
    def uid(self) -> str:
        """Its SeriesInstanceUID."""
        return str(self.slices[0].header.get("SeriesInstanceUID") or "")

    @property
    def scanner(self) -> list[Dataset]:
        """The equipment that acquired it, as an item of ContributingEquipmentSequence; none if it is not known."""
        known = {name: value for name in _OF_SCANNER if (value := self.slices[0].header.get(name))}
        if known.get("Manufacturer", "pnpct") == "pnpct":
            return []
        return [dataset_of({**known, "PurposeOfReferenceCodeSequence": [code(*_ACQUISITION_EQUIPMENT)]})]

    def as_stored(self, upright: NDArray[Any]) -> NDArray[Any]:
        """Turn an image back to how it is in the files."""
        return self.slices[0].layout.as_stored(upright)

    def elements(self) -> Iterator[dict[str, Any]]:
        """Yield for each slice the elements of a series that is made of it: patient, study, position, acquisition."""
        numbers = {str(one.header.get("InstanceNumber")) for one in self.slices}
        for one in self.slices:
            header = one.header
            known = _known(header, _TAKEN_OVER)
            if len(numbers) < len(self.slices):
                known.pop("InstanceNumber", None)
            number = str(known.get("SeriesNumber") or "")
            known["SeriesNumber"] = 1000 + (int(number) if number.isdecimal() else 0)
            known["SourceImageSequence"] = [_reference_to(one)]
            yield known


def read_source_series(folder: PathLike, *, series_uid: str | None = None) -> SourceSeries:
    """Read a folder that holds one axial CT series, of which another is to be made.

    What is read and what is passed over is as for `read_dicom_series`, but the images stay in their own planes and
    at their own heights.

    Args:
        folder: The folder.
        series_uid: SeriesInstanceUID of the series to read, where the folder holds several.

    Raises:
        OSError: If there is no such folder or a file cannot be read.
        FileFormatError: If there is no CT image, or several series; if a slice does not fit the others; if images
            are oblique, have oblong pixels, are not in HU, or cannot be decoded.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # pydicom's, of values that are against the standard and do no harm
        slices = read_slices(Path(folder), series_uid, also=(*_TAKEN_OVER, *_OF_SCANNER, "SOPInstanceUID"))
        return SourceSeries(hu_of_all(slices), tuple(slices))


def read_patient(folder: PathLike) -> dict[str, Any]:
    """Read whom a folder of DICOM files is of: images or anything else, such as a scanner's projections.

    Args:
        folder: The folder; its first DICOM file counts.

    Returns:
        The elements of patient and study, by keyword.

    Raises:
        OSError: If there is no such folder or a file cannot be read.
        FileFormatError: If there is no DICOM file, or it does not say of which study it is.
    """
    if not Path(folder).is_dir():
        raise NotADirectoryError(f"{folder} is no folder; give one with DICOM files of the patient.")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for path in sorted(path for path in Path(folder).iterdir() if path.is_file()):
            try:
                header = dcmread_any(path, stop_before_pixels=True, specific_tags=[*_PATIENT_AND_STUDY])
                known = _known(header, _PATIENT_AND_STUDY)
            except InvalidDicomError:
                continue
            except DAMAGE as error:
                raise broken(path, error) from error
            if "StudyInstanceUID" in known:
                return known
    raise FileFormatError(f"{folder} holds no DICOM file that says of which study it is; give another folder.")


def taken_from_scan(known: Mapping[str, str]) -> dict[str, str]:
    """Return those elements of a scan that an image of it takes over, and that are as DICOM wants them.

    Where a scan lies in the scanner's own frame of reference is not known, so that this one is not among them.

    Args:
        known: Values by keyword, as they were when the scan was imported.
    """
    taken = {}
    for name in (*_PATIENT_AND_STUDY, "KVP", "PatientPosition", "ProtocolName", "BodyPartExamined"):
        with (
            warnings.catch_warnings(),
            suppress(TypeError, ValueError),
        ):  # a text where a number should be, and the like
            warnings.simplefilter("ignore")
            if name in known and (name != "BodyPartExamined" or body_part_code(known[name])):
                dataset_of({name: known[name]})
                taken[name] = known[name]
    return taken


def _known(header: Dataset, names: Sequence[str]) -> dict[str, Any]:
    """Those of the elements that have a value."""
    known = {name: _plain(header[name].value) for name in names if name in header}
    return {name: value for name, value in known.items() if value not in (None, "", [])}


def _reference_to(one: CTSlice) -> Dataset:
    frame = {} if one.frame is None else {"ReferencedFrameNumber": one.frame + 1}
    return dataset_of(
        {
            "ReferencedSOPClassUID": one.header.get("SOPClassUID") or CTImageStorage,
            "ReferencedSOPInstanceUID": one.header.get("SOPInstanceUID") or "",
            **frame,
            "PurposeOfReferenceCodeSequence": [code(*_SOURCE_IMAGE)],
        }
    )


def _plain(value: Any) -> Any:
    """Names as text, which is written anew in UTF-8; they hold on to the characters of their file."""
    return str(value) if isinstance(value, PersonName) else value
