"""Shares of a team are the pseudoinverse of its grasp matrix, and its law says what the
body's motion takes.
"""

from __future__ import annotations

import dataclasses
import math
import tomllib
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import skyarm
from skyarm.algebra import ZERO3, Mat3, Quaternion, Sym3, Vec3
from skyarm.dynamics import State
from skyarm.dynamics.actuators.load_limits import largest_load
from skyarm.dynamics.point_motion import PointMotion
from skyarm.records.files import Fields
from skyarm.reference.carry import Carry
from skyarm.reference.object_motion import motion_of_object
from skyarm.vehicle.linkage import Follower, Joint
from skyarm.world.contact.carrier import CarriedFrame
from skyarm.world.team.decentralised import Decentralised, MemberState
from skyarm.world.team.leader_follower import LeaderFollower
from skyarm.world.team.object_wrench import ObjectWrench
from skyarm.world.team.team import Team, TeamInputs, load_fraction, weight_of
from skyarm.world.team.virtual_masses import Member

DT = 0.005
BAR = [(-0.55, 0.0, 0.02), (0.55, 0.0, 0.02)]
PLATE = [(0.5, 0.1, 0.05), (-0.3, 0.4, 0.02), (-0.2, -0.6, 0.0)]
LINE = [(-1.2, 0.0, 0.02), (0.15, 0.0, 0.02), (1.2, 0.0, 0.02)]
PHASES = [
    {"kind": "hold", "duration": 3.0},
    {"kind": "lift", "height": 0.5, "duration": 2.0},
    {"kind": "turn", "angle": 1.2, "duration": 2.0},
    {"kind": "tilt", "pitch": 0.3, "roll": -0.2, "duration": 1.0},
    {"kind": "place", "duration": 2.0},
]


def vec(values):
    return Vec3(*(float(v) for v in values))


def matrix(R):
    return Mat3(*(vec(row) for row in R.as_matrix()))


def members(places, masses=(1.0, 2.0, 0.5)):
    rows = enumerate(zip(places, masses, strict=False))
    return tuple(
        Member(agent=f"a{i}", place=vec(place), mass=m) for i, (place, m) in rows
    )


def team(places=BAR, kind=ObjectWrench, **fields):
    motion = motion_of_object(
        Fields({"phases": PHASES}, "reference.object"), Vec3(0.0, 0.0, 0.02)
    )
    masses = fields.pop("masses", (1.0, 1.0, 1.0))
    given = {"mass": 1.6, "inertia": Vec3(4e-4, 0.19, 0.19), "take": 1.4, **fields}
    return kind(object="bar", members=members(places, masses), motion=motion, **given)


def grasp_matrix(arms):
    def cross(r):
        return np.array([[0, -r[2], r[1]], [r[2], 0, -r[0]], [-r[1], r[0], 0]])

    return np.vstack(
        [np.hstack([np.eye(3)] * len(arms)), np.hstack([cross(r) for r in arms])]
    )


def test_unstated_masses_are_the_load_that_members_can_bear_but_1_without_messages():
    assert team().usual_mass(24.0) == 24.0
    assert team(kind=Decentralised).usual_mass(24.0) == 1.0


def test_messages_that_are_too_old_before_the_next_are_refused():
    with pytest.raises(
        ValueError, match=r"timeout = 0\.2: must be 1 s or more, the period of rate"
    ):
        team(rate=1.0, timeout=0.2).require_members(["a0", "a1"], DT)


def test_one_member_that_is_left_bears_all_and_none_bears_nothing():
    force, moment, arms = (
        vec((1.0, -2.0, 15.0)),
        vec((0.3, 0.1, 0.0)),
        [vec(place) for place in BAR],
    )
    alone, none = team().with_masses([0.0, 1.0]), team().with_masses([0.0, 0.0])
    assert np.allclose(
        [[*f] for f in alone.shares(force, moment, arms)],
        [[0, 0, 0], [1.0, -2.0, 15.0]],
        atol=1e-9,
    )
    assert np.allclose([[*f] for f in none.shares(force, moment, arms)], 0.0)
    turned = matrix(Rotation.from_euler("xyz", (0.1, 0.2, 0.3)))
    for left in (alone, none):  # about its own grasp one member turns nothing
        assert np.allclose(
            [*left.turn_error(turned, matrix(Rotation.identity()))], 0.0, atol=1e-9
        )


@pytest.mark.parametrize(
    ("rate", "count"), [(150.0, 300), (200.0, 400), (50.0, 100), (0, 400), (0.0, 400)]
)
def test_messages_are_sent_at_their_rate_although_it_does_not_divide_that_of_control(
    rate, count
):
    whole = team(rate=rate)
    own, sent = whole.first(DT), 0
    told = inputs(whole, 5.0)
    for _ in range(400):
        messages, since = whole._send(own, told, DT)
        own = dataclasses.replace(own, sent=messages, since=since)
        sent += messages[0].age == 0.0
    assert sent == pytest.approx(count, abs=1)


def test_the_measured_motion_of_the_body_has_its_noise_and_the_true_one_none():
    turn, draws = (
        Rotation.from_euler("xyz", (0.4, -0.2, 1.0)),
        np.random.default_rng(4).uniform(size=(6, 20_000)),
    )
    body = CarriedFrame(
        position=vec((1, 2, 3)),
        rotation=matrix(turn),
        velocity=vec((0, 0, 0)),
        turning=vec((0, 0, 0)),
    )
    assert team().uniforms == 0
    assert team().measured_motion(body, ()) is body
    noisy = team(position_noise=0.003, attitude_noise=0.02, loss=0.1)
    assert noisy.uniforms == 6 + 2
    seen = noisy.measured_motion(body, (*draws, 0.0, 0.0))
    assert np.std([*seen.position], axis=1) == pytest.approx([0.003] * 3, rel=0.02)
    assert np.mean([*seen.position], axis=1) == pytest.approx([1.0, 2.0, 3.0], abs=1e-4)
    rows = np.array(
        [[np.broadcast_to(c, 20_000) for c in row] for row in seen.rotation.rows]
    ).transpose(2, 0, 1)
    off = (Rotation.from_matrix(rows) * turn.inv()).as_rotvec()
    assert np.std(off, axis=0) == pytest.approx([0.02] * 3, rel=0.02)
    assert np.corrcoef(np.vstack([np.array([*seen.position]), off.T])) == pytest.approx(
        np.eye(6), abs=0.03
    )
    assert [*seen.velocity, *seen.turning] == [0.0] * 6


