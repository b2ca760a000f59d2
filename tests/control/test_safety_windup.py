"""Laws with memory under a guard that changes their commands: they know what was sent, and nothing winds up."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

import skyarm
from law_flights import PAPER
from law_parts import with_parts
from skyarm.actuation import Command
from skyarm.algebra import Quaternion, Vec3
from skyarm.control.catalogue import LAWS, make_controller
from skyarm.control.controller import all_applied, with_applied_command
from skyarm.control.safety import with_safety_layer
from skyarm.reference import Constant, Trajectory
from skyarm.reference.signals import Ramp
from skyarm.scalars import logical_and, where
from skyarm.sensors.measurement import Measurement
from skyarm.simulate import run
from skyarm.simulate.compiled_flight import fly
from skyarm.simulate.inputs import episode_inputs
from thorough import sampled

START, RELEASE, END = 1.0, 2.0, 5.0
EFFORT, SLEW = 0.03, 3e3
"""N m, less than the shoulder's weight; rad/s^2, 15 rad/s in a period."""

TRUSTING = {"trusted_tilt": math.pi} | dict.fromkeys(
    ("trusted_rate", "trusted_joint_error", "lost_rate", "lost_speed", "lost_joint_speed"), math.inf
)
"""So that the law flies on: given up, it would begin anew and forget what it had wound up."""

MOVED = Trajectory(
    x=Ramp(start=START, duration=0.5, height=0.2), z=Constant(3.0), joints=(Constant(0.3), Constant(-0.2))
)

WITHOUT_MEMORY = {*PAPER, "ct_level_gravity", "ct_coupled_thrust", "ct_consistent"}
WITHOUT_MEMORY |= {"bulut2019", "guo2023", "li2024"}

CASES = [*((name, {}) for name in sorted(LAWS)), ("centroidal", {"mode": "tip", "adaptation": 1.0})]
CASES += [("indi", {"delay_periods": 1, "measured_speeds": False})]


OFTEN = [(name, {}) for name in ("indi", "kim2013", "l1_adaptive", "ct_observer")]
WINDING = [case for case in CASES if case in OFTEN or "adaptation" in case[1]]
"""One of each kind of memory; the first law is without, the rest in ``make thorough``."""

SEEN: list = []
"""Not in the law's closure, which a log describes."""


def squeezed(controller, slew):
    """The controller under a guard whose limits are tight for a second; its memories go to SEEN if it is called."""
    guard = with_safety_layer(controller, TRUSTING)
    SEEN.clear()

    def law(memory, measurement, reference, dt, *, par):
        now = logical_and(measurement.time >= START - 1e-6, measurement.time < RELEASE - 1e-6)
        tight = dataclasses.replace(
            par.limits,
            effort=tuple(where(now, EFFORT, effort) for effort in par.limits.effort),
            rotor_slew=where(now, slew, par.limits.rotor_slew),
        )
        found = guard.law(memory, measurement, reference, dt, par=dataclasses.replace(par, limits=tight))
        if not controller.compiled:
            SEEN.append(found[0])
        return found

    return dataclasses.replace(guard, law=law)


def at_release(scenario):
    """Memory of the guard after the last squeezed period."""
    if not scenario.controller.compiled:
        return SEEN[round(RELEASE * scenario.rates.control) - 1]
    half = dataclasses.replace(scenario, duration=RELEASE)
    return fly(half, episode_inputs(half)).carry.memory


