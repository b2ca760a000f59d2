"""Joints and servos: torques that hold and move the arm, speeds, stiffness, ranges and the workspace."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from skyarm.dynamics.actuators.servo import Servo
from skyarm.dynamics.kinematics import Pose, link_poses
from skyarm.scenario.scenario_record import Scenario
from skyarm.studies.assess.arm_poses import WRENCH, ArmPoses, Array, columns, hover_efforts, in_parts
from skyarm.studies.assess.finding import FAULT, NOTE, OK, WARNING, Finding, at_most
from skyarm.vehicle.linkage import BASE
from skyarm.vehicle.vehicle_records import Vehicle

SWEEP = {"rad": 1.0, "m": 0.1}
"""rad or m that every joint is moved by in SECONDS, all at once, with least jerk."""

SECONDS = 2.0

NOTHING = 1e-12
"""N m or N: below it is rounding."""

PEAK_ACCELERATION, PEAK_RATE = 10.0 / math.sqrt(3.0), 1.875
"""Of a rest-to-rest motion of least jerk by 1 in 1 s (Flash and Hogan 1985)."""


def joint_torques(poses: ArmPoses) -> list[Finding]:
    """Largest static and dynamic effort of every joint against its limit, base level.

    The dynamic effort is the largest that any signs of the joints' accelerations can ask for, with friction.
    """
    vehicle, held = poses.vehicle, poses.held
    if not vehicle.n:
        return []

    def holding(joints: Array) -> Array:
        return -np.abs(poses.efforts(joints)[WRENCH:])

    least, at = poses.worst(holding)
    static = np.where(-least > NOTHING, -least, 0.0)
    tried = np.vstack([at, poses.joints])
    moving = _dynamic(vehicle, tried, poses.gravity)
    dynamic, where = np.max(moving, axis=1), tried[np.argmax(moving, axis=1)]
    found = []
    limits, servos = effort_limits(vehicle), servos_of(vehicle)
    for i, link in enumerate(vehicle.links):
        joint, limit = link.joint, float(limits[i])
        length, unit = joint.units
        name = f"joints[{joint.name}]"
        if float(joint.effort_limit) == 0.0:
            text = "passive: no drive holds it"
            found.append(Finding(f"{name} static effort{held}", NOTE, text, name))
            continue
        servo = servos.get(joint.name)
        field, stronger = f"{name}.effort_limit", f"{name}.effort_limit"
        if servo is not None and limit < float(joint.effort_limit):
            field = f"drives.{joint.name}"
            stronger = f"{field}: gear, torque_constant, voltage over resistance, current_limit"
        by = f"{SWEEP[length]:g} {length} in {SECONDS:g} s"
        remedy = f"a stronger drive ({stronger}) or a lighter, shorter arm"
        for kind, value, bad, pose, why in (
            ("static", float(static[i]), "fault", at[i], "to hold the arm"),
            ("dynamic", float(dynamic[i]), "warning", where[i], f"to move it ({by})"),
        ):
            text = f"up to {value:.3g} {unit}" + (f" of {limit:g}" if limit < math.inf else ", no limit stated")
            words = (f"{name} {kind} effort{held}", value, f"{text} {why}", field, remedy)
            stated = limit if limit < math.inf else math.nan
            bounds: Any = {bad: limit, "limit": stated}
            found.append(at_most(*words, unit=unit, joints=pose, **bounds))
    return found


def servos_of(vehicle: Vehicle) -> dict[str, Servo]:
    """Servos by the names of their joints."""
    return {each.name: each.drive for each in vehicle.drives if isinstance(each.drive, Servo)}


def effort_limits(vehicle: Vehicle) -> Array:
    """Largest effort (n,) of each joint, N m or N: its own, or what its servo gives at rest; infinite if passive."""
    servos = servos_of(vehicle)
    limits = {link.joint.name: float(link.joint.effort_limit) or math.inf for link in vehicle.links}
    return np.array([
        min(limit, float(servos[name].largest_effort())) if name in servos else limit for name, limit in limits.items()
    ])  # fmt: skip


def _dynamic(vehicle: Vehicle, joints: Array, gravity: float) -> Array:
    """Upper bound of every joint's |effort| (n, lanes) while all joints move at once."""
    still = in_parts(lambda q: hover_efforts(vehicle, gravity, q)[WRENCH:], joints)
    total = np.abs(still)
    for i, link in enumerate(vehicle.links):
        unit = np.zeros(vehicle.n)
        unit[i] = SWEEP[link.joint.units[0]] * PEAK_ACCELERATION / SECONDS**2

        def efforts(q: Array, a: Array = unit) -> Array:
            return hover_efforts(vehicle, gravity, q, a)[WRENCH:]

        total += np.abs(in_parts(efforts, joints) - still)
    rates = [SWEEP[link.joint.units[0]] * PEAK_RATE / SECONDS for link in vehicle.links]
    friction = [
        float(k.joint.damping) * rate + float(k.joint.coulomb) for k, rate in zip(vehicle.links, rates, strict=True)
    ]
    return np.asarray(total + np.array(friction)[:, None], dtype=float)


