"""Numbers and disk: scans, images and their provenance, and what other programs have written."""

from pnpct.files.array_file import load_array
from pnpct.files.atomic import atomic_path
from pnpct.files.catsim_results import scan_from_catsim
from pnpct.files.errors import FileFormatError
from pnpct.files.geometry_json import WrittenGeometry, read_geometry
from pnpct.files.hdf5 import describe_file
from pnpct.files.image_file import read_image, write_image
from pnpct.files.importers import scan_from_arrays
from pnpct.files.provenance import Provenance, record_run, sha256_of, write_sidecar
from pnpct.files.scan_file import read_scan, read_truth, write_scan

__all__ = [
    "FileFormatError",
    "Provenance",
    "WrittenGeometry",
    "atomic_path",
    "describe_file",
    "load_array",
    "read_geometry",
    "read_image",
    "read_scan",
    "read_truth",
    "record_run",
    "scan_from_arrays",
    "scan_from_catsim",
    "sha256_of",
    "write_image",
    "write_scan",
    "write_sidecar",
]
