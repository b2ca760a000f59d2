"""Every quantity that is counted on the fly, against its definition at one instant far
from its goal.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from skyarm.algebra import Quaternion, Vec3
from skyarm.compile import trace
from skyarm.dynamics import State
from skyarm.dynamics.actuators import Command
from skyarm.log.metrics import interaction
from skyarm.log.metrics.accumulate import QUANTITIES, quantity, roll_and_pitch, tilt
from skyarm.log.metrics.metric import ActuatorLimits, MetricGoal, MetricInstant
from skyarm.vehicle.battery import Battery, CellCurve
from skyarm.vehicle.vehicle_files import load_vehicle

TURN = Rotation.from_euler("ZYX", [0.9, -0.7, 0.4])
NOW = {
    "position": [0.7, -0.4, 1.9],
    "tool": [0.8, -0.6, 1.5],
    "joints": [0.5, -0.9],
    "rate": [0.3, -1.2, 0.8],
}
HELD = {"position": [0.2, 0.3, 2.4], "tool": [0.35, 0.15, 2.2], "joints": [0.1, 0.4]}
SMOOTH = {"position": [-0.3, 0.9, 1.2], "tool": [-0.1, 0.6, 1.1], "joints": [-0.6, 0.2]}
COMMANDED, BEFORE, EFFORTS = (
    [470.0, 520.0, 455.0, 500.0],
    [480.0, 500.0, 485.0, 503.0],
    [0.07, -0.02],
)


def goal(where):
    return MetricGoal(
        position=Vec3(*where["position"]),
        joints=tuple(where["joints"]),
        tool=Vec3(*where["tool"]),
    )


def instant():
    x, y, z, w = TURN.as_quat().tolist()
    state = State(
        position=Vec3(*NOW["position"]),
        quaternion=Quaternion(w, x, y, z),
        velocity=Vec3(0.0, 0.0, 0.0),
        rate=Vec3(*NOW["rate"]),
        joints=tuple(NOW["joints"]),
        joint_rates=(0.0, 0.0),
        rotor_speeds=(480.0,) * 4,
    )
    return MetricInstant(
        state=state,
        tool=Vec3(*NOW["tool"]),
        command=Command(rotor_speeds=tuple(COMMANDED), efforts=tuple(EFFORTS)),
        before=tuple(BEFORE),
        held=goal(HELD),
        continuous=goal(SMOOTH),
        lag=0.35,
        phase=2.0,
        limits=ActuatorLimits(
            speeds=(838.0, 838.0, 455.0, 838.0),
            least=(0.0,) * 4,
            efforts=(0.08, math.inf),
        ),
    )


def expected(wanted):
    """Definitions by NumPy and SciPy."""
    off = {name: np.subtract(NOW[name], wanted[name]) for name in wanted}
    _, pitch, roll = TURN.as_euler("ZYX")
    change = np.subtract(COMMANDED, BEFORE)
    return {
        "position": np.linalg.norm(off["position"]),
        "joint": np.linalg.norm(off["joints"]),
        "ee": np.linalg.norm(off["tool"]),
        "ee_outside": float(np.linalg.norm(off["tool"]) > 0.05),
        "x": off["position"][0],
        "ee_x": off["tool"][0],
        "height": -off["position"][2],
        "altitude": abs(off["position"][2]),
        "roll": roll,
        "pitch": pitch,
        "pitch_size": abs(pitch),
        "tilt": np.arccos(TURN.as_matrix()[2, 2]),
        "lag": 0.35,
        "phase": 2.0,
        "rate_square": np.sum(np.square(NOW["rate"])),
        "rotor_limited": 1.0,
        "joint_limited": 0.0,
        "jitter_size": np.mean(np.abs(change)),
        "jitter_square": np.mean(change**2),
    }


@pytest.mark.parametrize(
    "name", [name for name in QUANTITIES if name not in interaction.QUANTITIES]
)
@pytest.mark.parametrize(("suffix", "wanted"), [("", HELD), ("_continuous", SMOOTH)])
def test_a_quantity_is_what_its_name_says(name, suffix, wanted):
    assert quantity(name + suffix, instant()) == pytest.approx(
        expected(wanted)[name], rel=1e-12
    )


def test_an_effort_is_that_of_its_joint():
    assert [quantity(f"effort{i}", instant()) for i in range(2)] == EFFORTS


LIMITS = ActuatorLimits(speeds=(838.0,) * 4, least=(0.0,) * 4, efforts=(0.5, 0.5))


def limited(speeds=(470.0,) * 4, efforts=(0.0, 0.0), limits=LIMITS):
    """Whether rotors and joints are at limits, by what counts it in flight."""
    now = dataclasses.replace(
        instant(), command=Command(rotor_speeds=speeds, efforts=efforts), limits=limits
    )
    return quantity("rotor_limited", now), quantity("joint_limited", now)


def test_a_period_counts_once_however_many_commands_are_at_limits():
    assert limited() == (0.0, 0.0)
    assert (
        limited((838.0, 900.0, 0.0, 470.0))
        == limited((470.0,) * 3 + (838.0,))
        == (1.0, 0.0)
    )
    assert (
        limited((470.0, 0.0, 470.0, 470.0))
        == limited((470.0, -3.0, 470.0, 470.0))
        == (1.0, 0.0)
    )
    assert limited((837.999,) * 4, (0.4999, -0.4999)) == (0.0, 0.0)
    assert (
        limited(efforts=(0.5, 0.0))
        == limited(efforts=(0.0, -0.5))
        == limited(efforts=(-7.0, 0.5))
        == (0.0, 1.0)
    )
    assert limited((838.0 * (1.0 - 1e-10),) * 4)[0] == 1.0, (
        "rounding of a law that cuts its own commands"
    )


def test_what_has_no_limit_is_never_at_it_and_an_unknown_vehicle_has_no_share():
    found = load_vehicle("quadrotor_roll_arm2")
    assert ActuatorLimits.of(found, [True, True]).efforts == (
        math.inf,
        math.inf,
    ), "setpoints of servos"
    unlimited = ActuatorLimits(
        speeds=(math.inf,) * 4, least=(0.0,) * 4, efforts=(math.inf,) * 2
    )
    assert limited(efforts=(1e9, 1e9), limits=unlimited) == (0.0, 0.0)
    arm = load_vehicle("hummingbird_arm2")
    passive = dataclasses.replace(arm.links[0].joint, effort_limit=0)
    slack = dataclasses.replace(
        arm, links=(dataclasses.replace(arm.links[0], joint=passive), arm.links[1])
    )
    assert ActuatorLimits.of(slack, [False, False]).efforts == (math.inf, 0.5)
    assert np.isnan(limited(limits=None)).all()


@pytest.mark.parametrize("esc", ["governed", "open"])
@pytest.mark.parametrize(
    ("voltage", "most"), [(6.3, 419.0), (12.6, 838.0), (13.9, 838.0)]
)
def test_a_weak_battery_moves_the_limits_of_the_rotors(esc, voltage, most):
    """At half of the reference voltage a governed rotor turns at half its highest
    speed, either way.
    """
    curve = CellCurve(charge=(0.0, 1.0), voltage=(3.3, 4.2))
    pack = Battery(
        cells=3,
        capacity=1.0,
        resistance=0.05,
        open_circuit=curve,
        reference_voltage=12.6,
        esc=esc,
    )
    vehicle = load_vehicle("hummingbird_arm2")
    rotors = tuple(
        dataclasses.replace(each, reversible=True) for each in vehicle.rotors
    )
    assert {float(each.max_speed) for each in rotors} == {838.0}
    limits = ActuatorLimits.of(
        dataclasses.replace(vehicle, battery=pack, rotors=rotors), [False, False]
    )
    most = 838.0 if esc == "open" else most
    for speed in (most, -most):
        assert at_limit(speed, limits, voltage) == 1.0
        assert at_limit(0.999 * speed, limits, voltage) == 0.0


def at_limit(speed, limits, voltage):
    command = Command(rotor_speeds=(speed,) * 4, efforts=(0.0, 0.0))
    parts = (("battery_voltage", (voltage,)),)
    return quantity(
        "rotor_limited",
        dataclasses.replace(instant(), command=command, limits=limits, parts=parts),
    )


UPRIGHT = np.sqrt(0.5)
"""Twice its square is 1 + 2e-16: the sine of a pitch of a right angle, rounded up."""


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("length", [1.0, 1.0 + 1e-12])
def test_a_nose_that_points_straight_up_or_down_has_a_pitch(sign, length):
    """Rounding, or the integrator's 1e-12 of length, makes the sine larger than 1: no
    error, no NaN, in any engine.
    """
    assert 2.0 * UPRIGHT * UPRIGHT > 1.0
    q = Quaternion(UPRIGHT * length, 0.0, sign * UPRIGHT * length, 0.0)
    traced = trace(lambda q: roll_and_pitch(q)[1], q)
    for pitch in (roll_and_pitch(q)[1], traced(q)):
        assert pitch == pytest.approx(sign * 0.5 * np.pi, abs=1e-15)


@pytest.mark.parametrize("length", [1.0, 1.0 + 1e-12])
def test_a_vehicle_upside_down_has_a_tilt(length):
    q = Quaternion(0.0, 0.6 * length, 0.8 * length, 0.0)
    traced = trace(tilt, q)
    for found in (tilt(q), traced(q)):
        assert found == pytest.approx(np.pi, abs=1e-15)


def test_pitch_has_its_sign_and_range_on_the_whole_sphere():
    """Within 1e-7 rad: the arcsine loses half the digits where the nose is straight
    up.
    """
    for rotation in Rotation.random(300, random_state=5):
        x, y, z, w = rotation.as_quat().tolist()
        roll, pitch = roll_and_pitch(Quaternion(w, x, y, z))
        _, wanted_pitch, wanted_roll = rotation.as_euler("ZYX")
        assert pitch == pytest.approx(wanted_pitch, abs=1e-7)
        assert np.cos(roll - wanted_roll) == pytest.approx(1.0, abs=1e-7)
