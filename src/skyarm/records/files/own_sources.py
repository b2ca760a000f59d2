"""Digest of the library's own source files, under which a command stores what their code has made."""

from __future__ import annotations

import hashlib
import os
import sys
import time
from functools import cache

from skyarm.records.files.user_code import PACKAGE

MARGIN = 2.0
"""Time (s) before the command within which a changed file may have been loaded in an older state; the time stamps of
some file systems are as coarse."""

LOADED = "skyarm.algebra"
"""Module that all modules load whose code could take part in a flight."""

_begun = list[float]()


def begin_command() -> None:
    """Note that this process was started for a command: apart from plugins, no code but the library's runs in it.

    Where modules of the library are loaded already, somebody else calls the command, and may have replaced functions.
    """
    if LOADED not in sys.modules:
        _begun[:] = [time.time()]


def sources_digest() -> str:
    """SHA-256 of all files of the library, which is that of the code in this process.

    Empty where it may be of other code: outside a command, where functions can be replaced, and where a file has
    changed since the command began.
    """
    return _digest(_begun[0]) if _begun else ""


@cache
def _digest(begun: float) -> str:
    digest = hashlib.sha256()
    for folder, folders, names in os.walk(PACKAGE):
        folders[:] = sorted(each for each in folders if each != "__pycache__")
        for name in sorted(names):
            path = os.path.join(folder, name)
            with open(path, "rb") as file:
                if os.fstat(file.fileno()).st_mtime > begun - MARGIN:
                    return ""
                content = file.read()
            digest.update(f"{path.removeprefix(PACKAGE)}\0{len(content)}\0".encode() + content)
    return digest.hexdigest()
