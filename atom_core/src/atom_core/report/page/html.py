"""A report as one HTML file that opens from the disk, without a network."""

from __future__ import annotations

import base64
import gzip
import io
import json
from pathlib import Path
from typing import Any, Optional, Union

import jinja2
from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec

from atom_core.report.page.blocks import Chart, Page, Picture
from atom_core.report.page.pictures import jpeg

_FOLDER = Path(__file__).resolve().parent
VIEWER_FILE = "plotly-gl3d-4.1.1.min.js.gz"
STYLE = {
    "font.size": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#5b6770",
    "axes.labelcolor": "#22272b",
    "svg.hashsalt": "report",
    "svg.fonttype": "path",
}
SIZE_IN, SOLID_SIZE_IN, DOTS_PER_INCH = (3.7, 2.75), (6.6, 4.6), 170
_PAD = 0.4  # around a chart, in heights of its letters


def html(page: Page) -> str:
    """Return the document.

    Args:
        page: what it shows.
    """
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(str(_FOLDER / "templates")),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.filters["picture"] = picture_source
    environment.filters["script_json"] = script_json
    environment.tests["cell"] = lambda value: not isinstance(value, str)
    environment.globals["kind"] = lambda block: type(block).__name__
    template = environment.get_template("report.html.j2")
    return template.render(
        page=page,
        style=_static("report.css"),
        program=_static("viewer.js"),
        library=viewer_library() if page.viewer else "",
        licence=_static("LICENSE.plotly"),
    )


def picture_source(block: Union[Chart, Picture]) -> str:
    """Return a chart or picture as the address of an image that holds its data."""
    if isinstance(block, Picture):
        return _address("image/jpeg", jpeg(block.image))
    if block.dense:
        return _address("image/png", chart_file(block, "png"))
    return _address("image/svg+xml", chart_file(block, "svg"))


def chart_file(chart: Chart, form: str) -> bytes:
    """Return a chart as a file of a form that matplotlib knows: png or svg."""
    with rc_context(STYLE):
        size = SOLID_SIZE_IN if chart.solid else SIZE_IN
        figure = Figure(figsize=size, dpi=DOTS_PER_INCH)
        FigureCanvasAgg(figure)
        chart.draw(axes_of(figure, chart))
        if not chart.solid:  # once: with constrained_layout each chart is drawn twice
            figure.tight_layout(pad=_PAD)
        stream = io.BytesIO()
        metadata = {"Software": None} if form == "png" else {"Date": None}
        figure.savefig(stream, format=form, metadata=metadata)
    return stream.getvalue()


def axes_of(figure: Figure, chart: Chart, place: Optional[SubplotSpec] = None) -> Any:
    """Return axes for a chart, of three dimensions where it needs them.

    Args:
        figure: to which they belong.
        chart: what will be drawn.
        place: cell of a grid; None: the whole figure.
    """
    if not chart.solid:
        return figure.add_subplot(place or 111)
    from mpl_toolkits.mplot3d import Axes3D  # noqa: F401  (registers "3d" in older versions)

    axes = figure.add_subplot(place or 111, projection="3d")
    if place is None:
        axes.set_position((-0.06, -0.02, 1.12, 1.06))
    return axes


def script_json(value: Any) -> str:
    """Return JSON that can stand in an element ``script``."""
    text = json.dumps(value, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def viewer_library() -> str:
    """Return the program that draws in three dimensions (plotly.js, MIT licence)."""
    text = gzip.decompress((_FOLDER / "static" / VIEWER_FILE).read_bytes()).decode("utf-8")
    return text.replace("</script", "<\\/script")


def _static(name: str) -> str:
    return (_FOLDER / "static" / name).read_text(encoding="utf-8")


def _address(form: str, data: bytes) -> str:
    return f"data:{form};base64,{base64.b64encode(data).decode('ascii')}"
