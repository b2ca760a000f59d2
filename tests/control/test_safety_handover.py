"""Laws with memory under a guard that changes their commands: they know what was sent,
and nothing winds up.

What passes from the law to the recovery and back, and each limit on what is sent, from
memories made by hand.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from law_parts import with_parts

import skyarm
from skyarm.algebra import Quaternion, Vec3
from skyarm.algebra.scalars import logical_and, where
from skyarm.control.catalogue import LAWS, make_controller
from skyarm.control.controller import all_applied, with_applied_command
from skyarm.control.model import Model
from skyarm.control.safety import with_safety_layer
from skyarm.control.safety.recovery import Confidence
from skyarm.control.safety.safety_layer import arbitrate, govern, limit_command
from skyarm.dynamics.actuators import Command
from skyarm.records.leaves import leaves
from skyarm.reference import Constant, Trajectory
from skyarm.reference.signals import Ramp
from skyarm.sensing.measurement import Measurement
from skyarm.simulate import run
from support.cases import sampled
from support.flights import fly
from support.laws import ARM2, PAPER, cases, controller, vec

START, RELEASE, END = 1.0, 2.0, 5.0
EFFORT, SLEW = 0.03, 3e3
"""N m, less than the shoulder's weight; rad/s^2, 15 rad/s in a period."""

TRUSTING = {"trusted_tilt": math.pi} | dict.fromkeys(
    (
        "trusted_rate",
        "trusted_joint_error",
        "lost_rate",
        "lost_speed",
        "lost_joint_speed",
    ),
    math.inf,
)
"""So that the law flies on: given up, it would begin anew and forget what it had wound
up."""

MOVED = Trajectory(
    x=Ramp(start=START, duration=0.5, height=0.2),
    z=Constant(3.0),
    joints=(Constant(0.3), Constant(-0.2)),
)

WITHOUT_MEMORY = {*PAPER}
WITHOUT_MEMORY |= {"bulut2019", "guo2023", "li2024"}

CASES = [
    *((name, {}) for name in sorted(LAWS)),
    ("centroidal", {"mode": "tip", "adaptation": 1.0}),
]
CASES += [("indi", {"delay_periods": 1, "measured_speeds": False})]


OFTEN = [(name, {}) for name in ("indi", "kim2013", "l1_adaptive", "ct_ladder")]
WINDING = [case for case in CASES if case in OFTEN or "adaptation" in case[1]]
"""One of each kind of memory; the first law is without, the rest in ``make
thorough``."""

SEEN: list = []
"""Not in the law's closure, which a log describes."""


def squeezed(controller, slew):
    """The controller under a guard whose limits are tight for a second; its memories go
    to SEEN if it is called.
    """
    guard = with_safety_layer(controller, TRUSTING)
    SEEN.clear()

    def law(memory, measurement, reference, dt, *, par):
        now = logical_and(
            measurement.time >= START - 1e-6, measurement.time < RELEASE - 1e-6
        )
        tight = dataclasses.replace(
            par.limits,
            effort=tuple(where(now, EFFORT, effort) for effort in par.limits.effort),
            rotor_slew=where(now, slew, par.limits.rotor_slew),
        )
        found = guard.law(
            memory,
            measurement,
            reference,
            dt,
            par=dataclasses.replace(par, limits=tight),
        )
        if not controller.compiled:
            SEEN.append(found[0])
        return found

    return dataclasses.replace(guard, law=law)


def at_release(scenario):
    """Memory of the guard after the last squeezed period."""
    if not scenario.controller.compiled:
        return SEEN[round(RELEASE * scenario.rates.control) - 1]
    half = dataclasses.replace(scenario, duration=RELEASE)
    return fly(half).carry.agent.memory


