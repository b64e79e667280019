"""CT images in DICOM, made for the tests."""

import numpy as np
from pydicom import Dataset
from pydicom.dataset import FileMetaDataset
from pydicom.uid import CTImageStorage, ExplicitVRLittleEndian

ROWS, COLS = 4, 6
STANDARD = [1, 0, 0, 0, 1, 0]


def stored_pixels(z: float) -> np.ndarray:
    """Nothing about it is symmetric, and every slice is another."""
    return np.arange(ROWS * COLS, dtype=np.int16).reshape(ROWS, COLS) * 10 + round(z)


def dicom(
    z: float, pixels: np.ndarray | None = None, syntax: str = ExplicitVRLittleEndian, **changes: object
) -> Dataset:
    """A CT image; an element that is changed to None is left out."""
    pixels = stored_pixels(z) if pixels is None else pixels
    image = Dataset()
    image.file_meta = FileMetaDataset()
    image.file_meta.TransferSyntaxUID = syntax
    image.file_meta.MediaStorageSOPClassUID = changes.get("SOPClassUID", CTImageStorage)
    image.file_meta.MediaStorageSOPInstanceUID = f"1.2.3.4.{round(1000 + 10 * z)}"
    elements = {
        "SOPClassUID": CTImageStorage,
        "SOPInstanceUID": f"1.2.3.4.{round(1000 + 10 * z)}",
        "SeriesInstanceUID": "1.2.3",
        "Modality": "CT",
        "ImageType": ["ORIGINAL", "PRIMARY", "AXIAL"],
        "PatientName": "Secret^Person",
        "PatientID": "Secret",
        "SeriesDescription": "Secret",
        "Manufacturer": "ACME",
        "ConvolutionKernel": "B40f",
        "KVP": "120.0",
        "ImagePositionPatient": [-1.0, -2.0, z],
        "ImageOrientationPatient": STANDARD,
        "Rows": pixels.shape[0],
        "Columns": pixels.shape[1],
        "PixelSpacing": [0.7, 0.7],
        "SamplesPerPixel": 1,
        "PhotometricInterpretation": "MONOCHROME2",
        "BitsAllocated": 16,
        "BitsStored": 16,
        "HighBit": 15,
        "PixelRepresentation": int(pixels.dtype.kind == "i"),
        "RescaleSlope": 1,
        "RescaleIntercept": 0,
        "PixelData": pixels.tobytes(),
        **changes,
    }
    for name, value in elements.items():
        if value is not None:
            setattr(image, name, value)
    return image


def save(folder, *images: Dataset):
    folder.mkdir(exist_ok=True)
    for image in images:
        name = f"{len(list(folder.iterdir()))}.dcm"
        image.save_as(folder / name, enforce_file_format=True)
    return folder
