"""Checks of user-defined models before a flight, and the check of a user-defined control law.

Before a flight each part is traced alone, and a result of the wrong shape is refused in one line with class, file and
line. So is a part whose traces differ: three are compared here, and one in another process if it comes from a plugin.
:func:`check_law` looks further: it compares a law in floats with its program over some periods. What ships is not
checked.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import field, replace
from functools import partial
from typing import Any

import numpy as np

from skyarm.algebra import ZERO3, Scalar, Scalars, Vec3
from skyarm.algebra.scalars import data
from skyarm.compile.tracing.fingerprint import OUTSIDE, changed_argument, contents, fingerprint, in_floats
from skyarm.control.controller import Controller, preview_leads
from skyarm.control.law_checks import (
    PERIODS,
    LawError,
    call_maker,
    check_controller,
    checked_law,
    difference,
    is_own,
    kind_of,
    memory_mistake,
    mistake_in,
    try_law,
    wrong,
)
from skyarm.control.model import Model
from skyarm.dynamics import State
from skyarm.dynamics.actuators import Command
from skyarm.plant.surroundings import motions_of
from skyarm.records import coerce
from skyarm.records.coerce import RecordError
from skyarm.records.files import must_be_one_of, shown
from skyarm.records.files.messages import comma_list
from skyarm.records.files.user_code import failure, own_code, place_of, place_of_error
from skyarm.records.immutable import positional
from skyarm.records.leaves import Tree, is_record, leaves, named_parts, parts
from skyarm.records.path_names import word_of
from skyarm.records.registry.class_signatures import class_mistake
from skyarm.reference import Publisher
from skyarm.reference.preview import with_preview
from skyarm.reference.signals import Constant, Signal
from skyarm.scenario.paths import is_of_agent
from skyarm.scenario.scenario_file import load_scenario
from skyarm.scenario.scenario_record import Scenario, ScenarioError, first_state
from skyarm.scenario.without_effect import WEIGHT, readings_at
from skyarm.sensing.estimate.estimator import FULL_STATE
from skyarm.sensing.measurement import Measurement, measurement_of
from skyarm.sensing.sensor import NO_PUSH
from skyarm.sensing.sensor_kinds import declared_reading
from skyarm.simulate.draws import draw_plan, start_draws
from skyarm.simulate.other_process import ANSWERING, CAUSES, FAILED, WHERE, try_elsewhere
from skyarm.vehicle import BASE
from skyarm.world import Wrench
from skyarm.world.component import MOST_UNIFORMS

Call = Callable[..., Any]
"""Function (method, arguments) -> result of the user's method, of any type."""

Step = Callable[[Call, Tree, Scalar, State, Scalars], Tree]
"""Function (call, memory, time, state, draws) -> next memory; raises ScenarioError for a result of the wrong shape."""


class PartError(LawError, ScenarioError):
    """Error in a user-defined model, as one line with its file and line."""


PURE = "must compute from its arguments and fields alone; random numbers are its draws"

Fingerprint = dict[str, str]
"""Text of the traced results of a part's methods, by place."""


