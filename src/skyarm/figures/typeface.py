"""The typeface that comes with Matplotlib, as a file: the same letters on every machine."""

from __future__ import annotations

from pathlib import Path

import matplotlib


def typeface(*, bold: bool = False) -> Path:
    """File of DejaVu Sans."""
    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return Path(matplotlib.get_data_path()) / "fonts" / "ttf" / name
