"""Actuators of MJCF files: the effort of each joint, and the gains of its servos.

An actuator's force is gain * control + bias, within its force range; a joint takes the
gear times it. A bias of -kp length - kv velocity is a servo, whatever its control
means. Source: MuJoCo documentation, Computation, Actuation.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator
from typing import Any

import numpy as np

from skyarm.records.arrays import Array
from skyarm.vehicle.attach import Notes

AT_JOINT, FIXED, PID = (0, 1), 0, 5
"""MuJoCo's enumeration values of transmissions at a joint, and of gains: a number per
control, and a pid's."""

LAGGING = (0, 2, 3)
"""MuJoCo's enumeration values of dynamics in which a constant control comes through
whole: none, and two filters."""


def name_of(model: Any, kind: str, index: int) -> str:
    """Name of an element of a MuJoCo model; made from its index if the file states
    none.
    """
    return str(getattr(model, kind)(index).name) or f"{kind}{index}"


def joints_of(model: Any, body: int) -> list[int]:
    """Joints of a body of a MuJoCo model, in the order in which they move it."""
    first = model.body_jntadr[body]
    return list(range(first, first + model.body_jntnum[body]))


def carriers(model: Any, body: int) -> Iterator[int]:
    """A body of a MuJoCo model and all that carry it, but for the world."""
    while body:
        yield body
        body = model.body_parentid[body]


def limits(model: Any, joint: int) -> tuple[float, float]:
    """Lower and upper joint limit relative to the reference position, rad or m;
    infinite without limits.
    """
    if not model.jnt_limited[joint]:
        return -math.inf, math.inf
    # MuJoCo's ranges count from its own zero, this library's from the reference
    # position
    zero = float(model.qpos0[model.jnt_qposadr[joint]])
    lower, upper = (float(each) - zero for each in model.jnt_range[joint])
    return lower, upper


def force_range(model: Any, actuator: int) -> tuple[float, float]:
    """Least and largest force (N or N m) of an actuator before its gear: its range, its
    control's, its activation's.
    """
    low, high = (
        model.actuator_forcerange[actuator]
        # a joint may have no force limit of its own and yet be bounded by its control
        # or its activation
        if model.actuator_forcelimited[actuator]
        else (-math.inf, math.inf)
    )
    first = model.actuator_ctrladr[actuator]
    lagging = model.actuator_dyntype[actuator] in LAGGING
    of_control = (
        model.actuator_ctrlrange[first],
        lagging and model.actuator_ctrllimited[first],
    )
    of_activation = (
        model.actuator_actrange[actuator],
        model.actuator_actlimited[actuator],
    )
    # only a gain times the control is bounded by it; a servo's force follows its error
    for ends, counts in (of_control, of_activation):
        if counts and is_plain(model, actuator):
            # a negative gain swaps the ends
            least, most = np.sort(model.actuator_gainprm[actuator][0] * ends)
            low, high = max(low, least), min(high, most)
    return float(low), float(high)


def bias_of(model: Any, actuator: int) -> Array:
    """Coefficients of an actuator's bias; zeros without a bias, where MuJoCo ignores
    the numbers of the file.
    """
    # MuJoCo keeps the file's numbers in biasprm also where the bias is off
    bias: Array = model.actuator_biasprm[actuator] * (
        model.actuator_biastype[actuator] != 0
    )
    return bias


def is_plain(model: Any, actuator: int) -> bool:
    """True if an actuator's force is a number times its control."""
    # a plugin's force follows from none of the model's numbers
    alone = model.actuator_plugin[actuator] < 0
    return (
        alone
        and model.actuator_gaintype[actuator] == FIXED
        and not bias_of(model, actuator).any()
    )


def is_servo(model: Any, actuator: int) -> bool:
    """True if an actuator's force is that of a motor or of a loop that pulls towards a
    setpoint.
    """
    # a bias of type 2 and above is a muscle's, a motor's or a user's
    known = (
        model.actuator_gaintype[actuator] in (FIXED, PID)
        and model.actuator_biastype[actuator] < 2
    )
    return (
        known
        and model.actuator_plugin[actuator] < 0
        # positive coefficients would push away from the setpoint
        and max(bias_of(model, actuator)[1:3]) <= 0.0
    )


