"""Which command acted when: the laws' queues, and what of the disturbance the plan is
bent for.
"""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from law_parts import in_small_steps, with_parts
from scipy.spatial.transform import Rotation

import skyarm
from skyarm.algebra import Quaternion, Vec3
from skyarm.control.blocks.late_actuators import first_past
from skyarm.control.blocks.prediction import Disturbance
from skyarm.control.catalogue import make_controller
from skyarm.control.controller import with_applied_command
from skyarm.control.laws.centroidal import law as law_module
from skyarm.control.laws.centroidal import make_centroidal
from skyarm.control.laws.centroidal.law import learning
from skyarm.control.model import Model
from skyarm.dynamics.actuators import Command
from skyarm.reference import Reference
from skyarm.reference.preview import with_preview
from skyarm.sensing.measurement import blank_measurement

ARM = skyarm.load_vehicle("hummingbird_arm2_rotors")
MODEL = Model(vehicle=ARM, gravity=9.8)
DT = 0.005
SENT = (
    Command(rotor_speeds=(440.0, 520.0, 470.0, 500.0), efforts=(0.02, -0.01)),
    Command(rotor_speeds=(530.0, 450.0, 490.0, 460.0), efforts=(-0.03, 0.02)),
    Command(rotor_speeds=(480.0, 510.0, 430.0, 540.0), efforts=(0.01, 0.03)),
)
"""Oldest first: what was commanded while a measurement of two periods' age is on its
way."""
TURNING = (485.0, 475.0, 480.0, 490.0)
ZERO = Vec3(0.0, 0.0, 0.0)


def array(v):
    return np.array([float(c) for c in v])


def lag(speeds, command):
    """First-order lag over one period with the vehicle's two time constants, 12.5 ms up
    and 25 ms down.
    """
    found = []
    for now, wanted in zip(speeds, command.rotor_speeds, strict=True):
        found.append(
            wanted + (now - wanted) * np.exp(-DT / (0.0125 if wanted > now else 0.025))
        )
    return found


def hovering(joints=(0.3, -0.5)):
    level = dataclasses.replace(
        blank_measurement(2, 4),
        position=Vec3(0.0, 0.0, 1.0),
        joints=joints,
        rotor_speeds=TURNING,
    )
    still = dict.fromkeys(
        ("joint_rates", "joint_accelerations", "joint_jerks", "joint_snaps"), (0.0, 0.0)
    )
    goal = Reference(
        position=Vec3(0.0, 0.0, 1.0),
        velocity=ZERO,
        acceleration=ZERO,
        joints=joints,
        **still,
    )
    return level, goal.dense()


def underway(controller, sent=SENT, **observed):
    """Memory amid a flight: the observer runs, the rotors turn, three commands are on
    their way.
    """
    memory = controller.memory
    seen = dataclasses.replace(
        memory.observed,
        position=Vec3(0.0, 0.0, 1.0),
        joints=(0.3, -0.5),
        rotor_speeds=TURNING,
    )
    queue = {"sent": sent}
    if not isinstance(memory.sent, tuple):
        past = first_past(
            Command(rotor_speeds=TURNING, efforts=(0.0, 0.0)), len(memory.past.speeds)
        )
        for command in sent[:-1]:
            past = past.after(MODEL, command, DT)
        queue = {"sent": sent[-1], "past": past}
    return dataclasses.replace(
        memory, started=1.0, **queue, observed=dataclasses.replace(seen, **observed)
    )


NO_LAG = {"lag": (0.0, 0.0)}


def law(name):
    if name == "centroidal":
        return make_centroidal(MODEL, delay=2 * DT, **NO_LAG)
    return make_controller(name, MODEL, delay_periods=2)


def stepped(controller, memory):
    return controller.law(memory, *hovering(), DT, par=controller.par)


LAWS = ("centroidal", "ct_ladder")


@pytest.mark.parametrize("name", LAWS)
def test_the_observers_rotors_turn_by_the_oldest_command(name):
    controller = law(name)
    following, _ = stepped(controller, underway(controller))
    # the modelled lag is solved exactly
    assert following.observed.rotor_speeds == pytest.approx(
        lag(TURNING, SENT[0]), rel=1e-12
    )


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("part", ["rotor_speeds", "efforts"])
def test_the_observer_hears_the_oldest_command_and_no_other(name, part):
    controller = law(name)
    plain = stepped(controller, underway(controller))[0].observed
    for i in range(3):
        other = dataclasses.replace(
            SENT[i], **{part: tuple(1.1 * each for each in getattr(SENT[i], part))}
        )
        found = stepped(
            controller, underway(controller, (*SENT[:i], other, *SENT[i + 1 :]))
        )[0].observed
        assert (found != plain) == (i == 0)


