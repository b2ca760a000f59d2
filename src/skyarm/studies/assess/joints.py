"""Joint and servo checks: holding torques, servo speeds and workspace."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from skyarm.algebra import ZERO3, Mat3
from skyarm.dynamics.actuators.servo import Servo
from skyarm.dynamics.kinematics import frame_pose
from skyarm.records.arrays import Array, Mask, stack_values
from skyarm.scenario.scenario_record import Scenario
from skyarm.studies.assess.arm_poses import WRENCH, ArmPoses, in_parts
from skyarm.studies.assess.finding import (
    FAULT,
    NOTE,
    OK,
    WARNING,
    Concern,
    Finding,
    at_most,
)
from skyarm.vehicle import BASE, Vehicle
from skyarm.world.scene.clearance import clearances

NOTHING = 1e-12
"""Effort (N m or N) below which a value is rounding."""


def joint_torques(poses: ArmPoses) -> list[Finding]:
    """Check results for each joint's largest static torque or force against its limit,
    over all arm poses.
    """
    vehicle, load = poses.vehicle, poses.held
    if not vehicle.n:
        return []
    least, at = poses.worst(lambda joints: -np.abs(poses.efforts(joints)[WRENCH:]))
    static = np.where(-least > NOTHING, -least, 0.0)
    findings = []
    for joint, limit, value, pose in zip(
        vehicle.joints, effort_limits(vehicle), static, at, strict=True
    ):
        unit = joint.units[1]
        name = f"joints[{joint.name}]"
        question = f"{name} static effort{load}"
        if float(joint.effort_limit) == 0.0:
            findings.append(Finding(question, NOTE, "passive: no drive holds it", name))
            continue
        field = stronger = f"{name}.effort_limit"
        # a servo that gives less than its joint takes
        if limit < float(joint.effort_limit):
            field = f"drives.{joint.name}"
            stronger = (
                f"{field}: gear, torque_constant, voltage over resistance,"
                " current_limit"
            )
        stated = f" of {limit:g}" if limit < math.inf else ", no limit stated"
        text = f"up to {value:.3g} {unit}{stated} to hold the arm"
        remedy = f"a stronger drive ({stronger}) or a lighter, shorter arm"
        findings.append(
            at_most(
                question,
                float(value),
                text,
                field,
                remedy,
                fault=float(limit),
                limit=float(limit) if limit < math.inf else math.nan,
                unit=unit,
                joints=pose,
                concerns=Concern.STATIC_EFFORT,
            )
        )
    return findings


def effort_limits(vehicle: Vehicle) -> Array:
    """Effort limit (n,) of each joint, N m or N: of the joint or its servo at rest;
    infinite if passive.
    """
    of_servos = {
        each.name: float(each.drive.largest_effort())
        for each in vehicle.drives
        if isinstance(each.drive, Servo)
    }
    return np.array(
        [
            # a limit of 0 marks a passive joint
            min(
                float(each.effort_limit) or math.inf, of_servos.get(each.name, math.inf)
            )
            for each in vehicle.joints
        ]
    )


OFTEN = 0.05
"""Fraction of the flight in saturation above which the reference is infeasible."""


def servos(scenario: Scenario) -> list[tuple[int, Servo]]:
    """Servos of a scenario, each with the index of the joint that it drives."""
    return [
        (i, drive)
        for i, drive in enumerate(scenario.agent.all_drives)
        if isinstance(drive, Servo)
    ]


def servo_speeds(
    scenario: Scenario, time: Array, every_rate: Array, share: Callable[[Mask], float]
) -> list[Finding]:
    """Results of checking each servo's fastest reference rate against its rate limit
    and no-load speed.

    Args:
        scenario: scenario whose reference is followed exactly.
        time: (K,) s.
        every_rate: (n, K) of the reference's joints, rad/s or m/s.
        share: condition (K,) -> fraction of the flight's time in which it is true.
    """
    findings = []
    for i, servo in servos(scenario):
        joint = scenario.agent.vehicle.joints[i]
        # no servo turns faster than it does without a load
        top = min(float(servo.speed_limit), servo.no_load_speed)
        if math.isinf(top):
            continue
        rates = np.abs(every_rate[i])
        unit = f"{joint.units[0]}/s"
        k = int(np.argmax(rates))
        late = share(rates > top)
        field = (
            f"drives.{joint.name}.speed_limit"
            if top == servo.speed_limit
            else f"drives.{joint.name}.voltage"
        )
        level = OK if not late else FAULT if late > OFTEN else WARNING
        text = (
            f"the reference asks for up to {rates[k]:.3g} {unit} (at {time[k]:.3g} s),"
            f" the servo turns at {top:.3g}"
        )
        text += f": too fast for {late:.1%} of the flight" if late else ""
        question = f"joints[{joint.name}] servo's speed"
        remedy = f"a slower reference, or more of {field}"
        findings.append(
            Finding(
                question,
                level,
                text,
                field,
                remedy,
                rates[k],
                top,
                unit,
                concerns=Concern.SERVO_SPEED,
            )
        )
    return findings


def arm_workspace(poses: ArmPoses) -> list[Finding]:
    """Bounding box of the tip's workspace, as a check result; empty without an arm."""
    vehicle = poses.vehicle
    if not vehicle.end_effector or vehicle.frame().link == BASE:
        return []

    def both_ways(joints: Array) -> Array:
        tip = frame_pose(vehicle, vehicle.frame(), tuple(joints.T)).p
        places = stack_values(len(joints), tip)
        return np.vstack([places, -places])

    ends, _ = poses.worst(both_ways)
    # to a nanometre, since rounding leaves some digits where zero is meant; adding zero
    # turns -0.0, which would show its sign, into 0.0
    low, high = (np.round(each, 9) + 0.0 for each in (ends[:3], -ends[3:]))
    box = ", ".join(
        f"{c} {a:.3g} ... {b:.3g}" for c, a, b in zip("xyz", low, high, strict=True)
    )
    return [Finding("workspace", OK, f"tip in base axes: {box} m", "frames")]


OWN = "distance of own shapes"
"""Name of the question about shapes of a vehicle that may touch each other."""

SEARCHED = 3
"""Number of pairs of own shapes, the nearest ones in the sampled poses, for which a
worse pose is searched."""


def own_collision(poses: ArmPoses) -> list[Finding]:
    """Note on the arm pose in which two shapes of a vehicle overlap most, or are
    nearest; empty without such shapes.
    """
    vehicle = poses.vehicle
    near = clearances(vehicle)
    if not (vehicle.collisions and near.pairs):
        return []

    def gaps(joints: Array) -> Array:
        rows = near.distances(ZERO3, Mat3.identity(), tuple(joints.T))
        return stack_values(len(joints), rows)

    closest = in_parts(gaps, poses.joints).min(axis=1).argsort()[:SEARCHED]
    near = replace(near, pairs=tuple(near.pairs[i] for i in closest))
    least, at = poses.worst(gaps)
    k = int(least.argmin())
    pose = ", ".join(
        f"{joint.name} = {value:.3g} {joint.units[0]}"
        for joint, value in zip(vehicle.joints, at[k], strict=True)
    )
    level, word = (NOTE, "overlap") if least[k] < 0.0 else (OK, "are nearest")
    text = f"{near.names[k]} {word} at {pose}"
    return [Finding(OWN, level, text, value=least[k], unit="m", joints=at[k])]