def test_the_measured_velocity_of_the_body_has_its_own_noise():
    rows = np.random.default_rng(5).uniform(size=(12, 20_000))
    body = CarriedFrame(
        position=vec((1, 2, 3)),
        rotation=matrix(Rotation.identity()),
        velocity=vec((4, 5, 6)),
        turning=vec((7, 8, 9)),
    )
    noisy = team(velocity_noise=0.03, rate_noise=0.2)
    assert noisy.uniforms == 12
    seen = noisy.measured_motion(body, rows)
    moves = np.array([*seen.velocity, *seen.turning])
    assert np.mean(moves, axis=1) == pytest.approx([4, 5, 6, 7, 8, 9], abs=5e-3)
    assert np.std(moves, axis=1) == pytest.approx([0.03] * 3 + [0.2] * 3, rel=0.02)
    assert np.corrcoef(moves) == pytest.approx(np.eye(6), abs=0.03)
    assert [*seen.position] == [1.0, 2.0, 3.0]
    both = team(position_noise=0.003, velocity_noise=0.03).measured_motion(body, rows)
    alone = team(position_noise=0.003).measured_motion(body, rows[:6])
    assert np.array_equal([*both.position], [*alone.position])
    with_both = np.vstack([np.array([*both.position]), np.array([*both.velocity])])
    assert np.corrcoef(with_both) == pytest.approx(np.eye(6), abs=0.03)


@pytest.mark.parametrize("age", [2 * DT, 20 * DT])
def test_a_body_on_its_course_shifts_nothing_however_old_its_measured_pose(age):
    """The law compares a measured motion with the desired one of its time, in a lift
    and a turn.
    """
    for t in (3.6, 6.8):
        whole = team(pose_age=age, swing=0.3)
        at = whole.motion.at(t - age)
        old = CarriedFrame(
            position=at.position, rotation=at.R, velocity=at.velocity, turning=at.rate
        )
        given = dataclasses.replace(inputs(whole, t), body=old)
        own, rows = whole.lead(whole.first(DT), given, DT)
        assert max(map(abs, (*own.pose.place, *own.pose.turn))) < 1e-12
        shifts = [[*Carry.of(row).offset, *Carry.of(row).offset_rate] for row in rows]
        assert np.abs(shifts).max() < 1e-12
        young, _ = team(swing=0.3).lead(whole.first(DT), given, DT)
        assert max(map(abs, (*young.pose.place, *young.pose.turn))) > 1e-7
    with pytest.raises(
        ValueError,
        match=(
            r"pose_age = 0\.007: must be a whole number of control periods of 0\.005 s"
        ),
    ):
        team(pose_age=0.007).require_members(("a0", "a1"), DT)


@pytest.mark.parametrize(
    ("places", "masses"),
    [(PLATE, (1.0, 2.0, 0.5)), (BAR, (1.0, 1.0)), (BAR, (2.0, 0.7))],
)
def test_shares_are_the_weighted_pseudoinverse_of_the_grasp_matrix(places, masses):
    rng, turn = np.random.default_rng(2), Rotation.random(random_state=6)
    arms = [turn.apply(place) for place in places]
    G, M = grasp_matrix(arms), np.kron(np.diag(masses[: len(places)]), np.eye(3))
    wrench = G @ rng.normal(size=3 * len(places))  # one that the members can exert
    expected = M @ G.T @ np.linalg.pinv(G @ M @ G.T, rcond=1e-10) @ wrench
    found = team(places, masses=masses).shares(
        vec(wrench[:3]), vec(wrench[3:]), [vec(arm) for arm in arms]
    )
    assert np.allclose(np.concatenate([[*f] for f in found]), expected, atol=1e-6)


@pytest.mark.parametrize("places", [PLATE, BAR])
def test_internal_forces_move_nothing_and_are_all_that_moves_nothing(places):
    rng = np.random.default_rng(4)
    arms, whole = [np.array(place) for place in places], team(places)
    G, forces = grasp_matrix(arms), rng.normal(size=(len(places), 3))
    inner = np.array(
        [
            [*f]
            for f in whole.internal(
                [vec(f) for f in forces], [vec(arm) for arm in arms]
            )
        ]
    )
    assert np.allclose(G @ inner.ravel(), 0.0, atol=1e-6)
    null = np.eye(3 * len(places)) - np.linalg.pinv(G) @ G
    # equal virtual masses: the orthogonal part
    assert np.allclose(inner.ravel(), null @ forces.ravel(), atol=1e-6)


def test_two_members_have_the_pull_along_their_line_alone():
    forces = [Vec3(-3.0, 0.5, 4.0), Vec3(2.0, -1.0, 3.0)]
    inner = team().internal(forces, [vec(place) for place in BAR])
    assert np.allclose(
        [[*f] for f in inner], [[-2.5, 0.0, 0.0], [2.5, 0.0, 0.0]], atol=1e-6
    )


@pytest.mark.parametrize("com", [(0.0, 0.0, 0.0), (0.2, 0.0, -0.03)])
@pytest.mark.parametrize("t", [3.7, 5.9, 7.3, 8.8])
def test_the_weight_of_the_body_is_the_rate_of_its_momentum(t, com):
    whole, h = team(com=Vec3(*com)) if any(com) else team(), 1e-4

    def momentum(time):
        at = whole.motion.at(time)
        R = np.array([[*row] for row in at.R.rows])
        velocity = np.array([*at.velocity]) + np.cross([*at.rate], R @ com)
        return 1.6 * velocity, R @ np.diag([*whole.inertia]) @ R.T @ [*at.rate]

    (p0, L0), (p1, L1) = momentum(t - h), momentum(t + h)
    force, moment = weight_of(whole, whole.motion.at(t), 9.81)
    wanted = (p1 - p0) / (2.0 * h) + [0.0, 0.0, 1.6 * 9.81]
    lever = np.array([[*row] for row in whole.motion.at(t).R.rows]) @ com
    assert np.allclose([*force], wanted, atol=1e-5)
    assert np.allclose(
        [*moment], (L1 - L0) / (2.0 * h) + np.cross(lever, wanted), atol=1e-5
    )


def test_members_take_the_load_before_the_lift_and_give_it_back_after_the_place():
    motion = team().motion
    shares = [
        load_fraction(motion, t, 1.3) for t in (1.6, 1.7, 2.35, 3.0, 9.9, 10.65, 11.3)
    ]
    assert np.allclose(shares, [0.0, 0.0, 0.5, 1.0, 1.0, 0.5, 0.0], atol=1e-9)


