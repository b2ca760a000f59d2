"""Air, forces, drives, sensors, estimator and endings of someone's own, tried before they fly as a law is.

Each is called with floats beside its program for some periods (:mod:`skyarm.compile.tracing.float_trial`); a mistake
is one line with the class, its file and line. What ships is not tried.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from skyarm.actuation import Command
from skyarm.algebra import Vec3
from skyarm.compile.tracing.float_trial import PERIODS, compare_with_floats
from skyarm.control.law_checks import difference, kind_of, memory_mistake, mistake_in
from skyarm.control.law_trial import drifted
from skyarm.dynamics import State
from skyarm.dynamics.point_motion import PointMotion
from skyarm.environment import Wrench
from skyarm.estimate.estimator import FULL_STATE
from skyarm.files.user_code import own_code, place_of, place_of_error
from skyarm.records.coerce import RecordError
from skyarm.scalars import data, where
from skyarm.scenario.scenario_record import Scenario, ScenarioError, first_state
from skyarm.sensors.measurement import Measurement, measurement_of
from skyarm.sensors.sensor import NO_PUSH
from skyarm.simulate.component_classes import check_classes, reading_mistake
from skyarm.simulate.draws import draw_plan, start_draws
from skyarm.vehicle.linkage import BASE
from skyarm.vehicle.vehicle_records import Vehicle

WEIGHT = Vec3(0.0, 0.0, 9.81)
"""Specific force that sensors are told in a trial, m/s^2."""

Step = Callable[[Any, Any, State, Any], tuple[Any, Any]]


@dataclass(frozen=True, kw_only=True)
class Trial:
    """Something of someone's own.

    Attributes:
        place: in the scenario. record: itself. method: of it that does most.
        memory: its first. step: (memory, (time,), state, draws) -> (memory, result). draws: how many it takes.
        first: looks at the numbers of its first result.
    """

    place: str
    record: Any
    method: str
    memory: Any
    step: Step
    draws: int = 0
    first: Callable[[Any, Sequence[float]], None] | None = None

    def refusal(self, words: str, place: str = "") -> ScenarioError:
        """The error to raise."""
        method = getattr(self.record, self.method)
        found = place or place_of(method if own_code(method) else type(self.record))
        return ScenarioError(f"{found}: {self.place} ({type(self.record).__name__}) {words}")

    def checked(self, memory: Any, time: Any, state: State, draws: Any) -> tuple[Any, Any]:
        """A step whose mistakes are one line."""
        try:
            following, result = self.step(memory, time, state, draws)
        except (TypeError, AttributeError, RecordError) as error:
            words = mistake_in(error)
            if words is None:
                raise
            raise self.refusal(words, place_of_error(error)) from error
        different = difference(memory, following, "memory")
        if different:
            raise self.refusal(f"changes the structure of its memory: {different}")
        return following, result


def try_components(scenario: Scenario) -> None:
    """Try all that is not the library's.

    Raises:
        ScenarioError: one line with file and line.
    """
    period = 1.0 / scenario.rates.control
    check_classes(scenario)
    for trial in _trials(scenario, period):
        words = memory_mistake(trial.memory, "memory")
        if words:
            raise trial.refusal(words)
        state = first_state(scenario)
        instants = [((k * period,), drifted(state, k), _draws(trial.draws, k)) for k in range(PERIODS)]
        compare_with_floats(trial.checked, trial.memory, instants, trial.refusal, first=trial.first)


def _trials(scenario: Scenario, period: float) -> Iterator[Trial]:
    """Everything of a scenario that is someone's own."""
    vehicle = scenario.world.vehicle
    yield from _components(scenario, period)
    joints = [link.joint.name for link in vehicle.links]
    for each in scenario.joint_drives:
        if own_code(type(each.drive)):
            yield _drive(each.drive, joints.index(each.joint), scenario, period)
    for named in scenario.instruments:
        if own_code(type(named.sensor)):
            yield _sensor(named.name, named.sensor, scenario, period)
    if own_code(type(scenario.estimator)):
        yield _estimator(scenario, period)
    for i, ending in enumerate(scenario.endings):
        if own_code(type(ending)):
            yield _ending(f"endings[{i}]", ending, scenario)


def _components(scenario: Scenario, period: float) -> Iterator[Trial]:
    """Air and forces."""
    vehicle, plan = scenario.world.vehicle, draw_plan(scenario).components
    places = ["environment.wind", *(f"environment.air[{i}]" for i in range(len(scenario.air)))]
    places += [f"environment.forces[{i}]" for i in range(len(scenario.forces))]
    places += [f"payloads[{i}]" for i in range(len(scenario.payloads))]
    places += ["world"] * len(scenario.contacts)
    places += ["plant.vehicle.battery"] * len(scenario.power)
    starts = start_draws(scenario, scenario.seed, scenario.episode)
    for place, component, (_, count), row in zip(places, scenario.components, plan, starts, strict=True):
        if not own_code(type(component)):
            continue
        trial: list[Trial] = []

        def step(memory: Any, time: Any, state: State, draws: Any, c: Any = component, t: Any = trial) -> Any:
            following = c.advance(memory, time[0], period, state, draws)
            air = c.velocity(following, time[0], state.position)
            if not isinstance(air, Vec3):
                raise t[0].refusal(f"gives the velocity of the air as {kind_of(air)}: must be a Vec3")
            wrenches = c.wrenches(following, time[0], PointMotion(vehicle, state), state.rotor_speeds)
            if not isinstance(wrenches, (list, tuple)) or not all(isinstance(each, Wrench) for each in wrenches):
                raise t[0].refusal(f"gives wrenches as {kind_of(wrenches)}: must be a list of Wrench")
            for each in wrenches:
                if not BASE <= each.body < len(vehicle.moving):
                    raise t[0].refusal(f"gives a wrench on body {each.body}: must be {_bodies(vehicle)}")
            if c.coupled:
                slope = c.slope(following, time[0], PointMotion(vehicle, state), state.rotor_speeds)
                different = difference(following, slope, "the slope")
                if different:
                    raise t[0].refusal(f"gives the rates of its memory in another structure: {different}")
            parts = [(each.force_W, each.torque_W, each.point) for each in wrenches]
            return following, tuple(data(number) for vector in (air, *sum(parts, ())) for number in vector)

        memory = component.start(period, row.tolist())
        trial.append(Trial(place=place, record=component, method="advance", memory=memory, step=step, draws=count))
        yield trial[0]


