"""Flights of a controller comparison, simulated and stored per controller, case and condition.

A law that can be traced flies all episodes of a cell as one batch; others, and every law on MuJoCo's plant, fly one
episode after the other, about a thousand times slower.
"""

from __future__ import annotations

import dataclasses
import hashlib
import io
import json
import math
import re
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

import skyarm.records.files as skyarm_files
from skyarm.log.log_columns import names_of
from skyarm.log.metrics.score import score
from skyarm.log.metrics.shortfall import LARGEST_ERROR
from skyarm.records.arrays import AnyArray as Array
from skyarm.records.arrays import Mask
from skyarm.records.files import versions, write_atomically
from skyarm.records.files.unpacked import npz_arrays
from skyarm.records.identity import identity, own_files
from skyarm.records.immutable import immutable
from skyarm.records.registry import find
from skyarm.records.registry import names as registered
from skyarm.scenario.in_flight import is_traceable
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.paths import LATE
from skyarm.scenario.scenario_record import Delays, Scenario
from skyarm.simulate.batch import Batch
from skyarm.simulate.loop import run
from skyarm.studies.compare.entrants import Entrant
from skyarm.studies.compare.perturbed_plants import draw
from skyarm.studies.compare.suite import Case, Condition

Flown = tuple[dict[str, float], str]
"""Metrics and status of one flight."""

JITTER, LIMITED = "rotor_jitter", "rotor_saturation"
"""Metrics that every table shows beside the tip's error: RMS change of a rotor command per control period, rad/s, and
the share of periods with a rotor at its limit."""

METRICS = (
    *(f"{what}_error_{how}_continuous" for what in ("position", "joint", "ee") for how in ("mean", "max")),
    *("gust_peak_x_continuous", "gust_ee_peak_x_continuous"),
    *("ee_error_last_mean_continuous", "ee_error_last_max_continuous"),
    *(JITTER, LIMITED, "rate_rms", "tilt_max", "altitude_error_max_continuous"),
)
"""Counted of every flight, under the names of :mod:`skyarm.log.metrics.metric_catalogue`; and every joint's effort."""

ONE_BY_ONE = 8
"""Perturbed plants that a law meets whose flights fly one by one."""

AUTOPILOT = "autopilot"
"""Status of a flight that ended because an autopilot's program failed; here its cause follows."""

TILTED = math.radians(80.0)
"""rad: a flight that leans further is lost, even where it comes to its end."""

FEW = 16
"""Episodes up to which a compiler's full effort takes longer than it saves."""


@immutable(kw_only=False)
class Cell:
    """Metrics of all episodes of one controller in one case under one condition.

    Attributes:
        metrics: by name; NaN where the episode ended before their window.
        status: "completed", or why it ended.
    """

    metrics: Mapping[str, Array]
    status: Array

    @classmethod
    def of(cls, flown: Sequence[Flown]) -> Cell:
        """Combine the metrics of single flights into arrays; metrics that a flight lacks become NaN."""
        names = dict.fromkeys(name for row, _ in flown for name in row)
        metrics = {name: np.array([row.get(name, np.nan) for row, _ in flown]) for name in names}
        return cls(metrics, np.array([status for _, status in flown]))

    @property
    def completed(self) -> Mask:
        """True for each episode that reached its planned end."""
        return np.asarray(self.status == "completed")

    @property
    def stands(self) -> bool:
        """False where an autopilot's program has failed, which may go better another time."""
        return not any(str(status).startswith(AUTOPILOT) for status in self.status)

    @property
    def upright(self) -> Mask:
        """True for each episode in which the vehicle never tipped over."""
        return np.asarray(self.metrics["tilt_max"] <= TILTED)

    @property
    def tracked_to_end(self) -> Mask:
        """True for each completed, upright episode with a small mean tip error in its last seconds."""
        near = self.metrics["ee_error_last_mean_continuous"] <= LARGEST_ERROR
        return np.asarray(self.completed & self.upright & near)


@immutable
class Flights:
    """Description of the flights of one controller in one case and condition, to send to another process.

    Attributes:
        entrant: controller. case, condition: of the flights. plant: kind of simulated plant. seed: of plants and noise.
    """

    entrant: Entrant
    case: Case
    condition: Condition
    plant: str = "rigid_body"
    seed: int = 0

    further_metrics: ClassVar[tuple[str, ...]] = ()
    """Metrics in addition to those that every comparison counts."""

    same_noise: ClassVar[bool] = False
    """Whether all episodes have the noise of the first."""

    @property
    def name(self) -> tuple[str, str, str]:
        """Names of condition, case and controller of these flights."""
        return self.condition.name, self.case.name, self.entrant.name

    @property
    def label(self) -> str:
        """File name of the stored results without suffix, also shown in progress output."""
        plant = "" if self.plant == "rigid_body" else f"_{self.plant}"
        return re.sub(r"[^\w.() -]+", "-", "__".join(self.name) + plant)

    def scenario(self) -> Scenario:
        """Scenario that all flights have in common, before their perturbed parameters are set."""
        built = self.condition.apply(self.case.build())
        controller = self.entrant.controller(built.controller.par.model, noisy=self.condition.noisy)
        return built.with_words(controller=controller, kind=self.plant, seed=self.seed)

    def values(self, scenario: Scenario) -> dict[str, Array]:
        """Perturbed parameters of the flights: parameter path -> values (flights,)."""
        spread = self.condition.spread
        # drawn about the case as it is, whatever flies: every law meets the same plants
        return draw(scenario, spread, self.episodes(scenario), seed=self.seed) if spread else {}

    def alone(self, scenario: Scenario) -> bool:
        """True if the episodes are simulated one by one, not as a batch."""
        return self.plant != "rigid_body" or not is_traceable(scenario)

    def episodes(self, scenario: Scenario) -> int:
        """Number of flights; with perturbed plants, reduced if they cannot be simulated as a batch."""
        every = self.condition.episodes
        return min(ONE_BY_ONE, every) if self.condition.spread and self.alone(scenario) else every

    def keys_of_noise(self, count: int) -> Array:
        """Noise seed (count,) of each episode; zeros if all episodes share one noise sequence."""
        return np.zeros(count, dtype=int) if self.same_noise else np.arange(count)

    def trials(self, count: int) -> Array:
        """Index of each flight (count,), which identifies its perturbed plant or noise seed."""
        return np.arange(count, dtype=float)

    def stiffest(self, values: Mapping[str, Array]) -> dict[str, float]:
        """Values that require the shortest integration step among all flights, by parameter path."""
        return {path: float(column.max()) for path, column in values.items() if path.endswith(".damping")}

    def metric_names(self, setpoints: Sequence[bool]) -> tuple[str, ...]:
        """Names of the metrics to compute: common ones, joint torques, user-registered ones and those of the suite.

        Args:
            setpoints: joint by joint, whether its command is a setpoint of its drive: its torque is then not counted.
        """
        efforts = (f"tau{i + 1}_rms" for i, each in enumerate(setpoints) if not each)
        return (*METRICS, *efforts, *registered("metric", shipped=False), *self.further_metrics)


