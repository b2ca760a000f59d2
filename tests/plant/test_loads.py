"""What pushes on the vehicle: the sum over rotors, wind, drag and drives, against
definitions in world axes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from independent_flight import Flight, array

from skyarm.algebra import Quaternion, Vec3
from skyarm.dynamics.actuators import Command
from skyarm.plant.interface import Truth, flat
from skyarm.plant.loads import applied_force
from skyarm.plant.surroundings import Surroundings
from skyarm.records.immutable import immutable
from skyarm.vehicle.vehicle_records import BodyDrag
from skyarm.world.component import Force, Wrench
from support.one_vehicle import motion_of
from support.vehicles import (
    HOVER,
    WIND,
    hovering,
    hummingbird_arm,
    random_flyer,
    rotation_matrix,
    steady_wind,
    tumbling,
)

STILL = Vec3(0.0, 0.0, 0.0)


def generalized(vehicle, state, efforts, wind):
    """World force, body torque, joint torques."""
    force, torques = applied_force(
        motion_of(Truth(vehicle=vehicle), state, wind), Command(efforts=efforts), wind
    )
    R = rotation_matrix(array(state.quaternion))
    return np.concatenate(
        [R @ array(force.force), array(force.torque), [float(t) for t in torques]]
    )


def at_rest(vehicle, **changes):
    fields = {
        "joint_rates": (0.0,) * vehicle.n,
        "rotor_speeds": (0.0,) * len(vehicle.rotors),
    }
    return replace(hovering(vehicle), **(fields | changes))


@pytest.mark.parametrize("seed", range(6))
def test_loads_are_those_written_in_world_axes(seed):
    vehicle = random_flyer(seed, 3)
    state, efforts = tumbling(vehicle, seed), (0.3, -0.4, 0.02)
    ours = generalized(vehicle, state, efforts, WIND)
    np.testing.assert_allclose(
        ours,
        Flight(vehicle, 9.8, WIND).loads(flat(state), efforts),
        rtol=0.0,
        atol=1e-12,
    )


def test_wind_pushes_along_itself_and_turns_about_the_origin():
    """2 N along world x, 0.05 m above the origin, on a vehicle yawed by 90 degrees:
    world x is body -y.
    """
    vehicle = hummingbird_arm()
    half = 0.5**0.5
    state = at_rest(vehicle, quaternion=Quaternion(half, 0.0, 0.0, half))
    wind = steady_wind(force_W=Vec3(2.0, 0.0, 0.0), point_B=Vec3(0.0, 0.0, 0.05))
    expected = [2.0, 0.0, 0.0, 0.05 * 2.0, 0.0, 0.0, 0.0, 0.0]
    np.testing.assert_allclose(
        generalized(vehicle, state, (0.0, 0.0), wind), expected, atol=1e-15
    )


def test_body_drag_is_against_the_air_by_hand():
    """1 m/s of headwind along -x on 0.02 m^2: 1/2 1.225 0.02 1 = 0.01225 N
    backwards.
    """
    vehicle = replace(hummingbird_arm(), drag=BodyDrag(area=Vec3(0.02, 0.03, 0.04)))
    wind = steady_wind(air_velocity_W=Vec3(-1.0, 0.0, 0.0))
    np.testing.assert_allclose(
        generalized(vehicle, at_rest(vehicle), (0.0, 0.0), wind)[:3],
        [-0.01225, 0.0, 0.0],
        rtol=1e-12,
        atol=1e-18,
    )


def test_flying_with_the_wind_there_is_no_drag():
    vehicle = replace(hummingbird_arm(), drag=BodyDrag(area=Vec3(0.02, 0.03, 0.04)))
    air = Vec3(2.0, -1.0, 0.5)
    moving = at_rest(vehicle, velocity=air, rotor_speeds=(HOVER,) * 4)
    carried = generalized(vehicle, moving, (0.0, 0.0), steady_wind(air_velocity_W=air))
    still = generalized(
        vehicle, at_rest(vehicle, rotor_speeds=(HOVER,) * 4), (0.0, 0.0), steady_wind()
    )
    np.testing.assert_allclose(carried, still, atol=1e-15)


def test_turning_moves_each_hub_through_the_air():
    """Yaw at 3 rad/s: hubs move at 0.51 m/s across their arms; hub drags brake the yaw,
    rolling moments cancel.
    """
    vehicle = hummingbird_arm()
    spinning = at_rest(vehicle, rate=Vec3(0.0, 0.0, 3.0), rotor_speeds=(HOVER,) * 4)
    extra = generalized(vehicle, spinning, (0.0, 0.0), steady_wind()) - generalized(
        vehicle, at_rest(vehicle, rotor_speeds=(HOVER,) * 4), (0.0, 0.0), steady_wind()
    )
    brake = 4.0 * 0.17 * 8.06428e-5 * HOVER * 0.51
    np.testing.assert_allclose(
        extra, [0.0, 0.0, 0.0, 0.0, 0.0, -brake, 0.0, 0.0], atol=1e-15
    )


def test_loads_of_the_air_do_not_depend_on_the_heading():
    """Everything turned about the vertical together gives the turned force and the same
    torque.
    """
    vehicle = random_flyer(2, 3)
    state = tumbling(vehicle, 3)
    turn = Quaternion(np.cos(0.4), 0.0, 0.0, np.sin(0.4))
    R = turn.rotation()
    turned = replace(
        state, quaternion=turn * state.quaternion, velocity=R.apply(state.velocity)
    )
    sample = WIND.components[0]
    wind = steady_wind(
        R.apply(sample.force_W), sample.point_B, R.apply(sample.air_velocity_W)
    )
    a = generalized(vehicle, state, (0.0,) * 3, WIND)
    b = generalized(vehicle, turned, (0.0,) * 3, wind)
    np.testing.assert_allclose(b[:3], rotation_matrix(array(turn)) @ a[:3], atol=1e-13)
    np.testing.assert_allclose(b[3:], a[3:], atol=1e-13)


@immutable
class Tug(Force[tuple[()]]):
    """A wrench on the second link, which says whether it acts."""

    acts: float | int = 1

    def wrenches(self, memory, t, motion, rotor_speeds):
        """The one wrench."""
        return [
            Wrench(
                force_W=Vec3(1.0, -2.0, 3.0),
                torque_W=Vec3(0.1, 0.2, -0.3),
                point=Vec3(0.1, 0.0, 0.2),
                body=1,
                acts=self.acts,
            )
        ]


def test_a_wrench_that_acts_at_times_pushes_then_as_one_that_always_does():
    vehicle = random_flyer(3, 3)
    always, acting, resting = (
        generalized(
            vehicle,
            tumbling(vehicle, 3),
            (0.0, 0.0, 0.0),
            Surroundings(components=(Tug(acts=each),), memories=((),)),
        )
        for each in (1, 1.0, 0.0)
    )
    np.testing.assert_allclose(acting, always, rtol=1e-12)
    nothing = generalized(
        vehicle, tumbling(vehicle, 3), (0.0, 0.0, 0.0), Surroundings()
    )
    np.testing.assert_allclose(resting, nothing, rtol=1e-12)
    assert np.abs(always - nothing).max() > 1.0


def test_a_negated_quaternion_is_the_same_attitude():
    vehicle = random_flyer(2, 3)
    state = tumbling(vehicle, 3)
    negated = replace(state, quaternion=Quaternion(*(-c for c in state.quaternion)))
    np.testing.assert_array_equal(
        generalized(vehicle, state, (0.0,) * 3, WIND),
        generalized(vehicle, negated, (0.0,) * 3, WIND),
    )
