"""Names registered by the library: kind -> name -> (location, title).

Leaves are rooms that nothing imports (``pyproject.toml``): links, identification with
its flight data, the paper. What they perform is found by its row in ``shipped.toml``.
"""

from __future__ import annotations

from collections.abc import Mapping

from skyarm.records.files import shipped_tables

_TABLES = shipped_tables(__file__)


def _rows(
    tables: Mapping[str, Mapping[str, list[str]]],
) -> dict[str, dict[str, tuple[str, str]]]:
    return {
        kind: {name: (location, title) for name, (location, title) in rows.items()}
        for kind, rows in tables.items()
    }


KINDS: Mapping[str, str] = _TABLES["kinds"]
"""Kinds of extensions that can be registered, each with the requirements on the
registered object."""

SECTIONS: Mapping[str, Mapping[str, tuple[str, str]]] = _rows(_TABLES["sections"])
"""Section of the help -> command -> (location, line of the help), in the order of the
help.

Where the module of a command has SUBCOMMANDS, words and functions, a command of its own
stands behind each word.
"""

OPTIONS: Mapping[str, str] = _TABLES["options"]
"""Command-line option that a separate module performs -> location of the function in
that module."""

SHIPPED: Mapping[str, Mapping[str, tuple[str, str]]] = {
    **_rows(_TABLES["shipped"]),
    "command": {
        name: row for section in SECTIONS.values() for name, row in section.items()
    },
}

RESERVED: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "command": {"a command": (*SHIPPED["command"],)},
    "law": {
        "a preset": (*_TABLES["presets"],),
        "the controller of the scenario": ("own",),
    },
}
"""Names that users cannot register: kind -> description of the present owner ->
names."""

TUNED = "_tuned"
"""Suffix of a shipped law's name that selects its tuned gains."""


def reserved_for(kind: str, name: str) -> str | None:
    """Description of the library object that already has a name; None if the name is
    free for users.
    """
    # a name of that ending would be read as a law's tuned gains
    if (
        kind == "law"
        and name.endswith(TUNED)
        and name.removesuffix(TUNED) in SHIPPED["law"]
    ):
        return f"the tuned gains of {name.removesuffix(TUNED)!r}"
    return next(
        (what for what, names in RESERVED.get(kind, {}).items() if name in names), None
    )
