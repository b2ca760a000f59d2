"""A Figure as bytes or text for a page, and the script that draws interactive ones; nothing is written to disk."""

from __future__ import annotations

import io
import warnings
from importlib import resources

from matplotlib.figure import Figure

SCRIPTS = ("plot_parts.js", "plot_panels.js", "plot_pointer.js", "plot_path.js", "plot_page.js")


def image_bytes(figure: Figure, kind: str = "png", dpi: float = 160.0) -> bytes:
    """Encode a static figure as "png", "svg" or "pdf", without dates, so that equal figures give equal pixels."""
    stamp = {"png": {"Software": None}, "svg": {"Date": None}, "pdf": {"CreationDate": None}}
    buffer = io.BytesIO()
    with warnings.catch_warnings():
        # a name in letters that the fonts lack is drawn as boxes: no reason for a line for each of them
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        figure.savefig(buffer, format=kind, dpi=dpi, metadata=stamp[kind])
    return buffer.getvalue()


def plot_script() -> str:
    """The script that draws every interactive figure of a page, to be put into it once, at its end."""
    return "".join(_resource(name) for name in SCRIPTS)


def plot_style() -> str:
    """The styles of interactive figures, for light and dark pages."""
    return _resource("plot.css")


def _resource(name: str) -> str:
    return (resources.files(__package__) / name).read_text("utf-8")
