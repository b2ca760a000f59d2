"""Air, forces, drives, sensors, estimators and endings that are wrong: one line with
file and line, before they fly.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Vec3
from skyarm.dynamics.actuators.drive import Drive
from skyarm.scenario.scenario_file import load_scenario
from skyarm.scenario.scenario_record import JointDrive, NamedSensor
from skyarm.sensing.estimate.estimator import Estimator
from skyarm.sensing.sensor import Sensor
from skyarm.simulate import examine, run
from skyarm.simulate.batch import Batch
from skyarm.simulate.examine import require_shapes
from skyarm.world import Air, Force, Wrench
from support.components import Blend, Ceiling, Fix, Lag, Servo, Tether, Turbulence

BASE = load_scenario("case1", duration=0.25)


@dataclass(frozen=True, kw_only=True)
class Counting(Air):
    def start(self, period: float, draws: Any) -> Any:
        return (0,)

    def advance(self, memory: Any, t: Any, dt: float, state: Any, draws: Any) -> Any:
        return (memory[0] + 1,)


@dataclass(frozen=True, kw_only=True)
class Drawing(Air):
    uniforms = 2

    def start(self, period: float, draws: Any) -> Any:
        return (draws[4],)  # twice as many


@dataclass(frozen=True, kw_only=True)
class Growing(Air):
    def start(self, period: float, draws: Any) -> Any:
        return (0.0,)

    def advance(self, memory: Any, t: Any, dt: float, state: Any, draws: Any) -> Any:
        return (*memory, t)


@dataclass(frozen=True, kw_only=True)
class Tuple(Air):
    def velocity(self, memory: Any, t: Any, position_W: Vec3) -> Any:
        return (1.0, 0.0, 0.0)


@dataclass(frozen=True, kw_only=True)
class Alone(Force):
    def wrenches(self, memory: Any, t: Any, motion: Any, rotor_speeds: Any) -> Any:
        return Wrench(force_W=Vec3(0.1, 0.0, 0.0))


@dataclass(frozen=True, kw_only=True)
class Placed(Force):
    body: int = 0

    def wrenches(self, memory: Any, t: Any, motion: Any, rotor_speeds: Any) -> Any:
        return [Wrench(), Wrench(force_W=Vec3(0.1, 0.0, 0.0), body=self.body)]


@dataclass(frozen=True, kw_only=True)
class Branching(Force):
    def wrenches(self, memory: Any, t: Any, motion: Any, rotor_speeds: Any) -> Any:
        if motion.position(Vec3(0.0, 0.0, 0.0)).z < 0.5:  # here
            return ()
        return ()


@dataclass(frozen=True, kw_only=True)
class Nothing(Drive):
    def effort(self, memory: Any, setpoint: Any, position: Any, rate: Any) -> Any:
        return None


@dataclass(frozen=True, kw_only=True)
class Sine(Drive):
    def effort(self, memory: Any, setpoint: Any, position: Any, rate: Any) -> Any:
        return np.sin(position)  # here too


@dataclass(frozen=True, kw_only=True)
class ReadingOnly(Sensor):
    def measure(
        self,
        memory: Any,
        t: Any,
        state: Any,
        specific_force: Vec3,
        draws: Any,
        dt: float,
    ) -> Any:
        return tuple(state.position)


@dataclass(frozen=True, kw_only=True)
class Satellites(Estimator):
    def step(self, memory: Any, readings: Any, command: Any, dt: float) -> Any:
        read = readings["gps"]  # here reads
        return memory, read


@dataclass(frozen=True, kw_only=True)
class MeasurementOnly(Estimator):
    def step(self, memory: Any, readings: Any, command: Any, dt: float) -> Any:
        return readings["state"]


FIX = Fix(rate=50.0, sigma=0.01)


def with_(**fields: Any) -> Any:
    return dataclasses.replace(BASE, **fields)


def drive(record: Any) -> Any:
    return with_(drives=(JointDrive(joint="joint2", drive=record),))


WRONG: dict[str, tuple[Any, str, Any]] = {
    "int": (
        with_(air=(Counting(),)),
        (
            "environment.air[0] (Counting) has memory[0] = 0: an int never changes in a"
            " program; must be 0.0"
        ),
        Counting.advance,
    ),
    "draws": (
        with_(air=(Drawing(),)),
        (
            "environment.air[0] (Drawing) cannot start from 4 draws, which are twice"
            " its uniforms: list index out of range"
        ),
        "# twice as many",
    ),
    "grows": (
        with_(air=(Tether(), Growing())),
        (
            "environment.air[1] (Growing) changes the structure of its memory: "
            "memory is a tuple of 2, must stay a tuple of 1"
        ),
        Growing.advance,
    ),
    "tuple": (
        with_(air=(Tuple(),)),
        (
            "environment.air[0] (Tuple.velocity) gives the velocity of the air as a"
            " tuple of 3: must be a Vec3"
        ),
        Tuple.velocity,
    ),
    "alone": (
        with_(forces=(Alone(),)),
        (
            "environment.forces[0] (Alone.wrenches) gives wrenches as a Wrench: must be"
            " a list of Wrench"
        ),
        Alone.wrenches,
    ),
    "body": (
        with_(forces=(Placed(body=2),)),
        (
            "environment.forces[0] (Placed.wrenches) gives a wrench on body 2: must "
            "be -1 (base) or a link from 0 to 1"
        ),
        Placed.wrenches,
    ),
    "below": (
        with_(forces=(Tether(), Placed(body=-2))),
        (
            "environment.forces[1] (Placed.wrenches) gives a wrench on "
            "body -2: must be -1 (base) or a link from 0 to 1"
        ),
        Placed.wrenches,
    ),
    "branch": (
        with_(forces=(Branching(),)),
        (
            "environment.forces[0] (Branching) cannot be traced: branch on a traced "
            "value; use skyarm.algebra.scalars.where(condition, a, b)"
        ),
        "# here",
    ),
    "nothing": (
        drive(Nothing()),
        (
            "plant.drives.joint2 (Nothing.effort) gives an effort that is None: must be"
            " a number"
        ),
        Nothing.effort,
    ),
    "numpy": (
        drive(Sine()),
        (
            "plant.drives.joint2 (Sine) cannot be traced: operand a traced number does"
            " not support ufuncs (__array_ufunc__=None); must use + - * / and the"
            " functions of skyarm.algebra.scalars"
        ),
        "# here too",
    ),
    "reading": (
        with_(sensors=(NamedSensor(name="gps", sensor=ReadingOnly()),)),
        "sensors.gps (ReadingOnly) returns a tuple of 3: must return (memory, reading)",
        ReadingOnly.measure,
    ),
    "measurement": (
        with_(estimator=MeasurementOnly()),
        (
            "estimator (MeasurementOnly) returns a Measurement: must "
            "return (memory, Measurement)"
        ),
        MeasurementOnly.step,
    ),
    "no sensors": (
        with_(estimator=Satellites()),
        (
            "estimator (Satellites) reads sensor 'gps', which the scenario "
            "lacks: there is state"
        ),
        "# here reads",
    ),
    "other sensors": (
        with_(estimator=Satellites(), sensors=(NamedSensor(name="fix", sensor=FIX),)),
        (
            "estimator (Satellites) reads sensor 'gps', which the scenario lacks: there"
            " are state, fix"
        ),
        "# here reads",
    ),
}


def line_of(place: Any) -> int:
    if not isinstance(place, str):
        return int(place.__code__.co_firstlineno)
    lines = Path(__file__).read_text("utf-8").splitlines()
    return next(k for k, line in enumerate(lines, 1) if line.endswith(place))


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_component_is_one_line_with_file_and_line(name):
    scenario, words, place = WRONG[name]
    for check in (require_shapes, run):
        with pytest.raises(ValueError, match="test_wrong_components") as caught:
            check(scenario)
        assert str(caught.value) == f"{__file__}:{line_of(place)}: {words}"


@pytest.mark.parametrize("plane", ["mujoco", "session", "batch"])
def test_whatever_flies_it_says_so(plane):
    scenario, words, _ = WRONG["grows"]
    fly = {
        "mujoco": lambda: run(dataclasses.replace(scenario, kind="mujoco")),
        "session": lambda: skyarm.Session(scenario),
        "batch": lambda: Batch(scenario),
    }
    with pytest.raises(ValueError, match="Growing") as caught:
        fly[plane]()
    assert str(caught.value).endswith(words)


def test_what_is_right_passes_the_check_and_flies():
    scenario = with_(
        air=(Turbulence(),),
        forces=(Tether(),),
        sensors=(NamedSensor(name="fix", sensor=Fix(rate=50.0, sigma=0.01)),),
        estimator=Blend(),
        drives=(
            JointDrive(joint="joint1", drive=Lag()),
            JointDrive(joint="joint2", drive=Servo()),
        ),
        endings=(Ceiling(height=5.0),),
    )
    tried = [part.place for part in examine._parts(scenario)]
    assert tried == [
        *(
            "environment.air[0]",
            "environment.forces[0]",
            "plant.drives.joint1",
            "plant.drives.joint2",
        ),
        *("sensors.fix", "estimator", "endings[0]"),
    ]
    assert run(scenario).time.size == 50


@pytest.mark.parametrize("body", [-1, 0, 1])
def test_every_body_of_the_vehicle_may_be_pushed(body):
    assert run(with_(forces=(Placed(body=body),), duration=0.02)).time.size == 4


def test_what_ships_is_not_checked():
    assert list(examine._parts(load_scenario("case3_wind"))) == []
