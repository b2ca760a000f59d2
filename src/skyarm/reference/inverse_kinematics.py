"""Joints that put the tip where it is wanted, instant after instant: inverse kinematics of the arm below a level base.

The joints are those of the least |e|^2 + s^2 |q - q_p|^2, with the error e of the tip's position (and, as a length, of
its orientation), the posture q_p and a small length s. The posture takes what is redundant, and where a goal is out of
reach or the arm stretched, the smallest sum is still one place, which moves smoothly with the goal. It is sought by
damped steps that are taken only where the sum falls; a joint at its limit or at its largest rate stays there and the
others go on without it.
Sources: Levenberg 1944, Marquardt 1963 (damped least squares); Wampler 1986 (of arms).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from skyarm.algebra import ZERO3, Mat3, Motion, Vec3, ldl_solve
from skyarm.dynamics.kinematics import Pose, link_poses
from skyarm.vehicle.vehicle_records import Frame, Vehicle

FIRST_STEPS, STEPS = 100, 40
"""Most steps of the first instant, and of a later one, which starts near; the next instant goes on from there."""

ENOUGH = 1e-8
"""rad or m: a step shorter than this ends the search."""

DAMPING, EASIER, HARDER = 1e-6, 0.2, 6.0
"""First damping, of the squared length of the arm; what a step leaves of it, and what one that is not taken makes."""

EXACT, SMOOTH = 5e-4, 0.03
"""s over the arm's length: of a tip that nothing else moves, and of one whose base takes what the arm leaves."""


@dataclass(frozen=True, kw_only=True, slots=True)
class ArmTask:
    """What inverse kinematics are told of an arm.

    Attributes:
        vehicle, frame: whose tip. carriers: joints that carry it. posture: joints that it prefers.
        lower, upper: limits of the joints. rates: their largest speeds, per second.
        length: m, that weighs a radian of orientation.
        ease: m, that weighs a radian or metre away from the posture.
    """

    vehicle: Vehicle
    frame: Frame
    carriers: tuple[int, ...]
    posture: tuple[float, ...]
    lower: tuple[float, ...]
    upper: tuple[float, ...]
    rates: tuple[float, ...]
    length: float
    ease: float


def follow(
    task: ArmTask, positions: Sequence[Vec3] | None, orientations: Sequence[Mat3] | None, step: float
) -> list[list[float]]:
    """Joints at each instant of a motion of the tip.

    Args:
        task: the arm.
        positions: of the tip, base axes, m; None where any will do.
        orientations: R_BT; None where any will do.
        step: s between instants.

    Returns:
        Joints of the whole vehicle, one list an instant.
    """
    count = len(positions if positions is not None else orientations or ())
    found: list[list[float]] = []
    q = [min(max(p, low), high) for p, low, high in zip(task.posture, task.lower, task.upper, strict=True)]
    for k in range(count):
        low, high = list(task.lower), list(task.upper)
        if k:
            low = [max(a, x - r * step) for a, x, r in zip(low, q, task.rates, strict=True)]
            high = [min(a, x + r * step) for a, x, r in zip(high, q, task.rates, strict=True)]
        p = None if positions is None else positions[k]
        turn = None if orientations is None else orientations[k]
        q = reach(task, p, turn, q, low, high, STEPS if k else FIRST_STEPS)
        found.append(q)
    return found


def reach(
    task: ArmTask,
    position: Vec3 | None,
    orientation: Mat3 | None,
    start: Sequence[float],
    lower: Sequence[float],
    upper: Sequence[float],
    steps: int = FIRST_STEPS,
) -> list[float]:
    """Joints within bounds that put the tip nearest to a pose, sought from ``start`` on."""
    q, damping = list(start), DAMPING * task.length * task.length
    rows, errors = _errors(task, q, position, orientation)
    cost = _cost(task, q, errors)
    for _ in range(steps):
        held: set[int] = set()
        while True:
            dq = _step(task, q, rows, errors, held, damping)
            past = {
                i for i, d in enumerate(dq) if (q[i] <= lower[i] and d < 0.0) or (q[i] >= upper[i] and d > 0.0)
            } - held
            if not past:
                break
            held |= past
        new = [min(max(x + d, a), b) for x, d, a, b in zip(q, dq, lower, upper, strict=True)]
        tried = _errors(task, new, position, orientation)
        found = _cost(task, new, tried[1])
        moved = max((abs(a - b) for a, b in zip(new, q, strict=True)), default=0.0)
        if found <= cost:
            q, cost, (rows, errors), damping = new, found, tried, damping * EASIER
        else:
            damping *= HARDER
        if moved < ENOUGH:
            break
    return q


