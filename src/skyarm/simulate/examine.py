"""Examination of users' code before a flight, by the contract of its kind, and of a
user-defined control law.

Each part is traced alone, and what its contract refuses is one line with class, file
and line. So is a part whose traces differ: three are compared here, and one in another
process if it comes from a plugin. A part of a plugin that reads its environment or a
file, or goes through a set, gives the same program in every trace of one process, and
another one elsewhere. Files that its fields name are no such thing: they are there,
too.

Not seen are a plant and a law with ``compiled=False``, which are called with floats;
``euler_step``, ``drift``, ``push`` and ``far`` of a coupled force; what runs after the
flight or on its own, as a metric, a format, a command, ``cause`` or ``shapes``; what
the maker of a law or motion draws and reads; a file at an absolute path, an unset
variable, the date or a short set, which may be the same in both processes; and a part
that is pure for some values of its fields only, as the other process tries one part of
a class. Parts of a script or notebook have no file that could be loaded elsewhere; with
such parts in a scenario, a warning names those that no other process has tried.

:func:`check_law` looks further: it compares a law in floats with its program over some
periods. What ships is not examined.
"""

from __future__ import annotations

import inspect
import json
import os
import pickle
import shutil
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from skyarm.algebra import ZERO3, Scalar, Scalars, Vec3
from skyarm.algebra.scalars import data
from skyarm.compile.tracing.fingerprint import (
    OUTSIDE,
    changed_argument,
    contents,
    fingerprint,
    in_floats,
)
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
from skyarm.records.files import must_be_one_of, shown
from skyarm.records.files.messages import comma_list
from skyarm.records.files.user_code import failure, own_code, place_of, place_of_error
from skyarm.records.immutable import positional
from skyarm.records.leaves import Tree, is_leaf, leaves, named_parts, parts, walk
from skyarm.records.registry import RegistryError
from skyarm.records.registry.contract import CONTRACTS, Mistake, Numbers, class_mistake
from skyarm.records.registry.plugins import is_of_plugin, loaded_plugins
from skyarm.records.travel import luggage, pack, unload
from skyarm.reference.preview import with_preview
from skyarm.reference.signals import Signal
from skyarm.scenario.paths import is_of_agent
from skyarm.scenario.scenario_file import load_scenario
from skyarm.scenario.scenario_record import Scenario, ScenarioError, first_state
from skyarm.scenario.without_effect import WEIGHT, readings_at
from skyarm.sensing.measurement import Measurement, measurement_of
from skyarm.sensing.sensor import NO_PUSH
from skyarm.sensing.sensor_kinds import declared_reading
from skyarm.simulate.inputs import held_times
from skyarm.simulate.pictures import Images, blank_images
from skyarm.vehicle import BASE
from skyarm.world import Wrench
from skyarm.world.component import MOST_UNIFORMS

PURE = "must compute from its arguments and fields alone; random numbers are its draws"

Fingerprint = dict[str, str]
"""Text of the traced results of a part's methods, by place."""

Given = dict[str, Any]
"""Arguments of a part's methods by name; a function without arguments makes one that
takes long."""


class PartError(LawError, ScenarioError):
    """Error in a user-defined model, as one line with its file and line."""