@pytest.mark.parametrize("name", LAWS)
def test_the_queue_moves_on_by_one(name):
    controller = law(name)
    memory = underway(controller)
    following, command = stepped(controller, memory)
    if isinstance(memory.sent, tuple):
        assert following.sent == (*SENT[1:], command)
        return
    assert following.sent == command
    assert following.past.speeds[:-1] == memory.past.speeds[1:]
    assert following.past.efforts == (*memory.past.efforts[1:], SENT[2].efforts)


@pytest.mark.parametrize("periods", [0, 1, 4])
def test_the_first_queue_holds_a_hover_for_each_period_of_both_delays(periods):
    """Told as a time or as periods; the rotors carry the weight, each alike."""
    each = np.sqrt(float(ARM.mass) * 9.8 / (4 * 8.54858e-6))
    stepped_law = make_controller("ct_ladder", MODEL, delay_periods=periods).memory.sent
    own = make_centroidal(MODEL, delay=DT * periods, **NO_LAG).memory
    assert own.past.squares == tuple(
        tuple(speed**2 for speed in row) for row in own.past.speeds
    )
    for speeds, efforts in (
        (
            [command.rotor_speeds for command in stepped_law],
            [command.efforts for command in stepped_law],
        ),
        (own.past.speeds, own.past.efforts),
    ):
        assert len(speeds) == periods + 1
        np.testing.assert_allclose(speeds, each, rtol=1e-9)
        np.testing.assert_allclose(efforts, 0.0, atol=1e-12)


def present(controller, memory):
    none = Disturbance(force=ZERO, torque=ZERO, efforts=(0.0, 0.0))
    timing = law_module.time_of_action(controller.par, memory, DT)
    seen = SimpleNamespace(observed=memory.observed, unknown=none)
    return law_module.present(controller.par, timing, seen, DT)


def test_the_present_state_is_that_after_the_later_commands_in_their_order():
    """The measurement's own period had the first; the two that follow it have acted
    since.
    """
    controller = law("centroidal")
    memory = underway(controller)
    found = present(controller, memory)
    first = lag(TURNING, SENT[0])
    assert found.rotor_speeds == pytest.approx(
        lag(lag(first, SENT[1]), SENT[2]), rel=1e-12
    )
    # what rests on the order: the other way round is 4 rad/s off
    assert (
        np.abs(np.subtract(found.rotor_speeds, lag(lag(first, SENT[2]), SENT[1]))).max()
        > 4.0
    )
    # both torques, each for its period, move the joints by the mean of both over both
    seen, model = memory.observed.state(), MODEL
    none = Disturbance(force=ZERO, torque=ZERO, efforts=(0.0, 0.0))
    exact = dataclasses.replace(seen, rotor_speeds=tuple(first))
    for command in SENT[1:]:
        exact = in_small_steps(model, exact, command, none, DT)
    moved = np.subtract(exact.joint_rates, seen.joint_rates)
    assert np.subtract(found.joint_rates, exact.joint_rates) == pytest.approx(
        0.0, abs=0.05 * np.abs(moved).max()
    )


def found_late(periods):
    """Law and memory of a flight in which commands were found to be so many periods
    late, and its past of actuators.
    """
    controller = make_centroidal(MODEL, mode="tip", delay=2 * DT)
    memory = underway(controller)
    paid = tuple(0.9 if j != periods else 0.0 for j in range(9))
    lag = dataclasses.replace(
        memory.parts.lag, base=dataclasses.replace(memory.parts.lag.base, paid=paid)
    )
    past = memory.past
    for k in range(11):
        speeds = tuple(460.0 + 4.0 * k + each for each in (0.0, 5.0, 9.0, 14.0))
        past = past.after(
            MODEL, Command(rotor_speeds=speeds, efforts=(0.001 * k, -0.001 * k)), DT
        )
    return controller, dataclasses.replace(with_parts(memory, lag=lag), past=past)


@pytest.mark.parametrize("periods", [0, 3, 8])
def test_the_observers_rotors_are_late_by_the_measurements_age_and_the_lag_found(
    periods,
):
    controller, memory = found_late(periods)
    following, _ = stepped(controller, memory)
    # the newest row is of the command that is now the last
    assert following.past.speeds[-1] == pytest.approx(
        lag(memory.past.speeds[-1], SENT[2]), rel=1e-12
    )
    assert following.observed.rotor_speeds == pytest.approx(
        following.past.speeds[-1 - 2 - periods], rel=1e-6
    )


