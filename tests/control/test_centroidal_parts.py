"""Parts of the centroidal law, each against an oracle that shares no code with it."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from published_laws import NODES, differentiated
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import skyarm
from skyarm.algebra import Mat3, Quaternion, Vec3
from skyarm.algebra.scalars.taylor import Taylor
from skyarm.control.blocks.actuators import command_for
from skyarm.control.blocks.attitude import (
    BaseGains,
    DesiredAttitude,
    angular_acceleration,
    attitude,
    derivative,
    moving,
    posture,
    reachable,
)
from skyarm.control.blocks.extrapolation import Channel, extrapolate
from skyarm.control.blocks.prediction import Disturbance, actuation, predict_across
from skyarm.control.laws.centroidal import make_centroidal
from skyarm.control.laws.centroidal.com_tracking import thrust
from skyarm.control.laws.centroidal.demands import first_following
from skyarm.control.laws.centroidal.step_records import AccelerationDemand, Planned
from skyarm.control.laws.centroidal.tip_tasks import (
    PresentMotion,
    TipGoal,
    goal,
    joint_accelerations,
    level_joints,
    move_goal,
    needed_shift,
    orientation_error,
)
from skyarm.control.laws.centroidal.torques import needed, reaction
from skyarm.control.model import Model
from skyarm.dynamics import State
from skyarm.dynamics.actuators import Command, speed_after
from skyarm.dynamics.kinematics import frame_pose, link_poses
from skyarm.reference import Reference
from skyarm.reference.preview import samples
from support.vehicles import (
    TWINS,
    RandomState,
    random_state,
    random_vehicle,
    rotation_matrix,
)

TRUTH = skyarm.load_vehicle("hummingbird_arm2_rotors")


def array(v):
    return np.array([float(c) for c in v])


def vec(values):
    return Vec3(*(float(v) for v in values))


@pytest.mark.parametrize("joints", [1, 2, 4, 7])
def test_com_and_tip_derivatives_are_those_of_pinocchio_along_a_motion(joints):
    pytest.importorskip("pinocchio")
    rng = np.random.default_rng([5, joints])
    vehicle = random_vehicle(rng, joints)
    twin = TWINS["pinocchio"](vehicle)
    c = rng.normal(size=(5, joints)) / np.array([1.0, 1.0, 2.0, 6.0, 24.0])[:, None]
    still = np.zeros(6 + joints)

    def at(t):
        q = sum(c[k] * t**k for k in range(5))
        state = RandomState(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), q, still)
        return np.concatenate(
            [twin.center_of_mass(state), twin.frame(state, vehicle.end_effector)[0]]
        )

    expected = differentiated([at(t) for t in NODES])
    found = posture(vehicle, [Taylor(column) for column in c.T.tolist()], 4)
    for k in range(5):
        ours = np.concatenate(
            [array(derivative(found.com, k)), array(derivative(found.tip, k))]
        )
        np.testing.assert_allclose(
            ours,
            expected[k],
            rtol=1e-6,
            atol=1e-5 * max(1.0, np.abs(expected[k]).max()),
        )


def test_desired_rate_and_acceleration_are_those_of_the_turning_attitude():
    force = np.array([[1.0, -2.0, 7.0], [3.0, 1.0, -1.0], [-2.0, 4.0, 1.5]])
    yaw = np.array([0.4, 0.8, -0.5])

    def rotation(t):
        f, psi = (
            force[0] + force[1] * t + force[2] * t * t,
            yaw[0] + yaw[1] * t + yaw[2] * t * t,
        )
        b3 = f / np.linalg.norm(f)
        b2 = np.cross(b3, [np.cos(psi), np.sin(psi), 0.0])
        b2 = b2 / np.linalg.norm(b2)
        return np.stack([np.cross(b2, b3), b2, b3], axis=1)

    values = differentiated([rotation(t).ravel() for t in NODES], 2)
    R, first, second = (value.reshape(3, 3) for value in values)
    S = R.T @ first
    rate = np.array([S[2, 1], S[0, 2], S[1, 0]])
    A = R.T @ second - S @ S
    found = attitude(
        Vec3(*(Taylor(column) for column in force.T.tolist())), Taylor(yaw.tolist())
    )
    np.testing.assert_allclose([array(row) for row in found.R.rows], R, atol=1e-12)
    np.testing.assert_allclose(array(found.rate), rate, atol=1e-9)
    np.testing.assert_allclose(
        array(found.acceleration), [A[2, 1], A[0, 2], A[1, 0]], atol=1e-7
    )


@pytest.mark.parametrize(
    "force", [(0.0, 0.0, 0.0), (0.0, 0.0, -9.0), (50.0, -3.0, 1.0), (1e9, 0.0, -1e9)]
)
def test_the_commanded_tilt_is_bounded_for_any_force(force):
    held = reachable(Vec3(*(Taylor((f, 1.0, -1.0)) for f in force)), 1.2, 0.5)
    x, y, z = (c.c[0] for c in held)
    assert z >= 0.5
    assert np.hypot(x, y) == pytest.approx(min(1.2 * z, np.hypot(*force[:2])))
    found = attitude(held, Taylor((0.3, 0.1, 0.0)))
    for v in (*found.R.rows, found.rate, found.acceleration):
        assert np.all(np.isfinite(array(v)))


def test_a_small_tilt_is_not_touched_by_its_bound():
    force = Vec3(*(Taylor((f, 0.2, 0.1)) for f in (1.0, -2.0, 8.0)))
    assert [c.c for c in reachable(force, 1.2, 0.5)] == [c.c for c in force]


@pytest.mark.parametrize(
    ("speed", "wanted"),
    [(480.0, 500.0), (480.0, 455.0), (300.0, 301.0), (500.0, 500.0)],
)
def test_the_inverted_lag_reaches_the_wanted_speed_within_one_period(speed, wanted):
    rotor = TRUTH.rotors[0]
    command = command_for(rotor, speed, wanted, 0.005, 1.0)
    assert speed_after(rotor, speed, command, 0.005) == pytest.approx(wanted, abs=1e-9)
    tau = rotor.time_constant_up if wanted > speed else rotor.time_constant_down
    assert speed + (command - speed) * (1.0 - np.exp(-0.005 / tau)) == pytest.approx(
        wanted, abs=1e-9
    )
    assert command_for(rotor, speed, wanted, 0.005, 0.0) == wanted


@pytest.mark.parametrize(
    ("speed", "wanted"), [(100.0, 830.0), (800.0, 10.0), (480.0, 2000.0)]
)
def test_the_inverted_lag_stays_within_what_the_rotor_can_do(speed, wanted):
    assert (
        0.0
        <= command_for(TRUTH.rotors[0], speed, wanted, 0.005, 1.0)
        <= TRUTH.rotors[0].max_speed
    )


def held(value, rate, acceleration):
    zero = Vec3(0.0, 0.0, 0.0)
    return Reference(
        position=Vec3(value, 0.0, 0.0),
        velocity=Vec3(rate, 0.0, 0.0),
        acceleration=Vec3(acceleration, 0.0, 0.0),
        jerk=zero,
        snap=zero,
    ).dense()


def published(signal, ticks, jump=None):
    """Series of x at each control tick from samples every 20 ms of ``signal(t) ->
    value, rate, acceleration``.
    """
    channels, age, started, found = (Channel(),) * 4, 0.0, 0.0, []
    for k in range(ticks):
        held_samples = samples(held(*signal((k // 4) * 0.02)))
        series, channels, age = extrapolate(
            channels, age, held_samples, started, 0.005, 0.02
        )
        started = 1.0
        found.append([series[0].derivative(i) for i in range(5)])
    return np.array(found)


def test_held_samples_of_a_quartic_are_continued_exactly():
    """Its accelerations are a parabola, which three samples fix."""
    p = np.polynomial.Polynomial([0.2, -0.3, 0.5, 0.4, -0.6])
    found = published(lambda t: (p(t), p.deriv(1)(t), p.deriv(2)(t)), 60)
    for k in range(12, 60):
        expected = [p.deriv(i)(0.005 * k) if i else p(0.005 * k) for i in range(5)]
        np.testing.assert_allclose(found[k], expected, rtol=1e-6, atol=1e-7)


def test_a_sine_is_continued_far_better_than_held():
    w = 2.0 * np.pi * 0.5
    found = published(
        lambda t: (np.sin(w * t), w * np.cos(w * t), -w * w * np.sin(w * t)), 400
    )
    t = 0.005 * np.arange(400)
    assert np.abs(found[12:, 0] - np.sin(w * t)[12:]).max() < 1e-6
    assert np.abs(np.sin(w * 0.02 * (np.arange(400) // 4)) - np.sin(w * t)).max() > 0.04


def test_a_jump_does_not_kick_jerk_and_snap():
    """At 0.4 s a rest becomes a cosine: acceleration and value jump, the rate does
    not.
    """
    w = 3.0

    def signal(t):
        s = t - 0.4
        return (
            (0.0, 0.0, 0.0)
            if s < -1e-9
            else (np.cos(w * s), -w * np.sin(w * s), -w * w * np.cos(w * s))
        )

    found = published(signal, 200)
    assert np.abs(found[80:84, 3:]).max() == 0.0
    assert np.abs(found[80:, 3]).max() < 1.5 * w**3
    t = 0.005 * np.arange(200)[80:] - 0.4
    assert np.abs(found[80:, 0] - np.cos(w * t)).max() < 2e-4


def test_a_constant_reference_stays_constant():
    found = published(lambda t: (1.5, 0.0, 0.0), 40)
    assert np.all(found == np.array([1.5, 0.0, 0.0, 0.0, 0.0]))


def planned(rates):
    """A plan of which only the references' rates matter."""
    zero, series = (
        Vec3(0.0, 0.0, 0.0),
        tuple(Taylor((0.0, rate, 0.0)) for rate in rates),
    )
    return Planned(R=Mat3.identity(), rate=zero, alpha=zero, proper=zero, joints=series)


