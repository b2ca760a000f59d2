"""Pictures as files: the format by the suffix."""

from __future__ import annotations

from pathlib import Path

from skyarm.figures.embed import image_bytes
from skyarm.figures.picture_styles import DPI, Picture
from skyarm.files import write_atomically
from skyarm.files.names import require_suffix


def save_picture(figure: Picture, path: Path, style: str) -> Path:
    """Write a picture in the format of its suffix; the file appears whole or not at all."""
    return write_atomically(path, image_bytes(figure, require_suffix(path), dpi=DPI[style]))
