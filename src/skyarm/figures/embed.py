"""A Figure as bytes or text for a page; nothing is written to disk."""

from __future__ import annotations

import io
from typing import Any

from matplotlib.figure import Figure


def image_bytes(figure: Figure, kind: str = "png", dpi: float = 160.0) -> bytes:
    """Encode a static figure as "png", "svg" or "pdf", without dates, so that equal figures give equal pixels."""
    stamp = {"png": {"Software": None}, "svg": {"Date": None}, "pdf": {"CreationDate": None}}
    buffer = io.BytesIO()
    figure.savefig(buffer, format=kind, dpi=dpi, metadata=stamp[kind])
    return buffer.getvalue()


def plotly_library() -> str:
    """Source of plotly.js, to be put into a page once."""
    from plotly.offline import get_plotlyjs

    return str(get_plotlyjs())


def plotly_spec(figure: Any) -> str:
    """JSON of an interactive figure; plotly writes "<" as an escape, so that it is safe inside a script element."""
    return str(figure.to_json(remove_uids=True))
