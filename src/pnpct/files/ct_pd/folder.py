"""A folder of DICOM-CT-PD, one view in each file."""

import warnings
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from pydicom import dcmread

from pnpct.files.ct_pd.view import View, read_view
from pnpct.files.errors import FileFormatError, PathLike

_THREADS = 4
_OF_THE_PATIENT = (
    "PatientName",
    "PatientID",
    "PatientBirthDate",
    "PatientSex",
    "StudyInstanceUID",
    "StudyDate",
    "StudyTime",
    "StudyID",
    "AccessionNumber",
    "ReferringPhysicianName",
    "FrameOfReferenceUID",
)
_OF_THE_SCAN = (
    "SeriesInstanceUID",
    "SeriesDescription",
    "Manufacturer",
    "ManufacturerModelName",
    "BodyPartExamined",
    "ProtocolName",
    "PatientPosition",
    "KVP",
)


def projection_files(folder: PathLike) -> list[Path]:
    """Return the files of a folder, hidden ones left out, in the order of their names.

    Raises:
        OSError: If there is no such folder.
        FileFormatError: If it holds no file.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise NotADirectoryError(f"{folder} is no folder; give the folder that holds the files of one series.")
    files = [path for path in sorted(folder.iterdir()) if path.is_file() and not path.name.startswith(".")]
    if not files:
        inside = sorted(path.name for path in folder.iterdir() if path.is_dir())
        advice = f" such as {inside[0]}" if inside else ""
        raise FileFormatError(f"{folder} holds no file; give the folder that holds the files of one series{advice}.")
    return files


def read_views(files: Sequence[Path]) -> Iterator[View | None]:
    """Yield the headers of the files, in their order; None for one that is no view.

    Args:
        files: The files.

    Raises:
        OSError: If a file cannot be read.
        FileFormatError: If one is damaged, incomplete, or of a kind that is not read.
    """
    with ThreadPoolExecutor(_THREADS) as pool:
        try:
            yield from pool.map(read_view, files)
        finally:
            pool.shutdown(cancel_futures=True)


def patient_and_study(view: View) -> dict[str, str]:
    """Return who was scanned, when, and on what, as the header of a view has it.

    Returns:
        Values by DICOM keyword; those that are there.
    """
    names = (*_OF_THE_PATIENT, *_OF_THE_SCAN)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # pydicom's, of values that are against the standard and do no harm
        header = dcmread(view.path, stop_before_pixels=True, specific_tags=[*names])
        return {name: str(header[name].value) for name in names if header.get(name)}
