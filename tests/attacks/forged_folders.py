"""Ways to forge or damage the folder of a study: each is a function that does it to a whole folder."""

from __future__ import annotations

import dataclasses
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from skyarm.sweep.chunk_file import Origin, chunk_file
from skyarm.sweep.study_folder import Manifest

Forgery = Callable[[Path], object]

KINDS: dict[str, Forgery] = {}
"""Name -> what is done to a folder. The folder lies in one that nothing may be written into."""

EVIL = "x/../../evil"


def manifest_path(folder: Path) -> Path:
    return folder / "manifest.json"


def chunk(folder: Path, index: int = 0) -> Path:
    return folder / "rows" / f"chunk_{index:07d}.parquet"


def manifest_of(folder: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(manifest_path(folder).read_text())
    return found


def origin_of(folder: Path) -> Origin:
    held = manifest_of(folder)
    return Origin(study=held["study"], scenarios=held["scenarios"], version=held["versions"]["skyarm"])


def told(folder: Path, **fields: Any) -> None:
    """The manifest with other fields."""
    manifest_path(folder).write_text(json.dumps(manifest_of(folder) | fields))


def studied(folder: Path, **fields: Any) -> None:
    """The manifest with other fields in its study, and the digest that belongs to them."""
    held = manifest_of(folder)
    study = held["study"] | fields
    digest = Origin(study=study, scenarios=held["scenarios"], version="").digest
    told(folder, study=study, name=study.get("name"), digest=digest)


def table_of(folder: Path, index: int = 0) -> Any:
    import pyarrow.parquet as pq

    return pq.read_table(chunk(folder, index))


def column(name: str, make: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """A change of one column."""

    def change(table: Any) -> Any:
        return table.set_column(table.schema.get_field_index(name), name, make(table.column(name)))

    return change


def words(values: list[Any]) -> Any:
    import pyarrow as pa

    return pa.array(values).cast(pa.dictionary(pa.int8(), pa.string()))


def of_labels(folder: Path, labels: list[str]) -> None:
    """The folder with other names of its controllers, everywhere."""
    before = origin_of(folder)
    origin = dataclasses.replace(before, scenarios=dict(zip(labels, before.scenarios.values(), strict=True)))
    names = dict(zip(before.scenarios, labels, strict=True))
    for index in range(before.chunks):
        table = table_of(folder, index)
        renamed = column("controller", lambda held: words([names[each] for each in held.to_pylist()]))(table)
        chunk(folder, index).write_bytes(chunk_file(renamed, origin, index))
    manifest = Manifest(origin=origin, versions={"skyarm": origin.version}, complete=True, rows=origin.rows)
    manifest_path(folder).write_bytes(manifest.content(origin.chunks))


def said(name: str, forge: Forgery) -> None:
    KINDS[name] = forge


# manifests that are lost or damaged
said("manifest missing", lambda at: manifest_path(at).unlink())
said("manifest empty", lambda at: manifest_path(at).write_bytes(b""))
said("manifest cut off", lambda at: manifest_path(at).write_bytes(manifest_path(at).read_bytes()[:-40]))
said("manifest of zeros", lambda at: manifest_path(at).write_bytes(bytes(900)))
said("manifest of noise", lambda at: manifest_path(at).write_bytes(np.random.default_rng(0).bytes(900)))
said("manifest lost with a damaged chunk", lambda at: (manifest_path(at).unlink(), chunk(at).write_bytes(b"PAR1")))
# manifests that are none
said("manifest a list", lambda at: manifest_path(at).write_text("[]"))
said("manifest null", lambda at: manifest_path(at).write_text("null"))
said("manifest deep", lambda at: manifest_path(at).write_text("[" * 100_000))
said("manifest deep and closed", lambda at: manifest_path(at).write_text("[" * 900 + "]" * 900))
said("manifest with a number of 5000 digits", lambda at: manifest_path(at).write_text('{"schema": ' + "1" * 5000 + "}"))
said("manifest with NaN", lambda at: told(at, rows=float("nan")))
said("manifest of tomorrow", lambda at: told(at, schema=3))
said("manifest a folder", lambda at: (manifest_path(at).unlink(), manifest_path(at).mkdir()))
said("manifest a pipe", lambda at: (manifest_path(at).unlink(), os.mkfifo(manifest_path(at))))
said(
    "manifest a link in a circle",
    lambda at: (manifest_path(at).unlink(), manifest_path(at).symlink_to("manifest.json")),
)
said("manifest with fields of its own", lambda at: told(at, more=1))
said("manifest with a digest of another", lambda at: told(at, digest="0" * 64))
# manifests that lie, and names that lead elsewhere
said("manifest complete and a chunk missing", lambda at: chunk(at, 1).unlink())
said("manifest complete and no chunk", lambda at: [path.unlink() for path in (at / "rows").iterdir()])
said("manifest complete and no rows", lambda at: ([p.unlink() for p in (at / "rows").iterdir()], (at / "rows").rmdir()))
said("study's name leads out", lambda at: studied(at, name="../../evil"))
said("study's seed is a script", lambda at: studied(at, seed="<script>alert(1)</script>"))
said("study's vary a list", lambda at: studied(at, vary=[1]))
said("study of 10^300 episodes", lambda at: studied(at, episodes=10**300))
said("study of no controllers", lambda at: told(at, scenarios={}))
said("title a script", lambda at: told(at, title="</title><script>alert(1)</script>\x1b[2J"))
said("title half a character", lambda at: told(at, title="\ud800"))
said("controller leads out", lambda at: of_labels(at, [EVIL, "paper_pd"]))
said("controllers with one file name", lambda at: of_labels(at, ["a/b", "a\\b"]))
said("controller is a formula", lambda at: of_labels(at, ["$\\frac{", "<b>[/red]</b>"]))
said("controller clears the terminal", lambda at: of_labels(at, ["\x1b[2J", "paper_pd"]))
# files of rows
said("chunk empty", lambda at: chunk(at).write_bytes(b""))
said("chunk cut off", lambda at: chunk(at).write_bytes(chunk(at).read_bytes()[:-9]))
said("chunk no Parquet", lambda at: chunk(at).write_text("episode,controller\n"))
said("every chunk no Parquet", lambda at: [path.write_bytes(b"PAR1....PAR1") for path in (at / "rows").iterdir()])
said("chunk of another index", lambda at: os.replace(chunk(at, 2), chunk(at, 1)))
said("chunk beyond the last", lambda at: chunk(at, 9).write_bytes(chunk(at).read_bytes()))
said(
    "chunk of many digits", lambda at: (at / "rows" / f"chunk_{'9' * 200}.parquet").write_bytes(chunk(at).read_bytes())
)
said("chunk a folder", lambda at: (chunk(at).unlink(), chunk(at).mkdir()))
said("chunk a pipe", lambda at: (chunk(at).unlink(), os.mkfifo(chunk(at))))
said("chunk a link to nothing", lambda at: (chunk(at).unlink(), chunk(at).symlink_to(at.parent / "planted")))
said("chunk a link to its neighbour", lambda at: (chunk(at).unlink(), chunk(at).symlink_to(chunk(at, 1))))
said("chunk a link out", lambda at: (chunk(at).unlink(), chunk(at).symlink_to(at.parent / "precious")))
said(
    "manifest a link out", lambda at: (manifest_path(at).unlink(), manifest_path(at).symlink_to(at.parent / "precious"))
)
said(
    "rows a link out",
    lambda at: (os.rename(at / "rows", at.parent / "kept"), (at / "rows").symlink_to(at.parent / "kept")),
)
said("rows a file", lambda at: (os.rename(at / "rows", at / "moved"), (at / "rows").write_text("")))
said("what is left of a killed process a folder", lambda at: (at / "rows" / ".chunk_0000000.parquet.ab.part").mkdir())
# the folder of the statistics
said("stats a file", lambda at: (at / "stats").write_text(""))
said("stats a link out", lambda at: (at / "stats").symlink_to(at.parent))
said(
    "report a link out",
    lambda at: ((at / "stats").mkdir(), (at / "stats" / "report.html").symlink_to(at.parent / "precious")),
)
said(
    "map a link out",
    lambda at: ((at / "stats").mkdir(), (at / "stats" / "map_paper_ct.png").symlink_to(at.parent / "new")),
)