def test_torques_give_the_wished_accelerations_to_pinocchios_free_vehicle():
    """The real thrust and the unknown force go in; base torque and joint torques are
    what the demand needs.
    """
    pytest.importorskip("pinocchio")
    for joints in (0, 2, 5):
        rng = np.random.default_rng([9, joints])
        vehicle = random_vehicle(rng, joints)
        state, n = random_state(rng, joints), joints
        unknown = Disturbance(
            force=vec(rng.normal(size=3)),
            torque=vec(rng.normal(size=3)),
            efforts=tuple(rng.normal(size=n).tolist()),
        )
        demand = AccelerationDemand(
            thrust=float(10.0 * rng.normal()),
            alpha=vec(5.0 * rng.normal(size=3)),
            joints=tuple(rng.normal(size=n).tolist()),
            planned=planned((0.0,) * n),
        )
        now = State(
            position=vec(state.position),
            quaternion=Quaternion(*state.quaternion.tolist()),
            velocity=vec(state.velocity[:3]),
            rate=vec(state.velocity[3:6]),
            joints=tuple(state.joints.tolist()),
            joint_rates=tuple(state.velocity[6:].tolist()),
        )
        torque, efforts = needed(Model(vehicle=vehicle), now, demand, unknown)
        R = rotation_matrix(state.quaternion)
        force = np.concatenate(
            [
                R @ [0.0, 0.0, demand.thrust] + array(unknown.force),
                array(torque) + array(unknown.torque),
                np.array(efforts) + np.array(unknown.efforts),
            ]
        )
        found = TWINS["pinocchio"](vehicle).forward_dynamics(state, force, 9.81)
        np.testing.assert_allclose(found[3:6], array(demand.alpha), atol=1e-8)
        np.testing.assert_allclose(found[6:], demand.joints, atol=1e-8)