@positional
class UserPart:
    """User-defined model in a scenario.

    Attributes:
        kind: its key in ``CONTRACTS``. record: the model. place: its parameter path.
        scenario: flight of the vehicle that has the model, alone. whole: that of all
            vehicles.
        own: object within the record whose code is the user's, if not the record
            itself.
    """

    kind: str
    record: Any
    place: str
    scenario: Scenario
    whole: Scenario
    own: object = None

    @property
    def uniforms(self) -> Any:
        """Count of random numbers that the model draws, not yet checked; 0 for a kind
        that draws none.
        """
        count = getattr(self.record, "uniforms", 0)
        return count(self.scenario.agent.vehicle) if callable(count) else count

    def refusal(
        self, what: str, instead: str = "", place: str = "", method: str = ""
    ) -> PartError:
        """Error about a user-defined model, with file and line of the user's code.

        Args:
            what: what is wrong.
            instead: what must be in its place.
            place: file and line, if not those of the method.
            method: method that the message names; the contract's first one gives the
                line without it.
        """
        function = getattr(
            self.record, method or next(iter(CONTRACTS[self.kind].methods), ""), None
        )
        # the method itself, if the user wrote it; else his class, which inherits it
        line = place or place_of(
            function if own_code(function) else self.own or type(self.record)
        )
        owner = (
            f"{self.place}"
            f" ({type(self.own or self.record).__name__}{method and '.'}{method})"
        )
        return PartError(
            Mistake(
                f"law {self.record.name!r}" if self.kind == "law" else owner,
                line,
                what,
                instead,
            )
        )

    def require_numbers(self, method: str, wanted: Numbers, result: object) -> None:
        """Raise an error if a method's result contains a non-number or differs in
        structure from an example.
        """
        example = (
            wanted.example(self.record) if callable(wanted.example) else wanted.example
        )
        numbers = dict(named_parts(result, wanted.label))
        expected = (
            numbers if example is None else dict(named_parts(example, wanted.label))
        )
        if list(numbers) != list(expected):
            raise self.refusal(
                f"gives {comma_list(numbers)}",
                f"must be {comma_list(expected)}",
                method=method,
            )
        for at, each in numbers.items():
            plain = coerce.plain_number(each)
            if (
                example is not None
                and isinstance(expected[at], str)
                and isinstance(each, str)
            ):
                continue
            # an int is right here: it is read as a number, never kept in a memory
            if kind_of(plain) != "a number" and type(plain) not in (int, wanted.also):
                free = (
                    ", or a tuple or a frozen dataclass of numbers"
                    if example is None
                    else ""
                )
                raise self.refusal(
                    f"gives {at} as {kind_of(plain)}",
                    f"must be a number{free}",
                    method=method,
                )

    def pair(self, result: object, what: str, kind: type = object) -> tuple[Tree, Any]:
        """Return the result of a model's step if it is a pair (internal state, output);
        else raise an error.
        """
        if (
            not isinstance(result, tuple)
            or len(result) != 2
            or not isinstance(result[1], kind)
        ):
            raise self.refusal(
                f"returns {kind_of(result)}", f"must return (memory, {what})"
            )
        return result

    def require_velocity(self, given: Given, air: object) -> None:
        """Refuse a velocity of the air that is no vector of numbers."""
        if not isinstance(air, Vec3):
            raise self.refusal(
                f"gives the velocity of the air as {kind_of(air)}",
                "must be a Vec3",
                method="velocity",
            )
        self.require_numbers("velocity", Numbers("velocity", WEIGHT), air)

    def require_wrenches(self, given: Given, wrenches: Any) -> None:
        """Refuse anything but a list of wrenches on bodies that are there."""
        refuse = partial(self.refusal, method="wrenches")
        whole = self.whole.agents
        if not isinstance(wrenches, (list, tuple)) or not all(
            isinstance(each, Wrench) for each in wrenches
        ):
            raise refuse(
                f"gives wrenches as {kind_of(wrenches)}", "must be a list of Wrench"
            )
        self.require_numbers(
            "wrenches",
            Numbers("wrenches", (Wrench(),) * len(wrenches)),
            tuple(wrenches),
        )
        for each in wrenches:
            if each.agent and each.agent not in whole:
                raise refuse(
                    f"gives a wrench on agent {each.agent!r}",
                    must_be_one_of(whole, each.agent),
                )
            moving = len(
                (
                    whole[each.agent].plant.vehicle if each.agent else given["vehicle"]
                ).moving
            )
            if not BASE <= each.body < moving:
                bodies = (
                    f"-1 (base) or a link from 0 to {moving - 1}"
                    if moving
                    else "-1 (base)"
                )
                raise refuse(f"gives a wrench on body {each.body}", f"must be {bodies}")

    def require_rates(self, given: Given, slope: object) -> None:
        """Refuse rates of a memory in another structure than the memory's."""
        if different := difference(given["memory"], slope, "the slope"):
            raise self.refusal(
                "gives the rates of its memory in another structure",
                different,
                method="slope",
            )

    def require_effort(self, given: Given, effort: Any) -> None:
        """Refuse an effort that is no number."""
        kind = kind_of(data(effort))
        if kind != "a number":
            raise self.refusal(
                f"gives an effort that is {kind}", "must be a number", method="effort"
            )

    def require_reading(self, given: Given, result: object) -> None:
        """Refuse anything but a memory and a reading of numbers, of the class that the
        sensor declares.
        """
        given["memory"], reading = self.pair(result, "reading")
        declared = declared_reading(self.record)
        if not isinstance(reading, declared):
            kind = kind_of(reading)
            raise self.refusal(
                f"gives a reading that is {kind}",
                f"must be of type {declared.__name__}, its record",
            )
        self.require_numbers("measure", Numbers("a reading", also=bool), reading)

    def require_measurement(self, given: Given, result: object) -> None:
        """Refuse anything but a memory and a measurement of all joints."""
        given["memory"], measured = self.pair(result, "Measurement", Measurement)
        n = self.scenario.agent.vehicle.n
        for name in ("joints", "joint_rates"):
            joints = getattr(measured, name)
            if len(joints) != n:
                raise self.refusal(
                    f"gives {name} as {kind_of(joints)}", f"must be a tuple of {n}"
                )
        self.require_numbers(
            "step",
            Numbers("a measurement", measurement_of(given["state"], WEIGHT)),
            measured,
        )

    def require_command(self, given: Given, result: Any) -> None:
        """Take the memory of a law, whose step function looks at its command itself."""
        given["memory"] = result[0]

    def require_memory(self, given: Given, memory: Any) -> None:
        """Take the memory that other methods are given; its structure is looked at in
        the end.
        """
        given["memory"] = memory

    @property
    def images(self) -> Images:
        """Example of the pictures that the model sees."""
        sees = self.record.sees if self.kind in ("law", "ending") else ()
        return blank_images(self.scenario, sees)

    def arguments_at(
        self,
        t: Scalar,
        state: State,
        draws: Sequence[Scalar],
        images: Images = (),
    ) -> Given:
        """Arguments of the model's methods at an instant, by the names of its base
        class; functions of what is long.
        """
        scenario = self.scenario
        agent = scenario.agent
        period = scenario.rates.period
        vehicle = agent.vehicle
        speeds = state.rotor_speeds
        given: Given = {
            "t": t,
            "state": state,
            "draws": draws,
            "period": period,
            "dt": period,
            "vehicle": vehicle,
            "scenario": scenario,
            "position_W": state.position,
            # where it should be: an ending by the distance from there is not met
            "goal": state.position,
            "slack": 0.0,
            "rotors": vehicle.rotors,
            "rotor_speeds": speeds,
            "commands": speeds,
            "command": Command(rotor_speeds=speeds, efforts=vehicle.zeros),
            "specific_force": WEIGHT,
            "push": NO_PUSH,
            "measurement": replace(measurement_of(state, WEIGHT), images=images),
            "images": images,
            "motion": lambda: self._motion(state),
            "readings": lambda: readings_at(scenario, state, t),
            "reference": lambda: self._reference(t),
        }
        if self.kind == "sensor":
            given["dt"] = 1.0 / (self.record.frequency or scenario.rates.control)
        if self.kind == "estimator":
            given["vehicle"] = agent.model.vehicle
        if self.kind == "drive":
            joint = vehicle.joint_names.index(self.place.rpartition("plant.drives.")[2])
            position = state.joints[joint]
            # 0.1 away, chosen, because at its setpoint a drive shows little of its law
            given |= {
                "position": position,
                "setpoint": 0.1 + position,
                "rate": state.joint_rates[joint],
            }
        return given

    def _motion(self, state: State) -> Any:
        """Motion of the vehicle in sight of all others, with everything made that it
        keeps once it is called for.
        """
        whole, (own,) = self.whole, self.scenario.agents
        # the others stand at their starts: the part is tried in sight of the whole team
        states = {name: first_state(whole.of(name)) for name in whole.agents} | {
            own: state
        }
        motions = motions_of(
            [each.plant for each in whole.agents.values()],
            [*states.values()],
            tuple(states),
        )
        for moved in motions:
            # what it keeps is there before the call, and compared
            moved.to_world(ZERO3, len(moved.vehicle.moving) - 1)
        return motions[0].agents[own]

    def _reference(self, t: Scalar) -> Any:
        """Reference sample with the preview that a law looks at."""
        reference = self.scenario.agent.law_reference
        return with_preview(
            reference.at(t),
            preview_leads(self.record.par),
            lambda lead: reference.at(t + lead),
        )

    def call(self, method: str, given: Given) -> Any:
        """Call a method of the model; raise an error if it modifies an argument or
        reads a sensor that is not there.
        """
        own = self.record
        values = _values(given, CONTRACTS[self.kind].methods[method].arguments)
        function = (
            partial(checked_law(own), par=own.par)
            if self.kind == "law"
            else getattr(own, method)
        )
        if self.kind == "ending" and own.sees:
            function = partial(function, images=given["images"])
        names = ("self", *inspect.signature(function).parameters)
        # a parameter with a default, as the images of an ending, has no value here
        arguments = dict(zip(names, (own, *values), strict=False))
        before = contents(arguments)
        try:
            result = function(*values)
        except KeyError as error:
            name = next(iter(error.args), None)
            readings = given["readings"]
            # still a function: no readings were made, so the key is none of theirs
            if callable(readings) or not isinstance(name, str) or name in readings:
                raise
            there = (
                f"there {'are' if len(readings) > 1 else 'is'} {comma_list(readings)}"
            )
            what = f"reads sensor {name!r}, which the scenario lacks"
            raise self.refusal(what, there, place_of_error(error)) from error
        if (name := changed_argument(arguments, before)) is not None:
            raise self.refusal(
                f"writes to its argument {name!r}",
                "must return new records",
                method=method,
            )
        return result

    def first_memory(self) -> Tree:
        """Internal state at the start of a flight, of draws of one half; raise an error
        if no program can keep it.
        """
        start, _, arguments = CONTRACTS[self.kind].start.rstrip(")").partition("(")
        begin: Any = getattr(self.record, start, ())
        memory: Tree = begin
        if arguments:
            # one half of a uniform number is the median of what it stands for
            draws = [0.5] * (2 * self.uniforms)
            values = _values(
                self.arguments_at(0.0, first_state(self.scenario), draws), arguments
            )
            try:
                memory = begin(*values)
            except (ValueError, IndexError) as error:
                if "draws" not in arguments:
                    raise
                what = (
                    f"cannot start from {len(draws)} draws, which are twice its"
                    f" uniforms: {error}"
                )
                raise self.refusal(what, place=place_of_error(error)) from error
        if words := memory_mistake(memory, "memory"):
            raise self.refusal(words)
        return memory

    def trace(self) -> Fingerprint:
        """Trace one step of the model by its contract; raise a one-line error for a
        mistake in the user's code.
        """
        memory = self.first_memory()
        first = first_state(self.scenario)

        def step(
            moving: Tree,
            time: Scalars,
            state: State,
            draws: Scalars,
            images: Images,
        ) -> Mapping[str, Any]:
            # traced numbers refuse a branch, which no machine code has
            given = self.arguments_at(time[0], state, draws, images)
            given["memory"] = moving
            results = {}
            for name, method in CONTRACTS[self.kind].methods.items():
                if method.pure and method.needed(self.record):
                    results[name] = result = self.call(name, given)
                    if isinstance(method.result, Numbers):
                        self.require_numbers(name, method.result, result)
                    elif method.result:
                        getattr(self, f"require_{method.result}")(given, result)
            if different := difference(moving, given["memory"], "memory"):
                raise self.refusal("changes the structure of its memory", different)
            own = {
                name: getattr(self.record, name, None)
                for name in ("largest_step", "frequency", "latency")
            }
            with suppress(Exception):
                # what a constructor gives is compared here, as _as_constructed keeps
                # the values; a record that cannot be made of its fields gives nothing
                own["__post_init__"] = leaves(replace(self.record))
            return {"start": memory, **own, **results}

        try:
            return fingerprint(
                step,
                in_floats(memory),
                (0.0,),
                in_floats(first),
                (0.5,) * self.uniforms,
                self.images,
            )
        except (TypeError, AttributeError, IndexError, coerce.RecordError) as error:
            seen = self.images if self.kind == "ending" else None
            if words := mistake_in(error, seen):
                raise self.refusal(words, place=place_of_error(error)) from error
            raise


