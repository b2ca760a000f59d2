"""Joints on position servos: what is known of them before, and planted ones that
flights show.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from planted_servos import NOMINAL, fly_servos, planted_numbers, servo_numbers

from skyarm.dynamics.actuators.drive import LaggedTorque
from skyarm.dynamics.actuators.servo import VelocityServo
from skyarm.identify.identified_parts import vehicle_with
from skyarm.identify.identify_windows import identify_by_windows
from skyarm.identify.unknowns import servo_of, with_servos
from skyarm.vehicle.vehicle_records import MountedDrive


def test_a_joint_without_a_drive_gets_a_servo():
    bare = dataclasses.replace(NOMINAL, drives=NOMINAL.drives[1:])
    made = with_servos(bare, [True, True])
    assert with_servos(bare, [False, True]) is bare
    first = servo_of(made, 0)
    assert servo_of(made, 1) == NOMINAL.drives[1].drive
    # 20 rad/s, critically damped
    assert math.sqrt(first.stiffness / first.inertia) == pytest.approx(20.0)
    assert first.damping == pytest.approx(
        2.0 * math.sqrt(first.stiffness * first.inertia)
    )
    # which turns what lies behind the joint: at rest both links about one axis, the
    # second one about the other
    (one, two), motor = (
        (each.body for each in NOMINAL.links),
        [each.joint.armature for each in NOMINAL.links],
    )
    about = two.inertia.yy + two.mass * (two.com.x**2 + two.com.z**2) + motor[1]
    away = [
        a + b for a, b in zip(NOMINAL.links[1].joint.position, two.com, strict=True)
    ]
    whole = one.inertia.yy + one.mass * (one.com.x**2 + one.com.z**2) + motor[0]
    whole += two.inertia.yy + two.mass * (away[0] ** 2 + away[2] ** 2)
    both = with_servos(dataclasses.replace(NOMINAL, drives=()), [True, True])
    assert [servo_of(both, i).inertia for i in (0, 1)] == pytest.approx([whole, about])
    name = NOMINAL.links[0].joint.name
    spinning = MountedDrive(name=name, drive=VelocityServo(gain=0.1, inertia=1e-3))
    with pytest.raises(
        ValueError,
        match=f"^drives.{name}: must be a position_servo, or none: joint_commands",
    ):
        with_servos(dataclasses.replace(NOMINAL, drives=(spinning,)), [True, False])


def test_numbers_of_a_servo_are_put_into_the_vehicle():
    name = NOMINAL.links[1].joint.name
    numbers = {
        f"drives.{name}.stiffness": 5.0,
        f"drives.{name}.latency": -0.001,
        "links.link2.joint.coulomb": -0.01,
    }
    made = vehicle_with(NOMINAL, numbers, checked=True)
    assert made.drives[0] == NOMINAL.drives[0]
    assert made.drives[1].drive == dataclasses.replace(
        NOMINAL.drives[1].drive, stiffness=5.0, latency=0.0
    )
    assert made.links[1].joint.coulomb == 0.0
    assert vehicle_with(NOMINAL, numbers).drives[1].drive.latency == -0.001
    # of another drive no number is one of a position servo
    drives = (
        NOMINAL.drives[0],
        MountedDrive(name=name, drive=LaggedTorque(time_constant=0.02)),
    )
    lagging = dataclasses.replace(NOMINAL, drives=drives)
    assert vehicle_with(lagging, numbers, checked=True).drives == drives


@pytest.mark.thorough
def test_intervals_of_servos_in_flight_cover_them():
    """Of three flights of 20 s with base, links, rotors and servos 20 % off: gains to
    1.5 % (median).

    Of twelve such flights 108 of 120 intervals held the truth, of these three 24 of 30.
    """
    inside, errors = [], []
    for seed in range(3):
        numbers = planted_numbers(seed)
        _, flight = fly_servos(numbers, seed)
        found = identify_by_windows([flight], NOMINAL)
        for name in servo_numbers(seed):
            inside.append(found[name].low <= numbers[name] <= found[name].high)
            if name.endswith(("stiffness", "damping")):
                errors.append(abs(found[name].value / numbers[name] - 1.0))
    assert np.median(errors) < 0.015
    assert np.mean(inside) >= 0.75
