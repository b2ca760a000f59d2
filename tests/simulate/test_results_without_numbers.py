"""A part whose method gives text, nothing or another shape where a number belongs is
one line with file and method.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Vec3
from skyarm.dynamics.actuators.drive import Drive
from skyarm.log.metrics.metric import Metric
from skyarm.scenario.scenario_record import JointDrive, NamedSensor
from skyarm.sensing.estimate.estimator import Estimator
from skyarm.sensing.sensor import Sensor
from skyarm.simulate.check_endings import Ending
from skyarm.simulate.examine import require_shapes
from skyarm.world import Air, Force, Wrench
from support.cases import sampled
from support.components import registry_kept

BASE = skyarm.load_scenario("case1", duration=0.25)

GIVEN: Any = None
"""What the methods below give."""


@dataclass(frozen=True, kw_only=True)
class Blow(Air):
    def advance(self, memory: Any, t: Any, dt: float, state: Any, draws: Any) -> Any:
        return memory

    def velocity(self, memory: Any, t: Any, position_W: Vec3) -> Any:
        return Vec3(GIVEN, 0.0, 0.0)


@dataclass(frozen=True, kw_only=True)
class Push(Force):
    def advance(self, memory: Any, t: Any, dt: float, state: Any, draws: Any) -> Any:
        return memory

    def wrenches(self, memory: Any, t: Any, motion: Any, rotor_speeds: Any) -> Any:
        return [Wrench(), Wrench(torque_W=Vec3(0.0, GIVEN, 0.0))]


@dataclass(frozen=True, kw_only=True)
class Shown(Force):
    columns = (("shown", "", "N"),)

    def logged(self, memory: Any, motion: Any) -> Any:
        return (GIVEN,)


@dataclass(frozen=True, kw_only=True)
class Motor(Drive):
    def effort(self, memory: Any, setpoint: Any, position: Any, rate: Any) -> Any:
        return GIVEN


@dataclass(frozen=True, kw_only=True)
class Gauge(Sensor):
    def measure(
        self,
        memory: Any,
        t: Any,
        state: Any,
        specific_force: Vec3,
        draws: Any,
        dt: float,
    ) -> Any:
        return memory, (0.0, GIVEN)


@dataclass(frozen=True, kw_only=True)
class Guess(Estimator):
    def step(self, memory: Any, readings: Any, command: Any, dt: float) -> Any:
        return memory, dataclasses.replace(
            readings["state"], velocity=Vec3(0.0, 0.0, GIVEN)
        )


@dataclass(frozen=True, kw_only=True)
class Fence(Ending):
    status = "outside"

    def fine(self, scenario: Any, state: Any, goal: Any, slack: float) -> Any:
        return GIVEN

    def cause(self, scenario: Any, state: Any, goal: Any) -> str:
        return "outside"


PARTS: dict[str, tuple[Any, Callable[..., Any], str]] = {
    "air": (
        {"air": (Blow(),)},
        Blow.velocity,
        r"environment.air\[0\] \(Blow.velocity\) gives velocity.x",
    ),
    "force": (
        {"forces": (Push(),)},
        Push.wrenches,
        r"environment.forces\[0\] \(Push.wrenches\) gives wrenches\[1\].torque_W.y",
    ),
    "column": (
        {"forces": (Shown(),)},
        Shown.logged,
        r"environment.forces\[0\] \(Shown.logged\) gives logged\[0\]",
    ),
    "drive": (
        {"drives": (JointDrive(joint="joint2", drive=Motor()),)},
        Motor.effort,
        r"plant.drives.joint2 \(Motor.effort\) gives an effort that is",
    ),
    "sensor": (
        {"sensors": (NamedSensor(name="gauge", sensor=Gauge()),)},
        Gauge.measure,
        r"sensors.gauge \(Gauge.measure\) gives a reading\[1\]",
    ),
    "estimator": (
        {"estimator": Guess()},
        Guess.step,
        r"estimator \(Guess.step\) gives a measurement.velocity.z",
    ),
    "ending": (
        {"endings": (Fence(),)},
        Fence.fine,
        r"endings\[0\] \(Fence.fine\) gives fine",
    ),
}
VALUES = {
    "text": "5",
    "nothing": None,
    "complex": 1j,
    "list": [1.0, 2.0],
    "array": np.ones(2),
}


@pytest.mark.parametrize("value", sampled(list(VALUES), 5))
@pytest.mark.parametrize("name", PARTS)
def test_a_part_that_gives_no_number_is_one_line_with_its_method(
    monkeypatch, name: str, value: str
) -> None:
    fields, method, words = PARTS[name]
    monkeypatch.setitem(globals(), "GIVEN", VALUES[value])
    line = (
        rf"^{re.escape(__file__)}:{method.__code__.co_firstlineno}: {words}.*: must be"
        r" a number"
    )
    with pytest.raises(skyarm.ScenarioError, match=line) as error:
        require_shapes(dataclasses.replace(BASE, **fields))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("name", ["air", "force", "column", "ending"])
def test_a_tuple_in_place_of_a_number_is_one_line(monkeypatch, name: str) -> None:
    fields, method, _ = PARTS[name]
    monkeypatch.setitem(globals(), "GIVEN", (1.0,))
    with pytest.raises(
        skyarm.ScenarioError,
        match=rf":{method.__code__.co_firstlineno}: .*gives .*: must be ",
    ):
        require_shapes(dataclasses.replace(BASE, **fields))


@pytest.mark.parametrize("name", sampled(list(PARTS), 4))
def test_a_number_of_any_kind_passes(monkeypatch, name: str) -> None:
    for value in (0.5, np.float64(0.5), np.float32(0.5)):
        monkeypatch.setitem(globals(), "GIVEN", value)
        require_shapes(dataclasses.replace(BASE, **PARTS[name][0]))


@dataclass(frozen=True, kw_only=True)
class Count(Metric):
    def start(self) -> Any:
        return GIVEN[0]

    def count(self, memory: Any, now: Any) -> Any:
        return GIVEN[1]

    def result(self, memory: Any, instants: Any, period: float) -> Any:
        return GIVEN[2]


LOG = skyarm.run(dataclasses.replace(BASE, duration=0.02))


@pytest.mark.parametrize(
    ("given", "method", "words"),
    [
        ((("5",), (1.0,), 1.0), Count.start, "start[0] = '5': must be a number"),
        (((0.0,), ("5",), 1.0), Count.count, "count[0] = '5': must be a number"),
        (((0.0,), None, 1.0), Count.count, "count = None: must be a number"),
        (((0.0,), (1j,), 1.0), Count.count, "count[0] = 1j: must be a number"),
        (
            ((0.0,), np.ones(2), 1.0),
            Count.count,
            "count = array([1., 1.]): must be a number",
        ),
        (
            ((0.0,), (1.0, 1.0), 1.0),
            Count.count,
            "count = (1.0, 1.0): must be of 1 floats, as start",
        ),
        (
            ((0.0,), (1.0,), "5"),
            Count.result,
            "result = array('5', dtype='<U1'): must be one number a flight",
        ),
        (
            ((0.0,), (1.0,), None),
            Count.result,
            "result = array(None, dtype=object): must be one number a flight",
        ),
        (
            ((0.0,), (1.0,), 1j),
            Count.result,
            "result = array(0.+1.j): must be one number a flight",
        ),
        (
            ((0.0,), (1.0,), [1.0, 2.0]),
            Count.result,
            "result = array([1., 2.]): must be one number a flight",
        ),
    ],
)
def test_a_metric_that_gives_no_number_is_one_line_with_its_method(
    monkeypatch, given, method, words: str
) -> None:
    monkeypatch.setitem(globals(), "GIVEN", given)
    with registry_kept():
        skyarm.register.metric("own_count")(Count)
        with pytest.raises(ValueError) as error:  # noqa: PT011
            skyarm.score(LOG, ["own_count"])
    assert (
        str(error.value)
        == f"{__file__}:{method.__code__.co_firstlineno}: metric 'own_count': {words}"
    )
