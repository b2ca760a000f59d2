"""Folder of a sweep: a JSON manifest and Parquet files of results, written atomically and tagged by digest.

A file counts if its metadata has the study's digest and its own number and its pages fit their checksums; any other is
flown again.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from skyarm.records.files import (
    PathLike,
    needs_extra,
    require_no_link,
    require_writable,
    shown,
    sync_folder,
    versions,
    write_inside,
)
from skyarm.scenario.endings import STATUSES
from skyarm.studies.sweep.study import StudyError

MANIFEST, ROWS = "manifest.json", "rows"

SCHEMA = 2
"""Of the manifest."""

ROWS_NEED = ("numpy", "llvmlite", "pyarrow")
"""Packages on whose versions the bits of rows may depend."""

MARK, FACTS, VERSION = b"skyarm", b"skyarm.study", b"skyarm.version"
"""Keys of a file's metadata: digest of the facts and number of the chunk; the facts; version of skyarm."""

CHUNK = re.compile(r"chunk_(\d{7})\.parquet")


def arrow() -> Any:
    """Import pyarrow, with an error that names it if it is not installed.

    Raises:
        ValueError: it is not installed; names the extra that brings it.
    """
    try:
        import pyarrow as pa
        import pyarrow.parquet
    except ImportError:
        raise ValueError(f"pyarrow: is missing; {needs_extra('sweep')}") from None
    return pa


