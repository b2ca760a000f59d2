"""One cell of the comparison: an entrant flies a case under a condition; kept as a file that appears whole."""

from __future__ import annotations

import dataclasses
import hashlib
import io
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

import skyarm.files as skyarm_files
from skyarm.compare.entrants import Entrant
from skyarm.compare.one_by_one import METRICS, counted_metrics, fly_one_by_one
from skyarm.compare.perturbed_plants import draw
from skyarm.compare.suite import CASES, Case, Condition
from skyarm.files import versions, write_atomically
from skyarm.files.unpacked import npz_arrays
from skyarm.metrics.shortfall import LARGEST_ERROR
from skyarm.records.identity import identity, own_files
from skyarm.registry import find
from skyarm.registry import names as registered
from skyarm.registry.plugins import identities
from skyarm.scenario.in_flight import is_traceable
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.scenario_record import Scenario
from skyarm.simulate.batch import Batch

Array = npt.NDArray[Any]


BRIEF, WIDEST = ("step", "part"), "case3_wind"
"""Groups of entrants that meet wrong plants in one case only: their tables ask what a part buys."""

ONE_BY_ONE = 8
"""Wrong plants that a law meets whose flights fly one by one, about a thousand times slower than a batch."""


TILTED = math.radians(80.0)
"""rad: a flight that tilts further is lost, even where it comes to its end."""

FEW = 16
"""Episodes up to which a compiler's full effort takes longer than it saves."""


@dataclass(frozen=True, slots=True)
class Cell:
    """Metrics of an entrant's flights of a case under a condition, one entry per episode.

    Attributes:
        metrics: by name; NaN where the episode ended before their window.
        status: "completed", or why it ended.
    """

    metrics: Mapping[str, Array]
    status: Array

    @property
    def completed(self) -> npt.NDArray[np.bool_]:
        """Which episodes flew to their end."""
        return np.asarray(self.status == "completed")

    @property
    def upright(self) -> npt.NDArray[np.bool_]:
        """Which episodes never tilted over."""
        return np.asarray(self.metrics["tilt_max"] <= TILTED)

    @property
    def flown(self) -> npt.NDArray[np.bool_]:
        """Which episodes flew to their end, upright, the tip near its reference in the mean of the last seconds."""
        near = self.metrics["ee_error_last_mean_continuous"] <= LARGEST_ERROR
        return np.asarray(self.completed & self.upright & near)


@dataclass(frozen=True, kw_only=True)
class Flights:
    """What fixes a cell.

    Attributes:
        entrant, case, condition: who flies what. plant: "rigid_body" or "mujoco". seed: of plants and noise.
        one_by_one: wrong plants at most, if the episodes fly one by one.
    """

    entrant: Entrant
    case: Case
    condition: Condition
    plant: str = "rigid_body"
    seed: int = 0
    one_by_one: int = ONE_BY_ONE

    @property
    def label(self) -> str:
        """Name of its file, and what a progress bar says."""
        plant = "" if self.plant == "rigid_body" else f"_{self.plant}"
        return f"{self.condition.name}__{self.case.name}__{self.entrant.name}{plant}"

    def scenario(self) -> Scenario:
        """The scenario that every episode starts from."""
        built = self.condition.apply(self.case.build())
        model = built.controller.par.model
        controller = self.entrant.controller(model, noisy=self.condition.noisy)
        return dataclasses.replace(built, controller=controller, plant=self.plant, seed=self.seed)

    def values(self, scenario: Scenario) -> dict[str, Array]:
        """Numbers that differ from episode to episode, by path."""
        spread = self.condition.spread
        # drawn about the case as it is, whatever flies: every law meets the same plants
        return draw(scenario, spread, self.episodes(scenario), seed=self.seed) if spread else {}

    def alone(self, scenario: Scenario) -> bool:
        """Whether the episodes fly one by one."""
        return self.plant != "rigid_body" or not is_traceable(scenario)

    def episodes(self, scenario: Scenario) -> int:
        """How many fly: of wrong plants the first ``one_by_one``, if they fly one by one."""
        every = self.condition.episodes
        return min(self.one_by_one, every) if self.condition.spread and self.alone(scenario) else every

    def keys(self, count: int) -> Array:
        """Keys of the noise, one per episode."""
        return np.arange(count)

    @property
    def further_metrics(self) -> tuple[str, ...]:
        """Metrics beside those that every comparison counts."""
        return ()

    def stiffest(self, values: Mapping[str, Array]) -> dict[str, float]:
        """Numbers of the episodes that fix the integration steps of all, by path."""
        return {path: float(column.max()) for path, column in values.items() if path.endswith(".damping")}

    def more(self) -> Mapping[str, Any]:
        """What else fixes the cell, beside its scenario, its spread and its windows."""
        return {}


