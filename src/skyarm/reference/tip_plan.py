"""Tip motion planning: inverse kinematics of the arm below a level base, and smooth
joint trajectories.

The joints are those of the least |e|^2 + s^2 |q - q_p|^2, with the error e of the tip's
position (and, as a length, of its orientation), the posture q_p and a small length s.
The posture takes what is redundant, and where a goal is out of reach or the arm
stretched, the smallest sum is still one place, which moves smoothly with the goal. It
is sought by damped steps that are taken only where the sum falls; a joint at its limit
or at its largest rate stays there and the others go on without it.
Sources: Levenberg 1944, Marquardt 1963 (damped least squares); Wampler 1986 (of arms).

The joints' curve has four continuous derivatives and lies within the hull of its
control points, as its speed does within that of their differences; both are held within
the limits. The base takes exactly what the arm leaves
(:mod:`skyarm.reference.tip_motion`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated

import numpy as np

from skyarm.algebra import Mat3, Vec3, ldl_solve
from skyarm.algebra.quaternion import euler_rotation
from skyarm.dynamics.kinematics import frame_pose, jacobian_columns
from skyarm.dynamics.workspace import middle_position, reach
from skyarm.records.field_rules import accept_fields
from skyarm.records.files import Fields, errors_as
from skyarm.records.immutable import immutable
from skyarm.records.read_table import record_from
from skyarm.records.units import Unit, nonnegative
from skyarm.reference.phases import with_joint_moves
from skyarm.reference.signal_tables import SignalList
from skyarm.reference.signals import Constant, Signal
from skyarm.reference.splines import BEYOND, interpolating_points, uniform_curve
from skyarm.reference.task_records import Setting
from skyarm.reference.tip_motion import TipMotion, arm_of
from skyarm.reference.trajectory import Trajectory
from skyarm.vehicle import Frame, Vehicle

FIRST_STEPS, STEPS = 100, 40
"""Largest number of search steps at the first instant, and at a later one, which starts
from the previous solution; chosen. What is left after them is the start of the next
instant."""

ENOUGH = 1e-8
"""Step (rad or m) below which the search ends: far below what encoders resolve."""

DAMPING, EASIER, HARDER = 1e-6, 0.2, 6.0
"""Initial damping over the arm's squared length; its factors after an accepted and
after a rejected step. Chosen: one accepted step takes back most of a
rejected one."""

EXACT, SMOOTH = 5e-4, 0.03
"""Weights of a deviation (rad or m) from the posture, over the arm's length: for a tip
with a desired orientation, and for one whose base takes the remainder of the
displacement.

Chosen. Of 40 poses of ``hexarotor_arm6`` the tip is within 0.06 mm with the first, 0.15
mm with four times it. On a way of ``hummingbird_arm2_rotors`` to its full stretch the
second leaves 0.5 mm to the base half-way, and joints accelerate by 236 rad/s^2 at most;
0.1 mm and 252 rad/s^2 with half of it, 2 mm and 188 with twice (measured)."""


@immutable
class ArmTask:
    """Inverse kinematics problem of an arm.

    Attributes:
        vehicle, frame: vehicle and frame of the tip. carriers: joints that carry it.
            posture: preferred joints.
        lower, upper: limits of the joints. rates: their largest speeds, per second.
        length: weight of a radian of orientation, m.
        ease: weight of a radian or metre away from the posture, m.
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
    task: ArmTask,
    positions: Sequence[Vec3] | None,
    orientations: Sequence[Mat3] | None,
    step: float,
) -> list[list[float]]:
    """Joint positions at every sample of a tip motion, by inverse kinematics.

    Args:
        task: inverse kinematics problem of the arm.
        positions: positions of the tip, base axes, m; None where any will do.
        orientations: R_BT; None where any will do.
        step: time between instants, s.

    Returns:
        Joints of the whole vehicle, one list an instant.
    """
    count = len(positions if positions is not None else orientations or ())
    rows: list[list[float]] = []
    # the posture may be beyond a limit by the margin that plans keep
    q = [
        min(max(p, low), high)
        for p, low, high in zip(task.posture, task.lower, task.upper, strict=True)
    ]
    for k in range(count):
        low, high = list(task.lower), list(task.upper)
        # from the second instant on joints also keep to their largest rates
        if k:
            low = [
                max(a, x - r * step) for a, x, r in zip(low, q, task.rates, strict=True)
            ]
            high = [
                min(a, x + r * step)
                for a, x, r in zip(high, q, task.rates, strict=True)
            ]
        p = None if positions is None else positions[k]
        turn = None if orientations is None else orientations[k]
        q = solve_pose(task, p, turn, q, low, high, STEPS if k else FIRST_STEPS)
        rows.append(q)
    return rows


