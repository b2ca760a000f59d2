"""The folder of a study: files of rows that appear whole, and a manifest that says whose they are.

The files themselves are the record of what is done; the manifest lists them with their checksums. A file that is
damaged, or of another study, counts as not flown.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from skyarm.files import require_writable, shown, versions, write_atomically
from skyarm.sweep.plan import Plan
from skyarm.sweep.rows import MARK, mark, row_count
from skyarm.sweep.study import StudyError

MANIFEST = "manifest.json"
ROWS = "rows"
KEYS = ("name", "title", "study", "scenarios", "success", "versions", "complete", "rows", "chunks")
"""What a manifest must have to be read."""

ROWS_NEED = ("numpy", "llvmlite", "pyarrow")
"""Packages whose versions the bits of rows may depend on."""

LEFT = re.compile(r"\.(chunk_\d+\.parquet|manifest\.json)\.[0-9a-f]+\.part")
"""Names of what a killed process leaves of the file it was writing."""


def read_manifest(folder: str | os.PathLike[str]) -> dict[str, Any]:
    """Manifest of a study's folder.

    Raises:
        StudyError: there is none, or it is not one.
    """
    path = Path(folder) / MANIFEST
    try:
        found = json.loads(path.read_bytes())
    except FileNotFoundError:
        raise StudyError(f"folder = {os.fspath(folder)!r}: must be one that 'skyarm sweep' wrote") from None
    except (ValueError, UnicodeDecodeError):
        found = None
    if not isinstance(found, dict) or found.get("schema") != 1 or any(key not in found for key in KEYS):
        raise StudyError(f"{path}: must be a manifest of schema 1")
    return found


def row_files(folder: str | os.PathLike[str]) -> list[Path]:
    """Files of rows in the order of their episodes."""
    return sorted((Path(folder) / ROWS).glob("chunk_*.parquet"))


class Store:
    """A study's folder, opened to write.

    Args:
        folder: made if missing. plan: whose rows it takes.

    Raises:
        StudyError: the folder holds rows of another study; names what differs.
        OSError: it cannot be written.
    """

    def __init__(self, folder: str | os.PathLike[str], plan: Plan) -> None:
        self.folder, self.plan = Path(folder), plan
        require_writable(self.folder)
        require_writable(self.folder / ROWS)
        self._versions = versions(*ROWS_NEED)
        before = self._previous()
        for path in (*self.folder.glob(".*.part"), *(self.folder / ROWS).glob(".*.part")):
            if LEFT.fullmatch(path.name):
                path.unlink(missing_ok=True)
        self.done: dict[int, str] = {}
        for index in range(plan.study.chunks):
            checksum = self._checked(index, before.get(str(index)))
            if checksum:
                self.done[index] = checksum
        self.write_manifest()

    @property
    def todo(self) -> list[int]:
        """Chunks that are not there yet."""
        return [index for index in range(self.plan.study.chunks) if index not in self.done]

    def path(self, index: int) -> Path:
        """File of a chunk."""
        return self.folder / ROWS / f"chunk_{index:07d}.parquet"

    def put(self, index: int, content: bytes) -> None:
        """Keep a chunk."""
        write_atomically(self.path(index), content)
        self.done[index] = hashlib.sha256(content).hexdigest()

    def write_manifest(self) -> None:
        """Bring the manifest up to date."""
        study = self.plan.study
        chunks = {
            str(index): {"rows": row_count(study, index), "sha256": self.done[index]} for index in sorted(self.done)
        }
        content = {
            "schema": 1,
            "name": study.name,
            "title": study.title,
            "digest": self.plan.digest,
            **self.plan.facts,
            "success": dict(study.success),
            "versions": self._versions,
            "complete": len(chunks) == study.chunks,
            "rows": sum(chunk["rows"] for chunk in chunks.values()),
            "chunks": chunks,
        }
        write_atomically(self.folder / MANIFEST, (json.dumps(content, indent=1) + "\n").encode())

    def _previous(self) -> Mapping[str, Any]:
        """Chunks of the manifest that is there, after a check that it is of this study."""
        if not (self.folder / MANIFEST).exists():
            if row_files(self.folder):
                raise StudyError(f"{self.folder}: holds rows but no {MANIFEST}; choose another --out")
            return {}
        held = read_manifest(self.folder)
        for field, new, old in _differences(self.plan, held, self._versions):
            raise StudyError(
                f"{self.plan.study.source}: {field} = {shown(new)}: must be {shown(old)} as in the rows that "
                f"{self.folder} holds; choose another --out"
            )
        self._versions = held["versions"]
        found: Mapping[str, Any] = held["chunks"]
        return found

    def _checked(self, index: int, listed: Any) -> str | None:
        """Checksum of a chunk that is there and whole."""
        path = self.path(index)
        if not path.exists():
            return None
        import pyarrow as pa
        import pyarrow.parquet as pq

        content = path.read_bytes()
        checksum = hashlib.sha256(content).hexdigest()
        if isinstance(listed, dict):
            return checksum if listed.get("sha256") == checksum else None
        try:
            file = pq.ParquetFile(pa.BufferReader(content))
            whose = (file.schema_arrow.metadata or {}).get(MARK)
            rows = file.read().num_rows
        except (pa.ArrowException, OSError):
            return None
        return checksum if whose == mark(self.plan, index) and rows == row_count(self.plan.study, index) else None


def _differences(plan: Plan, held: Mapping[str, Any], now: Mapping[str, str]) -> list[tuple[str, Any, Any]]:
    """(field, this study's, the folder's) of everything in which rows would differ."""
    ours, theirs = plan.facts["study"], held["study"]
    found = [
        (name, ours.get(name), theirs.get(name))
        for name in dict.fromkeys([*ours, *theirs])
        if name != "vary" and ours.get(name) != theirs.get(name)
    ]
    new, old = ours.get("vary") or {}, theirs.get("vary") or {}
    found += [(f'vary."{p}"', new.get(p), old.get(p)) for p in dict.fromkeys([*new, *old]) if new.get(p) != old.get(p)]
    if not found and list(new) != list(old):
        found.append(("vary", list(new), list(old)))
    digests = held["scenarios"]
    for label, digest in plan.facts["scenarios"].items():
        if digests.get(label) != digest:
            found.append((f"scenario of {label!r}", digest[:12], str(digests.get(label))[:12]))
    version = held["versions"].get("skyarm")
    if version != now["skyarm"]:
        found.append(("version of skyarm", now["skyarm"], version))
    return found
