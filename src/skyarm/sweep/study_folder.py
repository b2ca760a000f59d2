"""The folder of a study: files of rows that appear whole, and a manifest next to them.

The files are the record of what was flown, and each of them states its study: a lost manifest is made anew from them, a
damaged file counts as not flown.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from skyarm.files import require_no_link, require_writable, shown, sync_folder, unreadable, versions, write_inside
from skyarm.sweep.chunk_file import Origin, metadata_of, origin_in
from skyarm.sweep.plan import Plan
from skyarm.sweep.study import StudyError
from skyarm.sweep.study_differences import differences

MANIFEST, ROWS = "manifest.json", "rows"

SCHEMA = 2
"""Of the manifest."""

ROWS_NEED = ("numpy", "llvmlite", "pyarrow")
"""Packages on whose versions the bits of rows may depend."""

CHUNK = re.compile(r"chunk_(\d{7})\.parquet")

LEFT = re.compile(r"\.(chunk_\d+\.parquet|manifest\.json)\.[0-9a-f]+\.part")
"""Names of the unfinished files of a killed process."""

NAMED = 3
"""Files that a message names; of more it gives the number."""


@dataclass(frozen=True, kw_only=True)
class Manifest:
    """Description of a folder's study.

    Attributes:
        origin: study, scenarios, version of skyarm.
        title: one line for people. success: metric -> largest value of a successful episode.
        versions: of the packages on which the bits of rows may depend.
        complete, rows: whether all rows were there, and how many, when this was written.
        rebuilt: from the rows, which have neither title nor success.
        units: path of a varied number -> its SI unit. noise: whether episodes draw random numbers; None if unknown.
    """

    origin: Origin
    title: str = ""
    success: Mapping[str, float] = field(default_factory=dict)
    versions: Mapping[str, str]
    complete: bool = False
    rows: int = 0
    rebuilt: bool = False
    units: Mapping[str, str] = field(default_factory=dict)
    noise: bool | None = None

    @property
    def name(self) -> str:
        """Name of the study."""
        return str(self.origin.study["name"])

    def content(self, chunks: int) -> bytes:
        """The file, where this many chunks are there."""
        plain = {
            "schema": SCHEMA,
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
    """Manifest of a study's folder, made anew from the rows if it is lost or cut off; None if there are no rows either.

    Raises:
        StudyError: it is no manifest.
        OSError: it cannot be read.
    """
    path = Path(folder) / MANIFEST
    why = unreadable(path)
    if why:
        if os.path.lexists(path):
            raise StudyError(f"{path}: must be a file ({why})")
        return _rebuilt(folder)
    try:
        return _manifest(json.loads(path.read_bytes()))
    except (json.JSONDecodeError, UnicodeDecodeError):
        return _rebuilt(folder)
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        why = " ".join(str(error).split())
        raise StudyError(
            f"{path}: must be as 'skyarm sweep' wrote it ({why}); delete it, and it is made anew"
        ) from None


def _manifest(table: Any) -> Manifest:
    if table["schema"] != SCHEMA:
        raise ValueError(f"schema = {shown(table['schema'])}: must be {SCHEMA}")
    held = {name: str(version) for name, version in table["versions"].items()}
    origin = Origin(study=table["study"], scenarios=table["scenarios"], version=held["skyarm"])
    if table["digest"] != origin.digest:
        raise ValueError(f"digest = {shown(table['digest'])}: must be that of study and scenarios")
    return Manifest(
        origin=origin,
        title=str(table["title"]),
        success={name: float(limit) for name, limit in table["success"].items()},
        versions=held,
        complete=bool(table["complete"]),
        rows=int(table["rows"]),
        units={path: str(unit) for path, unit in table.get("units", {}).items()},
        noise=table.get("noise"),
    )


def _rebuilt(folder: str | os.PathLike[str]) -> Manifest | None:
    """Manifest by the first whole file of rows; None without one."""
    for index in chunks_there(folder):
        origin = origin_in(_content(folder, index))
        if origin is not None:
            return Manifest(origin=origin, versions={"skyarm": origin.version}, rebuilt=True)
    return None


def chunk_path(folder: str | os.PathLike[str], index: int) -> Path:
    """File of a chunk in a study's folder."""
    return Path(folder) / ROWS / f"chunk_{index:07d}.parquet"


def chunks_there(folder: str | os.PathLike[str]) -> list[int]:
    """Numbers of the chunks that have a file, in order; folders and pipes of such names are none.

    Raises:
        OSError: the folder cannot be listed.
    """
    if not (Path(folder) / ROWS).is_dir():
        return []
    with os.scandir(Path(folder) / ROWS) as entries:
        names = [CHUNK.fullmatch(entry.name) for entry in entries if entry.is_file()]
    return sorted(int(name[1]) for name in names if name)


def _content(folder: str | os.PathLike[str], index: int) -> bytes:
    """File of a chunk; empty if it cannot be read."""
    try:
        return chunk_path(folder, index).read_bytes()
    except OSError:
        return b""