@positional
class UserPart:
    """User-defined model in a scenario, with its parameter path and the method that error messages refer to.

    Attributes:
        scenario: flight of the vehicle that has the model, alone. whole: that of all vehicles.
        own: object within the record whose code is the user's, if not the record itself.
        results: result of each method in the last trace.
    """

    place: str
    record: Any
    method: str
    scenario: Scenario
    whole: Scenario
    own: object = None
    results: dict[str, Any] = field(default_factory=dict)

    def refusal(self, words: str, place: str = "", method: str = "") -> PartError:
        """Error about a user-defined model, with file and line of the user's code."""
        if isinstance(self.record, Controller):
            return PartError(str(wrong(self.record, words, place)))
        function = getattr(self.record, method or self.method, None)
        named = f".{method}" if method else ""
        line = place or place_of(function if own_code(function) else self.own or type(self.record))
        return PartError(f"{line}: {self.place} ({type(self.own or self.record).__name__}{named}) {words}")

    def require_numbers(
        self, method: str, label: str, result: object, example: object = None, also: type = int
    ) -> None:
        """Raise an error if a method's result contains a non-number or differs in structure from an example."""
        numbers = dict(named_parts(result, label))
        expected = numbers if example is None else dict(named_parts(example, label))
        if list(numbers) != list(expected):
            raise self.refusal(f"gives {comma_list(numbers)}: must be {comma_list(expected)}", method=method)
        for at, each in numbers.items():
            plain = coerce.plain_number(each)
            if example is not None and isinstance(expected[at], str) and isinstance(each, str):
                continue
            if kind_of(plain) != "a number" and type(plain) not in (int, also):
                free = ", or a tuple or a frozen dataclass of numbers" if example is None else ""
                raise self.refusal(f"gives {at} as {kind_of(plain)}: must be a number{free}", method=method)

    def pair(self, result: object, what: str, kind: type = object) -> tuple[Tree, Any]:
        """Return the result of a model's step if it is a pair (internal state, output); else raise an error."""
        if not isinstance(result, tuple) or len(result) != 2 or not isinstance(result[1], kind):
            raise self.refusal(f"returns {kind_of(result)}: must return (memory, {what})")
        return result

    def call(self, method: str, *given: object) -> Any:
        """Call a method of the user-defined model and store its result; raise an error if it modifies an argument."""
        law, own = method == "law", self.record
        function = partial(checked_law(own), par=own.par) if law else getattr(own, method)
        names = ("self", *inspect.signature(function).parameters)
        arguments = dict(zip(names, (own, *given), strict=False))
        before = contents(arguments)
        self.results[method] = result = function(*given)
        if (name := changed_argument(arguments, before)) is not None:
            raise self.refusal(f"writes to its argument {name!r}: must return new records", method=method)
        return result

    def trace(self, step: Step, memory: Tree, scenario: Scenario, draws: int = 0) -> Fingerprint:
        """Trace one step of a user-defined model; raise a one-line error for a mistake in the user's code."""
        words = memory_mistake(memory, "memory")
        if words:
            raise self.refusal(words)

        def check_step(moving: Tree, time: Scalars, state: State, given: Scalars) -> Mapping[str, Any]:
            self.results.clear()
            following = step(self.call, moving, time[0], state, given)
            different = difference(moving, following, "memory")
            if different:
                raise self.refusal(f"changes the structure of its memory: {different}")
            own = {name: getattr(self.record, name, None) for name in ("largest_step", "frequency", "latency")}
            with suppress(Exception):
                own["__post_init__"] = leaves(replace(self.record))
            return {"start": memory, **own, **self.results}

        try:
            return fingerprint(check_step, in_floats(memory), (0.0,), in_floats(first_state(scenario)), (0.5,) * draws)
        except (TypeError, AttributeError, RecordError) as error:
            words = mistake_in(error)
            if words is None:
                raise
            raise self.refusal(words, place_of_error(error)) from error


Check = Callable[[Scenario, UserPart], Fingerprint]
"""Function that traces one step of a model and raises a one-line error for a mistake in it."""


def _as_constructed(record: Any) -> Any:
    """Copy of a record as its constructor made it, without values that it stored in itself later."""
    if type(record) is tuple:
        return tuple(map(_as_constructed, record))
    try:
        again = replace(record)
        # of a constructor that converts its fields, a second call makes something else than the first: what that made
        made = again if contents(again) == contents(replace(again)) else record
        for name in vars(again):
            object.__setattr__(again, name, _as_constructed(getattr(made, name)))
    except Exception:
        return record  # no dataclass, or one that cannot be constructed from its fields
    return again


