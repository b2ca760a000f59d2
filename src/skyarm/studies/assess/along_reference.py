"""Feasibility along a scenario's reference: demand on rotors and joints against their
limits, with all loads.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np

from skyarm.algebra import Mat3, Vec3
from skyarm.dynamics.actuators.hover import ROUNDING
from skyarm.dynamics.actuators.motion_demand import (
    ActuatorDemand,
    demand_of_motion,
    motion_of,
)
from skyarm.records.arrays import Array, Mask, float_array, stack_values
from skyarm.records.immutable import positional
from skyarm.records.leaves import leaves, rebuild
from skyarm.scenario.endings import clearances_of
from skyarm.scenario.scenario_record import Scenario, first_state
from skyarm.simulate.check_endings import find_ending
from skyarm.studies.assess.arm_poses import Allocation, ArmPoses
from skyarm.studies.assess.finding import (
    FAULT,
    LEVELS,
    OK,
    WARNING,
    Concern,
    Finding,
    at_least,
    at_most,
)
from skyarm.studies.assess.flight_loads import (
    FlightPart,
    Load,
    flight_parts,
    reference_at,
)
from skyarm.studies.assess.joints import OFTEN, effort_limits, servo_speeds, servos
from skyarm.studies.assess.thrust import thrust_margin

CLEARANCES = {"clearance from surfaces": True, "clearance of the arm": False}
"""Questions about distances of the vehicle's bodies -> whether from surfaces, or from
each other."""

INSTANTS, FEWEST = 2000, 9
"""Number of instants of a flight, and least number between two jumps of the
reference."""

SHORTEST = 1e-3
"""Shortest interval (s) between two jumps of the reference that is examined."""

FINE = 1e-3
"""Time (s) between two instants of a plan, as the planner looks at its clearance."""

AROUND, BLOW = 1e-6, 0.5
"""Time (s) before and after a step of the reference; step of its speed (m/s) that is
warned of. Of 40 drawn vehicles that can fly, two err by 3 and 14 m after steps of 0.92
and 1.26 m/s from rest, and simpler laws fall."""

POSES_HELD = 100
"""Number of poses of the reference, while a load is held, whose static hover is
examined."""


@positional
class Followed:
    """Rotor speeds and joint torques of a flight with exact tracking of its reference,
    as fractions of their limits.

    Attributes:
        demand: demand of rotors and joints. rotors, joints: shares (rotors or n, K) of
            their limits.
        position: (3, K) of the base, m, world axes.
        seconds: (K,) time that each instant stands for, s: instants of a short interval
            stand for less.
    """

    demand: ActuatorDemand
    rotors: Array
    joints: Array
    position: Array
    seconds: Array

    def share(self, at: Mask) -> float:
        """Fraction of the flight's time in which a condition (K,) is true."""
        return float(np.average(at, weights=self.seconds))


def along_reference(
    scenario: Scenario, *, clearance: bool = False, carried: Sequence[Load] = ()
) -> list[Finding]:
    """Check the reference against joint limits, and find when rotors or joints would
    saturate.

    The plant follows its reference exactly, with the loads that it holds, in still air;
    what the control adds is left out. A reference that is a plan says itself how its
    base turns and what it asks of rotors and joints; other references follow by
    differential flatness.

    Args:
        scenario: scenario of one vehicle.
        clearance: whether distances of its bodies from surfaces and from each other are
            found, too.
        carried: its shares of bodies that several vehicles carry.
    """
    parts = flight_parts(scenario, carried)
    followed = follow(parts)
    demand, vehicle = followed.demand, scenario.agent.vehicle
    findings = _joint_limits(scenario, demand)
    rotors = [f"rotors[{rotor.name}].max_speed" for rotor in vehicle.rotors]
    # rounding of a rotor that idles is no reversed thrust
    pulls = demand.squared < -ROUNDING * np.max(demand.squared, axis=0)
    findings.append(
        _saturation(
            "rotors along the reference", followed, followed.rotors, rotors, pulls
        )
    )
    if vehicle.n:
        joints = [f"joints[{joint.name}].effort_limit" for joint in vehicle.joints]
        findings.append(
            _saturation("joints along the reference", followed, followed.joints, joints)
        )
        findings += servo_speeds(scenario, demand.time, demand.rates, followed.share)
    findings += _speed_steps(scenario)
    if clearance:
        findings += _clearance(scenario, followed)
    return [
        *findings,
        *_planned_force(scenario),
        # shares of a carried body are checked with its grasps, by load_of
        *_hovers_with_loads(flight_parts(scenario) if carried else parts),
    ]


