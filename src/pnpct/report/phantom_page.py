"""What was measured on images of a phantom, as one HTML page: noise power, transfer, and the numbers."""

from pathlib import Path

from markupsafe import Markup

from pnpct.evaluation import PhantomFigures
from pnpct.files import atomic_path
from pnpct.report.drawing import Line, line_chart
from pnpct.report.environment import environment
from pnpct.report.page import styled
from pnpct.report.results import TOKENS
from pnpct.report.tables import Head, Row, Table
from pnpct.report.words import title_of, unit_of


def write_phantom_page(path: Path, title: str, found: PhantomFigures) -> None:
    """Write curves and numbers as a page that works offline.

    Args:
        path: Where the page shall be.
        title: What was measured.
        found: The numbers and curves.

    Raises:
        OSError: If the page cannot be written.
    """
    rings, transfer = found.power.radial(), found.transfer
    curves = [("Noise power", "noise power, HU² mm²", rings.frequencies, rings.power)]
    if transfer is not None:
        shown = transfer.frequencies <= rings.frequencies[-1]
        name = f"Transfer of a disc of {transfer.contrast_hu:.0f} HU".replace("-", "−")
        curves.append((name, "transfer", transfer.frequencies[shown], transfer.transfer[shown]))
    charts = []
    for name, axis, x, y in curves:
        line = Line(name, TOKENS["ink"], x.tolist(), y.tolist())
        says = f"{name} over frequency; its numbers are in the table below."
        charts.append(line_chart(name, [line], axes=("frequency, 1/mm", axis), says=says))
    rows = tuple(
        Row(title_of(name), (Markup(f"{value:.4g}"),), unit=unit_of(name)) for name, value in found.values.items()
    )
    page = environment().get_template("phantom.html.j2")
    text = page.render(title=title, charts=charts, table=Table("Numbers", (Head("value"),), rows), **styled())
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