def require_shapes(scenario: Scenario) -> None:
    """Raise an error if methods of user-defined models have wrong arguments or result shapes, or are not pure.

    A method that is not pure writes to its arguments, or gives another program when it is traced anew, as it is or as
    it was constructed; or, where a plugin has it, in another process.

    Raises:
        ScenarioError, LawError: one line with file and line, place in the scenario, class and method.
    """
    own = list(_parts(scenario))
    for part, _ in own:
        _require_class(part.scenario, part)
    if not own:
        return
    anew, once, twice = (fingerprints(scenario, anew=anew) for anew in (True, False, False))

    def compare(first: list[Fingerprint], other: list[Fingerprint], words: str) -> None:
        for (part, _), here, there in zip(own, first, other, strict=True):
            if FAILED in here:
                continue
            if FAILED in there:
                raise part.refusal(f"fails {words} ({there[FAILED]})")
            for at in {**here, **there}:
                if here.get(at) != there.get(at):
                    raise part.refusal(f"gives another program {words}", method=at.split(".")[1])

    for first, other in ((anew, once), (once, twice)):
        compare(first, other, f"whenever it is traced: {OUTSIDE}; {PURE}")
    models = [(part.own or type(part.record), part.record) for part, _ in own]
    try_elsewhere(scenario, models, lambda elsewhere: compare(anew, elsewhere, f"{WHERE}: {CAUSES}; {PURE}"))


def has_own(scenario: Scenario) -> bool:
    """True if the law or a part of a scenario, such as a force, sensor, fault or signal, is user-defined."""
    return any(is_own(each.controller) for each in scenario.agents.values()) or bool([*_parts(scenario)])


def fingerprints(scenario: Scenario, *, anew: bool = False) -> list[Fingerprint]:
    """Trace each user-defined model of a scenario separately; ``anew``: as newly constructed, with errors recorded."""
    texts = []
    for part, check in _parts(scenario):
        try:
            tried = replace(part, record=_as_constructed(part.record)) if anew and part.own is None else part
            texts.append(check(tried.scenario, tried))
        except Exception as error:
            # a flight gives a law more than it has here, and says what is wrong with it
            if not ANSWERING and (isinstance(error, PartError) or not (anew or part.method == "law")):
                raise
            texts.append({FAILED: failure(error) or str(error)})
    return texts


def _parts(scenario: Scenario) -> Iterator[tuple[UserPart, Check]]:
    """List the user-defined models of a scenario, each with the function that checks it."""
    for i, name in enumerate(scenario.agents):
        alone = scenario.of(name)
        before = f"agents.{name}." if scenario.is_team else ""
        for place, record, method, check, own in _parts_of_agent(alone, first=i == 0):
            at = before + place if is_of_agent(place) else place
            yield UserPart(at, record, method, alone, scenario, own), check


Found = tuple[str, Any, str, Check, object]
"""Place of a user-defined model, its record and method, the function that checks it, and the user's object in it."""


def _parts_of_agent(scenario: Scenario, *, first: bool) -> Iterator[Found]:
    """List the user-defined models of one vehicle's flight; of the ``first`` vehicle those that all share, too."""
    agent = scenario.agent
    if is_own(agent.controller) and agent.controller.compiled:
        yield "controller", agent.controller, "law", _check_law, agent.controller.law
    components = scenario.placed_components if first else scenario.placed_own
    faults = [(f"environment.faults[{i}]", each) for i, each in enumerate(agent.faults)]
    for at, record in [("reference", agent.reference), *faults, *components]:
        for place, signal in _own_signals(record, at):
            yield place, signal, "derivatives", _check_signal, None
    if (within := _first_own(agent.reference)) is not None:
        yield "reference", agent.reference, "at", _check_motion, within
    endings = [(f"endings[{i}]", each) for i, each in enumerate(scenario.endings)] if first else []
    groups: list[tuple[str, Check, Iterable[tuple[str, object]]]] = [
        ("advance", _check_component, components),
        ("share", _check_fault, faults),
        ("effort", _check_drive, [(f"plant.drives.{each.joint}", each.drive) for each in agent.joint_drives]),
        ("measure", _check_sensor, [(f"sensors.{named.name}", named.sensor) for named in agent.sensors]),
        ("step", _check_estimator, [("estimator", agent.estimator)]),
        ("fine", _check_ending, endings),
    ]
    for method, check, records in groups:
        for place, record in records:
            if own_code(type(record)):
                yield place, record, method, check, None


