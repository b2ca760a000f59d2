"""Ground effect, drag of links, inflow and lift of rotors against closed forms."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest

from skyarm.algebra import Quaternion, Vec3
from skyarm.dynamics.point_motion import PointMotion
from skyarm.dynamics.state import State
from skyarm.vehicle.vehicle_files import load_vehicle
from skyarm.world import GroundEffect, LinkDrag, RotorDrag

VEHICLE = load_vehicle("hummingbird_arm2_rotors")
THRUST = float(VEHICLE.rotors[0].thrust_coefficient) * 500.0**2


def state(
    z=1.0,
    velocity=(0.0, 0.0, 0.0),
    rate=(0.0, 0.0, 0.0),
    joints=(0.0, 0.0),
    rates=(0.0, 0.0),
):
    return State(
        position=Vec3(0.0, 0.0, z),
        quaternion=Quaternion(1.0, 0.0, 0.0, 0.0),
        velocity=Vec3(*velocity),
        rate=Vec3(*rate),
        joints=joints,
        joint_rates=rates,
        rotor_speeds=(500.0,) * 4,
    )


def lifts(force, z, **others):
    now = state(z, **others)
    return [
        w.force_W.z
        for w in force.wrenches((), 0.0, PointMotion(VEHICLE, now), now.rotor_speeds)
    ]


def test_a_rotor_alone_has_the_ground_effect_of_cheeseman_and_bennett():
    z = float(VEHICLE.rotors[0].position.z)
    for height in (0.06, 0.1, 0.3):
        wanted = THRUST / (1.0 - (0.1 / (4.0 * height)) ** 2)
        assert lifts(
            GroundEffect(radius=0.1, others=False), height - z
        ) == pytest.approx([wanted - THRUST] * 4)


def test_four_rotors_have_the_published_ground_effect_of_a_quadrotor():
    """Two neighbours at d and the opposite rotor at sqrt(2) d, as the published formula
    writes them.
    """
    hub, R = VEHICLE.rotors[0].position, 0.1
    d = np.sqrt(2.0) * 0.17
    for height in (0.08, 0.2):
        share = (R / (4 * height)) ** 2 + R**2 * height / np.sqrt(
            (d**2 + 4 * height**2) ** 3
        )
        share += R**2 / 2 * height / np.sqrt((2 * d**2 + 4 * height**2) ** 3)
        assert lifts(GroundEffect(radius=R), height - float(hub.z)) == pytest.approx(
            [THRUST / (1 - share) - THRUST] * 4
        )


def test_the_ground_effect_falls_with_height_and_stays_finite_on_the_ground():
    found = [
        lifts(GroundEffect(radius=0.1), z)[0] for z in (-1.0, 0.0, 0.05, 0.2, 1.0, 10.0)
    ]
    assert found[0] == found[1]
    assert all(a > b > 0.0 for a, b in itertools.pairwise(found[1:]))
    assert found[-1] < 1e-4 * THRUST


def test_links_drag_against_their_motion_through_the_air_and_take_energy():
    force, air = LinkDrag(area=(0.01, 0.02)), Vec3(2.0, -1.0, 0.5)
    now = state(
        velocity=(1.0, 0.0, 0.0),
        rate=(0.0, 0.5, 0.0),
        joints=(0.3, 0.2),
        rates=(1.0, -2.0),
    )
    for blowing in (None, lambda _: air):
        motion = PointMotion(VEHICLE, now, blowing)
        for i, wrench in enumerate(force.wrenches((), 0.0, motion, ())):
            v = motion.velocity(wrench.point, i) - (
                Vec3(0, 0, 0) if blowing is None else air
            )
            speed = np.sqrt(v.dot(v))
            assert wrench.body == i
            assert wrench.force_W.dot(v) == pytest.approx(
                -0.5 * 1.225 * force.area[i] * speed**3
            )
            assert tuple(wrench.force_W.cross(v)) == pytest.approx(
                (0.0, 0.0, 0.0), abs=1e-12
            )
    carried = state(velocity=tuple(air))
    for wrench in force.wrenches(
        (), 0.0, PointMotion(VEHICLE, carried, lambda _: air), ()
    ):
        assert tuple(wrench.force_W) == pytest.approx((0.0, 0.0, 0.0))


def test_climbing_loses_thrust_and_flying_across_gains_some():
    climb = lifts(RotorDrag(inflow=1e-5), 1.0, velocity=(0.0, 0.0, 2.0))
    assert climb == pytest.approx([-1e-5 * 500.0 * 2.0] * 4)
    across = lifts(RotorDrag(lift=0.01, inflow=1e-5), 1.0, velocity=(3.0, 0.0, 0.0))
    assert across == pytest.approx([0.01 * 9.0] * 4)
    # the front hub sinks, the rear one rises
    spun = lifts(RotorDrag(inflow=1e-5), 1.0, rate=(0.0, 1.0, 0.0))
    places = [float(rotor.position.x) for rotor in VEHICLE.rotors]
    assert spun == pytest.approx([1e-5 * 500.0 * x for x in places], abs=1e-12)


def test_a_rotor_that_lies_on_its_side_pushes_along_its_axis():
    axis = Vec3(0.6, 0.0, 0.8)
    tilted = dataclasses.replace(
        VEHICLE,
        rotors=tuple(dataclasses.replace(rotor, axis=axis) for rotor in VEHICLE.rotors),
    )
    now = state(velocity=(1.0, 2.0, 0.0))
    for wrench in RotorDrag(inflow=1e-4).wrenches(
        (), 0.0, PointMotion(tilted, now), now.rotor_speeds
    ):
        assert tuple(wrench.force_W) == pytest.approx(
            tuple(axis * (-1e-4 * 500.0 * 0.6))
        )
