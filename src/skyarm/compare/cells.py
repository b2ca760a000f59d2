"""One cell of the bench: an entrant flies a case under a condition; kept as a file that appears whole."""

from __future__ import annotations

import dataclasses
import hashlib
import io
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

import skyarm.files as skyarm_files
from skyarm.compare.entrants import Entrant
from skyarm.compare.plants import draw
from skyarm.compare.single import METRICS, fly_one_by_one
from skyarm.compare.suite import CASES, Case, Condition
from skyarm.files import versions, write_atomically
from skyarm.simulate.batch import Batch
from skyarm.simulate.paths import with_numbers
from skyarm.simulate.scenario import Scenario
from skyarm.sweep.identity import identity

Array = npt.NDArray[Any]


BRIEF, WIDEST = ("step", "part"), "case3_wind"
"""Groups of entrants that meet wrong plants in one case only: their tables ask what a part buys."""

SINGLE = 8
"""Wrong plants that a law meets whose flights fly one by one, about a thousand times slower than a batch."""


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


@dataclass(frozen=True, kw_only=True)
class Flights:
    """What fixes a cell.

    Attributes:
        entrant, case, condition: who flies what. plant: "rigid_body" or "mujoco". seed: of plants and noise.
        single: wrong plants at most, if the episodes fly one by one.
    """

    entrant: Entrant
    case: Case
    condition: Condition
    plant: str = "rigid_body"
    seed: int = 0
    single: int = SINGLE

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
        return self.plant != "rigid_body" or not scenario.controller.compiled

    def episodes(self, scenario: Scenario) -> int:
        """How many fly: of wrong plants the first ``single``, if they fly one by one."""
        every = self.condition.episodes
        return min(self.single, every) if self.condition.spread and self.alone(scenario) else every


def fly(flights: Flights, threads: int = 1) -> Cell:
    """Fly a cell; a law that is not over scalars flies one episode after the other."""
    scenario = flights.scenario()
    values = flights.values(scenario)
    episodes = flights.episodes(scenario)
    if flights.alone(scenario):
        return Cell(*fly_one_by_one(scenario, values, episodes, flights.case.windows))
    damping = {path: float(column.max()) for path, column in values.items() if path.endswith(".damping")}
    efforts = (f"tau{i + 1}_rms" for i in range(scenario.world.vehicle.n))
    batch = Batch(
        scenario,
        tuple(values),
        metrics=(*METRICS, *efforts),
        windows=flights.case.windows,
        stiffest=with_numbers(scenario, damping),
        effort=0 if episodes <= FEW else 2,
    )
    found = batch.fly(values, seed=flights.seed, episodes=np.arange(episodes), threads=threads)
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
        try:
            stored = self._path(flights).read_bytes()
        except OSError:
            return None
        digest, content = stored[:32], stored[32:]
        if hashlib.sha256(content).digest() != digest:
            return None
        with np.load(io.BytesIO(content), allow_pickle=False) as held:
            if str(held["identity"]) != key(flights):
                return None
            metrics = {name.removeprefix("metric."): held[name] for name in held if name.startswith("metric.")}
            return Cell(metrics, held["status"])

    def put(self, flights: Flights, cell: Cell) -> None:
        """Keep a cell behind its checksum."""
        stream = io.BytesIO()
        arrays: dict[str, Any] = {f"metric.{name}": values for name, values in cell.metrics.items()}
        np.savez_compressed(stream, identity=np.array(key(flights)), status=cell.status, **arrays)
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
        "metrics": METRICS,
        "scenario": identity(scenario),
        "episodes": flights.episodes(scenario),
        "spread": dataclasses.asdict(condition.spread) if condition.spread else None,
        "windows": dataclasses.asdict(flights.case.windows),
        "seed": flights.seed,
    }
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
    single: int = SINGLE,
) -> list[Flights]:
    """Every cell of a bench, entrant by entrant."""
    return [
        Flights(entrant=entrant, case=CASES[case], condition=condition, seed=seed, plant=plant, single=single)
        for entrant in entrants.values()
        for condition in conditions.values()
        for case in condition.cases
        if not condition.spread or case == WIDEST or entrant.group not in BRIEF
    ]