def inputs(whole, t, forces=None, off=(0.0, 0.0, 0.0), turn=(0.0, 0.0, 0.0)):
    desired = whole.motion.at(t)
    R = Rotation.from_rotvec(turn) * Rotation.from_matrix(
        [[*row] for row in desired.R.rows]
    )
    still = Vec3(0.0, 0.0, 0.0)
    body = CarriedFrame(
        position=desired.position + vec(off),
        rotation=matrix(R),
        velocity=desired.velocity,
        turning=still,
    )
    given = [still] * len(whole.members) if forces is None else [vec(f) for f in forces]
    holding = float(t >= whole.take)
    return TeamInputs(
        time=t,
        holding=holding,
        desired=desired,
        body=body,
        gravity=9.81,
        forces=given,
        moments=[still] * len(whole.members),
    )


def instructions(whole, t, count=1, **given):
    own, rows = whole.first(DT), ()
    for _ in range(count):
        own, rows = whole.lead(own, inputs(whole, t, **given), DT)
    return own, [Carry.of(row) for row in rows]


def test_the_known_wrenches_lift_the_body_with_the_desired_pull():
    whole = team(internal_force=2.0)
    _, rows = instructions(whole, 6.3)
    force, moment = weight_of(whole, whole.motion.at(6.3), 9.81)
    arms = [[*arm] for arm in whole.arms(whole.motion.at(6.3).R)]
    on_body = np.array([[*(-row.force)] for row in rows])
    assert np.allclose(on_body.sum(axis=0), [*force], atol=1e-9)
    line = np.subtract(arms[1], arms[0])
    line /= np.linalg.norm(line)
    left = np.cross(arms, on_body).sum(axis=0) - [*moment]
    # what two places can exert
    assert np.allclose(left - line * (left @ line), 0.0, atol=1e-6)
    assert (on_body[1] - on_body[0]) @ line / 2.0 == pytest.approx(2.0, abs=1e-6)


def test_members_forget_a_pull_beyond_the_desired_one_and_part_less():
    whole = team(internal_force=1.0, blind=8.0, pull_gain=0.05)
    # the members pull the bar with 4 N: the left one to the left
    own, rows = instructions(whole, 5.0, forces=[(-4.0, 0.0, 7.0), (4.0, 0.0, 7.0)])
    assert np.allclose(
        [[*row.forgotten_force] for row in rows],
        [[24.0, 0.0, 0.0], [-24.0, 0.0, 0.0]],
        atol=1e-5,
    )
    assert np.allclose(
        [[*q] for q in own.inner],
        [[0.5 * 0.05 * DT * 3.0, 0, 0], [-0.5 * 0.05 * DT * 3.0, 0, 0]],
    )
    _, before = instructions(whole, 1.0, forces=[(-4.0, 0.0, 7.0), (4.0, 0.0, 7.0)])
    assert all(
        [*row.forgotten_force] == [0.0, 0.0, 0.0] and row.held == 0.0 for row in before
    )


def test_where_a_member_must_lean_pulls_are_forgotten_and_answered_slowly():
    whole, forces = (
        team(internal_force=0.0, blind=8.0, pull_gain=0.05),
        [
            Vec3(-3.0, 0.0, 7.0),
            Vec3(3.0, 0.0, 7.0),
        ],
    )
    given = dataclasses.replace(inputs(whole, 5.0), forces=forces)
    _, (quick, _) = whole.lead(whole.first(DT), given, DT)
    leans = dataclasses.replace(
        given, tilting=[Sym3(1.0, 0.0, 0.0), Sym3(0.0, 1.0, 0.0)]
    )
    own, rows = whole.lead(whole.first(DT), leans, DT)
    slow, other = (Carry.of(row).forgotten_force for row in rows)
    assert slow.x == pytest.approx(0.1 * Carry.of(quick).forgotten_force.x)
    # it leans across the pull alone
    assert other.x == pytest.approx(-Carry.of(quick).forgotten_force.x)
    assert own.inner[0].x == pytest.approx(0.01 * 0.5 * 0.05 * DT * 3.0, rel=1e-5)
    assert own.inner[1].x == pytest.approx(-0.5 * 0.05 * DT * 3.0, rel=1e-5)


def test_members_forget_the_moments_of_fixed_grasps():
    whole = team(blind_moments=4.0)
    whole = dataclasses.replace(
        whole,
        members=tuple(dataclasses.replace(m, kind="fixed") for m in whole.members),
    )
    given = dataclasses.replace(
        inputs(whole, 5.0), moments=[Vec3(0.1, 0.0, -0.2), Vec3(0.0, 0.3, 0.0)]
    )
    _, rows = whole.lead(whole.first(DT), given, DT)
    found = [[*Carry.of(row).forgotten_moment] for row in rows]
    # of what the body does to the tips
    assert np.allclose(found, [[-0.4, 0.0, 0.8], [0.0, -1.2, 0.0]], atol=1e-12)


def test_an_error_of_the_pose_shifts_and_turns_all_tips_but_not_about_their_line():
    whole, count = team(pose_gain=0.3), 4
    own, _ = instructions(
        whole, 5.0, count, off=(0.01, -0.02, 0.03), turn=(0.05, 0.01, -0.02)
    )
    assert np.allclose(
        [*own.pose.place], -0.3 * DT * count * np.array([0.01, -0.02, 0.03]), atol=1e-12
    )
    assert np.allclose(
        [*own.pose.turn], -0.3 * DT * count * np.array([0.0, 0.01, -0.02]), atol=1e-6
    )
    standing, _ = instructions(whole, 2.5, count, off=(0.01, -0.02, 0.03))
    assert [*standing.pose.place] == [0.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("places", "masses"),
    [(PLATE, (1.0, 2.0, 0.5)), (BAR, (2.0, 0.7)), (LINE, (1.0, 0.0, 3.0))],
)
def test_the_rigid_shift_is_the_weighted_least_squares_fit(places, masses):
    rng, turn = np.random.default_rng(8), Rotation.random(random_state=9)
    arms = [turn.apply(place) for place in places]
    shifts, root = (
        rng.normal(size=(len(places), 3)),
        np.kron(np.sqrt(masses), np.ones(3)),
    )
    G = grasp_matrix(arms)
    fit = (
        G.T @ np.linalg.lstsq(root[:, None] * G.T, root * shifts.ravel(), rcond=1e-8)[0]
    )
    place, turned = team(places, masses=masses).rigid_shift(
        [vec(e) for e in shifts], [vec(arm) for arm in arms]
    )
    found = np.array(
        [np.cross([*turned], arm) + np.array([*place]) for arm in arms]
    ).ravel()
    assert np.allclose((root * found), (root * fit), atol=1e-5)