def _values(given: Given, arguments: str) -> list[Any]:
    """Values of the arguments of a method, made where they are not yet."""
    names = arguments.split(", ")
    given |= {name: given[name]() for name in names if callable(given[name])}
    return [given[name] for name in names]


def _require_class(part: UserPart) -> None:
    """Refuse a user-defined class with wrong method parameters, texts or an invalid
    count of random numbers.
    """
    # the class is one of the library's: only something inside is the user's
    if part.own is not None:
        return
    kind = type(part.record)
    mistake = class_mistake(kind)
    if mistake is not None:
        raise part.refusal(mistake.what, mistake.instead, mistake.place)
    for name in CONTRACTS[part.kind].texts:
        text = getattr(part.record, name, None)
        if not isinstance(text, str):
            raise part.refusal(f"has {name} = {shown(text)}", "must be a text")
    if part.kind == "ending" and part.record.sees:
        taken = inspect.signature(part.record.fine).parameters
        if "images" not in taken:
            raise part.refusal(
                f"sees {comma_list(part.record.sees)}, its fine takes no images",
                "must be fine(self, scenario, state, goal, slack, images=())",
            )
    count = part.uniforms
    given = getattr(part.record, "uniforms", None)
    if type(count) is not int or not 0 <= count <= MOST_UNIFORMS:
        line = place_of(
            given if callable(given) and own_code(given) is not None else kind
        )
        what = f"{'gives' if callable(given) else 'has'} uniforms = {shown(count)}"
        raise part.refusal(
            what, f"must be a whole number from 0 to {MOST_UNIFORMS}", line
        )


