"""The centroidal law's model over one control period: means of what turns, spins and
pushes in it.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.spatial.transform import Rotation

import skyarm
from skyarm.algebra import Force, Quaternion, Vec3
from skyarm.control.blocks.actuators import command_for
from skyarm.control.blocks.disturbance_observer import (
    filter_pose,
    first_observed,
    nearer_sign,
    observe,
)
from skyarm.control.blocks.prediction import (
    Disturbance,
    acceleration,
    actuation,
    predict_across,
    with_side,
)
from skyarm.control.blocks.stale_readings import Fresh
from skyarm.control.catalogue import make_controller
from skyarm.control.laws.centroidal import make_centroidal
from skyarm.control.laws.centroidal.parameters import ObserverGains
from skyarm.control.laws.ladder import _estimate_disturbance
from skyarm.control.model import Model
from skyarm.dynamics import State
from skyarm.dynamics.actuators import Command, speed_after
from skyarm.reference import Reference
from skyarm.sensing.measurement import blank_measurement
from support.vehicles import TWINS, RandomState, random_quaternion

ARM = skyarm.load_vehicle("hummingbird_arm2_rotors")
MODEL = Model(vehicle=ARM, gravity=9.8)
DT = 0.005
THRUST, MOMENT, DRAG, ROLLING = 8.54858e-6, 0.016, 8.06428e-5, 1e-6
"""Of each rotor, as its file has them."""
NEW = Fresh(
    position=1.0,
    quaternion=1.0,
    velocity=1.0,
    rate=1.0,
    specific_force=1.0,
    joints=1.0,
    joint_rates=1.0,
)
TURNING, COMMANDED = (485.0, 475.0, 480.0, 490.0), (520.0, 450.0, 460.0, 530.0)


def array(v):
    return np.array([float(c) for c in v])


def vec(values):
    return Vec3(*(float(v) for v in values))


def quaternion(rotation):
    x, y, z, w = rotation.as_quat()
    return Quaternion(float(w), float(x), float(y), float(z))


def hubs(vehicle):
    return [
        (array(rotor.position), array(rotor.axis), float(rotor.direction))
        for rotor in vehicle.rotors
    ]


def side(vehicle, speeds, velocity, rate):
    """Force and torque in base axes that rotors add to thrust along body z and its
    torque, rotor by rotor.

    Hub drag -c W v_perp, rolling moment -c_r W v_perp, and what a tilted rotor pushes
    across body z.
    """
    force, torque = np.zeros(3), np.zeros(3)
    for rotor, (position, axis, _), speed in zip(
        vehicle.rotors, hubs(vehicle), speeds, strict=True
    ):
        hub = velocity + np.cross(rate, position)
        across = hub - axis * (hub @ axis)
        drag = -float(rotor.drag_coefficient) * speed * across
        push = float(rotor.thrust_coefficient) * speed**2 * axis * [1.0, 1.0, 0.0]
        force += drag + push
        sense = rotor.direction if rotor.rolling == "signed" else 1
        torque += (
            np.cross(position, drag)
            - sense * float(rotor.rolling_moment_coefficient) * speed * across
        )
    return force, torque


@pytest.mark.parametrize("rolling", ["rotors_sim", "signed"])
@pytest.mark.parametrize("name", ["hummingbird_arm2_rotors", "tilted_hexarotor"])
def test_the_rotors_drag_is_that_of_their_hubs_turned_to_the_world(name, rolling):
    vehicle = skyarm.load_vehicle(name)
    vehicle = dataclasses.replace(
        vehicle,
        rotors=tuple(
            dataclasses.replace(each, rolling=rolling) for each in vehicle.rotors
        ),
    )
    rng = np.random.default_rng(4)
    R, velocity, rate = (
        Rotation.from_euler("ZYX", [0.9, -0.4, 0.6]),
        rng.normal(size=3),
        rng.normal(size=3),
    )
    speeds = rng.uniform(400.0, 600.0, len(vehicle.rotors)).tolist()
    known = Disturbance(
        force=vec(rng.normal(size=3)),
        torque=vec(rng.normal(size=3)),
        efforts=(0.1,) * vehicle.n,
    )
    found = with_side(
        Model(vehicle=vehicle),
        known,
        quaternion(R).rotation(),
        speeds,
        vec(velocity),
        vec(rate),
    )
    force, torque = side(vehicle, speeds, R.inv().apply(velocity), rate)
    # sums of thrusts of some newton cancel
    np.testing.assert_allclose(
        array(found.force), array(known.force) + R.apply(force), atol=1e-13
    )
    np.testing.assert_allclose(
        array(found.torque), array(known.torque) + torque, atol=1e-13
    )
    assert np.abs(force).max() > 0.02
    assert found.efforts == known.efforts


def test_the_stepped_law_feels_the_rotors_drag_in_world_axes():
    """At the first measurement, which is taken as it is: attitude, velocities and rotor
    speeds are those measured.
    """
    controller = make_controller("ct_ladder", MODEL, steps=3)
    R = Rotation.from_euler("ZYX", [0.9, -0.4, 0.6])
    velocity, rate = np.array([1.5, -0.8, 0.4]), np.array([0.5, -0.3, 0.9])
    measured = dataclasses.replace(
        blank_measurement(2, 4),
        quaternion=quaternion(R),
        velocity=vec(velocity),
        rate=vec(rate),
        rotor_speeds=TURNING,
    )
    observed, felt = _estimate_disturbance(
        controller.memory, measured, DT, controller.par
    )
    force, torque = side(ARM, TURNING, R.inv().apply(velocity), rate)
    np.testing.assert_allclose(
        array(felt.force), array(observed.force) + R.apply(force), atol=1e-13
    )
    np.testing.assert_allclose(
        array(felt.torque), array(observed.torque) + torque, atol=1e-13
    )
    np.testing.assert_allclose(array(observed.force), 0.0)


def test_a_law_that_knows_the_rotors_drag_does_what_one_that_found_it_does():
    """Drag in the model, or the same force and torque in what the observer believes,
    with the base as planned.
    """
    R, velocity = (
        Rotation.from_euler("ZYX", [0.9, -0.2, 0.3]),
        np.array([1.5, -0.8, 0.4]),
    )
    measured = dataclasses.replace(
        blank_measurement(2, 4),
        position=Vec3(0.0, 0.0, 1.0),
        quaternion=quaternion(R),
        velocity=vec(velocity),
        joints=(0.3, -0.5),
        rotor_speeds=TURNING,
    )
    still = dict.fromkeys(
        ("joint_rates", "joint_accelerations", "joint_jerks", "joint_snaps"), (0.0, 0.0)
    )
    zero = Vec3(0.0, 0.0, 0.0)
    goal = Reference(
        position=Vec3(0.0, 0.0, 1.0),
        velocity=vec(velocity),
        acceleration=zero,
        yaw=0.9,
        joints=(0.3, -0.5),
        **still,
    ).dense()
    smooth = dataclasses.replace(
        ARM,
        rotors=tuple(
            dataclasses.replace(r, drag_coefficient=0, rolling_moment_coefficient=0)
            for r in ARM.rotors
        ),
    )
    force, torque = side(ARM, TURNING, R.inv().apply(velocity), np.zeros(3))
    commands = []
    for vehicle, push, turn in (
        (ARM, np.zeros(3), np.zeros(3)),
        (smooth, R.apply(force), torque),
    ):
        # a trend would follow the force that only one of them has to find
        controller = make_centroidal(
            Model(vehicle=vehicle, gravity=9.8), lag=(0.0, 0.0), force_trend=0.0
        )
        seen = dataclasses.replace(
            controller.memory.observed,
            force=vec(push),
            torque=vec(turn),
            rotor_speeds=TURNING,
        )
        memory = dataclasses.replace(controller.memory, observed=seen)
        commands.append(
            controller.law(memory, measured, goal, DT, par=controller.par)[1]
        )
    for part in ("rotor_speeds", "efforts"):
        known, learned = (np.array(getattr(command, part)) for command in commands)
        np.testing.assert_allclose(known, learned, rtol=1e-9)
    assert np.abs(force).max() > 0.1


def turn_of(speed, command, t):
    """First-order lag, 12.5 ms up and 25 ms down, t seconds after the command."""
    return command + (speed - command) * np.exp(
        -t / (0.0125 if command > speed else 0.025)
    )


@pytest.mark.parametrize("seed", range(4))
def test_the_observer_predicts_by_pinocchio_in_the_middle_of_the_period(seed):
    """Velocities after the period: attitude and joints half way, squared rotor speeds
    in their mean, drag half way.

    Then v += (1 - b^2) e and d += M e (1 - b)^2 / dt, b = exp(-bandwidth dt). the mean
    of the squares is good to 2e-4 of the part that decays, which is a tenth here: 1e-4
    N of thrust, 1e-5 rad/s of body rate.
    """
    pytest.importorskip("pinocchio")
    rng = np.random.default_rng(seed)
    start = Rotation.from_euler("ZYX", [0.7, -0.2, 0.3])
    # what turns in a period at 20 rad/s: the middle is far from both ends
    end = start * Rotation.from_rotvec(0.06 * rng.normal(size=3))
    middle = start * Rotation.from_rotvec(0.5 * (start.inv() * end).as_rotvec())
    joints, after = rng.uniform(-0.5, 0.5, 2), rng.uniform(-0.5, 0.5, 2)
    velocity, rate, rates = rng.normal(size=3), rng.normal(size=3), rng.normal(size=2)
    push, turn, pulls = (
        0.5 * rng.normal(size=3),
        0.02 * rng.normal(size=3),
        0.01 * rng.normal(size=2),
    )
    efforts = 0.05 * rng.normal(size=2)
    memory = dataclasses.replace(
        first_observed(2, TURNING),
        quaternion=quaternion(start),
        joints=tuple(joints.tolist()),
        velocity=vec(velocity),
        rate=vec(rate),
        joint_rates=tuple(rates.tolist()),
        force=vec([1.0, 2.0, 3.0]),
        torque=vec([0.1, 0.2, 0.3]),
        efforts=(0.3, 0.4),
    )
    known = Disturbance(
        force=vec(push), torque=vec(turn), efforts=tuple(pulls.tolist())
    )
    gains = ObserverGains(force=27.0, torque=31.0, joints=34.0, pose=1e6)
    acted = Command(rotor_speeds=COMMANDED, efforts=tuple(efforts.tolist()))
    off = 0.1 * rng.normal(size=8)

    def observed(measured_velocity, free):
        measurement = dataclasses.replace(
            blank_measurement(2, 4),
            quaternion=quaternion(end),
            joints=tuple(after.tolist()),
            velocity=vec(measured_velocity[:3]),
            rate=vec(measured_velocity[3:6]),
            joint_rates=tuple(measured_velocity[6:].tolist()),
        )
        done = actuation(MODEL, memory.rotor_speeds, acted, DT)
        return observe(MODEL, gains, memory, measurement, done, known, 1.0, free, DT)[0]

    squares = [
        quad(lambda t, w=w, c=c: turn_of(w, c, t) ** 2, 0.0, DT)[0] / DT
        for w, c in zip(TURNING, COMMANDED, strict=True)
    ]
    half = [turn_of(w, c, 0.5 * DT) for w, c in zip(TURNING, COMMANDED, strict=True)]
    thrusts = [THRUST * square * np.array([0.0, 0.0, 1.0]) for square in squares]
    force, torque = side(ARM, half, middle.inv().apply(velocity), rate)
    for thrust, (position, _, direction) in zip(thrusts, hubs(ARM), strict=True):
        force = force + thrust
        torque = torque + np.cross(position, thrust) - direction * MOMENT * thrust
    applied = np.concatenate(
        [middle.apply(force) + push, torque + turn, efforts - 0.001 * rates + pulls]
    )
    twin = TWINS["pinocchio"](ARM)
    q = array(quaternion(middle))
    there = RandomState(
        np.zeros(3), q, 0.5 * (joints + after), np.concatenate([velocity, rate, rates])
    )
    predicted = there.velocity + twin.forward_dynamics(there, applied, 9.8) * DT
    bandwidths = np.array([27.0] * 3 + [31.0] * 3 + [34.0] * 2)
    b = np.exp(-bandwidths * DT)
    missed = twin.mass_matrix(there) @ (off * (1.0 - b) ** 2 / DT)
    for free in ((1.0, 1.0, 1.0), (0.0, 1.0, 0.0)):
        found = observed(predicted + off, free)
        moved = np.concatenate(
            [array(found.velocity), array(found.rate), found.joint_rates]
        )
        np.testing.assert_allclose(moved, predicted + off * (1.0 - b**2), atol=1e-5)
        learned = np.concatenate(
            [array(found.force), array(found.torque), found.efforts]
        )
        # of a joint at its limit a fifth
        shares = np.repeat(np.maximum(free, [0.0, 0.2, 0.2]), [6, 1, 1])
        # a force that shrinks does so at a limit, too, until it is least
        along = missed[:3] @ [1.0, 2.0, 3.0]
        shares[:3] = np.maximum(
            shares[:3], np.clip(-along / (missed[:3] @ missed[:3]), 0.0, 0.05)
        )
        held = shares * missed + [1.0, 2.0, 3.0, 0.1, 0.2, 0.3, 0.3, 0.4]
        # 1e-5 rad/s of prediction, times inertia and (1 - b)^2 / dt = 4 per second
        np.testing.assert_allclose(learned, held, atol=2e-5)
        ends = [turn_of(w, c, DT) for w, c in zip(TURNING, COMMANDED, strict=True)]
        np.testing.assert_allclose(found.rotor_speeds, ends, rtol=1e-12)


def test_accelerations_take_an_unknown_force_in_world_axes():
    """A world force on a turned base without arm, through its centre of mass: F / m,
    whatever the attitude.
    """
    vehicle = skyarm.load_vehicle("hummingbird")
    R = quaternion(Rotation.from_euler("ZYX", [0.9, -0.4, 0.6])).rotation()
    none = Disturbance(
        force=Vec3(0.7, -0.4, 0.2), torque=Vec3(0.0, 0.0, 0.0), efforts=()
    )
    zero = Vec3(0.0, 0.0, 0.0)
    linear, _, _ = acceleration(
        Model(vehicle=vehicle, gravity=9.8),
        R,
        zero,
        (),
        (),
        Force(zero, zero),
        (),
        none,
    )
    expected = np.array([0.7, -0.4, 0.2]) / float(vehicle.mass) - [0.0, 0.0, 9.8]
    np.testing.assert_allclose(array(linear), expected, rtol=1e-12)


def test_a_constant_acceleration_is_carried_exactly():
    """p + v t + a t^2 / 2 for the base, its heading and two slides along body z:
    Newton's equations solved by NumPy.
    """
    base = dataclasses.replace(ARM.base, com=Vec3(0.0, 0.0, 0.0))
    slides = tuple(
        dataclasses.replace(
            link,
            joint=dataclasses.replace(
                link.joint,
                kind="prismatic",
                axis=Vec3(0, 0, 1),
                damping=0.0,
                lower=-1.0,
                upper=1.0,
            ),
        )
        for link in ARM.links
    )
    smooth = tuple(
        dataclasses.replace(r, drag_coefficient=0, rolling_moment_coefficient=0)
        for r in ARM.rotors
    )
    vehicle = dataclasses.replace(ARM, base=base, links=slides, rotors=smooth)
    speeds, efforts, extra = (500.0,) * 4, np.array([-0.4, -0.2]), np.array([0.1, -0.3])
    # sideways it would turn the base, whose arm hangs below it
    push, twist = np.array([0.0, 0.0, 0.3]), 0.05
    start = State(
        position=Vec3(0.1, -0.2, 1.0),
        quaternion=Quaternion(1.0, 0.0, 0.0, 0.0),
        velocity=Vec3(0.3, 0.1, -0.2),
        rate=Vec3(0.0, 0.0, 0.7),
        joints=(0.02, -0.03),
        joint_rates=(0.4, -0.6),
        rotor_speeds=speeds,
    )
    unknown = Disturbance(
        force=vec(push), torque=Vec3(0.0, 0.0, twist), efforts=tuple(extra.tolist())
    )
    model = Model(vehicle=vehicle, gravity=9.8)
    done = actuation(
        model, speeds, Command(rotor_speeds=speeds, efforts=tuple(efforts)), DT
    )
    found = predict_across(model, start, done, unknown, DT, False)
    mb, m1, m2 = (float(body.mass) for body in (base, *(link.body for link in slides)))
    whole = mb + m1 + m2
    M = np.array([[whole, m1 + m2, m2], [m1 + m2, m1 + m2, m2], [m2, m2, m2]])
    weight = 9.8 * M[0]
    up, *slid = np.linalg.solve(
        M, [4 * THRUST * 500.0**2 + push[2], *(efforts + extra)] - weight
    )
    a = np.array([0.0, 0.0, up])
    v = array(start.velocity)
    # sums of numbers near 1
    np.testing.assert_allclose(
        array(found.position),
        array(start.position) + v * DT + 0.5 * a * DT**2,
        atol=1e-14,
    )
    np.testing.assert_allclose(array(found.velocity), v + a * DT, atol=1e-13)
    q, qd = np.array(start.joints), np.array(start.joint_rates)
    np.testing.assert_allclose(
        found.joints, q + qd * DT + 0.5 * np.array(slid) * DT**2, atol=1e-14
    )
    np.testing.assert_allclose(found.joint_rates, qd + np.array(slid) * DT, atol=1e-12)
    spin = twist / sum(
        float(body.inertia.zz) for body in (base, *(link.body for link in slides))
    )
    # about one axis rotations add up
    yaw = 2.0 * np.arctan2(found.quaternion.z, found.quaternion.w)
    assert yaw == pytest.approx(0.7 * DT + 0.5 * spin * DT**2, abs=1e-13)


def test_the_rotors_thrust_in_a_step_is_the_mean_of_its_squares():
    """Simpson's rule over 5 ms is good to (5 / 12.5)^4 / 180 of what the lag of 12.5 ms
    takes; one end to a fifth.
    """
    vehicle = skyarm.load_vehicle("hummingbird")
    start = State(
        position=Vec3(0.0, 0.0, 1.0),
        quaternion=Quaternion(1.0, 0.0, 0.0, 0.0),
        velocity=Vec3(0.0, 0.0, 0.0),
        rate=Vec3(0.0, 0.0, 0.0),
        joints=(),
        joint_rates=(),
        rotor_speeds=(450.0,) * 4,
    )
    none = Disturbance(
        force=Vec3(0.0, 0.0, 0.0), torque=Vec3(0.0, 0.0, 0.0), efforts=()
    )
    model = Model(vehicle=vehicle, gravity=9.8)
    done = actuation(
        model, start.rotor_speeds, Command(rotor_speeds=(550.0,) * 4, efforts=()), DT
    )
    found = predict_across(model, start, done, none, DT, False)
    k, m = float(vehicle.rotors[0].thrust_coefficient), float(vehicle.mass)
    gained = 4 * k * quad(lambda t: turn_of(450.0, 550.0, t) ** 2, 0.0, DT)[0] / m
    assert found.velocity.z == pytest.approx(
        gained - 9.8 * DT, abs=2e-4 * (4 * k * 550.0**2 * DT / m - gained)
    )


@pytest.mark.parametrize("seed", range(20))
def test_of_an_attitudes_two_quaternions_the_nearer_is_taken(seed):
    """Each component decides alone in one of four cases; then any two attitudes, by
    their distance in R^4.
    """
    rng = np.random.default_rng(seed)
    for axis in range(4):
        one = np.zeros(4)
        one[axis] = 1.0
        for sign in (1.0, -1.0):
            assert array(
                nearer_sign(
                    Quaternion(*(sign * one).tolist()), Quaternion(*one.tolist())
                )
            ) == pytest.approx(one)
    q, before = random_quaternion(rng), random_quaternion(rng)
    near = min((q, -q), key=lambda each: np.linalg.norm(each - before))
    assert (
        array(
            nearer_sign(Quaternion(*q.tolist()), Quaternion(*before.tolist()))
        ).tolist()
        == near.tolist()
    )


def test_the_filtered_place_follows_estimated_velocities_and_a_measured_share():
    """The place is carried, then pulled by the share 1 - exp(-bandwidth dt) along
    SciPy's arc; at first all the way.
    """
    start = Rotation.from_euler("ZYX", [2.9, -0.4, 0.6])
    memory = dataclasses.replace(
        first_observed(2, TURNING),
        position=Vec3(0.1, 0.2, 1.0),
        quaternion=quaternion(start),
        joints=(0.3, -0.5),
        velocity=Vec3(1.0, -2.0, 0.5),
        rate=Vec3(0.6, -0.9, 0.3),
        joint_rates=(1.5, -2.0),
    )
    gone = start * Rotation.from_rotvec(DT * array(memory.rate))
    offset = np.array([0.004, -0.003, 0.005])
    end = gone * Rotation.from_rotvec(offset)
    measured = dataclasses.replace(
        blank_measurement(2, 4),
        position=Vec3(0.3, 0.1, 1.2),
        quaternion=Quaternion(*(-c for c in quaternion(end))),
        joints=(0.4, -0.2),
    )
    carried_to = array(memory.position) + DT * array(memory.velocity)
    joints = np.array(memory.joints) + DT * np.array(memory.joint_rates)
    for started, share in ((1.0, 1.0 - np.exp(-60.0 * DT)), (0.0, 1.0)):
        found = filter_pose(60.0, memory, measured, NEW, started, DT)
        expected = carried_to + share * (array(measured.position) - carried_to)
        np.testing.assert_allclose(array(found.position), expected, rtol=1e-13)
        np.testing.assert_allclose(
            found.joints,
            joints + share * (np.array(measured.joints) - joints),
            rtol=1e-13,
        )
        w, x, y, z = array(found.quaternion)
        left = (gone * Rotation.from_rotvec(share * offset)).inv() * Rotation.from_quat(
            [x, y, z, w]
        )
        # the chord for the arc: a cube of 7 mrad
        assert left.magnitude() < 1e-8


def test_a_repeated_place_is_carried_by_the_estimated_velocities_alone():
    memory = dataclasses.replace(
        first_observed(2, TURNING),
        velocity=Vec3(1.0, -2.0, 0.5),
        rate=Vec3(0.6, -0.9, 0.3),
        joint_rates=(1.5, -2.0),
    )
    turn = Rotation.from_rotvec(0.1 * np.ones(3))
    measured = dataclasses.replace(
        blank_measurement(2, 4),
        position=Vec3(0.3, 0.1, 1.2),
        quaternion=quaternion(turn),
        joints=(0.4, -0.2),
    )
    new = filter_pose(60.0, memory, measured, NEW, 1.0, DT)
    for name in ("position", "quaternion", "joints"):
        found = filter_pose(
            60.0, memory, measured, dataclasses.replace(NEW, **{name: 0.0}), 1.0, DT
        )
        carried = {
            "position": DT * array(memory.velocity),
            "quaternion": array(
                quaternion(Rotation.from_rotvec(DT * array(memory.rate)))
            ),
            "joints": DT * np.array(memory.joint_rates),
        }
        for each, alone in carried.items():
            wanted = alone if each == name else np.array([*getattr(new, each)])
            np.testing.assert_allclose([*getattr(found, each)], wanted, atol=1e-8)
        assert np.abs(np.subtract([*getattr(new, name)], carried[name])).max() > 0.005
        # the first one is taken all the same
        first = filter_pose(
            60.0, memory, measured, dataclasses.replace(NEW, **{name: 0.0}), 0.0, DT
        )
        np.testing.assert_allclose(
            [*getattr(first, name)], [*getattr(measured, name)], atol=1e-12
        )


@pytest.mark.parametrize(
    ("speed", "wanted"),
    [(855.0, 870.0), (845.0, 2000.0), (838.0, 900.0), (830.0, 839.0)],
)
def test_no_more_is_wanted_of_a_rotor_than_its_highest_speed(speed, wanted):
    """A measured speed may lie above it, by noise; the demand is cut before the lag is
    undone, and reached as ever.
    """
    rotor = ARM.rotors[0]
    command = command_for(rotor, speed, wanted, DT, 1.0)
    reached = command + (speed - command) * np.exp(
        -DT / (0.0125 if command > speed else 0.025)
    )
    # from below, the command is at its limit, and so is what can be reached
    expected = min(838.0, 838.0 + (speed - 838.0) * np.exp(-DT / 0.0125))
    assert reached == pytest.approx(expected, abs=1e-9)
    assert speed_after(rotor, speed, command, DT) == pytest.approx(expected, abs=1e-9)
    assert command_for(rotor, speed, wanted, DT, 0.0) == 838.0