def flying():
    return State(
        position=Vec3(0.1, -0.2, 1.0),
        quaternion=Quaternion(
            *np.roll(Rotation.from_euler("xyz", [0.2, -0.3, 0.5]).as_quat(), 1).tolist()
        ),
        velocity=Vec3(0.3, 0.1, -0.2),
        rate=Vec3(0.6, -0.9, 0.3),
        joints=(0.4, -0.7),
        joint_rates=(1.5, -2.0),
        rotor_speeds=(500.0, 470.0, 455.0, 510.0),
    )


def test_the_prediction_is_what_mujoco_does_in_that_time():
    pytest.importorskip("mujoco")
    from skyarm.plant.interface import Truth
    from skyarm.plant.mujoco import MujocoPlant
    from support.vehicles import steady_wind

    vehicle = TRUTH.with_joints(damping=0.0)
    vehicle = dataclasses.replace(
        vehicle,
        rotors=tuple(
            dataclasses.replace(r, drag_coefficient=0, rolling_moment_coefficient=0)
            for r in vehicle.rotors
        ),
    )
    push = Vec3(0.8, -0.5, 0.3)
    command = Command(rotor_speeds=(520.0, 440.0, 480.0, 500.0), efforts=(0.02, -0.01))
    none = Disturbance(force=push, torque=Vec3(0.0, 0.0, 0.0), efforts=(0.0, 0.0))
    model = Model(vehicle=vehicle, gravity=9.8)
    done = actuation(model, flying().rotor_speeds, command, 0.005)
    found = predict_across(model, flying(), done, none, 0.005, False)
    wind = steady_wind(push, Vec3(0.0, 0.0, 0.0), Vec3(0.0, 0.0, 0.0))
    plant = MujocoPlant(Truth(vehicle=vehicle, gravity=9.8), wind, "euler", 1e-5)
    from skyarm.records.leaves import leaves

    x = plant.advance(
        tuple(leaves(flying())), tuple(leaves(command)), tuple(leaves(wind)), 0.005
    )
    ours = np.array(leaves(found))
    # one step against 500: accelerations of 100 rad/s^2 that change by some percent
    # within 5 ms
    np.testing.assert_allclose(ours[:7], x[:7], atol=2e-5)
    np.testing.assert_allclose(ours[7:17], x[7:17], atol=1e-2)
    np.testing.assert_allclose(ours[17:], x[17:], rtol=1e-12)