def fly(flights: Flights, threads: int = 1) -> Cell:
    """Fly a cell; a law that cannot be traced flies one episode after the other."""
    scenario = flights.scenario()
    values = flights.values(scenario)
    episodes = flights.episodes(scenario)
    if flights.alone(scenario):
        options: dict[str, Any] = {"keys": flights.keys(episodes), "more": flights.further_metrics}
        return Cell(*fly_one_by_one(scenario, values, episodes, flights.case.windows, **options))
    batch = Batch(
        scenario,
        tuple(values),
        metrics=(*counted_metrics(scenario.told), *flights.further_metrics),
        windows=flights.case.windows,
        stiffest=with_numbers(scenario, flights.stiffest(values)),
        effort=0 if episodes <= FEW else 2,
    )
    found = batch.fly(values, seed=flights.seed, episodes=flights.keys(episodes), threads=threads)
    return Cell(found.metrics, found.status)


class Cells:
    """A folder of cells; one that is there, and of this very scenario, is not flown again.

    Args:
        folder: made if missing.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def get(self, flights: Flights) -> Cell | None:
        """The cell, if it is there, whole, and belongs to what would be flown today."""
        content = self._content(flights)
        if content is None:
            return None
        try:
            held = npz_arrays(content)
            if str(held["identity"]) != key(flights):
                return None
            metrics = {name.removeprefix("metric."): held[name] for name in held if name.startswith("metric.")}
            status = held["status"]
        except (ValueError, KeyError):
            return None  # a checksum that fits is no proof: the folder may come from anyone
        fits = all(column.shape == status.shape and column.dtype == float for column in metrics.values())
        return Cell(metrics, status) if fits and status.ndim == 1 and status.dtype.kind == "U" else None

    def plugins(self, flights: Flights) -> Mapping[str, str]:
        """Name and identity of the plugins that were loaded when a cell was flown; empty where none is there."""
        content = self._content(flights)
        try:
            found = json.loads(str(npz_arrays(content or b"")["plugins"]))
        except (ValueError, KeyError, RecursionError):
            return {}
        return found if isinstance(found, dict) else {}

    def _content(self, flights: Flights) -> bytes | None:
        """What a cell's file holds behind its checksum; None where it is not there or not whole."""
        try:
            stored = self._path(flights).read_bytes()
        except OSError:
            return None
        digest, content = stored[:32], stored[32:]
        return content if hashlib.sha256(content).digest() == digest else None

    def put(self, flights: Flights, cell: Cell) -> None:
        """Keep a cell behind its checksum."""
        stream = io.BytesIO()
        arrays: dict[str, Any] = {f"metric.{name}": values for name, values in cell.metrics.items()}
        plugins = np.array(json.dumps(identities(), sort_keys=True))
        np.savez_compressed(stream, identity=np.array(key(flights)), plugins=plugins, status=cell.status, **arrays)
        content = stream.getvalue()
        write_atomically(self._path(flights), hashlib.sha256(content).digest() + content)

    def _path(self, flights: Flights) -> Path:
        return self.folder / f"{flights.label}.cell"


def key(flights: Flights) -> str:
    """Digest of what the numbers of a cell depend on."""
    condition, scenario = flights.condition, flights.scenario()
    facts = {
        "versions": versions("numpy", "llvmlite"),
        "source": source(),
        "metrics": (*METRICS, *sorted(registered("metric"))),
        "scenario": identity(scenario),
        "episodes": flights.episodes(scenario),
        "spread": dataclasses.asdict(condition.spread) if condition.spread else None,
        "windows": dataclasses.asdict(flights.case.windows),
        "seed": flights.seed,
    }
    counted = own_files([find("metric", name) for name in registered("metric")])
    facts |= {"code": counted} if counted else {}
    facts |= flights.more()
    return hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()


@lru_cache(maxsize=1)
def source() -> str:
    """Digest of the library's own code: a formula that changed is flown again."""
    package = Path(skyarm_files.__file__).parents[1]
    found = hashlib.sha256()
    for path in sorted([*package.rglob("*.py"), *package.rglob("*.toml"), *package.rglob("*.json")]):
        found.update(path.relative_to(package).as_posix().encode() + path.read_bytes())
    return found.hexdigest()


def chosen(
    entrants: Mapping[str, Entrant],
    conditions: Mapping[str, Condition],
    *,
    seed: int = 0,
    plant: str = "rigid_body",
    one_by_one: int = ONE_BY_ONE,
) -> list[Flights]:
    """Every cell of a comparison, entrant by entrant."""
    return [
        Flights(entrant=entrant, case=CASES[case], condition=condition, seed=seed, plant=plant, one_by_one=one_by_one)
        for entrant in entrants.values()
        for condition in conditions.values()
        for case in condition.cases
        if not condition.spread or case == WIDEST or entrant.group not in BRIEF
    ]
