"""Names of files of pictures: the format by the suffix. Knows no Matplotlib, which takes a second to load."""

from __future__ import annotations

from pathlib import Path

from skyarm.files.atomic import output_file
from skyarm.files.one_line import shown
from skyarm.files.suggestions import must_be_one_of

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
