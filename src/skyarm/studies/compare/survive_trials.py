"""Trials of the survive suite: blows, failing sensors, wrong and stiff plants, landings and half turns of any vehicle.

The trials and their conditions are in ``library/survive_trials.toml``, whose first lines say what its words mean.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, replace

import numpy as np

from skyarm.algebra import Mat3
from skyarm.dynamics import mass_matrix
from skyarm.log.metrics.shortfall import LARGEST_ERROR
from skyarm.records.arrays import Array
from skyarm.records.immutable import immutable
from skyarm.records.leaves import parts
from skyarm.reference import Constant
from skyarm.scenario.controller_table import controller_by_name
from skyarm.scenario.numbers import number_at, with_numbers
from skyarm.scenario.scenario_file import scenario_from
from skyarm.scenario.scenario_record import Scenario, with_words
from skyarm.studies.compare.cell_flights import Document
from skyarm.studies.compare.faulty_sensors import FaultySensors
from skyarm.studies.compare.suite import library_rows
from skyarm.studies.trial.facts import PAPER, Setting
from skyarm.studies.trial.trial import NOISE, Trial, with_entries
from skyarm.vehicle import Vehicle

MODEL = "hummingbird_arm2"
"""Nominal model of the paper's vehicle; that of another vehicle is the vehicle."""

HEIGHT, BENT = 4.34, 0.5
"""Height (m) of the hover: skids are 1.2 m above the surfaces of the landing; and joints in it, as a share of their
swing from the middle of their range: neither straight nor at a limit."""


SLOW_CIRCLE = Trial(name="slow", title="slow circle", unit="", values=(0.0,), base="slow_circle", arm="gentle")


@immutable
class SurviveCondition:
    """Condition of a trial: the numbers in which its flights differ.

    Attributes:
        name: short name. title: one line, before the value. unit: of the values.
        values: values from mild to hard. each: tables, path -> factor on value and scale; one flight for each.
        scale: "blow", "damping", "mass", "nominal", or empty for 1.
        made: true if law and loop are made with the numbers; "told" is then the delay that the law knows, "late" the
            age of the measurements, s.
        near: largest mean tip error at the end of a flight that is not lost, m.
    """

    name: str
    title: str
    values: Sequence[float]
    each: Sequence[Mapping[str, float]]
    unit: str = ""
    scale: str = ""
    made: bool = False
    near: float = LARGEST_ERROR

    def flights(self, scenario: Scenario, value: float) -> list[dict[str, float]]:
        """Numbers of the flights at one value: parameter path -> number, of each table."""
        vehicle, rate = scenario.agent.vehicle, scenario.rates.control
        mass, damping = float(vehicle.mass), decaying(vehicle, rate)
        scales = {"": 1.0, "mass": mass, "blow": mass * rate}
        flights = list[dict[str, float]]()
        for table in self.each:
            numbers = dict[str, float]()
            for pattern, factor in table.items():
                several = vehicle.rotors if ".rotors." in pattern else vehicle.links
                for i, _ in enumerate(several if "*" in pattern else several[:1]):
                    path = pattern.replace("*", str(i))
                    if self.scale == "nominal":
                        scale = number_at(scenario, path)
                    else:
                        scale = float(damping[i]) if self.scale == "damping" else scales[self.scale]
                    numbers[path] = factor * value * scale
            flights.append(numbers)
        return flights


def decaying(vehicle: Vehicle, rate: float) -> Array:
    """Damping (joints,) in proportion to what each joint moves, of which the fastest motion decays at a rate (1/s).

    What a joint moves is 1 / (M^-1)_ii, base and other joints free; of one joint the damping is rate / (M^-1)_ii.
    """
    M = np.array(mass_matrix(vehicle, Mat3.identity(), vehicle.zeros), dtype=float)
    mobility = np.linalg.inv(M)[6:, 6:]
    inertia = 1.0 / np.diag(mobility)
    fastest = np.abs(np.linalg.eigvals(mobility * inertia)).max()
    damping: Array = rate / fastest * inertia
    return damping


@immutable
class SurviveTrial:
    """Scenario of the survive suite and its conditions.

    Attributes:
        name: short name. duration: s. motion: "hover" or "circle". noisy: noise, and sensors that can fail.
        tables: entries of a scenario file. conditions: what its flights differ in.
    """

    name: str
    duration: float
    conditions: Sequence[SurviveCondition]
    motion: str = "hover"
    noisy: bool = False
    tables: Document = field(default_factory=dict)

    def scenario(self, setting: Setting, law: str, plant: str, made: Mapping[str, float]) -> Scenario:
        """Scenario that the flights of the trial have in common.

        Args:
            setting: vehicle and its scales.
            law: preset, law or file.
            plant: kind of simulated plant.
            made: numbers of a condition that is ``made``.

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
            moved = SLOW_CIRCLE.built(setting, 0.0).agent.reference
            built = built.with_reference(replace(moved, z=Constant(HEIGHT)))
        if self.noisy:
            built = with_words(built, noise=FaultySensors(**parts(NOISE)))
        built = with_numbers(built, {path: number for path, number in made.items() if "." in path})
        delays = built.agent.delays
        told, late = (replace(delays, measurement=made.get(word, delays.measurement)) for word in ("told", "late"))
        return built.with_controller(controller_by_name(built.with_delays(told), law)).with_delays(late)


TRIALS: Mapping[str, SurviveTrial] = {
    row["name"]: SurviveTrial(**row | {"conditions": [SurviveCondition(**each) for each in row["conditions"]]})
    for row in library_rows("survive_trials")
}
"""Trials by name."""

CONDITIONS: Mapping[str, SurviveCondition] = {each.name: each for trial in TRIALS.values() for each in trial.conditions}
"""Conditions of all trials by name."""