def _as_constructed(record: Any) -> Any:
    """Copy of a record as its constructor made it, without values that it stored in
    itself later.
    """
    if type(record) is tuple:
        return tuple(map(_as_constructed, record))
    try:
        again = replace(record)
        # of a constructor that converts its fields, a second call makes something else
        # than the first: what that made
        made = again if contents(again) == contents(replace(again)) else record
        for name in vars(again):
            object.__setattr__(again, name, _as_constructed(getattr(made, name)))
    except Exception:
        return record  # no dataclass, or one that cannot be constructed from its fields
    return again


FAILED = "failed"
"""Key for the reason why the models of a process failed."""


def _fingerprints(own: Sequence[UserPart], *, anew: bool = False) -> list[Fingerprint]:
    """Trace user-defined models one by one; ``anew``: as newly constructed, with errors
    recorded.
    """
    texts = []
    for part in own:
        try:
            # a function within a record has no constructor to call again
            constructed = anew and part.own is None
            texts.append(
                (
                    replace(part, record=_as_constructed(part.record))
                    if constructed
                    else part
                ).trace()
            )
        except Exception as error:
            # a flight gives a law more than it has here, and says what is wrong with it
            if not ANSWERING and (
                isinstance(error, PartError) or not (anew or part.kind == "law")
            ):
                raise
            texts.append({FAILED: failure(error) or str(error)})
    return texts


