"""Sensors of force: what pushes beyond a frame, in its axes; low pass, switch, and what
the law is told of it.
"""

from __future__ import annotations

import dataclasses
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Vec3
from skyarm.control.controller import ControllerError
from skyarm.control.onboard.export_c import export_c
from skyarm.dynamics.kinematics import Pose, frame_pose
from skyarm.dynamics.point_motion import PointMotion
from skyarm.plant.interface import Truth
from skyarm.records.coerce import RecordError
from skyarm.scenario.numbers import number_at
from skyarm.scenario.scenario_file import scenario_from
from skyarm.sensing.channel import Channel
from skyarm.sensing.sensor import NO_PUSH, Push
from skyarm.sensing.sensor_kinds import ForceTorque, TactileSwitch
from skyarm.simulate.loop import run_in_python
from skyarm.simulate.stages import Stages, beyond, push_at
from skyarm.world import Wrench
from support.one_vehicle import motion_of
from support.worlds import at_rest

FORCE, TORQUE, WEIGHT = np.array([0.3, -0.2, 0.5]), np.array([0.01, 0.0, -0.02]), 0.05
DOCUMENT = {
    "schema": 1,
    "name": "felt",
    "duration": 0.1,
    "plant": {"vehicle": "hummingbird_arm2_rotors"},
    "controller": {
        "law": "centroidal",
        "mode": "tip",
        "interaction": [0.3, 0.1],
        "force_sensor": True,
    },
    "reference": {"base": {"kind": "signals", "z": 1.0}, "joints": [-0.45, -0.9]},
    "environment": {
        "forces": [
            {
                "kind": "disturbance",
                "frame": "tip",
                "force": FORCE.tolist(),
                "torque": TORQUE.tolist(),
            },
            {"kind": "disturbance", "force": [5.0, 0.0, 0.0]},
        ]
    },
    "payloads": [{"mass": WEIGHT, "pick": 0.0, "com": [0.0, 0.02, 0.0]}],
    "sensors": {"wrist": {"kind": "force_torque"}},
}
ARM = skyarm.load_vehicle("hummingbird_arm2_rotors")


def pose_of(state):
    """R_WT of the true tip."""
    pose = Pose(state.quaternion.rotation(), state.position) @ frame_pose(
        ARM, ARM.frame(), state.joints
    )
    return np.array([[float(c) for c in row] for row in pose.R.rows])


@pytest.fixture(scope="module")
def scenario():
    return scenario_from(DOCUMENT)


def test_the_law_is_told_what_pushes_the_tip_in_its_axes():
    plain = scenario_from(
        {**DOCUMENT, "controller": {"preset": "paper_ct"}, "payloads": []}
    )
    for plant in ("rigid_body", "mujoco"):
        session = skyarm.Session(
            dataclasses.replace(plain, kind=plant), machine_code=False
        )
        for _ in range(2):
            session.step()
        told = np.array(session.measurement.tip_force, dtype=float)
        assert told == pytest.approx(pose_of(session.state).T @ FORCE, abs=1e-9)


HELD = {
    "rigid": {"payloads": [{"name": "p", "mass": 0.1, "pick": 0.0}]},
    "timed": {"payloads": [{"name": "p", "mass": 0.1, "pick": 0.5}]},
    "plant": {
        "plant": {"vehicle": "hummingbird_arm2_rotors", "payload": {"mass": 0.1}}
    },
    "hanging": {
        "payloads": [
            {"name": "p", "kind": "hanging", "mass": 0.1, "pick": 0.0, "cord": 0.3}
        ]
    },
}


@pytest.mark.parametrize("plant", ["rigid_body", "mujoco"])
@pytest.mark.parametrize("kind", HELD)
def test_every_kind_of_load_is_felt_as_its_mass_times_a_plus_g(kind, plant):
    """Accelerations of the load by differences of where the log has it; 0.1 kg moved at
    1 Hz in height.
    """
    sine = {"kind": "sine", "amplitude": 0.1, "frequency_hz": 1.0, "phase": 1.5707963}
    document = DOCUMENT | {
        "duration": 1.9,
        "environment": {"ground": False},
        "payloads": [],
        "controller": {"preset": "centroidal_joint"},
        "reference": {
            "base": {"kind": "signals", "z": [2.0, sine], "x": 0.1},
            "joints": [sine, -0.4],
        },
        "initial": {"position": [0.1, 0.0, 2.1], "joints": [0.1, -0.4]},
    }
    log = skyarm.run(
        dataclasses.replace(scenario_from(document | HELD[kind]), kind=plant)
    )
    at = (
        log.component("payload_position").reshape(-1, 3)
        if kind == "hanging"
        else log.tip
    )
    second = np.diff(at, n=2, axis=0) / 0.005**2
    right = 0.1 * np.linalg.norm(second + np.array([0.0, 0.0, 9.81]), axis=1)
    felt = np.linalg.norm(log.readings["wrist"]["force"], axis=1)[1:-1]
    flown = log.time[1:-1] > 0.8
    assert np.ptp(right[flown]) > 0.3
    # differences, and commands that change in between; a cord pulls by the mean of the
    # period
    tolerance = 0.06 if kind == "hanging" else 0.02
    assert felt[flown] == pytest.approx(right[flown], abs=tolerance)


