"""Code as results tell it: the name of its file, and SHA-256 of what the file holds."""

from __future__ import annotations

import hashlib
import linecache
import os
import types
from collections.abc import Iterable
from pathlib import Path

MISSING = "missing"
"""Identity of a file that cannot be read any more."""


def numbered(pairs: Iterable[tuple[str, str]]) -> dict[str, str]:
    """Names and identities as a table in which another identity of the same name gets a number."""
    found: dict[str, str] = {}
    for plain, identity in pairs:
        name = plain
        while found.get(name, identity) != identity:
            name = f"{plain} ({len(found) + 1})"
        found[name] = identity
    return found


def file_of(module: types.ModuleType | None) -> str:
    """Path of a module's file, without links; empty where it has none."""
    file = getattr(module, "__file__", None)
    return os.path.realpath(file) if isinstance(file, str) else ""


def identity_of(content: bytes) -> str:
    """What a file's content is told by: "sha256:..."."""
    return f"sha256:{hashlib.sha256(content).hexdigest()}"


def identity_of_file(file: str) -> str:
    """What a file is told by as it is now."""
    try:
        return identity_of(Path(file).read_bytes())
    except OSError:
        return MISSING


def source_of(code: types.CodeType) -> tuple[str, str]:
    """Name and identity of the file that code comes from; what was typed in is told by its lines, else by itself."""
    file = code.co_filename
    identity = identity_of_file(file)
    if identity != MISSING:
        return Path(file).name, identity
    lines = "".join(linecache.getlines(file))  # a notebook's cell
    return "(typed in)", identity_of((lines or _told(code)).encode())


def _told(code: types.CodeType) -> str:
    """All that code does, as a text that is the same in each process."""
    held = [_told(each) if isinstance(each, types.CodeType) else _constant(each) for each in code.co_consts]
    return f"{code.co_name} {code.co_code.hex()} {code.co_names} {code.co_varnames} {code.co_freevars} {held}"


def _constant(value: object) -> str:
    return repr(sorted(map(repr, value))) if isinstance(value, frozenset) else repr(value)