def examine(
    kind: str, record: object, where: Scenario, place: str = ""
) -> Sequence[Mistake]:
    """Examine users' code by the contract of its kind; the first mistake is the only
    one, none in code that is right.

    In this order: the signatures of its class, the trace of each method, what it
    returns, three equal traces, and an equal one in another process if a plugin has it.

    Args:
        kind: key of ``skyarm.records.registry.contract.CONTRACTS``.
        record: object of the user's class.
        where: scenario at whose start it is called; need not have it.
        place: its parameter path in messages; the kind if left out.
    """
    part = UserPart(kind, record, place or kind, where, where)
    try:
        _require_right([part])
        if kind == "law":
            check_controller(part.record)
            _try_periods(part.record, where)
    except PartError as error:
        return [error.args[0]]
    except LawError as error:
        return [_mistake_of_law(error, part.record)]
    return []


def _mistake_of_law(error: LawError, controller: Controller) -> Mistake:
    """Error of a law as data, from its line "PLACE: law NAME WHAT: must INSTEAD"."""
    owner = f"law {controller.name!r}"
    place, _, line = str(error).partition(f": {owner} ")
    what, _, instead = line.partition(": must ")
    return Mistake(owner, place, what, instead and f"must {instead}")


def require_shapes(scenario: Scenario) -> None:
    """Raise an error if methods of user-defined models have wrong arguments or result
    shapes, or are not pure.

    A method that is not pure writes to its arguments, or gives another program when it
    is traced anew, as it is or as it was constructed; or, where a plugin has it, in
    another process.

    Raises:
        ScenarioError, LawError: one line with file and line, place in the scenario,
            class and method.
    """
    _require_right([*_parts(scenario)])


