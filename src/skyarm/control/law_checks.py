"""Checks of a user-defined control law and of its results, with the law's file and line
in each message.

Shipped laws are not looked at: all of their code stands in the library, and its tests
fly them. A law of which any function stands elsewhere, in a plugin, another package or
a script, is someone's own; its trial compares floats with the traced program.
"""

from __future__ import annotations

import inspect
import math
import re
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import FrozenInstanceError, replace
from enum import Enum
from functools import partial
from traceback import extract_tb
from typing import Any

import numpy as np

from skyarm.algebra import Scalar, Vec3
from skyarm.compile import Node, TracedBranchError
from skyarm.compile.tracing.fingerprint import (
    OUTSIDE,
    changed_argument,
    contents,
    fingerprint,
    in_floats,
)
from skyarm.compile.tracing.program import trace
from skyarm.control.controller import Controller, ControllerError, Law
from skyarm.control.model import Model
from skyarm.dynamics.actuators import Command
from skyarm.dynamics.actuators.rotor import require_speeds
from skyarm.records.coerce import RecordError
from skyarm.records.files import must_be_one_of, shown
from skyarm.records.files.user_code import own_code, place_of, place_of_error
from skyarm.records.leaves import (
    Tree,
    field_names,
    is_record,
    leaves,
    named_parts,
    pairs,
    rebuild,
)
from skyarm.reference import Reference
from skyarm.sensing.measurement import Image, Measurement

CALLED_AS = "law(memory, measurement, reference, dt, *, par)"

RETURNS = "must return (memory, Command)"

ONE_FOR = {"rotor_speeds": "rotor", "efforts": "joint", "tilts": "rotor that tilts"}
"""Component (rotor, joint, tilting rotor) that each number of a command belongs to, by
field of the command."""

MAY_BE_EMPTY = ("tilts",)

TRACED = "cannot be traced"

ALLOWED = "must use + - * / and the functions of skyarm.algebra.scalars"

AS_FLOATS = "or Controller(compiled=False), which calls it with floats"


PERIODS = 20
"""Number of control periods over which a traced law is compared with its evaluation on
floats; chosen."""

Numbers = tuple[float, ...]


class LawError(ControllerError):
    """Error in a user-defined law, as one line with its file and line."""


def is_own(controller: Controller) -> bool:
    """True if any code of a law lies outside this library."""
    return own_code(controller.law) is not None


def wrong(controller: Controller, words: str) -> LawError:
    """One-line error about a user-defined law, with the file and line where it begins.

    ``words`` state the fault and the requirement.
    """
    return _fault(controller.law, controller.name, words)


def _fault(law: Law, name: str, words: str, place: str = "") -> LawError:
    return LawError(f"{place or place_of(law)}: law {name!r} {words}")


def check_controller(controller: Controller) -> None:
    """Reject a controller with an invalid step function, signature, constants or
    initial state, before the law runs.

    Raises:
        LawError: one line.
    """
    # shipped laws are flown by the library's tests, so that a check would only cost
    # time
    if not is_own(controller) and callable(controller.law):
        return
    law = controller.law
    if isinstance(law, type) or not callable(law):
        kind = (
            f"the class {law.__qualname__}"
            if isinstance(law, type)
            else f"{shown(law)}, which cannot be called"
        )
        raise wrong(
            controller,
            f"is {kind}: must be a function, or an object with __call__, {CALLED_AS}",
        )
    try:
        inspect.signature(law).bind(None, None, None, None, par=None)
    except TypeError as error:
        raise wrong(controller, f"cannot be called as {CALLED_AS}: {error}") from None
    except ValueError:
        # built in: it has no signature to look at
        pass
    par = controller.par
    if not is_record(par):
        raise wrong(
            controller,
            f"has the constants {shown(par)}: par must be a frozen dataclass with a"
            " field 'model'",
        )
    if not isinstance(getattr(par, "model", None), Model):
        raise wrong(
            controller,
            f"has constants without a Model: {type(par).__name__}.model must be the"
            " nominal one",
        )
    if controller.compiled and (words := memory_mistake(controller.memory, "memory")):
        raise wrong(
            controller,
            f"{words}, {AS_FLOATS}" if words.endswith("of numbers") else words,
        )


MEMORIES = "must be a tuple or a frozen dataclass of numbers"


def memory_mistake(memory: object, path: str) -> str | None:
    """Error text for an initial controller state that cannot be compiled; None for a
    valid state.
    """
    # within a memory it is a constant, alone it never changes
    if isinstance(memory, str):
        return f"has {path} = {shown(memory)}: {MEMORIES}"
    mistakes = (_kept_mistake(value, at) for at, value in named_parts(memory, path))
    return next((words for words in mistakes if words), None)


