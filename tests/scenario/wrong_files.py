"""Wrong scenario files, each with the line that says what is wrong with it.

An entry of ``pins/wrong_files.json`` is a file of this folder (``base``) in which one
entry (``path``) has another ``value``, or, without ``value``, is left out; or it is a
file's whole ``text``. ``message`` is the error without the file's name; null, with a
``note``, where a file is read that should not be. To add one, write it without
``message``; ``python tests/scenario/wrong_files.py --write`` writes all messages anew.
"""

from __future__ import annotations

import copy
import json
import re
import sys
import tempfile
import tomllib
import warnings
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from shipped_files import PINS, only_shipped

import skyarm

FILE = PINS / "wrong_files.json"


@cache
def _base(name: str) -> dict[str, Any]:
    return tomllib.loads((PINS / f"wrong_{name}.toml").read_text("utf-8"))


def document(entry: Mapping[str, Any]) -> dict[str, Any]:
    """The document of an entry that differs from a base."""
    made = copy.deepcopy(_base(entry["base"]))
    *tables, last = (
        int(i) if i else word
        for i, word in re.findall(r"\[(\d+)\]|([^.\[\]]+)", entry["path"])
    )
    at: Any = made
    for table in tables:
        at = at[table] if isinstance(at, list) else at.setdefault(table, {})
    if "value" in entry:
        at[last] = entry["value"]
    else:
        del at[last]
    return made


def message(entry: Mapping[str, Any]) -> str | None:
    """Error of an entry's file; None if it is read."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            if "text" in entry:
                return _message_of_text(entry["text"])
            skyarm.scenario_from(document(entry))
        except skyarm.ScenarioError as error:
            return str(error)
    return None


def _message_of_text(text: str) -> str | None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scenario.toml"
        path.write_bytes(text.encode("latin-1"))
        try:
            skyarm.load_scenario(path)
        except skyarm.ScenarioError as error:
            return str(error).removeprefix(f"{path}: ").replace(str(path), "FILE")
    return None


def entries() -> list[dict[str, Any]]:
    """All wrong files."""
    found: list[dict[str, Any]] = json.loads(FILE.read_text("utf-8"))
    return found


if __name__ == "__main__":
    if sys.argv[1:] != ["--write"]:
        sys.exit("usage: python tests/scenario/wrong_files.py --write")
    with only_shipped():
        told = [{**entry, "message": message(entry)} for entry in entries()]
    FILE.write_text(
        "[\n" + ",\n".join(json.dumps(entry) for entry in told) + "\n]\n", "utf-8"
    )
    print(
        len(told),
        "files,",
        sum(entry["message"] is None for entry in told),
        "of them read",
    )