def estimated(memory):
    """What a law has integrated, each with the most that it may be at release: some
    times what it is in free flight.

    The plant's rotors and joints differ from the belief by 0.14 N and 1e-4 N m. Taken
    for granted, the desired commands would make it 0.1 N m (l1), 0.075 N m (learned: a
    network far from its training), the adaptation's bounds (sliding mode).
    """
    kind = type(memory).__name__
    found = []
    if kind == "SlidingMemory":
        found = [((*memory.position,), 0.2), (memory.joints, 0.5 * 60.0)]
    if kind == "L1Memory":
        found = [((memory.thrust, *memory.force), 0.2), (memory.efforts_twice, 0.01)]
    if kind == "LearnedMemory":
        found = [(memory.answer[6:], 0.04)]
    if kind == "PredictiveMemory":
        # force, torque and joint efforts end the leaves of the estimate
        unknown = memory.past.estimate[-8:]
        found = [(unknown[:3], 0.2), (unknown[6:], 0.006)]
    if getattr(memory, "observed", ()):
        # of the accelerometer: what was changed acts in its period, before the
        # observer's motion has it
        found = [((*memory.observed.force,), 0.3), (memory.observed.efforts, 0.006)]
    if kind == "CentroidalMemory":
        found += [
            ([v / 838.0**2 for v in memory.trim], 0.03),
            ((memory.parts.adaptation.tip_mass,), 1e-3),
            ([joint.damping for joint in memory.parts.adaptation.joints], 3e-3),
        ]
    return found


@pytest.mark.parametrize(("law", "options"), sampled(CASES, 30, keep=WINDING))
def test_a_law_whose_commands_are_changed_knows_it_winds_nothing_up_and_comes_back(
    law, options
):
    base = skyarm.load_scenario("case1", duration=END if law != "nmpc" else 3.5)
    made = make_controller(law, base.controller.par.model, **options)
    # tracking joints, the centroidal law does not fly on rotors that are slewed and an
    # arm that does not follow at once
    controller = squeezed(
        made, math.inf if (law, options) == ("centroidal", {}) else SLEW
    )
    scenario = dataclasses.replace(
        base, reference=MOVED, initial=None, controller=controller
    )
    log = run(scenario)
    memory = at_release(scenario)
    # a memory may hold programs: names of their own keep it out of what a failing test
    # prints
    given_up, sent, kept = (
        memory.confidence.given_up,
        memory.sent,
        getattr(memory.inner, "sent", ()),
    )
    assert given_up == 0.0
    if law in WITHOUT_MEMORY:
        assert not kept
    else:
        assert (kept if isinstance(kept, Command) else kept[-1]) == sent
    for values, most in estimated(memory.inner):
        assert np.abs(values).max() <= most
    tight = (log.time >= START) & (log.time < RELEASE)
    if law != "rotors_sim_position":  # which leaves the joints alone
        assert (
            np.abs(log.efforts[tight]).max()
            == EFFORT
            < 1.1 * np.abs(log.efforts[~tight]).max()
        )
        np.testing.assert_allclose(log.joints[-1], [0.3, -0.2], atol=0.03)
    assert log.status == "completed"
    # what the paper's laws do not know of rotors and gravity leaves 0.1 m
    np.testing.assert_allclose(log.position[-1], [0.2, 0.0, 3.0], atol=0.12)
    # the step of 0.2 m, and what a network far from its training adds
    assert np.abs(log.position - log.position_reference).max() < 0.4


@pytest.mark.parametrize("changed", ["rotor", "joint"])
def test_centroidal_trim_and_adaptation_stand_still_while_another_command_is_sent(
    changed,
):
    scenario = skyarm.load_scenario("case1", duration=0.05)
    law = make_controller("centroidal", scenario.controller.par.model, adaptation=1.0)
    reading = reading_of(run(dataclasses.replace(scenario, reference=MOVED)))
    wanted = MOVED.at(0.0).dense()
    memory, command = law.law(law.memory, reading, wanted, 0.005, par=law.par)
    learned = memory.parts.adaptation
    sticky = tuple(
        dataclasses.replace(joint, damping=0.002, moving=0.1)
        for joint in learned.joints
    )
    learned = dataclasses.replace(learned, tip_mass=0.01, joints=sticky)
    memory = with_parts(memory, adaptation=learned)
    turned, pulled = list(command.rotor_speeds), list(command.efforts)
    if changed == "rotor":
        turned[2] -= 1e-9
    else:
        pulled[1] += 1e-9
    sent = Command(rotor_speeds=tuple(turned), efforts=tuple(pulled))
    free, held = (
        law.law(
            with_applied_command(memory, each), reading, wanted, 0.005, par=law.par
        )[0]
        for each in (command, sent)
    )
    assert free.applied == held.applied == all_applied(2)
    adapted, before, still = (each.parts.adaptation for each in (free, memory, held))
    assert adapted.tip_mass != before.tip_mass == still.tip_mass
    assert (
        adapted.joints[0].damping != before.joints[0].damping == still.joints[0].damping
    )
    # the trim is of the rotors alone
    assert free.trim != memory.trim
    assert held.trim == memory.trim if changed == "rotor" else held.trim != memory.trim