def _drive(drive: Any, index: int, scenario: Scenario, period: float) -> Trial:
    def step(memory: Any, _time: Any, state: State, _draws: Any) -> tuple[Any, Any]:
        position, rate = state.joints[index], state.joint_rates[index]
        following = drive.advance(memory, 0.1 + position, position, rate, period)
        effort = data(drive.effort(following, 0.1 + position, position, rate))
        if kind_of(effort) != "a number":
            raise trial.refusal(f"gives an effort that is {kind_of(effort)}: must be a number")
        return following, (effort,)

    place = f"plant.drives.{scenario.world.vehicle.links[index].joint.name}"
    position = first_state(scenario).joints[index]
    memory = drive.begin(position, position, period)
    trial = Trial(place=place, record=drive, method="effort", memory=memory, step=step)
    return trial


def _sensor(name: str, sensor: Any, scenario: Scenario, period: float) -> Trial:
    vehicle = scenario.world.vehicle
    every = 1.0 / sensor.frequency if sensor.frequency else period

    def step(memory: Any, time: Any, state: State, draws: Any) -> tuple[Any, Any]:
        result = sensor.take(memory, time[0], state, WEIGHT, NO_PUSH, draws, every)
        if not isinstance(result, tuple) or len(result) != 2:
            raise trial.refusal(f"returns {kind_of(result)}: must return (memory, reading)")
        wrong = reading_mistake(result[1], "a reading")
        if wrong:
            raise trial.refusal(f"gives {wrong}: must be a number, or a tuple or a frozen dataclass of numbers")
        return result[0], result[1]

    def first(_instant: Any, numbers: Sequence[float]) -> None:
        found = next((number for number in numbers if not math.isfinite(number)), None)
        if found is not None:
            raise trial.refusal(f"gives a reading with {found} in its first period: must be finite numbers")

    trial = Trial(
        place=f"sensors.{name}", record=sensor, method="measure", memory=sensor.start(vehicle), step=step,
        draws=sensor.uniforms(vehicle), first=first,
    )  # fmt: skip
    return trial


def _estimator(scenario: Scenario, period: float) -> Trial:
    vehicle, estimator = scenario.world.vehicle, scenario.estimator

    def step(memory: Any, time: Any, state: State, _draws: Any) -> tuple[Any, Any]:
        readings: dict[str, Any] = {FULL_STATE: measurement_of(state, WEIGHT)}
        for named in scenario.instruments:
            middle = (0.5,) * named.sensor.uniforms(vehicle)
            start = named.sensor.start(vehicle)
            readings[named.name] = named.sensor.take(start, time[0], state, WEIGHT, NO_PUSH, middle, period)[1]
        command = Command(rotor_speeds=state.rotor_speeds, efforts=(0.0,) * vehicle.n)
        result = estimator.step(memory, readings, command, period)
        if not isinstance(result, tuple) or len(result) != 2 or not isinstance(result[1], Measurement):
            raise trial.refusal(f"returns {kind_of(result)}: must return (memory, Measurement)")
        for name in ("joints", "joint_rates"):
            given = getattr(result[1], name)
            if len(given) != vehicle.n:
                raise trial.refusal(f"gives {name} as {kind_of(given)}: must be a tuple of {vehicle.n}")
        return result

    memory = estimator.start(scenario.controller.par.model.vehicle)
    trial = Trial(place="estimator", record=estimator, method="step", memory=memory, step=step)
    return trial


def _ending(place: str, ending: Any, scenario: Scenario) -> Trial:
    def step(memory: Any, _time: Any, state: State, _draws: Any) -> tuple[Any, Any]:
        return memory, (where(ending.fine(scenario, state, state.position, 0.0), 1.0, 0.0),)

    return Trial(place=place, record=ending, method="fine", memory=(), step=step)


def _bodies(vehicle: Vehicle) -> str:
    """Indices of a vehicle's bodies, in words."""
    return "-1 (base)" if vehicle.n == 0 else f"-1 (base) or a link from 0 to {len(vehicle.moving) - 1}"


def _draws(count: int, k: int) -> tuple[float, ...]:
    """Numbers between 0 and 1, other ones in every period."""
    return tuple(0.05 + 0.9 * ((0.37 * (k + 1) + 0.61 * i) % 1.0) for i in range(count))
