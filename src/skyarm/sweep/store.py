"""The folder of a study, opened to write: files of rows that appear whole, and a manifest that says whose they are.

The files themselves are the record of what is done. One that is damaged, or of another study, counts as not flown.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from skyarm.files import require_no_link, require_writable, shown, sync_folder, versions, write_inside
from skyarm.sweep.facts import origin_in
from skyarm.sweep.manifest import MANIFEST, Manifest, read_manifest
from skyarm.sweep.origin import Verdict
from skyarm.sweep.plan import Plan
from skyarm.sweep.rows import chunk_file
from skyarm.sweep.study import StudyError
from skyarm.sweep.study_differences import differences

ROWS = "rows"

ROWS_NEED = ("numpy", "llvmlite", "pyarrow")
"""Packages whose versions the bits of rows may depend on."""

CHUNK = re.compile(r"chunk_(\d{7})\.parquet")

LEFT = re.compile(r"\.(chunk_\d+\.parquet|manifest\.json)\.[0-9a-f]+\.part")
"""Names of what a killed process leaves of the file it was writing."""

Found = Callable[[int], None]
"""Called with the number of episodes that were found."""


def chunk_path(folder: str | os.PathLike[str], index: int) -> Path:
    """File of a chunk in a study's folder."""
    return Path(folder) / ROWS / f"chunk_{index:07d}.parquet"


def chunks_there(folder: str | os.PathLike[str]) -> list[int]:
    """Numbers of the chunks that have a file, in order; the folder is listed once and no file is opened.

    Raises:
        OSError: it cannot be listed.
    """
    return sorted(int(name[1]) for name, _ in _entries(Path(folder) / ROWS))


def _entries(rows: Path) -> Iterator[tuple[re.Match[str], os.DirEntry[str]]]:
    """Files of rows; what only bears such a name, a folder or a pipe, is none."""
    if not rows.is_dir():
        return
    with os.scandir(rows) as entries:
        for entry in entries:
            name = CHUNK.fullmatch(entry.name)
            if name and entry.is_file():
                yield name, entry


