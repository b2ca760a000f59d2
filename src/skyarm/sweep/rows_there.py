"""What a study's folder really holds: read file by file, whatever its manifest says."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass

from skyarm.sweep.manifest import MANIFEST, Manifest, read_manifest
from skyarm.sweep.origin import Verdict
from skyarm.sweep.seal import is_whole
from skyarm.sweep.store import chunk_path, chunks_there, rebuilt
from skyarm.sweep.study import StudyError

NAMED = 3
"""Files that a line names; of more it says how many."""


@dataclass(frozen=True, slots=True)
class RowsThere:
    """Rows of a folder.

    Attributes:
        manifest: read, or made from the rows.
        chunks: numbers of those whose files are whole, in order. skipped: names of the other files of rows.
        beyond: those of them that are whole and have a number beyond the study's last.
    """

    manifest: Manifest
    chunks: tuple[int, ...]
    skipped: tuple[str, ...]
    beyond: tuple[str, ...] = ()


def rows_of(folder: str | os.PathLike[str]) -> RowsThere:
    """Read every file of rows and keep those that are whole.

    Raises:
        StudyError: no study's folder, a manifest that is none, or rows of another study among these.
        OSError: the folder cannot be read.
    """
    there = chunks_there(folder)
    manifest = read_manifest(folder) or rebuilt(folder, there)
    if manifest is None:
        why = f"; it has no {MANIFEST}, and no file of rows says whose it is" if there else ""
        raise StudyError(f"folder = {os.fspath(folder)!r}: must be one that 'skyarm sweep' wrote{why}")
    found = {index: _verdict(folder, manifest, index) for index in there}
    for index, verdict in found.items():
        if verdict is Verdict.FOREIGN:
            raise StudyError(
                f"{chunk_path(folder, index)}: must hold chunk {index} of the study {manifest.name!r} flown by skyarm "
                f"{manifest.origin.version}, and holds other rows; 'skyarm sweep' flies it again"
            )
    names = {index: chunk_path(folder, index).name for index in found}
    return RowsThere(
        manifest,
        tuple(index for index, verdict in found.items() if verdict is Verdict.WHOLE),
        tuple(names[index] for index, verdict in found.items() if verdict is not Verdict.WHOLE),
        tuple(names[index] for index, verdict in found.items() if verdict is Verdict.BEYOND),
    )


def _verdict(folder: str | os.PathLike[str], manifest: Manifest, index: int) -> Verdict:
    """What the file of a chunk is; one that cannot be read is as good as damaged."""
    try:
        content = chunk_path(folder, index).read_bytes()
    except OSError:
        return Verdict.DAMAGED
    if index >= manifest.origin.chunks:
        return Verdict.BEYOND if is_whole(content) else Verdict.DAMAGED
    listed = manifest.listed.get(index)
    found = manifest.origin.verdict(content, index)
    if found is Verdict.WHOLE or listed is None:
        return found
    return manifest.origin.verdict(content, index, listed)


def not_counted(skipped: Sequence[str], beyond: Sequence[str]) -> list[str]:
    """Why files of rows are not counted, in words: one text a reason."""
    damaged = [name for name in skipped if name not in beyond]
    found = [f"not counted, since they are damaged: {named(damaged)}"] if damaged else []
    if beyond:
        found.append(f"not counted, since the study ends before them: {named(beyond)}")
    return found


def named(files: Sequence[str]) -> str:
    """Files in words."""
    return ", ".join(files) if len(files) <= NAMED else f"{', '.join(files[:NAMED])} and {len(files) - NAMED} more"
