"""Work items: flights of one scenario simulated together, and the digest of all that
their results depend on.
"""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from collections.abc import Callable, Mapping
from dataclasses import asdict, field
from functools import cache, cached_property, partial
from pathlib import Path

import numpy as np

import skyarm.records.files as skyarm_files
from skyarm.log.flight_log import Log
from skyarm.log.metrics.accumulate import added_metric
from skyarm.log.metrics.metric_catalogue import catalogue_names
from skyarm.log.metrics.windows import Windows
from skyarm.records.arrays import AnyArray as Array
from skyarm.records.files import versions
from skyarm.records.identity import identity, own_files
from skyarm.records.immutable import immutable
from skyarm.records.plain import digest, plain
from skyarm.records.registry import registrations
from skyarm.scenario.scenario_record import Scenario

Rows = dict[str, Array]
"""Columns of rows by name, a number or text per flight: identifying columns first, then
metrics and status."""

AUTOPILOT = "autopilot"
"""Status of a flight that ended because an autopilot's program failed; the cause
follows in rows."""


Measure = Callable[[Log], Mapping[str, float | None]]
"""Function that returns additional metrics of a log; a module's function, or a partial
of one."""


@immutable(slots=False, eq=False)
class Work:
    """Work item: flights of one scenario that are simulated together, with the same
    results in any process.

    Attributes:
        label: name in a folder, unique there.
        scenario: scenario that all flights have in common.
        columns: path -> value of each flight (:mod:`skyarm.scenario.numbers`).
        episodes: key of the noise of each flight.
        fixed: further columns of the rows, on which no flight depends: a word, or a
            value of each flight.
        metrics: names and groups of the catalogue. windows: windows of the metrics, in
            place of the scenario's.
        seed: seed of the noise. precision: "double", "single" or "bit_exact".
        stiffest: scenario that fixes the integration steps; the scenario itself if left
            out.
        effort: effort of the compiler (:class:`skyarm.simulate.Batch`).
        alone: whether each flight flies by itself: laws that cannot be traced, other
            plants, kept logs.
        measure: computes the metrics of such a flight from its log, in place of names.
        keeps_log: whether the rows hold its log.
    """

    label: str
    scenario: Scenario
    columns: Mapping[str, Array] = field(default_factory=dict)
    episodes: Array = field(default_factory=partial(np.zeros, 1, int))
    fixed: Mapping[str, str | Array] = field(default_factory=dict)
    metrics: tuple[str, ...] = ()
    windows: Windows | None = None
    seed: int = 0
    precision: str = "double"
    stiffest: Scenario | None = None
    effort: int = 2
    alone: bool = False
    measure: Measure | None = None
    keeps_log: bool = False

    @property
    def count(self) -> int:
        """Number of flights."""
        return len(self.episodes)

    @cached_property
    def program(self) -> str:
        """Digest of all that the compiled simulation depends on; work items of equal
        digest share a compilation.
        """
        metrics = [
            added_metric(name)
            for name in sorted(registrations("metric"))
            if name in catalogue_names(self.metrics)
        ]
        return digest(
            {
                "scenario": _identity(self.scenario),
                "stiffest": _identity(self.stiffest) if self.stiffest else "",
                "paths": list(self.columns),
                "metrics": list(self.metrics),
                "added": plain(metrics),
                "code": own_files(metrics),
                "windows": asdict(self.windows) if self.windows else "",
                "precision": self.precision,
                "effort": self.effort,
                "alone": self.alone,
            }
        )

    @cached_property
    def key(self) -> str:
        """SHA-256 digest (hexadecimal) of all that the results depend on: parameters,
        code and versions.
        """
        return digest(
            {
                "program": self.program,
                "seed": self.seed,
                "episodes": _bytes(self.episodes),
                "columns": {
                    path: _bytes(column) for path, column in self.columns.items()
                },
                "fixed": {
                    name: _bytes(np.asarray(column))
                    for name, column in self.fixed.items()
                },
                "measure": {
                    "function": plain(self.measure),
                    "code": own_files(self.measure),
                },
                "log": self.keeps_log,
                "versions": {
                    # only flights by themselves may be on MuJoCo's plant
                    **kinship(),
                    **(versions("mujoco-core") if self.alone else {}),
                },
            }
        )


Flown = tuple[Work, bytes]
"""Work item with the content of its result file."""


def _bytes(column: Array) -> str:
    array = np.ascontiguousarray(column)
    # type and shape, too: equal bytes may be other numbers
    return hashlib.sha256(
        f"{array.dtype.str} {array.shape} ".encode() + array.tobytes()
    ).hexdigest()


identified: OrderedDict[int, tuple[Scenario, str]] = OrderedDict()
"""Scenarios by address with their digests; they are stored so that no other object
takes the address.

A component of the user may be changed, so that it holds for one runner only."""


def _identity(scenario: Scenario) -> str:
    entry = identified.get(id(scenario))
    if entry is None:
        entry = identified[id(scenario)] = (scenario, identity(scenario))
        # each entry keeps its scenario alive: memory is bounded. 256 is chosen: a miss
        # costs 6 to 14 ms (measured)
        if len(identified) > 256:
            identified.popitem(last=False)
    return entry[1]


@cache
def kinship() -> Mapping[str, str]:
    """Package versions on which the bits of results may depend, and the digest of the
    library's own code.
    """
    installed = versions("numpy", "llvmlite")
    return {
        **{name: installed[name] for name in ("skyarm", "numpy", "llvmlite")},
        "code": _source(),
    }


@cache
def _source() -> str:
    """Digest of the library's source code: changed code invalidates stored results."""
    package = Path(skyarm_files.__file__).parents[2]
    source_digest = hashlib.sha256()
    # shipped tables decide numbers as code does
    for path in sorted(
        [*package.rglob("*.py"), *package.rglob("*.toml"), *package.rglob("*.json")]
    ):
        source_digest.update(
            path.relative_to(package).as_posix().encode() + path.read_bytes()
        )
    return source_digest.hexdigest()
