"""Methods side by side on the same scans: their images, all that was measured of them, and the file that keeps it."""

from pnpct.comparison.candidates import Candidate
from pnpct.comparison.case_record import Case, Detail, Grid, StoredImage
from pnpct.comparison.case_results import CaseResults
from pnpct.comparison.image_hash import image_sha256
from pnpct.comparison.measures import fidelity_values, histogram_values, texture_values
from pnpct.comparison.phantom_records import PhantomJob, PhantomRecord, measure_phantoms, phantom_jobs
from pnpct.comparison.phantom_results import PhantomResults, phantom_results
from pnpct.comparison.phantom_tests import Phantoms, PhantomTests
from pnpct.comparison.plan import Plan
from pnpct.comparison.results import (
    RESULTS,
    Check,
    Comparison,
    Curve,
    DosePoint,
    DoseShare,
    LeastReduction,
    LesionResult,
    Method,
    Task,
    read_comparison,
    write_comparison,
)
from pnpct.comparison.run import compare_cases, summarise
from pnpct.comparison.subjects import Subject, subjects_of
from pnpct.comparison.table_file import write_table
from pnpct.comparison.texture_group import TextureGroup

__all__ = [
    "RESULTS",
    "Candidate",
    "Case",
    "CaseResults",
    "Check",
    "Comparison",
    "Curve",
    "Detail",
    "DosePoint",
    "DoseShare",
    "Grid",
    "LeastReduction",
    "LesionResult",
    "Method",
    "PhantomJob",
    "PhantomRecord",
    "PhantomResults",
    "PhantomTests",
    "Phantoms",
    "Plan",
    "StoredImage",
    "Subject",
    "Task",
    "TextureGroup",
    "compare_cases",
    "fidelity_values",
    "histogram_values",
    "image_sha256",
    "measure_phantoms",
    "phantom_jobs",
    "phantom_results",
    "read_comparison",
    "subjects_of",
    "summarise",
    "texture_values",
    "write_comparison",
    "write_table",
]
