"""Private files of one user: not writable by others, and ignored if another user could
have written them.

On systems without such rights (Windows, whose user folders are closed by themselves)
owner and mode are not looked at.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

WITH_OWNERS = hasattr(os, "geteuid")

OTHERS, OTHERS_WRITE = 0o077, 0o022
"""Permission bits of group and others: all of them, and those for writing."""

# no link is followed, and a pipe does not block
_READ = os.O_RDONLY | sum(
    getattr(os, name, 0)
    for name in ("O_NOFOLLOW", "O_NONBLOCK", "O_CLOEXEC", "O_BINARY")
)
_NEW = (
    os.O_WRONLY
    | os.O_CREAT
    | os.O_EXCL
    | sum(getattr(os, name, 0) for name in ("O_CLOEXEC", "O_BINARY"))
)


def private_folder(folder: Path, ours: Callable[[str], bool]) -> str:
    """Create a private folder; restrict the access to an existing one if it holds
    nothing else.

    A folder with other files in it keeps its rights: it is used if no other user may
    write there.

    Args:
        folder: made if missing.
        ours: true if a file of this name belongs there.

    Returns:
        Why it must not be used, in words; empty if it may.

    Raises:
        OSError: it cannot be made, or is no folder.
    """
    if not folder.is_dir():
        folder.parent.mkdir(parents=True, exist_ok=True)
        # another process made it meanwhile; or it is a file, as is seen below
        with suppress(FileExistsError):
            folder.mkdir(mode=0o700)
    status = folder.stat()
    if not stat.S_ISDIR(status.st_mode):
        raise NotADirectoryError(f"file = {str(folder)!r}: must be a folder")
    if not WITH_OWNERS:
        return ""
    if status.st_uid != os.geteuid():
        return "it belongs to another user"
    # another user could redirect the link later; root's links are the system's
    if folder.lstat().st_uid not in (os.geteuid(), 0):
        return "it is a link of another user"
    if not status.st_mode & OTHERS:
        return ""
    # nobody else's files lose rights by it
    if all(ours(each.name) for each in folder.iterdir()):
        with suppress(OSError):
            folder.chmod(0o700)
        if folder.stat().st_mode & OTHERS_WRITE:
            return "others may write into it, and that cannot be changed"
    elif status.st_mode & OTHERS_WRITE:
        return (
            "others may write into it, and it holds other files, so its rights are left"
            " alone; name another folder"
        )
    return ""


def read_private(file: Path, most: int, *, secret: bool = False) -> bytes | None:
    """Content of a file that only the present user can write; None if it is missing or
    others can write it.

    Args:
        file: a regular file of this user; a link is not followed.
        most: bytes; a larger file is not read.
        secret: others must not be able to read it either.
    """
    try:
        descriptor = os.open(file, _READ)
    # a ValueError is a path with a zero byte
    except (OSError, ValueError):
        return None
    try:
        # of the open file, because its path may lead to another one by now
        status = os.fstat(descriptor)
        if not stat.S_ISREG(status.st_mode) or status.st_size > most:
            return None
        if WITH_OWNERS and (
            status.st_uid != os.geteuid()
            or status.st_mode & (OTHERS if secret else OTHERS_WRITE)
        ):
            return None
        with os.fdopen(descriptor, "rb", closefd=False) as stream:
            return stream.read()
    except OSError:
        return None
    finally:
        os.close(descriptor)


def write_private(file: Path, content: bytes, *, replace: bool = True) -> None:
    """Write a file atomically with mode 0600; a link at its path is replaced, not
    followed.

    Args:
        file: file to write, in a folder that is there.
        content: content of the file.
        replace: false leaves a file that is there, or that another process makes at the
            same time, as it is.

    Raises:
        OSError: it cannot be written.
    """
    # random, so that no other user can lay a file or a link at that name beforehand
    temporary = file.with_name(f".{file.name}.{os.urandom(6).hex()}.part")
    try:
        with os.fdopen(os.open(temporary, _NEW, 0o600), "wb") as stream:
            stream.write(content)
        if replace:
            temporary.replace(file)
        else:
            _link(temporary, file)
    finally:
        with suppress(OSError):
            temporary.unlink()


def _link(temporary: Path, file: Path) -> None:
    """Move a temporary file to its final name, unless a file of that name already
    exists.
    """
    with suppress(FileExistsError):
        try:
            # linking fails if the name exists, which a rename does not
            os.link(temporary, file)
        except FileExistsError:
            raise
        except OSError:  # a file system without hard links
            if not os.path.lexists(file):
                temporary.replace(file)
