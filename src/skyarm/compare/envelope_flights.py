"""Flights of the envelope: a law flies an axis in one batch where it can, value by value where it cannot."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.compare.cells import Cell, Cells, Flights, fly
from skyarm.compare.entrants import Entrant
from skyarm.compare.envelope_axes import AXES, OUTSIDE, OVERSHOOT, Axis
from skyarm.compare.envelope_plants import PLANTS, plants_at
from skyarm.compare.envelope_setting import DURATION, PAPER, Setting, setting_of
from skyarm.compare.suite import Case, Condition
from skyarm.metrics.windows import Window, Windows
from skyarm.scenario.controller_table import controller_by_name
from skyarm.scenario.scenario_record import Scenario
from skyarm.simulate.workers import workers

Array = npt.NDArray[Any]
Done = Callable[[int, int, str], None]


@dataclass(frozen=True, kw_only=True)
class AxisFlights(Flights):
    """Flights of a law along an axis, a lane a value; all meet the same noise.

    Attributes:
        points: values that fly, SI. vehicle: name or file. duration: s, of every flight.
    """

    points: tuple[float, ...]
    vehicle: str = PAPER
    duration: float = DURATION

    @property
    def axis(self) -> Axis:
        """What is made harder."""
        return AXES[self.case.name]

    @property
    def label(self) -> str:
        """Name of its file, of a single value with the value; a law may be called by the path of a file."""
        at = f"_{self.points[0]:g}" if len(self.points) == 1 else ""
        return re.sub(r"[^\w.() -]+", "-", f"{super().label}{at}")

    def scenario(self) -> Scenario:
        """The trial at the easiest value of the axis, or where values are no data at the one that flies."""
        setting = setting_of(self.vehicle, self.duration, self.plant)
        value = self.points[0] if self.axis.numbers is None else self.axis.of(setting)[0]
        built = dataclasses.replace(self.axis.scenario(setting, value), seed=self.seed, name=self.case.name)
        return dataclasses.replace(built, controller=controller_by_name(built, self.entrant.law))

    def values(self, scenario: Scenario) -> dict[str, Array]:
        """Numbers of every value, by path."""
        if not self.axis.batched:
            return {}
        setting = setting_of(self.vehicle, self.duration, self.plant)
        if self.axis.plants:
            count = self.episodes(scenario) // len(self.points)
            drawn = [plants_at(setting, scenario, value, count, seed=self.seed) for value in self.points]
            return {path: np.concatenate([each[path] for each in drawn]) for path in drawn[0]}
        assert self.axis.numbers is not None
        rows = [self.axis.numbers(setting, value) for value in self.points]
        return {path: np.array([row[path] for row in rows]) for path in rows[0]}

    def episodes(self, scenario: Scenario) -> int:
        """One for each value; of an axis of plants as many as a law meets, value after value."""
        if not self.axis.plants:
            return len(self.points)
        return len(self.points) * (min(PLANTS, self.one_by_one) if self.alone(scenario) else PLANTS)

    def keys(self, count: int) -> Array:
        """The noise of the first episode for every value."""
        return np.zeros(count, dtype=int)

    @property
    def further_metrics(self) -> tuple[str, ...]:
        """How far beyond a step, and for how long away from the reference."""
        return (OVERSHOOT, OUTSIDE)

    def more(self) -> Mapping[str, Any]:
        """Values are a part of what fixes the cell."""
        found = {path: list(column) for path, column in self.values(self.scenario()).items()}
        return {"points": list(self.points), "values": found, "further": self.further_metrics}


def axis_flights(
    law: str, axis: Axis, setting: Setting, *, seed: int = 0, plant: str = "rigid_body"
) -> list[AxisFlights]:
    """Cells of a law along an axis: one where its values fly in a batch, else one for each value.

    Args:
        law: preset or law.
        axis: with the values that fly.
        setting: vehicle and duration.
        seed: of the noise.
        plant: that flies.

    Raises:
        ControllerError: the law does not fit the vehicle.
    """
    points = axis.of(setting)
    facts: dict[str, Any] = {"duration": setting.duration, "seed": seed, "plant": plant}
    whole = flights_at(law, axis.name, setting.vehicle, points, **facts)
    if axis.batched and not whole.alone(whole.scenario()):
        return [whole]
    return [flights_at(law, axis.name, setting.vehicle, (value,), **facts) for value in points]


def flights_at(
    law: str, name: str, vehicle: str, points: tuple[float, ...], *, duration: float, seed: int, plant: str
) -> AxisFlights:
    """A cell from plain values, as they travel to another process."""
    axis = AXES[name]
    inside = Window(axis.start, duration)
    windows = Windows(steady=inside, gust=inside)
    condition = "noisy" if axis.noisy else "perfect"
    return AxisFlights(
        entrant=Entrant(name=law, group="own", law=law),
        case=Case(name=name, title=axis.title, scenario=vehicle, windows=windows),
        condition=Condition(name=condition, title=condition, noisy=axis.noisy, episodes=len(points), cases=(name,)),
        plant=plant,
        seed=seed,
        points=points,
        vehicle=vehicle,
        duration=duration,
    )


def fly_at(law: str, name: str, vehicle: str, points: tuple[float, ...], facts: Mapping[str, Any]) -> Cell:
    """Fly a cell from plain values."""
    return fly(flights_at(law, name, vehicle, points, **facts))


def perform_axes(
    todo: Sequence[AxisFlights], folder: Path, *, threads: int = 1, progress: Done | None = None
) -> list[Cell]:
    """Cells in order; those that the folder holds are not flown again, the others fly in processes.

    Args:
        todo: what flies.
        folder: of the cells.
        threads: processes; the numbers do not depend on it.
        progress: called after every cell.

    Raises:
        OSError: a process ended unexpectedly, or a cell cannot be written.
    """
    cells, found = Cells(folder), dict[int, Cell]()

    def note(k: int, cell: Cell) -> None:
        found[k] = cell
        if progress is not None:
            progress(len(found), len(todo), todo[k].label.replace("__", " "))

    def keep(k: int, cell: Cell) -> None:
        cells.put(todo[k], cell)
        note(k, cell)

    left = []
    for k, flights in enumerate(todo):
        cell = cells.get(flights)
        if cell is None:
            left.append(k)
        else:
            note(k, cell)
    if threads == 1 or len(left) < LEAST:
        for k in left:
            keep(k, fly(todo[k]))
    else:
        with workers(min(threads, len(left))) as submit:
            flying = {submit(fly_at, *_travelling(todo[k])): k for k in left}
            for flown in as_completed(flying):
                keep(flying[flown], flown.result())
    return [found[k] for k in range(len(todo))]


LEAST = 4
"""Cells for which processes are worth their start."""


def _travelling(flights: AxisFlights) -> tuple[Any, ...]:
    facts = {"duration": flights.duration, "seed": flights.seed, "plant": flights.plant}
    return flights.entrant.law, flights.case.name, flights.vehicle, flights.points, facts
