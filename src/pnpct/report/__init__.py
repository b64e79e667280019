"""Results for readers: a comparison as one offline HTML page, and images beside each other as a picture."""

from pnpct.report.page import write_report
from pnpct.report.panel_layout import PanelRow
from pnpct.report.panels import panel_rows, write_panels

__all__ = ["PanelRow", "panel_rows", "write_panels", "write_report"]