def test_errors_of_the_tips_are_no_errors_of_the_pose():
    """Tips that are off with the body shift nothing; what they do not explain does."""
    whole, off, turn = (
        team(PLATE, pose_gain=0.3),
        np.array([0.01, -0.02, 0.03]),
        np.array([0.004, 0.002, -0.003]),
    )
    given = inputs(whole, 5.0, off=off, turn=turn)
    arms = [[*arm] for arm in whole.arms(given.desired.R)]
    for part in (1.0, 0.25):
        behind = [vec(-part * (off + np.cross(turn, arm))) for arm in arms]
        own, _ = whole.lead(
            whole.first(DT), dataclasses.replace(given, behind=[ZERO3] * 3), DT
        )
        own = dataclasses.replace(
            own, pose=dataclasses.replace(own.pose, place=ZERO3, turn=ZERO3)
        )
        own, _ = whole.lead(own, dataclasses.replace(given, behind=behind), DT)
        assert np.allclose([*own.pose.place], -0.3 * DT * (1.0 - part) * off, atol=1e-9)
        assert np.allclose([*own.pose.turn], -0.3 * DT * (1.0 - part) * turn, atol=1e-8)


@pytest.mark.parametrize("kind", ["fixed", "cable"])
def test_errors_of_tips_that_last_are_removed_by_the_integral(kind):
    whole, off = team(PLATE, pose_gain=0.3), np.array([0.01, -0.02, 0.03])
    whole = dataclasses.replace(
        whole, members=tuple(dataclasses.replace(m, kind=kind) for m in whole.members)
    )
    given = dataclasses.replace(inputs(whole, 5.0, off=off), behind=[vec(-off)] * 3)
    own, _ = whole.lead(whole.first(DT), given, DT)
    assert np.allclose([*own.pose.place], -0.3 * DT * off, atol=1e-9)
    # there it would act on the loops of the members
    assert [*own.pose.off] == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("share", [0.0, 0.6, 2.0])
def test_the_proportional_part_leaves_its_share_of_a_misfit_that_tips_do_not_explain(
    share,
):
    """Tips that are where they are asked to be hold the body elsewhere: it stays 1 /
    (1 + share) of that off.
    """
    whole = team(PLATE, pose_gain=0.0, pose_shift=share)
    off, turn = np.array([0.01, -0.02, 0.03]), np.array([0.004, 0.002, -0.003])
    own, there, turned = whole.first(DT), off, turn
    for _ in range(600):
        given = dataclasses.replace(
            inputs(whole, 5.0, off=there, turn=turned), behind=[ZERO3] * 3
        )
        own, rows = whole.lead(own, given, DT)
        place, about = whole.rigid_shift(
            [Carry.of(row).offset for row in rows], whole.arms(given.desired.R)
        )
        there, turned = np.add(off, [*place]), np.add(turn, [*about])
    assert np.allclose(there, off / (1.0 + share), atol=1e-6)
    assert np.allclose(turned, turn / (1.0 + share), atol=2e-5)


def test_a_body_that_swings_about_the_line_of_its_grasps_shifts_nothing():
    """Grasps above the centre of mass stay where they are, and the middle of the body
    moves.
    """
    places = ((0.0, 0.5, 0.1), (0.0, -0.5, 0.1))
    whole, rolled = team(places), Rotation.from_rotvec([0.0, 0.2, 0.0]).as_matrix()
    own = whole.first(DT)
    for _ in range(3):
        given = inputs(whole, 5.0)
        R = np.array([[*given.desired.R.apply(vec(e))] for e in np.eye(3)]).T
        turned, held = R @ rolled, R @ [0.0, 0.0, 0.1]
        body = dataclasses.replace(
            given.body,
            position=given.desired.position + vec(held - turned @ [0.0, 0.0, 0.1]),
            rotation=Mat3.columns(*(vec(column) for column in turned.T)),
        )
        own, _ = whole.lead(
            own, dataclasses.replace(given, body=body, behind=[ZERO3] * 2), DT
        )
    assert np.abs([*own.pose.off, *own.pose.place]).max() < 1e-9


@pytest.mark.parametrize("age", [0.0, DT, 4 * DT])
def test_errors_of_body_and_tips_are_compared_at_the_same_time(age):
    """Body and tips swing together, faster than the loops of the members: nothing is
    shifted, however old the pose.
    """
    whole = team(PLATE, pose_age=age)
    own, largest = whole.first(DT), 0.0
    for k in range(400):
        t = 5.0 + DT * k
        away = [
            np.array([0.05, -0.02, 0.03]) * math.sin(5.5 * (time - 5.0))
            for time in (t - age, t - DT)
        ]
        at = whole.motion.at(t - age)
        body = CarriedFrame(
            position=at.position + vec(away[0]),
            rotation=at.R,
            velocity=at.velocity,
            turning=at.rate,
        )
        behind = [vec(-away[1])] * 3  # of the period before
        own, _ = whole.lead(
            own, dataclasses.replace(inputs(whole, t), body=body, behind=behind), DT
        )
        if k > 250:
            largest = max(largest, *map(abs, (*own.pose.off, *own.pose.askew)))
    assert largest < 5e-5


def test_the_proportional_part_passes_a_pole_of_the_filter_and_waits_for_the_lift():
    whole, off = team(PLATE, pose_gain=0.0, filter=8.0), np.array([0.01, -0.02, 0.03])
    own = whole.first(DT)
    for _ in range(40):
        own, _ = whole.lead(
            own,
            dataclasses.replace(inputs(whole, 5.0, off=off), behind=[ZERO3] * 3),
            DT,
        )
    assert np.allclose(
        [*own.pose.off], -off * (1.0 - math.exp(-8.0 * 40 * DT)), rtol=0.05
    )
    assert [*own.pose.place] == [0.0, 0.0, 0.0]
    still, _ = whole.lead(
        own, dataclasses.replace(inputs(whole, 2.5, off=off), behind=[ZERO3] * 3), DT
    )
    # not on its support, where nothing gives way
    assert [*still.pose.off] == [*own.pose.off]