def follow(parts: Sequence[FlightPart]) -> Followed:
    """Rotor speeds and joint efforts for exact tracking of a scenario's reference, as
    fractions of their limits.
    """
    # a demand that is no number becomes a fault, not a warning
    with np.errstate(over="ignore", invalid="ignore"):
        pieces = [
            _stretch(part, time)
            for part in parts
            for time in _sample_times(part, parts[-1].stop)
        ]
    # the last axis of each array is that of the instants
    columns = zip(*map(leaves, pieces), strict=True)
    joined = (np.concatenate(each, axis=-1) for each in columns)
    return rebuild(pieces[0], joined)


def _clearance(scenario: Scenario, followed: Followed) -> list[Finding]:
    """Smallest distances of the vehicle's bodies, from surfaces and from each other."""
    planned = scenario.agent.reference.planned
    demand = followed.demand
    findings = []
    # the arm of a plan without contact keeps off as the other bodies do
    every = clearances_of(
        scenario, touching=planned is None or bool(np.any(np.array(planned.force)))
    )
    position = Vec3(*followed.position)
    rotation = Mat3(*(Vec3(*row) for row in demand.rotation))
    joints = tuple(demand.joints)
    for question, surfaces in CLEARANCES.items():
        some = replace(
            every,
            pairs=tuple(
                each for each in every.pairs if (each.surface is not None) == surfaces
            ),
        )
        if not some.pairs:
            continue
        distances = some.distances(position, rotation, joints, time=demand.time)
        rows = stack_values(len(demand.time), distances)
        i, k = np.unravel_index(int(np.argmin(rows)), rows.shape)
        often = followed.share(np.any(rows < 0.0, axis=0))
        text = f"{some.names[i]} are {rows[i, k]:.3g} m apart at {demand.time[k]:.3g} s"
        text += f", with an overlap for {often:.1%} of the flight" if often else ""
        remedy = "a path farther from it, or another arm pose"
        findings.append(
            at_least(
                question,
                float(rows[i, k]),
                text,
                "reference",
                remedy,
                warning=0.0,
                unit="m",
                concerns=Concern.CLEARANCE,
            )
        )
    return findings


def _speed_steps(scenario: Scenario) -> list[Finding]:
    """Alarm of a reference whose velocity steps, which for the vehicle is as a blow.

    At the start of tracking the step is from the velocity of the vehicle: its initial
    one, or rest.
    """
    # before a later start of tracking the vehicle hovers: its initial velocity is gone
    start = float(scenario.agent.tracking_start)
    initial = scenario.agent.initial
    times = np.array(
        [start, *(t for t in _jump_times(scenario) if start < t < scenario.duration)]
    )
    # nothing is planned before the start
    before, after = (
        stack_values(
            len(times), reference_at(scenario, np.maximum(times + side, 0.0)).velocity
        )
        for side in (-AROUND, AROUND)
    )
    before[:, 0] = 0.0 if initial is None or start else float_array(initial.velocity)
    steps = np.linalg.norm(after - before, axis=0)
    # a vehicle that is to brake at first is meant to
    steps[0] = min(steps[0], np.linalg.norm(after[:, 0]))
    k = int(np.argmax(steps))
    if not steps[k] > BLOW:
        return []
    text = (
        f"the velocity steps by {steps[k]:.3g} m/s at {times[k]:.3g} s, which for the"
        " vehicle is a blow"
    )
    remedy = (
        "a motion that begins at rest (as quintic ramps do), or an [initial] velocity"
    )
    return [
        at_most(
            "steps of the reference",
            float(steps[k]),
            text,
            "reference.base",
            remedy,
            warning=BLOW,
            unit="m/s",
        )
    ]


