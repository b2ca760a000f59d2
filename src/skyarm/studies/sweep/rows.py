"""Valid result files in a sweep's folder; those of skyarm 0.3 are read but not
continued.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path

from skyarm.records.files import shown
from skyarm.records.immutable import immutable
from skyarm.studies.flights.store import (
    LABEL,
    ROWS,
    STUDY,
    facts_of,
    files_by_label,
    name_of,
    sound_content,
)
from skyarm.studies.sweep.manifest import MANIFEST, Manifest, label_of, read_manifest
from skyarm.studies.sweep.study import StudyError

OLD_FILE, OLD_MARK = re.compile(r"chunk_(\d{7})\.parquet"), b"skyarm"
"""Names of row files of version 0.3, which lack a digest, and the key of the study's
digest in their metadata."""

LABEL_OF = re.compile(r"chunk_(?P<index>\d{7})\.(?P<controller>.+)")

Piece = tuple[int, str]
"""Index of a chunk of episodes, and a controller."""


@immutable
class RowsThere:
    """Valid result files in a sweep's folder.

    Attributes:
        files: files of each chunk with each controller. chunks: chunks that are there
            with all controllers, ascending.
        ignored: names of files that do not count. count: flights of those that do.
    """

    files: Mapping[Piece, Path]
    chunks: tuple[int, ...]
    ignored: tuple[str, ...]
    count: int


def rows_there(
    folder: Path, manifest: Manifest, *, untrusted: Collection[str] | None = None
) -> RowsThere:
    """Find the valid result files in a sweep's folder: whole, undamaged and of this
    study.

    Args:
        folder: folder of the sweep.
        manifest: manifest of the sweep.
        untrusted: names of files that do not count, where all others have been looked
            at; None to look now.

    Raises:
        OSError: the folder cannot be read.
    """
    files: dict[Piece, Path] = {}
    ignored: list[str] = []
    for piece, path in _candidates(folder, manifest):
        # of two sound files of a chunk one counts
        if piece in files:
            continue
        if (
            _counts(path, piece, manifest)
            if untrusted is None
            else path.name not in untrusted
        ):
            files |= (
                {(piece[0], each): path for each in manifest.scenarios}
                if manifest.old
                else {piece: path}
            )
        else:
            ignored.append(path.name)
    chunks = [
        index
        for index in {index for index, _ in files}
        if all((index, c) in files for c in manifest.scenarios)
    ]
    count = sum(len(manifest.span(index)) for index, _ in files)
    return RowsThere(
        files=files, chunks=tuple(sorted(chunks)), ignored=tuple(ignored), count=count
    )


def _candidates(folder: Path, manifest: Manifest) -> Iterator[tuple[Piece, Path]]:
    """Yield files of a sweep's folder that are named as results of one chunk of
    episodes and one controller.
    """
    if manifest.old:
        for path in sorted((folder / ROWS).glob("chunk_*.parquet")):
            match = OLD_FILE.fullmatch(path.name)
            if match and path.is_file() and int(match[1]) < manifest.chunks:
                # such a file has the rows of all controllers: the first stands for them
                yield (int(match[1]), next(iter(manifest.scenarios))), path
        return
    controllers = {name_of(controller): controller for controller in manifest.scenarios}
    for label, paths in files_by_label(folder / ROWS).items():
        match = LABEL_OF.fullmatch(label)
        if (
            match
            and match["controller"] in controllers
            and int(match["index"]) < manifest.chunks
        ):
            yield from (
                ((int(match["index"]), controllers[match["controller"]]), path)
                for path in paths
            )


def _counts(path: Path, piece: Piece, manifest: Manifest) -> bool:
    """True if a result file is undamaged, of this study and of this chunk of
    episodes.
    """
    # names of old files have no digest: these are read in whole, and bear a mark
    content = sound_content(path, named=not manifest.old)
    if content is None:
        return False
    facts = facts_of(content, whole=manifest.old)
    rows = len(manifest.span(piece[0]))
    if manifest.old:
        marked = (
            facts.metadata.get(OLD_MARK) == f"{manifest.digest}/{piece[0]}".encode()
        )
        return marked and facts.rows == rows * len(manifest.scenarios)
    ours = {STUDY: manifest.digest.encode(), LABEL: label_of(*piece).encode()}
    return facts.rows == rows and ours.items() <= facts.metadata.items()


def require_same_study(folder: Path, manifest: Manifest) -> None:
    """Raise an error that names the difference if a folder holds results of another
    study.

    Raises:
        StudyError: one line. OSError: the folder cannot be read.
    """
    files = [path for paths in files_by_label(folder / ROWS).values() for path in paths]
    if not any((folder / ROWS).glob("chunk_*.parquet")):
        if files:
            raise StudyError(f"{folder}: holds rows of no sweep; choose another --out")
        return  # a manifest without rows belongs to none
    stored = read_manifest(folder)
    if stored is None:
        if any(OLD_FILE.fullmatch(path.name) for path in (folder / ROWS).iterdir()):
            raise StudyError(
                f"{folder}: holds rows of skyarm 0.3 without a {MANIFEST}; choose"
                " another --out"
            )
        for path in files:
            content = sound_content(path)
            if (
                content
                and facts_of(content).metadata.get(STUDY) != manifest.digest.encode()
            ):
                raise StudyError(
                    f"{folder}: holds rows of another study ({path.name}) without a"
                    f" {MANIFEST}; choose another --out"
                )
        return
    if stored.old:
        raise StudyError(
            f"{folder}: holds rows of skyarm {stored.versions['skyarm']}, which can be"
            " summed up and not continued; choose another --out"
        )
    for name, new, old in manifest.differences(stored):
        raise StudyError(
            f"{name} = {shown(new)}: must be {shown(old)} as in the rows that {folder}"
            " holds; choose another --out"
        )


def not_counted(names: Sequence[str]) -> list[str]:
    """Message (in a list) that names the ignored files of a sweep; an empty list if
    there are none.
    """
    return (
        [f"not counted, since they are damaged or of another study: {', '.join(names)}"]
        if names
        else []
    )