def test_link_orientations_of_a_level_base_are_absolute_angles_for_parallel_axes():
    vehicle, pitch, th = TRUTH, 0.27, (0.2, -0.15)
    par = make_centroidal(Model(vehicle=vehicle), mode="tip").par
    joints = moving(th, (0.0, 0.0), (0.0, 0.0), (0.0, 0.0), (0.0, 0.0))
    zero = [Vec3(0.0, 0.0, 0.0)] * 5
    wanted = goal(
        vehicle, zero, Taylor.constant(0.0, 4), joints, posture(vehicle, joints, 4)
    )
    c, s = np.cos(pitch), np.sin(pitch)
    R = Mat3(Vec3(c, 0.0, s), Vec3(0.0, 1.0, 0.0), Vec3(-s, 0.0, c))
    poses = link_poses(vehicle, th)
    change = level_joints(vehicle, par.tip, wanted, R, poses)
    # the error is the sine of the angle; the posture's weight is 1e-5 of the
    # orientations'
    np.testing.assert_allclose(change, [-np.sin(pitch), 0.0], atol=1e-4)
    error = orientation_error(R @ poses[0].R, wanted.links[0])
    np.testing.assert_allclose(array(error), [0.0, -np.sin(pitch), 0.0], atol=1e-12)


def test_goal_rates_are_those_of_the_turning_links():
    """Angular velocity and acceleration of every link of a level base, by SciPy's
    rotations of a random arm.
    """
    rng = np.random.default_rng(3)
    vehicle = random_vehicle(rng, 4)
    c, yaw = rng.normal(size=(3, 4)), np.array([0.3, 0.7, -0.4])

    def rotations(t):
        q = tuple((c[0] + c[1] * t + 0.5 * c[2] * t * t).tolist())
        turn = Rotation.from_euler(
            "z", yaw[0] + yaw[1] * t + 0.5 * yaw[2] * t * t
        ).as_matrix()
        return np.array(
            [
                turn @ np.array([array(row) for row in pose.R.rows])
                for pose in link_poses(vehicle, q)
            ]
        )

    joints = moving(*c.tolist(), (0.0,) * 4, (0.0,) * 4)
    level = posture(vehicle, joints, 4)
    found = goal(
        vehicle,
        [Vec3(0.0, 0.0, 0.0)] * 5,
        Taylor.of_derivatives([*yaw.tolist(), 0.0, 0.0]),
        joints,
        level,
    )
    values = differentiated([rotations(t).ravel() for t in NODES], 2)
    R, first, second = (value.reshape(4, 3, 3) for value in values)
    for i in range(4):
        S = first[i] @ R[i].T
        A = second[i] @ R[i].T - S @ S
        np.testing.assert_allclose(
            array(found.rates[i]), [S[2, 1], S[0, 2], S[1, 0]], atol=1e-8
        )
        np.testing.assert_allclose(
            array(found.accelerations[i]), [A[2, 1], A[0, 2], A[1, 0]], atol=1e-6
        )
        np.testing.assert_allclose(
            [array(row) for row in found.links[i].rows], R[i], atol=1e-12
        )


