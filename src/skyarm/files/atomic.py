"""Files that appear whole or not at all."""

from __future__ import annotations

import contextlib
import errno
import os
import secrets
import tempfile
from pathlib import Path

from skyarm.files.fields import shown


def write_atomically(path: str | os.PathLike[str], content: bytes) -> Path:
    """Write to a temporary file beside the target, then rename; a cut-off run leaves no half file.

    A link is followed. A device or a pipe, such as /dev/stdout, is written into, never replaced.

    Raises:
        OSError: with one line that names the file.
    """
    target = Path(os.path.realpath(path))
    if target.is_dir() or target.is_symlink():
        reason = os.strerror(errno.EISDIR if target.is_dir() else errno.ELOOP)
        raise OSError(f"file = {str(path)!r}: must be writable ({reason})")
    # a name of its own for every writer; opened as an ordinary new file, so that the usual rights apply
    temporary = target.with_name(f".{target.name}.{secrets.token_hex(6)}.part")
    try:
        if target.exists() and not target.is_file():
            target.write_bytes(content)
            return Path(path)
        target.parent.mkdir(parents=True, exist_ok=True)
        with temporary.open("xb") as stream:
            stream.write(content)
        temporary.replace(target)
    except OSError as error:
        _forget(temporary)
        raise OSError(f"file = {str(path)!r}: must be writable ({error.strerror})") from error
    except BaseException:
        _forget(temporary)
        raise
    return Path(path)


def _forget(temporary: Path) -> None:
    """Remove a temporary file if it is there; the error that led here is the one to report."""
    with contextlib.suppress(OSError):
        temporary.unlink()


def require_writable(folder: str | os.PathLike[str]) -> Path:
    """Make an output folder and prove that a file can be written there, before any work is done.

    Raises:
        ValueError: no name at all.
        OSError: with one line that names the folder.
    """
    if not isinstance(folder, (str, os.PathLike)) or not os.fspath(folder):
        raise ValueError(f"output folder = {folder!r}: must be the path of a folder")
    target = Path(folder)
    try:
        target.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=target):
            pass
    except (OSError, ValueError) as error:  # a NUL in its name is a ValueError
        reason = getattr(error, "strerror", None) or error
        raise OSError(f"output folder = {shown(str(target))}: must be writable ({reason})") from None
    return target


def output_file(name: str, field: str) -> Path:
    """Path of a file to come, checked before any work is done.

    Args:
        name: as it was given.
        field: what it was given to, for the message.

    Raises:
        ValueError: no name at all.
        OSError: it is a folder, or its own folder cannot be written.
    """
    if not name:
        raise ValueError(f"{field} = '': must be the path of a file")
    file = Path(name)
    require_replaceable(file)
    require_writable(file.parent)
    return file


def require_replaceable(*files: Path) -> None:
    """Refuse names of files to come that are taken by folders, before any work is done.

    Raises:
        OSError: with one line that names the first of them.
    """
    for file in files:
        if file.is_dir():
            raise OSError(f"file = {shown(str(file))}: must be writable (there is a folder of this name)")