def reading_of(log):
    """The last instant of a log as a measurement, some centimetres and degrees off."""
    return Measurement(
        time=0.0,
        position=Vec3(0.03, -0.02, 2.99),
        quaternion=Quaternion(*log.quaternion[-1].tolist()),
        velocity=Vec3(0.01, 0.0, 0.02),
        rate=Vec3(0.02, -0.01, 0.0),
        specific_force=Vec3(0.0, 0.0, 9.8),
        joints=(0.28, -0.17),
        joint_rates=(0.05, -0.03),
        rotor_speeds=tuple(log.rotor_speeds[-1].tolist()),
    )


@dataclasses.dataclass(frozen=True)
class Obeying:
    """Memory of a law that integrates."""

    sent: object
    applied: tuple[float, ...]


@pytest.mark.parametrize("several", [False, True])
def test_a_memory_is_told_which_actuators_did_something_else(several):
    desired = Command(rotor_speeds=(1.0, 2.0), efforts=(0.1, -0.2))
    before = Command(rotor_speeds=(9.0, 9.0), efforts=(9.0, 9.0))
    memory = Obeying((before, desired) if several else desired, all_applied(2))
    for sent, applied in (
        (desired, (1.0, 1.0, 1.0)),
        (dataclasses.replace(desired, rotor_speeds=(1.0, 2.5)), (0.0, 1.0, 1.0)),
        (dataclasses.replace(desired, rotor_speeds=(0.5, 2.0)), (0.0, 1.0, 1.0)),
        (dataclasses.replace(desired, efforts=(0.1, 0.0)), (1.0, 1.0, 0.0)),
        (dataclasses.replace(desired, efforts=(math.nan, -0.3)), (1.0, 0.0, 0.0)),
    ):
        assert with_applied_command(memory, sent).applied == applied


def test_the_learned_laws_history_is_of_what_was_sent():
    scenario = skyarm.load_scenario("case1", duration=0.05)
    law = make_controller("learned_compensator", scenario.controller.par.model)
    reading, wanted = (
        reading_of(run(dataclasses.replace(scenario, reference=MOVED))),
        MOVED.at(0.0).dense(),
    )
    memory, _ = law.law(law.memory, reading, wanted, 0.005, par=law.par)
    for k, effort in enumerate((0.4, 0.1)):
        sent = Command(rotor_speeds=(500.0,) * 4, efforts=(effort, 0.0))
        memory, _ = law.law(
            with_applied_command(memory, sent), reading, wanted, 0.005, par=law.par
        )
        # the filter starts at the first command and follows the second at 15 rad/s
        share = 1.0 - math.exp(-15.0 * 0.005)
        assert memory.history.commands[6] == pytest.approx(
            0.4 if k == 0 else 0.4 - 0.3 * share, rel=1e-12
        )
    rotors = law.par.model.vehicle.rotors
    assert memory.history.commands[2] == pytest.approx(
        sum(r.thrust_coefficient * 500.0**2 for r in rotors), rel=1e-12
    )


DT = 0.005
EFFORTS = (0.3, 0.05)
SPEED = 838.0


def model():
    links = tuple(
        dataclasses.replace(
            link,
            joint=dataclasses.replace(
                link.joint, lower=-1.0, upper=1.0, effort_limit=most
            ),
        )
        for link, most in zip(ARM2.links, EFFORTS, strict=True)
    )
    return Model(vehicle=dataclasses.replace(ARM2, links=links), gravity=9.81)


def guard(**limits):
    return with_safety_layer(
        controller("hybrid_computed_torque", model()),
        {"stiffness": 5.0, "damping": 2.7} | limits,
    )


GUARD = guard(joint_slew=[2.0, 3.0], joint_step=[0.1, 0.2])
HOVER = math.sqrt(
    sum(float(body.mass) for body in ARM2.bodies)
    * 9.81
    / 4.0
    / float(ARM2.rotors[0].thrust_coefficient)
)
WISHED = Command(rotor_speeds=(HOVER,) * 4, efforts=(0.01, -0.01))


def level(joints, *, position=(1.0, 2.0, 3.0), joint_rates=(0.0, 0.0), yaw=0.7):
    zero = np.zeros(3)
    case = dataclasses.replace(
        cases(1, seed=3)[0],
        p=np.array(position),
        euler=np.array([0.0, 0.0, yaw]),
        v=zero,
        w=zero,
    )
    return dataclasses.replace(
        case.measurement(), joints=joints, joint_rates=joint_rates
    )