def whole_chunks(folder: str | os.PathLike[str]) -> tuple[Manifest, list[int], tuple[str, ...]]:
    """Manifest, numbers of the chunks whose files are whole, and names of damaged files.

    Raises:
        StudyError: no study's folder, a wrong manifest, or rows of another study.
        OSError: the folder cannot be read.
    """
    manifest = read_manifest(folder)
    if manifest is None:
        why = f"; it has no {MANIFEST}, and no file of rows says whose it is" if chunks_there(folder) else ""
        raise StudyError(f"folder = {os.fspath(folder)!r}: must be one that 'skyarm sweep' wrote{why}")
    whole, damaged = [], []
    for index in chunks_there(folder):
        said = metadata_of(_content(folder, index))
        if said is None:
            damaged.append(chunk_path(folder, index).name)
        elif said == manifest.origin.metadata(index):
            whole.append(index)
        else:
            raise StudyError(
                f"{chunk_path(folder, index)}: must hold chunk {index} of the study {manifest.name!r} flown by skyarm "
                f"{manifest.origin.version}, and holds other rows; 'skyarm sweep' flies it again"
            )
    return manifest, whole, tuple(damaged)


def not_counted(damaged: Sequence[str]) -> list[str]:
    """A line on files of rows that are not counted; none where all are."""
    named = ", ".join(damaged[:NAMED]) + (f" and {len(damaged) - NAMED} more" if len(damaged) > NAMED else "")
    return [f"not counted, since they are damaged: {named}"] if damaged else []


class StudyFolder:
    """A study's folder, opened to write.

    Args:
        folder: made if missing. plan: whose rows it takes.
        found: called with the number of episodes found, after each file that is read.

    Raises:
        StudyError: the folder holds rows of another study; names what differs.
        OSError: it cannot be written.
    """

    def __init__(self, folder: str | os.PathLike[str], plan: Plan, found: Callable[[int], None] | None = None) -> None:
        self.folder, self.plan = Path(folder), plan
        require_writable(self.folder)
        require_writable(require_no_link(self.folder / ROWS))
        self._versions = self._versions_before() or versions(*ROWS_NEED)
        for each in (self.folder, self.folder / ROWS):
            _clear(each)
        self._done: Any = np.zeros(plan.study.chunks, dtype=bool)
        self.episodes = 0
        """That are there."""
        self.complete = False
        for index in chunks_there(folder):
            if index < self._done.size and metadata_of(_content(folder, index)) == plan.origin.metadata(index):
                self._note(index)
            if found is not None:
                found(self.episodes)
        self.write_manifest()

    def _versions_before(self) -> Mapping[str, str] | None:
        """Versions by the manifest that is there, once it is known to be of this study."""
        there, held = chunks_there(self.folder), read_manifest(self.folder)
        if held is None:
            for index in there:
                content = _content(self.folder, index)
                if content[:4] == content[-4:] == b"PAR1" and self.plan.digest.encode() not in content:
                    raise StudyError(
                        f"{chunk_path(self.folder, index)}: must say whose rows it holds, since there is no "
                        f"{MANIFEST}; choose another --out"
                    )
            return None
        if not there:  # a manifest without rows belongs to none
            return None
        for name, new, old in differences(self.plan.origin, held.origin):
            raise StudyError(
                f"{self.plan.study.source}: {name} = {shown(new)}: must be {shown(old)} as in the rows that "
                f"{self.folder} holds; choose another --out"
            )
        return None if held.rebuilt else held.versions

    @property
    def todo(self) -> Iterator[int]:
        """Chunks that are not there yet, in order."""
        return (int(index) for index in np.flatnonzero(~self._done))

    def put(self, index: int, content: bytes) -> None:
        """Keep a chunk."""
        write_inside(chunk_path(self.folder, index), content, entry=False)
        self._note(index)

    def _note(self, index: int) -> None:
        self._done[index] = True
        self.episodes += len(self.plan.study.span(index))

    def finish(self) -> None:
        """Write the manifest, which says complete if every chunk is on disk.

        Raises:
            OSError: files vanished; they count as not flown.
        """
        sync_folder(self.folder / ROWS)
        there = set(chunks_there(self.folder))
        lost = [index for index in np.flatnonzero(self._done).tolist() if index not in there]
        self._done[lost] = False
        self.episodes -= sum(len(self.plan.study.span(index)) for index in lost)
        self.complete = bool(self._done.all())
        self.write_manifest()
        if lost:
            raise OSError(
                f"{self.folder}: {len(lost)} of {self._done.size} files of rows vanished while the sweep ran; the same "
                f"command continues"
            )

    def write_manifest(self) -> None:
        """Bring the manifest up to date."""
        study = self.plan.study
        manifest = Manifest(
            origin=self.plan.origin,
            title=study.title,
            success=dict(study.success),
            versions=self._versions,
            complete=self.complete,
            rows=self.episodes * len(study.scenarios),
            units=self.plan.units,
            noise=self.plan.noise,
        )
        write_inside(self.folder / MANIFEST, manifest.content(int(np.count_nonzero(self._done))))


def _clear(folder: Path) -> None:
    """Remove the unfinished files of a killed process."""
    with os.scandir(folder) as entries:
        left = [entry.path for entry in entries if LEFT.fullmatch(entry.name) and not entry.is_dir()]
    for path in left:
        Path(path).unlink(missing_ok=True)