@pytest.mark.parametrize("joints", [2, 4, 7])
def test_joint_accelerations_give_the_tip_and_the_links_what_they_were_asked_for(
    joints,
):
    """A motion of Pinocchio's vehicle, differentiated by interpolation, is recovered
    from its own tip and links.
    """
    pytest.importorskip("pinocchio")
    rng = np.random.default_rng([11, joints])
    vehicle = random_vehicle(rng, joints)
    twin, par = TWINS["pinocchio"](vehicle), make_exact_gains()
    first = Rotation.from_rotvec(rng.normal(size=3))
    w, alpha, p, q = (
        rng.normal(size=3),
        rng.normal(size=3),
        rng.normal(size=(3, 3)),
        rng.normal(size=(3, joints)),
    )

    def at(t):
        x, y, z, s = (
            first * Rotation.from_rotvec(w * t + 0.5 * alpha * t * t)
        ).as_quat()
        turned = np.array([s, x, y, z])
        state = RandomState(
            p[0] + p[1] * t + 0.5 * p[2] * t * t,
            turned,
            q[0] + q[1] * t + 0.5 * q[2] * t * t,
            still,
        )
        frames = [twin.frame(state, f"tip{i}") for i in range(joints)]
        return np.concatenate(
            [
                twin.center_of_mass(state),
                frames[-1][0],
                *(frame[1].ravel() for frame in frames),
            ]
        )

    still = np.zeros(6 + joints)
    values = differentiated([at(t) for t in NODES], 2)
    com_acceleration, tip = values[2][:3], [vec(value[3:6]) for value in values]
    rates, accelerations = [], []
    for i in range(joints):
        R, Rd, Rdd = (value[6 + 9 * i : 15 + 9 * i].reshape(3, 3) for value in values)
        S = Rd @ R.T
        A = Rdd @ R.T - S @ S
        rates.append(Vec3(S[2, 1], S[0, 2], S[1, 0]))
        accelerations.append(Vec3(A[2, 1], A[0, 2], A[1, 0]))
    R = Mat3(*(vec(row) for row in first.as_matrix()))
    now = PresentMotion(
        R=R,
        rate=vec(w),
        alpha=vec(alpha),
        joints=tuple(q[0].tolist()),
        joint_rates=tuple(q[1].tolist()),
        posture=posture(
            vehicle, moving(q[0].tolist(), q[1].tolist(), (0.0,) * joints), 2
        ),
        tip=tip[0],
        tip_velocity=tip[1],
        com_acceleration=vec(com_acceleration),
    )
    wanted = TipGoal(
        tip=(tip[0], tip[1], tip[2]),
        links=tuple(R @ pose.R for pose in link_poses(vehicle, now.joints)),
        rates=tuple(rates),
        accelerations=tuple(accelerations),
    )
    found = joint_accelerations(vehicle, par, wanted, now, tuple(q[2].tolist()))
    # interpolation differentiates twice to about 1e-8, which the least squares enlarge
    np.testing.assert_allclose(found, q[2], atol=1e-5)


def make_exact_gains():
    """Both tasks weigh alike, so that an error in either shows."""
    gains = make_centroidal(Model(vehicle=TRUTH), mode="tip").par.tip
    return dataclasses.replace(gains, damping=1.0, posture=1e-6)