def at_joint(model: Any, joint: int) -> list[int]:
    """Actuators that act at a joint."""
    kinds, ids = model.actuator_trntype, model.actuator_trnid
    return [
        a for a in range(model.nactuator) if kinds[a] in AT_JOINT and ids[a][0] == joint
    ]


def effort_of(model: Any, joint: int, notes: Notes) -> float:
    """Effort limit of a joint from all its actuators together, N m or N; 0 without
    actuators.
    """
    name = name_of(model, "jnt", joint)
    total = 0.0
    for actuator in (each for each in at_joint(model, joint) if is_servo(model, each)):
        low, high = force_range(model, actuator)
        # a joint has one effort limit for both directions here
        total += abs(float(model.actuator_gear[actuator][0])) * max(-low, high)
        if abs(low + high) > 0.0:
            notes.add(
                "with a range of effort that differs both ways; the larger one counts"
                " for both",
                name,
            )
    # the joint's own clamp bounds the sum of its actuators
    if model.jnt_actfrclimited[joint]:
        total = min(total, float(abs(model.jnt_actfrcrange[joint]).max()))
    if total == 0.0:
        notes.add(
            "without an actuator, so passive; [[joints]] effort_limit gives it a drive",
            name,
        )
    elif math.isinf(total):
        notes.add(
            "of unlimited effort: the file states none; [[joints]] effort_limit does",
            name,
        )
    return total


def read_drives(
    model: Any, joints: Collection[str], following: Collection[str], notes: Notes
) -> dict[str, dict[str, Any]]:
    """Servos of the joints: joint -> table as ``[drives.JOINT]`` of a vehicle file has
    it.

    Args:
        model: MuJoCo's model.
        joints: names of those that move.
        following: names of those that an equality ties to others.
        notes: takes what is not read of their actuators.
    """
    drives: dict[str, dict[str, Any]] = {}
    for joint in range(model.njnt):
        name = name_of(model, "jnt", joint)
        actuators = at_joint(model, joint)
        for each in actuators if name in following else ():
            why = f"at joint {name}, which follows another one: not read"
            notes.add(why, name_of(model, "actuator", each), "actuator")
        if not model.jnt_type[joint]:
            for each in actuators:
                own = name_of(model, "actuator", each)
                notes.add(
                    "at the free joint: a wrench on the vehicle and no rotor; not read",
                    own,
                    "actuator",
                )
        if name in joints:
            stiffness, damping, integral = map(
                float, sum((_gains(model, a, notes) for a in actuators), np.zeros(3))
            )
            table = {"kind": "velocity_servo", "gain": damping}
            if stiffness:
                table = {
                    "kind": "position_servo",
                    "stiffness": stiffness,
                    "damping": damping,
                    "integral": integral,
                }
            if stiffness or damping:
                # inertia that the servo moves at the reference position, armature
                # included, by which its integration step is bounded
                drives[name] = {
                    **table,
                    "inertia": (
                        1.0 / float(model.dof_invweight0[model.jnt_dofadr[joint]])
                    ),
                }
    return drives


def _gains(model: Any, actuator: int, notes: Notes) -> Array:
    """Torque per position error, per rate and per integral of the error that an
    actuator gives its joint; or zeros.
    """
    bias = bias_of(model, actuator)
    kind = model.actuator_gaintype[actuator]
    servo = is_servo(model, actuator)
    name = name_of(model, "actuator", actuator)
    # a bias without a stiffness is a constant force; dynamics of type 0 are none, those
    # of type 6 a PID loop, and others filter the control
    if (
        not servo
        or (bias[0] and not bias[1])
        or model.actuator_dyntype[actuator] not in (0, 6)
    ):
        why = (
            "muscle, damper, dcmotor, plugin, or with a filter or bias of its own: that"
            " is not read"
        )
        notes.add(why, name, "actuator")
    if model.actuator_delay[actuator] or (
        kind == PID and model.actuator_dynprm[actuator].any()
    ):
        why = (
            "with a delay, slewmax or imax: not read; [drives] latency and speed_limit"
            " state a servo's"
        )
        notes.add(why, name, "actuator")
    integral = model.actuator_gainprm[actuator][0] if kind == PID else 0.0
    gains: Array = np.array([-bias[1], -bias[2], integral])
    # gear squared: once from the joint to the length, and once from the force to the
    # torque
    return gains * (servo * float(model.actuator_gear[actuator][0]) ** 2)
