"""Servos: motor and supply bound their torque, the loop's law, its memory, and flights
against SciPy's integrator.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from skyarm.algebra import Sym3, Vec3
from skyarm.dynamics.actuators import Command
from skyarm.dynamics.actuators.servo import PositionServo, VelocityServo
from skyarm.plant.compiled import example_state
from skyarm.plant.interface import Truth
from skyarm.plant.rigid_body import coupled_rk4
from skyarm.plant.surroundings import Surroundings
from skyarm.vehicle.linkage import Body, Joint, Link
from skyarm.vehicle.vehicle_records import Vehicle
from support.one_vehicle import after_step

GEARED = {
    "gear": 257.4,
    "efficiency": 0.5704,
    "torque_constant": 7.298e-3,
    "resistance": 8.571,
    "voltage": 12.0,
}
INERTIA = 2e-3


def position_servo(**fields: Any) -> PositionServo:
    return PositionServo(
        **{"stiffness": 6.9, "damping": 0.235, "inertia": INERTIA, **fields}
    )


def test_the_bounds_are_the_data_sheets_line():
    """ROBOTIS 2XL430-W250 at 12 V: 1.5 N m at standstill with 1.4 A, 61 rev/min without
    load.
    """
    servo, free = position_servo(**GEARED), 61.0 * 2.0 * math.pi / 60.0
    low, high = servo.bounds(0.0)
    assert high == pytest.approx(1.5, rel=2e-3)
    assert low == -high
    assert servo.bounds(free)[1] == pytest.approx(0.0, abs=2e-3)
    assert servo.bounds(0.5 * free)[1] == pytest.approx(0.75, rel=4e-3)
    assert servo.bounds(-0.5 * free) == pytest.approx((-0.75, 2.25), rel=4e-3)
    assert servo.bounds(2.0 * free)[1] == pytest.approx(-1.5, rel=4e-3), (
        "beyond the no-load speed the winding brakes"
    )


def test_current_and_torque_limits_cut_the_line():
    limited = position_servo(**GEARED, current_limit=0.7)
    assert limited.bounds(0.0) == pytest.approx((-0.75, 0.75), rel=2e-3)
    assert limited.bounds(-50.0)[1] == pytest.approx(0.75, rel=2e-3)
    assert limited.bounds(50.0)[1] == pytest.approx(-0.75, rel=2e-3), "braking too"
    assert position_servo(**GEARED, torque_limit=0.4).bounds(0.0) == (-0.4, 0.4)
    assert position_servo().bounds(3.0) == (
        -math.inf,
        math.inf,
    ), "an ideal motor has no limit"


def swung(
    servo: Any, setpoint: float, seconds: float, load: float = 0.0, start: float = 0.0
) -> list[list[float]]:
    """Angle and rate of a joint on a base too heavy to move, a row a control period of
    5 ms, by our plant.
    """
    heavy = Body(mass=1e9, inertia=Sym3(1e9, 1e9, 1e9, 0, 0, 0))
    link = Link(
        name="arm",
        parent=-1,
        joint=Joint(name="j", axis=Vec3(0, 0, 1), damping=load),
        body=Body(mass=1e-3, inertia=Sym3(INERTIA, INERTIA, INERTIA, 0, 0, 0)),
    )
    world = Truth(vehicle=Vehicle(name="bench", base=heavy, links=(link,)), gravity=0.0)
    state = dataclasses.replace(example_state(1, 0), joints=(start,))
    memory = servo.begin(start, servo.standing(0.0, start), 0.005)
    count = max(1, math.ceil(0.005 / servo.largest_step))
    rows = [[start, 0.0]]
    for _ in range(round(seconds / 0.005)):
        memory = servo.advance(
            memory, setpoint, state.joints[0], state.joint_rates[0], 0.005
        )
        around = Surroundings(drives=(servo,), drive_memories=(memory,))
        for _ in range(count):
            state, _ = after_step(
                coupled_rk4,
                world,
                state,
                Command(efforts=(setpoint,)),
                around,
                0.005 / count,
            )
        rows.append([state.joints[0], state.joint_rates[0]])
    return rows


def test_a_step_is_that_of_a_motor_with_its_winding_and_supply():
    """SciPy integrates the motor's equations: voltage of the loop, current through the
    winding, torque of the gear.
    """
    servo = position_servo(**GEARED)
    per_ampere, counter = 257.4 * 7.298e-3 * 0.5704, 257.4 * 7.298e-3

    def motor(_t: float, x: Any) -> list[float]:
        # a loop on voltage, whose gains give the same torque: the counter-voltage adds
        # its part of the damping
        kp, kd = 6.9 * 8.571 / per_ampere, 0.235 * 8.571 / per_ampere - counter
        voltage = np.clip(kp * (1.0 - x[0]) - kd * x[1], -12.0, 12.0)
        return [x[1], per_ampere * (voltage - counter * x[1]) / 8.571 / INERTIA]

    times = np.arange(0.0, 0.6 + 1e-9, 0.005)
    exact = solve_ivp(
        motor,
        (0.0, 0.6),
        [0.0, 0.0],
        t_eval=times,
        rtol=1e-10,
        atol=1e-12,
        max_step=1e-3,
    ).y.T
    assert np.abs(exact[:20, 1]).max() > 4.5, "the supply bounds the swing"
    # of 6.2 rad/s; the most at the kink where the bound is left
    np.testing.assert_allclose(swung(servo, 1.0, 0.6), exact, rtol=0.0, atol=2e-3)


def test_a_swing_within_bounds_keeps_the_methods_order():
    servo, J = position_servo(damping=0.05), INERTIA
    zeta, w = 0.05 / (2.0 * math.sqrt(6.9 * J)), math.sqrt(6.9 / J)
    damped, times = w * math.sqrt(1.0 - zeta**2), np.arange(0.0, 0.3 + 1e-9, 0.005)
    decay = np.exp(-zeta * w * times)
    exact = 0.2 * (
        1.0
        - decay * (np.cos(damped * times) + zeta * w / damped * np.sin(damped * times))
    )
    np.testing.assert_allclose(
        np.array(swung(servo, 0.2, 0.3))[:, 0], exact, rtol=0.0, atol=5e-5
    )


def test_the_integral_takes_a_load_and_does_not_wind_up():
    lasting = position_servo(integral=30.0, damping=0.3)
    memory = lasting.begin(0.0, 0.0, 0.005)
    for _ in range(4):
        memory = lasting.advance(memory, 0.1, 0.0, 0.0, 0.005)
    assert memory.integral == pytest.approx(4 * 0.1 * 0.005)
    assert lasting.effort(memory, 0.1, 0.0, 0.0) == pytest.approx(0.69 + 30.0 * 0.002)
    bound = position_servo(integral=30.0, torque_limit=0.5)
    for asked, held in ((0.1, True), (0.05, False), (-0.1, True)):
        before = bound.begin(0.0, 0.0, 0.005)
        after = bound.advance(before, asked, 0.0, 0.0, 0.005)
        assert (after.integral == 0.0) is held, "it stands where the bound is reached"
        # an error that leads back from the bound is integrated
    full = dataclasses.replace(before, integral=0.1, goal=-0.01)
    assert bound.advance(full, -0.01, 0.0, 0.0, 0.005).integral < 0.1


def test_a_setpoint_is_heard_after_its_latency():
    servo = position_servo(latency=0.012)
    memory = servo.begin(0.0, 0.0, 0.005)
    assert len(memory.waiting) == 3
    goals = []
    for k in range(6):
        memory = servo.advance(memory, 1.0 + k, 0.0, 0.0, 0.005)
        goals.append(memory.goal)
    # two periods and 0.4 of one: 0.6 of the setpoint two periods ago, 0.4 of that
    # before
    assert goals == pytest.approx([0.0, 0.0, 0.6, 1.6, 2.6, 3.6])
    assert position_servo(latency=0.005).begin(0.0, 0.0, 0.005).waiting == (0.0,)


def test_the_goal_moves_with_the_servos_speed_in_steps_of_its_resolution():
    servo = position_servo(speed_limit=2.0, resolution=0.001)
    memory = servo.begin(0.0, 0.0, 0.005)
    memory = servo.advance(memory, 0.0123456, 0.00051, 0.0, 0.005)
    assert memory.goal == pytest.approx(0.01)
    assert memory.rounding == pytest.approx(0.001 - 0.00051)
    assert servo.effort(memory, 0.0, 0.00051, 0.0) == pytest.approx(
        6.9 * (0.01 - 0.001)
    )
    memory = servo.advance(memory, 0.0123456, 0.0, 0.0, 0.005)
    assert memory.goal == pytest.approx(0.012)


def test_a_velocity_servo_keeps_its_rate_under_friction():
    servo = VelocityServo(gain=0.05, integral=0.5, inertia=INERTIA, speed_limit=3.0)
    rows = np.array(swung(servo, 2.0, 0.5, load=0.02))
    assert rows[-1, 1] == pytest.approx(2.0, abs=2e-3)
    proportional = VelocityServo(gain=0.05, inertia=INERTIA)
    assert np.array(swung(proportional, 2.0, 0.5, load=0.02))[-1, 1] == pytest.approx(
        2.0 * 0.05 / 0.07, rel=1e-3
    )
    assert servo.advance(servo.begin(0.0, 0.0, 0.005), 9.0, 0.0, 0.0, 0.005).goal == 3.0


@pytest.mark.parametrize(
    "servo",
    [
        position_servo(integral=3.0),
        VelocityServo(gain=0.2, integral=1.0, inertia=INERTIA),
    ],
    ids=["position", "velocity"],
)
def test_setpoint_is_the_inverse_of_effort(servo):
    memory = dataclasses.replace(
        servo.begin(0.3, servo.standing(0.0, 0.3), 0.005), integral=0.02
    )
    for _ in range(3):
        setpoint = servo.setpoint(memory, 0.17, 0.31, -0.4, 0.005)
        memory = servo.advance(memory, setpoint, 0.31, -0.4, 0.005)
        assert servo.effort(memory, setpoint, 0.31, -0.4) == pytest.approx(
            0.17, abs=1e-12
        )
    at_rest = dataclasses.replace(memory, integral=0.0, goal=servo.standing(0.17, 0.3))
    assert servo.effort(at_rest, 0.0, 0.3, 0.0) == pytest.approx(0.17, abs=1e-12)


def test_the_largest_step_is_the_fastest_root():
    for servo in (
        position_servo(),
        position_servo(damping=0.01),
        position_servo(damping=1.0),
    ):
        roots = np.abs(np.roots([servo.inertia, servo.damping, servo.stiffness]))
        assert servo.largest_step == pytest.approx(0.5 / roots.max())
    assert VelocityServo(gain=0.2, inertia=1e-3).largest_step == pytest.approx(
        0.5 * 1e-3 / 0.2
    )
    # against its supply the motor alone: stall torque over no-load speed
    assert position_servo(**GEARED, inertia=5e-4).largest_step == pytest.approx(
        0.5 * 5e-4 / (1.5 / 6.388), rel=2e-3
    )


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"stiffness": 0.0}, r"^stiffness = 0\.0: must be above 0$"),
        ({"inertia": -1.0}, r"^inertia = -1\.0: must be "),
        ({"efficiency": 0.0}, r"^efficiency = 0\.0: must be above 0 and at most 1$"),
        ({"efficiency": 1.5}, r"^efficiency = 1\.5: must be at most 1$"),
        ({"latency": math.nan}, r"^latency = nan: must be a finite number$"),
    ],
)
def test_a_servo_that_cannot_be_is_refused(fields, words):
    with pytest.raises(ValueError, match=words):
        position_servo(**fields)
