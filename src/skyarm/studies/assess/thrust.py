"""Thrust and torque reserves in level hover: margins, control authority, payload and
side force.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from skyarm.dynamics.actuators.hover import ROUNDING, highest_thrust
from skyarm.dynamics.array_front import mass_matrix
from skyarm.records.arrays import Array, doubles, float_array
from skyarm.studies.assess.arm_poses import WRENCH, ArmPoses, hanging_joints
from skyarm.studies.assess.finding import (
    FAULT,
    NOTE,
    OK,
    WARNING,
    Concern,
    Finding,
    at_least,
)
from skyarm.studies.assess.joints import effort_limits
from skyarm.vehicle import Vehicle

ENOUGH = 1.2
"""Least ratio of the busiest rotor's largest thrust to its hover thrust; below it
attitude control saturates often."""

LEAST_SHARE = 0.05
"""Least thrust of the slowest rotor over the mean; below it a small torque stops that
rotor."""


OWN_LAW = "a scenario with a law of your own: the shipped ones turn no rotor backwards"
"""Remedy of a vehicle whose hover turns rotors backwards, and mark of its finding."""


def thrust_margin(poses: ArmPoses) -> list[Finding]:
    """Check results for thrust: margin of the most loaded rotor and load of the least
    loaded one, worst arm pose.
    """

    def quantities(joints: Array) -> Array:
        squared = poses.squared_speeds(joints)
        busiest = np.max(
            poses.allocation.sizes(squared) / poses.allocation.highest[:, None], axis=0
        )
        idlest = np.min(squared, axis=0) / np.mean(np.abs(squared), axis=0)
        return np.stack([-busiest, idlest])

    (busiest, share), at = poses.worst(quantities)
    share = 0.0 if abs(share) <= ROUNDING else share  # a rotor that idles in hover
    text = f"the idlest rotor carries {share:.2g} of the mean in the worst arm pose"
    if share < 0.0:
        text = (
            f"a rotor would have to pull down: {text}; the centre of mass lies too far"
            " from the rotors' middle"
        )
    field = "base.com, links.com" if poses.vehicle.n else "base.com"
    remedy = f"move mass towards the rotors' middle ({field}; m, not mm?)"
    squared = poses.squared_speeds(at[1][None])[:, 0]
    backwards = [
        rotor
        for rotor, square in zip(poses.vehicle.rotors, squared, strict=True)
        if square < 0.0
    ]
    if share < 0.0 and all(rotor.reversible for rotor in backwards):
        text = (
            "no shipped law flies it: hover turns"
            f" {', '.join(rotor.name for rotor in backwards)} backwards"
        )
        field = "rotors.reversible"
        remedy = OWN_LAW
    return [
        _margin(poses, -float(busiest), at[0]),
        at_least(
            f"balance of the rotors{poses.held}",
            share,
            text,
            field,
            remedy,
            fault=0.0,
            warning=LEAST_SHARE,
            joints=at[1],
            concerns=Concern.LOADED_BALANCE if poses.held else Concern.BALANCE,
        ),
    ]


def _margin(poses: ArmPoses, busiest: float, joints: Array) -> Finding:
    question = f"thrust margin{poses.held}"
    field = "rotors.max_speed"
    if any(math.isinf(float(rotor.max_speed)) for rotor in poses.vehicle.rotors):
        return Finding(
            question,
            NOTE,
            "not known: a rotor has no max_speed",
            field,
            f"state {field}, rad/s",
        )
    margin = 1.0 / busiest if busiest > 0.0 else math.nan
    text = (
        f"the busiest rotor gives up to {margin:.3g} times what hover asks of it in the"
        " worst arm pose"
    )
    remedy = (
        f"less mass, a shorter arm, or more thrust: {field}, rotors.thrust_coefficient"
    )
    concerns = Concern.THRUST_MARGIN
    # not "<": a margin that is no number is a fault
    if not margin >= 1.0:
        weight = float(poses.efforts(joints[None])[WRENCH - 1, 0])
        cannot = "cannot hover"
        if not weight < highest_thrust(poses.vehicle):
            cannot = "cannot lift itself"
            concerns = Concern.LOADED_LIFT if poses.held else Concern.LIFT
        text = f"{cannot}: {text} ({weight:.3g} N of weight)"
    return at_least(
        question,
        margin,
        text,
        field,
        remedy,
        fault=1.0,
        warning=ENOUGH,
        joints=joints,
        concerns=concerns,
    )


AXES = ("roll", "pitch", "yaw")

FAULTS, WARNINGS = (1.0, 1.0, 0.05), (5.0, 5.0, 0.2)
"""Angular accelerations (rad/s^2) about x, y, z: below the first the base cannot be
held against a breeze, below the second it turns slowly."""


def torque_authority(poses: ArmPoses) -> list[Finding]:
    """Check results for roll, pitch and yaw: angular acceleration available in hover in
    the worst arm pose.

    The worst pose is that of the least acceleration: an arm that is stretched out adds
    inertia and takes no torque.
    """
    sides = _sides(poses)
    directions = [
        sign * np.eye(WRENCH)[axis] for axis in range(3) for sign in (1.0, -1.0)
    ]

    def quantities(joints: Array) -> Array:
        squared = poses.squared_speeds(joints)
        inertias = locked_inertia(poses.vehicle, joints)
        rooms = (poses.allocation.room(squared, direction) for direction in directions)
        # directions come in pairs, both senses of each axis
        least = np.stack(
            [room / inertias[:, i // 2, i // 2] for i, room in enumerate(rooms)]
        )
        # leaning rotors push sideways where they turn: that has a torque about the
        # centre of mass only
        if sides.any():
            M = _mass_matrix(poses.vehicle, joints)
            lost = M[:, 3:6, :2] @ sides / M[:, :1, :1]
            least *= 1.0 - lost.diagonal(axis1=1, axis2=2).T.repeat(2, axis=0)
        return least

    least, at = poses.worst(quantities)
    findings = []
    for axis, name in enumerate(AXES):
        i = 2 * axis + int(np.argmin(least[2 * axis : 2 * axis + 2]))
        acceleration = float(least[i])
        torque = acceleration * float(
            locked_inertia(poses.vehicle, at[i][None])[0, axis, axis]
        )
        text = (
            f"rotors can add {max(torque, 0.0):.3g} N m to hover either way,"
            f" {max(acceleration, 0.0):.3g} rad/s^2"
        )
        text = text if acceleration >= FAULTS[axis] else f"cannot be turned: {text}"
        fields = (
            "rotors.direction, rotors.moment_coefficient"
            if name == "yaw"
            else "rotors.position"
        )
        fields += ", base.inertia" + ", rotors.axis" * bool(sides.any())
        findings.append(
            at_least(
                f"{name} authority",
                acceleration,
                text,
                fields,
                f"check {fields}; more thrust margin",
                fault=FAULTS[axis],
                warning=WARNINGS[axis],
                unit="rad/s^2",
                joints=at[i],
                concerns=Concern.AUTHORITY,
            )
        )
    return findings


SLOWEST_ZERO = 20.0
"""Unstable zero (rad/s) of the position below which shipped laws are too fast; their
attitude has 10 to 20 rad/s."""


def side_forces(poses: ArmPoses) -> list[Finding]:
    """Warning about leaning rotors that push the base against its tilt while they tilt
    it.

    A tilt a about x or y moves the base by g a - e a'', where e a'' is the side force:
    a zero at sqrt(g / e).
    """
    # the first pose is that of zeros
    joints = poses.joints[:1]
    pushed = (
        _sides(poses)
        @ locked_inertia(poses.vehicle, joints)[0]
        / float(poses.vehicle.mass)
    )
    # a turn about x leans the thrust towards -y, one about y towards +x
    against = max(float(pushed[1, 0]), -float(pushed[0, 1]))
    zero = math.sqrt(poses.gravity / against) if against > 0.0 else math.inf
    text = (
        "rotors push against the tilt that they make: an unstable zero of the position"
        f" at {zero:.3g} rad/s"
    )
    remedy = (
        "lean rotors.axis inward, or take a law with a slower attitude:"
        " controller.bandwidth = 0.3"
    )
    if not zero < SLOWEST_ZERO:
        return []
    return [
        Finding(
            "side force of torques",
            WARNING,
            text,
            "rotors.axis",
            remedy,
            zero,
            SLOWEST_ZERO,
            "rad/s",
        )
    ]


def _sides(poses: ArmPoses) -> Array:
    """Force (2, 3) along x and y per torque of the rotors about the base's axes, N per
    N m.
    """
    thrusts = [
        float(rotor.thrust_coefficient) * float_array(rotor.axis)
        for rotor in poses.vehicle.rotors
    ]
    return doubles(np.transpose(thrusts)[:2] @ poses.allocation.inverse[:, :3])


def _mass_matrix(vehicle: Vehicle, joints: Array) -> Array:
    still = np.zeros((len(joints), 3))
    level = np.tile([1.0, 0.0, 0.0, 0.0], (len(joints), 1))
    return mass_matrix(vehicle, still, level, joints)


def locked_inertia(vehicle: Vehicle, joints: Array) -> Array:
    """Locked inertia (poses, 3, 3) of vehicle with arm about its centre of mass, base
    axes, kg m^2.

    Joints that hang give way: they add the inertia that is felt while no torque acts
    about them.
    """
    M = _mass_matrix(vehicle, joints)
    hanging = hanging_joints(vehicle)
    # joints without a drive are eliminated, as in a Schur complement
    if hanging:
        free = [0, 1, 2, *(6 + i for i in hanging)]
        turned = M[:, free, 3:6]
        return M[:, 3:6, 3:6] - turned.swapaxes(1, 2) @ np.linalg.solve(
            M[:, free][:, :, free], turned
        )
    return M[:, 3:6, 3:6] - M[:, 3:6, :3] @ M[:, :3, 3:6] / M[:, :1, :1]


NOTHING = 1e-9
"""Mass (kg) below which a payload is rounding."""


def largest_payload(poses: ArmPoses, payload: float) -> list[Finding]:
    """Check result for the largest point mass at the tip with which hover keeps a
    thrust margin of 1.2 in all poses.

    Wrench and efforts of a level hover are linear in the mass at the tip, so that each
    pose has its largest mass in closed form; the least of them is sought over the
    poses.
    """
    question = "largest payload"
    vehicle = poses.vehicle
    if not vehicle.end_effector:
        return [
            Finding(
                question,
                NOTE,
                f"not known: the vehicle has no tip{vehicle.tip_cure}",
                "end_effector",
            )
        ]
    # 1 kg shows the slope of what is linear in the mass
    loaded = replace(poses, vehicle=vehicle.with_payload(1.0))
    names = [f"rotors[{rotor.name}]" for rotor in vehicle.rotors]
    names += [f"joints[{joint.name}].effort_limit" for joint in vehicle.joints]

    def largest(joints: Array) -> Array:
        return doubles(np.min(_largest_by_part(poses, loaded, joints), axis=0)[None])

    (least,), at = poses.worst(largest)
    binding = names[int(np.argmin(_largest_by_part(poses, loaded, at)[:, 0]))]
    most = max(float(least), 0.0)
    if math.isinf(most):
        return [
            Finding(question, NOTE, "not limited: no rotor or joint states a limit")
        ]
    level = FAULT if payload > most else OK if most > NOTHING else WARNING
    text = (
        f"{most:.3g} kg in every arm pose, with thrust for {ENOUGH:g} times the weight;"
        f" {binding} comes first"
    )
    remedy = f"at most {most:.3g} kg, or more of {binding}"
    if most <= NOTHING:
        text = (
            f"none: {binding} has nothing left in some arm pose, with thrust for"
            f" {ENOUGH:g} times the weight"
        )
        remedy = f"more of {binding}, or a lighter vehicle"
    if level == FAULT:
        text = f"--payload {payload:g} kg is more than it holds: {text}"
    limit = payload or math.nan
    concerns = Concern.NO_PAYLOAD if level == WARNING else ""
    return [
        Finding(
            question, level, text, binding, remedy, most, limit, "kg", at[0], concerns
        )
    ]


def _largest_by_part(poses: ArmPoses, loaded: ArmPoses, joints: Array) -> Array:
    """Largest payload (kg) that each rotor and joint (rows) can carry in each pose;
    negative if already overloaded.
    """
    # as much reserve with the payload as the thrust margin asks for
    limits = poses.allocation
    bare = poses.efforts(joints)
    allocation = replace(
        limits, highest=limits.highest / ENOUGH, lowest=limits.lowest / ENOUGH
    )
    per_kilogram = loaded.efforts(joints) - bare
    rotors = allocation.headroom(
        allocation.squared_speeds(bare), allocation.squared_speeds(per_kilogram)
    )
    most = effort_limits(poses.vehicle)[:, None]
    effort, step = bare[WRENCH:], per_kilogram[WRENCH:]
    with np.errstate(divide="ignore", invalid="ignore"):
        # a joint whose effort the payload does not change bears any payload
        efforts = np.where(
            np.abs(step) > 1e-12, (most - np.sign(step) * effort) / np.abs(step), np.inf
        )
    return np.vstack([rotors, efforts])


def largest_side_force(
    vehicle: Vehicle, gravity: float, payload: float
) -> list[Finding]:
    """Check result for the largest steady horizontal force, as of wind, at which hover
    is possible, N.
    """
    question = "largest side force"
    weight = (float(vehicle.mass) + payload) * gravity
    top = float(highest_thrust(vehicle)) / ENOUGH
    if not math.isfinite(top):
        return [Finding(question, NOTE, "not known: a rotor has no max_speed")]
    # weight and side force are the legs of the thrust's triangle
    force = math.sqrt(max(top * top - weight * weight, 0.0))
    text = (
        f"{force:.3g} N of steady wind in hover, with {1.0 / ENOUGH:.0%} of the largest"
        " thrust"
    )
    return [Finding(question, OK, text, value=force, unit="N")]
