"""The elements of a DICOM-CT-PD header, by their names in the dictionary.

A file in explicit VR says how its values are written; one in implicit VR, as those of the public collections, does not,
and the dictionary has to. The private creators say nothing that is needed, and differ.
"""

from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydicom import FileDataset, dcmread
from pydicom.dataelem import RawDataElement
from pydicom.errors import InvalidDicomError

from pnpct.files.dicom_image import DAMAGE
from pnpct.files.errors import FileFormatError

_FLOAT, _WHOLE, _TEXT = "<f4", "<u2", ""
ELEMENTS = {
    "SOPClassUID": (0x00080016, _TEXT),
    "Manufacturer": (0x00080070, _TEXT),
    "KVP": (0x00180060, _TEXT),
    "HUCalibrationFactor": (0x00180061, _TEXT),
    "XRayTubeCurrent": (0x00181151, _TEXT),
    "SeriesInstanceUID": (0x0020000E, _TEXT),
    "InstanceNumber": (0x00200013, _TEXT),
    "NumberOfFrames": (0x00280008, _TEXT),
    "Rows": (0x00280010, _WHOLE),
    "Columns": (0x00280011, _WHOLE),
    "BitsAllocated": (0x00280100, _WHOLE),
    "PixelRepresentation": (0x00280103, _WHOLE),
    "SmallestImagePixelValue": (0x00280106, _WHOLE),
    "LargestImagePixelValue": (0x00280107, _WHOLE),
    "RescaleIntercept": (0x00281052, _TEXT),
    "RescaleSlope": (0x00281053, _TEXT),
    "DetectorElementTransverseSpacing": (0x70291002, _FLOAT),
    "DetectorElementAxialSpacing": (0x70291006, _FLOAT),
    "DetectorShape": (0x7029100B, _TEXT),
    "NumberofDetectorRows": (0x70291010, _WHOLE),
    "NumberofDetectorColumns": (0x70291011, _WHOLE),
    "DetectorFocalCenterAngularPosition": (0x70311001, _FLOAT),
    "DetectorFocalCenterAxialPosition": (0x70311002, _FLOAT),
    "DetectorFocalCenterRadialDistance": (0x70311003, _FLOAT),
    "ConstantRadialDistance": (0x70311031, _FLOAT),
    "DetectorCentralElement": (0x70311033, _FLOAT),
    "SourceAngularPositionShift": (0x7033100B, _FLOAT),
    "SourceAxialPositionShift": (0x7033100C, _FLOAT),
    "SourceRadialDistanceShift": (0x7033100D, _FLOAT),
    "SpectrumIndex": (0x70331063, _WHOLE),
    "PhotonStatistics": (0x70331065, _FLOAT),
    "BeamHardeningCorrectionFlag": (0x70391003, _TEXT),
    "GainCorrectionFlag": (0x70391004, _TEXT),
    "DarkFieldCorrectionFlag": (0x70391005, _TEXT),
    "FlatFieldCorrectionFlag": (0x70391006, _TEXT),
    "BadPixelCorrectionFlag": (0x70391007, _TEXT),
    "ScatterCorrectionFlag": (0x70391008, _TEXT),
    "LogFlag": (0x70391009, _TEXT),
    "WaterAttenuationCoefficient": (0x70411001, _TEXT),
}
"""Tag and binary type by name, in the dictionary's tenth version; text and decimal strings have no binary type."""

PIXELS = 0x7FE00010
_TYPES = {"FL": "<f4", "FD": "<f8", "US": "<u2", "SS": "<i2", "UL": "<u4", "SL": "<i4"}


@dataclass(frozen=True)
class Elements:
    """The elements of one view.

    Args:
        path: Its file, which errors name.
        dataset: What pydicom has read of it.
    """

    path: Path
    dataset: FileDataset

    def text(self, name: str) -> str:
        """Return a text without its padding; empty if there is none."""
        return self._found(name)[0].decode("ascii", "replace").strip(" \0")

    def numbers(self, name: str) -> NDArray[np.float64]:
        """Return the numbers of an element; none if it is missing or empty.

        Raises:
            FileFormatError: If they are not finite numbers.
        """
        content, kind = self._found(name)
        try:
            if kind or not content.strip(b" \0"):
                with np.errstate(invalid="ignore"):  # a NaN may be one that signals
                    numbers = np.frombuffer(content if kind else b"", kind or "u1").astype(np.float64)
            else:
                numbers = np.array([float(part) for part in content.decode("ascii").strip(" \0").split("\\")])
        except ValueError as error:
            raise FileFormatError(f"{self.path}: {name} must hold numbers; the file is damaged.") from error
        if not np.isfinite(numbers).all():
            raise FileFormatError(f"{self.path}: {name} must be finite, got {numbers[~np.isfinite(numbers)][0]}.")
        return numbers

    def number(self, name: str) -> float:
        """Return the number of an element.

        Raises:
            FileFormatError: If it is missing, or not one finite number.
        """
        numbers = self.numbers(name)
        if numbers.size != 1:
            raise FileFormatError(
                f"{self.path}: {name} must be one number in each view of DICOM-CT-PD, got {numbers.size or 'none'}."
            )
        return float(numbers[0])

    def whole_number(self, name: str) -> int:
        """Return the number of an element that counts something, as `number` does."""
        number = self.number(name)
        if not number.is_integer():
            raise FileFormatError(f"{self.path}: {name} must be a whole number, got {number:g}.")
        return int(number)

    def number_or(self, name: str, default: float) -> float:
        """Return the number of an element, as `number` does; another where it is missing."""
        return self.number(name) if self.numbers(name).size else default

    @property
    def pixels(self) -> NDArray[np.uint16]:
        """The values of the pixels as they are stored; none if they were not read or end too early."""
        found: object = self.dataset.get_item(PIXELS)
        content = found.value if isinstance(found, RawDataElement) else None
        return np.frombuffer(content if content and not len(content) % 2 else b"", "<u2").astype(np.uint16, copy=False)

    def _found(self, name: str) -> tuple[bytes, str]:
        """The content of an element, and the type of its numbers; text has none."""
        tag, kind = ELEMENTS[name]
        found: object = self.dataset.get_item(tag)
        if not isinstance(found, RawDataElement) or not found.value:
            return b"", kind
        return bytes(found.value), kind if found.VR in (None, "UN") else _TYPES.get(found.VR, _TEXT)


def read_elements(path: Path, *, pixels: bytes | None = None) -> Elements | None:
    """Read the elements of a file, its header only or with its pixels.

    Args:
        path: The file.
        pixels: The content of the file, if the pixels are to be read.

    Returns:
        The elements; None if the file is not in DICOM.

    Raises:
        OSError: If the file cannot be read.
        FileFormatError: If it is damaged.
    """
    try:
        if pixels is not None:
            return Elements(path, dcmread(BytesIO(pixels), specific_tags=[*_TAGS, PIXELS]))
        return Elements(path, dcmread(path, stop_before_pixels=True, specific_tags=_TAGS))
    except InvalidDicomError:
        return None
    except OSError:
        raise
    except DAMAGE as error:
        raise FileFormatError(f"{path}: this is not a complete DICOM file ({' '.join(str(error).split())}).") from error


_TAGS = [tag for tag, _ in ELEMENTS.values()]
