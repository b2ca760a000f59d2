"""The plan of a tip's motion: joints by inverse kinematics at equal steps, a smooth curve through them.

The joints' curve has four continuous derivatives and lies within the hull of its control points, as its speed does
within that of their differences; both are held within the limits. Of a tip in the world the base takes exactly what the
arm leaves (:mod:`skyarm.reference.tip_motion`); of a tip that is relative to the base the arm has to do all of it, and
where it cannot, :mod:`skyarm.reference.feasibility` says how far it stays behind.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from skyarm.algebra import Mat3, Vec3
from skyarm.dynamics.kinematics import frame_pose
from skyarm.dynamics.workspace import reach
from skyarm.reference.inverse_kinematics import EXACT, SMOOTH, ArmTask, follow
from skyarm.reference.polynomials import interpolating_points, uniform_curve
from skyarm.reference.signals import Constant, Signal
from skyarm.reference.tip_motion import TipMotion, arm_of
from skyarm.reference.trajectory import Trajectory
from skyarm.vehicle.vehicle_records import Vehicle

BEYOND = 14
"""Samples before the start and after the end of a flight: what the curve's ends do not know has died down over them."""

MOST_SAMPLES = 4000

MARGIN = 1e-3
"""rad or m that a plan keeps from a joint's limits."""


@dataclass(frozen=True, kw_only=True, slots=True)
class TipChoices:
    """How the motion of a tip is shared.

    Attributes:
        posture: joints that the arm prefers, rad or m.
        base_share: from 0 to 1, how much of a tip's way in the world the base takes; the arm takes the rest.
        arm_range: m, that the arm moves its tip at most for that.
        joint_speed: rad/s or m/s, the largest of a plan.
        orientation: roll, pitch and yaw (ZYX) of the tip in the world, or relative to the base; None for any.
        rate: Hz of the plan's samples.
    """

    posture: tuple[float, ...]
    base_share: float = 1.0
    arm_range: float = 0.1
    joint_speed: float = 2.0
    orientation: tuple[Signal, Signal, Signal] | None = None
    rate: float = 10.0


def plan(vehicle: Vehicle, tip: TipMotion, yaw: Signal, choices: TipChoices, duration: float) -> tuple[Signal, ...]:
    """Signals of all joints of a vehicle whose tip follows a motion for ``duration`` s.

    Raises:
        ValueError: more samples than a plan may have.
    """
    needed = tip.relative or choices.base_share < 1.0
    if not needed and choices.orientation is None:
        return tuple(Constant(q) for q in choices.posture)
    step = 1.0 / choices.rate
    count = math.ceil(duration * choices.rate) + 1
    if count > MOST_SAMPLES:
        raise ValueError(
            f"rate = {choices.rate!r}: makes {count} samples of {duration:g} s, must be at most {MOST_SAMPLES}"
        )
    times = (np.arange(-BEYOND, count + BEYOND) * step).tolist()
    task = task_of(vehicle, tip.arm.carriers, choices, exact=tip.relative or choices.orientation is not None)
    headings = [float(yaw.derivatives(t)[0]) for t in times]
    positions = _arm_goals(task, tip, choices, times, headings) if needed else None
    turns = None
    if choices.orientation is not None:
        turns = [
            (Mat3.identity() if tip.relative else _heading(-h))
            @ _turn(*(float(s.derivatives(t)[0]) for s in choices.orientation))
            for t, h in zip(times, headings, strict=True)
        ]
    samples = follow(task, positions, turns, step)
    carriers = set(tip.arm.carriers)
    found: list[Signal] = []
    for i, low, high in zip(range(vehicle.n), task.lower, task.upper, strict=True):
        if i not in carriers:
            found.append(Constant(choices.posture[i]))
            continue
        points = interpolating_points([row[i] for row in samples])[BEYOND - 2 : len(times) - BEYOND + 2]
        found.append(uniform_curve(_held_within(points, low, high, choices.joint_speed * step), 0.0, step))
    return tuple(found)


def _held_within(points: Sequence[float], low: float, high: float, most: float) -> list[float]:
    """Control points within limits, none further than ``most`` from the one before: so are the curve and its speed."""
    found: list[float] = []
    for point in points:
        within = min(max(point, low), high)
        found.append(min(max(within, found[-1] - most), found[-1] + most) if found else within)
    return found


def task_of(vehicle: Vehicle, carriers: tuple[int, ...], choices: TipChoices, *, exact: bool = True) -> ArmTask:
    """What inverse kinematics are told of a vehicle's arm; ``exact`` where nothing else moves the tip."""
    length = max(float(reach(vehicle)), 1e-3)
    limits = [(float(link.joint.lower), float(link.joint.upper)) for link in vehicle.links]
    kept = [(low + min(MARGIN, 0.1 * (high - low)), high - min(MARGIN, 0.1 * (high - low))) for low, high in limits]
    return ArmTask(
        vehicle=vehicle,
        frame=vehicle.frame(vehicle.end_effector),
        carriers=carriers,
        posture=choices.posture,
        lower=tuple(low for low, _ in kept),
        upper=tuple(high for _, high in kept),
        rates=(choices.joint_speed,) * vehicle.n,
        length=length,
        ease=length * (EXACT if exact else SMOOTH),
    )


def _arm_goals(
    task: ArmTask, tip: TipMotion, choices: TipChoices, times: Sequence[float], headings: Sequence[float]
) -> list[Vec3]:
    """Where the arm is to put the tip, base axes, at each instant."""
    paths = [tip.path(t)[0] for t in times]
    if tip.relative:
        return paths
    start, home = tip.path(0.0)[0], frame_pose(task.vehicle, task.frame, choices.posture).p
    found = []
    for p, heading in zip(paths, headings, strict=True):
        way = _heading(-heading).apply(p - start) * (1.0 - choices.base_share)
        length = float(way.norm()) / choices.arm_range
        found.append(home + way * (1.0 / math.sqrt(1.0 + length * length)))
    return found


def _heading(angle: float) -> Mat3:
    return _turn(0.0, 0.0, angle)


def _turn(roll: float, pitch: float, yaw: float) -> Mat3:
    """Rotation R_z(yaw) R_y(pitch) R_x(roll)."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(a), math.sin(a)) for a in (roll, pitch, yaw))
    return Mat3.columns(
        Vec3(cy * cp, sy * cp, -sp),
        Vec3(cy * sp * sr - sy * cr, sy * sp * sr + cy * cr, cp * sr),
        Vec3(cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr),
    )


def with_tip(
    base: Trajectory, vehicle: Vehicle, path: Trajectory, choices: TipChoices, duration: float, *, relative: bool
) -> Trajectory:
    """The trajectory whose tip follows the path of another one's base.

    Args:
        base: heading, and for a relative tip the motion of the base.
        vehicle: whose arm carries the tip.
        path: x, y, z of the tip.
        choices: how its motion is shared.
        duration: s, for which it is planned.
        relative: whether the path is relative to the base.
    """
    tip = TipMotion(x=path.x, y=path.y, z=path.z, arm=arm_of(vehicle), relative=relative)
    return dataclasses.replace(base, joints=plan(vehicle, tip, base.yaw, choices, duration), tip=tip)
