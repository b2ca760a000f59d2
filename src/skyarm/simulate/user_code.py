"""User-defined air, forces, drives, sensors, estimators, endings and laws: checks of their results.

Before a flight each part is traced once, and a result of the wrong shape is refused in one line with class, file and
line. :func:`check_components` and :func:`check_law` look further: they compare floats with the program over some
periods, which finds state that a part keeps outside its memory. What ships is not checked.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from skyarm.algebra import Vec3
from skyarm.algebra.scalars import data, where
from skyarm.compile import trace
from skyarm.compile.tracing.float_trial import PERIODS, compare_with_floats
from skyarm.control.controller import Controller
from skyarm.control.law_checks import (
    check_controller,
    check_made,
    difference,
    is_own,
    kind_of,
    made_by,
    memory_mistake,
    mistake_in,
    perturb,
    try_law,
)
from skyarm.control.model import Model
from skyarm.dynamics import State
from skyarm.dynamics.actuators import Command
from skyarm.dynamics.point_motion import PointMotion
from skyarm.records.coerce import RecordError
from skyarm.records.files import shown
from skyarm.records.files.user_code import own_code, place_of, place_of_error
from skyarm.records.leaves import leaves, named_parts, rebuild
from skyarm.records.registry.class_signatures import class_mistake
from skyarm.reference import Publisher
from skyarm.scenario.scenario_file import load_scenario
from skyarm.scenario.scenario_record import Scenario, ScenarioError, first_state
from skyarm.sensing.estimate.estimator import FULL_STATE
from skyarm.sensing.measurement import Measurement, measurement_of
from skyarm.sensing.sensor import NO_PUSH
from skyarm.simulate.draws import draw_plan, start_draws
from skyarm.vehicle.linkage import BASE
from skyarm.world import Wrench

WEIGHT = Vec3(0.0, 0.0, 9.81)
"""Specific force that sensors are given in a check, m/s^2."""

MOST_UNIFORMS = 10_000
"""Random numbers of one component a period: beyond this it is a slip, and a program of it would take minutes."""

Step = Callable[[Any, Any, State, Any], tuple[Any, Any]]


@dataclass(frozen=True, kw_only=True)
class Part:
    """A user-defined part of a scenario.

    Attributes:
        place: in the scenario. record: the part. method: its main one, for messages.
        memory: its first. step: (memory, (time,), state, draws) -> (memory, result); raises TypeError of a result with
            the wrong shape. draws: how many random numbers it takes.
        first: checks the numbers of its first result.
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

    def checked_step(self, memory: Any, time: Any, state: State, draws: Any) -> tuple[Any, Any]:
        """A step whose mistakes are one line."""
        try:
            following, result = self.step(memory, time, state, draws)
        except _ShapeError as error:
            raise self.refusal(str(error)) from None
        except (TypeError, AttributeError, RecordError) as error:
            words = mistake_in(error)
            if words is None:
                raise
            raise self.refusal(words, place_of_error(error)) from error
        different = difference(memory, following, "memory")
        if different:
            raise self.refusal(f"changes the structure of its memory: {different}")
        return following, result


class _ShapeError(Exception):
    """A result of the wrong shape, in words."""


def require_shapes(scenario: Scenario) -> None:
    """Refuse user-defined parts whose functions cannot be called as the loop calls them, or return another shape.

    Raises:
        ScenarioError: one line with file and line, place in the scenario, class and method.
    """
    for part in _checked_parts(scenario):
        state = rebuild(first_state(scenario), iter([float(leaf) for leaf in leaves(first_state(scenario))]))
        start = rebuild(part.memory, iter([float(leaf) for leaf in leaves(part.memory)]))
        trace(part.checked_step, start, (0.0,), state, (0.5,) * part.draws)


def check_components(scenario: Scenario) -> None:
    """Check that the user-defined parts of a scenario are pure functions: floats and program must agree.

    Args:
        scenario: with air, forces, drives, sensors, an estimator or endings of your own.

    Raises:
        ScenarioError: one line with file and line.
    """
    period = 1.0 / scenario.rates.control
    for part in _checked_parts(scenario):
        state = first_state(scenario)
        instants = [((k * period,), perturb(state, k), _uniforms(part.draws, k)) for k in range(PERIODS)]
        compare_with_floats(part.checked_step, part.memory, instants, part.refusal, first=part.first)