@pytest.mark.parametrize("change", [0.0, 2.0])
def test_the_forces_derivatives_are_those_along_the_motion_that_the_thrust_makes(
    change,
):
    """The centre of mass under f b3 + d, d as it is known to change: integrated by
    SciPy, differentiated.
    """
    rng = np.random.default_rng(8)
    par = make_centroidal(Model(vehicle=TRUTH, gravity=9.8)).par
    mass, d, w = float(TRUTH.mass), rng.normal(size=3), rng.normal(size=3)
    c = rng.normal(size=(5, 3)) * 0.3
    kp, kv, weight = (
        array(par.base.position),
        array(par.base.velocity),
        np.array([0.0, 0.0, 9.8]),
    )
    rate, bend = (
        change * np.array([0.5, -0.4, 0.3]),
        change * np.array([-2.0, 1.0, 3.0]),
    )
    first = Rotation.from_rotvec([0.1, -0.2, 0.3])

    def b3(t):
        return (first * Rotation.from_rotvec(w * t)).as_matrix()[:, 2]

    def pushed(t):
        return d + rate * t + 0.5 * bend * t * t

    def reference(t, k):
        signals = [np.polynomial.Polynomial(column) for column in c.T]
        return np.array([(x.deriv(k) if k else x)(t) for x in signals])

    def force(t, x, v):
        off = x - reference(t, 0)
        far = 1.0 + (off @ off / (4.0 * (kv[0] / kp[0]) ** 2) ** 2) ** 2
        pull = kp * off * far ** (-1.0 / 8.0) + kv * (v - reference(t, 1))
        pull = pull / np.sqrt(1.0 + pull @ pull / 64.0)
        return mass * (reference(t, 2) + weight - pull) - pushed(t)

    def slope(t, y):
        f = force(t, y[:3], y[3:])
        return np.concatenate([y[3:], (f @ b3(t) * b3(t) + pushed(t)) / mass - weight])

    start = np.concatenate([reference(0.0, 0) + 0.05, reference(0.0, 1) - 0.2])
    paths = [
        solve_ivp(
            slope,
            (0.0, sign * 0.02),
            start,
            rtol=1e-12,
            atol=1e-13,
            dense_output=True,
            method="DOP853",
            max_step=0.005,
        ).sol
        for sign in (-1.0, 1.0)
    ]
    # the bound of the pull bends within some 50 ms
    times = 0.1 * NODES
    along = [paths[int(t > 0.0)](t) for t in times]
    expected = differentiated(
        [force(t, y[:3], y[3:]) for t, y in zip(times, along, strict=True)], 2, 0.1
    )
    found = thrust(
        par,
        mass,
        wanted=[vec(reference(0.0, k)) for k in range(5)],
        position=vec(start[:3]),
        velocity=vec(start[3:]),
        R=Mat3(*(vec(row) for row in first.as_matrix())),
        w=vec(w),
        disturbance=(vec(d), vec(rate), vec(bend)),
    )
    for k, tolerance in enumerate((1e-9, 1e-6, 1e-4)):
        np.testing.assert_allclose(
            array(derivative(found.force, k)),
            expected[k],
            rtol=tolerance,
            atol=tolerance,
        )
    f = array(derivative(found.force, 0)) @ b3(0.0)
    assert found.along == pytest.approx(f, rel=1e-12)
    np.testing.assert_allclose(
        array(found.acceleration), (f * b3(0.0) + d) / mass - weight, atol=1e-12
    )


def test_the_shift_moves_with_the_tilting_tip():
    """Offset, rate and acceleration of a turning vehicle with a moving arm, by
    interpolation of the offset itself.
    """
    rng = np.random.default_rng(12)
    vehicle = random_vehicle(rng, 3)
    level, arm = rng.normal(size=(3, 3)), rng.normal(size=(3, 3))
    first, w, alpha, yaw = (
        Rotation.from_rotvec([0.2, -0.1, 0.4]),
        rng.normal(size=3),
        rng.normal(size=3),
        (0.4, 0.5, -0.6),
    )
    zero = (0.0,) * 3
    postures = [
        posture(vehicle, moving(*rows.tolist(), zero, zero), 4) for rows in (level, arm)
    ]

    def tip_of(rows, t):
        q = tuple((rows[0] + rows[1] * t + 0.5 * rows[2] * t * t).tolist())
        return array(frame_pose(vehicle, vehicle.frame(), q).p)

    def offset(t):
        turn = Rotation.from_euler("z", yaw[0] + yaw[1] * t + 0.5 * yaw[2] * t * t)
        leaning = first * Rotation.from_rotvec(w * t + 0.5 * alpha * t * t)
        return turn.apply(tip_of(level, t)) - leaning.apply(tip_of(arm, t))

    still = DesiredAttitude(
        Mat3(*(vec(row) for row in first.as_matrix())), vec(w), vec(alpha)
    )
    series = Taylor.of_derivatives([*yaw, 0.0, 0.0])
    expected = differentiated([offset(t) for t in NODES], 2)
    found = needed_shift(postures[0].tip, series, postures[1].tip, still)
    for k in range(3):
        np.testing.assert_allclose(
            array(found[k]),
            expected[k],
            atol=1e-6 * max(1.0, np.abs(expected[k]).max()),
        )