def reference(joints):
    case = dataclasses.replace(
        cases(1, seed=3)[0],
        p_d=np.array([1.0, 2.0, 3.0]),
        v_d=np.zeros(3),
        a_d=np.zeros(3),
    )
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
    np.testing.assert_allclose(
        was.reference.joints, (0.3 + 2.0 * DT, -0.2 + 3.0 * DT), rtol=1e-12
    )
    assert after.joints == was.reference.joints
    assert after.ramping == was.ramping == (1.0, 1.0)
    assert after.started == 1.0


def test_in_the_first_period_they_start_at_the_joints():
    was, after = step(
        flying(started=0.0, ramping=(0.0, 0.0)),
        level((0.25, -0.25)),
        reference((0.9, 0.9)),
    )
    assert was.joints == (0.25, -0.25)
    np.testing.assert_allclose(
        after.joints, (0.25 + 2.0 * DT, -0.25 + 3.0 * DT), rtol=1e-12
    )
    assert after.started == 1.0


@pytest.mark.parametrize("before", [0.0, 1.0])
def test_while_the_recovery_flies_they_follow_the_joints_and_nothing_is_on_its_way(
    before,
):
    """So that a law that comes back is asked to start where the arm is: from the period
    in which it is given up on.
    """
    _, after = step(
        flying(before), level((0.05, -0.5)), reference((0.9, 0.9)), failed=True
    )
    assert after.confidence.given_up == 1.0
    assert after.joints == (0.05, -0.5)
    assert after.ramping == (0.0, 0.0)


def test_a_law_that_comes_back_is_asked_for_no_jump_of_the_joints():
    calm = guard(calm=1e-3, joint_slew=[2.0, 3.0], joint_step=[0.1, 0.2])
    memory, joints, slew = flying(1.0), np.array([0.3, -0.2]), np.array([2.0, -3.0])
    _, memory = step(
        memory, level(tuple(joints)), reference((0.9, -0.9)), failed=True, guard=calm
    )
    for _ in range(20):
        joints = joints - 0.01  # the arm is stowed meanwhile
        _, memory = step(
            memory,
            level(tuple(joints.tolist())),
            reference((0.9, -0.9)),
            failed=True,
            guard=calm,
        )
    was, memory = step(
        memory, level(tuple(joints.tolist())), reference((0.9, -0.9)), guard=calm
    )
    assert memory.confidence.given_up == 0.0
    np.testing.assert_allclose(was.reference.joints, joints + DT * slew, rtol=1e-12)
    assert memory.joints == was.reference.joints
    # and the next period goes on from there
    then, _ = step(
        memory, level(tuple(joints.tolist())), reference((0.9, -0.9)), guard=calm
    )
    np.testing.assert_allclose(
        then.reference.joints, joints + 2.0 * DT * slew, rtol=1e-12
    )


def test_the_recovery_hovers_where_the_law_ended_and_takes_the_arm_from_its_pose():
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
def test_the_laws_command_is_sent_until_it_is_given_up_and_then_the_recoverys(given_up):
    """Level over the place it holds, the arm hanging: the recovery carries the weight
    and nothing else.
    """
    free = guard(rotor_slew=math.inf, effort_slew=math.inf)
    seen = level((0.0, 0.0))
    desired = Command(rotor_speeds=(HOVER + 20.0,) * 4, efforts=(0.01, -0.01))
    memory = flying(
        float(given_up), joints=(0.0, 0.0), arm=(0.0, 0.0), hold=seen.position, yaw=0.7
    )
    was = govern(free.par, memory, seen, reference((0.0, 0.0)), DT)
    found = arbitrate(free.par, memory, seen, was, desired, given_up, DT).sent
    np.testing.assert_allclose(
        found.rotor_speeds,
        (HOVER,) * 4 if given_up else desired.rotor_speeds,
        rtol=1e-9,
    )
    np.testing.assert_allclose(
        found.efforts, (0.0, 0.0) if given_up else desired.efforts, atol=1e-9
    )


@pytest.mark.parametrize("i", [0, 1])
def test_a_joint_far_from_where_its_governed_reference_stood_is_doubted(i):
    """0.6 rad is the most: counted from the reference that the law was asked for, not
    from the one that is wanted.
    """
    for off, outside in ((0.59, 0.0), (0.61, DT), (-0.59, 0.0), (-0.61, DT)):
        joints = [0.3, -0.2]
        joints[i] += off
        _, after = step(flying(), level(tuple(joints)), reference(tuple(joints)))
        assert after.confidence.outside == outside