def test_shifts_reach_the_members_through_a_filter_with_their_derivatives():
    whole = dataclasses.replace(team(), pose_gain=1e4)  # a step to the limit of 0.3 m
    own, rows, track = whole.first(DT), [], []
    for _ in range(200):
        own, given = whole.lead(own, inputs(whole, 5.0, off=(-1.0, 0.0, 0.0)), DT)
        rows = [Carry.of(row) for row in given]
        track.append(
            [rows[0].offset.x, rows[0].offset_rate.x, rows[0].offset_acceleration.x]
        )
    track = np.array(track)
    t = DT * np.arange(1, 201)
    assert np.allclose(
        track[:, 0], 0.3 * (1.0 - (1.0 + 10.0 * t) * np.exp(-10.0 * t)), atol=0.01
    )
    assert np.allclose(np.diff(track[:, 0]) / DT, track[1:, 1], atol=1e-9)
    assert np.allclose(np.diff(track[:, 1]) / DT, track[1:, 2], atol=1e-9)


def wrench_of(arms, forces):
    """Force and moment about the middle of a body (6,) of forces (N, 3) at places (N,
    3).
    """
    return np.concatenate([np.sum(forces, axis=0), np.cross(arms, forces).sum(axis=0)])


@pytest.mark.parametrize("places", [PLATE, LINE])
def test_pulls_along_all_pairs_of_grasps_are_the_internal_forces(places):
    whole, arms = team(places), [vec(place) for place in places]
    given = np.array([2.0, -1.0, 1.5])
    forces = np.array([[*f] for f in whole.along([*given], arms)])
    columns = []
    for i, j in ((0, 1), (0, 2), (1, 2)):
        line, column = np.subtract(places[i], places[j]), np.zeros((3, 3))
        column[i] = line / np.linalg.norm(line)
        columns.append((column - np.eye(3)[j][:, None] * column[i]).ravel())
    A = np.array(columns).T
    assert np.allclose(forces.ravel(), A @ given)
    assert np.allclose(wrench_of(places, forces), 0.0, atol=1e-12)
    found = whole.tensions([vec(f) for f in forces], arms)
    assert np.allclose(A @ found, A @ given, atol=1e-6)
    # on one line many would do
    assert np.allclose(found, np.linalg.pinv(A, rcond=1e-9) @ forces.ravel(), atol=1e-4)


def test_three_desired_pulls_stand_in_the_known_forces_and_two_are_refused():
    whole = team(PLATE, internal_forces=(2.0, -1.0, 1.5))
    _, rows = instructions(whole, 6.3)
    arms = [[*arm] for arm in whole.arms(whole.motion.at(6.3).R)]
    on_body = np.array([[*(-row.force)] for row in rows])
    force, moment = weight_of(whole, whole.motion.at(6.3), 9.81)
    assert np.allclose(wrench_of(arms, on_body), [*force, *moment], atol=1e-6)
    left = on_body.ravel() - np.linalg.pinv(grasp_matrix(arms)) @ [*force, *moment]
    pulls = whole.along([2.0, -1.0, 1.5], [vec(arm) for arm in arms])
    assert np.allclose(left, np.concatenate([[*f] for f in pulls]), atol=1e-6)
    with pytest.raises(
        ValueError,
        match=r"internal_forces = 2 numbers: must be 3, one of each two members",
    ):
        team(PLATE, internal_forces=(2.0, -1.0)).require_members(("a0", "a1", "a2"), DT)


def test_members_on_one_line_do_not_turn_the_body_about_it_and_others_do():
    turn = Rotation.from_rotvec([0.05, 0.01, -0.02])
    found = {
        n: team(p).turn_error(matrix(turn), matrix(Rotation.identity()))
        for n, p in ((3, LINE), (0, PLATE))
    }
    assert np.allclose([*found[3]], [0.0, -0.01, 0.02], atol=1e-4)
    assert np.allclose([*found[0]], [-0.05, -0.01, 0.02], atol=1e-4)


def test_the_others_bear_the_body_when_a_member_has_lost_its_grasp():
    whole = team(LINE, masses=(1.0, 2.0, 0.5))
    after = whole.with_masses([1.0, 0.0, 0.5])
    _, rows = instructions(
        after, 5.0, forces=[(-3.0, 0.0, 7.0), (9.0, 9.0, 9.0), (3.0, 0.0, 7.0)]
    )
    force, moment = weight_of(whole, whole.motion.at(5.0), 9.81)
    arms = np.array(LINE)[[0, 2]]
    G, M = grasp_matrix(arms), np.kron(np.diag((1.0, 0.5)), np.eye(3))
    wrench = np.array([*force, *moment]) - [0, 0, 0, -0.02 * force.y, 0, 0]
    expected = (M @ G.T @ np.linalg.pinv(G @ M @ G.T, rcond=1e-10) @ wrench).reshape(
        2, 3
    )
    assert np.allclose([[*(-rows[i].force)] for i in (0, 2)], expected, atol=1e-5)
    assert rows[1].held == 0.0
    assert [*rows[1].force] == [*rows[1].forgotten_force] == [0.0, 0.0, 0.0]
    # what the lost member believes to feel is not taken for a pull of the others: they
    # forget 3 N each
    assert np.allclose([*rows[0].forgotten_force], [30.0, 0.0, 0.0], atol=1e-4)


SLOW = 0.04
"""Period (s) of a law that is evaluated for seconds."""


def limited(whole, t, limits, count, **given):
    own, rows = whole.first(DT), ()
    for _ in range(count):
        own, rows = whole.lead(
            own, dataclasses.replace(inputs(whole, t), limits=limits, **given), SLOW
        )
        t += SLOW
    return own, np.array([[*(-Carry.of(row).force)] for row in rows])


def test_a_member_at_its_limit_passes_its_load_to_those_that_can_bear_it():
    whole = team(LINE, mass=3.0, inertia=Vec3(1e-3, 1.5, 1.5))
    _, free = limited(whole, 4.96, (50.0, 50.0, 50.0), 1)
    own, found = limited(whole, 3.0, (50.0, 5.0, 50.0), 50)
    assert free[1, 2] > 8.0
    assert found[1, 2] == pytest.approx(5.0, abs=0.25)
    force, moment = weight_of(whole, whole.motion.at(4.96), 9.81)
    arms = [[*arm] for arm in whole.arms(whole.motion.at(4.96).R)]
    assert np.allclose(
        wrench_of(arms, found)[[0, 1, 2, 4, 5]], [*force, moment.y, moment.z], atol=1e-5
    )
    assert own.overload == 0.0