def _first_own(record: object) -> object:
    """First object of a user-defined class, or user-defined function, within a record; None without any."""
    if own_code(record if callable(record) else type(record)) is not None:
        return record
    return next((own for each in parts(record).values() if (own := _first_own(each)) is not None), None)


def _own_signals(record: object, place: str) -> Iterator[tuple[str, Signal]]:
    """Time signals of user-defined classes within a record, each with its parameter path."""
    if isinstance(record, Signal) and own_code(type(record)) is not None:
        yield place, record
    for name, each in parts(record).items():
        if is_record(each) or isinstance(each, tuple):
            yield from _own_signals(each, f"{place}.{name}")


def _require_class(scenario: Scenario, part: UserPart) -> None:
    """Refuse a user-defined class with wrong method parameters or an invalid count of random numbers."""
    if part.own is not None:
        return
    kind = type(part.record)
    mistake = class_mistake(kind)
    if mistake is not None:
        raise part.refusal(mistake[1], mistake[0])
    given = getattr(part.record, "uniforms", 0)
    count = given(scenario.agent.vehicle) if callable(given) else given
    if type(count) is not int or not 0 <= count <= MOST_UNIFORMS:
        line = place_of(given if callable(given) and own_code(given) is not None else kind)
        said = "gives uniforms" if callable(given) else "has uniforms"
        raise part.refusal(f"{said} = {shown(count)}: must be a whole number from 0 to {MOST_UNIFORMS}", line)


def _check_component(scenario: Scenario, part: UserPart) -> Fingerprint:
    """Check one step of a user-defined wind, force, payload or contact model."""
    vehicle, component, period = scenario.agent.vehicle, part.record, scenario.rates.period
    whole = part.whole

    def step(call: Call, memory: Tree, time: Scalar, state: State, draws: Scalars) -> Tree:
        following: Tree = call("advance", memory, time, period, state, draws)
        air = call("velocity", following, time, state.position)
        if not isinstance(air, Vec3):
            raise part.refusal(f"gives the velocity of the air as {kind_of(air)}: must be a Vec3", method="velocity")
        part.require_numbers("velocity", "velocity", air, WEIGHT)
        (own,) = scenario.agents
        states = {name: first_state(whole.of(name)) for name in whole.agents} | {own: state}
        motions = motions_of([each.plant for each in whole.agents.values()], [*states.values()], tuple(states))
        for moved in motions:
            moved.to_world(ZERO3, len(moved.vehicle.moving) - 1)  # what it keeps is there before the call, and compared
        motion = motions[0].agents[own]
        wrenches = call("wrenches", following, time, motion, state.rotor_speeds)
        if not isinstance(wrenches, (list, tuple)) or not all(isinstance(each, Wrench) for each in wrenches):
            raise part.refusal(f"gives wrenches as {kind_of(wrenches)}: must be a list of Wrench", method="wrenches")
        part.require_numbers("wrenches", "wrenches", tuple(wrenches), (Wrench(),) * len(wrenches))
        for each in wrenches:
            if each.agent and each.agent not in whole.agents:
                known = must_be_one_of(whole.agents, each.agent)
                raise part.refusal(f"gives a wrench on agent {each.agent!r}: {known}", method="wrenches")
            moving = len((whole.agents[each.agent].plant.vehicle if each.agent else vehicle).moving)
            if not BASE <= each.body < moving:
                bodies = f"-1 (base) or a link from 0 to {moving - 1}" if moving else "-1 (base)"
                raise part.refusal(f"gives a wrench on body {each.body}: must be {bodies}", method="wrenches")
        if component.coupled:
            slope = call("slope", following, time, motion, state.rotor_speeds)
            different = difference(following, slope, "the slope")
            if different:
                raise part.refusal(f"gives the rates of its memory in another structure: {different}", method="slope")
        if component.columns:
            numbers = (0.0,) * len(component.columns)
            part.require_numbers("logged", "logged", call("logged", following, motion), numbers)
        call("act", following, time, period, motion)
        call("rotor_commands", following, vehicle.rotors, state.rotor_speeds)
        return following

    index = [place for place, _ in scenario.placed_components].index(word_of(part.place))
    draws = start_draws(scenario, scenario.seed, scenario.episode)[index].tolist()
    try:
        memory = component.start(period, draws)
    except (ValueError, IndexError) as error:
        raise part.refusal(
            f"cannot start from {len(draws)} draws, which are twice its uniforms: {error}", place_of_error(error)
        ) from error
    return part.trace(step, memory, scenario, draw_plan(scenario).models[index][1])


