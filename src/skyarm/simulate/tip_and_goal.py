"""Tip position of a vehicle, and desired positions of base, joints and tip."""

from __future__ import annotations

from skyarm.algebra import Quaternion, Scalars, Vec3
from skyarm.dynamics import frame_pose
from skyarm.log.metrics.metric import MetricGoal
from skyarm.reference import Reference
from skyarm.vehicle import Vehicle


def tip_at(
    vehicle: Vehicle, position: Vec3, quaternion: Quaternion, joints: Scalars
) -> Vec3:
    """Tip position (m), world axes, from base position, attitude and joint positions.

    Without a tip it is the position of the base origin.
    """
    # without a tip the metrics of the tip are those of the base
    if not vehicle.end_effector:
        return position
    tip = frame_pose(vehicle, vehicle.frame(), joints).p
    return position + quaternion.rotation().apply(tip)


def goal_of(vehicle: Vehicle, reference: Reference) -> MetricGoal:
    """Desired positions of base, joints and tip of a reference; without a tip
    reference, the tip of the level vehicle.

    The latter is p_d + R_z(psi_d) p_e(th_d).
    """
    if reference.tip:
        return MetricGoal(
            position=reference.position,
            joints=reference.joints,
            tool=Vec3(*reference.tip),
        )
    tool = reference.position
    if vehicle.end_effector:
        tip = frame_pose(vehicle, vehicle.frame(), reference.joints).p
        tool = tool + tip.about_z(reference.yaw)
    return MetricGoal(position=reference.position, joints=reference.joints, tool=tool)