def fly(flights: Flights, threads: int = 1) -> Cell:
    """Simulate all flights of one controller in one case and condition, and compute their metrics."""
    scenario = flights.scenario()
    values, episodes = flights.values(scenario), flights.episodes(scenario)
    if flights.alone(scenario):
        return Cell.of([fly_episode(flights, k) for k in range(episodes)])
    batch = Batch(
        scenario,
        tuple(values),
        metrics=flights.metric_names(scenario.commands_setpoints),
        windows=flights.case.windows,
        stiffest=with_numbers(scenario, flights.stiffest(values)),
        effort=0 if episodes <= FEW else 2,
    )
    found = batch.fly(values, seed=flights.seed, episodes=flights.keys_of_noise(episodes), threads=threads)
    return Cell(found.metrics, found.status)


def fly_episode(flights: Flights, episode: int) -> Flown:
    """Simulate a single flight of a comparison; returns its metrics and status."""
    log = run(episode_scenario(flights, episode))
    names = flights.metric_names([unit is not None for unit in names_of(log).setpoints])
    status = f"{AUTOPILOT}: {log.info['cause']}" if log.status == AUTOPILOT else log.status
    return score(log, names, flights.case.windows), status


def episode_scenario(flights: Flights, episode: int) -> Scenario:
    """Scenario of a single episode of a batch, with its command delay rounded to whole physics steps."""
    scenario = flights.scenario()
    numbers = {path: float(column[episode]) for path, column in flights.values(scenario).items()}
    late, rate = numbers.pop(LATE, None), scenario.rates.physics
    key = int(flights.keys_of_noise(episode + 1)[episode])
    found = dataclasses.replace(with_numbers(scenario, numbers), episode=key)
    if late is None:
        return found
    delays = Delays(measurement=found.delays.measurement, command=round(late * rate) / rate)
    return found.with_words(delays=delays)


class Cells:
    """Folder of stored comparison results; those of an unchanged scenario are reused.

    Args:
        folder: made if missing.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def get(self, flights: Flights) -> Cell | None:
        """Read the stored metrics of some flights; None if the file is missing, damaged or outdated."""
        try:
            stored = self._path(flights).read_bytes()
            held = npz_arrays(stored[32:]) if hashlib.sha256(stored[32:]).digest() == stored[:32] else {}
            if str(held.pop("identity")) != key(flights):
                return None
            status = held.pop("status")
        except (OSError, ValueError, KeyError):
            return None
        return Cell(held, status)

    def put(self, flights: Flights, cell: Cell) -> None:
        """Write the metrics of some flights to a file with a checksum, unless an autopilot's program has failed."""
        if not cell.stands:
            return
        stream = io.BytesIO()
        arrays: dict[str, Any] = {"identity": np.array(key(flights)), "status": cell.status, **cell.metrics}
        np.savez_compressed(stream, **arrays)
        content = stream.getvalue()
        write_atomically(self._path(flights), hashlib.sha256(content).digest() + content)

    def _path(self, flights: Flights) -> Path:
        return self.folder / f"{flights.label}.cell"


def key(flights: Flights) -> str:
    """Digest of everything that determines the metrics of some flights, to detect outdated result files."""
    scenario = flights.scenario()
    facts = {
        "versions": versions("numpy", "llvmlite"),
        "source": _source(),
        "metrics": sorted(flights.metric_names(())),
        "code": own_files([find("metric", name) for name in registered("metric", shipped=False)]),
        "scenario": identity(scenario),
        "episodes": flights.episodes(scenario),
        "values": {p: hashlib.sha256(column.tobytes()).hexdigest() for p, column in flights.values(scenario).items()},
        "windows": dataclasses.asdict(flights.case.windows),
        "seed": flights.seed,
    }
    return hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()


@lru_cache(maxsize=1)
def _source() -> str:
    """Digest of the library's source code, so that changed code invalidates stored results."""
    package = Path(skyarm_files.__file__).parents[2]
    found = hashlib.sha256()
    for path in sorted([*package.rglob("*.py"), *package.rglob("*.toml"), *package.rglob("*.json")]):
        found.update(path.relative_to(package).as_posix().encode() + path.read_bytes())
    return found.hexdigest()