def test_by_a_known_delay_of_the_commands_the_reference_is_ahead():
    level, goal = hovering()
    moving = dataclasses.replace(
        goal, velocity=Vec3(0.4, -0.2, 0.1), acceleration=Vec3(0.5, 0.3, -0.2)
    )
    later = dataclasses.replace(
        moving,
        position=moving.position
        + moving.velocity * DT
        + moving.acceleration * (0.5 * DT * DT),
        velocity=moving.velocity + moving.acceleration * DT,
    )
    told, old = (
        make_centroidal(MODEL, delay=2 * DT, age=age, **NO_LAG) for age in (DT, 2 * DT)
    )
    assert told.memory == old.memory
    ahead = told.law(told.memory, level, moving, DT, par=told.par)[1]
    assert ahead == old.law(old.memory, level, later, DT, par=old.par)[1]
    assert ahead != old.law(old.memory, level, moving, DT, par=old.par)[1]


@pytest.mark.parametrize(("told", "late"), [(9, -8), (9, 3), (2, 0)])
def test_a_known_delay_that_is_too_long_is_no_lead_and_shortens_the_age(told, late):
    """40 ms less than told: the command acts after one period, and the reference is not
    read in the past.
    """
    controller = make_centroidal(MODEL, delay=told * DT)
    memory, gains = underway(controller, SENT[:1]), controller.par.parts.lag
    lags = np.arange(-gains.earlier, 9)
    paid = tuple(0.0 if each == late else 0.9 for each in lags)
    lag = dataclasses.replace(
        memory.parts.lag, base=dataclasses.replace(memory.parts.lag.base, paid=paid)
    )
    timing = law_module.time_of_action(controller.par, with_parts(memory, lag=lag), DT)
    assert timing.late == pytest.approx(late * DT, abs=1e-6)
    assert timing.lead == pytest.approx(max(late, 0) * DT, abs=1e-6)
    assert timing.age == pytest.approx(told + late, abs=1e-3)
    assert controller.par.lead_periods == 0


def test_the_preview_counts_from_when_the_command_acts():
    """Commands 15 or 100 ms late: samples to come are so much nearer, and at least a
    period away.
    """
    goal = hovering()[1]
    for late in (3, 20):
        controller = make_centroidal(MODEL, mode="tip", delay=late * DT, age=0.0)
        par, memory = controller.par, controller.memory
        leads = [float(each) for each in par.preview]
        told = with_preview(goal, leads, lambda lead: goal)
        motion, _, _ = law_module.continue_reference(par, memory, told, late * DT, DT)
        left = [max(each - late * DT, DT) for each in leads[2:]]
        assert [float(time) for time, _ in motion.ahead] == pytest.approx(left)
        # what a command that is still later has missed: no two instants are one
        motion, _, _ = law_module.continue_reference(par, memory, told, leads[3], DT)
        left = [DT, 2 * DT, *(each - leads[3] for each in leads[4:])]
        assert [float(time) for time, _ in motion.ahead] == pytest.approx(left)


def test_a_command_that_others_changed_teaches_nothing():
    controller = make_centroidal(MODEL)
    memory = dataclasses.replace(underway(controller, SENT[:1]), free=(1.0, 0.0, 1.0))
    assert learning(memory, 1) == (1.0, 0.0, 1.0)
    assert learning(memory, 0.5) == (0.5, 0.0, 0.5)
    changed = dataclasses.replace(memory, applied=(1.0, 1.0, 0.0))
    assert learning(changed, 1) == (0.0, 0.0, 0.0)


def test_the_delay_less_the_measurements_age_leads_the_reference():
    led = [
        make_centroidal(MODEL, delay=2 * DT, age=age).par.lead_periods
        for age in (0.0, DT, 2 * DT)
    ]
    assert led == [2, 1, 0]


def test_a_measurement_without_delay_is_the_present():
    controller = make_centroidal(MODEL, **NO_LAG)
    memory = underway(controller, SENT[:1])
    found = present(controller, memory)
    assert found.rotor_speeds == TURNING
    assert found.position == memory.observed.position