def _cost(task: ArmTask, q: Sequence[float], errors: Sequence[float]) -> float:
    away = sum((q[i] - task.posture[i]) ** 2 for i in task.carriers)
    return sum(e * e for e in errors) + task.ease * task.ease * away


def _errors(
    task: ArmTask, q: Sequence[float], position: Vec3 | None, orientation: Mat3 | None
) -> tuple[list[list[float]], list[float]]:
    """Rows of the Jacobian and what is missing, m."""
    poses = link_poses(task.vehicle, q)
    pose = poses[task.frame.link] @ Pose(task.frame.rotation, task.frame.position)
    columns = _columns(task, poses, pose.p)
    rows: list[list[float]] = []
    errors: list[float] = []
    if position is not None:
        errors += [float(c) for c in position - pose.p]
        rows += [[float(tuple(column.linear)[axis]) for column in columns] for axis in range(3)]
    if orientation is not None:
        turn = rotation_vector(orientation @ pose.R.T)
        errors += [task.length * float(c) for c in turn]
        rows += [[task.length * float(tuple(column.angular)[axis]) for column in columns] for axis in range(3)]
    return rows, errors


def _columns(task: ArmTask, poses: Sequence[Pose], tip: Vec3) -> list[Motion]:
    """Angular and linear velocity of the tip per unit of each joint rate, base axes."""
    found = [Motion(ZERO3, ZERO3)] * len(task.posture)
    for i in task.carriers:
        joint = task.vehicle.links[i].joint
        axis = poses[i].R.apply(joint.axis)
        found[i] = Motion(axis, axis.cross(tip - poses[i].p)) if joint.kind == "revolute" else Motion(ZERO3, axis)
    return found


def _step(
    task: ArmTask,
    q: Sequence[float],
    rows: Sequence[Sequence[float]],
    errors: Sequence[float],
    held: set[int],
    damping: float,
) -> list[float]:
    """One damped step of the joints that are not held."""
    free = [i for i in task.carriers if i not in held]
    own = task.ease * task.ease
    J = [[row[i] for i in free] for row in rows]
    A = [
        [sum(row[a] * row[b] for row in J) + (own + damping) * (a == b) for b in range(len(free))]
        for a in range(len(free))
    ]
    b = [
        sum(row[a] * e for row, e in zip(J, errors, strict=True)) + own * (task.posture[i] - q[i])
        for a, i in enumerate(free)
    ]
    dq = [0.0] * len(q)
    for i, x in zip(free, ldl_solve(A, b), strict=True):
        dq[i] = float(x)
    return dq


def rotation_vector(R: Mat3) -> Vec3:
    """Axis times angle (rad) of a rotation, up to half a turn."""
    (a, b, c), (d, e, f), (g, h, i) = (tuple(float(x) for x in row) for row in R.rows)
    twice = Vec3(h - f, c - g, d - b)
    sine, cosine = 0.5 * float(twice.norm()), 0.5 * (a + e + i - 1.0)
    if sine > 1e-9:
        return twice * (0.5 * math.atan2(sine, cosine) / sine)
    if cosine > 0.0:
        return twice * 0.5
    # half a turn: the axis is the longest column of R + 1
    columns = (Vec3(a + 1.0, d, g), Vec3(b, e + 1.0, h), Vec3(c, f, i + 1.0))
    axis = max(columns, key=lambda column: float(column.norm()))
    return axis * (math.pi / float(axis.norm()))
