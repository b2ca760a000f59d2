"""What surrounds the vehicle adds up, and pushes its bodies alike on both plants."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from skyarm.algebra import ZERO3, Quaternion, Vec3
from skyarm.dynamics import State
from skyarm.dynamics.actuators import Command
from skyarm.dynamics.point_motion import PointMotion
from skyarm.plant.interface import Truth
from skyarm.plant.loads import wind_at
from skyarm.plant.surroundings import Surroundings
from skyarm.scenario.scenario_file import load_scenario
from skyarm.simulate import run
from skyarm.vehicle.vehicle_files import load_vehicle
from skyarm.world import MovingAir
from support.components import (
    RandomPush,
    Shear,
    SteadyWrench,
    Tether,
    Turbulence,
    telling,
    with_law,
)
from support.one_vehicle import motion_of, rate_of
from support.vehicles import TWINS, random_state, random_vehicle


def record(state, rotors=0):
    position, quaternion, joints, velocity = state.all
    return State(
        position=Vec3(*position.tolist()),
        quaternion=Quaternion(*quaternion.tolist()),
        velocity=Vec3(*velocity[:3].tolist()),
        rate=Vec3(*velocity[3:6].tolist()),
        joints=tuple(joints.tolist()),
        joint_rates=tuple(velocity[6:].tolist()),
        rotor_speeds=(0.0,) * rotors,
    )


def around_of(*rows, time=0.0):
    components, memories = zip(*rows, strict=True)
    return Surroundings(components=components, memories=memories, time=time)


def test_air_velocities_add_up_each_with_its_own_memory_and_place():
    mean = MovingAir(velocity_W=Vec3(1.0, -2.0, 0.5))
    first, second = Turbulence(sigma=0.5), Turbulence(sigma=2.0)
    around = around_of(
        (mean, ()),
        (first, (1.0, 2.0, 3.0)),
        (Shear(rate=0.3), ()),
        (second, (-1.0, 0.5, 0.25)),
    )
    # by hand: (1, -2, .5) + .5 (1, 2, 3) + (.3 z, 0, 0) + 2 (-1, .5, .25)
    for z in (0.0, 2.0):
        assert list(around.air_velocity(Vec3(9.0, 9.0, z))) == pytest.approx(
            [-0.5 + 0.3 * z, 0.0, 2.5], abs=1e-15
        )


def test_wrenches_are_those_of_every_component_in_order():
    vehicle = random_vehicle(np.random.default_rng(1), 2)
    motion = PointMotion(vehicle, record(random_state(np.random.default_rng(2), 2)))
    steady, push = (
        SteadyWrench(force=Vec3(1.0, 2.0, 3.0), body=1),
        RandomPush(sigma=3.0),
    )
    found = around_of(
        (steady, ()), (push, (0.5,)), (Shear(), ()), (push, (-2.0,))
    ).wrenches(motion)
    assert [list(each.force_W) for each in found] == [
        [1.0, 2.0, 3.0],
        [0.0, 0.0, 1.5],
        [0.0, 0.0, -6.0],
    ]
    assert [each.body for each in found] == [1, -1, -1]


def test_components_feel_the_time_of_the_period():
    @dataclasses.dataclass(frozen=True)
    class Clock(MovingAir):
        def velocity(self, memory, t, position_W):
            return Vec3(t, 0, 0)

    assert around_of((Clock(), ()), time=3.25).air_velocity(ZERO3).x == 3.25


def test_the_log_keeps_the_force_on_the_base_and_the_air_at_its_origin():
    rng = np.random.default_rng(3)
    vehicle, state = random_vehicle(rng, 2), record(random_state(rng, 2))
    base, link = (
        SteadyWrench(force=Vec3(1.0, 2.0, 3.0)),
        SteadyWrench(force=Vec3(50.0, 0.0, 0.0), body=1),
    )
    around = around_of((base, ()), (link, ()), (base, ()), (Shear(rate=2.0), ()))
    sample = wind_at(around, motion_of(Truth(vehicle=vehicle), state, around))
    assert list(sample.force_W) == [2.0, 4.0, 6.0]
    assert list(sample.air_velocity_W) == [2.0 * state.position.z, 0.0, 0.0]


def drag_in_numpy(vehicle, state, air):
    """Drag of rotors and airframe in world axes: -c W v_perp of each, and -1/2 rho area
    |v| v.
    """
    R = np.array([list(row) for row in state.quaternion.rotation().rows])
    v = R.T @ (np.array(list(state.velocity)) - air)
    total = (
        -0.5
        * vehicle.drag.air_density
        * np.array(list(vehicle.drag.area))
        * np.linalg.norm(v)
        * v
    )
    for rotor, speed in zip(vehicle.rotors, state.rotor_speeds, strict=True):
        axis, at = (
            np.array(list(rotor.axis)),
            v + np.cross(list(state.rate), list(rotor.position)),
        )
        total = total - rotor.drag_coefficient * speed * (at - axis * (axis @ at))
    return R @ total


@pytest.mark.parametrize(
    "name", ["hexarotor_arm6", "tilted_hexarotor", "hummingbird_arm2_rotors"]
)
def test_the_force_of_moving_air_is_its_drag_less_that_in_calm_air(name):
    vehicle, rng = load_vehicle(name), np.random.default_rng(8)
    state = record(random_state(rng, vehicle.n), len(vehicle.rotors))
    state = dataclasses.replace(
        state,
        rotor_speeds=tuple(rng.uniform(200.0, 600.0, len(vehicle.rotors)).tolist()),
    )
    air = np.array([3.0, -2.0, 1.5])
    blown = around_of(
        (MovingAir(velocity_W=tuple(air)), ()),
        (SteadyWrench(force=Vec3(0.5, 0.0, 0.0)), ()),
    )
    found = np.array(
        list(wind_at(blown, motion_of(Truth(vehicle=vehicle), state, blown)).force_W)
    )
    wanted = (
        drag_in_numpy(vehicle, state, air)
        - drag_in_numpy(vehicle, state, np.zeros(3))
        + [0.5, 0.0, 0.0]
    )
    assert found == pytest.approx(wanted, abs=1e-12)
    assert np.linalg.norm(found) > 0.6
    # in air that moves as the vehicle does it is the whole drag of still air, taken
    # away; in calm air none
    calm = around_of((MovingAir(velocity_W=(0.0, 0.0, 0.0)), ()))
    assert list(
        wind_at(calm, motion_of(Truth(vehicle=vehicle), state, calm)).force_W
    ) == [0.0, 0.0, 0.0]


def test_a_part_logs_with_the_gravity_that_it_acts_with():
    @dataclasses.dataclass(frozen=True)
    class Weighed(SteadyWrench):
        columns = ("weight",)

        def logged(self, memory, motion):
            return (motion.gravity,)

    vehicle, state = (
        random_vehicle(np.random.default_rng(3), 2),
        record(random_state(np.random.default_rng(3), 2)),
    )
    weighed = Weighed(force=Vec3(0.0, 0.0, 0.0))
    around = around_of((weighed, ()))
    sample = wind_at(
        around, motion_of(Truth(vehicle=vehicle, gravity=3.7), state, around)
    )
    assert sample.numbers == (3.7,)


@pytest.mark.parametrize("seed", range(6))
def test_a_wrench_on_a_link_accelerates_the_vehicle_as_mujocos_own_application_of_it(
    seed,
):
    """mj_applyFT maps a force at a place of the world and a torque on a body to
    generalized forces by its own code.
    """
    mujoco = pytest.importorskip("mujoco")
    rng = np.random.default_rng([5, seed])
    vehicle, state = random_vehicle(rng, 4), random_state(rng, 4)
    twin, force, motion = (
        TWINS["mujoco"](vehicle),
        np.zeros(10),
        PointMotion(vehicle, record(state)),
    )
    rows = []
    for body in range(-1, 4):
        wrench, point = 3.0 * rng.normal(size=6), Vec3(*rng.normal(size=3).tolist())
        push = SteadyWrench(
            force=Vec3(*wrench[:3].tolist()),
            torque=Vec3(*wrench[3:].tolist()),
            point=point,
            body=body,
        )
        rows.append((push, ()))
        data = twin._prepare(state)
        mujoco.mj_forward(twin.model, data)
        name = "base" if body < 0 else vehicle.links[body].name
        index, place = (
            twin.model.body(name).id,
            np.array(list(motion.position(point, body))),
        )
        mujoco.mj_applyFT(
            twin.model,
            data,
            wrench[:3],
            wrench[3:],
            place,
            index,
            theirs := np.zeros(10),
        )
        force += theirs[twin.v_order]
    wanted = twin.forward_dynamics(state, force)
    rate = rate_of(
        Truth(vehicle=vehicle),
        record(state),
        Command(efforts=(0.0,) * 4),
        around_of(*rows),
    )
    ours = np.array([*rate.velocity, *rate.rate, *rate.joint_rates], dtype=float)
    scale = max(1.0, np.abs(wanted).max()) * max(
        1.0, 1e-4 * np.linalg.cond(twin.mass_matrix(state))
    )
    assert np.abs(ours - wanted).max() < 1e-10 * scale


PUSHES = {
    "link": SteadyWrench(
        force=Vec3(0.05, -0.1, 0.08), point=Vec3(0.0, 0.0, -0.1), body=1
    ),
    "torque": SteadyWrench(torque=Vec3(0.002, 0.01, -0.003), body=0),
    "tether": Tether(
        anchor=Vec3(0.5, 0.3, 2.0),
        stiffness=1.0,
        damping=0.2,
        point=Vec3(0.0, 0.0, -0.15),
        body=1,
    ),
}


def falling(plant, *forces):
    """A quarter of a second with rotors and arm left alone, in Euler's steps."""
    base = with_law(
        load_scenario("case1", plant=plant, duration=0.25),
        telling(lambda _: (0.0,) * 4),
    )
    return run(
        dataclasses.replace(base, forces=forces, integrator="euler", ground=False)
    )