def test_what_the_others_cannot_bear_is_set_down_where_it_was():
    whole = team(LINE, mass=3.0, pose_gain=0.0, pull_gain=0.0).with_masses(
        [1.0, 0.0, 1.0]
    )
    own, path = whole.first(DT), []
    for k in range(200):
        t = 4.5 + k * SLOW
        own, rows = whole.lead(
            own, dataclasses.replace(inputs(whole, t), limits=(9.0, 0.0, 9.0)), SLOW
        )
        way, carry = (
            whole.motion.at(t).of_place(whole.members[0].place),
            Carry.of(rows[0]),
        )
        path.append(
            [
                *(way[0] + carry.offset),
                *(way[1] + carry.offset_rate),
                carry.force.z,
                whole.motion.yaw.derivatives(t)[0] + carry.heading.x,
                whole.motion.yaw.derivatives(t)[1] + carry.heading.y,
                whole.motion.yaw.derivatives(t)[2] + carry.heading.z,
            ]
        )
    path, time = np.array(path), 4.5 + SLOW * np.arange(200)
    stopped, still = time > 6.6, vec(LINE[0])
    assert path[time < 5.4][:, 6].max() < -13.0  # 1.5 kg
    # the motion of 4.5 s to 5.5 s goes on for half a second more while it slows
    middle = whole.motion.at(6.0)
    assert np.allclose(
        path[stopped][:, :2],
        [*(middle.position + middle.R.apply(still))][:2],
        atol=0.05,
    )
    assert np.allclose(
        path[stopped][:, 7], whole.motion.yaw.derivatives(6.0)[0], atol=0.05
    )
    fell = path[np.searchsorted(time, 7.5), 2] - path[np.searchsorted(time, 8.5), 2]
    assert fell == pytest.approx(0.15, abs=0.01)
    assert path[-1, 2] == pytest.approx(0.04, abs=2e-3)  # on the support
    assert path[-1, 6] == 0.0
    assert np.allclose(np.diff(path[:, :3], axis=0) / SLOW, path[1:, 3:6], atol=0.06)
    assert np.allclose(np.diff(path[:, 7]) / SLOW, path[1:, 8], atol=0.06)
    slows = (time > 5.7) & (time < 6.3)
    assert np.allclose(np.gradient(path[:, 8], SLOW)[slows], path[slows, 9], atol=0.06)


def test_a_body_that_tips_is_set_down_and_fixed_grasps_bear_a_moment():
    def overload(kind, moments):
        whole = team(PLATE, mass=2.0).with_masses([1.0, 0.0, 1.0])
        whole = dataclasses.replace(
            whole,
            members=tuple(dataclasses.replace(m, kind=kind) for m in whole.members),
        )
        given = dataclasses.replace(inputs(whole, 5.0), moment_limits=moments)
        own, rows = whole.lead(whole.first(DT), given, DT)
        return own.overload, [Carry.of(row) for row in rows], whole

    assert overload("ball", (9.0,) * 3)[0] > 0.0
    assert overload("fixed", (0.5,) * 3)[0] > 0.0
    seconds, rows, whole = overload("fixed", (6.0, 6.0, 3.0))
    assert seconds == 0.0
    arms, on_body = np.array(PLATE), np.array([[*(-row.force)] for row in rows])
    moments = np.array([[*(-row.moment)] for row in rows])
    _, moment = weight_of(whole, whole.motion.at(5.0), 9.81)
    assert np.allclose(
        wrench_of(arms, on_body)[3:] + moments.sum(axis=0), [*moment], atol=1e-6
    )
    assert np.allclose(moments[0], 2.0 * moments[2])  # by what they can bear
    assert [*moments[1]] == [0.0, 0.0, 0.0]


def test_the_largest_load_is_that_of_the_rotors_or_of_the_weakest_joint():
    vehicle, q = skyarm.load_vehicle("hexarotor_arm6"), (0.3, 0.6, -1.0, 0.2, 0.5, 0.1)
    R, p, frames = Rotation.identity(), np.zeros(3), []
    for link, angle in zip(vehicle.links, q, strict=True):  # a chain of turning joints
        p = p + R.apply([*link.joint.position])
        axis = R.apply([*link.joint.axis])
        R = R * Rotation.from_rotvec(angle * np.array([*link.joint.axis]))
        frames.append(
            (p, axis, p + R.apply([*link.body.com]), float(link.body.mass) * 9.81)
        )
    tip = p + R.apply([*vehicle.frame().position])

    def torque(i, force, at):
        return frames[i][1] @ np.cross(at - frames[i][0], [0.0, 0.0, force])

    thrust = sum(
        float(r.axis.z * r.thrust_coefficient * r.max_speed**2) for r in vehicle.rotors
    )
    bounds, spare = [0.85 * thrust - 9.81 * float(vehicle.mass)], []
    for i, link in enumerate(vehicle.links):
        own = sum(torque(i, weight, com) for _, _, com, weight in frames[i:])
        spare.append(0.85 * float(link.joint.effort_limit) - abs(own))
        bounds.append(spare[-1] / max(abs(torque(i, 1.0, tip)), 1e-3))

    def found(thing):
        state = State(
            position=vec((0, 0, 1)),
            quaternion=Quaternion(1.0, 0.0, 0.0, 0.0),
            velocity=vec((0, 0, 0)),
            rate=vec((0, 0, 0)),
            joints=q,
            joint_rates=(0.0,) * 6,
            rotor_speeds=(0.0,) * 6,
        )
        most = largest_load(PointMotion(thing, state, gravity=9.81))
        return most.weight, most.moment

    assert found(vehicle) == pytest.approx((min(bounds), min(spare)))
    elbow = dataclasses.replace(
        vehicle.links[2],
        joint=dataclasses.replace(vehicle.links[2].joint, effort_limit=1.0),
    )
    weak = dataclasses.replace(
        vehicle, links=(*vehicle.links[:2], elbow, *vehicle.links[3:])
    )
    assert found(weak)[0] == pytest.approx(
        bounds[3] * (spare[2] - 0.85 * 3.0) / spare[2]
    )
    assert bounds[0] < bounds[3]


