"""Manifest of a sweep's folder: the settings that its results depend on, as JSON with a
digest of its own.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, field
from functools import cached_property
from pathlib import Path
from typing import Any, TypeGuard

from skyarm.records.files import PathLike, shown, write_inside
from skyarm.records.immutable import immutable
from skyarm.records.plain import Plain
from skyarm.studies.flights.store import name_of
from skyarm.studies.flights.work import kinship
from skyarm.studies.sweep.study import DESIGNS, LARGEST_CHUNK, MOST_EPISODES, StudyError
from skyarm.view.pages import Facts

MANIFEST = "manifest.json"

SCHEMA, OLD = 3, 2
"""Version of the manifest, and that of skyarm 0.3, whose rows are read and not
continued."""

LARGEST = 10_000_000
"""Largest size (bytes) of a manifest."""


def _texts(value: object) -> bool:
    return isinstance(value, list) and all(isinstance(each, str) for each in value)


def _table(
    value: object, kind: type | tuple[type, ...]
) -> TypeGuard[dict[str, object]]:
    return isinstance(value, dict) and all(
        isinstance(each, kind) for each in value.values()
    )


def _whole(value: object, low: int, high: int) -> bool:
    return type(value) is int and low <= value <= high


Check = Callable[[object], bool]
"""Function that is true for an allowed value of a field."""

STUDY_FIELDS: Mapping[str, Check] = {
    "name": lambda value: isinstance(value, str),
    "episodes": lambda value: _whole(value, 1, MOST_EPISODES),
    "chunk": lambda value: _whole(value, 1, LARGEST_CHUNK),
    "design": lambda value: value in DESIGNS,
    "seed": lambda value: _whole(value, 0, 2**63),
    "metrics": _texts,
    "vary": lambda value: value is None or _table(value, dict),
    "derived": lambda value: value is None or _table(value, str),
    "endings": lambda value: value is None or _texts(value),
    "plugins": lambda value: value is None or _table(value, str),
}
"""Field of the study that statistics read -> check of its value; fields that are left
out are None."""

FIELDS: Mapping[str, Check] = {
    "study": lambda value: isinstance(value, dict),
    "scenarios": lambda value: _table(value, str) and bool(value),
    "versions": lambda value: _table(value, str) and "skyarm" in value,
    "title": lambda value: isinstance(value, str),
    "success": lambda value: _table(value, (int, float)),
    "units": lambda value: _table(value, str),
    "noise": lambda value: isinstance(value, bool),
}
"""Field of the manifest -> check of its value."""

LEFT_OUT = ("title", "success", "units", "noise")
"""Fields that earlier versions may have left out."""


@immutable(slots=False)
class Manifest:
    """JSON manifest of a sweep's folder: the settings that determine its results.

    Attributes:
        study: document of the study, plain values. scenarios: label of the
            controller -> digest of the scenario.
        versions: on which the bits of rows may depend, and the digest of the code.
        title: one-line description. success: metric -> largest value of a successful
            episode.
        units: path of a varied number -> its SI unit. noise: whether episodes draw
            random numbers.
        old: whether it is of skyarm 0.3: all controllers of a chunk are in one file,
            which has no digest.
    """

    study: Mapping[str, Any]
    scenarios: Mapping[str, str]
    versions: Mapping[str, str] = field(default_factory=kinship)
    title: str = ""
    success: Mapping[str, float] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    noise: bool = True
    old: bool = False

    @property
    def name(self) -> str:
        """Name of the study that a parameter sweep simulates."""
        return str(self.study["name"])

    @cached_property
    def digest(self) -> str:
        """Digest of the settings that determine a sweep's results."""
        versions = self.versions["skyarm"] if self.old else self.versions
        facts = {"study": self.study, "scenarios": self.scenarios, "version": versions}
        return hashlib.sha256(json.dumps(facts).encode()).hexdigest()

    @property
    def chunks(self) -> int:
        """Number of chunks of episodes of the whole sweep."""
        return -(-int(self.study["episodes"]) // int(self.study["chunk"]))

    @property
    def rows(self) -> int:
        """Number of flights of the whole sweep."""
        return int(self.study["episodes"]) * len(self.scenarios)

    @property
    def vary(self) -> Mapping[str, Any]:
        """Tables of the distributions of the varied parameters, by path or name."""
        return self.study.get("vary") or {}

    @property
    def parameters(self) -> tuple[str, ...]:
        """Paths and names of the sweep's varied parameters, derived ones last."""
        return (*self.vary, *(self.study.get("derived") or {}))

    def span(self, index: int) -> range:
        """Range of episode numbers of one chunk of the sweep."""
        size, episodes = self.study["chunk"], self.study["episodes"]
        return range(index * size, min((index + 1) * size, episodes))

    def is_of(self, other: Manifest) -> bool:
        """True if two sweeps have the same study, regardless of package versions."""
        return (self.study, self.scenarios) == (other.study, other.scenarios)

    def differences(self, there: Manifest) -> Iterator[tuple[str, Plain, Plain]]:
        """Yield the differences of two sweeps that affect results: setting, value in
        this sweep, value in the other.
        """
        ours, theirs = (each._rows_depend_on() for each in (self, there))
        names = dict.fromkeys([*ours, *theirs])
        # the most telling first
        for name in sorted(
            names,
            key=lambda name: (
                name.startswith(("scenario of", "version of")),
                name == "vary",
            ),
        ):
            # as text, since the digest tells 1 from 1.0
            if json.dumps(ours.get(name)) != json.dumps(theirs.get(name)):
                yield name, ours.get(name), theirs.get(name)

    def _rows_depend_on(self) -> dict[str, Plain]:
        """Settings that determine a sweep's results, by name, as shown in error
        messages.
        """
        study = self.study
        return {
            **{
                name: value
                for name, value in study.items()
                if name not in ("vary", "plugins")
            },
            **{
                f"plugin {name!r}": value
                for name, value in (study.get("plugins") or {}).items()
            },
            **{f'vary."{path}"': value for path, value in self.vary.items()},
            "vary": list(self.vary),
            **{
                # twelve digits tell two digests apart
                f"scenario of {label!r}": digest[:12]
                for label, digest in self.scenarios.items()
            },
            **{
                f"version of {name}": version[:12]
                for name, version in self.versions.items()
            },
        }

    def write(self, folder: Path, rows: int, done: int) -> None:
        """Write the manifest, with the numbers of simulated flights and of complete
        chunks of episodes.
        """
        facts = {
            "schema": SCHEMA,
            "name": self.name,
            "digest": self.digest,
            **asdict(self),
        }
        del facts["old"]
        facts |= {
            "complete": done == self.chunks,
            "rows": rows,
            "chunks": {"done": done, "of": self.chunks},
        }
        content = json.dumps({**facts, "sha256": _sum(facts)}, indent=1) + "\n"
        write_inside(folder / MANIFEST, content.encode())


def _sum(facts: Facts) -> str:
    """SHA-256 digest of the content of a manifest."""
    return hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()


def read_manifest(folder: PathLike) -> Manifest | None:
    """Read the JSON manifest of a sweep's folder; None if it is missing or truncated.

    Raises:
        StudyError: it is no manifest, or is damaged.
        OSError: it cannot be read.
    """
    path = Path(folder) / MANIFEST
    if not path.is_file():
        return None
    if path.stat().st_size > LARGEST:
        raise StudyError(f"{path}: must have at most {LARGEST / 1e6:.0f} MB")
    try:
        table = json.loads(path.read_bytes())
    # json answers deep nesting by RecursionError
    except (ValueError, RecursionError):
        return None
    try:
        if not isinstance(table, dict):
            raise ValueError("must be a table")
        schema = table.get("schema")
        digest = table.pop("sha256", None)
        if schema not in (SCHEMA, OLD):
            raise ValueError(f"schema = {shown(schema)}: must be {SCHEMA}")
        if (digest is not None or schema == SCHEMA) and digest != _sum(table):
            raise ValueError("its content does not fit its sha256: it is damaged")
        _require(table, FIELDS, "")
        _require(table["study"], STUDY_FIELDS, "study.")
    except ValueError as error:
        raise StudyError(
            f"{path}: must be as 'skyarm sweep' wrote it ({error}); delete it, and it"
            " is made anew"
        ) from None
    return Manifest(
        **{name: table[name] for name in FIELDS if name in table}, old=schema == OLD
    )


def _require(table: Facts, fields: Mapping[str, Check], where: str) -> None:
    for name, may_be in fields.items():
        if not may_be(table.get(name)) and (name in table or name not in LEFT_OUT):
            raise ValueError(f"{where}{name} = {shown(table.get(name))}: cannot be")


def label_of(index: int, controller: str) -> str:
    """Label of the result file of one chunk of episodes with one controller."""
    return f"chunk_{index:07d}.{name_of(controller)}"