def test_without_gains_the_rate_error_does_not_change():
    """Lee's feed-forward: w - R^T R_d w_d stays what it is while both attitudes turn
    and accelerate.
    """
    rng = np.random.default_rng(4)
    first, goal_ = (
        Rotation.from_rotvec([0.3, -0.2, 0.1]),
        Rotation.from_rotvec([-0.4, 0.5, 0.2]),
    )
    w, w_d, a_d = rng.normal(size=(3, 3))
    rows = [Mat3(*(vec(row) for row in turn.as_matrix())) for turn in (first, goal_)]
    zero = Vec3(0.0, 0.0, 0.0)
    gains = BaseGains(position=zero, velocity=zero, attitude=zero, rate=zero)
    alpha = array(
        angular_acceleration(
            gains, DesiredAttitude(rows[1], vec(w_d), vec(a_d)), rows[0], vec(w)
        )
    )

    def error(t):
        now = first * Rotation.from_rotvec(w * t + 0.5 * alpha * t * t)
        then = goal_ * Rotation.from_rotvec(w_d * t + 0.5 * a_d * t * t)
        return w + alpha * t - (now.inv() * then).apply(w_d + a_d * t)

    np.testing.assert_allclose(
        differentiated([error(t) for t in NODES], 1)[1], 0.0, atol=1e-9
    )


def test_the_attitude_law_turns_back_and_brakes():
    rows = Mat3(
        *(vec(row) for row in Rotation.from_rotvec([0.1, 0.0, 0.0]).as_matrix())
    )
    level = DesiredAttitude(Mat3.identity(), Vec3(0.0, 0.0, 0.0), Vec3(0.0, 0.0, 0.0))
    gains = make_centroidal(Model(vehicle=TRUTH)).par.base
    leaning = array(angular_acceleration(gains, level, rows, Vec3(0.0, 0.0, 0.0)))
    turning = array(
        angular_acceleration(gains, level, Mat3.identity(), Vec3(0.0, 0.5, 0.0))
    )
    np.testing.assert_allclose(
        leaning, [-gains.attitude.x * np.sin(0.1), 0.0, 0.0], atol=1e-12
    )
    np.testing.assert_allclose(turning, [0.0, -0.5 * gains.rate.y, 0.0], atol=1e-12)


def level_flight(vehicle, joint_rates):
    """A state at the origin, level, whose joints move."""
    zero = Vec3(0.0, 0.0, 0.0)
    return State(
        position=zero,
        quaternion=Quaternion(1.0, 0.0, 0.0, 0.0),
        velocity=zero,
        rate=zero,
        joints=(0.3, -0.5),
        joint_rates=joint_rates,
        rotor_speeds=(400.0,) * len(vehicle.rotors),
    )


NONE = Disturbance(
    force=Vec3(0.0, 0.0, 0.0), torque=Vec3(0.0, 0.0, 0.0), efforts=(0.0, 0.0)
)


def test_known_friction_is_given_back_viscous_at_the_present_rate_dry_at_the_desired():
    dry = TRUTH.with_joints(damping=0.02, coulomb=0.03, coulomb_rate=0.1)
    smooth = TRUTH.with_joints(damping=0.0, coulomb=0.0)
    demand = AccelerationDemand(
        thrust=6.0,
        alpha=Vec3(0.0, 0.0, 0.0),
        joints=(1.0, -2.0),
        planned=planned((0.1, -0.2)),
    )
    now = level_flight(TRUTH, (1.5, -0.4))
    (torque, efforts), (bare_torque, bare) = (
        needed(Model(vehicle=v), now, demand, NONE) for v in (dry, smooth)
    )
    given = np.array(efforts) - np.array(bare)
    # 0.02 qd + 0.03 tanh(qd_d / 0.1)
    np.testing.assert_allclose(
        given, [0.03 + 0.03 * np.tanh(1.0), -0.008 - 0.03 * np.tanh(2.0)], rtol=1e-10
    )
    assert array(torque) == pytest.approx(array(bare_torque), abs=1e-15)


@pytest.mark.parametrize("joints", [1, 2, 5])
def test_a_torque_without_what_fell_away_turns_the_base_as_wished(joints):
    """Joint torques less than wanted, the body torque less by as much as follows: the
    same angular acceleration.
    """
    pytest.importorskip("pinocchio")
    rng = np.random.default_rng([13, joints])
    vehicle, state = random_vehicle(rng, joints), random_state(rng, joints)
    missing, force = rng.normal(size=joints), rng.normal(size=6 + joints)
    found = reaction(vehicle, tuple(state.joints.tolist()))
    lost = array(found.torque(found.accelerations(missing.tolist())))
    twin, less = TWINS["pinocchio"](vehicle), force.copy()
    less[3:6] -= lost
    less[6:] -= missing
    one, other = (twin.forward_dynamics(state, each, 9.81) for each in (force, less))
    np.testing.assert_allclose(
        other[3:6], one[3:6], atol=1e-8 * (1.0 + np.abs(one).max())
    )
    assert np.abs(other[6:] - one[6:]).max() > 1e-3


