"""Results for readers: a comparison as one offline HTML page, and images beside each other as a picture."""

from pnpct.report.page import write_report
from pnpct.report.panels import PanelRow, draw_panels, panel_rows, write_panels

__all__ = ["PanelRow", "draw_panels", "panel_rows", "write_panels", "write_report"]