def _kept_mistake(value: object, path: str) -> str | None:
    """Error text for one value of a controller state that cannot be compiled; None for
    a valid value.
    """
    if isinstance(value, (bool, int)) and not isinstance(value, Enum):
        number = "1.0 or 0.0" if isinstance(value, bool) else f"{value}.0"
        return (
            f"has {path} = {value!r}: an int never changes in a program; must be"
            f" {number}"
        )
    if value is None or isinstance(value, (str, Enum)) or _is_number(value):
        return None
    return f"has {path} = {shown(value)}: {MEMORIES}"


def checked_law(controller: Controller) -> Law:
    """Step function that checks each result of a user-defined law; a shipped law is
    returned unchanged.

    A wrong result raises LawError. An error of the law's own code passes as it is.
    """
    law = controller.law
    # a law that a layer has wrapped is checked already: twice would find nothing more
    if not is_own(controller) or getattr(law, "func", None) is _check_step:
        return law
    counts = _counts(controller)
    return partial(
        _check_step,
        law=law,
        name=controller.name,
        compiled=controller.compiled,
        counts=counts,
    )


def bound_by(law: object) -> tuple[tuple[int, ...], tuple[object, ...]]:
    """Identities of a law's functions, which functools.partial may bind together, and
    the constants that they bind.
    """
    if not isinstance(law, partial):
        return ((id(law),), ()) if callable(law) else ((), (law,))
    bound = [
        bound_by(each)
        for each in (
            law.func,
            *law.args,
            *(law.keywords[name] for name in sorted(law.keywords)),
        )
    ]
    return tuple(i for functions, _ in bound for i in functions), tuple(
        c for _, many in bound for c in many
    )


def _counts(controller: Controller) -> dict[str, int]:
    """Required number of rotor speeds, joint efforts and tilt angles in a command."""
    vehicle = controller.par.model.vehicle
    return {
        "rotor_speeds": len(vehicle.rotors),
        "efforts": vehicle.n,
        "tilts": len(vehicle.tilts),
    }


def _check_step(
    memory: Any,
    measurement: Measurement,
    reference: Reference,
    dt: Scalar,
    *,
    par: Any,
    law: Callable[..., Any],
    name: str,
    compiled: bool,
    counts: Mapping[str, int],
) -> tuple[Any, Command]:
    """One step of a user-defined law, with its result checked."""
    fault = partial(_fault, law, name)
    try:
        result = law(memory, measurement, reference, dt, par=par)
    except (TypeError, AttributeError, IndexError, RecordError) as error:
        cause = mistake_in(error, measurement.images)
        if cause is None:
            raise
        words = f"{cause}, {AS_FLOATS}" if cause.startswith(TRACED) else cause
        raise fault(words, place_of_error(error)) from error
    if not isinstance(result, tuple) or len(result) != 2:
        raise fault(f"returns {kind_of(result)}: {RETURNS}")
    following, command = result
    if not isinstance(command, Command):
        order = isinstance(following, Command)
        pair = (
            f"(Command, {kind_of(command)})"
            if order
            else f"(memory, {kind_of(command)})"
        )
        raise fault(f"returns {pair}: {RETURNS}{', in this order' if order else ''}")
    if compiled and (change := difference(memory, following, "memory")):
        raise fault(f"changes the structure of its memory: {change}")
    for field, count in counts.items():
        if mistake := _field_mistake(field, getattr(command, field), count):
            raise fault(mistake)
    return following, command.dense()


def _field_mistake(field: str, values: object, count: int) -> str | None:
    """Error text for a wrong field of a law's command, None if valid; the angles of
    tilting rotors may be omitted.
    """
    if not isinstance(values, tuple):
        return f"gives {field} as {kind_of(values)}: must be a tuple of {count} numbers"
    if len(values) != count and (values or field not in MAY_BE_EMPTY):
        return (
            f"gives {len(values)} {field}: must be {count}, one for each"
            f" {ONE_FOR[field]}"
        )
    for i, value in enumerate(values):
        if not (type(value) is int or _is_number(value)):
            return f"gives {field}[{i}] as {kind_of(value)}: must be a number"
    return None