@pytest.mark.parametrize("mode", ["joint", "tip"])
def test_the_plan_leans_against_the_force_found_or_in_tip_mode_its_slow_part(mode):
    """The plan's attitude is told by the torque of a known load at the tip: r x R^T (0,
    0, -m g), R e_3 || m g e_3 - d.

    Sideways, so that no joint (all turn about y) has a part in it.
    """
    found, slow = np.array([0.0, -0.6, 0.2]), np.array([0.0, 1.5, 0.1])
    controller = make_centroidal(
        MODEL, mode=mode, preview=0.0, force_trend=0.0, **NO_LAG
    )
    memory = underway(controller, SENT[:1], force=Vec3(*found.tolist()))
    # the observer holds what it found
    memory = dataclasses.replace(
        memory, free=(0.0, 0.0, 0.0), slow_force=Vec3(*slow.tolist())
    )
    memory = with_parts(
        memory, adaptation=dataclasses.replace(memory.parts.adaptation, tip_mass=0.05)
    )
    following, _ = stepped(controller, memory)
    # but for the little by which a false one may shrink there
    np.testing.assert_allclose(array(following.observed.force), found, atol=1e-3)
    found = array(following.observed.force)
    # one pole at 3 rad/s
    slow = slow + (found - slow) * (1.0 - np.exp(-3.0 * DT))
    np.testing.assert_allclose(
        array(following.slow_force), slow, rtol=1e-12, atol=1e-15
    )
    up = float(ARM.mass) * np.array([0.0, 0.0, 9.8]) - (
        slow if mode == "tip" else found
    )
    roll = np.arctan2(-up[1], up[2])
    pull = Rotation.from_rotvec([roll, 0.0, 0.0]).inv().apply([0.0, 0.0, -9.8])
    tip = -0.15 * np.array(
        [np.sin(0.3) + np.sin(-0.2), 0.0, np.cos(0.3) + np.cos(-0.2)]
    )
    # what shrinks has turned by a millionth about the other axis
    np.testing.assert_allclose(
        array(following.parts.adaptation.feedforward.torque),
        0.05 * np.cross(tip, pull),
        atol=2e-7,
    )
    assert following.parts.adaptation.feedforward.torque.x == pytest.approx(
        0.05 * 9.8 * tip[2] * np.sin(roll), abs=1e-9
    )


@dataclasses.dataclass(frozen=True)
class Queue:
    """A memory with a queue of anything."""

    sent: object
    applied: tuple[float, ...] = (1.0, 1.0, 1.0)


def test_the_newest_of_the_queue_is_what_was_really_sent():
    changed = dataclasses.replace(SENT[2], efforts=(0.01, 0.02))
    found = with_applied_command(Queue(SENT), changed)
    assert found == Queue((*SENT[:2], changed), applied=(1.0, 1.0, 0.0))
    assert with_applied_command(Queue(SENT[2]), changed) == Queue(
        changed, applied=(1.0, 1.0, 0.0)
    )
    for i, off in ((0, 1.0), (0, -1.0), (3, 1.0), (3, -1.0)):
        speeds = [*SENT[2].rotor_speeds]
        speeds[i] += off
        one = dataclasses.replace(SENT[2], rotor_speeds=tuple(speeds))
        assert with_applied_command(Queue(SENT), one) == Queue(
            (*SENT[:2], one), applied=(0.0, 1.0, 1.0)
        )
    more = dataclasses.replace(SENT[2], efforts=(0.02, 0.03))
    assert with_applied_command(Queue(SENT), more).applied == (1.0, 0.0, 1.0)
    lost = dataclasses.replace(SENT[2], efforts=(float("nan"), 0.03))
    assert with_applied_command(Queue((*SENT[:2], lost)), SENT[2]).applied == (
        1.0,
        0.0,
        1.0,
    )


@pytest.mark.parametrize(
    "sent",
    [
        (),
        (1.0, SENT[0]),
        (SENT[0], 1.0),
        ((), SENT[0]),
        [SENT[0]],
        3.0,
        None,
        (1.0, 2.0),
    ],
    ids=str,
)
def test_a_field_that_is_no_queue_of_commands_is_left_as_it_is(sent):
    memory = Queue(sent)
    assert with_applied_command(memory, SENT[1]) is memory


def test_a_command_sent_as_wished_is_obeyed():
    assert with_applied_command(Queue(SENT), SENT[2]) == Queue(SENT)
    assert with_applied_command(Quaternion(1.0, 0.0, 0.0, 0.0), SENT[2]) == Quaternion(
        1.0, 0.0, 0.0, 0.0
    )
