"""Disturbances as signals of time: wrenches at frames, air, noise, several gusts,
shares of thrust.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Quaternion, Vec3
from skyarm.dynamics.point_motion import PointMotion
from skyarm.dynamics.state import State
from skyarm.reference import Constant, Sine
from skyarm.scenario.document import read_part, slot_of
from skyarm.vehicle.vehicle_files import load_vehicle
from skyarm.vehicle.vehicle_records import Frame
from skyarm.world import (
    ColouredNoise,
    Disturbance,
    Fault,
    ForceWind,
    Gust,
    MovingAir,
    SignalVector,
    effectiveness_at,
    wind_from,
)

VEHICLE = load_vehicle("hummingbird_arm2_rotors")
STATE = State(
    position=Vec3(0.3, -0.2, 1.0),
    quaternion=Quaternion(0.8, 0.36, 0.48, 0.0),
    velocity=Vec3(0.5, 0.2, -0.1),
    rate=Vec3(0.1, -0.4, 0.3),
    joints=(0.4, -0.3),
    joint_rates=(0.5, 1.0),
    rotor_speeds=(500.0,) * 4,
)


def test_a_force_at_a_frame_does_the_work_of_its_signal_on_the_frame():
    """The power of a wrench is that of its generalised forces: force times velocity
    plus torque times turning.
    """
    turned = Quaternion(0.6, 0.0, 0.8, 0.0).rotation()
    vehicle = dataclasses.replace(
        VEHICLE,
        frames=(
            *VEHICLE.frames,
            Frame(
                name="side", link=1, position=Vec3(0.02, 0.01, -0.1), rotation=turned
            ),
        ),
    )
    motion = PointMotion(vehicle, STATE)
    force = SignalVector(x=Sine(amplitude=2.0, frequency_hz=0.25), y=Constant(-0.5))
    torque = SignalVector(z=Constant(0.3))
    for axes in ("world", "frame"):
        record = Disturbance(frame="side", axes=axes, force=force, torque=torque)
        (wrench,) = record.wrenches((), 1.0, motion, ())
        f, m = Vec3(2.0, -0.5, 0.0), Vec3(0.0, 0.0, 0.3)
        if axes == "frame":
            f, m = (motion.to_world(turned.apply(v), 1) for v in (f, m))
        assert tuple(wrench.force_W) == pytest.approx(tuple(f))
        assert tuple(wrench.torque_W) == pytest.approx(tuple(m))
        on_base, efforts = motion.generalized_force(
            wrench.force_W, wrench.torque_W, wrench.point, wrench.body
        )
        v_base = STATE.quaternion.rotation().apply_T(STATE.velocity)
        power = (
            on_base.force.dot(v_base)
            + on_base.torque.dot(STATE.rate)
            + np.dot(efforts, STATE.joint_rates)
        )
        moved = (
            motion.velocity(wrench.point, 1),
            motion.to_world(motion.angular_velocity(1), 1),
        )
        assert power == pytest.approx(f.dot(moved[0]) + m.dot(moved[1]))


def test_an_angular_velocity_turns_a_body_as_its_points_move():
    motion = PointMotion(VEHICLE, STATE)
    w = motion.to_world(motion.angular_velocity(1), 1)
    a, b = Vec3(0.1, 0.2, -0.3), Vec3(-0.2, 0.05, 0.1)
    apart = motion.position(a, 1) - motion.position(b, 1)
    assert tuple(motion.velocity(a, 1) - motion.velocity(b, 1)) == pytest.approx(
        tuple(w.cross(apart))
    )


def test_noise_has_its_deviation_and_its_bandwidth_whatever_the_period():
    """Autocovariance sigma^2 exp(-2 pi f tau) over 40 000 lanes: within 5 standard
    errors.
    """
    rng, lanes = np.random.default_rng(5), 40000
    record = Disturbance(
        noise=ColouredNoise(
            force=[2.0, 0.0, 0.0], torque=[0.0, 0.0, 0.5], bandwidth_hz=3.0
        )
    )
    assert record.uniforms == 6
    for dt in (0.005, 0.02):
        first = record.start(dt, list(rng.uniform(size=(12, lanes))))
        memory = first
        for _ in range(round(0.04 / dt)):
            memory = record.advance(
                memory, 0.0, dt, STATE, list(rng.uniform(size=(6, lanes)))
            )
        for a, b in zip(first, memory, strict=True):
            assert abs(a.var() - 1.0) < 5.0 * math.sqrt(2.0 / lanes)
            assert abs(b.var() - 1.0) < 5.0 * math.sqrt(2.0 / lanes)
            assert abs(
                (a * b).mean() - math.exp(-2.0 * math.pi * 3.0 * 0.04)
            ) < 5.0 * math.sqrt(2.0 / lanes)
    memory = tuple(float(each[0]) for each in memory)
    (wrench,) = record.wrenches(memory, 0.0, PointMotion(VEHICLE, STATE), ())
    assert tuple(wrench.force_W) == pytest.approx((2.0 * memory[0], 0.0, 0.0))
    assert tuple(wrench.torque_W) == pytest.approx((0.0, 0.0, 0.5 * memory[5]))


@pytest.mark.parametrize(
    ("where", "kind", "field", "there"),
    [
        ("forces", "disturbance", "velocity", "noise.force and noise.torque"),
        ("air", "air_signals", "force", "noise.velocity"),
        ("air", "air_signals", "torque", "noise.velocity"),
    ],
)
def test_noise_of_what_is_not_there_is_refused_by_name(where, kind, field, there):
    noise = {field: [0.0, 0.3, 0.0], "bandwidth_hz": 1.0}
    tables = {"name": "noisy", "duration": 1.0, "plant": {"vehicle": "hummingbird"}}
    tables |= {
        "controller": {"law": "decoupled_pd"},
        "environment": {where: [{"kind": kind, "noise": noise}]},
    }
    with pytest.raises(ValueError, match=rf"environment\.{where}\[0\]\.noise") as error:
        skyarm.scenario_from(tables)
    said = (
        f"environment.{where}[0].noise.{field} = [0.0, 0.3, 0.0]: must be left out;"
        f" here there is {there}"
    )
    assert str(error.value).endswith(said)
    noise[field] = [0.0, 0.0, 0.0]
    skyarm.scenario_from(tables)


def test_several_gusts_add_up_and_one_has_its_bits():
    one = Gust(peak=[2.0, 0.0, 0.0], start=1.0, duration=2.0)
    two = Gust(peak=[0.0, 3.0, 0.0], start=2.0, duration=2.0)
    assert MovingAir(gusts=(one,)).velocity((), 1.5, STATE.position) == MovingAir(
        gust=one
    ).velocity((), 1.5, STATE.position)
    both = MovingAir(velocity_W=[0.0, 0.0, 1.0], gust=one, gusts=(two,))
    for t, wanted in (
        (0.5, (0, 0, 1)),
        (1.5, (2, 0, 1)),
        (2.5, (2, 3, 1)),
        (3.5, (0, 3, 1)),
    ):
        assert tuple(both.velocity((), t, STATE.position)) == wanted
    (wrench,) = ForceWind(gusts=(one, two)).wrenches(
        (), 2.5, PointMotion(VEHICLE, STATE), ()
    )
    assert tuple(wrench.force_W) == (2.0, 3.0, 0)
    table = {
        "mode": "force_wind",
        "gust": [{"force": [1, 0, 0], "start": 1, "duration": 1}] * 2,
    }
    assert len(wind_from(table, "wind").gusts) == 2
    table["gust"].append({"force": [1, 0], "start": 1, "duration": 1})
    with pytest.raises(ValueError, match=r"^wind\.gust\[2\]\.force"):
        wind_from(table, "wind")


def test_a_share_of_thrust_is_a_signal_within_none_and_all():
    sine = {"kind": "sine", "amplitude": 2.0, "frequency_hz": 1.0}
    (fault,) = read_part(
        slot_of("environment.faults"),
        [{"rotor": "front", "start": 1.0, "effectiveness": [1.0, sine]}],
        None,
    )
    shares = [float(fault.share(t)) for t in (0.75, 1.0, 1.25, 1.5 + 1.0 / 12.0, 1.75)]
    assert shares == pytest.approx([1.0, 1.0, 1.0, 0.0, 0.0], abs=1e-12)
    gentle = Fault(
        rotor="left", signal=Sine(amplitude=0.5, frequency_hz=0.25), effectiveness=0.8
    )
    assert float(gentle.share(1.0)) == pytest.approx(0.4)
    left = effectiveness_at(
        (gentle, Fault(joint="joint1", stuck=True, start=2.0)), VEHICLE, 1.0
    )
    assert left.rotors.count(1) == 3
    assert left.stuck == (0.0, 0)
    assert effectiveness_at(
        (Fault(joint="joint1", stuck=True, start=2.0),), VEHICLE, 2.0
    ).stuck == (1.0, 0)


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"rotor": "front", "stuck": True}, r"stuck = true: must be of a joint"),
        ({"joint": "joint1", "stuck": 1}, r"stuck = 1: must be true or false"),
        (
            {"joint": "joint1", "stuck": True, "effectiveness": 0.5},
            r"effectiveness = 0.5: must be left out beside stuck",
        ),
        (
            {"rotor": "front", "effectiveness": {"kind": "sin"}},
            r"effectiveness\.kind = 'sin': ",
        ),
        (
            {"rotor": "front", "effectiveness": [1.0, "x"]},
            r"effectiveness\[1\] = 'x': must be a finite number",
        ),
    ],
)
def test_a_wrong_fault_is_one_line(table, words):
    with pytest.raises(ValueError, match=words) as error:
        read_part(slot_of("environment.faults"), [table], None)
    assert str(error.value).startswith("environment.faults[0]")
    assert "\n" not in str(error.value)
