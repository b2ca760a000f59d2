"""Pictures as files: the format by the suffix."""

from __future__ import annotations

from pathlib import Path

from skyarm.figures.embed import image_bytes
from skyarm.figures.picture_styles import DPI, Picture
from skyarm.files import must_be_one_of, output_file, shown, write_atomically

SUFFIXES = ("png", "svg", "pdf")


def picture_file(name: str, field: str = "file") -> Path:
    """Path of a picture that is to be made, checked before the work.

    Raises:
        ValueError: another suffix; one line with those there are. OSError: it cannot be written.
    """
    if name:
        require_suffix(Path(name), field)
    return output_file(name, field)


def require_suffix(path: Path, field: str = "file") -> str:
    """The suffix of a picture's file, without its dot.

    Raises:
        ValueError: one line.
    """
    suffix = path.suffix.removeprefix(".").lower()
    if suffix not in SUFFIXES:
        raise ValueError(f"{field} = {shown(str(path))}: suffix {shown(suffix)}: {must_be_one_of(SUFFIXES, suffix)}")
    return suffix


def save_picture(figure: Picture, path: Path, style: str) -> Path:
    """Write a picture in the format of its suffix; the file appears whole or not at all."""
    return write_atomically(path, image_bytes(figure, require_suffix(path), dpi=DPI[style]))