def _check_value(
    scenario: Scenario,
    part: UserPart,
    label: str,
    example: Tree,
    also: type = int,
    given: Callable[[Scalar, State], tuple[Tree, ...]] = lambda time, _: (time,),
) -> Fingerprint:
    """Check a user-defined stateless method by one call; the result must have the structure of an example.

    Args:
        scenario: scenario with the model.
        part: user-defined model.
        label: name of the result in messages; "" for one that is not looked at.
        example: example of a right result.
        also: class that its numbers may have, too.
        given: arguments of the call, from time and state; the time if left out.
    """

    def step(call: Call, memory: Tree, time: Scalar, state: State, _draws: Scalars) -> Tree:
        result = call(part.method, *given(time, state))
        if label:
            part.require_numbers(part.method, label, result, example, also)
        return memory

    return part.trace(step, (), scenario)


def _check_ending(scenario: Scenario, part: UserPart) -> Fingerprint:
    status = getattr(part.record, "status", None)
    if not isinstance(status, str):
        raise part.refusal(f"has status = {shown(status)}: must be a text")
    return _check_value(scenario, part, "fine", 0.0, bool, lambda _, state: (scenario, state, state.position, 0.0))


_check_signal = partial(_check_value, label="derivatives", example=Constant(0.0).derivatives(0.0))

_check_fault = partial(_check_value, label="a share", example=0.0)

_check_motion = partial(_check_value, label="", example=None)


def _check_drive(scenario: Scenario, part: UserPart) -> Fingerprint:
    joints = scenario.agent.vehicle.joint_names
    joint, drive = joints.index(part.place.rpartition("plant.drives.")[2]), part.record
    period, place = scenario.rates.period, first_state(scenario).joints[joint]

    def step(call: Call, memory: Tree, _time: Scalar, state: State, _draws: Scalars) -> Tree:
        position, rate = state.joints[joint], state.joint_rates[joint]
        following: Tree = call("advance", memory, 0.1 + position, position, rate, period)
        effort = data(call("effort", following, 0.1 + position, position, rate))
        if kind_of(effort) != "a number":
            raise part.refusal(f"gives an effort that is {kind_of(effort)}: must be a number", method="effort")
        return following

    return part.trace(step, drive.begin(place, place, period), scenario)


def _check_sensor(scenario: Scenario, part: UserPart) -> Fingerprint:
    vehicle, sensor = scenario.agent.vehicle, part.record
    every = 1.0 / (sensor.frequency or scenario.rates.control)
    declared = declared_reading(sensor)

    def step(call: Call, memory: Tree, time: Scalar, state: State, draws: Scalars) -> Tree:
        seen = (state, WEIGHT) if sensor.feels is None else (NO_PUSH,)
        result = call("measure" if sensor.feels is None else "feel", memory, time, *seen, draws, every)
        following, reading = part.pair(result, "reading")
        if not isinstance(reading, declared):
            raise part.refusal(
                f"gives a reading that is {kind_of(reading)}: must be of type {declared.__name__}, its record"
            )
        part.require_numbers("measure", "a reading", reading, also=bool)
        return following

    return part.trace(step, sensor.start(vehicle), scenario, sensor.uniforms(vehicle))


