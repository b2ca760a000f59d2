"""TOML documents of tables, for tests that write files."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from skyarm.records.files.toml import toml_key, toml_value


def toml_text(document: Mapping[str, Any]) -> str:
    """TOML document of a table: plain values first, then a section for each table and list of tables."""
    lines = [f"{toml_key(name)} = {toml_value(value)}" for name, value in document.items() if not _is_section(value)]
    for name, value in document.items():
        if isinstance(value, Mapping):
            lines += _section(f"[{toml_key(name)}]", value)
        elif _is_section(value):
            for table in value:
                lines += _section(f"[[{toml_key(name)}]]", table)
    return "\n".join(lines) + "\n"


def _is_section(value: object) -> bool:
    listed = isinstance(value, (list, tuple)) and bool(value) and all(isinstance(each, Mapping) for each in value)
    return isinstance(value, Mapping) or listed


def _section(head: str, table: Mapping[str, Any]) -> list[str]:
    return ["", head, *(f"{toml_key(name)} = {toml_value(value)}" for name, value in table.items())]
