"""What the joints must give to hold and to move the arm in every pose."""

from __future__ import annotations

import math

import numpy as np

from skyarm.actuation.servo import Servo
from skyarm.assess.arm_poses import ArmPoses, Array, in_parts
from skyarm.assess.finding import FAULT, NOTE, OK, WARNING, Finding
from skyarm.assess.level_hover import WRENCH, hover_efforts
from skyarm.vehicle.vehicle_records import Vehicle

SWEEP = {"revolute": 1.0, "prismatic": 0.1}
"""rad or m that every joint is moved by in SECONDS, all at once, with least jerk."""

SECONDS = 2.0

NOTHING = 1e-12
"""N m or N: below it is rounding."""

PEAK_ACCELERATION, PEAK_RATE = 10.0 / math.sqrt(3.0), 1.875
"""Of a rest-to-rest motion of least jerk by 1 in 1 s (Flash and Hogan 1985)."""


def joint_torques(vehicle: Vehicle, poses: ArmPoses, gravity: float, held: str = "") -> list[Finding]:
    """Largest static and dynamic effort of every joint against its limit, base level.

    The dynamic effort is the largest that any signs of the joints' accelerations can ask for, with friction.
    """
    if not vehicle.n:
        return []

    def holding(joints: Array) -> Array:
        return -np.abs(hover_efforts(vehicle, gravity, joints)[WRENCH:])

    least, at = poses.worst(holding)
    static = np.where(-least > NOTHING, -least, 0.0)
    tried = np.vstack([at, poses.joints])
    moving = _dynamic(vehicle, tried, gravity)
    dynamic, where = np.max(moving, axis=1), tried[np.argmax(moving, axis=1)]
    found = []
    limits = effort_limits(vehicle)
    for i, link in enumerate(vehicle.links):
        joint = link.joint
        unit, limit = ("N m" if joint.kind == "revolute" else "N"), float(limits[i])
        name = f"joints[{joint.name}]"
        if float(joint.effort_limit) == 0.0:
            text = "passive: no drive holds it"
            found.append(Finding(question=f"{name} static effort{held}", level=NOTE, text=text, field=name))
            continue
        by = f"{SWEEP[joint.kind]:g} {'rad' if joint.kind == 'revolute' else 'm'} in {SECONDS:g} s"
        for kind, value, bad, pose, why in (
            ("static", float(static[i]), FAULT, at[i], "to hold the arm"),
            ("dynamic", float(dynamic[i]), WARNING, where[i], f"to move it ({by})"),
        ):
            level = bad if value > limit else OK
            text = f"up to {value:.3g} {unit}" + (f" of {limit:g}" if limit < math.inf else ", no limit stated")
            found.append(
                Finding(
                    question=f"{name} {kind} effort{held}",
                    level=level,
                    text=f"{text} {why}",
                    field=f"{name}.effort_limit",
                    value=value,
                    limit=limit if limit < math.inf else math.nan,
                    unit=unit,
                    remedy="" if level == OK else f"a stronger drive ({name}.effort_limit) or a lighter, shorter arm",
                    joints=tuple(map(float, pose)),
                )
            )
    return found


def effort_limits(vehicle: Vehicle) -> Array:
    """Largest effort (n,) of each joint, N m or N: its own, or what its servo gives at rest; infinite if passive."""
    servos = {each.name: each.drive for each in vehicle.drives}
    found = []
    for link in vehicle.links:
        limit = float(link.joint.effort_limit) or math.inf
        servo = servos.get(link.joint.name)
        if isinstance(servo, Servo):
            limit = min(limit, float(servo.bounds(0.0)[1]))
        found.append(limit)
    return np.array(found)


def _dynamic(vehicle: Vehicle, joints: Array, gravity: float) -> Array:
    """Upper bound of every joint's |effort| (n, lanes) while all joints move at once."""
    still = in_parts(lambda q: hover_efforts(vehicle, gravity, q)[WRENCH:], joints)
    total = np.abs(still)
    for i, link in enumerate(vehicle.links):
        unit = np.zeros(vehicle.n)
        unit[i] = SWEEP[link.joint.kind] * PEAK_ACCELERATION / SECONDS**2

        def changed(q: Array, a: Array = unit) -> Array:
            return hover_efforts(vehicle, gravity, q, a)[WRENCH:]

        total += np.abs(in_parts(changed, joints) - still)
    rates = [SWEEP[link.joint.kind] * PEAK_RATE / SECONDS for link in vehicle.links]
    friction = [
        float(k.joint.damping) * rate + float(k.joint.coulomb) for k, rate in zip(vehicle.links, rates, strict=True)
    ]
    return np.asarray(total + np.array(friction)[:, None], dtype=float)
