"""Methods side by side on the same scans: their images, all that was measured of them, and the file that keeps it."""

from pnpct.comparison.candidates import Candidate
from pnpct.comparison.case_results import CaseResults
from pnpct.comparison.image_hash import image_sha256
from pnpct.comparison.measures import fidelity_values, histogram_values, texture_values
from pnpct.comparison.phantom_tests import phantom_curves, phantom_tasks
from pnpct.comparison.plan import Plan
from pnpct.comparison.results import (
    RESULTS,
    Case,
    Check,
    Comparison,
    Curve,
    Detail,
    DosePoint,
    DoseShare,
    Grid,
    LesionResult,
    Method,
    StoredImage,
    Task,
    read_comparison,
    write_comparison,
)
from pnpct.comparison.run import compare_cases, summarise
from pnpct.comparison.subjects import Subject, subjects_of
from pnpct.comparison.table_file import write_table

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
    "LesionResult",
    "Method",
    "Plan",
    "StoredImage",
    "Subject",
    "Task",
    "compare_cases",
    "fidelity_values",
    "histogram_values",
    "image_sha256",
    "phantom_curves",
    "phantom_tasks",
    "read_comparison",
    "subjects_of",
    "summarise",
    "texture_values",
    "write_comparison",
    "write_table",
]
