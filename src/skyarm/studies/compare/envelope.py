"""Performance envelope of controllers: one trial parameter at a time is increased until the vehicle crashes.

A law flies an axis as one batch where the axis' values are data of one scenario, value by value where they are not.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from skyarm.control.controller import ControllerError
from skyarm.log.metrics.windows import Window, Windows
from skyarm.records.arrays import AnyArray as Array
from skyarm.records.immutable import immutable
from skyarm.scenario.controller_table import controller_by_name
from skyarm.scenario.scenario_record import Scenario
from skyarm.studies.compare.cells import ONE_BY_ONE, Cell, Document, Flights, Record
from skyarm.studies.compare.entrants import TUNED, Entrant
from skyarm.studies.compare.envelope_axes import AXES, OUTSIDE, OVERSHOOT, PLANTS, Axis, plants_at
from skyarm.studies.compare.envelope_report import (
    axis_record,
    envelope_picture,
    envelope_report,
    points_of,
)
from skyarm.studies.compare.envelope_setting import DURATION, PAPER, Setting, setting_of
from skyarm.studies.compare.run_suite import Refused, Suite
from skyarm.studies.compare.suite import Case, Condition
from skyarm.view.pages import Report

ENVELOPE = "envelope-suite"

LAWS = ("paper_pd", "paper_ct", "l1_adaptive", "centroidal_tip")
"""What flies where nobody chooses; nmpc takes a quarter of an hour more (--laws nmpc)."""

TUNED_LAWS = tuple(TUNED.get(law, law) for law in LAWS)
"""What flies on another vehicle than the paper's where nobody chooses."""

QUICK = 10.0
"""s, of a trial where the envelope is to be quick."""