@pytest.mark.parametrize("what", sorted(PUSHES))
def test_a_force_of_a_users_own_moves_both_plants_equally(what):
    pytest.importorskip("mujoco")
    ours, theirs, calm = (
        falling("rigid_body", PUSHES[what]),
        falling("mujoco", PUSHES[what]),
        falling("rigid_body"),
    )
    assert ours.status == theirs.status == "completed"
    for name in ("position", "quaternion", "velocity", "rate", "joints", "joint_rates"):
        # semi-implicit Euler on both: 250 steps of rounding
        np.testing.assert_allclose(
            getattr(ours, name), getattr(theirs, name), rtol=0.0, atol=1e-9
        )
    assert np.abs(ours.joints - calm.joints).max() > 1e-3, "it moves the arm"


def test_air_of_a_users_own_drags_both_plants_equally():
    pytest.importorskip("mujoco")
    logs = [
        run(
            dataclasses.replace(
                with_law(
                    load_scenario("case1", plant=plant, duration=0.25),
                    telling(lambda _: (0.0,) * 4),
                ),
                air=(Shear(rate=2.0), Turbulence(sigma=0.7)),
                integrator="euler",
            )
        )
        for plant in ("rigid_body", "mujoco")
    ]
    assert np.abs(logs[0].velocity[-1, 0]) > 1e-3
    np.testing.assert_allclose(logs[0].velocity, logs[1].velocity, rtol=0.0, atol=1e-9)
    # the same memories and draws, at places that are the same up to rounding
    np.testing.assert_allclose(
        logs[0].air_velocity, logs[1].air_velocity, rtol=0.0, atol=1e-9
    )