def mistake_in(error: Exception, images: Sequence[Image] | None = None) -> str | None:
    """Error text for an exception caused by untraceable user code; None for an ordinary
    bug in that code.

    ``images`` are the pictures that the code sees; None for code that sees none ever.
    """
    text = " ".join(str(error).split())
    if isinstance(error, TracedBranchError):
        # the text begins with file and line, which the message states itself
        return f"{TRACED}: {text.rpartition('.py:')[2].partition(': ')[2] or text}"
    if isinstance(error, FrozenInstanceError):
        return f"changes a record: {text}; must make another, by dataclasses.replace"
    if isinstance(error, RecordError):
        return f"makes a record that cannot be: {text}"
    if isinstance(error, IndexError):
        lines = [each.line or "" for each in extract_tb(error.__traceback__)]
        # a tuple of joints or rotors may be left as well, which no camera cures
        if images is None or not any("image" in line for line in lines[-1:]):
            return None
        seen = [f"{each.sensor!r}, {len(each.depth)} pixels" for each in images]
        there = "; ".join(seen) or 'none, must state sees = ["SENSOR"]'
        return f"reads beyond a tuple; its images: {there}"
    # NumPy and Python raise plain errors for a traced number, so only their texts tell
    if re.search("0-dimensional arrays|length-1 arrays", text):
        return f"{TRACED}: a NumPy array meets a traced number; {ALLOWED}"
    if "another trace" in text:
        return f"meets a number of an earlier call: {OUTSIDE}"
    if re.search(r"\bNode\b|ufunc", text):
        # the class is internal: its name would tell a user nothing
        words = text.replace("'Node'", "a traced number").replace(
            "Node", "traced number"
        )
        return f"{TRACED}: {words}; {ALLOWED}"
    if isinstance(error, AttributeError) and is_record(error.obj):
        kind = type(error.obj)
        allowed = must_be_one_of(field_names(kind) or (), error.name)
        return f"reads {error.name!r} of {kind.__name__}: {allowed}"
    return None


def difference(example: object, record: object, path: str) -> str | None:
    """Text on the first difference in structure between two nested dataclasses or
    tuples; None if alike.
    """
    below = pairs(example, record, path)
    if below is None:
        tuples = isinstance(example, tuple) or isinstance(record, tuple)
        same = (
            _is_number(record)
            if _is_number(example)
            else type(example) is type(record) and example == record
        )
        return (
            None
            if same and not tuples
            else f"{path} is {kind_of(record)}, must stay {kind_of(example)}"
        )
    return next(
        (change for a, b, name in below if (change := difference(a, b, name))), None
    )


def _is_number(value: object) -> bool:
    """True if a value is a float or a symbolic scalar; an int would become a constant
    of the compiled program.
    """
    if isinstance(value, (int, str, Enum, np.ndarray)) or is_record(value):
        return False
    # other engines call the law with scalars of their own, which are no floats
    return isinstance(value, (float, Node)) or (
        hasattr(value, "__mul__") and hasattr(value, "__float__")
    )


def kind_of(value: object) -> str:
    """Short description of a value's type."""
    if value is None or isinstance(value, (bool, str)):
        return shown(value)
    if isinstance(value, int):
        return f"the int {value}"
    if isinstance(value, tuple):
        return f"a tuple of {len(value)}"
    if isinstance(value, np.ndarray):
        return "a NumPy array"
    return "a number" if _is_number(value) else f"a {type(value).__name__}"


def call_maker(
    maker: Callable[..., Any], name: str, model: Model, options: dict[str, Any]
) -> Controller:
    """Call a user-defined function that makes a controller, and check the result.

    Raises:
        LawError: it cannot be called as maker(model, **options), makes a record that
            cannot be, or no controller.
    """

    def wrong_maker(words: str, place: str = "") -> LawError:
        return LawError(f"{place or place_of(maker)}: maker of law {name!r}{words}")

    try:
        inspect.signature(maker).bind(None, **options)
    except TypeError as error:
        raise wrong_maker(f" cannot be called as maker(model): {error}") from None
    except ValueError:
        # built in: it has no signature to look at
        pass
    try:
        made = maker(model, **options)
    except (RecordError, ControllerError) as error:
        if own_code(maker) is None or isinstance(error, LawError):
            raise
        raise wrong_maker(f": {error}", place_of_error(error)) from error
    if not isinstance(made, Controller):
        kind = (
            f"the class {made.__qualname__}" if isinstance(made, type) else shown(made)
        )
        raise wrong_maker(f" returns {kind}: its maker must return a Controller")
    check_controller(made)
    return made