def solve_pose(
    task: ArmTask,
    position: Vec3 | None,
    orientation: Mat3 | None,
    start: Sequence[float],
    lower: Sequence[float],
    upper: Sequence[float],
    steps: int = FIRST_STEPS,
) -> list[float]:
    """Joint positions within bounds that bring the tip nearest to a pose, by damped
    least squares.
    """
    q = list(start)
    damping = DAMPING * task.length * task.length
    rows, errors = _errors(task, q, position, orientation)
    cost = _cost(task, q, errors)
    for _ in range(steps):
        still: set[int] = set()
        while True:
            dq = _step(task, q, rows, errors, still, damping)
            past = {
                i
                for i, d in enumerate(dq)
                if (q[i] <= lower[i] and d < 0.0) or (q[i] >= upper[i] and d > 0.0)
            } - still
            if not past:
                break
            # without those at a bound the step is another, and may pass further ones
            still |= past
        new = [
            min(max(x + d, a), b)
            for x, d, a, b in zip(q, dq, lower, upper, strict=True)
        ]
        tried = _errors(task, new, position, orientation)
        new_cost = _cost(task, new, tried[1])
        moved = max((abs(a - b) for a, b in zip(new, q, strict=True)), default=0.0)
        # as good counts, too: at the bottom of the sum steps hardly change it
        if new_cost <= cost:
            q, cost = new, new_cost
            rows, errors = tried
            damping *= EASIER
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
    """Jacobian and error (m) of the tip pose, with rotations multiplied by a length."""
    pose = frame_pose(task.vehicle, task.frame, q)
    columns = jacobian_columns(task.vehicle, task.frame, q)
    rows: list[list[float]] = []
    errors: list[float] = []
    if position is not None:
        errors += [float(c) for c in position - pose.p]
        rows += [
            [float(column.linear[axis]) for column in columns] for axis in range(3)
        ]
    if orientation is not None:
        turn = rotation_vector(orientation @ pose.R.T)
        errors += [task.length * float(c) for c in turn]
        rows += [
            [task.length * float(column.angular[axis]) for column in columns]
            for axis in range(3)
        ]
    return rows, errors


def _step(
    task: ArmTask,
    q: Sequence[float],
    rows: Sequence[Sequence[float]],
    errors: Sequence[float],
    still: set[int],
    damping: float,
) -> list[float]:
    """Damped least-squares increment of the joint positions, with joints at a bound
    held fixed.
    """
    free = [i for i in task.carriers if i not in still]
    # the posture's weight is part of the sum; damping acts on the step alone
    own = task.ease * task.ease
    J = [[row[i] for i in free] for row in rows]
    A = [
        [
            sum(row[a] * row[b] for row in J) + (own + damping) * (a == b)
            for b in range(len(free))
        ]
        for a in range(len(free))
    ]
    b = [
        sum(row[a] * e for row, e in zip(J, errors, strict=True))
        + own * (task.posture[i] - q[i])
        for a, i in enumerate(free)
    ]
    dq = [0.0] * len(q)
    for i, x in zip(free, ldl_solve(A, b), strict=True):
        dq[i] = float(x)
    return dq


def rotation_vector(R: Mat3) -> Vec3:
    """Rotation vector (rad) of a rotation matrix, up to half a turn."""
    (a, b, c), (d, e, f), (g, h, i) = (tuple(map(float, row)) for row in R.rows)
    twice = Vec3(h - f, c - g, d - b)
    sine, cosine = 0.5 * float(twice.norm()), 0.5 * (a + e + i - 1.0)
    # below that the axis is rounding; next to no turn the vector is the sine's
    if sine > 1e-9:
        return twice * (0.5 * math.atan2(sine, cosine) / sine)
    if cosine > 0.0:
        return twice * 0.5
    # half a turn: the axis is the longest column of R + 1
    columns = (Vec3(a + 1.0, d, g), Vec3(b, e + 1.0, h), Vec3(c, f, i + 1.0))
    axis = max(columns, key=lambda column: float(column.norm()))
    return axis * (math.pi / float(axis.norm()))


# a plan of as many takes 18 s with two joints, 140 s with six
MOST_SAMPLES = 4000

MARGIN = 1e-3
"""Distance (rad or m) that a plan keeps from joint limits; chosen, for errors of the
joints."""


