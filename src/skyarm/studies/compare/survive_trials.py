"""Trials of the survive suite: blows, failing sensors, wrong and stiff plants, landings and half turns of any vehicle.

The trials and their conditions are in ``library/survive_trials.toml``, whose first lines say what its words mean.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import field

import numpy as np

from skyarm.algebra import Mat3
from skyarm.dynamics import mass_matrix
from skyarm.log.metrics.shortfall import LARGEST_ERROR
from skyarm.records.arrays import Array
from skyarm.records.immutable import immutable
from skyarm.reference import Constant
from skyarm.scenario.controller_table import controller_by_name
from skyarm.scenario.numbers import number_at, with_numbers
from skyarm.scenario.scenario_file import scenario_from
from skyarm.scenario.scenario_record import Delays, Scenario, with_words
from skyarm.studies.compare.cell_flights import Document
from skyarm.studies.compare.envelope_axes import SLOW, circle
from skyarm.studies.compare.envelope_setting import PAPER, Setting
from skyarm.studies.compare.faulty_sensors import FaultySensors
from skyarm.studies.compare.suite import DELAY, NOISE, library_rows
from skyarm.studies.compare.team_conditions import with_entries
from skyarm.vehicle import Vehicle

MODEL = "hummingbird_arm2"
"""Nominal model of the paper's vehicle; that of another vehicle is the vehicle."""

HEIGHT, BENT = 4.34, 0.5
"""Height (m) of the hover; and joints in it, as a share of their swing from the middle of their range."""


@immutable
class SurviveCondition:
    """Condition of a trial: the numbers in which its flights differ.

    Attributes:
        name: short name. title: one line, before the value. unit: of the values.
        values: values from mild to hard. each: tables, path -> factor on value and scale; one flight for each.
        scale: "blow", "damping", "mass", "nominal", or empty for 1.
        sets: "model", "told" and "late" for what the law and the loop are made with, in flights of their own.
        near: largest mean tip error at the end of a flight that is not lost, m.
    """

    name: str
    title: str
    values: tuple[float, ...]
    unit: str = ""
    each: tuple[Mapping[str, float], ...] = ({},)
    scale: str = ""
    sets: tuple[str, ...] = ()
    near: float = LARGEST_ERROR

    def flights(self, scenario: Scenario, value: float) -> list[dict[str, float]]:
        """Numbers of the flights at one value: parameter path -> number, of each table."""
        return [self._numbers(scenario, table, value) for table in self.each]

    def _numbers(self, scenario: Scenario, table: Mapping[str, float], value: float) -> dict[str, float]:
        vehicle, found = scenario.agent.plant.vehicle, dict[str, float]()
        for pattern, factor in table.items():
            above, star, _ = pattern.partition(".*")
            count = len(vehicle.rotors if above.endswith("rotors") else vehicle.links) if star else 1
            for i in range(count):
                path = pattern.replace("*", str(i))
                found[path] = float(factor * value * self._scale(scenario, path, i))
        return found

    def _scale(self, scenario: Scenario, path: str, i: int) -> float:
        vehicle, rate = scenario.agent.plant.vehicle, scenario.rates.control
        if self.scale == "nominal":
            return number_at(scenario, path)
        if self.scale == "damping":
            return float(decaying(vehicle, rate)[i])
        return {"": 1.0, "mass": float(vehicle.mass), "blow": float(vehicle.mass) * rate}[self.scale]


def decaying(vehicle: Vehicle, rate: float) -> Array:
    """Damping (joints,) in proportion to what each joint moves, of which the fastest motion decays at a rate (1/s).

    What a joint moves is 1 / (M^-1)_ii, base and other joints free; of one joint the damping is rate / (M^-1)_ii.
    """
    M = np.array(mass_matrix(vehicle, Mat3.identity(), (0.0,) * vehicle.n), dtype=float)
    mobility = np.linalg.inv(M)[6:, 6:]
    inertia = 1.0 / np.diag(mobility)
    fastest = np.abs(np.linalg.eigvals(mobility * inertia)).max()
    return rate / fastest * inertia


@immutable
class Trial:
    """Scenario of the survive suite and its conditions.

    Attributes:
        name: short name. duration: s. motion: "hover" or "circle". noisy: noise, delay, and sensors that can fail.
        tables: entries of a scenario file. conditions: what its flights differ in.
    """

    name: str
    duration: float
    conditions: tuple[SurviveCondition, ...]
    motion: str = "hover"
    noisy: bool = False
    tables: Document = field(default_factory=dict)

    def scenario(self, setting: Setting, law: str, plant: str, condition: SurviveCondition, value: float) -> Scenario:
        """Scenario that the flights of the trial have in common.

        Args:
            setting: vehicle and its scales.
            law: preset, law or file.
            plant: kind of simulated plant.
            condition: condition whose ``sets`` hold.
            value: its value.

        Raises:
            ControllerError: the law does not fit the vehicle.
        """
        bent = [m + BENT * a for m, a in zip(setting.middle, setting.swing, strict=True)]
        document: Document = {
            "name": self.name,
            "duration": self.duration,
            "plant": {"vehicle": setting.vehicle, "kind": plant},
            "controller": {"law": "centroidal", "bandwidth": 1.0},
            "environment": {"ground": False},
            "reference": {"base": {"kind": "signals", "z": HEIGHT}, "joints": bent},
        }
        if setting.vehicle == PAPER:
            document["model"] = {"vehicle": MODEL}
        built = scenario_from(with_entries(document, self.tables))
        if self.motion == "circle":
            moved = circle(setting, *SLOW).agent.reference
            built = built.with_reference(dataclasses.replace(moved, z=Constant(HEIGHT)))
        delays = built.agent.delays
        if self.noisy:
            delays = dataclasses.replace(delays, measurement=DELAY)
            sigmas = {name: getattr(NOISE, name) for name in ("position", "velocity", "attitude", "rate")}
            sigmas |= {"joints": NOISE.joints, "joint_rates": NOISE.joint_rates}
            built = with_words(built, noise=FaultySensors(**sigmas))
        if "model" in condition.sets:
            (numbers,) = condition.flights(built, value)
            built = with_numbers(built, numbers)
        told, true = (self._delays(delays, word in condition.sets, value) for word in ("told", "late"))
        controller = controller_by_name(built.with_delays(told), law)
        return built.with_controller(controller).with_delays(true)

    def _delays(self, delays: Delays, changed: bool, value: float) -> Delays:
        return dataclasses.replace(delays, measurement=value) if changed else delays


def _trial(row: Document) -> Trial:
    conditions = tuple(
        SurviveCondition(**{key: tuple(each) if isinstance(each, list) else each for key, each in table.items()})
        for table in row.pop("conditions")
    )
    return Trial(conditions=conditions, **row)


TRIALS: Mapping[str, Trial] = {row["name"]: _trial(row) for row in library_rows("survive_trials")}
"""Trials by name."""

CONDITIONS: Mapping[str, SurviveCondition] = {each.name: each for trial in TRIALS.values() for each in trial.conditions}
"""Conditions of all trials by name."""
