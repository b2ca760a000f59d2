"""What a TOML file describes, by its tables: so that a vehicle given as a scenario is called a vehicle."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

from skyarm.files.one_line import shown
from skyarm.files.read import unreadable
from skyarm.files.suggestions import did_you_mean
from skyarm.files.toml_text import read_toml

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


def names_in(library: Traversable) -> tuple[str, ...]:
    """Names of the shipped files of a folder."""
    return tuple(sorted(Path(entry.name).stem for entry in library.iterdir() if entry.name.endswith(".toml")))


def read_named(text: str, kind: str, library: Traversable, others: str = "") -> tuple[dict[str, Any], Path]:
    """Tables of a shipped file by its name, or of a file by its path, and the folder in which its paths start.

    Args:
        text: name or path.
        kind: of the file, a key of ``READS``.
        library: folder of the shipped files.
        others: what else may be given, for messages.

    Raises:
        ValueError: one line that begins with the kind, or with the file.
    """
    names, path = names_in(library), Path(text)
    field, plural = f"{kind} = {shown(text)}", "studies" if kind == "study" else f"{kind}s"
    known = f"shipped {plural} are {', '.join(names)}"
    if text in names:
        content, folder = (library / f"{text}.toml").read_bytes(), Path()
    elif path.suffix != ".toml":
        allowed = f"{did_you_mean(text, names)}must be the path of a .toml file{others or ' or a name'}"
        raise ValueError(f"{field}: {allowed}; {known}")
    elif reason := unreadable(path):
        raise ValueError(f"{field}: {reason}; {known}")
    else:
        try:
            content, folder = path.read_bytes(), path.parent
        except OSError as error:
            raise ValueError(f"{field}: must be readable ({error.strerror}); {known}") from None
    try:
        document = read_toml(content)
        require_kind(document, kind)
    except ValueError as error:
        raise ValueError(f"{text}: {error}") from None
    return document, folder
