"""A flight that a number ends which is not finite: its cause names the user's file,
line and method that gave it.
"""

from __future__ import annotations

import dataclasses
import math
import sys
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from skyarm.algebra import Vec3
from skyarm.algebra.scalars import divide, log, maximum, sqrt, where
from skyarm.dynamics.actuators import Command
from skyarm.records.files.user_code import first_not_finite
from skyarm.scenario.scenario_file import scenario_from
from skyarm.scenario.scenario_record import JointDrive, NamedSensor
from skyarm.simulate import run
from skyarm.simulate.loop import run_in_python
from skyarm.simulate.session import Session
from support.components import Blend, Fix, Lag, SteadyWrench, Turbulence, with_law
from support.flights import document

BASE = scenario_from(document("case1", duration=0.05))
LINES = Path(__file__).read_text("utf-8").splitlines()


def line_with(mark: str) -> int:
    """Number of the only line with a comment."""
    (found,) = [
        number for number, line in enumerate(LINES, 1) if line.endswith(f"  # {mark}")
    ]
    return found


def reciprocal(value: Any) -> Any:
    return divide(1.0, value)


@dataclass(frozen=True, kw_only=True)
class Masked(SteadyWrench):
    """A force with an infinite number on the way to a finite one."""

    def wrenches(self, memory: Any, t: Any, motion: Any, rotor_speeds: Any) -> Any:
        size = where(t < 99.0, 0.0, reciprocal(t - t))
        return (
            dataclasses.replace(
                super().wrenches(memory, t, motion, rotor_speeds)[0],
                force_W=Vec3(0, 0, size),
            ),
        )


@dataclass(frozen=True, kw_only=True)
class Undefined(SteadyWrench):
    until: float = math.inf

    def wrenches(self, memory: Any, t: Any, motion: Any, rotor_speeds: Any) -> Any:
        masked = where(t > 99.0, 1.0 / (t - t), 0.0)  # infinite, and meant so
        size = masked + sqrt(0.0125 - t)  # in a force
        return (
            dataclasses.replace(
                super().wrenches(memory, t, motion, rotor_speeds)[0],
                force_W=Vec3(0, 0, size),
            ),
        )


@dataclass(frozen=True, kw_only=True)
class Late(Turbulence):
    """A memory that is NaN three periods before the air that it moves."""

    def start(self, period: float, draws: Any) -> Any:
        return (0.0, 0.0)

    def advance(self, memory: Any, t: Any, dt: float, state: Any, draws: Any) -> Any:
        count, total = memory
        return (count + 1.0, total + sqrt(3.5 - count))  # in air

    def velocity(self, memory: Any, t: Any, position_W: Vec3) -> Vec3:
        return Vec3(where(t > 0.03, memory[1], 0.0), 0.0, 0.0)


@dataclass(frozen=True, kw_only=True)
class Blind(Fix):
    def measure(
        self,
        memory: Any,
        t: Any,
        state: Any,
        specific_force: Vec3,
        draws: Any,
        dt: float,
    ) -> Any:
        count, reading = super().measure(memory, t, state, specific_force, draws, dt)
        return count, (*reading[:2], log(-1.0 - t), *reading[3:])  # in a sensor


@dataclass(frozen=True, kw_only=True)
class Torn(Lag):
    def effort(self, memory: Any, setpoint: Any, position: Any, rate: Any) -> Any:
        slope = setpoint * 0.0 / (rate - rate)  # in a drive
        return memory[0] + slope


def pole(value: Any) -> Any:
    return 5.0 / maximum(value, 0.0)  # in a law


def law(memory: Any, seen: Any, wanted: Any, dt: Any, *, par: Any) -> Any:
    return memory, Command(
        rotor_speeds=(pole(0.0125 - seen.time),) * 4, efforts=(0.0, 0.0)
    )


def sensed(sensor: Any) -> Any:
    return dataclasses.replace(
        BASE, sensors=(NamedSensor(name="fix", sensor=sensor),), estimator=Blend()
    )


FLIGHTS = {
    "a force": (
        dataclasses.replace(BASE, forces=(Masked(), Undefined())),
        "Undefined.wrenches): size is nan",
    ),
    "air": (dataclasses.replace(BASE, air=(Late(),)), "Late.advance)"),
    "a sensor": (sensed(Blind()), "Blind.measure)"),
    "a drive": (
        dataclasses.replace(BASE, drives=(JointDrive(joint="joint1", drive=Torn()),)),
        "Torn.effort): slope is nan",
    ),
    "a law": (with_law(BASE, law, memory=()), "pole): float division by zero"),
}


def require_line(part: str, fly: Any) -> None:
    scenario, words = FLIGHTS[part]
    flown, debugger = fly(scenario), sys.gettrace()
    assert flown.status == "diverged"
    place = f"{Path(__file__).name}:{line_with(f'in {part}')}"
    assert flown.info["cause"].endswith(f"is not finite; first in {place} ({words}")
    assert sys.gettrace() is debugger


@pytest.mark.parametrize(
    ("part", "fly"), [("a law", run), ("a force", run_in_python)], ids=["law", "force"]
)
def test_the_cause_names_file_line_and_method_of_the_part_that_gave_it(
    part: str, fly: Any
) -> None:
    require_line(part, fly)


@pytest.mark.thorough
@pytest.mark.parametrize("part", ["air", "a sensor", "a drive"])
def test_every_kind_of_part_is_named(part: str) -> None:
    require_line(part, run_in_python)


def test_nothing_is_named_where_a_command_from_outside_was_not_finite() -> None:
    session = Session(FLIGHTS["a law"][0], machine_code=False)
    # the law, which is not evaluated, would give NaN then, too
    for speed in (485.0, 485.0, 485.0, math.nan):
        session.step(Command(rotor_speeds=(speed,) * 4, efforts=(0.0, 0.0)))
    assert session.ended is not None
    assert session.ended.cause == "commanded speed of rotor 'front' is not finite"


def test_a_law_that_is_called_is_not_flown_again() -> None:
    calls = []

    def law(memory: Any, seen: Any, wanted: Any, dt: Any, *, par: Any) -> Any:
        calls.append(seen.time)  # as hardware would be commanded
        return memory, Command(
            rotor_speeds=(485.0 if len(calls) < 4 else math.nan,) * 4,
            efforts=(0.0, 0.0),
        )

    called = with_law(BASE, law, memory=())
    flown = run(
        dataclasses.replace(
            called, controller=dataclasses.replace(called.controller, compiled=False)
        )
    )
    assert flown.info["cause"] == "commanded speed of rotor 'front' is not finite"
    assert calls == sorted(set(calls))


def twice(value: Any) -> Any:
    return 2.0 * value  # in a function


def test_a_function_that_passes_on_what_it_was_given_is_not_named() -> None:
    assert (
        first_not_finite(partial(twice, math.nan))
        == first_not_finite(partial(twice, 1.0))
        == ""
    )
    assert (
        first_not_finite(partial(twice, 1e308))
        == f"{Path(__file__).name}:{line_with('in a function')} (twice)"
    )