def sent(command, measurement, memory=None, **limits):
    free = {"rotor_slew": math.inf, "effort_slew": math.inf} | limits
    return limit_command(
        guard(**free).par, memory or flying(), measurement, command, DT
    )


WIDE = {"joint_pole": 200.0, "joint_speed": 400.0}
"""A barrier too far away to add anything."""

AT_LIMIT = [(i, side) for i in (0, 1) for side in (-1.0, 1.0)]


@pytest.mark.parametrize(("i", "side"), AT_LIMIT)
def test_braking_a_joint_asks_no_more_than_its_effort(i, side):
    """At 11 rad/s a hand's breadth from its limit only more than the effort would do:
    the most is sent, against it.
    """
    q, rate = np.zeros(2), np.zeros(2)
    q[i], rate[i] = side * 0.9, side * 11.0
    seen = level(tuple(q), joint_rates=tuple(rate))
    found = sent(Command(rotor_speeds=(HOVER,) * 4, efforts=(0.0, 0.0)), seen).efforts
    assert found[i] == -side * EFFORTS[i]
    unlimited = sent(
        Command(rotor_speeds=(HOVER,) * 4, efforts=(0.0, 0.0)), seen, effort=1e3
    ).efforts
    assert abs(unlimited[i]) > 2.0 * EFFORTS[i]


@pytest.mark.parametrize(("i", "side"), AT_LIMIT)
def test_an_effort_out_of_reach_is_cut_before_the_joints_are_looked_after(i, side):
    """What no drive gives accelerates no joint: neighbours are not braked against
    it.
    """
    efforts = [0.02, -0.03]
    efforts[i] = side * 500.0
    reached = list(efforts)
    reached[i] = side * EFFORTS[i]
    for given in (efforts, reached):
        found = sent(
            Command(rotor_speeds=(HOVER,) * 4, efforts=tuple(given)),
            level((0.0, 0.0)),
            **WIDE,
        )
        assert found.efforts == tuple(reached)


def test_efforts_within_their_limits_pass_as_they_are():
    given = Command(rotor_speeds=(HOVER, 300.0, 838.0, 0.0), efforts=(0.05, -0.04))
    assert sent(given, level((0.0, 0.0)), **WIDE) == given


@pytest.mark.parametrize("rotor", range(4))
def test_a_rotor_beyond_its_reach_is_brought_within(rotor):
    speeds = [HOVER] * 4
    speeds[rotor] = 2.0 * SPEED
    found = sent(
        Command(rotor_speeds=tuple(speeds), efforts=(0.0, 0.0)), level((0.0, 0.0))
    )
    assert max(found.rotor_speeds) <= SPEED * (1.0 + 1e-12)
    assert min(found.rotor_speeds) >= 0.0


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_what_is_sent_moves_no_faster_than_its_slew(sign):
    far = Command(
        rotor_speeds=tuple(HOVER + sign * 50.0 * k for k in (1, 2, 3, 4)),
        efforts=(sign * 0.2, sign * 0.04),
    )
    found = sent(
        far, level((0.0, 0.0)), rotor_slew=1000.0, effort_slew=[2.0, 3.0], **WIDE
    )
    np.testing.assert_allclose(
        found.rotor_speeds, HOVER + sign * 1000.0 * DT, rtol=1e-12
    )
    np.testing.assert_allclose(
        found.efforts, (0.01 + sign * 2.0 * DT, -0.01 + sign * 3.0 * DT), rtol=1e-12
    )
    first = sent(
        far,
        level((0.0, 0.0)),
        flying(started=0.0),
        rotor_slew=1000.0,
        effort_slew=[2.0, 3.0],
        **WIDE,
    )
    assert first == far


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("place", range(6))
def test_a_number_that_is_not_finite_becomes_the_last_one_sent_or_is_limited(
    place, bad
):
    values = [*(HOVER + 1.0,) * 4, 0.02, -0.03]
    values[place] = bad
    found = sent(
        Command(rotor_speeds=tuple(values[:4]), efforts=tuple(values[4:])),
        level((0.0, 0.0)),
        **WIDE,
    )
    last = [*WISHED.rotor_speeds, *WISHED.efforts]
    assert all(math.isfinite(value) for value in leaves(found))
    if math.isnan(bad):
        assert leaves(found)[place] == last[place]
