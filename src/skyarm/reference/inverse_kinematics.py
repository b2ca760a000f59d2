"""Joints that put the tip where it is wanted, instant after instant: inverse kinematics of the arm below a level base.

One step solves (J^T J + (|e|^2 / 2 + d) I) dq = J^T e with the error e of the tip's position (and, as a length, of its
orientation): the damping is large where the goal is out of reach and vanishes with the error, so that singularities
neither stop nor throw the arm. What is redundant goes to the posture; a joint at its limit or at its largest rate
stays there and the others go on without it.
Sources: Sugihara 2011 (damping by the error); Liegeois 1977 (posture in the null space).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from skyarm.algebra import ZERO3, Mat3, Motion, Vec3, ldl_solve
from skyarm.dynamics.kinematics import Pose, link_poses
from skyarm.vehicle.vehicle_records import Frame, Vehicle

FIRST_STEPS, STEPS = 100, 8
"""Most steps of the first instant, and of a later one, which starts near; the next instant goes on from there."""

ENOUGH = 1e-8
"""rad or m: a step shorter than this ends the search."""

LEAST_DAMPING = 1e-6
"""Of the squared length of the arm: leaves 1e-6 of an error where the Jacobian is as long as the arm."""

PULL, NEAR = 0.5, 1e-2
"""Share of the way back to the posture that a step takes, and the error over the arm's length at which it is half that:
what is out of reach is approached first.
"""


@dataclass(frozen=True, kw_only=True, slots=True)
class ArmTask:
    """What inverse kinematics are told of an arm.

    Attributes:
        vehicle, frame: whose tip. carriers: joints that carry it. posture: joints that it prefers.
        lower, upper: limits of the joints. rates: their largest speeds, per second.
        length: m, that weighs a radian of orientation.
    """

    vehicle: Vehicle
    frame: Frame
    carriers: tuple[int, ...]
    posture: tuple[float, ...]
    lower: tuple[float, ...]
    upper: tuple[float, ...]
    rates: tuple[float, ...]
    length: float


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
    q = list(start)
    for _ in range(steps):
        rows, errors = _errors(task, q, position, orientation)
        held: set[int] = set()
        while True:
            dq = _step(task, q, rows, errors, held)
            past = {
                i for i, d in enumerate(dq) if (q[i] <= lower[i] and d < 0.0) or (q[i] >= upper[i] and d > 0.0)
            } - held
            if not past:
                break
            held |= past
        new = [min(max(x + d, a), b) for x, d, a, b in zip(q, dq, lower, upper, strict=True)]
        moved = max((abs(a - b) for a, b in zip(new, q, strict=True)), default=0.0)
        q = new
        if moved < ENOUGH:
            break
    return q


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
    task: ArmTask, q: Sequence[float], rows: Sequence[Sequence[float]], errors: Sequence[float], held: set[int]
) -> list[float]:
    """One damped step, and with what it leaves free one towards the posture."""
    free = [i for i in task.carriers if i not in held]
    square = sum(e * e for e in errors)
    damping = 0.5 * square + LEAST_DAMPING * task.length * task.length
    pull = PULL / (1.0 + square / (NEAR * task.length) ** 2)
    J = [[row[i] for i in free] for row in rows]
    back = [pull * (task.posture[i] - q[i]) for i in free]
    A = [[sum(row[a] * row[b] for row in J) + damping * (a == b) for b in range(len(free))] for a in range(len(free))]
    left = [e - sum(c * w for c, w in zip(row, back, strict=True)) for row, e in zip(J, errors, strict=True)]
    b = [sum(row[a] * e for row, e in zip(J, left, strict=True)) for a in range(len(free))]
    dq = [0.0] * len(q)
    for i, x, w in zip(free, ldl_solve(A, b), back, strict=True):
        dq[i] = float(x) + w
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