class Store:
    """A study's folder, opened to write.

    Args:
        folder: made if missing. plan: whose rows it takes.
        found: called now and then while the files that are there are read.

    Raises:
        StudyError: the folder holds rows of another study; names what differs.
        OSError: it cannot be written.
    """

    def __init__(self, folder: str | os.PathLike[str], plan: Plan, found: Found | None = None) -> None:
        self.folder, self.plan = Path(folder), plan
        require_writable(self.folder)
        require_writable(require_no_link(self.folder / ROWS))
        there = chunks_there(self.folder)
        before = self._previous(there)
        self._versions = before.versions if before else versions(*ROWS_NEED)
        _clear(self.folder)
        _clear(self.folder / ROWS)
        self._seen: Any = np.zeros(plan.study.chunks, dtype=np.int64)
        """Of each chunk that was read or written here, what its file's size and time were; 0 for the others."""
        self.episodes = 0
        """That are there."""
        self.verified = False
        """Whether every chunk was on disk when :meth:`verify` looked, and nothing was written since."""
        for index in there:
            if index < plan.study.chunks and self._read(index, (before.listed if before else {}).get(index)):
                self.episodes += len(plan.study.span(index))
            if found is not None:
                found(self.episodes)
        self.write_manifest()

    @property
    def todo(self) -> Iterator[int]:
        """Chunks that are not there yet, in order."""
        return (int(index) for index in np.flatnonzero(self._seen == 0))

    def put(self, index: int, content: bytes) -> None:
        """Keep a chunk."""
        path = chunk_path(self.folder, index)
        self.verified = False
        write_inside(path, content, entry=False)
        try:
            self._seen[index] = _signature(path.stat())
        except FileNotFoundError:  # gone already
            return
        self.episodes += len(self.plan.study.span(index))

    def verify(self) -> int:
        """Look whether every chunk is on disk as it was read or written here; one that changed is read again.

        Returns:
            How many chunks were lost since then; they are flown again.

        Raises:
            OSError: the folder cannot be listed.
        """
        sync_folder(self.folder / ROWS)
        there: Any = np.zeros(self.plan.study.chunks, dtype=bool)
        for name, entry in _entries(self.folder / ROWS):
            index = int(name[1])
            if index < there.size and self._seen[index]:
                there[index] = _unchanged(entry, int(self._seen[index])) or self._read(index)
        lost = np.flatnonzero((self._seen != 0) & ~there)
        self._seen[lost] = 0
        self.episodes -= sum(len(self.plan.study.span(int(index))) for index in lost)
        self.verified = not np.any(self._seen == 0)
        return len(lost)

    def write_manifest(self) -> None:
        """Bring the manifest up to date; it says complete only of rows that :meth:`verify` saw."""
        study = self.plan.study
        manifest = Manifest(
            origin=self.plan.origin,
            title=study.title,
            success=dict(study.success),
            versions=self._versions,
            complete=self.verified,
            rows=self.episodes * len(study.scenarios),
            units=self.plan.units,
            noise=self.plan.noise,
        )
        write_inside(self.folder / MANIFEST, manifest.content(int(np.count_nonzero(self._seen))))

    def _previous(self, there: list[int]) -> Manifest | None:
        """The manifest that is there, or is made from the rows, after a check that it is of this study."""
        held = read_manifest(self.folder) or rebuilt(self.folder, there)
        if held is None:
            for index in there:
                content = chunk_path(self.folder, index).read_bytes()
                if content[:4] == content[-4:] == b"PAR1" and self.plan.digest.encode() not in content:
                    raise StudyError(
                        f"{chunk_path(self.folder, index)}: must say whose rows it holds, since there is no "
                        f"{MANIFEST}; choose another --out"
                    )
            return None
        if not there:  # a manifest without rows says whose none are
            return None
        for field, new, old in differences(self.plan.origin, held.origin):
            raise StudyError(
                f"{self.plan.study.source}: {field} = {shown(new)}: must be {shown(old)} as in the rows that "
                f"{self.folder} holds; choose another --out"
            )
        return None if held.rebuilt else held

    def _read(self, index: int, listed: str | None = None) -> bool:
        """Whether the file of a chunk is whole; notes its size and time.

        One that only a manifest of schema 1 vouches for is written anew with a seal of its own.
        """
        path, origin = chunk_path(self.folder, index), self.plan.origin
        try:
            signature = _signature(path.stat())
            content = path.read_bytes()
        except OSError:
            return False
        if origin.verdict(content, index) is not Verdict.WHOLE:
            if listed is None or origin.verdict(content, index, listed) is not Verdict.WHOLE:
                return False
            import pyarrow as pa
            import pyarrow.parquet as pq

            table = pq.read_table(pa.BufferReader(content))
            write_inside(path, chunk_file(table, origin, index), entry=False)
            signature = _signature(path.stat())
        self._seen[index] = signature
        return True


def _clear(folder: Path) -> None:
    """Remove what a killed process was writing."""
    with os.scandir(folder) as entries:
        left = [entry.path for entry in entries if LEFT.fullmatch(entry.name) and not entry.is_dir()]
    for path in left:
        Path(path).unlink(missing_ok=True)


def _signature(status: os.stat_result) -> int:
    """A number, never 0, that is another one after the file was written by anyone."""
    return hash((status.st_size, status.st_mtime_ns)) or 1


def _unchanged(entry: os.DirEntry[str], signature: int) -> bool:
    try:
        return _signature(entry.stat()) == signature
    except OSError:
        return False


def rebuilt(folder: str | os.PathLike[str], there: list[int]) -> Manifest | None:
    """A manifest made from the first file of rows that says whose it is; None if no file does.

    Args:
        folder: of the study.
        there: chunks that have a file.
    """
    for index in there:
        try:
            origin = origin_in(chunk_path(folder, index).read_bytes())
        except OSError:
            continue
        if origin is not None:
            return Manifest(origin=origin, versions={"skyarm": origin.version}, rebuilt=True)
    return None
