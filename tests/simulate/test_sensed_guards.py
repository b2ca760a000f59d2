"""Phases that wait for what sensors say: the force at the wrist, a switch in the
fingertip.
"""

from __future__ import annotations

import copy
import dataclasses
import math
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Quaternion, Vec3
from skyarm.reference.reference_tables import reference_from
from skyarm.reference.signals import Constant
from skyarm.reference.task_records import Guard, Phase, Setting
from skyarm.reference.trajectory import Trajectory
from skyarm.scenario.scenario_record import ScenarioError
from skyarm.sensing.measurement import blank_measurement
from skyarm.simulate.reference_clock import GuardInputs, Waits
from support.cases import sampled
from support.engines import ENGINES, evaluate

OUT = (-0.6, 0.0, 0.8)
GUARDS = (
    Guard(at=0.1, force=0.5, direction=OUT, hold=0.0, sensed=True),
    Guard(at=0.2, phase=1, force=0.5, direction=OUT, hold=0.0),
    Guard(
        at=0.3,
        phase=2,
        force_below=0.2,
        direction=OUT,
        hold=0.0,
        sensed=True,
        closed="b",
    ),
    Guard(at=0.4, phase=3, open="b", hold=0.0),
    Guard(at=0.5, phase=4, closed="a", open="b", hold=0.0),
)
WRIST, SWITCH = {"kind": "force_torque"}, {"kind": "tactile_switch"}
PAGE = Path(__file__).resolve().parents[2] / "docs" / "phases.md"


def document(until, **sensors):
    (text,) = re.findall(
        r'```toml title="touch.toml"\n(.*?)```', PAGE.read_text("utf-8"), re.DOTALL
    )
    found = copy.deepcopy(tomllib.loads(text))
    found["reference"]["tip"]["path"]["phases"][0]["until"] = until
    return found | ({"sensors": sensors} if sensors else {})


def waits_of(guards):
    base = skyarm.scenario_from(
        document({"error": 1.0}, wrist=WRIST, a=SWITCH, b=SWITCH)
    )
    phases = tuple(Phase(name="p", end=guard.at) for guard in guards)
    way = Trajectory(
        z=Constant(1.0), joints=base.reference.joints, guards=guards, phases=phases
    )
    return Waits(dataclasses.replace(base, reference=way))


WAITS = waits_of(GUARDS)
CASES = [
    (n, felt, observed, a, b)
    for n in range(len(GUARDS))
    for felt, observed in ((0.4, 0.6), (0.6, 0.4), (0.1, 0.1))
    for a in (0.0, 1.0)
    for b in (0.0, 1.0)
]


def passed(row):
    """Number of the guard one period later; it stands at the end of what it guards."""
    n, felt, observed, a, b = row
    clock = dataclasses.replace(
        WAITS.first(), place=WAITS.terms(n).end, guard=n, waited=1.0
    )
    tip = Vec3(0.0, 0.0, 1.0)
    switches = tuple({"a": a, "b": b}[name] for name in WAITS.switches)
    seen = GuardInputs(
        tip=tip,
        goal=tip,
        push=(),
        force=Vec3(*OUT) * observed,
        felt=Vec3(*OUT) * felt,
        switches=switches,
    )
    return [WAITS.following(clock, 0.0, seen).guard]


@pytest.mark.parametrize("engine", sampled(ENGINES, 3))
def test_each_guard_hears_its_own_sensors(engine):
    wanted = [
        {
            0: felt >= 0.5,
            1: observed >= 0.5,
            2: felt <= 0.2 and b > 0.5,
            3: b < 0.5,
            4: a > 0.5 and b < 0.5,
        }[n]
        for n, felt, observed, a, b in CASES
    ]
    found = evaluate(
        engine, lambda *row: passed(row), [[float(c) for c in row] for row in CASES]
    )
    assert [row[0] - case[0] for row, case in zip(found, CASES, strict=True)] == [
        float(each) for each in wanted
    ]


UNMET = {
    "error": 0.01,
    "force": 2.0,
    "force_below": 0.5,
    "distance": 0.3,
    "closed": "a",
    "open": "b",
}
"""Conditions of a guard that do not hold 2 cm off the goal under 1 N, on the spot, with
``a`` open and ``b`` closed."""
CONDITIONS = [
    each.name for each in dataclasses.fields(Guard) if each.default is None
] + ["closed", "open"]


@pytest.mark.parametrize("name", CONDITIONS)
def test_every_condition_that_a_guard_may_have_is_evaluated(name):
    """A condition that ``Waits`` forgot would hold at once, and its phase would end."""
    waits, spot = waits_of(GUARDS), Vec3(0.0, 0.0, 1.0)
    force = Vec3(*OUT)
    closed = tuple(float(each == "b") for each in waits.switches)
    seen = GuardInputs(
        tip=spot,
        goal=spot + Vec3(0.02, 0.0, 0.0),
        push=(),
        force=force,
        felt=force,
        switches=closed,
    )
    guard = Guard(at=0.1, direction=OUT)
    assert waits._holds(guard, seen, tuple(spot)) == 1.0
    assert (
        waits._holds(
            dataclasses.replace(guard, **{name: UNMET[name]}), seen, tuple(spot)
        )
        == 0.0
    )


