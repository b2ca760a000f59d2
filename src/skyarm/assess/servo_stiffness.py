"""Whether a law of torques can fly the servos of the joints: how fast their loops are beside a control period."""

from __future__ import annotations

import math

import numpy as np

from skyarm.actuation.servo import PositionServo, Servo, VelocityServo
from skyarm.assess.finding import OK, WARNING, Finding
from skyarm.vehicle.mobility import joint_mobility
from skyarm.vehicle.vehicle_records import Vehicle

PERIOD = 0.005
"""s, of control, where a scenario does not say otherwise."""

LARGEST = 1.0
"""Frequency of a servo's loop times the control period: while a setpoint is held the loop then moves the joint so far
that the law's torque is not what the joint feels, and the joint drifts off its reference."""


LEAST = 0.01
"""Stated over least inertia of a joint: a smaller one only makes the steps of the integrator short."""


def servo_stiffness(vehicle: Vehicle) -> list[Finding]:
    """Frequency of every servo's loop on the least inertia that its joint has, against the control period.

    A position servo's is sqrt(stiffness / inertia), a velocity servo's gain / inertia. The inertia is the one against
    which the joint's own torque accelerates it, all else free to move.
    """
    servos = {each.name: each.drive for each in vehicle.drives if isinstance(each.drive, Servo)}
    if not servos:
        return []
    ease = np.max([np.diag(each) for each in joint_mobility(vehicle)], axis=0)
    found = []
    for link, each in zip(vehicle.links, ease.tolist(), strict=True):
        servo = servos.get(link.joint.name)
        if servo is not None and math.isfinite(each) and each > 0.0:
            found.append(_finding(link.joint.name, frequency(servo, 1.0 / each), float(link.joint.armature)))
            if float(servo.inertia) < LEAST * (1.0 / each):
                found.append(_inertia(link.joint.name, float(servo.inertia), 1.0 / each))
    return found


def frequency(servo: Servo, inertia: float) -> float:
    """Natural frequency of a servo's loop on an inertia (kg m^2 or kg), rad/s; 0 of a kind without one."""
    if isinstance(servo, PositionServo):
        return math.sqrt(float(servo.stiffness) / inertia)
    return float(servo.gain) / inertia if isinstance(servo, VelocityServo) else 0.0


def _finding(joint: str, rate: float, armature: float) -> Finding:
    most = LARGEST / PERIOD
    level = WARNING if rate > most else OK
    text = f"its loop moves the joint at {rate:.3g} rad/s; a torque held for {1e3 * PERIOD:g} ms asks for {most:g}"
    if level == WARNING:
        text += " or less: under a law of torques the joint drifts"
    missing = f"state joints[{joint}].armature, what the gear makes of the motor's inertia"
    stiff = f"less stiffness in drives.{joint}, a higher rates.control, or a law of setpoints (servos = false)"
    return Finding(
        question=f"joints[{joint}] servo",
        level=level,
        text=text,
        field=f"drives.{joint}" if armature else f"joints[{joint}].armature",
        value=rate,
        limit=most,
        unit="rad/s",
        remedy="" if level == OK else stiff if armature else f"{missing}, or {stiff}",
    )


def _inertia(joint: str, stated: float, least: float) -> Finding:
    field = f"drives.{joint}.inertia"
    return Finding(
        question=f"joints[{joint}] servo's inertia",
        level=WARNING,
        text=f"{stated:.3g} kg m^2 or kg stated, the joint moves {least:.3g} at least: steps are needlessly short",
        field=field,
        value=stated,
        limit=LEAST * least,
        unit="kg m^2 or kg",
        remedy=f"check {field} (kg m^2, not less than the joint moves)",
    )
