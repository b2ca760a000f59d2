"""Joints that nothing drives: a pendulum, the cord of a slung load."""

from __future__ import annotations

from collections.abc import Collection

from skyarm.vehicle.vehicle_records import Vehicle


def undriven_joints(vehicle: Vehicle, driven: Collection[str] = ()) -> tuple[str, ...]:
    """Names of the joints without effort (``effort_limit = 0``) that no drive of the vehicle or of ``driven`` moves."""
    driven = {*driven, *(each.name for each in vehicle.drives)}
    joints = (link.joint for link in vehicle.links)
    return tuple(joint.name for joint in joints if joint.name not in driven and float(joint.effort_limit) == 0.0)
