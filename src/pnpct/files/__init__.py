"""Numbers and disk: scans, images and their provenance, and what other programs have written."""

from pnpct.files.array_file import file_and_member, load_array
from pnpct.files.atomic import atomic_folder, atomic_path
from pnpct.files.catsim_results import scan_from_catsim
from pnpct.files.checkpoint import load_network, save_network
from pnpct.files.ct_pd import (
    VIEWS_OF_A_SLAB,
    CTPDSeries,
    patient_and_study,
    projection_files,
    read_slabs,
    read_views,
    series_of,
)
from pnpct.files.dicom_elements import body_part_code
from pnpct.files.dicom_series import read_dicom_series
from pnpct.files.dicom_source import SourceSeries, read_patient, read_source_series, taken_from_scan
from pnpct.files.dicom_writer import check_replaceable, write_dicom_series
from pnpct.files.errors import FileFormatError
from pnpct.files.exposure_file import ExposedSlice, read_exposure, tube_voltages, write_exposures
from pnpct.files.geometry_json import WrittenGeometry, read_geometry
from pnpct.files.hdf5 import describe_file
from pnpct.files.image_file import check_window, read_image, write_image
from pnpct.files.image_series import ImageSeries, read_volume
from pnpct.files.importers import ImportedScan, import_arrays, scan_from_arrays
from pnpct.files.manifest import MANIFEST, SPLITS, ListedScan, Manifest, Split, read_manifest, write_manifest
from pnpct.files.named_denoisers import DEFAULT_DENOISER, load_denoiser, network_file, network_names
from pnpct.files.onnx_file import export_onnx
from pnpct.files.provenance import Provenance, record_run, sha256_of, write_sidecar
from pnpct.files.scan_file import FORMAT as SCAN
from pnpct.files.scan_file import read_scan, read_scan_geometry, read_truth, write_scan, write_scan_slabs
from pnpct.files.series_resampling import evenly_spaced
from pnpct.files.slab_folder import SlabFolder
from pnpct.files.sole_writer import sole_writer
from pnpct.files.xcist_phantom import FractionMap, read_xcist_phantom, write_xcist_phantom

__all__ = [
    "DEFAULT_DENOISER",
    "MANIFEST",
    "SCAN",
    "SPLITS",
    "VIEWS_OF_A_SLAB",
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
    "file_and_member",
    "import_arrays",
    "load_array",
    "load_denoiser",
    "load_network",
    "network_file",
    "network_names",
    "patient_and_study",
    "projection_files",
    "read_dicom_series",
    "read_exposure",
    "read_geometry",
    "read_image",
    "read_manifest",
    "read_patient",
    "read_scan",
    "read_scan_geometry",
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
    "sole_writer",
    "taken_from_scan",
    "tube_voltages",
    "write_dicom_series",
    "write_exposures",
    "write_image",
    "write_manifest",
    "write_scan",
    "write_scan_slabs",
    "write_sidecar",
    "write_xcist_phantom",
]