def _require_right(own: Sequence[UserPart]) -> None:
    """Raise the first error in user-defined models.

    Raises:
        PartError, LawError: one line.
    """
    for part in own:
        _require_class(part)
    # as constructed first: what a part has stored in itself since differs from it
    anew, once, twice = (_fingerprints(own, anew=anew) for anew in (True, False, False))

    def compare(
        first: list[Fingerprint], other: list[Fingerprint], where: str, why: str
    ) -> None:
        for part, here, there in zip(own, first, other, strict=True):
            # the first trace failed as well: there is nothing to compare it with
            if FAILED in here:
                continue
            if FAILED in there:
                raise part.refusal(f"fails {where}", f"{why} ({there[FAILED]})")
            for at in {**here, **there}:
                if here.get(at) != there.get(at):
                    raise part.refusal(
                        f"gives another program {where}", why, method=at.split(".")[1]
                    )

    for first, other in ((anew, once), (once, twice)):
        compare(first, other, "whenever it is traced", f"{OUTSIDE}; {PURE}")
    _try_elsewhere(
        own, lambda elsewhere: compare(anew, elsewhere, WHERE, f"{CAUSES}; {PURE}")
    )


def has_own(scenario: Scenario) -> bool:
    """True if the law or a part of a scenario, such as a force, sensor, fault or
    signal, is user-defined.
    """
    return any(is_own(each.controller) for each in scenario.agents.values()) or bool(
        [*_parts(scenario)]
    )


def _parts(scenario: Scenario) -> Iterator[UserPart]:
    """List the user-defined models of a scenario."""
    for i, name in enumerate(scenario.agents):
        for part in _parts_of_agent(scenario.of(name), scenario, first=i == 0):
            its_own = scenario.is_team and is_of_agent(part.place)
            yield (
                replace(part, place=f"agents.{name}.{part.place}") if its_own else part
            )


def _parts_of_agent(
    scenario: Scenario, whole: Scenario, *, first: bool
) -> Iterator[UserPart]:
    """List the user-defined models of one vehicle's flight; of the ``first`` vehicle
    those that all share, too.
    """
    agent = scenario.agent
    part = partial(UserPart, scenario=scenario, whole=whole)
    if is_own(agent.controller) and agent.controller.compiled:
        yield part("law", agent.controller, "controller", own=agent.controller.law)
    components = (
        scenario.placed_components
        if first
        else agent.placed_models(scenario.environment)
    )
    faults = [(f"environment.faults[{i}]", each) for i, each in enumerate(agent.faults)]
    for at, record in [("reference", agent.reference), *faults, *components]:
        for place, each in _values_within(record, at):
            if isinstance(each, Signal) and own_code(type(each)):
                yield part("signal", each, place)
    for _, each in _values_within(agent.reference, "reference"):
        if own_code(each if callable(each) else type(each)):
            yield part("motion", agent.reference, "reference", own=each)
            break
    models: list[tuple[str, Any]] = [
        *components,
        *faults,
        *((f"plant.drives.{each.joint}", each.drive) for each in agent.joint_drives),
        *((f"sensors.{name}", each) for name, each in agent.all_sensors[1:]),
        ("estimator", agent.estimator),
        *(
            (f"endings[{i}]", each)
            for i, each in enumerate(scenario.endings if first else ())
        ),
    ]
    for place, model in models:
        if own_code(type(model)):
            # a component of no kind with a contract has the one that all components
            # share
            kind = getattr(model, "registered_as", "")
            yield part(kind if kind in CONTRACTS else "force", model, place)


