"""TOML text as tables: the one reader of every file of ours, whose refusals are one line each."""

from __future__ import annotations

import re
import tomllib
from typing import Any

from skyarm.files.one_line import one_line

DEEPEST = 64
"""Tables and arrays in one another: readers of tables call themselves, and no file of ours needs ten."""

LARGEST_BITS = 1024
"""Of a whole number: one above 1.8e308 fits into no field, and Python refuses to write out one of 4300 digits."""

_CHAIN = re.compile(rf"""(?<![\w-])(?:["']?[\w-]++["']?[ \t]*+\.[ \t]*+){{{DEEPEST}}}""")
"""A key of too many parts: the library's time grows with their square."""


def read_toml(content: bytes) -> dict[str, Any]:
    """Tables of a TOML file; a byte order mark before it is skipped, as editors on Windows write one.

    Raises:
        ValueError: one line, without the file's name, which the caller adds.
    """
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ValueError(f"byte {error.start} = {error.object[error.start]:#04x}: must be UTF-8 text") from None
    deep = f"TOML = tables in tables: must be nested at most {DEEPEST} deep"
    if _CHAIN.search(text):
        raise ValueError(deep)
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ValueError(one_line(f"TOML = {str(error)!r}: must be valid TOML")) from None
    except RecursionError:
        raise ValueError(deep) from None
    except ValueError:  # of int(): longer than Python reads
        raise ValueError("TOML = a number of thousands of digits: must be at most 1.8e308 in size") from None
    _require_bounded(document, deep)
    return document


def _require_bounded(document: dict[str, Any], deep: str) -> None:
    """Refuse what is nested too deeply, and whole numbers that no field can hold."""
    waiting: list[tuple[Any, str, int]] = [(document, "", 1)]
    while waiting:
        value, at, depth = waiting.pop()
        if depth > DEEPEST:
            raise ValueError(deep)
        for key, inner in value.items() if isinstance(value, dict) else enumerate(value):
            if isinstance(inner, (dict, list)):
                waiting.append((inner, _below(at, key), depth + 1))
            elif isinstance(inner, int) and inner.bit_length() > LARGEST_BITS:
                raise ValueError(one_line(f"{_below(at, key)}: must be at most 1.8e308 in size"))


def _below(at: str, key: str | int) -> str:
    if isinstance(key, int):
        return f"{at}[{key}]"
    return f"{at}.{key}" if at else key
