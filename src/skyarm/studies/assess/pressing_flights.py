"""Check of a commanded contact force by simulated flights: the largest force that is
held, and what limits it.

Statics say what joints and rotors bear (:mod:`skyarm.studies.assess.push_limits`), not
whether the loop presses: the recoil of the base may stretch the arm, and a tip of much
inertia bounces. The scenario is therefore flown with shares of its force, each with
several noises, in one batch.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection

import numpy as np

from skyarm.algebra import Mat3
from skyarm.compile.machine_code import NoMachineCodeError
from skyarm.control.controller import ControllerError, part_of, presses
from skyarm.dynamics import mass_matrix
from skyarm.dynamics.kinematics import frame_pose, jacobian_columns, link_poses
from skyarm.log.flight_log import Log
from skyarm.log.metrics.score import score
from skyarm.plant.largest_step import divisions
from skyarm.records.arrays import Array, doubles, float_array, norm
from skyarm.reference.trajectory import Reference
from skyarm.scenario.endings import RotorContact
from skyarm.scenario.numbers import number_at
from skyarm.scenario.scenario_record import Scenario, ScenarioError
from skyarm.studies.assess.finding import FAULT, NOTE, OK, Finding
from skyarm.studies.assess.push_limits import (
    FORCE,
    HALF,
    largest_push,
    push_on_level_base,
    yaw_room,
    yaw_torques,
)
from skyarm.studies.flights import Work
from skyarm.studies.flights.fly import fly
from skyarm.vehicle import BASE, Vehicle

QUESTION, STEPS = "force in flight", "steps of the contact"

SHARES, NOISES = (0.25, 0.5, 0.75, 1.0), 8
"""Fractions of the commanded force, and number of noise seeds of each."""

ALLOWED = 0.05
"""Largest mean force error over a flight, as a fraction of the commanded force:
chosen."""

LIMITED = 0.05
"""Fraction of the periods with a rotor at its limit that a force may take: of 16
flights of 30 s of an octocopter none was lost with 0.02, one with 0.05, three with
0.13; others have below 0.001 at half of what their joints bear."""

SLUGGISH = 5.0
"""Acceleration (m/s^2) of the tip by the force below which a bounce takes tenths of a
second."""

PRESS = "press"
"""Kind of the phases of a task that begin a contact."""

VALUE = "reference.push.force.value"


def pressing_flights(scenario: Scenario) -> list[Finding]:
    """Check result for a constant contact force in simulated flights; empty without one
    or without force control.
    """
    at = _constant_push(scenario)
    if at is None:
        return []
    force = float(at.push[0])
    unresolved = contact_steps(scenario, at)
    if unresolved:
        return unresolved
    try:
        mean, status, limited = fly_shares(scenario, force)
    except (ScenarioError, ControllerError, NoMachineCodeError) as error:
        return [Finding(QUESTION, NOTE, f"not known: {error}")]
    ended = status != "completed"
    off = np.abs(mean) / (np.array(SHARES)[:, None] * force)
    whole = off[-1][~ended[-1]]
    if not ended[-1].any() and not np.isfinite(whole).any():
        return [
            Finding(
                QUESTION,
                NOTE,
                f"not known: {force:.3g} N meet nothing, or for too short a time",
            )
        ]
    # a flight without values fails by its error, and counts as free of limits
    strained = np.nan_to_num(limited).mean(axis=1)
    fails = (
        ended.any(axis=1)
        | (np.nan_to_num(off, nan=np.inf).mean(axis=1) > ALLOWED)
        | (strained > LIMITED)
    )
    worst = float(np.nanmean(whole)) if np.isfinite(whole).any() else math.inf
    said = f"{force:.3g} N are held in no flight of {NOISES}"
    if math.isfinite(worst):
        said = (
            f"{force:.3g} N are {100.0 * worst:.2g} % off in flights with {NOISES}"
            " noises"
        )
    said += f", of which {int(ended[-1].sum())} end early" if ended[-1].any() else ""
    said += (
        f", with a rotor at its limit {100.0 * strained[-1]:.2g} % of the time"
        if strained[-1] > LIMITED
        else ""
    )
    if not fails[-1]:
        return [
            Finding(QUESTION, OK, said, FORCE, "", 100.0 * worst, 100.0 * ALLOWED, "%")
        ]
    achieved = [
        share * force
        for share, failing in zip(SHARES, fails, strict=True)
        if not failing
    ]
    cause, remedy = cause_of(scenario, at, set(status[-1]))
    said = f"{said}: {cause}; " + (
        f"{max(achieved):.3g} N are held" if achieved else "nor is a quarter of it"
    )
    return [
        Finding(
            QUESTION,
            FAULT,
            said,
            FORCE,
            remedy,
            100.0 * worst,
            100.0 * ALLOWED,
            "%",
            at.joints,
        )
    ]


def lost_force(scenario: Scenario, log: Log) -> list[str]:
    """Warning that a flight did not hold its constant contact force, with the likeliest
    cause; empty if it did.
    """
    at = _constant_push(scenario)
    if at is None:
        return []
    force = float(at.push[0])
    error, limited = score(log, ("contact_error_mean", "rotor_saturation")).values()
    off = abs(error) / force
    if log.status == "completed" and not (off > ALLOWED or limited > LIMITED):
        return []
    cause, remedy = cause_of(scenario, at, {log.status})
    share = f"{100.0 * off:.2g} % off" if math.isfinite(off) else "not held"
    return [
        f"{FORCE}: {force:.3g} N are {share}, with a rotor at its limit"
        f" {100.0 * limited:.2g} % of the time: {cause}; {remedy}"
    ]


def missed_contact(scenario: Scenario, log: Log) -> list[str]:
    """Warning that a completed flight was to press and touched nothing, for each press
    phase; empty if it touched.
    """
    if log.status != "completed" or largest_push(scenario) is None:
        return []
    touches = [
        (each.start, math.inf if each.end is None else each.end)
        for each in log.contact_periods
    ]
    remedy = (
        "the tip missed the surface: check world.surfaces, the path of the tip and the"
        " normal"
    )
    ends = log.phase_ends
    if not ends:
        return (
            []
            if touches
            else [f"{FORCE}: the flight ended without any contact; {remedy}"]
        )
    lines = list[str]()
    begin = 0.0
    for number, (kind, end) in enumerate(ends):
        stop = float(log.time[-1]) if end is None else end
        if kind == PRESS and not any(
            start < stop and begin < last for start, last in touches
        ):
            lines.append(
                f"reference: phase {number} '{kind}': ended at {stop:.3g} s without any"
                f" contact; {remedy}"
            )
        begin = stop
    return lines


def _constant_push(scenario: Scenario) -> Reference | None:
    """Reference at the largest contact force, if constant and commanded to a law with
    force control; otherwise None.
    """
    if not scenario.worlds or not presses(scenario.agent.controller.par):
        return None
    # only a constant force is a number that flights of one batch can differ in
    try:
        number_at(scenario, VALUE)
    except ScenarioError:
        return None
    return largest_push(scenario)


def contact_steps(scenario: Scenario, at: Reference) -> list[Finding]:
    """Fault if the integration steps of the contact are too long for the inertia of the
    arm tip; otherwise empty.

    Stoermer-Verlet steps h are stable up to h sqrt(k / m) = 2; Hairer, Lubich, Wanner
    2003.
    """
    (contact,) = scenario.worlds
    vehicle = scenario.agent.vehicle
    period = scenario.rates.period
    joints = tuple(map(float, at.joints))
    push = push_on_level_base(at)
    mass = tip_mass(vehicle, joints, push / norm(push))
    step = float(contact.largest_verlet_step or 0.0)
    hardest = max(
        (float(each.material.stiffness) for each in contact.surfaces), default=0.0
    )
    phase = (
        period / divisions(period, step) * math.sqrt(hardest / mass) if step else 0.0
    )
    if phase < 2.0:
        return []
    text = (
        f"the tip, {1e3 * mass:.2g} g along the normal, is too light for the steps of a"
        f" contact of {hardest:.3g} N/m"
    )
    # phase goes with the root of the stiffness: this one gives a phase of 1, half of
    # the limit
    remedy = f"material.stiffness of at most {hardest / phase**2:.2g} N/m"
    return [
        Finding(STEPS, FAULT, text, "world.surfaces", remedy, phase, 2.0, "", at.joints)
    ]


def fly_shares(scenario: Scenario, force: float) -> tuple[Array, Array, Array]:
    """Force error (N), status and fraction of saturated periods of flights at several
    force levels and seeds.

    Args:
        scenario: a constant force, no changes of it in flight.
        force: N, commanded.

    Raises:
        ScenarioError: a force that is no constant, or a plant that no batch flies: one
            line.
    """
    rows = fly(
        Work(
            label=QUESTION,
            scenario=scenario,
            columns={VALUE: np.repeat(np.array(SHARES) * force, NOISES)},
            episodes=np.tile(np.arange(NOISES), len(SHARES)),
            metrics=("contact", "rotor_saturation"),
            seed=scenario.seed,
            # the code flies one batch of one check: it is made four times as fast,
            # chosen
            effort=0,
        )
    )
    shape = (len(SHARES), NOISES)
    error, status, limited = (
        rows[name].reshape(shape)
        for name in ("contact_error_mean", "status", "rotor_saturation")
    )
    return error, status, limited


def cause_of(
    scenario: Scenario, at: Reference, statuses: Collection[str] = ()
) -> tuple[str, str]:
    """Likeliest cause of a force that is not held, and a remedy: a rotor, yaw torque,
    reach, inertia of the tip.

    Args:
        scenario: with a contact force.
        at: reference at the largest force.
        statuses: how flights with this force ended.
    """
    vehicle = scenario.agent.vehicle
    joints = tuple(map(float, at.joints))
    push = push_on_level_base(at)
    force = float(at.push[0])
    # what a flight has shown comes before what statics suggest; the first cause that
    # holds is named
    if RotorContact.status in statuses:
        return (
            "a rotor touches a surface",
            "a pose with the tip further ahead of the rotors, or a longer arm",
        )
    room = yaw_room(scenario, joints)
    turning, _ = yaw_torques(scenario, joints, push)
    if turning > HALF * room:
        text = (
            f"the push beside the middle takes {turning:.3g} of {room:.3g} N m of yaw"
            " torque"
        )
        return text, "a pose with the tip ahead of the middle"
    left, recoil = reach_left(vehicle, joints), base_recoil(scenario, force)
    # half of what the arm has left, chosen
    if recoil > 0.5 * left:
        text = (
            f"the base recoils by about {1e3 * recoil:.2g} mm, and the arm is"
            f" {1e3 * left:.2g} mm from its full length"
        )
        return text, "a pose with the arm more bent, or less force"
    mass = tip_mass(vehicle, joints, push / force)
    if force < SLUGGISH * mass:
        text = f"the tip weighs {mass:.2g} kg along the normal and bounces"
        return (
            text,
            "more force, a slower approach, or a pose in which gears move the tip less",
        )
    return (
        "no single cause in statics",
        "less force, another pose; skyarm plot --kind contact shows the force",
    )


def base_recoil(scenario: Scenario, force: float) -> float:
    """Distance (m) by which a rising contact force pushes back the base before the base
    tilts against the force.
    """
    rise = float(part_of(scenario.agent.controller.par, "interaction").rise)
    # way of a mass under a constant force over the time of the rise
    return 0.5 * rise * rise * force / float(scenario.agent.vehicle.mass)


def reach_left(vehicle: Vehicle, joints: tuple[float, ...]) -> float:
    """Distance (m) by which an arm can still extend: its full length less the distance
    from first joint to tip.

    Infinite for an arm of one link, which no force stretches.
    """
    poses = link_poses(vehicle, joints)
    index = vehicle.frame().link
    places = [frame_pose(vehicle, vehicle.frame(), joints).p]
    while index != BASE:
        places.append(poses[index].p)
        index = vehicle.moving[index].parent
    lengths = [float((b - a).norm()) for a, b in itertools.pairwise(places)]
    if len(lengths) < 2:
        return math.inf
    return sum(lengths) - float((places[-1] - places[0]).norm())


def tip_mass(vehicle: Vehicle, joints: tuple[float, ...], normal: Array) -> float:
    """Inertia of the tip along a direction, kg: 1 / (n J M^-1 J^T n) of the free
    vehicle.

    Source: Khatib 1987, operational space.
    """
    M = doubles(mass_matrix(vehicle, Mat3.identity(), joints))
    tip = float_array(frame_pose(vehicle, vehicle.frame(), joints).p)
    arm = [
        normal @ float_array(each.linear)
        for each in jacobian_columns(vehicle, vehicle.frame(), joints)
    ]
    # speed of the tip along the normal by base velocity, base rate and joint rates
    row = np.array([*normal, *np.cross(tip, normal), *arm])
    return float(1.0 / (row @ np.linalg.solve(M, row)))