def _values_within(record: object, place: str) -> Iterator[tuple[str, object]]:
    """A record and all records and values within it, each with its parameter path."""
    yield place, record
    for name, each in parts(record).items():
        yield from _values_within(each, f"{place}.{name}")


WHERE = "in a process with an empty environment, another folder and another hash seed"

CAUSES = (
    "it reads the environment or a file that no field names, is made of random numbers,"
    " or goes through a set"
)

KEPT = ("SYSTEMROOT", "LD_LIBRARY_PATH", "DYLD_LIBRARY_PATH", "PYTHONHOME")
"""Environment variables without which Python or NumPy may not start."""

PROGRAM = """import json, os, sys
sys.path[:] = json.loads(sys.argv[1])
out = os.dup(1)
os.dup2(2, 1)
from skyarm.simulate.examine import answer
text = json.dumps(answer())
with open(out, "w") as file:
    file.write(text)"""
"""Program of the other process; plugins print to standard error, since standard output
carries the answer."""

SECONDS = 120.0
"""Time (s) after which the other process is abandoned; chosen. It imports this library
in 1.1 s; the rest is the traces of a user's parts."""

DEEP = "a/b/c/d"
"""Subfolder of the other, empty folder; a field may name a file some folders above the
present one."""

TRIED: set[str] = set()
"""Models of plugins that this process or its parent has tried."""

ANSWERING: list[bool] = []
"""Not empty in the other process, which starts no further one."""


def _try_elsewhere(
    own: Sequence[UserPart], compare: Callable[[list[Fingerprint]], None]
) -> None:
    """Compare the traces of user-defined models with those of another process if a
    plugin defines any of the models.

    Models that differ in the values of their numbers alone are tried once in a process
    and those that it starts. A warning is where no other process can be had, it gives
    no answer, or the models cannot travel there.

    Args:
        own: the models.
        compare: check that raises an error of a difference.

    Raises:
        RegistryError: a plugin cannot be loaded there.
    """
    codes = [
        code
        for part in own
        if (code := own_code(part.own or type(part.record))) is not None
    ]
    if ANSWERING or not any(map(is_of_plugin, codes)):
        return
    pairs = [pair for part in own for pair in walk(part.record)]
    values = [pair for pair in pairs if not is_leaf(pair[1])]
    places = [f"{code.co_filename}:{code.co_firstlineno}" for code in codes]
    # numbers are left out: they are inputs of a trace, and vary in a study
    key = repr((loaded_plugins(), places, values))
    if key in TRIED:
        return
    answered = None
    why = ""
    try:
        with tempfile.TemporaryDirectory() as folder:
            here = Path(folder).resolve() / DEEP
            here.mkdir(parents=True)
            for _, value in values:
                _lend_file(value, here)
            # another one than here, also where the user has fixed his own
            seed = "1" if os.environ.get("PYTHONHASHSEED") == "0" else "0"
            done = subprocess.run(
                [
                    # an embedded Python knows no path: an empty one is an OSError, told
                    # as a warning
                    sys.executable or "",
                    # writes no byte code beside the user's files
                    "-B",
                    "-c",
                    PROGRAM,
                    # absolute, as the other process stands in another folder
                    json.dumps([os.path.abspath(path) for path in sys.path]),
                ],
                input=pickle.dumps((luggage(), pack(own))),
                capture_output=True,
                cwd=here,
                env={"PYTHONHASHSEED": seed}
                | {name: os.environ[name] for name in KEPT if name in os.environ},
                timeout=SECONDS,
                check=False,
            )
        # a traceback ends with its cause
        last = done.stderr.decode(errors="replace").strip().rpartition("\n")[2]
        why = f"it ended with code {done.returncode}: {last}".removesuffix(": ")
        answered = json.loads(done.stdout)
    except subprocess.TimeoutExpired:
        why = f"no answer within {SECONDS:g} s"
    except (ValueError, OSError) as error:
        why = why or str(error)
    if isinstance(answered, str):
        raise RegistryError(f"{answered} {WHERE}")
    if answered is None:
        warnings.warn(
            f"{comma_list(dict.fromkeys(places))}: could not be tried {WHERE}: {why}",
            stacklevel=2,
        )
    else:
        compare(answered)
    # only after the comparison, whose error comes again at the next try
    TRIED.add(key)