def try_law(
    controller: Controller,
    period: float,
    seen: Measurement,
    wanted: Sequence[Reference],
) -> None:
    """Reject a user-defined law that is not a pure function or whose first command is
    not finite.

    A shipped law is not tried, nor one that is called with floats: such a law may keep
    what it likes.

    Args:
        controller: controller with all its layers.
        period: control period, s.
        seen: first measurement; in the following periods the vehicle drifts slightly
            from there.
        wanted: references of the periods.

    Raises:
        LawError: one line.
    """
    if not controller.compiled or not is_own(controller):
        return
    law = checked_law(controller)
    par = controller.par

    def step(
        memory: Any, measured: Measurement, reference: Reference
    ) -> tuple[Any, Command]:
        return law(memory, measured, reference, period, par=par)

    start = in_floats(controller.memory)
    drifting = (
        replace(perturb(seen, k), time=float(seen.time) + k * period)
        for k in range(PERIODS)
    )
    # a flight may have fewer periods
    instants = list(zip(drifting, wanted, strict=False))
    expected = _results_with_floats(controller, step, start, instants)
    program = trace(step, start, *instants[0])
    now: Numbers = tuple(leaves(start))
    for k, instant in enumerate(instants):
        numbers = program.flat((*now, *leaves(instant)))
        if k == 0:
            _require_numbers(controller, instant, numbers[len(now) :])
        if k < len(expected) and not np.array_equal(
            np.array(numbers, float), np.array(expected[k], float), equal_nan=True
        ):
            raise wrong(
                controller,
                f"gives other numbers as a program in period {k} than with floats:"
                f" {OUTSIDE}",
            )
        now = numbers[: len(now)]
    # a law that draws numbers or reads a clock is another program at each trace
    if fingerprint(step, start, *instants[0]) != fingerprint(step, start, *instants[0]):
        raise wrong(
            controller,
            f"gives another program in period 0 whenever it is traced: {OUTSIDE}",
        )


def _results_with_floats(
    controller: Controller,
    step: Callable[..., tuple[Tree, Command]],
    memory: Tree,
    instants: Sequence[tuple[Measurement, Reference]],
) -> list[Numbers]:
    """Results of a law called with floats for several periods, until an arithmetic
    error ends the calls.
    """
    results: list[Numbers] = []
    for k, (measured, reference) in enumerate(instants):
        given = {
            "memory": memory,
            "measurement": measured,
            "reference": reference,
            "par": controller.par,
        }
        # frozen records may hold lists and arrays, which a law could write to unseen
        before = contents(given)
        try:
            result = step(memory, measured, reference)
        except ArithmeticError:
            # floats refuse 1 / 0, a program goes on with inf
            break
        if (name := changed_argument(given, before)) is not None:
            raise wrong(
                controller,
                f"writes to its argument {name!r} in period {k}: must return new"
                " records",
            )
        numbers = leaves(result)
        memory = result[0]
        if any(isinstance(number, Node) for number in numbers):
            raise wrong(
                controller,
                f"gives a number of an earlier trace in period {k}: {OUTSIDE}",
            )
        results.append(tuple(map(float, numbers)))
    return results


def _require_numbers(
    controller: Controller, instant: tuple[Tree, ...], command: Sequence[float]
) -> None:
    """Reject a first command that is not finite although its inputs are, or turns a
    rotor backwards that cannot.

    A speed above a rotor's largest one is a warning: a law may start far from its
    reference.
    """
    if not all(map(math.isfinite, leaves(instant))):
        return
    fields = [
        f"{name}[{i}]"
        for name, count in _counts(controller).items()
        for i in range(count)
    ]
    # angles may be left out
    for field, value in zip(fields, command, strict=False):
        if not math.isfinite(value):
            raise wrong(
                controller,
                f"gives {field} = {value} in its first period: must be a finite number",
            )
    rotors = controller.par.model.vehicle.rotors
    speeds = command[: len(rotors)]
    try:
        require_speeds(rotors, speeds, "rotor_speeds")
    except ValueError as error:
        fault = wrong(controller, f"gives {error}, in its first period")
        if any(
            speed < rotor.min_speed for speed, rotor in zip(speeds, rotors, strict=True)
        ):
            raise fault from None
        warnings.warn(
            f"{fault}; a flight clips it and counts it as saturation", stacklevel=2
        )


def perturb(record: Measurement, k: int) -> Measurement:
    """Test measurement with every number slightly changed in period ``k`` > 0,
    unchanged in period 0.
    """
    start = [float(leaf) for leaf in leaves(record)]
    if k == 0:
        return rebuild(record, start)
    # a sine and no draw, so that the verdict on a law is the same at each trial; every
    # number moves by another amount, so that differences do not hide what is read.
    # 1e-3 is chosen, far inside of what a law takes for a jump
    moved = [
        x + 1e-3 * (1.0 + 0.01 * abs(x)) * math.sin(0.7 * i + 0.9 * k)
        for i, x in enumerate(start)
    ]
    perturbed = rebuild(record, moved)
    # four moved numbers are no attitude: laws count on unit length
    return replace(perturbed, quaternion=perturbed.quaternion.normalized())


def level(blank: Measurement, gravity: float) -> Measurement:
    """Measurement at rest with a level base; gravity in m/s^2."""
    return replace(blank, specific_force=Vec3(0.0, 0.0, gravity))
