"""Limits of a commanded push: a law that presses, joint and yaw torques, servos and the tip's mass."""

from __future__ import annotations

import math

import numpy as np

from skyarm.control.actuator_layer import ActuatorMemory, believed_drives, effort_at_rest
from skyarm.control.controller import presses, senses_force
from skyarm.dynamics.actuators import make_mixer
from skyarm.dynamics.actuators.drive import TorqueDrive
from skyarm.dynamics.array_front import mass_matrix
from skyarm.dynamics.kinematics import frame_pose, jacobian_columns
from skyarm.reference.trajectory import Reference
from skyarm.scenario.scenario_record import Scenario
from skyarm.studies.assess.arm_poses import WRENCH, Allocation, Array, hover_efforts
from skyarm.studies.assess.finding import WARNING, Finding, at_least, at_most
from skyarm.studies.assess.joints import effort_limits

FORCE = "reference.push.force"
"""Field that these findings are about."""

INSTANTS = 500
"""Of the flight, at which force and pose are looked at."""

WARNS, HALF = 0.8, 0.5
"""Shares of a joint's limit and of the yaw torque that leave little: friction and a tilted base take the rest."""

MISSED = 0.05
"""Share of the push's joint torques by which servos may miss them: shipped ones miss 7 % and more, and press with 20 %
too little or bounce; one that misses 1 % presses with an error of 1 %."""

BOUNCES, RIPPLES = 0.6, 5.0
"""m/s^2, force over the tip's mass: below the first flights without noise bounced and none held its force, below the
second under noise less than 90 % of the time went by within 30 % of it."""


def push_limits(scenario: Scenario) -> list[Finding]:
    """The commanded push against joints and rotors, of a level base on its reference; none without one.

    The base is taken as level; friction along the surface is left out at the joints, and at the rotors it is that of
    the roughest surface, in the direction along the surface in which it turns the vehicle most.
    """
    vehicle, push = scenario.plant.vehicle, scenario.reference.push
    if push is None or not vehicle.n or not vehicle.end_effector:
        return []
    times = np.linspace(0.0, scenario.duration, INSTANTS, endpoint=False)
    at = max((scenario.reference.at(float(t)) for t in times), key=lambda reference: float(reference.push[0]))
    if not float(at.push[0]) > 0.0:
        return []  # nothing is pushed at any time
    return [
        *_law(scenario),
        *_joints(scenario, at),
        *_yaw(scenario, at),
        *_servos(scenario, at),
        *_tip_mass(scenario, at),
    ]


def _law(scenario: Scenario) -> list[Finding]:
    if presses(scenario.controller.par):
        return []
    text = f"law {scenario.controller.name} knows nothing of reference.push and follows positions against the surface"
    remedy = 'law = "centroidal" with mode = "tip" and interaction'
    return [Finding("pressing", WARNING, text, "controller", remedy)]


def _force(at: Reference) -> Array:
    """Force of the surface on the tip, N, axes of the level base."""
    force, _, *normal = (float(c) for c in at.push[:5])
    x, y, z = normal
    c, s = math.cos(float(at.yaw)), math.sin(float(at.yaw))
    return force * np.array([c * x + s * y, c * y - s * x, z])


def pushing_efforts(scenario: Scenario, joints: tuple[float, ...], force: Array) -> Array:
    """Joint efforts (N m or N) that hold the arm of a level base at rest against a force on its tip.

    Args:
        scenario: vehicle and gravity.
        joints: rad or m.
        force: on the tip, N, axes of the base.
    """
    vehicle = scenario.plant.vehicle
    still = hover_efforts(vehicle, float(scenario.plant.gravity), np.array([joints]))[WRENCH:, 0]
    columns = np.array([[float(c) for c in each.linear] for each in jacobian_columns(vehicle, vehicle.frame(), joints)])
    found: Array = still - columns @ force
    return found


def yaw_room(scenario: Scenario, joints: tuple[float, ...]) -> float:
    """Yaw torque that the rotors have left in level hover, the smaller of both senses, N m."""
    vehicle = scenario.plant.vehicle
    allocation = Allocation.of(make_mixer(vehicle))
    hover = allocation.squared_speeds(hover_efforts(vehicle, float(scenario.plant.gravity), np.array([joints])))
    return min(float(allocation.room(hover, sign * np.eye(WRENCH)[2])[0]) for sign in (1.0, -1.0))


def yaw_torques(scenario: Scenario, joints: tuple[float, ...], push: Array) -> tuple[float, float]:
    """Yaw torque of a push on the tip, and most that friction of coefficient 1 across it adds, N m.

    A force f at r turns about z by f.(z x r).
    """
    vehicle = scenario.plant.vehicle
    tip = frame_pose(vehicle, vehicle.frame(), joints).p
    lever = np.array([-float(tip.y), float(tip.x), 0.0])
    return float(abs(lever @ push)), float(np.linalg.norm(np.cross(push, lever)))