def test_the_weight_of_a_follower_is_borne_by_its_leader():
    vehicle = skyarm.load_vehicle("hummingbird_arm2")
    body = dataclasses.replace(
        vehicle.links[1].body, mass=0.1, com=Vec3(0.0, 0.0, -0.1)
    )
    joint = Joint(name="tied", axis=Vec3(0.0, 1.0, 0.0))
    link = dataclasses.replace(
        vehicle.links[0], name="bar", parent=-1, joint=joint, body=body
    )
    tied = dataclasses.replace(
        vehicle, followers=(Follower(link=link, leader=1, ratio=-1.0),)
    )
    still = vec((0, 0, 0))
    state = State(
        position=still,
        quaternion=Quaternion(1.0, 0.0, 0.0, 0.0),
        velocity=still,
        rate=still,
        joints=(0.0, 0.5),
        joint_rates=(0.0,) * 2,
        rotor_speeds=(0.0,) * 4,
    )
    # of the last link and what it carries
    own = 9.81 * (0.04 * 0.075 + 0.01 * 0.15) * np.sin(0.5)
    for thing, more in ((vehicle, 0.0), (tied, 9.81 * 0.1 * 0.1 * np.sin(0.5))):
        most = largest_load(PointMotion(thing, state, gravity=9.81))
        assert most.moment == pytest.approx(0.85 * 0.5 - own - more)


def prompt_rate(whole):
    """Rate (1/s) at which observers forget an internal force that the others hear
    late.
    """
    late = whole.delay + (
        (1.0 / (1.0 - whole.loss) - 0.5) / whole.rate if whole.rate else 0.0
    )
    return whole.blind / (1.0 + whole.blind * late)


def heard_pull(whole, count, drawn=lambda k: ()):
    own, seen = whole.first(DT), []
    for k in range(count):
        pull = float(k + 1)
        given = inputs(whole, 5.0, forces=[(-pull, 0.0, 0.0), (pull, 0.0, 0.0)])
        own, rows = whole.lead(own, dataclasses.replace(given, drawn=drawn(k)), DT)
        seen.append(Carry.of(rows[0]).forgotten_force.x)
    return np.divide(seen, prompt_rate(whole)), whole.further_logged(own)


def test_messages_at_a_rate_are_those_of_the_last_sending():
    seen, (*ages, a, b) = heard_pull(team(rate=50.0), 9)
    assert np.allclose(seen, [1, 1, 1, 1, 5, 5, 5, 5, 9], atol=1e-5)
    assert [*ages, a, b] == [0.0] * 4
    half, _ = heard_pull(team(rate=50.0, loss=0.5), 9, lambda k: (0.6, 0.6))
    assert np.allclose(half, seen, atol=1e-5)
    late, (age, *_) = heard_pull(team(rate=50.0, delay=2 * DT), 8)
    assert np.allclose(late, [0, 0, 1, 1, 1, 1, 5, 5], atol=1e-5)
    # sent with the fifth force, heard two periods later and held for one
    assert age == pytest.approx(3 * DT)


def test_lost_messages_leave_the_last_force_until_it_is_too_old():
    whole = team(loss=0.5, timeout=2.5 * DT)
    assert whole.uniforms == 2
    assert team().uniforms == 0
    lost = {2, 3, 4, 5}
    seen, (age, other, gone, none) = heard_pull(
        whole, 7, lambda k: (0.4 if k in lost else 0.6, 0.6)
    )
    # the pull is half of the difference of both forces, the first of which is the
    # second period's
    assert np.allclose(seen, [1.0, 2.0, 2.5, 3.0, 0.0, 0.0, 7.0], atol=1e-5)
    assert (age, other, gone, none) == (0.0, 0.0, 4.0, 0.0)


def test_late_messages_are_those_of_some_periods_before():
    whole = team(delay=3 * DT)
    own, seen = whole.first(DT), []
    for k in range(6):
        pull = float(k + 1)
        own, rows = whole.lead(
            own, inputs(whole, 5.0, forces=[(-pull, 0.0, 0.0), (pull, 0.0, 0.0)]), DT
        )
        seen.append(Carry.of(rows[0]).forgotten_force.x / prompt_rate(whole))
    assert np.allclose(seen, [0.0, 0.0, 0.0, 1.0, 2.0, 3.0], atol=1e-5)
    with pytest.raises(
        ValueError,
        match=r"delay = 0\.007: must be a whole number of control periods of 0\.005 s",
    ):
        team(delay=0.007).require_members(("a0", "a1"), DT)


def test_a_team_of_own_paths_says_nothing():
    whole = team(kind=Team)
    assert whole.start(DT, ()).carries == ()
    assert whole.lead((), inputs(whole, 5.0), DT) == ((), ())


def pulled(whole, t, pull):
    """Forces of two members that bear the planned load and pull the bar with a force
    (N) beside it.
    """
    at = whole.motion.at(t)
    arms = whole.arms(at.R)
    loads = np.array([[*f] for f in whole.shares(*weight_of(whole, at, 9.81), arms)])
    line = np.subtract([*arms[1]], [*arms[0]])
    return loads + pull * np.array([-line, line]) / np.linalg.norm(line)


@pytest.mark.parametrize("t", [5.0, 6.8, 7.9])
def test_a_follower_yields_to_a_pull_as_its_virtual_body_and_the_leader_does_not(t):
    whole = team(kind=LeaderFollower, virtual_mass=2.0, damping=60.0, stiffness=20.0)
    own, rows, count = whole.first(DT), (), 150
    for _ in range(count):
        own, rows = whole.lead(own, inputs(whole, t, forces=pulled(whole, t, 1.5)), DT)
    first, second = map(Carry.of, rows)
    assert [*first.offset] == [0.0, 0.0, 0.0]
    arms = [np.array([*arm]) for arm in whole.arms(whole.motion.at(t).R)]
    line = (arms[1] - arms[0]) / np.linalg.norm(arms[1] - arms[0])
    slow, fast = np.roots([2.0, 60.0, 20.0])[::-1]
    seconds = DT * count
    settled = (
        -1.5
        / 20.0
        * (
            1.0
            - (fast * np.exp(slow * seconds) - slow * np.exp(fast * seconds))
            / (fast - slow)
        )
    )
    assert np.allclose([*second.offset], settled * line, atol=1e-3)
    assert [*second.force] == [0.0, 0.0, 0.0]