def test_forces_and_torques_are_those_about_the_frame(scenario):
    state = skyarm.Session(scenario, machine_code=False).state
    stages = Stages(scenario)
    memories = [c.start(0.005, (0.5,) * 2 * c.uniforms) for c in scenario.components]
    memories[-1] = dataclasses.replace(memories[-1], held=1.0)
    around = stages.together([memories], (), [()], 0.0).of(0)
    R = pose_of(state)
    motion = motion_of(Truth(vehicle=ARM, gravity=9.81), state, around)
    load = Wrench(
        force_W=Vec3(0.0, 0.0, -WEIGHT * 9.81),
        point=ARM.frame().position + Vec3(0.0, 0.02, 0.0),
        body=1,
    )
    felt = push_at(ARM.frame(), around, motion, (load,))
    weight = np.array([0.0, 0.0, -WEIGHT * 9.81])
    assert [*felt.force] == pytest.approx(R.T @ (FORCE + weight))
    assert [*felt.torque] == pytest.approx(
        R.T @ TORQUE + np.cross([0.0, 0.02, 0.0], R.T @ weight)
    )
    elbow = dataclasses.replace(ARM.frame(), link=0, position=Vec3(0.0, 0.0, 0.0))
    first = Pose(state.quaternion.rotation(), state.position) @ frame_pose(
        ARM, elbow, state.joints
    )
    whole = Pose(state.quaternion.rotation(), state.position) @ frame_pose(
        ARM, ARM.frame(), state.joints
    )
    lever = np.array([*(whole.p - first.p)], dtype=float)
    place = R @ [0.0, 0.02, 0.0] + lever
    about = np.cross(lever, FORCE) + TORQUE + np.cross(place, weight)
    turned = np.array([[float(c) for c in row] for row in first.R.rows])
    assert [*push_at(elbow, around, motion, (load,)).torque] == pytest.approx(
        turned.T @ about
    )
    # a payload that the elbow holds is none of the tip's
    there = (dataclasses.replace(load, body=0),)
    tip, upper = (
        push_at(at, around, motion, there).force for at in (ARM.frame(), elbow)
    )
    assert [*tip] == pytest.approx(R.T @ FORCE)
    assert [*upper] == pytest.approx(turned.T @ (FORCE + weight))


def test_a_sensor_feels_what_is_beyond_it():
    assert beyond(ARM, 1) == {1}
    assert beyond(ARM, 0) == {0, 1}
    assert beyond(ARM, -1) == {-1, 0, 1}
    # what moves with a joint is beyond its link, whatever tree the links are
    for vehicle in (
        skyarm.load_vehicle("hexarotor_arm6"),
        skyarm.load_vehicle("octo_coaxial_two_arms"),
    ):
        still = at_rest(vehicle, (0.0, 0.0, 0.0), (0.1,) * vehicle.n)
        off, links = Vec3(0.01, 0.02, 0.03), range(vehicle.n)
        for i in links:
            turned = dataclasses.replace(
                still, joints=tuple(0.1 + 0.5 * (j == i) for j in links)
            )
            before, after = (
                [PointMotion(vehicle, s).position(off, j) for j in links]
                for s in (still, turned)
            )
            moved = {
                j for j in links if np.linalg.norm([*(before[j] - after[j])]) > 1e-4
            }
            assert beyond(vehicle, i) == moved


def felt(sensor, forces, dt=0.005, draws=None):
    memory, found = sensor.start(ARM), []
    for force in forces:
        push = Push(force=Vec3(force, 0.0, 0.0), torque=Vec3(0.0, 2.0 * force, 0.0))
        memory, reading = sensor.feel(
            memory, 0.0, push, draws or [0.5] * sensor.uniforms(ARM), dt
        )
        found.append(reading)
    return found


def test_the_low_pass_begins_where_the_first_reading_is():
    plain = felt(ForceTorque(), [1.0, 3.0])
    assert [(r.force.x, r.torque.y) for r in plain] == [(1.0, 2.0), (3.0, 6.0)]
    slow = felt(ForceTorque(bandwidth=60.0), [1.0, 3.0, 3.0])
    left = np.exp(-60.0 * 0.005)
    assert [r.force.x for r in slow] == pytest.approx(
        [1.0, 3.0 - 2.0 * left, 3.0 - 2.0 * left**2]
    )
    assert [r.torque.y for r in slow] == pytest.approx(
        [2.0, 6.0 - 4.0 * left, 6.0 - 4.0 * left**2]
    )


def test_errors_are_those_of_channels():
    biased = ForceTorque(
        force=Channel(bias=(0.1, 0.0, 0.0), sigma=0.05), torque=Channel(scale=0.1)
    )
    assert biased.uniforms(ARM) == 4
    reading = felt(biased, [1.0], draws=[0.5, 0.1, 0.5, 0.1])[0]
    assert reading.force.x != 1.1
    assert reading.force.x == pytest.approx(1.1, abs=0.2)
    assert reading.torque.y == pytest.approx(2.2)


