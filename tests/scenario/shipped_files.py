"""Scenarios whose words are pinned: all that ship, those of the examples, the
environments', and one of every table.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import skyarm
from skyarm.records.registry import plugins
from skyarm.records.registry.registrations import _FOUND, SHIPPED
from skyarm.scenario.scenario_file import kind_of_file
from support.components import registry_kept

ROOT = Path(__file__).resolve().parents[2]
PINS = Path(__file__).with_name("pins")
RICH = "rich"
"""A scenario that has every table of a scenario file (``pins/rich.toml``)."""


def _files() -> dict[str, Path]:
    examples = [
        path
        for path in sorted((ROOT / "examples").glob("*.toml"))
        if kind_of_file(str(path)) == "scenario"
    ]
    tasks = sorted((ROOT / "src" / "skyarm" / "envs" / "tasks").glob("*.toml"))
    return {RICH: PINS / "rich.toml"} | {
        f"{path.parent.name}/{path.stem}": path for path in (*examples, *tasks)
    }


FILES = _files()
"""Name -> file of the scenarios that are no name of the library."""

NAMES = (*skyarm.list_scenarios(), *FILES)


@cache
def scenario(name: str) -> skyarm.Scenario:
    """One of ``NAMES``; it may warn."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return skyarm.load_scenario(FILES.get(name, name))


@contextmanager
def only_shipped() -> Iterator[None]:
    """Registry without what other tests of this process added: messages name what is
    there, identities the plugins.
    """
    with registry_kept():
        for rows in _FOUND.values():
            for name in [name for name, row in rows.items() if row.source != SHIPPED]:
                del rows[name]
        plugins._LOADED.clear()
        yield