@immutable
class TipChoices:
    """Options for a tip trajectory: posture of the arm, fraction of the motion by the
    base, and speed limits.

    Attributes:
        posture: joint positions that the arm prefers, rad or m.
        base_share: share of a tip's way in the world that the base takes, 0 to 1; the
            arm takes the rest.
        arm_range: largest way of the tip by the arm for that, m.
        joint_speed: largest joint speed of a plan, rad/s or m/s.
        orientation: roll, pitch and yaw (ZYX) of the tip in the world; None for any.
        rate: rate of the plan's samples, Hz.
    """

    posture: Annotated[
        tuple[float, ...], Unit("rad or m", "preferred position of each joint")
    ] = ()
    base_share: Annotated[
        float,
        nonnegative(
            "",
            "fraction of the tip's displacement that the base takes",
            high=1.0,
            effect="higher values move the base more and the arm less",
        ),
    ] = 1.0
    arm_range: Annotated[
        float,
        Unit(
            "m",
            "largest displacement of the tip that the arm takes",
            low=1e-3,
            high=1e6,
        ),
    ] = 0.1
    joint_speed: Annotated[
        float,
        Unit(
            "rad/s or m/s",
            "largest joint speed of a plan",
            low=1e-3,
            high=1e6,
            effect="lower values plan slower motions of the arm",
        ),
    ] = 2.0
    orientation: SignalList | None = None
    rate: Annotated[
        float,
        Unit(
            "Hz",
            "sampling rate of the plan",
            low=1e-3,
            high=1e6,
            effect="higher values follow the path more closely and make larger plans",
        ),
    ] = 10.0

    def __post_init__(self) -> None:
        accept_fields(self, "")
        if self.orientation is not None and len(self.orientation.signals) != 3:
            said = f"{len(self.orientation.signals)} signals"
            raise ValueError(
                f"orientation = {said}: must be three signals: roll, pitch, yaw"
            )


def plan(
    vehicle: Vehicle,
    tip: TipMotion,
    yaw: Signal,
    choices: TipChoices,
    duration: float,
    turned: tuple[Signal, ...] = (),
) -> tuple[Signal, ...]:
    """Joint signals with which the tip of a vehicle follows a motion for ``duration``
    seconds.

    ``turned`` are roll, pitch and yaw of a body that turns the tip along, from its
    attitude at the beginning.

    Raises:
        ValueError: more samples than a plan may have.
    """
    needed = choices.base_share < 1.0
    angles = turned if choices.orientation is None else choices.orientation.signals
    if not (needed or angles):
        return tuple(map(Constant, choices.posture))
    step = 1.0 / choices.rate
    count = math.ceil(duration * choices.rate) + 1
    if count > MOST_SAMPLES:
        raise ValueError(
            f"rate = {choices.rate!r}: makes {count} samples of {duration:g} s, must be"
            f" at most {MOST_SAMPLES}"
        )
    # effects of the curve's ends decay outside of the flight
    times = (np.arange(-BEYOND, count + BEYOND) * step).tolist()
    task = task_of(
        vehicle, tip.arm.carriers, choices, exact=choices.orientation is not None
    )
    headings = [float(yaw.derivatives(t)[0]) for t in times]
    positions = _arm_goals(task, tip, choices, times, headings) if needed else None
    turns = None
    if angles:
        turns = [
            _heading(-h) @ _turn(*(float(each.derivatives(t)[0]) for each in angles))
            for t, h in zip(times, headings, strict=True)
        ]
    # a tip that is turned along keeps its angles to the body, from the posture on
    if turns and choices.orientation is None:
        home = turns[BEYOND].T @ frame_pose(vehicle, task.frame, choices.posture).R
        turns = [each @ home for each in turns]
    samples = follow(task, positions, turns, step)
    carriers = set(tip.arm.carriers)
    signals: list[Signal] = []
    for i, low, high in zip(range(vehicle.n), task.lower, task.upper, strict=True):
        if i not in carriers:
            signals.append(Constant(choices.posture[i]))
            continue
        points = interpolating_points([row[i] for row in samples])
        # two points beyond either end bear on the curve within
        points = points[BEYOND - 2 : len(times) - BEYOND + 2]
        held = _held_within(points, low, high, choices.joint_speed * step)
        signals.append(uniform_curve(held, 0.0, step))
    return tuple(signals)