def test_a_switch_closes_above_one_force_and_opens_below_another():
    found = felt(TactileSwitch(on=0.5, off=0.25), [0.0, 0.4, 0.6, 0.4, 0.3, 0.2, 0.4])
    assert [r.closed for r in found] == [0.0, 0.0, 1.0, 1.0, 1.0, 0.0, 0.0]
    late = felt(TactileSwitch(on=0.5, off=0.25, bandwidth=20.0), [0.0, 0.6, 0.6, 0.6])
    assert [r.closed for r in late] == [0.0, 0.0, 0.0, 0.0]
    # 1 - exp(-20 t) of 1 N is 0.5 N at 35 ms
    slow = felt(TactileSwitch(on=0.5, off=0.25, bandwidth=20.0), [0.0, *[1.0] * 8])
    assert [r.closed for r in slow] == [0.0] * 7 + [1.0] * 2
    for on, off in ((0.5, 0.25), (0.5, 0.5)):  # at the thresholds it stays as it is
        at = felt(TactileSwitch(on=on, off=off), [on, 0.6, on, off, 0.2, on])
        assert [r.closed for r in at] == [0.0, 1.0, 1.0, 1.0, 0.0, 0.0]
    for wrong in ({"on": 0.1}, {"off": 0.6}, {"on": -1.0}, {"bandwidth": float("nan")}):
        with pytest.raises(
            RecordError, match=next(iter(wrong)) if "on" not in wrong else "o"
        ):
            TactileSwitch(**wrong)


def test_every_engine_tells_the_same_and_numbers_have_paths(scenario):
    noisy = scenario_from(
        DOCUMENT
        | {
            "sensors": {
                "wrist": {
                    "kind": "force_torque",
                    "force": {"sigma": 0.05},
                    "bandwidth": 200.0,
                    "latency": 0.01,
                }
            }
        }
    )
    assert number_at(noisy, "sensors.wrist.force.sigma") == 0.05
    noisy = dataclasses.replace(noisy, duration=0.03)
    log = skyarm.run(noisy)
    assert np.array_equal(log.efforts, run_in_python(noisy).efforts)
    switch = scenario_from(
        DOCUMENT
        | {
            "controller": {"preset": "paper_ct"},
            "sensors": {"tip": {"kind": "tactile_switch"}},
        }
    )
    session = skyarm.Session(switch, machine_code=False)
    session.step()
    assert session.measurement.tip_force == ()


def test_where_nothing_can_push_the_sensors_feel_nothing():
    kept = {key: DOCUMENT[key] for key in ("schema", "name", "plant", "reference")}
    sensors = {
        "wrist": {"kind": "force_torque"},
        "finger": {"kind": "tactile_switch", "bandwidth": 200.0},
    }
    free = scenario_from(
        kept
        | {
            "duration": 0.01,
            "controller": {"preset": "paper_ct"},
            "sensors": sensors,
        }
    )
    memories = [c.start(0.005, (0.5,) * 2 * c.uniforms) for c in free.components]
    around = Stages(free).together([memories], (), [()], 0.0).of(0)
    state = skyarm.Session(free, machine_code=False).state
    push = push_at(
        ARM.frame(), around, motion_of(Truth(vehicle=ARM, gravity=9.81), state, around)
    )
    assert push == NO_PUSH
    assert {type(each) for each in (*push.force, *push.torque)} == {float}
    assert skyarm.run(free).status == "completed"


def test_the_sensor_on_the_page_is_one():
    # its toml without a title
    page = Path(__file__).resolve().parents[2] / "docs" / "sensors.md"
    (text,) = re.findall(r"```toml\n(.*?)```", page.read_text("utf-8"), re.DOTALL)
    found = scenario_from(DOCUMENT | tomllib.loads(text)).sensors[0].sensor
    assert found == ForceTorque(force=Channel(sigma=0.05, turn_on=0.1), bandwidth=600.0)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            {"sensors": {}},
            (
                r"controller\.force_sensor = true: must be false without a sensor of"
                r" kind 'force_torque'"
            ),
        ),
        (
            {"sensors": {"wrist": {"kind": "force_torque", "frame": "elbow"}}},
            r"sensors\.wrist\.frame = 'elbow': .*no frame 'elbow'",
        ),
        (
            {"sensors": {"wrist": {"kind": "force_torque", "bandwidth": -1}}},
            r"bandwidth = -1",
        ),
        (
            {"sensors": {"wrist": {"kind": "force_torque", "force": {"sigma": "x"}}}},
            r"sigma",
        ),
        (
            {"controller": {"law": "centroidal", "mode": "tip", "force_sensor": True}},
            r"must be false without interaction",
        ),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(change, words):
    with pytest.raises((ValueError, ControllerError), match=words) as refusal:
        scenario_from(DOCUMENT | change)
    assert "\n" not in str(refusal.value)


def test_exported_c_is_told_of_the_sensor(scenario):
    assert (
        "double tip_force[3];"
        in export_c(scenario.controller, name="law", period=0.005).text
    )