def _check_estimator(scenario: Scenario, part: UserPart) -> Fingerprint:
    vehicle, estimator, period = scenario.agent.vehicle, part.record, scenario.rates.period

    def step(call: Call, memory: Tree, time: Scalar, state: State, _draws: Scalars) -> Tree:
        readings = readings_at(scenario, state, time)
        command = Command(rotor_speeds=state.rotor_speeds, efforts=vehicle.zeros)
        try:
            result = call("step", memory, readings, command, period)
        except KeyError as error:
            name = error.args[0] if error.args else None
            if not isinstance(name, str) or name in readings:
                raise
            words = f"reads sensor {name!r}, which the scenario lacks: there {'are' if len(readings) > 1 else 'is'}"
            raise part.refusal(f"{words} {comma_list(readings)}", place_of_error(error)) from error
        following, measured = part.pair(result, "Measurement", Measurement)
        for name in ("joints", "joint_rates"):
            given = getattr(measured, name)
            if len(given) != vehicle.n:
                raise part.refusal(f"gives {name} as {kind_of(given)}: must be a tuple of {vehicle.n}")
        part.require_numbers("step", "a measurement", measured, readings[FULL_STATE])
        return following

    return part.trace(step, estimator.start(scenario.agent.model.vehicle), scenario)


def _check_law(scenario: Scenario, part: UserPart) -> Fingerprint:
    """Check one step of a user-defined law at the start of the reference."""
    leads, period = preview_leads(part.record.par), scenario.rates.period
    reference = scenario.agent.law_reference

    def step(call: Call, memory: Tree, time: Scalar, state: State, _draws: Scalars) -> Tree:
        sample = with_preview(reference.at(time), leads, lambda lead: reference.at(time + lead))
        following: Tree = call("law", memory, measurement_of(state, WEIGHT), sample, period)[0]
        return following

    return part.trace(step, part.record.memory, scenario)


def check_law(law: Scenario | Controller | Callable[[Model], Controller], scenario: Scenario | str = "case3") -> None:
    """Refuse a law that cannot be traced, has hidden state, or returns a first command that cannot be.

    It must be finite, and turn no rotor backwards that is not reversible. A speed above a rotor's largest one is a
    warning.

    The law steps over its first periods twice, as floats and as a traced program, and both must agree to the bit: a law
    that keeps something outside its memory, or freezes a number into the program, differs. A law that is called
    (``compiled=False``) may keep what it likes and is not compared. After that all of the user's parts in
    the scenario are checked as before a flight.

    Args:
        law: a controller, or its maker, which gets the scenario's model; or a scenario, whose law is checked where it
            is user-defined.
        scenario: gives model, references and initial state; or the name of a shipped one.

    Raises:
        LawError: one line with the law's file and line.
    """
    if isinstance(law, Scenario):
        flown, controller = law, law.agent.controller
    else:
        flown = load_scenario(scenario) if isinstance(scenario, str) else scenario
        controller = _make_controller(law, flown.agent.model)
    flown, rates = flown.with_controller(controller), flown.rates
    seen = measurement_of(first_state(flown), Vec3(0.0, 0.0, float(flown.agent.plant.gravity)))
    times = Publisher(control_rate=rates.control, reference_rate=rates.reference).held_time(np.arange(PERIODS))
    references = [flown.agent.reference.at(float(time)) for time in times[: flown.steps]]
    try_law(controller, 1.0 / rates.control, seen, references)
    require_shapes(flown)


def _make_controller(law: Controller | Callable[[Model], Controller], model: Model) -> Controller:
    """Return a controller, given directly or built by a maker function, after a check."""
    if isinstance(law, Controller):
        check_controller(law)
        return law
    name = getattr(law, "__name__", "law")
    return call_maker(law, name, model, {})
