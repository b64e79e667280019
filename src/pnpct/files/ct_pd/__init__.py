"""Clinical projection data in DICOM-CT-PD, the format of the public collections, one view in each file.

Read are the dictionaries of versions 8 and 10 and the early files before them, of Siemens and GE; not those of several
views in a file. The headers come first, the pixels then, in slabs of views.

References:
    Chen et al., Med. Phys. 42 (2015) 6964; Moen et al., Med. Phys. 48 (2021) 902.
"""

from pnpct.files.ct_pd.folder import patient_and_study, projection_files, read_views
from pnpct.files.ct_pd.pixels import VIEWS_OF_A_SLAB, Slab, read_slabs
from pnpct.files.ct_pd.series import CTPDSeries, series_of
from pnpct.files.ct_pd.view import Layout, View, read_view

__all__ = [
    "VIEWS_OF_A_SLAB",
    "CTPDSeries",
    "Layout",
    "Slab",
    "View",
    "patient_and_study",
    "projection_files",
    "read_slabs",
    "read_view",
    "read_views",
    "series_of",
]
