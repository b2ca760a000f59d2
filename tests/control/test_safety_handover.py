"""What passes from the law to the recovery and back, and each limit on what is sent, from memories made by hand."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from flown import ARM2, cases, controller, vec
from skyarm.actuation import Command
from skyarm.compile import leaves
from skyarm.control.model import Model
from skyarm.control.safety import with_safety_layer
from skyarm.control.safety.recovery import Confidence
from skyarm.control.safety.safety_layer import arbitrate, govern, limit_command

DT = 0.005
EFFORTS = (0.3, 0.05)
SPEED = 838.0


def model():
    links = tuple(
        dataclasses.replace(link, joint=dataclasses.replace(link.joint, lower=-1.0, upper=1.0, effort_limit=most))
        for link, most in zip(ARM2.links, EFFORTS, strict=True)
    )
    return Model(vehicle=dataclasses.replace(ARM2, links=links), gravity=9.81)


def guard(**limits):
    return with_safety_layer(controller("hybrid_computed_torque", model()), {"stiffness": 5.0, "damping": 2.7} | limits)


GUARD = guard(joint_slew=[2.0, 3.0], joint_step=[0.1, 0.2])
HOVER = math.sqrt(sum(float(body.mass) for body in ARM2.bodies) * 9.81 / 4.0 / float(ARM2.rotors[0].thrust_coefficient))
WISHED = Command(rotor_speeds=(HOVER,) * 4, efforts=(0.01, -0.01))


def level(joints, *, position=(1.0, 2.0, 3.0), joint_rates=(0.0, 0.0), yaw=0.7):
    zero = np.zeros(3)
    case = dataclasses.replace(
        cases(1, seed=3)[0], p=np.array(position), euler=np.array([0.0, 0.0, yaw]), v=zero, w=zero
    )
    return dataclasses.replace(case.measurement(), joints=joints, joint_rates=joint_rates)


def reference(joints):
    case = dataclasses.replace(cases(1, seed=3)[0], p_d=np.array([1.0, 2.0, 3.0]), v_d=np.zeros(3), a_d=np.zeros(3))
    return dataclasses.replace(case.reference(), joints=joints, joint_rates=(0.0, 0.0))


def flying(given_up=0.0, **changes):
    """A memory in the midst of a flight."""
    values = {
        "started": 1.0,
        "joints": (0.3, -0.2),
        "ramping": (1.0, 1.0),
        "arm": (0.11, 0.12),
        "sent": WISHED,
        "confidence": Confidence(given_up=given_up, outside=0.0, calm=0.0),
        "hold": vec([7.0, 8.0, 9.0]),
        "yaw": -1.1,
    }
    return dataclasses.replace(GUARD.memory, **(values | changes))


def step(memory, measurement, wanted, *, failed=False, guard=GUARD):
    was = govern(guard.par, memory, measurement, wanted, DT)
    return was, arbitrate(guard.par, memory, measurement, was, WISHED, failed, DT)


def test_while_the_law_flies_its_joint_references_go_on_from_where_they_stood():
    was, after = step(flying(), level((0.25, -0.25)), reference((0.9, 0.9)))
    # not from where the joints are
    assert was.joints == (0.3, -0.2)
    np.testing.assert_allclose(was.reference.joints, (0.3 + 2.0 * DT, -0.2 + 3.0 * DT), rtol=1e-12)
    assert after.joints == was.reference.joints
    assert after.ramping == was.ramping == (1.0, 1.0)
    assert after.started == 1.0


def test_in_the_first_period_they_start_at_the_joints():
    was, after = step(flying(started=0.0, ramping=(0.0, 0.0)), level((0.25, -0.25)), reference((0.9, 0.9)))
    assert was.joints == (0.25, -0.25)
    np.testing.assert_allclose(after.joints, (0.25 + 2.0 * DT, -0.25 + 3.0 * DT), rtol=1e-12)
    assert after.started == 1.0


@pytest.mark.parametrize("before", [0.0, 1.0])
def test_while_the_recovery_flies_they_follow_the_joints_and_nothing_is_on_its_way(before):
    """So that a law that comes back is asked to start where the arm is: from the period in which it is given up on."""
    _, after = step(flying(before), level((0.05, -0.5)), reference((0.9, 0.9)), failed=True)
    assert after.confidence.given_up == 1.0
    assert after.joints == (0.05, -0.5)
    assert after.ramping == (0.0, 0.0)


def test_a_law_that_comes_back_is_asked_for_no_jump_of_the_joints():
    calm = guard(calm=1e-3, joint_slew=[2.0, 3.0], joint_step=[0.1, 0.2])
    memory, joints, slew = flying(1.0), np.array([0.3, -0.2]), np.array([2.0, -3.0])
    _, memory = step(memory, level(tuple(joints)), reference((0.9, -0.9)), failed=True, guard=calm)
    for _ in range(20):
        joints = joints - 0.01  # the arm is stowed meanwhile
        _, memory = step(memory, level(tuple(joints.tolist())), reference((0.9, -0.9)), failed=True, guard=calm)
    was, memory = step(memory, level(tuple(joints.tolist())), reference((0.9, -0.9)), guard=calm)
    assert memory.confidence.given_up == 0.0
    np.testing.assert_allclose(was.reference.joints, joints + DT * slew, rtol=1e-12)
    assert memory.joints == was.reference.joints
    # and the next period goes on from there
    then, _ = step(memory, level(tuple(joints.tolist())), reference((0.9, -0.9)), guard=calm)
    np.testing.assert_allclose(then.reference.joints, joints + 2.0 * DT * slew, rtol=1e-12)


def test_the_recovery_hovers_where_the_law_was_given_up_and_takes_the_arm_from_where_it_is():
    seen = level((0.5, -0.4))
    _, after = step(flying(0.0), seen, reference((0.9, 0.9)), failed=True)
    assert after.hold == seen.position
    assert after.yaw == pytest.approx(0.7, abs=1e-12)
    # 1 rad/s towards the middle of the range, from the joints
    np.testing.assert_allclose(after.arm, (0.5 - DT, -0.4 + DT), rtol=1e-12)
    moved = level((0.45, -0.35), position=(1.5, 2.5, 3.5), yaw=1.9)
    _, later = step(after, moved, reference((0.9, 0.9)), failed=True)
    assert (later.hold, later.yaw) == (after.hold, after.yaw)
    np.testing.assert_allclose(later.arm, (0.5 - 2.0 * DT, -0.4 + 2.0 * DT), rtol=1e-12)


def test_while_the_law_flies_place_and_heading_are_kept_up_to_date():
    seen = level((0.5, -0.4))
    _, after = step(flying(0.0), seen, reference((0.5, -0.4)))
    assert after.hold == seen.position
    assert after.yaw == pytest.approx(0.7, abs=1e-12)
    np.testing.assert_allclose(after.arm, (0.5 - DT, -0.4 + DT), rtol=1e-12)


@pytest.mark.parametrize("given_up", [False, True])
def test_what_is_sent_is_the_laws_command_until_it_is_given_up_and_then_the_recoverys(given_up):
    """Level over the place it holds, the arm hanging: the recovery carries the weight and nothing else."""
    free = guard(rotor_slew=math.inf, effort_slew=math.inf)
    seen = level((0.0, 0.0))
    desired = Command(rotor_speeds=(HOVER + 20.0,) * 4, efforts=(0.01, -0.01))
    memory = flying(float(given_up), joints=(0.0, 0.0), arm=(0.0, 0.0), hold=seen.position, yaw=0.7)
    was = govern(free.par, memory, seen, reference((0.0, 0.0)), DT)
    found = arbitrate(free.par, memory, seen, was, desired, given_up, DT).sent
    np.testing.assert_allclose(found.rotor_speeds, (HOVER,) * 4 if given_up else desired.rotor_speeds, rtol=1e-9)
    np.testing.assert_allclose(found.efforts, (0.0, 0.0) if given_up else desired.efforts, atol=1e-9)


@pytest.mark.parametrize("i", [0, 1])
def test_a_joint_far_from_where_its_governed_reference_stood_is_doubted(i):
    """0.6 rad is the most: counted from the reference that the law was asked for, not from the one that is wanted."""
    for off, outside in ((0.59, 0.0), (0.61, DT), (-0.59, 0.0), (-0.61, DT)):
        joints = [0.3, -0.2]
        joints[i] += off
        _, after = step(flying(), level(tuple(joints)), reference(tuple(joints)))
        assert after.confidence.outside == outside


def sent(command, measurement, memory=None, **limits):
    free = {"rotor_slew": math.inf, "effort_slew": math.inf} | limits
    return limit_command(guard(**free).par, memory or flying(), measurement, command, DT)


WIDE = {"joint_pole": 200.0, "joint_speed": 400.0}
"""A barrier too far away to add anything."""

AT_LIMIT = [(i, side) for i in (0, 1) for side in (-1.0, 1.0)]


@pytest.mark.parametrize(("i", "side"), AT_LIMIT)
def test_braking_a_joint_asks_no_more_than_its_effort(i, side):
    """At 11 rad/s a hand's breadth from its limit only more than the effort would do: the most is sent, against it."""
    q, rate = np.zeros(2), np.zeros(2)
    q[i], rate[i] = side * 0.9, side * 11.0
    seen = level(tuple(q), joint_rates=tuple(rate))
    found = sent(Command(rotor_speeds=(HOVER,) * 4, efforts=(0.0, 0.0)), seen).efforts
    assert found[i] == -side * EFFORTS[i]
    unlimited = sent(Command(rotor_speeds=(HOVER,) * 4, efforts=(0.0, 0.0)), seen, effort=1e3).efforts
    assert abs(unlimited[i]) > 2.0 * EFFORTS[i]