def _lend_file(name: object, folder: Path) -> None:
    """Make a file under a relative path available under the same relative path in
    another folder.
    """
    if (
        not isinstance(name, str)
        or not name
        or os.path.isabs(name)
        or not os.path.exists(name)
    ):
        return
    there = Path(os.path.normpath(folder / name))
    # never outside the temporary folder, however often a name goes up
    if there.exists() or not there.is_relative_to(folder.parents[DEEP.count("/")]):
        return
    there.parent.mkdir(parents=True, exist_ok=True)
    try:
        there.symlink_to(os.path.abspath(name))
    except OSError:
        # Windows allows links to administrators alone
        shutil.copy(name, there)


def answer() -> list[Fingerprint] | str:
    """Read models from standard input and trace them; return their fingerprints, or a
    plugin's load error.
    """
    ANSWERING.append(True)
    luggage_there, own = pickle.loads(sys.stdin.buffer.read())
    try:
        unload(luggage_there)
    except RegistryError as error:
        return str(error)
    return _fingerprints(pickle.loads(own), anew=True)


def check_law(
    law: Scenario | Controller | Callable[[Model], Controller],
    scenario: Scenario | str = "case3",
) -> None:
    """Refuse a law that cannot be traced, has hidden state, or returns a first command
    that cannot be.

    It must be finite, and turn no rotor backwards that is not reversible. A speed above
    a rotor's largest one is a warning.

    The law steps over its first periods twice, as floats and as a traced program, and
    both must agree to the bit: a law that keeps something outside its memory, or
    freezes a number into the program, differs. A law that is called
    (``compiled=False``) may keep what it likes and is not compared. After that all of
    the user's parts in the scenario are checked as before a flight.

    Args:
        law: a controller, or its maker, which gets the scenario's model; or a scenario,
            whose law is checked where it is user-defined.
        scenario: gives model, references, initial state and the cameras that the law
            sees; or the name of a shipped one.

    Raises:
        LawError: one line with the law's file and line.
    """
    if isinstance(law, Scenario):
        flown = law
        controller = law.agent.controller
    else:
        flown = load_scenario(scenario) if isinstance(scenario, str) else scenario
        name = getattr(law, "__name__", "law")
        model = flown.agent.model
        controller = (
            law if isinstance(law, Controller) else call_maker(law, name, model, {})
        )
        check_controller(controller)
    for name in controller.sees:
        if name not in flown.agent.cameras:
            raise wrong(
                controller,
                f"sees {name!r}: scenario {flown.name!r} must have this camera; give"
                " one that has it, skyarm.check_law(law, scenario)",
            )
    flown = flown.with_controller(controller)
    _try_periods(controller, flown)
    require_shapes(flown)


def _try_periods(controller: Controller, flown: Scenario) -> None:
    """Try a law over the first control periods of a scenario (:func:`try_law`)."""
    # at rest an accelerometer reads gravity upwards
    seen = measurement_of(
        first_state(flown), Vec3(0.0, 0.0, float(flown.agent.plant.gravity))
    )
    seen = replace(seen, images=blank_images(flown, controller.sees))
    times = held_times(flown, np.arange(min(PERIODS, flown.steps)))
    references = [flown.agent.reference.at(float(time)) for time in times]
    try_law(controller, 1.0 / flown.rates.control, seen, references)
