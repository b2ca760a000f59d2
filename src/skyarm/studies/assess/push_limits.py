"""Checks of a contact force that the reference commands: law, joint torques, yaw
torque, error of its estimate.
"""

from __future__ import annotations

import math

import numpy as np

from skyarm.algebra import Mat3, Vec3
from skyarm.control.blocks.tip_force import effort_shares, levers
from skyarm.control.blocks.torque_scale import Tolerances
from skyarm.control.controller import part_of, presses
from skyarm.dynamics.kinematics import frame_pose, jacobian_columns
from skyarm.records.arrays import Array, doubles, float_array, norm
from skyarm.reference.trajectory import Reference
from skyarm.scenario.scenario_record import Scenario
from skyarm.studies.assess.arm_poses import WRENCH, Allocation, hover_efforts
from skyarm.studies.assess.finding import NOTE, WARNING, Finding, at_most
from skyarm.studies.assess.joints import effort_limits

FORCE = "reference.push.force"
"""Field to which the findings about the pressing force belong."""

INSTANTS = 500
"""Number of instants of the flight at which force and pose are evaluated."""

ASSUMED = Tolerances(torques=0.1, masses=0.0)
"""Tolerances of a law that states none."""

WARNS, HALF = 0.8, 0.5
"""Fractions of a joint's limit and of the yaw torque that leave little for friction and
for a tilted base, chosen.

In the shipped tasks a base tilted by 10 degrees takes up to 1.2 times the torque of a
level one, which 0.8 leaves room for; friction of 0.5 upwards or down 1.4 to 1.9 times
(measured)."""


LEVEL = 0.3
"""Largest vertical component of a direction that counts as horizontal."""


def push_limits(scenario: Scenario) -> list[Finding]:
    """Check results for the commanded contact force against joint and rotor limits;
    empty without such a force.

    The base is taken as level; friction along the surface is left out at the joints,
    and at the rotors it is that of the roughest surface, in the direction along the
    surface in which it turns the vehicle most.
    """
    at = largest_push(scenario)
    if at is None:
        return []
    findings = [
        *_law(scenario),
        *_joints(scenario, at),
        *_yaw(scenario, at),
        *_error(scenario, at),
    ]
    return [*findings, *_guards(scenario, float(at.push[1]))]


def largest_push(scenario: Scenario) -> Reference | None:
    """Reference at the instant of its largest contact force; None if it commands none,
    or the vehicle has no arm.
    """
    vehicle, push = scenario.agent.vehicle, scenario.agent.reference.push
    if push is None or not vehicle.n or not vehicle.end_effector:
        return None
    # the flight ends before its last instant, which belongs to no period
    times = np.linspace(0.0, scenario.duration, INSTANTS, endpoint=False)
    # a constant force is one number for all instants
    forces = np.broadcast_to(
        doubles(scenario.agent.reference.at(times).push[0]), times.shape
    )
    k = int(np.argmax(forces))
    return scenario.agent.reference.at(float(times[k])) if forces[k] > 0.0 else None


def _law(scenario: Scenario) -> list[Finding]:
    if presses(scenario.agent.controller.par):
        return []
    text = (
        f"law {scenario.agent.controller.name} has no force control: it ignores"
        " reference.push and tracks positions"
    )
    remedy = 'law = "centroidal" with mode = "tip" and interaction'
    return [Finding("pressing", WARNING, text, "controller", remedy)]


def push_on_level_base(at: Reference) -> Array:
    """Contact force (N) of the surface on the tip, in the axes of a level base."""
    force, _, *normal = map(float, at.push[:5])
    # into the axes of the base: by the yaw, backwards
    return force * float_array(Vec3(*normal).about_z(-float(at.yaw)))


def pushing_efforts(
    scenario: Scenario, joints: tuple[float, ...], force: Array
) -> Array:
    """Static joint efforts (N m or N) of a level base's arm against a force on its tip.

    Args:
        scenario: vehicle and gravity.
        joints: rad or m.
        force: on the tip, N, axes of the base.
    """
    vehicle = scenario.agent.vehicle
    still = hover_efforts(
        vehicle, float(scenario.agent.plant.gravity), np.array([joints])
    )[WRENCH:, 0]
    columns = np.array(
        [
            float_array(each.linear)
            for each in jacobian_columns(vehicle, vehicle.frame(), joints)
        ]
    )
    return still - columns @ force


def yaw_room(scenario: Scenario, joints: tuple[float, ...]) -> float:
    """Yaw torque reserve of the rotors in level hover, N m: the smaller of both
    senses.
    """
    vehicle = scenario.agent.vehicle
    allocation = Allocation.of(vehicle)
    hover = allocation.squared_speeds(
        hover_efforts(vehicle, float(scenario.agent.plant.gravity), np.array([joints]))
    )
    return min(
        float(allocation.room(hover, sign * np.eye(WRENCH)[2])[0])
        for sign in (1.0, -1.0)
    )


def yaw_torques(
    scenario: Scenario, joints: tuple[float, ...], push: Array
) -> tuple[float, float]:
    """Yaw torques (N m) of a push on the tip, and of tangential friction with
    coefficient 1 in the worst direction.

    A force f at r turns about z by f.(z x r).
    """
    vehicle = scenario.agent.vehicle
    tip = frame_pose(vehicle, vehicle.frame(), joints).p
    lever = np.array([-float(tip.y), float(tip.x), 0.0])
    return float(abs(lever @ push)), norm(np.cross(push, lever))