@immutable(slots=False)
class AxisFlights(Flights):
    """Flights of one controller in a trial at increasing difficulty, all with the same noise.

    Attributes:
        points: values that fly, SI. vehicle: name or file. duration: s, of every flight.
    """

    points: tuple[float, ...]
    vehicle: str = PAPER
    duration: float = DURATION

    further_metrics = (OVERSHOOT, OUTSIDE)
    same_noise = True

    @property
    def axis(self) -> Axis:
        """Difficulty axis of these flights: a trial with one parameter that grows."""
        return AXES[self.case.name]

    @property
    def setting(self) -> Setting:
        """Hover scenario of the vehicle, with the scales of its envelope trials."""
        return setting_of(self.vehicle, self.duration, self.plant)

    @property
    def label(self) -> str:
        """File name of the stored results; includes the axis value if the flights have only one."""
        return super().label + (f"_{self.points[0]:g}" if len(self.points) == 1 else "")

    def scenario(self) -> Scenario:
        """Scenario of the envelope trial at its easiest value, or at the only value to be simulated."""
        value = self.points[0] if self.axis.numbers is None else self.axis.of(self.setting)[0]
        built = dataclasses.replace(self.axis.scenario(self.setting, value), seed=self.seed, name=self.case.name)
        return built.with_controller(controller_by_name(built, self.entrant.law))

    def values(self, scenario: Scenario) -> dict[str, Array]:
        """Parameters that vary along the difficulty axis: parameter path -> values (flights,)."""
        if self.axis.plants:
            count = self.episodes(scenario) // len(self.points)
            drawn = [plants_at(self.setting, scenario, value, count, seed=self.seed) for value in self.points]
            return {path: np.concatenate([each[path] for each in drawn]) for path in drawn[0]}
        rows = [self.axis.numbers(self.setting, value) for value in self.points] if self.axis.numbers else [{}]
        return {path: np.array([row[path] for row in rows]) for path in rows[0]}

    def episodes(self, scenario: Scenario) -> int:
        """Number of flights: one per axis value, or several perturbed plants per value."""
        if not self.axis.plants:
            return len(self.points)
        return len(self.points) * (min(PLANTS, ONE_BY_ONE) if self.alone(scenario) else PLANTS)

    def trials(self, count: int) -> Array:
        """Axis value (count,) of each flight, SI."""
        return np.repeat(self.points, count // len(self.points))


def axis_flights(
    law: str, axis: Axis, setting: Setting, *, seed: int = 0, plant: str = "rigid_body"
) -> list[AxisFlights]:
    """Flights of a controller along one difficulty axis: one batch if possible, else one entry per value.

    Args:
        law: preset or law.
        axis: with the values that fly.
        setting: vehicle and duration.
        seed: of the noise.
        plant: kind of simulated plant.

    Raises:
        ControllerError: the law does not fit the vehicle.
    """
    points, inside = axis.of(setting), Window(axis.start, setting.duration)
    condition = "noisy" if axis.noisy else "perfect"
    whole = AxisFlights(
        entrant=Entrant(name=law, group="own", law=TUNED.get(law, law) if axis.vehicle else law),
        case=Case(
            name=axis.name, title=axis.title, scenario=setting.vehicle, windows=Windows(steady=inside, gust=inside)
        ),
        condition=Condition(name=condition, title=condition, noisy=axis.noisy, episodes=1, cases=(axis.name,)),
        plant=plant,
        seed=seed,
        points=points,
        vehicle=setting.vehicle,
        duration=setting.duration,
    )
    if (axis.plants or axis.numbers is not None) and not whole.alone(whole.scenario()):
        return [whole]
    return [dataclasses.replace(whole, points=(value,)) for value in points]


@immutable
class Envelope(Suite[AxisFlights]):
    """Benchmark that measures the performance envelope of several controllers.

    Attributes:
        laws: presets or laws, in order. axes: names. vehicle: name or file. seed: of the noise. plant: its kind.
        quick: the first and the last value of each axis only, in flights of 10 s.
    """

    laws: tuple[str, ...] = LAWS
    axes: tuple[str, ...] = tuple(AXES)
    vehicle: str = PAPER
    seed: int = 0
    plant: str = "rigid_body"
    quick: bool = False

    name, file, folder = ENVELOPE, "envelope", "out/envelope"
    settings = ("vehicle", "seed", "plant", "quick")

    @property
    def setting(self) -> Setting:
        """Hover scenario of the vehicle, with the scales of its envelope trials."""
        return setting_of(self.vehicle, QUICK if self.quick else DURATION, self.plant)

    def setting_of_axis(self, name: str) -> Setting:
        """Hover scenario of the vehicle that flies a difficulty axis, the envelope's or the axis' own."""
        return setting_of(AXES[name].vehicle or self.vehicle, self.setting.duration, self.plant)

    @property
    def flyable_axes(self) -> tuple[str, ...]:
        """Names of the difficulty axes that the vehicle can fly; those of other vehicles only beside the paper's."""
        servos = bool(self.setting.truth.drives)
        return tuple(
            name
            for name in self.axes
            if not (servos and AXES[name].torques) and (self.vehicle == PAPER or not AXES[name].vehicle)
        )

    def axis(self, name: str) -> Axis:
        """Difficulty axis by name, with only the values to be simulated."""
        axis = AXES[name]
        return dataclasses.replace(axis, values=(axis.values[0], axis.values[-1])) if self.quick else axis

    def plan_cells(self) -> tuple[list[AxisFlights], dict[str, str]]:
        """All flights of the envelope, and reasons why a controller is excluded."""
        found: list[AxisFlights] = []
        refused: dict[str, str] = {}
        for law in self.laws:
            for name in self.flyable_axes:
                axis, setting = self.axis(name), self.setting_of_axis(name)
                try:
                    found += axis_flights(law, axis, setting, seed=self.seed, plant=self.plant)
                except ControllerError as error:
                    if axis.vehicle:  # the law may fly the others
                        refused[f"{law} on {axis.vehicle}"] = str(error)
                        continue
                    refused[law] = str(error)
                    found = [each for each in found if each.entrant.name != law]
                    break
        return found, refused

    def judge(self, todo: Sequence[AxisFlights], cells: Sequence[Cell], refused: Refused) -> Document:
        """Evaluate the envelope: errors of every controller at every value of every difficulty axis."""
        axes: Document = {name: axis_record(self.axis(name), self.setting_of_axis(name)) for name in self.flyable_axes}
        for flights, cell in zip(todo, cells, strict=True):
            points = points_of(cell, flights.axis, len(flights.points))
            axes[flights.case.name]["laws"].setdefault(flights.entrant.name, []).extend(points)
        laws = [law for law in self.laws if law not in refused]
        return {"laws": laws, "not_flown": dict(refused), "axes": axes}

    def pictures(self, found: Record) -> dict[str, bytes]:
        """Pictures of the envelope report by file name: errors along all difficulty axes."""
        return {"envelope.png": envelope_picture(found)}

    def report(self, found: Record, pictures: Mapping[str, bytes] | None = None) -> Report:
        """Envelope report: a summary, and a table for each difficulty axis."""
        return envelope_report(found, (pictures or {}).get("envelope.png"))
