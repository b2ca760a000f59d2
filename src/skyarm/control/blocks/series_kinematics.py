"""Centre of mass and tip in base axes, with time derivatives: the vehicle's kinematics over Taylor series."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from skyarm.algebra import ZERO3, Vec3
from skyarm.compile import leaves, rebuild
from skyarm.dynamics.kinematics import Pose, link_poses
from skyarm.scalars import divide
from skyarm.scalars.taylor import Taylor
from skyarm.vehicle.linkage import BASE
from skyarm.vehicle.vehicle_records import Vehicle


@dataclass(frozen=True, slots=True)
class Posture:
    """Where an arm is, base axes; every component a series or a structural number.

    Attributes:
        com: centre of mass of the whole vehicle. tip: its tip (the base origin if there is none).
        links: poses of the links.
    """

    com: Vec3
    tip: Vec3
    links: tuple[Pose, ...]


def posture(vehicle: Vehicle, joints: Sequence[Taylor], order: int) -> Posture:
    """Posture of joint signals, to ``order`` derivatives."""
    # every number a series: an engine's scalar on the left of a product would not know what a series is
    lifted = rebuild(vehicle, iter([Taylor.constant(number, order) for number in leaves(vehicle)]))
    poses = tuple(link_poses(lifted, [q.truncated(order) for q in joints]))
    total = lifted.base.com * lifted.base.mass
    for link, pose in zip(lifted.moving, poses, strict=True):
        total = total + pose.apply(link.body.com) * link.body.mass
    com = total * Taylor.constant(divide(1.0, vehicle.mass), order)
    tip = ZERO3
    if vehicle.end_effector:
        frame = lifted.frame()
        tip = frame.position if frame.link == BASE else poses[frame.link].apply(frame.position)
    return Posture(com, tip, poses[: vehicle.n])


def derivative(v: Vec3, k: int) -> Vec3:
    """The k-th derivative of a vector of series, structural components constant."""
    return Vec3(*(c.derivative(k) if isinstance(c, Taylor) else (c if k == 0 else 0) for c in v))


def moving(values: Sequence[Any], *rates: Sequence[Any]) -> list[Taylor]:
    """Series of signals from their values and derivatives."""
    return [Taylor.of_derivatives(each) for each in zip(values, *rates, strict=True)]