def _joints(scenario: Scenario, at: Reference) -> list[Finding]:
    vehicle, joints = scenario.plant.vehicle, tuple(float(q) for q in at.joints)
    efforts, limits = pushing_efforts(scenario, joints, _force(at)), effort_limits(vehicle)
    shares = np.abs(efforts) / limits
    i = int(np.argmax(shares))
    share, name = float(shares[i]), vehicle.links[i].joint.name
    unit = vehicle.links[i].joint.units[1]
    text = f"{float(at.push[0]):.3g} N take {abs(efforts[i]):.3g} of {limits[i]:.3g} {unit} at joint {name}"
    remedy = "less force, or a pose with the tip nearer to the joint's height"
    words = ("joints while pressing", share, text, FORCE, remedy)
    return [at_most(*words, fault=1.0, warning=WARNS, limit=1.0, joints=joints)]


def _yaw(scenario: Scenario, at: Reference) -> list[Finding]:
    frictions = [float(s.material.friction) for world in scenario.worlds for s in world.surfaces]
    joints = tuple(float(q) for q in at.joints)
    if not frictions:
        return []
    room, (pushing, sliding) = yaw_room(scenario, joints), yaw_torques(scenario, joints, _force(at))
    torque = pushing + max(frictions) * sliding
    text = f"pushing and sliding take {torque:.3g} of {room:.3g} N m of yaw torque at friction {max(frictions):g}"
    remedy = "slide across the lever as little as can be, less force, a shorter reach, or stronger yaw"
    warning = HALF * room
    return [at_most("yaw while pressing", torque, text, FORCE, remedy, warning=warning, unit="N m", joints=joints)]


def _push_columns(scenario: Scenario, at: Reference) -> tuple[Array, Array]:
    """Generalised force (6 + n,) of 1 N with which the tip of a level base presses, and the free acceleration by it."""
    vehicle, joints = scenario.plant.vehicle, np.array([[float(q) for q in at.joints]])
    M = mass_matrix(vehicle, np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0, 0.0]]), joints)[0]
    frame = vehicle.frame()
    tip = np.array([float(c) for c in frame_pose(vehicle, frame, tuple(joints[0])).p])
    columns = np.array([[float(c) for c in each.linear] for each in jacobian_columns(vehicle, frame, tuple(joints[0]))])
    along = -_force(at) / float(at.push[0])
    pushed = np.concatenate([along, np.cross(tip, along), columns @ along])
    return pushed, np.asarray(np.linalg.solve(M, pushed))


def _servos(scenario: Scenario, at: Reference) -> list[Finding]:
    """Torque that servos miss of the push, under a law of torques without a force sensor.

    The setpoint of a servo is chosen for a joint that accelerates freely; one that a surface stops gets another torque,
    and the law, which takes its own for applied, does not observe the difference.
    """
    law, memory = scenario.controller, scenario.controller.memory
    if not presses(law.par) or senses_force(law.par) or not isinstance(memory, ActuatorMemory) or not memory.drives:
        return []
    force, (pushed, free) = float(at.push[0]), _push_columns(scenario, at)
    joints, torques = tuple(float(q) for q in at.joints), force * pushed[6:]
    efforts, period = pushing_efforts(scenario, joints, _force(at)), 1.0 / scenario.rates.control
    drives = believed_drives(law.par.model)
    rows = zip(drives, efforts, force * free[6:], strict=True)
    missed = np.array([float(effort_at_rest(drive, effort, a, period)) for drive, effort, a in rows]) - efforts
    share = float(np.linalg.norm(missed) / np.linalg.norm(torques)) if np.any(torques) else 0.0
    servos = [k for k, drive in enumerate(drives) if not isinstance(drive, TorqueDrive)]
    i = max(servos, key=lambda k: abs(missed[k]), default=0)
    name = scenario.plant.vehicle.links[i].joint.name
    said = f"setpoints for joints that move freely miss {share:.2g} of the push's torque on a surface that stops them"
    remedy = "a force sensor at the tip (force_sensor = true), or joints that take torques"
    words = (f"{said}, most at joint {name}", f"drives.{name}", remedy)
    return [at_most("servos while pressing", share, *words, fault=MISSED, joints=joints)]


def _tip_mass(scenario: Scenario, at: Reference) -> list[Finding]:
    """Force over the mass that the tip has along the push: a heavy tip bounces, and passes on noise as force."""
    if not presses(scenario.controller.par):
        return []
    pushed, free = _push_columns(scenario, at)
    mass = 1.0 / float(pushed @ free)
    text = f"{float(at.push[0]):.3g} N press with a tip that weighs {mass:.2g} kg along the normal"
    remedy = "more force, a lighter arm, or drives with less armature"
    words = ("mass of the tip while pressing", float(at.push[0]) / mass, text, "links.joint.armature", remedy)
    return [at_least(*words, fault=BOUNCES, warning=RIPPLES, unit="m/s^2", joints=at.joints)]
