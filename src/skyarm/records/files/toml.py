"""Conversion between TOML text and tables, with each vector on one line."""

from __future__ import annotations

import datetime
import math
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeAlias

from skyarm.records.files.messages import one_line

Entry: TypeAlias = (
    bool
    | int
    | float
    | str
    | datetime.date
    | datetime.time
    | list["Entry"]
    | dict[str, "Entry"]
)
"""Value of a key in a TOML file: a number, text, date, list or table."""

DEEPEST = 64
"""Largest nesting depth of tables and lists in a file; readers recurse, and no file
needs ten."""

LARGEST_BITS = 1024
"""Largest number of bits of a whole number in a file; a larger one fits into no
field."""

MOST_KEYS = 50_000
"""Largest number of keys of a file; the reading time grows with them, and no file needs
a thousand."""

_KEY = re.compile(r"=|^[ \t]*\[[^\],\n]*\]", re.MULTILINE)
"""Pattern of a key's assignment or the head of a table; a row of several numbers does
not match."""

_CHAIN = re.compile(
    rf"""(?<![\w-])(?:["']?[\w-]++["']?[ \t]*+\.[ \t]*+){{{DEEPEST}}}"""
)
"""Pattern of a dotted key with too many parts, whose parsing time grows with their
square."""


def read_toml(content: bytes) -> dict[str, Entry]:
    """Read a TOML file as tables; a byte order mark, as editors on Windows write one,
    is skipped.

    Raises:
        ValueError: one line, without the file's name, which the caller adds.
    """
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ValueError(
            f"byte {error.start} = {error.object[error.start]:#04x}: must be UTF-8 text"
        ) from None
    deep = f"TOML = tables in tables: must be nested at most {DEEPEST} deep"
    # before the parser, whose time grows with the square of the parts
    if _CHAIN.search(text):
        raise ValueError(deep)
    if (keys := len(_KEY.findall(text))) > MOST_KEYS:
        raise ValueError(f"TOML = {keys} keys: must be at most {MOST_KEYS}")
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ValueError(
            one_line(f"TOML = {str(error)!r}: must be valid TOML")
        ) from None
    except RecursionError:
        raise ValueError(deep) from None
    except ValueError:  # of int(): longer than Python reads
        raise ValueError(
            "TOML = a number of thousands of digits: must be at most 1.8e308 in size"
        ) from None
    _require_bounded(document, deep)
    return document


def shipped_tables(module: str) -> dict[str, Any]:
    """Tables of the TOML file beside a module of the same name, from the module's
    ``__file__``.
    """
    return tomllib.loads(Path(module).with_suffix(".toml").read_text("utf-8"))


def _require_bounded(document: dict[str, Entry], deep: str) -> None:
    """Raise an error for tables nested too deeply and for integers too large for any
    field.
    """
    # a list of what is left to do, because recursion has a limit of its own
    waiting: list[tuple[dict[str, Entry] | list[Entry], str, int]] = [(document, "", 1)]
    while waiting:
        value, at, depth = waiting.pop()
        if depth > DEEPEST:
            raise ValueError(deep)
        for key, inner in (
            value.items() if isinstance(value, dict) else enumerate(value)
        ):
            if isinstance(inner, (dict, list)):
                waiting.append((inner, _below(at, key), depth + 1))
            elif isinstance(inner, int) and inner.bit_length() > LARGEST_BITS:
                raise ValueError(
                    one_line(f"{_below(at, key)}: must be at most 1.8e308 in size")
                )


def _below(at: str, key: str | int) -> str:
    if isinstance(key, int):
        return f"{at}[{key}]"
    return f"{at}.{key}" if at else key


_BARE = re.compile(r"[A-Za-z0-9_-]+")

_ESCAPES = {
    "\\": "\\\\",
    '"': '\\"',
    "\b": "\\b",
    "\t": "\\t",
    "\n": "\\n",
    "\f": "\\f",
    "\r": "\\r",
}


def toml_value(value: object) -> str:
    """TOML text of a value on one line; tables are written inline.

    Raises:
        TypeError: what TOML has no words for.
    """
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return str(int(value))
    if isinstance(value, float):
        # the shortest text that reads back as this number
        # TOML writes inf and nan in these letters, too
        return repr(float(value)) if math.isfinite(value) else str(float(value))
    if isinstance(value, str):
        return f'"{"".join(map(_character, value))}"'
    if isinstance(value, Mapping):
        inner = ", ".join(
            f"{toml_key(name)} = {toml_value(each)}" for name, each in value.items()
        )
        return f"{{ {inner} }}" if inner else "{}"
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(toml_value, value))}]"
    raise TypeError(f"{type(value).__name__} cannot be written as TOML")


def toml_key(name: str) -> str:
    """TOML text of a key, in quotes where it needs them."""
    return name if _BARE.fullmatch(name) else toml_value(name)


def _character(character: str) -> str:
    if character in _ESCAPES:
        return _ESCAPES[character]
    code = ord(character)
    return f"\\u{code:04x}" if code < 0x20 or code == 0x7F else character
