"""What the joints must give to hold and to move the arm in every pose."""

from __future__ import annotations

import math

import numpy as np

from skyarm.actuation.servo import PositionServo, Servo
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
        servo = _servo_of(vehicle, joint.name)
        field, stronger = f"{name}.effort_limit", f"{name}.effort_limit"
        if servo is not None and limit < float(joint.effort_limit):
            field = f"drives.{joint.name}"
            stronger = f"{field}: gear, torque_constant, voltage over resistance, current_limit"
        if servo is not None:
            found += _bent(joint.name, joint.kind, servo, float(static[i]), held, tuple(map(float, at[i])))
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
                    field=field,
                    value=value,
                    limit=limit if limit < math.inf else math.nan,
                    unit=unit,
                    remedy="" if level == OK else f"a stronger drive ({stronger}) or a lighter, shorter arm",
                    joints=tuple(map(float, pose)),
                )
            )
    return found


BENT = {"revolute": 0.5, "prismatic": 0.05}
"""rad or m by which the arm's weight bends a position servo off its setpoint: hobby servos give way by 0.1 rad."""


def _servo_of(vehicle: Vehicle, joint: str) -> Servo | None:
    found = next((each.drive for each in vehicle.drives if each.name == joint), None)
    return found if isinstance(found, Servo) else None


def _bent(joint: str, kind: str, servo: Servo, static: float, held: str, pose: tuple[float, ...]) -> list[Finding]:
    """A warning where a position servo without an integral gives way under the weight that it holds."""
    if not isinstance(servo, PositionServo) or float(servo.integral) > 0.0:
        return []
    bent, unit = static / float(servo.stiffness), "rad" if kind == "revolute" else "m"
    if bent <= BENT[kind]:
        return []
    per = "N m/rad, not N m/degree" if kind == "revolute" else "N/m, not N/mm"
    field = f"drives.{joint}.stiffness"
    return [
        Finding(
            question=f"joints[{joint}] under the arm's weight{held}",
            level=WARNING,
            text=f"{static:.3g} {'N m' if unit == 'rad' else 'N'} bend its servo by {bent:.3g} {unit} off its setpoint",
            field=field,
            value=bent,
            limit=BENT[kind],
            unit=unit,
            remedy=f"check {field} ({per}?), or an integral",
            joints=pose,
        )
    ]


def effort_limits(vehicle: Vehicle) -> Array:
    """Largest effort (n,) of each joint, N m or N: its own, or what its servo gives at rest; infinite if passive."""
    servos = {each.name: each.drive for each in vehicle.drives}
    found = []
    for link in vehicle.links:
        limit = float(link.joint.effort_limit) or math.inf
        servo = servos.get(link.joint.name)
        if isinstance(servo, Servo):
            limit = min(limit, float(servo.largest_effort()))
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