def met_at_start(scenario: Scenario) -> list[Finding]:
    """Fault of a start at which a termination condition holds, so that a flight ends at
    0 s; what sees pictures is left out.
    """
    blind = replace(
        scenario, endings=tuple(each for each in scenario.endings if not each.sees)
    )
    goal = scenario.agent.reference.at(0.0).position
    ended = find_ending(blind, 0.0, leaves(first_state(scenario)), [*goal])
    if ended is None:
        return []
    text = f"ending '{ended.status}' holds at 0 s: {ended.cause}"
    remedy = (
        "a reference.base that begins elsewhere (left out, it is the origin), or an"
        " [initial] state"
    )
    field = "reference" if scenario.agent.initial is None else "initial"
    return [Finding("start of the flight", FAULT, text, field, remedy)]


def _planned_force(scenario: Scenario) -> list[Finding]:
    """Alarm of a plan that counts on a contact of the tip in a world without any: a
    fault where it hangs from it.
    """
    planned = scenario.agent.reference.planned
    if planned is None or scenario.world is not None:
        return []
    force = np.linalg.norm(np.array(planned.force), axis=0)
    if not force.any():
        return []
    k = int(force.argmax())
    text = (
        f"the plan counts on {force[k]:.3g} N on the tip at {planned.times[k]:.3g} s;"
        " the world has no surface"
    )
    weight = float(scenario.agent.vehicle.mass * scenario.agent.plant.gravity)
    return [
        at_most(
            "contact along the reference",
            float(force[k]),
            text,
            "world.surfaces",
            "what the tip touches in the plan",
            warning=0.0,
            fault=weight,
            unit="N",
            concerns=Concern.CONTACT,
        )
    ]


def _hovers_with_loads(parts: Sequence[FlightPart]) -> list[Finding]:
    """Check the thrust margin in level hover with each payload, in the arm poses
    commanded while it is carried.

    Of several loads each question is answered for the worst, of equal ones for the
    heaviest.
    """
    answers: dict[str, list[Finding]] = {}
    loaded = [part for part in parts if part.words]
    # max takes the first of equals, so that of equal levels the heaviest load is named
    for part in sorted(loaded, key=lambda each: -float(each.vehicle.mass)):
        reference = reference_at(
            part.scenario,
            np.linspace(part.start, part.stop, POSES_HELD, endpoint=False),
        )
        joints = stack_values(POSES_HELD, reference.joints).T
        gravity = float(part.scenario.agent.plant.gravity)
        poses = ArmPoses.only(part.vehicle, joints, gravity, part.words)
        for each in thrust_margin(poses):
            answers.setdefault(each.question.removesuffix(part.words), []).append(each)
    return [
        max(each, key=lambda finding: LEVELS.index(finding.level))
        for each in answers.values()
    ]


def _sample_times(part: FlightPart, end: float) -> list[Array]:
    """Sample times (K,) of each interval between two jumps of the reference, s.

    Args:
        part: part of a flight.
        end: end of the flight, s.
    """
    cuts = [
        part.start,
        *(t for t in _jump_times(part.scenario) if part.start < t < part.stop),
        part.stop,
    ]
    every = max(INSTANTS, end / FINE if part.scenario.agent.reference.planned else 0)
    intervals = []
    for a, b in pairwise(cuts):
        # a flight that is itself so short keeps its only interval
        if b - a < SHORTEST and end > SHORTEST:
            continue  # no rates can be had of it
        count = max(FEWEST, round(every * (b - a) / end))
        # midpoints: no instant lies on a jump of the reference
        intervals.append(a + (b - a) * (np.arange(count) + 0.5) / count)
    return intervals


def _jump_times(scenario: Scenario) -> list[float]:
    """Times (s) at which the reference may jump, in order."""
    path = scenario.agent.path_time
    times = scenario.agent.reference.switch_times()
    return (
        list(times) if path is None else [path.instant_of(t) for t in times if t > 0.0]
    )


