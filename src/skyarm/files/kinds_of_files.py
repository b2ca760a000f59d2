"""What a TOML file describes, by its tables: so that a vehicle given as a scenario is called a vehicle."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

VEHICLES = ("rotors", "base", "urdf", "mjcf", "airframe", "attach")
"""Words of a vehicle file that no other file has."""

READS = {
    "vehicle": "skyarm show",
    "scenario": "skyarm run",
    "study": "skyarm sweep",
    "gains": "skyarm run SCENARIO --controller",
}
"""Kind of a file -> a command that reads it."""


def kind_of(document: Mapping[str, Any]) -> str:
    """One of ``READS``, or nothing where the tables do not tell."""
    if "scenario" in document and ("vary" in document or "episodes" in document or "design" in document):
        return "study"
    if "gains" in document and "law" in document:
        return "gains"
    if "plant" in document or "controller" in document:
        return "scenario"
    return "vehicle" if any(word in document for word in VEHICLES) else ""


def require_kind(document: Any, wanted: str) -> None:
    """Refuse a file of another kind.

    Raises:
        ValueError: one line.
    """
    found = kind_of(document) if isinstance(document, Mapping) else ""
    if found and found != wanted:
        a, b = (kind if kind != "gains" else "file of gains" for kind in (wanted, found))
        a, b = (each if each.startswith("file") else f"{each} file" for each in (a, b))
        raise ValueError(f"{wanted}: must be a {a}, and this is a {b}, for '{READS[found]}'")
