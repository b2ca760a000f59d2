"""Plain tables as TOML text: what :func:`skyarm.files.read_toml` reads back as the same tables."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

_BARE = re.compile(r"[A-Za-z0-9_-]+")

_ESCAPES = {"\\": "\\\\", '"': '\\"', "\b": "\\b", "\t": "\\t", "\n": "\\n", "\f": "\\f", "\r": "\\r"}


def toml_value(value: Any) -> str:
    """A value on one line; tables are written inline.

    Raises:
        TypeError: what TOML has no words for.
    """
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return str(int(value))
    if isinstance(value, float):
        # the shortest text that reads back as this number
        return repr(float(value)) if math.isfinite(value) else str(float(value))
    if isinstance(value, str):
        return f'"{"".join(map(_character, value))}"'
    if isinstance(value, Mapping):
        inner = ", ".join(f"{toml_key(name)} = {toml_value(each)}" for name, each in value.items())
        return f"{{ {inner} }}" if inner else "{}"
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(toml_value, value))}]"
    raise TypeError(f"{type(value).__name__} cannot be written as TOML")


def toml_key(name: str) -> str:
    """A key, in quotes where it must be."""
    return name if _BARE.fullmatch(name) else toml_value(name)


def _character(character: str) -> str:
    if character in _ESCAPES:
        return _ESCAPES[character]
    code = ord(character)
    return f"\\u{code:04x}" if code < 0x20 or code == 0x7F else character


def toml_text(document: Mapping[str, Any]) -> str:
    """A document: its plain values first, then a section for each table and for each table of a list of tables."""
    lines = [f"{toml_key(name)} = {toml_value(value)}" for name, value in document.items() if not _is_section(value)]
    for name, value in document.items():
        if isinstance(value, Mapping):
            lines += _section(f"[{toml_key(name)}]", value)
        elif _is_section(value):
            for table in value:
                lines += _section(f"[[{toml_key(name)}]]", table)
    return "\n".join(lines) + "\n"


def _is_section(value: Any) -> bool:
    listed = isinstance(value, (list, tuple)) and bool(value) and all(isinstance(each, Mapping) for each in value)
    return isinstance(value, Mapping) or listed


def _section(head: str, table: Mapping[str, Any]) -> list[str]:
    return ["", head, *(f"{toml_key(name)} = {toml_value(value)}" for name, value in table.items())]
