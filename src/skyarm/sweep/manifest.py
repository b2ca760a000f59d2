"""The manifest of a study's folder: whose rows it holds, and how many were there when it was written.

The files of rows are the record of what was flown, and each of them says whose it is: a manifest that is lost is made
anew from them. A folder may come from anyone, so everything in it is checked here before it is used.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from skyarm.files import Fields, shown, unreadable
from skyarm.sweep.facts import origin_from, plain_json, text, whole
from skyarm.sweep.origin import Origin
from skyarm.sweep.study import StudyError

MANIFEST = "manifest.json"

SCHEMAS = (1, 2)
"""Of manifests that are read; 1 had a list of all files with their checksums, which files carry themselves now."""


@dataclass(frozen=True, kw_only=True)
class Manifest:
    """What a folder says of its study.

    Attributes:
        origin: study, scenarios, version of skyarm.
        title: one line for people. success: metric -> largest value of a successful episode.
        versions: of the packages that the bits of rows may depend on.
        complete, rows: all rows were there; how many were, when this was written.
        listed: chunk -> SHA-256 of its file, in a manifest of schema 1.
        rebuilt: from the rows, which say neither title nor success.
        units: path of a varied number -> its SI unit. noise: whether episodes draw random numbers while they fly; None
            where a folder does not say, as those of older versions.
    """

    origin: Origin
    title: str = ""
    success: Mapping[str, float] = field(default_factory=dict)
    versions: Mapping[str, str]
    complete: bool = False
    rows: int = 0
    listed: Mapping[int, str] = field(default_factory=dict)
    rebuilt: bool = False
    units: Mapping[str, str] = field(default_factory=dict)
    noise: bool | None = None

    @property
    def name(self) -> str:
        """Name of the study."""
        return str(self.origin.study["name"])

    def content(self, chunks: int) -> bytes:
        """The file, which says that this many chunks are there."""
        plain = {
            "schema": SCHEMAS[-1],
            "name": self.name,
            "title": self.title,
            "digest": self.origin.digest,
            "study": self.origin.study,
            "scenarios": self.origin.scenarios,
            "success": self.success,
            "versions": self.versions,
            "units": self.units,
            "noise": self.noise,
            "complete": self.complete,
            "rows": self.rows,
            "chunks": {"done": chunks, "of": self.origin.chunks},
        }
        return (json.dumps(plain, indent=1) + "\n").encode()


def read_manifest(folder: str | os.PathLike[str]) -> Manifest | None:
    """Manifest of a study's folder; None where there is none, or only the beginning of one.

    Raises:
        StudyError: it is no manifest; one line with file, field, value and what is allowed.
        OSError: it cannot be read.
    """
    path = Path(folder) / MANIFEST
    try:
        why = unreadable(path)
        if why:
            if os.path.lexists(path):
                raise ValueError(f"must be a file ({why})")
            return None
        return _manifest(plain_json(path.read_bytes()))
    except (json.JSONDecodeError, UnicodeDecodeError):
        return None
    except ValueError as error:
        raise StudyError(f"{path}: {' '.join(str(error).split())}") from None


def _manifest(table: Any) -> Manifest:
    """Manifest from what its file holds."""
    if not isinstance(table, dict):
        raise ValueError(f"manifest = {shown(table)}: must be a table")
    top = Fields(table, "")
    schema = top.take("schema")
    if isinstance(schema, bool) or schema not in SCHEMAS:
        raise ValueError(f"schema = {shown(schema)}: must be a manifest of schema {' or '.join(map(str, SCHEMAS))}")
    versions = Fields(top.take("versions"), "versions")
    version = text("versions.skyarm", versions.take("skyarm"))
    origin = origin_from(top.table, version)
    for name in ("study", "scenarios", "chunks"):
        top.take(name)
    if top.take("name") != origin.study["name"]:
        raise ValueError(f"name = {shown(top.take('name'))}: must be that of the study, {origin.study['name']!r}")
    if top.take("digest") != origin.digest:
        raise ValueError(f"digest = {shown(top.take('digest'))}: must be that of study and scenarios")
    complete = top.take("complete")
    if not isinstance(complete, bool):
        raise ValueError(f"complete = {shown(complete)}: must be true or false")
    limits = Fields(top.take("success"), "success")
    units = Fields(top.take("units", {}), "units")
    noise = top.take("noise", None)
    if noise is not None and not isinstance(noise, bool):
        raise ValueError(f"noise = {shown(noise)}: must be true or false")
    found = Manifest(
        origin=origin,
        title=text("title", top.take("title")),
        success={name: limits.number(name) for name in limits.table},
        versions={name: text(versions.at(name), value) for name, value in versions.table.items()},
        complete=complete,
        rows=whole("rows", top.take("rows"), origin.rows, low=0),
        units={name: text(units.at(name), value) for name, value in units.table.items()},
        noise=noise,
        listed=_listed(top.take("chunks"), origin) if schema == 1 else _counted(top.take("chunks")),
    )
    top.done()
    return found


def _listed(table: Any, origin: Origin) -> dict[int, str]:
    """Checksums of a manifest of schema 1."""
    chunks, found = Fields(table, "chunks"), {}
    for name, each in chunks.table.items():
        if not (name.isascii() and name.isdecimal()) or len(name) > 10 or int(name) >= origin.chunks:
            raise ValueError(f"chunks = {shown(name)}: must be a number of the study's {origin.chunks} chunks")
        found[int(name)] = text(chunks.at(name), Fields(each, chunks.at(name)).take("sha256"))
    return found


def _counted(table: Any) -> dict[int, str]:
    """No checksums in a manifest of schema 2, but counts for people."""
    counts = Fields(table, "chunks")
    for name in ("done", "of"):
        whole(counts.at(name), counts.take(name), 2**32, low=0)
    counts.done()
    return {}