def test_the_shift_of_a_follower_moves_at_its_rate_and_rests_at_its_bound():
    whole = team(kind=LeaderFollower, virtual_mass=2.0, damping=60.0, stiffness=20.0)
    own, given = whole.first(DT), []
    for pull in (*[20.0] * 150, *[-20.0] * 5):
        own, rows = whole.lead(
            own, inputs(whole, 4.0, forces=pulled(whole, 4.0, pull)), DT
        )
        given.append(Carry.of(rows[1]))
    offset, rate, acceleration = (
        np.array([[*getattr(each, name)] for each in given]) for name in PARTS_OF_SHIFT
    )
    bound = int(np.argmax(np.all(rate[1:] == 0.0, axis=1)))
    assert 5 < bound < 145
    assert np.allclose(
        np.diff(rate[:bound], axis=0), DT * acceleration[1:bound], atol=1e-12
    )
    # at the bound, too
    assert np.allclose(np.diff(offset, axis=0), DT * rate[1:], atol=1e-12)
    size = np.linalg.norm(offset, axis=1)
    assert 0.0995 < size[149] <= size.max() <= 0.1
    # a pull the other way lets it go
    assert np.linalg.norm(offset[-1]) < np.linalg.norm(offset[149])


PARTS_OF_SHIFT = ("offset", "offset_rate", "offset_acceleration")


def test_a_follower_does_not_yield_to_its_part_of_the_weight_of_a_tilted_bar():
    whole = team(kind=LeaderFollower, internal_force=0.7)
    own, _ = whole.lead(
        whole.first(DT), inputs(whole, 7.9, forces=pulled(whole, 7.9, 0.7)), DT
    )
    assert all(abs(each.rate) < 1e-9 for each in own)
    with pytest.raises(ValueError, match=r"leader = 'a7': must be one of a0, a1"):
        dataclasses.replace(whole, leader="a7").require_members(("a0", "a1"), DT)


def test_thapas_law_on_kinematic_tips_has_his_internal_force_speed_and_mass():
    """Two kinematic tips on a light point mass: the example of Thapa, Bai, Acosta 2018.

    An implementation of the equations that shares no code with this one gives after 1 s
    an internal force of 2.000 N, a load at 0.2000 m/s and masses of together 0.4990 kg.
    How the members share it follows from m_i' = -c_i g z_i': m_i / c_i + g z_i stays as
    it was, z_i the height of the tip.
    """
    gains = (0.6, 0.4)
    places = [(0.0, -0.1, 0.0), (0.0, 0.1, 0.0)]
    law = team(
        kind=Decentralised,
        places=places,
        internal_force=2.0,
        gain=0.1,
        filter=200.0,
        take=0.0,
        rise=1e-9,
    )
    phases = [
        {"kind": "hold", "duration": 1e-3},
        {"kind": "lift", "height": 1e-9, "duration": 10.0},
    ]
    motion = motion_of_object(
        Fields({"phases": phases}, "reference.object"), Vec3(0.0, 0.0, 0.0)
    )
    rows = [dataclasses.replace(law, motion=motion, adaptation=c) for c in gains]
    h, K, weight = 2e-3, 500.0, 0.5 * 9.81
    state = [(MemberState(mass=0.1),) * 2 for _ in rows]
    tips, path = np.zeros((2, 3)), [np.zeros(3)]
    for _ in range(500):
        # where the springs balance the load
        path.append(tips.mean(axis=0) - [0.0, 0.0, weight / (2.0 * K)])
        force = K * (tips - path[-1])  # of the tips on the load
        for i, each in enumerate(rows):
            state[i], given = each.lead(state[i], inputs(each, 0.5, forces=force), h)
            tips[i] += h * np.add([*Carry.of(given[i]).offset_rate], [0.2, 0.0, 0.0])
    masses = np.array([state[i][i].mass for i in range(2)])
    assert (force[1] - force[0])[1] / 2.0 == pytest.approx(2.0, abs=2e-3)
    assert (path[-1] - path[-2]) / h == pytest.approx([0.2, 0.0, 0.0], abs=2e-3)
    assert masses.sum() == pytest.approx(0.4990, abs=4e-3)
    assert (masses - 0.1) / gains == pytest.approx(-9.81 * tips[:, 2], rel=0.02)


def test_the_tables_of_the_page_are_those_of_the_shipped_scenario() -> None:
    root = Path(__file__).resolve().parents[2]
    page = (root / "docs" / "several_vehicles.md").read_text("utf-8")
    shown = tomllib.loads(page.partition("```toml\n")[2].partition("```")[0])
    shipped = tomllib.loads(
        (root / "src/skyarm/scenario/library/two_carry_a_bar.toml").read_text("utf-8")
    )
    assert shown["controller"].items() <= shipped["controller"].items()
    assert [shown[name] for name in ("team", "agents")] == [
        shipped[name] for name in ("team", "agents")
    ]
    assert shown["world"]["grasps"] == shipped["world"]["grasps"][:1]
    assert shown["reference"]["tip"] == shipped["reference"]["tip"]
    pairs = zip(
        shown["reference"]["object"]["phases"],
        shipped["reference"]["object"]["phases"],
        strict=True,
    )
    for one, other in pairs:
        assert one.keys() == other.keys()
        assert all(
            value == pytest.approx(other[word], abs=1e-3)
            for word, value in one.items()
            if word != "kind"
        )
        assert one["kind"] == other["kind"]


@pytest.mark.parametrize(
    ("kind", "settling"),
    [(ObjectWrench, 8.0), (Decentralised, 8.0), (LeaderFollower, 15.0)],
)
def test_members_are_told_their_parts_of_the_mass_and_how_shifts_settle(kind, settling):
    whole = team(
        kind=kind,
        masses=(3.0, 1.0),
        **({} if kind is LeaderFollower else {"filter": 8.0}),
    )
    start = whole.first(DT)
    if kind is Decentralised:  # whose members have no common mass
        start = tuple(MemberState(mass=mass) for mass in (1.2, 0.4))
    for t, share in ((5.0, 1.0), (3.0 - 0.5 * whole.rise, 0.5), (1.5, 0.0)):
        told = [Carry.of(row) for row in whole.lead(start, inputs(whole, t), DT)[1]]
        assert [each.mass for each in told] == pytest.approx([1.2 * share, 0.4 * share])
        assert [each.settling for each in told] == [settling] * 2
    nobody = dataclasses.replace(inputs(whole, 5.0), holding=0.0)
    for row in whole.lead(start, nobody, DT)[1]:
        told = Carry.of(row)
        assert [told.mass, told.held, *told.force] == [0.0] * 5