def check_law(law: Scenario | Controller | Callable[[Model], Controller], scenario: Scenario | str = "case3") -> None:
    """Refuse a law that cannot be traced, is no function of its arguments, or gives no finite first command.

    The law steps over its first periods twice, as floats and as a traced program, and both must agree to the bit: a law
    that keeps something outside its memory, or freezes a number into the program, differs. A law that is called
    (``compiled=False``) may keep what it likes and is not compared. A flight checks the shape of each result only.

    Args:
        law: a controller, or its maker, which gets the scenario's model; or a scenario, whose law is checked where it
            is user-defined.
        scenario: gives model, references and initial state; or the name of a shipped one.

    Raises:
        LawError: one line with the law's file and line.
    """
    if isinstance(law, Scenario):
        if not is_own(law.controller):
            return
        flown, controller = law, law.controller
    else:
        flown = load_scenario(scenario) if isinstance(scenario, str) else scenario
        controller = _make_controller(law, flown.controller.par.model)
        check_controller(controller)
    rates = flown.rates
    start = first_state(flown.with_words(controller=controller))
    seen = measurement_of(start, Vec3(0.0, 0.0, float(flown.plant.gravity)))
    times = Publisher(control_rate=rates.control, reference_rate=rates.reference).held_time(np.arange(PERIODS))
    wanted = [flown.reference.at(float(time)) for time in times[: flown.steps]]
    try_law(controller, 1.0 / rates.control, seen, wanted)


def _make_controller(law: Controller | Callable[[Model], Controller], model: Model) -> Controller:
    """The controller itself, or what its maker makes of a model."""
    if isinstance(law, Controller):
        return law
    name = getattr(law, "__name__", "law")
    controller: Controller = made_by(law, name, model, {})
    check_made(law, name, controller)
    return controller


def _checked_parts(scenario: Scenario) -> Iterator[Part]:
    """The user-defined parts, once their classes and first memories are sound."""
    _require_classes(scenario)
    for part in _parts(scenario, 1.0 / scenario.rates.control):
        words = memory_mistake(part.memory, "memory")
        if words:
            raise part.refusal(words)
        yield part


def _require_classes(scenario: Scenario) -> None:
    """Refuse methods with other parameters, and a number of random numbers that is none."""
    for place, record in _records(scenario):
        kind = type(record)
        mistake = class_mistake(kind)
        if mistake is not None:
            raise ScenarioError(f"{mistake[0]}: {place} ({kind.__name__}) {mistake[1]}")
        given = getattr(record, "uniforms", 0)
        count = given(scenario.plant.vehicle) if callable(given) else given
        if type(count) is not int or not 0 <= count <= MOST_UNIFORMS:
            found = place_of(given if callable(given) and own_code(given) is not None else kind)
            said = "gives uniforms" if callable(given) else "has uniforms"
            words = f"{said} = {shown(count)}: must be a whole number from 0 to {MOST_UNIFORMS}"
            raise ScenarioError(f"{found}: {place} ({kind.__name__}) {words}")


def _records(scenario: Scenario) -> Iterator[tuple[str, Any]]:
    """Place and record of every user-defined part."""
    places: list[tuple[str, Any]] = list(zip(_component_places(scenario), scenario.components, strict=True))
    places += [(f"plant.drives.{each.joint}", each.drive) for each in scenario.joint_drives]
    places += [(f"sensors.{named.name}", named.sensor) for named in scenario.sensors]
    places += [("estimator", scenario.estimator)]
    places += [(f"endings[{i}]", each) for i, each in enumerate(scenario.endings)]
    return ((place, record) for place, record in places if own_code(type(record)))


def _component_places(scenario: Scenario) -> list[str]:
    """Parameter path of each of the scenario's components."""
    return [
        "environment.wind",
        *(f"environment.air[{i}]" for i in range(len(scenario.air))),
        *(f"environment.forces[{i}]" for i in range(len(scenario.forces))),
        *(f"payloads[{i}]" for i in range(len(scenario.payloads))),
        *["world"] * len(scenario.worlds),
        *["plant.vehicle.battery"] * len(scenario.power),
    ]


def _parts(scenario: Scenario, period: float) -> Iterator[Part]:
    """The user-defined parts, each with a function that calls it as the loop does."""
    made = {
        "plant": lambda place, record: _drive(place, record, scenario, period),
        "sensors": lambda place, record: _sensor(place, record, scenario, period),
        "estimator": lambda place, record: _estimator(place, record, scenario, period),
        "endings": lambda place, record: _ending(place, record, scenario),
    }
    components = {id(component): i for i, component in enumerate(scenario.components)}
    for place, record in _records(scenario):
        if id(record) in components:
            yield _component(place, record, components[id(record)], scenario, period)
        else:
            yield made[place.split(".")[0].split("[")[0]](place, record)