def test_nothing_falls_away_from_a_vehicle_without_joints():
    found = reaction(skyarm.load_vehicle("hummingbird"), ())
    assert tuple(found.torque(found.accelerations(()))) == (0, 0, 0)


@pytest.mark.parametrize("length", [0.03, 0.12, 0.5])
def test_the_tip_follows_base_errors_longer_than_its_reach(length):
    """A share e^4 / (e^4 + reach^4) of a resting error: at the reach itself a half."""
    zero = Vec3(0.0, 0.0, 0.0)
    still = TipGoal(tip=(zero, zero, zero), links=(), rates=(), accelerations=())
    found = move_goal(still, [Vec3(length, 0.0, 0.0), zero, zero], 0.12).tip
    expected = length**5 / (length**4 + 0.12**4)
    np.testing.assert_allclose(
        array(found[0]), [expected, 0.0, 0.0], rtol=1e-12, atol=1e-15
    )


def asked_of_two_arms(gains, pull, preferred):
    """Joint accelerations of the resting octorotor whose right tip is asked for
    ``pull``, m/s^2.
    """
    vehicle, zero = skyarm.load_vehicle("octo_coaxial_two_arms"), Vec3(0.0, 0.0, 0.0)
    still = (0.0,) * vehicle.n
    arms = posture(vehicle, moving(still, still, still), 2)
    tip = derivative(arms.tip, 0)
    now = PresentMotion(
        R=Mat3.identity(),
        rate=zero,
        alpha=zero,
        joints=still,
        joint_rates=still,
        posture=arms,
        tip=tip,
        tip_velocity=zero,
        com_acceleration=zero,
    )
    links = tuple(pose.R for pose in link_poses(vehicle, still))
    wanted = TipGoal(
        tip=(tip, zero, vec(pull)),
        links=links,
        rates=(zero,) * 5,
        accelerations=(zero,) * 5,
    )
    return np.array(
        joint_accelerations(vehicle, gains, wanted, now, preferred), dtype=float
    )


def test_another_arms_slide_keeps_its_own_reference_whatever_the_tip_is_asked_for():
    gains = make_centroidal(Model(vehicle=TRUTH), mode="tip").par.tip
    preferred = (0.0, 0.0, 0.0, 0.0, 0.7)
    found = [
        asked_of_two_arms(gains, pull, preferred)[4]
        for pull in ([0.0, 0.0, 0.0], [3.0, -5.0, 8.0])
    ]
    assert found == pytest.approx([0.7, 0.7], abs=1e-9)


def test_a_slide_that_carries_the_tip_is_damped_by_its_distance():
    """Of the hanging arm the slide alone moves the tip along z, by 1 less the share of
    mass that it takes along.

    Least squares by hand: (c a + w b) / (c^2 + w) with w = (damping / reach)^2, wanted
    a, preferred b.
    """
    gains = make_centroidal(Model(vehicle=TRUTH), mode="tip").par.tip
    vehicle = skyarm.load_vehicle("octo_coaxial_two_arms")
    c = 1.0 - float(vehicle.links[2].body.mass) / float(vehicle.mass)
    w, sign = (0.03 / 0.12) ** 2, float(vehicle.links[2].joint.axis.z)
    found = asked_of_two_arms(gains, [0.0, 0.0, 2.0], (0.0, 0.0, 0.5, 0.0, 0.0))[2]
    assert found == pytest.approx((sign * c * 2.0 + w * 0.5) / (c * c + w), rel=1e-6)


def test_the_mean_motion_of_the_arm_is_kept_of_a_vehicle_with_an_arm_alone():
    models = {
        name: Model(vehicle=skyarm.load_vehicle(name))
        for name in ("tilted_hexarotor", "hummingbird_arm2")
    }
    arms = {
        name: first_following(make_centroidal(model).par).arm
        for name, model in models.items()
    }
    assert arms["tilted_hexarotor"] == ()
    assert arms["hummingbird_arm2"].size == 0.0