@dataclass(frozen=True, kw_only=True)
class Manifest:
    """JSON manifest of a sweep's folder: the settings that determine its results.

    Attributes:
        study: its document, plain values. scenarios: label of the controller -> digest of the scenario.
        versions: of skyarm, which flew it, and of the packages on which the bits of rows may depend.
        title: one-line description. success: metric -> largest value of a successful episode.
        units: path of a varied number -> its SI unit. noise: whether episodes draw random numbers.
    """

    study: Mapping[str, Any]
    scenarios: Mapping[str, str]
    versions: Mapping[str, str] = field(default_factory=lambda: versions(*ROWS_NEED))
    title: str = ""
    success: Mapping[str, float] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    noise: bool = True

    @property
    def name(self) -> str:
        """Name of the sweep's study."""
        return str(self.study["name"])

    @cached_property
    def facts(self) -> str:
        """JSON text of the settings that determine a sweep's results."""
        return json.dumps({"study": self.study, "scenarios": self.scenarios, "version": self.versions["skyarm"]})

    @cached_property
    def digest(self) -> str:
        """Digest of the settings that determine a sweep's results."""
        return hashlib.sha256(self.facts.encode()).hexdigest()

    @property
    def chunks(self) -> int:
        """Number of Parquet files of the whole sweep."""
        return -(-int(self.study["episodes"]) // int(self.study["chunk"]))

    @property
    def rows(self) -> int:
        """Number of flights of the whole sweep."""
        return int(self.study["episodes"]) * len(self.scenarios)

    @property
    def parameters(self) -> tuple[str, ...]:
        """Paths and names of the sweep's varied parameters, derived ones last."""
        return (*(self.study["vary"] or {}), *(self.study.get("derived") or {}))

    @property
    def statuses(self) -> tuple[str, ...]:
        """Names of the termination statuses, in the order of their codes in the Parquet files."""
        return tuple(dict.fromkeys((*STATUSES, *self.study.get("endings", ()))))

    def span(self, index: int) -> range:
        """Range of episode numbers of one chunk of the sweep."""
        size, episodes = self.study["chunk"], self.study["episodes"]
        return range(index * size, min((index + 1) * size, episodes))

    def mark(self, index: int) -> bytes:
        """Tag of a chunk's Parquet file: the sweep's digest and the chunk's number."""
        return f"{self.digest}/{index}".encode()

    def parquet(self, table: Any, index: int) -> bytes:
        """Content of a chunk's Parquet file, tagged with the sweep's digest and the chunk's number."""
        sink = io.BytesIO()
        version = self.versions["skyarm"].encode()
        marked = table.replace_schema_metadata({MARK: self.mark(index), FACTS: self.facts.encode(), VERSION: version})
        arrow().parquet.write_table(
            marked, sink, compression="zstd", use_dictionary=["controller", "status"], write_page_checksum=True
        )
        return sink.getvalue()

    def differences(self, there: Manifest) -> Iterator[tuple[str, Any, Any]]:
        """Differences of two sweeps that affect their results: (setting, value here, value there)."""
        ours, theirs = (each._rows_depend_on() for each in (self, there))
        names = dict.fromkeys([*ours, *theirs])
        # the most telling first
        for name in sorted(names, key=lambda name: (name.startswith(("scenario of", "version of")), name == "vary")):
            # as text, since the digest tells 1 from 1.0
            if json.dumps(ours.get(name)) != json.dumps(theirs.get(name)):
                yield name, ours.get(name), theirs.get(name)

    def _rows_depend_on(self) -> dict[str, Any]:
        """Settings that determine a sweep's results, by name, as shown in error messages."""
        study, vary = self.study, self.study["vary"] or {}
        return {
            **{name: value for name, value in study.items() if name not in ("vary", "plugins")},
            **{f"plugin {name!r}": value for name, value in (study.get("plugins") or {}).items()},
            **{f'vary."{path}"': value for path, value in vary.items()},
            "vary": list(vary),
            **{f"scenario of {label!r}": digest[:12] for label, digest in self.scenarios.items()},
            "version of skyarm": self.versions["skyarm"],
        }


def read_manifest(folder: PathLike) -> Manifest | None:
    """Read the JSON manifest of a sweep's folder; None if it is missing or truncated.

    Raises:
        StudyError: it is no manifest.
        OSError: it cannot be read.
    """
    path = Path(folder) / MANIFEST
    if not path.is_file():
        return None
    try:
        table = json.loads(path.read_bytes())
    except (ValueError, RecursionError):
        return None
    try:
        if table["schema"] != SCHEMA:
            raise ValueError(f"schema = {shown(table['schema'])}: must be {SCHEMA}")
        return Manifest(**{name: table[name] for name in Manifest.__dataclass_fields__ if name in table})
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise StudyError(
            f"{path}: must be as 'skyarm sweep' wrote it ({error}); delete it, and it is made anew"
        ) from None


def chunk_path(folder: PathLike, index: int) -> Path:
    """Path of a chunk's Parquet file in a sweep's folder."""
    return Path(folder) / ROWS / f"chunk_{index:07d}.parquet"


def chunks_there(folder: PathLike) -> list[int]:
    """Indices of the chunks whose Parquet file exists in a sweep's folder, ascending.

    Raises:
        OSError: the folder cannot be listed.
    """
    if not (Path(folder) / ROWS).is_dir():
        return []
    with os.scandir(Path(folder) / ROWS) as entries:
        names = [CHUNK.fullmatch(entry.name) for entry in entries if entry.is_file()]
    return sorted(int(name[1]) for name in names if name)


def _mark(path: Path) -> bytes | None:
    """Sweep digest and chunk number stored in a Parquet file, b"" if absent; None if the file is damaged."""
    pa = arrow()
    try:
        table = pa.parquet.ParquetFile(path, page_checksum_verification=True).read()
    except (pa.ArrowException, OSError):
        return None
    return bytes(dict(table.schema.metadata or {}).get(MARK, b""))


def whole_chunks(folder: PathLike, manifest: Manifest) -> tuple[list[int], tuple[str, ...]]:
    """Indices of a sweep's chunks with valid Parquet files, and names of the files that are ignored.

    Raises:
        OSError: the folder cannot be read.
    """
    marks = {index: _mark(chunk_path(folder, index)) for index in chunks_there(folder)}
    whole = [index for index, mark in marks.items() if mark == manifest.mark(index)]
    return whole, tuple(chunk_path(folder, index).name for index in marks if index not in whole)


def not_counted(names: Sequence[str]) -> list[str]:
    """List of one message that names the ignored Parquet files of a sweep; empty if there are none."""
    return [f"not counted, since they are damaged or of another study: {', '.join(names)}"] if names else []


class StudyFolder:
    """Folder of a sweep, opened for writing its results.

    Args:
        folder: made if missing. manifest: of the rows that it takes.

    Raises:
        StudyError: the folder holds rows of another study; names what differs.
        OSError: it cannot be written.
    """

    def __init__(self, folder: PathLike, manifest: Manifest) -> None:
        self.folder, self.manifest = Path(folder), manifest
        require_writable(self.folder)
        require_writable(require_no_link(self.folder / ROWS))
        there = chunks_there(folder)
        held = read_manifest(folder) if there else manifest  # a manifest without rows belongs to none
        for name, new, old in manifest.differences(held) if held else ():
            raise StudyError(
                f"{name} = {shown(new)}: must be {shown(old)} as in the rows that {self.folder} holds; choose another "
                "--out"
            )
        whole, others = whole_chunks(folder, manifest)
        foreign = [name for name in others if _mark(self.folder / ROWS / name) is not None]
        if held is None and foreign:
            raise StudyError(
                f"{self.folder}: holds rows of another study ({foreign[0]}) without a {MANIFEST}; choose another --out"
            )
        self.done = set(whole)

    @property
    def episodes(self) -> int:
        """Number of episodes whose results are already in the sweep's folder."""
        return sum(len(self.manifest.span(index)) for index in self.done)

    def put(self, index: int, content: bytes) -> None:
        """Write the Parquet file of one chunk of episodes into the sweep's folder."""
        write_inside(chunk_path(self.folder, index), content, entry=False)
        self.done.add(index)

    def write_manifest(self) -> None:
        """Write the sweep's JSON manifest, marked complete if every chunk is on disk."""
        sync_folder(self.folder / ROWS)
        self.done &= set(chunks_there(self.folder))
        manifest, done = self.manifest, len(self.done)
        rows = self.episodes * len(manifest.scenarios)
        facts = {"schema": SCHEMA, "name": manifest.name, "digest": manifest.digest, **asdict(manifest)}
        facts |= {"complete": done == manifest.chunks, "rows": rows, "chunks": {"done": done, "of": manifest.chunks}}
        write_inside(self.folder / MANIFEST, (json.dumps(facts, indent=1) + "\n").encode())
        if facts["complete"]:  # nobody writes any more: hidden parts are those of killed processes
            for left in [*self.folder.glob(f".{MANIFEST}.*.part"), *(self.folder / ROWS).glob(".chunk_*.part")]:
                left.unlink(missing_ok=True)
