"""The carrying part compensates a known wrench at the tip, estimates what the tip
bears, and forgets on request.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import skyarm
from skyarm.algebra import ZERO3, Mat3, Quaternion, Sym3, Vec3
from skyarm.control.blocks.prediction import Disturbance
from skyarm.control.blocks.tip_force import ForceErrors
from skyarm.control.controller import ControllerError, part_of
from skyarm.control.laws.centroidal import make_centroidal
from skyarm.control.laws.centroidal.contact.carrying import (
    FIRM,
    CarryingGains,
    inertia_ratio,
    planned_effect,
    shares_of_tilt,
    tip_wrench,
)
from skyarm.control.laws.centroidal.law import continue_reference
from skyarm.control.model import Model
from skyarm.dynamics.actuators.load_limits import largest_load
from skyarm.dynamics.kinematics import frame_pose, link_poses
from skyarm.dynamics.point_motion import PointMotion
from skyarm.dynamics.state import State
from skyarm.records.leaves import leaves
from skyarm.reference import Reference, hover
from skyarm.reference.carry import Carry
from skyarm.sensing.measurement import Measurement
from skyarm.vehicle import Body
from support.engines import ENGINES, evaluate

VEHICLE = skyarm.load_vehicle("hexarotor_arm6")
POSTURE = (0.2, 0.6, -1.0, 0.3, 0.5, -0.4)
FORCE, MOMENT = Vec3(1.5, -0.7, -8.0), Vec3(0.2, 0.1, -0.3)
DT = 0.005


def law(vehicle=VEHICLE, **options):
    chosen = {
        "mode": "tip",
        "carrying": 1.0,
        "adaptation": 0.0,
        "bandwidth": 1.0,
        **options,
    }
    return make_centroidal(Model(vehicle=vehicle, gravity=9.81), **chosen)


def at_rest(controller, carry=(), yaw=0.0):
    """Reference of a hover in the posture, with the preview that the law takes, and its
    measurement.
    """
    still = hover((0.0, 0.0, 2.0), yaw=yaw, joints=POSTURE).at(0.0)
    row = [(v, 0.0, 0.0) for v in (0.0, 0.0, 2.0, yaw, *POSTURE)]
    ahead = tuple(n for _ in controller.par.preview for each in row for n in each)
    measured = Measurement(
        position=Vec3(0.0, 0.0, 2.0),
        quaternion=Quaternion(np.cos(0.5 * yaw), 0.0, 0.0, np.sin(0.5 * yaw)),
        velocity=Vec3(0.0, 0.0, 0.0),
        rate=Vec3(0.0, 0.0, 0.0),
        joints=POSTURE,
        joint_rates=(0.0,) * 6,
        rotor_speeds=controller.memory.sent.rotor_speeds,
        specific_force=Vec3(0.0, 0.0, 0.0),
        time=0.0,
    )
    return dataclasses.replace(still, ahead=ahead, carry=carry).dense(), measured


def steps(controller, count, carry, yaw=0.0):
    """Memory and command after some steps at rest, with the carry of each step."""
    memory, command = controller.memory, None
    for k in range(count):
        reference, measured = at_rest(controller, carry(k), yaw)
        memory, command = controller.law(
            memory, measured, reference, DT, par=controller.par
        )
    return memory, command


def carrying(**fields):
    return dataclasses.replace(Carry.none(), **fields).numbers


def jacobian(joints, yaw):
    """Numerical Jacobian of the tip's position and attitude (6, 6) by the joints, world
    axes, for a level base.
    """
    turn = Rotation.from_euler("z", yaw)

    def pose(q):
        at = frame_pose(VEHICLE, VEHICLE.frame(), q)
        return turn.apply([*at.p]), turn * Rotation.from_matrix(
            [[*row] for row in at.R.rows]
        )

    h, J = 1e-6, np.zeros((6, 6))
    for i in range(6):
        (p0, R0), (p1, R1) = (
            pose([q + s * h * (j == i) for j, q in enumerate(joints)]) for s in (-1, 1)
        )
        J[:3, i], J[3:, i] = (
            (p1 - p0) / (2.0 * h),
            (R1 * R0.inv()).as_rotvec() / (2.0 * h),
        )
    return J, pose(joints)[0]


def test_a_planned_wrench_does_its_work_on_joints_and_base():
    yaw = 0.7
    reference = Reference(
        joints=POSTURE,
        yaw=yaw,
        **dict.fromkeys(("joint_rates", "joint_accelerations"), (0.0,) * 6),
    )
    turned = dataclasses.replace(Carry.none(), heading=Vec3(0.2, 0.0, 0.0))
    reference = dataclasses.replace(reference, yaw=yaw - 0.2)
    d = planned_effect(VEHICLE, reference, turned, FORCE, MOMENT)
    J, tip = jacobian(POSTURE, yaw)
    assert np.allclose(d.efforts, J.T @ [*FORCE, *MOMENT], atol=1e-8)
    assert [*d.force] == [*FORCE]
    world = np.add(np.cross(tip, [*FORCE]), [*MOMENT])
    assert np.allclose(
        [*d.torque], Rotation.from_euler("z", -yaw).apply(world), atol=1e-12
    )


@pytest.mark.parametrize("moment", [0.002, 10.0])
def test_the_estimated_wrench_is_the_least_squares_solution_of_numpy(moment):
    rng, errors = np.random.default_rng(3), ForceErrors()
    turn = Rotation.random(random_state=4)
    R = Mat3(*(Vec3(*row) for row in turn.as_matrix().tolist()))
    efforts, torque, force = (
        rng.normal(size=6) * 0.1,
        rng.normal(size=3) * 0.1,
        rng.normal(size=3),
    )
    rest = Disturbance(
        force=Vec3(*force.tolist()),
        torque=Vec3(*torque.tolist()),
        efforts=tuple(efforts.tolist()),
    )
    f, n = tip_wrench(errors, moment, VEHICLE, R, POSTURE, rest)
    J, (x, y, z) = jacobian(POSTURE, 0.0)
    cross, none = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]), np.zeros((3, 3))
    rows = np.vstack(
        [
            J.T / errors.turning,
            np.hstack([cross, np.eye(3)]) / errors.base,
            np.hstack([np.eye(3), none]),
            np.hstack([none, np.eye(3)]) / moment,
        ]
    )
    target = [
        *efforts / errors.turning,
        *torque / errors.base,
        *turn.inv().apply(force),
        0.0,
        0.0,
        0.0,
    ]
    solved = np.linalg.lstsq(rows, np.array(target), rcond=None)[0]
    assert np.allclose([*f], turn.apply(solved[:3]), atol=1e-6)
    assert np.allclose([*n], turn.apply(solved[3:]), atol=1e-6)


def test_a_known_weight_is_in_the_command_at_once_and_not_in_the_observer():
    controller = law()
    free, loaded = (
        steps(controller, 1, lambda _, f=f: carrying(force=Vec3(0.0, 0.0, f)))
        for f in (0.0, -8.0)
    )
    J, _ = jacobian(POSTURE, 0.0)
    change = np.subtract(loaded[1].efforts, free[1].efforts)
    assert np.allclose(change, J.T @ [0, 0, 8.0, 0, 0, 0], atol=1e-3)
    coefficient = float(VEHICLE.rotors[0].thrust_coefficient)
    thrust = [
        coefficient * sum(w * w for w in each[1].rotor_speeds)
        for each in (free, loaded)
    ]
    # less than 8 N as motors are late, which the command makes up for in part
    assert thrust[1] > thrust[0] + 6.0
    assert [*loaded[0].observed.force] == [*free[0].observed.force]


def test_an_observer_forgets_at_the_rate_that_the_reference_says():
    controller = law()
    rate = Vec3(0.4, -0.2, 0.1)
    kept, forgot = (
        steps(controller, 1, lambda _, r=r: carrying(held=1.0, forgotten_force=r))
        for r in (Vec3(0.0, 0.0, 0.0), rate)
    )
    change = np.subtract([*forgot[0].observed.force], [*kept[0].observed.force])
    assert np.allclose(change, [-DT * c for c in rate], atol=1e-12)
    J, tip = jacobian(POSTURE, 0.0)
    across, damping = J[:2] @ J[:2].T, float(controller.par.tip.damping) ** 2
    # what damped least squares of the joints leave of a horizontal motion
    by_tilt = np.zeros((3, 3))
    by_tilt[:2, :2] = np.eye(2) - across @ np.linalg.inv(across + damping * np.eye(2))
    by_joints = (np.eye(3) - by_tilt) @ [*rate]
    turned = np.subtract(forgot[0].observed.efforts, kept[0].observed.efforts)
    assert np.allclose(turned, -DT * J[:3].T @ by_joints, atol=1e-9)
    turned = np.subtract([*forgot[0].observed.torque], [*kept[0].observed.torque])
    assert np.allclose(turned, -DT * np.cross(tip, by_joints), atol=1e-9)
    found = forgot[0].parts.carrying.tilting
    assert np.allclose([[*row] for row in found.full().rows], by_tilt, atol=1e-9)


@pytest.mark.parametrize("turned", [0.0, 0.9])
def test_a_planar_arm_moves_its_tip_across_its_plane_by_a_tilt_alone(turned):
    """An arm whose joints turn about parallel axes, at a heading: all of what is across
    its plane, nothing along.
    """
    vehicle = skyarm.load_vehicle("pelican_arm2")
    links = tuple(
        dataclasses.replace(
            link, joint=dataclasses.replace(link.joint, axis=Vec3(0.0, 1.0, 0.0))
        )
        for link in vehicle.links
    )
    planar = dataclasses.replace(vehicle, links=links)
    turn = Rotation.from_euler("z", turned)
    R = Mat3(*(Vec3(*row) for row in turn.as_matrix().tolist()))
    shares = shares_of_tilt(planar, R, (0.4,) * planar.n, 1e-3)
    across, along = turn.apply([0.0, 1.0, 0.0]), turn.apply([1.0, 0.0, 0.0])
    assert np.allclose([*shares.apply(Vec3(*across))], across, atol=1e-4)
    assert np.allclose([*shares.apply(Vec3(*along))], 0.0, atol=1e-4)


def test_the_bias_stands_from_the_moment_at_which_the_tip_holds():
    controller, rows = law(), []
    # nothing acts at rest: what a force at the tip does is put into the observer's
    # memory
    reference, measured = at_rest(controller)
    d = planned_effect(VEHICLE, reference, Carry.none(), FORCE, Vec3(0.0, 0.0, 0.0))
    acted = dataclasses.replace(
        controller.memory.observed, force=d.force, torque=d.torque, efforts=d.efforts
    )
    memory = dataclasses.replace(controller.memory, observed=acted)
    for held in (0.0, 1.0):
        reference, _ = at_rest(controller, carrying(held=held))
        rows.append(
            controller.law(memory, measured, reference, DT, par=controller.par)[
                0
            ].parts.carrying
        )
    free, holding = rows
    assert np.allclose([*holding.force], [*FORCE], atol=1e-3)
    assert [*holding.bias.force] == [0.0, 0.0, 0.0]
    follows = 1.0 - np.exp(-3.0 * DT)  # the bandwidth of the bias is 3 rad/s
    assert np.allclose([*free.bias.force], follows * np.array([*FORCE]), atol=1e-12)
    assert np.allclose([*free.force], (1.0 - follows) * np.array([*FORCE]), atol=1e-3)


def test_a_held_load_stops_adaptation_and_its_force_turns_the_base_by_its_rate():
    controller, seen = law(adaptation=2.0), []

    class Watched(CarryingGains):
        def affect(self, memory, step, effect):
            following, effect = CarryingGains.affect(self, memory, step, effect)
            seen.append(effect)
            return following, effect

    part = Watched(bandwidth=1.0)
    par = dataclasses.replace(
        controller.par, parts=dataclasses.replace(controller.par.parts, carrying=part)
    )
    memory = controller.memory
    for k in range(3):
        row = carrying(held=float(k > 0), force=Vec3(0.2 * k, 0.0, -0.1 * k))
        reference, measured = at_rest(controller, row)
        memory, _ = controller.law(memory, measured, reference, DT, par=par)
    assert [float(each.learns) for each in seen] == [1.0, 0.0, 0.0]
    assert [float(each.isolated) for each in seen] == [1.0, 0.0, 0.0]
    assert np.allclose(
        [[*each.force_rate] for each in seen],
        [[0, 0, 0], *[[0.2 / DT, 0.0, -0.1 / DT]] * 2],
    )


def test_gains_become_those_of_carrying_while_a_load_is_held():
    controller = law(carrying=0.5)
    memory, _ = steps(controller, 8, lambda _: carrying(held=1.0))
    part = controller.par.parts.carrying
    free = part.adjust_gains(controller.memory.parts.carrying, controller.par, DT)
    soft = part.adjust_gains(memory.parts.carrying, controller.par, DT)
    assert free.tip.position == controller.par.tip.position
    factor = 1.0 - 0.5 * (1.0 - np.exp(-30.0 * DT * 8))  # within 33 ms, not at once
    assert soft.tip.position == pytest.approx(factor**2 * controller.par.tip.position)
    assert soft.observer.joints == pytest.approx(
        factor * controller.par.observer.joints
    )


@pytest.mark.parametrize(
    ("most", "heavy", "kept"),
    [
        (0.5, 1.0, 0.5),
        (0.5, 2.0 / FIRM, 0.5 * 2**0.5),
        (0.5, 99.0, 1.0),
        (2.0, 99.0, 2.0),
    ],
)
def test_rotor_gains_rise_with_the_inertia_about_the_held_tip(most, heavy, kept):
    """The stiffness per inertia stays: the factor goes with its root, from ``carrying``
    to 1, and never below it.
    """
    controller = law(carrying=most)
    memory = dataclasses.replace(
        controller.memory.parts.carrying, share=1.0, heavy=heavy
    )
    held = controller.par.parts.carrying.adjust_gains(memory, controller.par, DT)
    assert held.base.attitude == pytest.approx(kept**2 * controller.par.base.attitude)
    assert held.observer.force == pytest.approx(kept * controller.par.observer.force)
    assert held.tip.position == pytest.approx(most**2 * controller.par.tip.position)


def test_the_inertia_about_the_tip_is_that_of_summed_bodies():
    """Sum over bodies of I + m (|r|^2 1 - r r^T) about the centre of mass, and
    Steiner's term of the tip.
    """
    poses = link_poses(VEHICLE, POSTURE)
    bodies = [(VEHICLE.base, np.eye(3), np.zeros(3))]
    bodies += [
        (link.body, np.array([[*row] for row in pose.R.rows]), np.array([*pose.p]))
        for link, pose in zip(VEHICLE.links, poses, strict=True)
    ]
    places = [p + R @ [*body.com] for body, R, p in bodies]
    masses = [body.mass for body, *_ in bodies]
    middle, total = np.average(places, axis=0, weights=masses), np.zeros((3, 3))
    for (body, R, _), place in zip(bodies, places, strict=True):
        r = place - middle
        total += R @ [[*row] for row in body.inertia.full().rows] @ R.T + body.mass * (
            r @ r * np.eye(3) - np.outer(r, r)
        )
    lever = np.array([*frame_pose(VEHICLE, VEHICLE.frame(), POSTURE).p]) - middle
    mean = 0.5 * (total[0, 0] + total[1, 1])
    assert inertia_ratio(VEHICLE, POSTURE) == pytest.approx(
        1.0 + sum(masses) * lever @ lever / mean
    )
    # without the part of the load that the model has
    memory, _ = steps(
        law(carried_inertia=0.2), 3, lambda _: carrying(held=1.0, mass=0.5)
    )
    assert memory.parts.carrying.heavy == pytest.approx(
        inertia_ratio(VEHICLE, memory.observed.joints)
    )


def settled(numbers, w, times):
    """Value, rate and acceleration of a filter with two poles at -w at some times,
    whose input stays.
    """
    value, rate, acceleration = numbers
    goal = value + 2.0 * rate / w + acceleration / w**2

    def bend(x, v):
        return w * w * (goal - x) - 2.0 * w * v

    flown = solve_ivp(
        lambda _, y: (y[1], bend(*y)),
        (0.0, max(times)),
        (value, rate),
        "DOP853",
        times,
        rtol=1e-12,
    )
    return [(x, v, bend(x, v)) for x, v in flown.y.T]


def test_a_shift_of_the_tip_is_that_of_the_reference_and_of_its_preview():
    controller, w = law(), 9.0
    rows = (0.01, 0.02, 0.3), (-0.02, 0.01, 0.2), (0.005, -0.03, -0.5)
    offset, rate, acceleration = (Vec3(*each) for each in zip(*rows, strict=True))
    turn, arm = 0.2, np.array([*frame_pose(VEHICLE, VEHICLE.frame(), POSTURE).p])
    # the base moves around the tip
    around = Vec3(*(arm - Rotation.from_euler("z", turn).apply(arm)))
    shift = {
        "offset": offset,
        "offset_rate": rate,
        "offset_acceleration": acceleration,
        "settling": w,
    }
    shift["heading"] = Vec3(turn, 0.0, 0.0)
    reference, measured = at_rest(controller, carrying(**shift))
    coming = np.reshape(reference.ahead, (-1, 10, 3)).copy()
    plain = dataclasses.replace(reference, carry=carrying())
    now = dataclasses.replace(
        plain,
        position=plain.position + offset + around,
        velocity=plain.velocity + rate,
        acceleration=acceleration,
        yaw=turn,
    ).dense()
    # the first two samples continue the reference between its samples
    times = controller.par.preview[2:]
    coming[2:, :3] += np.array([settled(each, w, times) for each in rows]).transpose(
        1, 0, 2
    )
    coming[2:, 3, 0] += turn
    moved = dataclasses.replace(now, ahead=tuple(coming.ravel()))
    first, second, late, still = (
        controller.law(controller.memory, measured, each, DT, par=controller.par)[1]
        for each in (reference, moved, now, plain)
    )
    assert np.allclose(first.efforts, second.efforts, atol=1e-9)
    assert np.allclose(first.rotor_speeds, second.rotor_speeds, atol=1e-6)
    for other in (late, still):
        assert not np.allclose(first.rotor_speeds, other.rotor_speeds, atol=1.0)


LOAD = 0.8
"""Mass (kg) that the tip moves."""


def loaded_memory(controller, ahead=None, mass=LOAD):
    """Memory of a law that was told of a load one period ago, compensated so in
    advance.
    """
    part = dataclasses.replace(controller.memory.parts.carrying, mass=mass)
    part = part if ahead is None else dataclasses.replace(part, ahead=ahead)
    return dataclasses.replace(
        controller.memory,
        parts=dataclasses.replace(controller.memory.parts, carrying=part),
    )


def test_what_the_model_has_of_a_load_is_no_known_wrench_as_well():
    controller, h = law(carried_inertia=0.6), 1e-4
    part, motion = controller.par.parts.carrying, Vec3(0.4, -0.9, 1.3)
    rates, bends = np.linspace(-1.0, 1.5, 6), np.linspace(3.0, -2.0, 6)
    turn, rate, bend = 0.7, -0.8, 1.6

    def tip(t):
        heading, q = (
            turn + t * rate + 0.5 * t * t * bend,
            POSTURE + t * rates + 0.5 * t * t * bends,
        )
        arm = Rotation.from_euler("z", heading).apply(
            [*frame_pose(VEHICLE, VEHICLE.frame(), q).p]
        )
        return 0.5 * t * t * np.array([*motion]) + arm

    proper = (tip(h) - 2.0 * tip(0.0) + tip(-h)) / h**2 + [0.0, 0.0, 9.81]
    told = dataclasses.replace(
        Carry.none(), held=1.0, force=FORCE, moment=MOMENT, heading=Vec3(0.2, 0.3, -0.4)
    )
    reference = Reference(
        acceleration=motion,
        yaw=turn - 0.2,
        yaw_rate=rate - 0.3,
        yaw_acceleration=bend + 0.4,
        joints=POSTURE,
        joint_rates=tuple(rates),
        joint_accelerations=tuple(bends),
        carry=told.numbers,
    )
    memory = loaded_memory(controller).parts.carrying
    motion = continue_reference(
        controller.par, controller.memory, reference.dense(), 0, DT
    )[0]
    known = part.feedforward(memory, controller.par, reference, motion)[1]
    left = FORCE + Vec3(*(0.6 * LOAD * proper))
    wanted = planned_effect(VEHICLE, reference, told, left, MOMENT)
    for name in ("force", "torque", "efforts"):
        assert np.allclose([*getattr(known, name)], [*getattr(wanted, name)], atol=1e-5)
    model, alone = part.adjust_gains(memory, controller.par, DT).model.vehicle, VEHICLE
    assert float(model.mass) == pytest.approx(float(alone.mass) + 0.6 * LOAD)
    change = model.links[-1].body.com * float(model.links[-1].body.mass)
    change = change - alone.links[-1].body.com * float(alone.links[-1].body.mass)
    assert np.allclose(
        [*change], [0.6 * LOAD * c for c in alone.frame().position], atol=1e-12
    )


@pytest.mark.parametrize("inertia", [0.0, 0.6])
def test_the_estimate_is_of_the_whole_load_and_the_limits_of_the_vehicle_alone(inertia):
    controller = law(carried_inertia=inertia)
    weight = Vec3(0.0, 0.0, -LOAD * 9.81)
    told = dataclasses.replace(Carry.none(), held=1.0, force=weight, mass=LOAD)
    reference, measured = at_rest(controller, told.numbers)
    ahead = planned_effect(VEHICLE, reference, told, weight * (1.0 - inertia), ZERO3)
    memory, _ = controller.law(
        loaded_memory(controller, ahead), measured, reference, DT, par=controller.par
    )
    found = part_of(memory, "carrying")
    plain, _ = law().law(law().memory, measured, reference, DT, par=law().par)
    assert np.allclose([*found.force], [*weight], atol=0.1)
    assert np.allclose(
        [found.limits.weight], [part_of(plain, "carrying").limits.weight], rtol=1e-6
    )
    assert float(found.mass) == LOAD


def test_a_load_in_the_model_stiffens_the_arm_as_that_of_the_vehicle_does():
    off = tuple(
        q + d
        for q, d in zip(POSTURE, (0.01, -0.02, 0.015, 0.02, 0.01, -0.03), strict=True)
    )
    tip, told = VEHICLE.frame(), dataclasses.replace(Carry.none(), held=1.0, mass=LOAD)
    heavier = VEHICLE.with_body(
        tip.link, Body(mass=LOAD, com=tip.position, inertia=Sym3(0.0, 0.0, 0.0))
    )
    begin, changes = law(heavier).memory, []
    for vehicle, inertia, force in (
        (VEHICLE, 0.0, -LOAD * 9.81),
        (VEHICLE, 1.0, -LOAD * 9.81),
        (heavier, 0.0, 0.0),
    ):
        controller = law(carried_inertia=inertia)
        # with the same gains
        par = dataclasses.replace(
            controller.par, model=Model(vehicle=vehicle, gravity=9.81)
        )
        carry = dataclasses.replace(told, force=Vec3(0.0, 0.0, force))
        reference, measured = at_rest(controller, carry.numbers)
        measured = dataclasses.replace(measured, rotor_speeds=begin.sent.rotor_speeds)
        left = Vec3(0.0, 0.0, force * (1.0 - inertia))
        memory = dataclasses.replace(
            begin,
            parts=loaded_memory(
                controller, planned_effect(vehicle, reference, carry, left, ZERO3)
            ).parts,
        )
        rows = [
            controller.law(
                memory, dataclasses.replace(measured, joints=q), reference, DT, par=par
            )[1]
            for q in (POSTURE, off)
        ]
        changes.append(np.subtract(rows[1].efforts, rows[0].efforts))
    plain, loaded, own = changes
    assert np.allclose(loaded, own, rtol=0.01, atol=1e-3)
    assert not np.allclose(plain, own, rtol=0.2, atol=2e-2)


def test_the_error_of_the_tip_is_that_of_its_shifted_reference():
    controller, joints = (
        law(),
        tuple(
            q + d
            for q, d in zip(POSTURE, (0.1, -0.05, 0.08, 0.2, -0.1, 0.3), strict=True)
        ),
    )
    turned, place = (
        Rotation.from_euler("xyz", (0.05, -0.08, 0.2)),
        np.array([0.02, -0.03, 1.96]),
    )
    offset = Vec3(0.01, -0.02, 0.005)
    reference, measured = at_rest(
        controller, carrying(offset=offset, heading=Vec3(0.05, 0.0, 0.0))
    )
    x, y, z, w = turned.as_quat()
    measured = dataclasses.replace(
        measured,
        position=Vec3(*place),
        quaternion=Quaternion(w, x, y, z),
        joints=joints,
    )
    memory, _ = controller.law(
        controller.memory, measured, reference, DT, par=controller.par
    )
    tip = place + turned.apply([*frame_pose(VEHICLE, VEHICLE.frame(), joints).p])
    planned = (
        np.array([0.0, 0.0, 2.0])
        + np.array([*frame_pose(VEHICLE, VEHICLE.frame(), POSTURE).p])
        + [*offset]
    )
    # a heading turns about the tip
    assert np.allclose([*part_of(memory, "carrying").behind], planned - tip, atol=1e-9)
    names = (
        field.name
        for field in dataclasses.fields(State)
        if hasattr(measured, field.name)
    )
    state = State(**{name: getattr(measured, name) for name in names})
    most, found = (
        largest_load(PointMotion(VEHICLE, state, gravity=9.81)),
        part_of(memory, "carrying").limits,
    )
    assert np.allclose(
        [found.weight, found.moment], [most.weight, most.moment], rtol=1e-9, atol=0.0
    )
    assert (
        float(found.weight)
        != part_of(steps(law(), 1, lambda k: carrying())[0], "carrying").limits.weight
    )


def test_a_turned_heading_takes_the_base_around_the_tip():
    controller, (turn, rate, bend) = law(), (0.05, 0.03, -0.08)
    reference, measured = at_rest(controller, carrying(heading=Vec3(turn, rate, bend)))
    arm = np.array([*frame_pose(VEHICLE, VEHICLE.frame(), POSTURE).p])
    about, up = Rotation.from_euler("z", turn).apply(arm), np.array([0.0, 0.0, 1.0])
    velocity = np.cross(rate * up, about)
    moved = dataclasses.replace(
        reference,
        carry=carrying(),
        position=Vec3(*(arm - about + [0.0, 0.0, 2.0])),
        velocity=Vec3(*-velocity),
        acceleration=Vec3(
            *-(np.cross(bend * up, about) + np.cross(rate * up, velocity))
        ),
        yaw=turn,
        yaw_rate=rate,
        yaw_acceleration=bend,
    ).dense()
    rows = [
        controller.law(controller.memory, measured, each, DT, par=controller.par)[1]
        for each in (reference, moved)
    ]
    assert np.allclose(rows[0].efforts, rows[1].efforts, atol=1e-3)
    assert np.allclose(rows[0].rotor_speeds, rows[1].rotor_speeds, atol=0.5)
    plain = dataclasses.replace(reference, carry=carrying())
    still = controller.law(controller.memory, measured, plain, DT, par=controller.par)[
        1
    ]
    assert not np.allclose(rows[0].rotor_speeds, still.rotor_speeds, atol=5.0)


def test_a_law_without_the_part_or_without_a_carry_is_the_one_before():
    plain, able = law(carrying=0.0), law()
    assert plain.par.parts.carrying is None
    (_, first), (_, second) = (steps(each, 3, lambda _: ()) for each in (plain, able))
    assert first == second


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"carrying": -1.0}, "controller.carrying = -1.0: must be at least 0"),
        (
            {"mode": "joint"},
            "controller.carrying = 1.0: must be 0 but in mode 'tip' with joints",
        ),
        ({"load": 0.3}, "controller.carrying = 1.0: must be 0 beside load"),
        (
            {"carrying": 0.0, "carried_inertia": 0.5},
            "controller.carried_inertia = 0.5: must be 0 without carrying",
        ),
        (
            {"carried_inertia": 3.0},
            "controller.carried_inertia = 3.0: must be at most 1",
        ),
        (
            {"interaction": (0.5, 0.2)},
            "controller.carrying = 1.0: must be 0 beside interaction",
        ),
    ],
)
def test_a_wrong_option_is_refused_in_one_line(options, words):
    with pytest.raises(ControllerError) as refused:
        law(**options)
    assert str(refused.value).startswith(words)


def one_step(*numbers):
    """What a step of the law answers to some instructions of a team, and its memory."""
    controller = law(carrying=0.7, carried_inertia=0.2)
    reference, measured = at_rest(controller)
    told = dataclasses.replace(reference, carry=(1.0, *numbers))
    memory, command = controller.law(
        loaded_memory(controller), measured, told, DT, par=controller.par
    )
    return leaves((memory.parts.carrying, memory.observed, command.dense()))


@pytest.mark.parametrize(
    "engine",
    [
        pytest.param(each, marks=pytest.mark.thorough if each == "jax" else ())
        for each in ENGINES
        if each != "floats"
    ],
)
def test_a_step_that_carries_is_the_same_on_every_engine(engine):
    rng = np.random.default_rng(5)
    lanes = np.abs(rng.normal(0.0, 0.3, (4, len(Carry.none().numbers) - 1))).tolist()
    expected = evaluate("floats", one_step, lanes)
    assert len({tuple(row) for row in expected.tolist()}) == 4
    np.testing.assert_allclose(
        evaluate(engine, one_step, lanes), expected, rtol=1e-9, atol=1e-9
    )
