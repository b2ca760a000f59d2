"""A joint's drive: limited torque less friction; and the hard stops at its limits."""

from __future__ import annotations

from typing import Any

from skyarm.scalars import add, clip, divide, maximum, mul, sub, tanh
from skyarm.vehicle.linkage import Joint


def joint_force(joint: Joint, command: Any, rate: Any, effectiveness: Any = 1) -> Any:
    """Torque (N m) or force (N) on the joint: the limited command, less viscous and smooth Coulomb friction.

    ``effectiveness`` is the share of the drive's effort that a fault leaves; friction stays.
    The friction law c tanh(qd / v0) is smooth through zero, so that both plants integrate the same right-hand side.
    """
    return sub(mul(effectiveness, limited_effort(joint, command)), friction(joint, rate, rate))


def limited_effort(joint: Joint, command: Any) -> Any:
    """What the drive gives of a commanded torque (N m) or force (N): no more than its limit, either way."""
    return clip(command, -joint.effort_limit, joint.effort_limit)


def friction(joint: Joint, rate: Any, dry_rate: Any) -> Any:
    """What friction takes: viscous at ``rate``, Coulomb's c tanh(qd / v0) at ``dry_rate`` (rad/s or m/s).

    A law that gives it back takes the reference's rate for the dry part, whose sign would chatter with a measured one.
    """
    return add(mul(joint.damping, rate), mul(joint.coulomb, tanh(divide(dry_rate, joint.coulomb_rate))))


def stop_force(joint: Joint, position: Any, rate: Any) -> Any:
    """What the stops at a joint's limits push it back with, N m or N; a structural 0 without stops.

    k depth (1 + d speed), with the depth past the limit and the speed into the stop; never a pull. It begins at zero,
    so that integrators of both plants meet no jump, and takes energy away with every push.
    Source: Hunt, Crossley 1975, with a linear spring.
    """
    if not joint.has_stops:
        return 0
    k, more = joint.stop_stiffness, mul(joint.stop_damping, rate)
    above = mul(maximum(sub(position, joint.upper), 0.0), maximum(add(1.0, more), 0.0))
    below = mul(maximum(sub(joint.lower, position), 0.0), maximum(sub(1.0, more), 0.0))
    return mul(k, sub(below, above))