def _stretch(part: FlightPart, time: Array) -> Followed:
    vehicle, scenario = part.vehicle, part.scenario
    reference = reference_at(scenario, time)
    motion = motion_of(reference, time)
    asked = partial(
        demand_of_motion, gravity=float(scenario.agent.plant.gravity), motion=motion
    )
    planned = scenario.agent.reference.planned
    if planned is None or not planned.attitude:
        demand = asked(vehicle)
    else:
        rotation, speeds, efforts = planned.actuation_at(time)
        demand = asked(vehicle, rotation=rotation)
        # what the plan states is of the law's model: loads come on top
        bare = asked(scenario.agent.model.vehicle, rotation=rotation)
        efforts = (
            efforts + demand.efforts - bare.efforts if len(efforts) else demand.efforts
        )
        demand = replace(
            demand, squared=speeds**2 + demand.squared - bare.squared, efforts=efforts
        )
    top = Allocation.of(vehicle).highest[:, None]
    # of joints and servos, at the joint rates of the reference
    limits = demand.effort_limits(
        effort_limits(scenario.agent.vehicle)[:, None], servos(scenario)
    )
    return Followed(
        demand,
        rotors=demand.squared / top,
        joints=np.abs(demand.efforts) / limits,
        position=stack_values(len(time), reference.position),
        # midpoints of one interval are equally far apart
        seconds=np.full(len(time), time[1] - time[0]),
    )


def _joint_limits(scenario: Scenario, demand: ActuatorDemand) -> list[Finding]:
    findings = []
    for i, joint in enumerate(scenario.agent.vehicle.joints):
        q = demand.joints[i]
        low, high = joint.ends
        beyond = (q < low) | (q > high)
        if np.any(beyond):
            t = float(demand.time[np.argmax(beyond)])
            worst = float(q[np.argmax(np.maximum(low - q, q - high))])
            findings.append(
                Finding(
                    "reference within joint limits",
                    FAULT,
                    f"joints[{joint.name}] is to reach {worst:.3g}, beyond {low:g} ..."
                    f" {high:g}, first at {t:.3g} s",
                    f"reference.joints[{i}]",
                    "a smaller motion, or joint limits as they are (rad, not degrees?)",
                    worst,
                    high if worst > high else low,
                    concerns=Concern.JOINT_LIMITS,
                )
            )
    return findings


def _saturation(
    question: str,
    followed: Followed,
    share: Array,
    fields: list[str],
    reversed_: Mask | None = None,
) -> Finding:
    """Check result for all rotors or all joints: which saturates first, when, and for
    what share of the flight.
    """
    time, within = followed.demand.time, share <= 1.0  # false for what is no number
    outside = ~within if reversed_ is None else ~within | reversed_
    at_any = np.any(outside, axis=0)
    often = followed.share(at_any)
    # the first that is no number, if any
    i, k = np.unravel_index(int(np.argmax(share)), share.shape)
    field = fields[int(i)]
    finite = bool(np.isfinite(share[i, k]))
    most = (
        f"at most {share[i, k]:.3g} of the limit"
        if finite
        else "a demand that is no finite number"
    )
    text = f"{most} ({field.rpartition('.')[0]}, at {time[k]:.3g} s)"
    if not often:
        return Finding(question, OK, text, field, value=float(share[i, k]), limit=1.0)
    first = int(np.argmax(at_any))
    field = fields[int(np.argmax(outside[:, first]))]
    lowest = (
        ""
        if reversed_ is None or not reversed_[:, first].any()
        else " at its lowest thrust"
    )
    text = (
        f"saturates first{lowest} at {time[first]:.3g} s ({field.rpartition('.')[0]}),"
        f" for {often:.1%} of the flight; {text}"
    )
    return Finding(
        question,
        FAULT if often > OFTEN or not finite else WARNING,
        text,
        field,
        "a slower or smaller reference, less load, or stronger rotors and drives",
        float(share[i, k]),
        1.0,
        concerns=(
            Concern.JOINTS_IN_FLIGHT if reversed_ is None else Concern.ROTORS_IN_FLIGHT
        ),
    )