def _held_within(
    points: Sequence[float], low: float, high: float, most: float
) -> list[float]:
    """Spline control points clipped to joint limits and to the largest increment per
    step.
    """
    clipped: list[float] = []
    for point in points:
        # the rate last: between two points within the limits there is no other
        within = min(max(point, low), high)
        clipped.append(
            min(max(within, clipped[-1] - most), clipped[-1] + most)
            if clipped
            else within
        )
    return clipped


def task_of(
    vehicle: Vehicle,
    carriers: tuple[int, ...],
    choices: TipChoices,
    *,
    exact: bool = True,
) -> ArmTask:
    """Inverse kinematics problem of a vehicle's arm, with joint limits, speeds and
    preferred posture.
    """
    # a weight of 0 would leave the normal equations without a solution
    length = max(float(reach(vehicle)), 1e-3)
    limits = [joint.ends for joint in vehicle.joints]
    # of a joint with hardly any range a tenth at each end
    margins = [min(MARGIN, 0.1 * (high - low)) for low, high in limits]
    return ArmTask(
        vehicle=vehicle,
        frame=vehicle.frame(),
        carriers=carriers,
        posture=choices.posture,
        lower=tuple(low + m for (low, _), m in zip(limits, margins, strict=True)),
        upper=tuple(high - m for (_, high), m in zip(limits, margins, strict=True)),
        rates=(choices.joint_speed,) * vehicle.n,
        length=length,
        ease=length * (EXACT if exact else SMOOTH),
    )


def _arm_goals(
    task: ArmTask,
    tip: TipMotion,
    choices: TipChoices,
    times: Sequence[float],
    headings: Sequence[float],
) -> list[Vec3]:
    """Desired tip positions in base axes (m) at given times."""
    start = tip.path(0.0)[0]
    home = frame_pose(task.vehicle, task.frame, choices.posture).p
    goals = []
    for t, heading in zip(times, headings, strict=True):
        way = _heading(-heading).apply(tip.path(t)[0] - start) * (
            1.0 - choices.base_share
        )
        length = float(way.norm()) / choices.arm_range
        # saturates smoothly at the arm's range; a clip would have a corner in the path
        goals.append(home + way * (1.0 / math.sqrt(1.0 + length * length)))
    return goals


def _heading(angle: float) -> Mat3:
    return _turn(0.0, 0.0, angle)


def _turn(*angles: float) -> Mat3:
    """Rotation matrix R_z(yaw) R_y(pitch) R_x(roll) of roll, pitch and yaw."""
    return euler_rotation(tuple(map(math.sin, angles)), tuple(map(math.cos, angles)))


def tip_trajectory(
    fields: Fields,
    base: Trajectory,
    path: Trajectory,
    vehicle: Vehicle,
    setting: Setting,
) -> Trajectory:
    """Trajectory of base and joints whose tip follows a given path.

    Args:
        fields: table ``tip`` of the reference.
        base: trajectory with the heading.
        path: trajectory of the tip, x, y, z.
        vehicle: vehicle whose arm carries the tip.
        setting: flight data.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    choices = record_from(TipChoices, fields)
    choices = replace(choices, posture=_posture(choices.posture, vehicle, fields))
    tip = TipMotion(x=path.x, y=path.y, z=path.z, arm=arm_of(vehicle))
    with errors_as(ValueError, f"{fields.where}."):
        joints = plan(vehicle, tip, base.yaw, choices, setting.duration, setting.turned)
    planned = replace(
        base,
        joints=joints,
        tip=tip,
        guards=setting.all_guards,
        phases=setting.all_phases,
    )
    return with_joint_moves(planned, setting.joint_moves, vehicle, choices.joint_speed)


def _posture(
    given: tuple[float, ...], vehicle: Vehicle, fields: Fields
) -> tuple[float, ...]:
    """Preferred joint positions of the arm within their limits; mid-range if none are
    given.
    """
    bounds = [joint.ends for joint in vehicle.joints]
    if not given and "posture" not in fields.table:
        return tuple(map(middle_position, vehicle.joints))
    if len(given) != vehicle.n:
        raise ValueError(
            f"{fields.at('posture')} = {len(given)} numbers: must be one for each of"
            f" {vehicle.n} joints"
        )
    for i, (q, (low, high), link) in enumerate(
        zip(given, bounds, vehicle.links, strict=True)
    ):
        if not low <= q <= high:
            name = link.joint.name
            raise ValueError(
                f"{fields.at('posture')}[{i}] = {q:g}: must be within {low:g} and"
                f" {high:g} of {name!r}"
            )
    return given