OFTEN = 0.05
"""Share of the flight in saturation above which the reference cannot be followed."""


def servos(scenario: Scenario) -> list[tuple[int, Servo]]:
    """Indices of the joints with servos, and these."""
    given = {each.joint: each.drive for each in scenario.joint_drives}
    named = [(i, given.get(link.joint.name)) for i, link in enumerate(scenario.plant.vehicle.links)]
    return [(i, drive) for i, drive in named if isinstance(drive, Servo)]


def servo_speeds(scenario: Scenario, time: Array, every_rate: Array) -> list[Finding]:
    """Fastest reference rate of each servo against its own limit and the motor's speed without load.

    Args:
        scenario: whose reference is followed exactly.
        time: (K,) s.
        every_rate: (n, K) of the reference's joints, rad/s or m/s.
    """
    found = []
    for i, servo in servos(scenario):
        joint, top = scenario.plant.vehicle.links[i].joint, min(float(servo.speed_limit), servo.no_load_speed)
        if math.isinf(top):
            continue
        rates, unit = np.abs(every_rate[i]), f"{joint.units[0]}/s"
        k = int(np.argmax(rates))
        late = float(np.mean(rates > top))
        field = f"drives.{joint.name}.speed_limit" if top == servo.speed_limit else f"drives.{joint.name}.voltage"
        level = OK if not late else FAULT if late > OFTEN else WARNING
        text = f"the reference asks for up to {rates[k]:.3g} {unit} (at {time[k]:.3g} s), the servo turns at {top:.3g}"
        text += f": too fast for {late:.1%} of the flight" if late else ""
        question, remedy = f"joints[{joint.name}] servo's speed", f"a slower reference, or more of {field}"
        found.append(Finding(question, level, text, field, remedy, rates[k], top, unit))
    return found


def arm_workspace(poses: ArmPoses) -> list[Finding]:
    """Box of the tip's places over all poses, and limits that look wrong."""
    vehicle = poses.vehicle
    found = _ranges(vehicle)
    if vehicle.end_effector and vehicle.frame().link != BASE:
        ends, _ = poses.worst(lambda joints: np.vstack([tip_places(vehicle, joints).T, -tip_places(vehicle, joints).T]))
        low, high = (np.round(each, 9) + 0.0 for each in (ends[:3], -ends[3:]))
        box = ", ".join(f"{c} {a:.3g} ... {b:.3g}" for c, a, b in zip("xyz", low, high, strict=True))
        found.append(Finding("workspace", OK, f"tip in base axes: {box} m", "frames"))
    return found


def tip_places(vehicle: Vehicle, joints: Array) -> Array:
    """Tip (lanes, 3) in base axes, m."""
    frame = vehicle.frame()
    place = link_poses(vehicle, columns(joints))[frame.link] @ Pose(frame.rotation, frame.position)
    return np.stack([np.broadcast_to(np.asarray(c, dtype=float), len(joints)) for c in place.p], axis=1)


SMALLEST_RANGE = {"rad": 0.05, "m": 0.005}
"""rad or m; fingers slide by some millimetres."""


def _ranges(vehicle: Vehicle) -> list[Finding]:
    found = []
    for link in vehicle.links:
        joint, name = link.joint, f"joints[{link.joint.name}]"
        width = float(joint.upper) - float(joint.lower)
        smallest = SMALLEST_RANGE[joint.units[0]]
        if width < smallest:
            text = f"moves by {width:.3g} only"
            remedy = f"check {name}.lower and {name}.upper (rad or m)"
            found.append(Finding(f"range of {name}", WARNING, text, f"{name}.lower", remedy, width, smallest))
        if not float(joint.lower) <= 0.0 <= float(joint.upper):
            text = f"zero is outside {float(joint.lower):g} ... {float(joint.upper):g}: a flight must state its start"
            found.append(Finding(f"range of {name}", NOTE, text, f"{name}.lower"))
    return found