def _joints(scenario: Scenario, at: Reference) -> list[Finding]:
    vehicle = scenario.agent.vehicle
    joints = tuple(map(float, at.joints))
    efforts = pushing_efforts(scenario, joints, push_on_level_base(at))
    limits = effort_limits(vehicle)
    shares = np.abs(efforts) / limits
    i = int(np.argmax(shares))
    share = float(shares[i])
    joint = vehicle.joints[i]
    text = (
        f"{float(at.push[0]):.3g} N take {abs(efforts[i]):.3g} of {limits[i]:.3g}"
        f" {joint.units[1]} at joint {joint.name}"
    )
    remedy = "less force, or a pose with the tip nearer to the joint's height"
    return [
        at_most(
            "joints while pressing",
            share,
            text,
            FORCE,
            remedy,
            fault=1.0,
            warning=WARNS,
            limit=1.0,
            joints=joints,
        )
    ]


def _yaw(scenario: Scenario, at: Reference) -> list[Finding]:
    frictions = [
        float(s.material.friction) for world in scenario.worlds for s in world.surfaces
    ]
    joints = tuple(map(float, at.joints))
    if not frictions:
        return []
    room = yaw_room(scenario, joints)
    pushing, sliding = yaw_torques(scenario, joints, push_on_level_base(at))
    torque = pushing + max(frictions) * sliding
    text = (
        f"pushing and sliding take {torque:.3g} of {room:.3g} N m of yaw torque at"
        f" friction {max(frictions):g}"
    )
    remedy = (
        "slide across the lever as little as can be, less force, a shorter reach, or"
        " stronger yaw"
    )
    warning = HALF * room
    return [
        at_most(
            "yaw while pressing",
            torque,
            text,
            FORCE,
            remedy,
            warning=warning,
            unit="N m",
            joints=joints,
        )
    ]


def _guards(scenario: Scenario, speed: float) -> list[Finding]:
    """Warnings for guards (contact conditions) of a reference whose horizontal force
    would push an object too fast.
    """
    findings = []
    surfaces = [surface for world in scenario.worlds for surface in world.surfaces]
    objects = [thing for world in scenario.worlds for thing in world.objects]
    standing = [thing for thing in objects if thing.standing]
    friction = max(
        (float(surface.material.friction) for surface in surfaces), default=0.0
    )
    for i, guard in enumerate(scenario.agent.reference.guards):
        tip = scenario.agent.reference.at(float(guard.at)).tip
        n = np.array(guard.direction)
        if guard.force is None or not tip or abs(n[2]) > LEVEL:
            continue
        for thing in standing:
            away = np.array(tip) - doubles([*thing.position])
            # the worst case: the whole force acts all the time that it must hold
            bears = friction * float(thing.mass) * float(scenario.agent.plant.gravity)
            driven = (
                (float(guard.force) - bears) / float(thing.mass) * float(guard.hold)
            )
            # the tip pushes towards its middle, give or take half of its longest side
            ahead = n @ away > 0.0 and norm(np.cross(n, away)) < 0.5 * max(thing.size)
            if ahead and driven > speed:
                text = (
                    f"object {thing.name} slides away from {bears:.2g} N:"
                    f" {guard.force:g} N for {guard.hold:g} s would drive it at"
                    f" {driven:.2g} m/s, above the {speed:g} m/s of the approach"
                )
                remedy = (
                    "until.force below that, a shorter hold, until.distance in its"
                    " place, or more speed"
                )
                findings.append(
                    Finding(
                        "force of a guard",
                        WARNING,
                        text,
                        f"reference.guards.{i}.force",
                        remedy,
                    )
                )
    return findings


def _error(scenario: Scenario, at: Reference) -> list[Finding]:
    part = part_of(scenario.agent.controller.par, "interaction")
    if part is None or part.sensing is not None:
        return []
    common, deviation = push_errors(
        scenario, at, ASSUMED if part.tolerances is None else part.tolerances
    )
    text = (
        f"joint torques all {100.0 * ASSUMED.torques:.2g} % off change it by"
        f" {common:.2g} of {float(at.push[0]):.3g} N"
    )
    if part.tolerances is not None:
        text = (
            f"standard error {deviation:.2g} of {float(at.push[0]):.3g} N by the"
            " tolerances, before any is learned"
        )
    remedy = (
        "controller.tolerances lets the law learn the scale; a force sensor needs none"
    )
    return [
        Finding(
            "force without a sensor",
            NOTE,
            text,
            FORCE,
            remedy,
            deviation,
            math.nan,
            "N",
            at.joints,
        )
    ]


def push_errors(
    scenario: Scenario, at: Reference, by: Tolerances
) -> tuple[float, float]:
    """Errors (N) of a contact force estimated from joint torques: due to a common
    torque scale, and standard error.

    Args:
        scenario: vehicle, gravity and law.
        at: reference while it pushes; the base is taken as level.
        by: standard deviations of scales, independent from joint to joint, and of
            weights.
    """
    vehicle = scenario.agent.vehicle
    joints = tuple(map(float, at.joints))
    push = push_on_level_base(at)
    errors = part_of(scenario.agent.controller.par, "interaction").errors
    place = levers(vehicle, Mat3.identity(), joints)
    shares = np.array(
        effort_shares(errors, place, Vec3(*(push / norm(push)))), dtype=float
    )
    # efforts with the push, and of the weights alone
    loads, weights = (
        shares * pushing_efforts(scenario, joints, force)
        for force in (push, 0.0 * push)
    )
    # independent errors add as squares; a common scale adds the efforts with their
    # signs
    independent = math.hypot(by.torques * norm(loads), by.masses * norm(weights))
    return float(abs(by.torques * loads.sum())), independent