def test_what_the_wrist_reads_is_turned_into_the_world():
    waits = waits_of(GUARDS[:1])
    turned = Quaternion(math.cos(0.4), 0.0, math.sin(0.4), 0.0)
    told = dataclasses.replace(
        blank_measurement(2, 4),
        quaternion=turned,
        joints=(0.3, -0.5),
        tip_force=(1.0, 2.0, 3.0),
    )
    reference = waits._trajectory.at(0.0)
    # base and both joints turn about the same axis, y
    angle = 0.8 + 0.3 - 0.5
    c, s = math.cos(angle), math.sin(angle)
    found = waits.guard_inputs(told, reference, None).felt
    assert np.linalg.norm([*found]) == pytest.approx(math.sqrt(14.0))
    assert found.y == pytest.approx(2.0)
    frame = (
        skyarm.load_vehicle("hummingbird_arm2")
        .frame()
        .rotation.apply(Vec3(1.0, 2.0, 3.0))
    )
    assert [found.x, found.z] == pytest.approx(
        [c * frame.x + s * frame.z, c * frame.z - s * frame.x]
    )


@pytest.mark.parametrize(
    ("until", "sensors", "words"),
    [
        (
            {"closed": "fingertop"},
            {"fingertip": SWITCH},
            "phase 0 'press': until.closed = 'fingertop': did you mean",
        ),
        (
            {"open": "wrist"},
            {"wrist": WRIST},
            "until.open = 'wrist': must be the name of a sensor of kind 'tactile_s",
        ),
        (
            {"force": 1.0, "force_sensor": True},
            {},
            "until.force_sensor = true: must be false without a sensor of kind",
        ),
        (
            {"error": 1.0, "force_sensor": True},
            {"wrist": WRIST},
            "until.force_sensor = true: must be left out without",
        ),
        (
            {"force": 1.0, "force_sensor": 1},
            {},
            "until.force_sensor = 1: must be true or false",
        ),
        ({"closed": ""}, {}, "until.closed = '': must be the name of a tactile switch"),
        ({"closed": ["fingertip"]}, {}, "must be the name of a tactile switch"),
        (
            {"hold": 1.0},
            {},
            "must have one of error, force, force_below, distance, closed, open",
        ),
    ],
)
def test_sensors_that_are_not_there_get_one_line(until, sensors, words):
    with pytest.raises(ScenarioError, match=r"phase") as caught:
        skyarm.scenario_from(document(until, **sensors))
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_tables_of_phases_md_are_those_of_a_switch_and_of_a_handle():
    switch, handle = (
        tomllib.loads(text)
        for text in re.findall(r"```toml\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)
    )
    (press,) = switch["reference"]["tip"]["path"]["phases"]
    found = skyarm.scenario_from(document(press["until"], **switch["sensors"]))
    assert [(guard.closed, guard.fails) for guard in found.reference.guards] == [
        ("fingertip", True)
    ]
    path = {
        "kind": "phases",
        "position": [0.6, 0.0, 1.27],
        **handle["reference"]["tip"]["path"],
    }
    push = reference_from({"base": path}, 0, "reference", Setting(duration=20.0)).push
    assert [push.at(t)[5] for t in (0.49, 0.51, 9.49, 9.51)] == [0.0, 1.0, 1.0, 0.0]
    assert push.at(1.0)[6:] == (0.665, -0.8, 1.27, 0.0, 0.0, 1.0)


@pytest.mark.thorough
@pytest.mark.parametrize("plant", ["rigid_body", "mujoco"])
@pytest.mark.parametrize(
    "until", [{"force": 0.5, "force_sensor": True}, {"closed": "fingertip"}]
)
def test_a_press_waits_for_its_sensor(plant, until):
    told = document(
        until | {"hold": 0.1, "timeout": 2.0, "on_timeout": "fail"},
        wrist=WRIST,
        fingertip=SWITCH,
    )
    told["plant"]["kind"] = plant
    scenario = skyarm.scenario_from(told)
    log = skyarm.run(scenario)
    touch = log.time[log.contact_force.sum(axis=1) > 0.0][0]
    (_, pressed), _ = log.phase_ends
    assert log.status == "completed"
    assert 0.6 <= pressed - touch < 0.9, (
        "0.1 s of it, 0.5 s of pressing, and what bounced"
    )
    far = copy.deepcopy(told)
    far["world"]["surfaces"][0]["position"][0] = 1.0
    away = skyarm.run(skyarm.scenario_from(far))
    words = (
        "switch 'fingertip' not closed" if "closed" in until else "no contact of 0.5 N"
    )
    assert (away.status, away.info["cause"]) == (
        "phase_failed",
        f"phase 0 'press': {words} within 2 s",
    )