@pytest.mark.parametrize(("i", "side"), AT_LIMIT)
def test_an_effort_out_of_reach_is_cut_before_the_joints_are_looked_after(i, side):
    """What no drive gives accelerates no joint: neighbours are not braked against it."""
    efforts = [0.02, -0.03]
    efforts[i] = side * 500.0
    reached = list(efforts)
    reached[i] = side * EFFORTS[i]
    for given in (efforts, reached):
        found = sent(Command(rotor_speeds=(HOVER,) * 4, efforts=tuple(given)), level((0.0, 0.0)), **WIDE)
        assert found.efforts == tuple(reached)


def test_efforts_within_their_limits_pass_as_they_are():
    given = Command(rotor_speeds=(HOVER, 300.0, 838.0, 0.0), efforts=(0.05, -0.04))
    assert sent(given, level((0.0, 0.0)), **WIDE) == given


@pytest.mark.parametrize("rotor", range(4))
def test_a_rotor_beyond_its_reach_is_brought_within(rotor):
    speeds = [HOVER] * 4
    speeds[rotor] = 2.0 * SPEED
    found = sent(Command(rotor_speeds=tuple(speeds), efforts=(0.0, 0.0)), level((0.0, 0.0)))
    assert max(found.rotor_speeds) <= SPEED * (1.0 + 1e-12)
    assert min(found.rotor_speeds) >= 0.0


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_what_is_sent_moves_no_faster_than_its_slew(sign):
    far = Command(rotor_speeds=tuple(HOVER + sign * 50.0 * k for k in (1, 2, 3, 4)), efforts=(sign * 0.2, sign * 0.04))
    found = sent(far, level((0.0, 0.0)), rotor_slew=1000.0, effort_slew=[2.0, 3.0], **WIDE)
    np.testing.assert_allclose(found.rotor_speeds, HOVER + sign * 1000.0 * DT, rtol=1e-12)
    np.testing.assert_allclose(found.efforts, (0.01 + sign * 2.0 * DT, -0.01 + sign * 3.0 * DT), rtol=1e-12)
    first = sent(far, level((0.0, 0.0)), flying(started=0.0), rotor_slew=1000.0, effort_slew=[2.0, 3.0], **WIDE)
    assert first == far


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("place", range(6))
def test_a_number_that_is_not_finite_becomes_the_last_one_sent_or_is_limited(place, bad):
    values = [*(HOVER + 1.0,) * 4, 0.02, -0.03]
    values[place] = bad
    found = sent(Command(rotor_speeds=tuple(values[:4]), efforts=tuple(values[4:])), level((0.0, 0.0)), **WIDE)
    last = [*WISHED.rotor_speeds, *WISHED.efforts]
    assert all(math.isfinite(value) for value in leaves(found))
    if math.isnan(bad):
        assert leaves(found)[place] == last[place]
