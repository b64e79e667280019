"""What `pnpct.files` has, and where; its `__init__.py` imports each when it is first asked for."""

from .array_file import file_and_member, load_array
from .atomic import atomic_folder, atomic_path
from .catsim_results import scan_from_catsim
from .checkpoint import load_network, save_network
from .ct_pd import (
    VIEWS_OF_A_SLAB,
    CTPDSeries,
    patient_and_study,
    projection_files,
    read_slabs,
    read_views,
    series_of,
)
from .dicom_elements import body_part_code
from .dicom_series import read_dicom_series
from .dicom_source import SourceSeries, read_patient, read_source_series, taken_from_scan
from .dicom_writer import check_replaceable, write_dicom_series
from .errors import FileFormatError
from .exposure_file import ExposedSlice, exposure_pixel, read_exposure, tube_voltages, write_exposures
from .geometry_json import WrittenGeometry, read_geometry
from .hdf5 import describe_file
from .image_file import WINDOW, check_window, read_image, write_image
from .image_series import ImageSeries, read_volume
from .import_path import imported, imported_network, is_import_path, where_imported
from .importers import ImportedScan, import_arrays, scan_from_arrays
from .manifest import MANIFEST, SPLITS, ListedScan, Manifest, Split, read_manifest, write_manifest
from .named_denoisers import DEFAULT_DENOISER, load_denoiser, network_file, network_names, read_network
from .nifti_file import packed_nifti
from .onnx_file import export_onnx
from .provenance import Provenance, record_run, sha256_of, sha256_of_folder, write_sidecar
from .scan_file import SCAN, read_scan, read_scan_geometry, read_truth, write_scan, write_scan_slabs
from .series_input import read_series
from .series_resampling import evenly_spaced
from .slab_folder import SlabFolder
from .sole_writer import sole_writer
from .xcist_phantom import FractionMap, read_xcist_phantom, write_xcist_phantom

__all__ = [
    "DEFAULT_DENOISER",
    "MANIFEST",
    "SCAN",
    "SPLITS",
    "VIEWS_OF_A_SLAB",
    "WINDOW",
    "CTPDSeries",
    "ExposedSlice",
    "FileFormatError",
    "FractionMap",
    "ImageSeries",
    "ImportedScan",
    "ListedScan",
    "Manifest",
    "Provenance",
    "SlabFolder",
    "SourceSeries",
    "Split",
    "WrittenGeometry",
    "atomic_folder",
    "atomic_path",
    "body_part_code",
    "check_replaceable",
    "check_window",
    "describe_file",
    "evenly_spaced",
    "export_onnx",
    "exposure_pixel",
    "file_and_member",
    "import_arrays",
    "imported",
    "imported_network",
    "is_import_path",
    "load_array",
    "load_denoiser",
    "load_network",
    "network_file",
    "network_names",
    "packed_nifti",
    "patient_and_study",
    "projection_files",
    "read_dicom_series",
    "read_exposure",
    "read_geometry",
    "read_image",
    "read_manifest",
    "read_network",
    "read_patient",
    "read_scan",
    "read_scan_geometry",
    "read_series",
    "read_slabs",
    "read_source_series",
    "read_truth",
    "read_views",
    "read_volume",
    "read_xcist_phantom",
    "record_run",
    "save_network",
    "scan_from_arrays",
    "scan_from_catsim",
    "series_of",
    "sha256_of",
    "sha256_of_folder",
    "sole_writer",
    "taken_from_scan",
    "tube_voltages",
    "where_imported",
    "write_dicom_series",
    "write_exposures",
    "write_image",
    "write_manifest",
    "write_scan",
    "write_scan_slabs",
    "write_sidecar",
    "write_xcist_phantom",
]