def _component(place: str, component: Any, index: int, scenario: Scenario, period: float) -> Part:
    """Air or a force."""
    vehicle = scenario.plant.vehicle

    def step(memory: Any, time: Any, state: State, draws: Any) -> tuple[Any, Any]:
        following = component.advance(memory, time[0], period, state, draws)
        air = component.velocity(following, time[0], state.position)
        if not isinstance(air, Vec3):
            raise _ShapeError(f"gives the velocity of the air as {kind_of(air)}: must be a Vec3")
        motion = PointMotion(vehicle, state)
        wrenches = component.wrenches(following, time[0], motion, state.rotor_speeds)
        if not isinstance(wrenches, (list, tuple)) or not all(isinstance(each, Wrench) for each in wrenches):
            raise _ShapeError(f"gives wrenches as {kind_of(wrenches)}: must be a list of Wrench")
        for each in wrenches:
            if not BASE <= each.body < len(vehicle.moving):
                bodies = f"-1 (base) or a link from 0 to {len(vehicle.moving) - 1}" if vehicle.n else "-1 (base)"
                raise _ShapeError(f"gives a wrench on body {each.body}: must be {bodies}")
        if component.coupled:
            slope = component.slope(following, time[0], motion, state.rotor_speeds)
            different = difference(following, slope, "the slope")
            if different:
                raise _ShapeError(f"gives the rates of its memory in another structure: {different}")
        vectors = (air, *(each for one in wrenches for each in (one.force_W, one.torque_W, one.point)))
        return following, tuple(data(number) for vector in vectors for number in vector)

    count = draw_plan(scenario).components[index][1]
    start = start_draws(scenario, scenario.seed, scenario.episode)[index]
    memory = component.start(period, start.tolist())
    return Part(place=place, record=component, method="advance", memory=memory, step=step, draws=count)


def _drive(place: str, drive: Any, scenario: Scenario, period: float) -> Part:
    joints = [link.joint.name for link in scenario.plant.vehicle.links]
    index = joints.index(place.removeprefix("plant.drives."))

    def step(memory: Any, _time: Any, state: State, _draws: Any) -> tuple[Any, Any]:
        position, rate = state.joints[index], state.joint_rates[index]
        following = drive.advance(memory, 0.1 + position, position, rate, period)
        effort = data(drive.effort(following, 0.1 + position, position, rate))
        if kind_of(effort) != "a number":
            raise _ShapeError(f"gives an effort that is {kind_of(effort)}: must be a number")
        return following, (effort,)

    position = first_state(scenario).joints[index]
    memory = drive.begin(position, position, period)
    return Part(place=place, record=drive, method="effort", memory=memory, step=step)


def _sensor(place: str, sensor: Any, scenario: Scenario, period: float) -> Part:
    vehicle = scenario.plant.vehicle
    every = 1.0 / sensor.frequency if sensor.frequency else period

    def step(memory: Any, time: Any, state: State, draws: Any) -> tuple[Any, Any]:
        result = sensor.take(memory, time[0], state, WEIGHT, NO_PUSH, draws, every)
        if not isinstance(result, tuple) or len(result) != 2:
            raise _ShapeError(f"returns {kind_of(result)}: must return (memory, reading)")
        for at, each in named_parts(result[1], "a reading"):
            if kind_of(each) != "a number" and type(each) not in (int, bool):
                found = f"{at} as {kind_of(each)}"
                raise _ShapeError(f"gives {found}: must be a number, or a tuple or a frozen dataclass of numbers")
        return result

    def first(_instant: Any, numbers: Sequence[float]) -> None:
        found = next((number for number in numbers if not math.isfinite(number)), None)
        if found is not None:
            raise part.refusal(f"gives a reading with {found} in its first period: must be finite numbers")

    part = Part(
        place=place, record=sensor, method="measure", memory=sensor.start(vehicle), step=step,
        draws=sensor.uniforms(vehicle), first=first,
    )  # fmt: skip
    return part


def _estimator(place: str, estimator: Any, scenario: Scenario, period: float) -> Part:
    vehicle = scenario.plant.vehicle

    def step(memory: Any, time: Any, state: State, _draws: Any) -> tuple[Any, Any]:
        readings: dict[str, Any] = {FULL_STATE: measurement_of(state, WEIGHT)}
        for named in scenario.sensors:
            sensor, middle = named.sensor, (0.5,) * named.sensor.uniforms(vehicle)
            taken = sensor.take(sensor.start(vehicle), time[0], state, WEIGHT, NO_PUSH, middle, period)
            readings[named.name] = taken[1]
        command = Command(rotor_speeds=state.rotor_speeds, efforts=(0.0,) * vehicle.n)
        result = estimator.step(memory, readings, command, period)
        if not isinstance(result, tuple) or len(result) != 2 or not isinstance(result[1], Measurement):
            raise _ShapeError(f"returns {kind_of(result)}: must return (memory, Measurement)")
        for name in ("joints", "joint_rates"):
            given = getattr(result[1], name)
            if len(given) != vehicle.n:
                raise _ShapeError(f"gives {name} as {kind_of(given)}: must be a tuple of {vehicle.n}")
        return result

    memory = estimator.start(scenario.controller.par.model.vehicle)
    return Part(place=place, record=estimator, method="step", memory=memory, step=step)


def _ending(place: str, ending: Any, scenario: Scenario) -> Part:
    def step(memory: Any, _time: Any, state: State, _draws: Any) -> tuple[Any, Any]:
        return memory, (where(ending.fine(scenario, state, state.position, 0.0), 1.0, 0.0),)

    return Part(place=place, record=ending, method="fine", memory=(), step=step)


def _uniforms(count: int, k: int) -> tuple[float, ...]:
    """Numbers between 0 and 1, other ones in every period."""
    return tuple(0.05 + 0.9 * ((0.37 * (k + 1) + 0.61 * i) % 1.0) for i in range(count))
