"""Methods side by side on the same scans: their images, all that was measured of them, and the file that says it."""

from pnpct.comparison.all_scans import compare, compare_scans, summarise
from pnpct.comparison.image_hash import image_sha256
from pnpct.comparison.imported_methods import imported_methods
from pnpct.comparison.measures import (
    fidelity_values,
    histogram_values,
    score_definitions,
    texture_values,
    why_no_texture,
)
from pnpct.comparison.methods import (
    Candidate,
    Candidates,
    PaperMethods,
    Reconstruct,
    controls,
)
from pnpct.comparison.metrics_file import RESULTS, read_comparison, write_comparison
from pnpct.comparison.one_scan import OneScan, compare_one_scan
from pnpct.comparison.phantoms import Phantoms, lesion_in_words
from pnpct.comparison.schema import (
    Case,
    Check,
    ComparedMethod,
    Comparison,
    Curve,
    Detail,
    DosePoint,
    DoseShare,
    LeastReduction,
    StoredImage,
    Task,
    TextureGroup,
)
from pnpct.comparison.study import Study
from pnpct.comparison.subjects import Subject, subjects_of
from pnpct.comparison.table import write_table

__all__ = [
    "RESULTS",
    "Candidate",
    "Candidates",
    "Case",
    "Check",
    "ComparedMethod",
    "Comparison",
    "Curve",
    "Detail",
    "DosePoint",
    "DoseShare",
    "LeastReduction",
    "OneScan",
    "PaperMethods",
    "Phantoms",
    "Reconstruct",
    "StoredImage",
    "Study",
    "Subject",
    "Task",
    "TextureGroup",
    "compare",
    "compare_one_scan",
    "compare_scans",
    "controls",
    "fidelity_values",
    "histogram_values",
    "image_sha256",
    "imported_methods",
    "lesion_in_words",
    "read_comparison",
    "score_definitions",
    "subjects_of",
    "summarise",
    "texture_values",
    "why_no_texture",
    "write_comparison",
    "write_table",
]