def estimated(memory):
    """What a law has integrated, each with the most that it may be at release: some times what it is in free flight.

    The plant's rotors and joints differ from the belief by 0.14 N and 1e-4 N m. Taken for granted, the desired commands
    would make it 0.1 N m (l1), 0.075 N m (learned: a network far from its training), the adaptation's bounds (sliding
    mode).
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
        unknown = memory.estimate[-8:]
        found = [(unknown[:3], 0.2), (unknown[6:], 0.006)]
    if getattr(memory, "observed", ()):
        found = [((*memory.observed.force,), 0.2), (memory.observed.efforts, 0.006)]
    if kind == "CentroidalMemory":
        found += [
            ([v / 838.0**2 for v in memory.trim], 0.03),
            ((memory.parts.adaptation.tip_mass,), 1e-3),
            ([joint.damping for joint in memory.parts.adaptation.joints], 3e-3),
        ]
    return found


@pytest.mark.parametrize(("law", "options"), sampled(CASES, 30, keep=WINDING))
def test_a_law_whose_commands_are_changed_knows_it_winds_nothing_up_and_comes_back(law, options):
    base = skyarm.load_scenario("case1", duration=END if law != "nmpc" else 3.5)
    made = make_controller(law, base.controller.par.model, **options)
    # tracking joints, the centroidal law does not fly on rotors that are slewed and an arm that does not follow at once
    controller = squeezed(made, math.inf if (law, options) == ("centroidal", {}) else SLEW)
    scenario = dataclasses.replace(base, trajectory=MOVED, initial=None, controller=controller)
    log = run(scenario)
    memory = at_release(scenario)
    # a memory may hold programs: names of their own keep it out of what a failing test prints
    given_up, sent, kept = memory.confidence.given_up, memory.sent, getattr(memory.inner, "sent", ())
    assert given_up == 0.0
    if law in WITHOUT_MEMORY:
        assert not kept
    else:
        assert (kept if isinstance(kept, Command) else kept[-1]) == sent
    for values, most in estimated(memory.inner):
        assert np.abs(values).max() <= most
    tight = (log.time >= START) & (log.time < RELEASE)
    if law != "rotors_sim_position":  # which leaves the joints alone
        assert np.abs(log.efforts[tight]).max() == EFFORT < 1.1 * np.abs(log.efforts[~tight]).max()
        np.testing.assert_allclose(log.joints[-1], [0.3, -0.2], atol=0.03)
    assert log.status == "completed"
    # what the paper's laws do not know of rotors and gravity leaves 0.1 m
    np.testing.assert_allclose(log.position[-1], [0.2, 0.0, 3.0], atol=0.12)
    # the step of 0.2 m, and what a network far from its training adds
    assert np.abs(log.position - log.position_reference).max() < 0.4


@pytest.mark.parametrize("changed", ["rotor", "joint"])
def test_the_centroidal_law_trim_and_what_it_learns_stand_still_while_what_was_sent_is_not_what_it_wished(changed):
    scenario = skyarm.load_scenario("case1", duration=0.05)
    law = make_controller("centroidal", scenario.controller.par.model, mode="tip", adaptation=1.0)
    reading = reading_of(run(dataclasses.replace(scenario, trajectory=MOVED)))
    wanted = MOVED.at(0.0).dense()
    memory, command = law.law(law.memory, reading, wanted, 0.005, par=law.par)
    learned = dataclasses.replace(memory.parts.adaptation, tip_mass=0.01)
    memory = with_parts(memory, adaptation=learned)
    turned, pulled = list(command.rotor_speeds), list(command.efforts)
    if changed == "rotor":
        turned[2] -= 1e-9
    else:
        pulled[1] += 1e-9
    sent = Command(rotor_speeds=tuple(turned), efforts=tuple(pulled))
    free, held = (
        law.law(with_applied_command(memory, each), reading, wanted, 0.005, par=law.par)[0] for each in (command, sent)
    )
    assert free.applied == held.applied == all_applied(2)
    assert free.parts.adaptation.tip_mass != memory.parts.adaptation.tip_mass == held.parts.adaptation.tip_mass
    assert (
        free.parts.adaptation.joints[0].level
        != memory.parts.adaptation.joints[0].level
        == held.parts.adaptation.joints[0].level
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
    reading, wanted = reading_of(run(dataclasses.replace(scenario, trajectory=MOVED))), MOVED.at(0.0).dense()
    memory, _ = law.law(law.memory, reading, wanted, 0.005, par=law.par)
    for k, effort in enumerate((0.4, 0.1)):
        sent = Command(rotor_speeds=(500.0,) * 4, efforts=(effort, 0.0))
        memory, _ = law.law(with_applied_command(memory, sent), reading, wanted, 0.005, par=law.par)
        # the filter starts at the first command and follows the second at 15 rad/s
        share = 1.0 - math.exp(-15.0 * 0.005)
        assert memory.history.efforts[0] == pytest.approx(0.4 if k == 0 else 0.4 - 0.3 * share, rel=1e-12)
    rotors = law.par.model.vehicle.rotors
    assert memory.history.force.z == pytest.approx(sum(r.thrust_coefficient * 500.0**2 for r in rotors), rel=1e-12)
