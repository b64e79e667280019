"""Results for readers: a comparison as one offline HTML page, and images beside each other as a picture.

Volumes as pages to scroll through; phantoms as pages of curves; any value as a figure in a notebook.
"""

from pnpct.report.page import write_report
from pnpct.report.panels import PanelRow, draw_panels, panel_rows, write_panels
from pnpct.report.phantom_page import write_phantom_page
from pnpct.report.show import show
from pnpct.report.volumes import write_volume_page

__all__ = [
    "PanelRow",
    "draw_panels",
    "panel_rows",
    "show",
    "write_panels",
    "write_phantom_page",
    "write_report",
    "write_volume_page",
]
