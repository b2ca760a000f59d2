"""Whole text of a record, by which two are told apart: the text that a notebook prints is short."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any


def whole_text(value: Any) -> str:
    """Every field at any depth, as the text of a plain dataclass has it."""
    if is_dataclass(value) and not isinstance(value, type):
        held = ", ".join(f"{each.name}={whole_text(getattr(value, each.name))}" for each in fields(value) if each.repr)
        return f"{type(value).__qualname__}({held})"
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{key!r}: {whole_text(each)}' for key, each in value.items())}}}"
    return f"({', '.join(map(whole_text, value))})" if isinstance(value, (tuple, list)) else repr(value)
