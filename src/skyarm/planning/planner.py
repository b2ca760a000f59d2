"""Plan of a task: stages and seeds from its phases, the best of several solutions, and
what is tight in it.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
import re
import time
from collections.abc import Callable, Collection, Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from skyarm.algebra import ZERO3_DATA, Quaternion, Vec3
from skyarm.algebra.frames import continuous, unit_rows
from skyarm.control.model import Model
from skyarm.dynamics import frame_pose
from skyarm.dynamics.actuators.hover import highest_thrust, hover_trim
from skyarm.dynamics.state import example_state
from skyarm.planning.seeds import free_distance, ways_around
from skyarm.planning.solver import (
    ITERATIONS,
    TOLERANCE,
    Guess,
    PlanProblem,
    PlanSolver,
    Solution,
)
from skyarm.planning.stage import (
    SPIN_UNIT,
    CompiledStage,
    ObstaclePlace,
    PlanStage,
    StageData,
    largest,
    slices,
)
from skyarm.planning.task import Goal, PlanPhase, Start, Task
from skyarm.records.arrays import (
    Array,
    doubles,
    float_array,
    lengths,
    norm,
    stack_values,
)
from skyarm.records.files import shown
from skyarm.records.immutable import immutable
from skyarm.records.leaves import leaves, parts
from skyarm.world.contact.surface import Surface
from skyarm.world.scene.clearance import Clearances, clearances
from skyarm.world.scene.vehicle_shapes import boom_and_disc

TIME_WEIGHTS = {"effort": 1.0, "time": 30.0}
"""Cost of a second of free time, by what is minimised; chosen. Least effort has a
price of time, too, which decides where slower hardly costs less."""

REACTION = 0.01
"""Time (s) that a law itself takes, two control periods: rotors lag behind what it asks
by this and their own lag."""

JOINT_MARGIN = 0.02
"""Part of a joint's range at each end that a plan leaves to the law, as far as start
and goals do; chosen."""

PENALTIES = (100.0, 10.0, 1000.0)
"""First penalties that are tried, one after the other, while no seed leads to a plan.

Chosen: by another penalty the same seed takes another way, so a softer one and a
stiffer one come after the usual."""

HOLD_STEP = 0.02
"""Time (s) between nodes while the tip rests: it drifts by less than 0.3 mm in 0.2
s."""


SMOOTH_STEP = 0.01
"""Length (s) of the first and the last stage of a free motion between rests, in which
no rotor turns faster.

The plan begins and ends smoothly in them, which laws that follow it need; longer ones
would cost time by their length.
"""


class PlanError(ValueError):
    """Error: no plan within the limits was found; one line with the phase, the
    constraint and how far it is off.
    """


@immutable(eq=False)
class Nearest:
    """Smallest distance between two bodies along a plan.

    Attributes:
        gap: m, of all. time: s. bodies: names of both. apart: from obstacles, m.
            pairs: of own bodies that meet.
        short: which obstacles and own bodies come nearer than the task's clearance, and
            when; empty if none.
        missing: distance (m) from obstacles that each node lacks, of what the task
            says, before and after it.
    """

    gap: float = math.inf
    apart: float = math.inf
    time: float = 0.0
    bodies: str = ""
    pairs: frozenset[tuple[str, str]] = frozenset()
    short: str = ""
    missing: Array | float = 0.0


@immutable(eq=False)
class Plan:
    """Planned motion of one vehicle.

    Attributes:
        task: planned task. t: (N + 1,) s. x: (N + 1, nx) states. u: (N, nu) inputs. K:
            (N, nu, nt) gains.
        edges: node at which each phase begins, and the last. solution: of the solver.
        not_least: why its time is not the least, which was asked for; empty if it is.
    """

    task: Task
    stage: PlanStage
    compiled: CompiledStage
    data: Array
    t: Array
    x: Array
    u: Array
    K: Array
    edges: tuple[int, ...]
    solution: Solution
    seeds: int
    seconds: float = 0.0
    nearest: Nearest = Nearest()
    not_least: str = ""

    @property
    def rotor_speeds(self) -> Array:
        """Rotor speeds (rad/s) at the nodes, (N + 1, rotors)."""
        return np.asarray(self.x[:, self.stage.at.speeds] * self.stage.hover)

    @property
    def thrust_shares(self) -> Array:
        """Thrusts at the nodes over those at the highest speeds, (N + 1, rotors)."""
        most = float_array(rotor.max_speed for rotor in self.task.vehicle.rotors)
        return np.asarray((self.rotor_speeds / most) ** 2)

    @property
    def torques(self) -> Array:
        """Joint torques (N m or N) at the nodes, (N + 1, n)."""
        vehicle, stage = self.task.vehicle, self.stage
        # a limit is the torque over its most, less 1
        limits = self.compiled.values(self.x, self.u, self.data)[0][
            :, self.compiled.limits
        ]
        columns = [
            self.compiled.names.index(f"torque of {joint.name}")
            for joint in vehicle.joints
        ]
        most = [
            largest(joint.effort_limit) * stage.limits.torque_share
            for joint in vehicle.joints
        ]
        return np.asarray((limits[:, columns] + 1.0) * most)

    @property
    def durations(self) -> list[float]:
        """Duration of each phase, s."""
        durations: list[float] = np.diff(self.t[[*self.edges]]).tolist()
        return durations

    @property
    def lags(self) -> Array:
        """Largest lag of a rotor behind its command in each phase, over its speed in
        hover, (phases,).
        """
        rotors = self.task.vehicle.rotors
        times = np.array(
            [
                (float(each.time_constant_up), float(each.time_constant_down))
                for each in rotors
            ]
        ).T
        # each rotor has one lag upwards and one downwards
        spins = self.u[:, : len(rotors)] * SPIN_UNIT
        delays = np.where(spins > 0.0, times[0], times[1]) + REACTION
        worst = np.max(delays * np.abs(spins), axis=1)
        return np.array([worst[a:b].max() for a, b in itertools.pairwise(self.edges)])


# each longer plan of a task has the stage of the one before, so it compiles once; the
# rounds of a plan have five stages at most, and 8 is chosen
@lru_cache(maxsize=8)
def compiled_stage(**fields: Any) -> CompiledStage:
    """Compiled stage with given fields, such as model, limits and shape."""
    return CompiledStage(PlanStage(**fields))


def stage_of(task: Task, met: Collection[tuple[str, str]] = ()) -> CompiledStage:
    """Compiled stage of a task.

    ``met``: pairs of the vehicle's own bodies that count; the plan before went through
    them.
    """
    near = clearances(
        task.vehicle, [placeholder(k, each) for k, each in enumerate(task.obstacles)]
    )
    pairs = [
        pair
        for pair in near.pairs
        if (
            # a boom is thin and ends in hull and disc, which come near before it
            # does: it costs no limit at each node, but nearest_of looks at it, too
            not pair.volume.startswith("boom/")
            if pair.surface is not None
            else (pair.volume, pair.other) in met
        )
    ]
    close = dataclasses.replace(near, pairs=tuple(pairs)) if pairs else None
    return compiled_stage(
        model=Model(vehicle=task.vehicle, gravity=task.gravity),
        # those that are data of a stage, or none of its limits, compile nothing anew
        limits=dataclasses.replace(task.limits, tilt=1.0, clearance=0.0, rotor_lag=1.0),
        ranges=ranges_of(task),
        contact=any(phase.kind == "contact" for phase in task.phases),
        free=sum(phase.duration is None for phase in task.phases),
        clearances=close,
        nearer=nearer_pairs(task, close) if close is not None else (),
    )


def nearer_pairs(task: Task, near: Clearances) -> tuple[float, ...]:
    """Distances (m) by which own bodies may be nearer than the clearance: where start
    or goals have them as near.
    """
    level = attitude((0.0, 0.0, 0.0)).rotation()
    poses = [
        near.distances(task.start.position, level, joints)
        for joints in stated_joints(task)
    ]
    # half of what is there leaves the arm a way out of its pose
    least = [
        0.5 * min(map(float, gaps)) if pair.surface is None else math.inf
        for pair, *gaps in zip(near.pairs, *poses, strict=True)
    ]
    return tuple(max(0.0, task.limits.clearance - max(gap, 0.0)) for gap in least)


def stated_joints(task: Task) -> list[tuple[float, ...]]:
    """Joint positions (rad or m) at the start and of the goals that state them."""
    return [
        task.start.joints or task.vehicle.zeros,
        *(each.to.joints for each in task.phases if each.to.joints),
    ]


def ranges_of(task: Task) -> tuple[tuple[float, float], ...]:
    """Range of each joint (rad or m) without :data:`JOINT_MARGIN`; what start and goals
    say is within it.
    """
    found = []
    for joint, places in zip(
        task.vehicle.joints, zip(*stated_joints(task), strict=True), strict=True
    ):
        low, high = joint.ends
        # a share of an endless range would be endless, too
        margin = JOINT_MARGIN * (high - low) if math.isfinite(high - low) else 0.0
        found.append(
            (
                max(low, min(low + margin, *places)),
                min(high, max(high - margin, *places)),
            )
        )
    return tuple(found)


def placeholder(k: int, obstacle: Surface) -> Surface:
    """Obstacle of the same shape, which one compiled stage serves wherever the
    obstacles stand.
    """
    return Surface(
        name=f"obstacle{k}",
        shape=obstacle.shape,
        # no zeros and no equal sizes, since the trace would take them for structure
        size=tuple(1.0 + 0.1 * i for i, _ in enumerate(obstacle.size)),
        vertices=obstacle.vertices,
        position=Vec3(0.5, 0.25, 0.125),
        angles=Vec3(0.5, 0.25, 0.125),
    )


def obstacle_places(task: Task, stage: CompiledStage) -> tuple[ObstaclePlace, ...]:
    """Obstacles of a task as the data of a compiled stage."""
    return tuple(
        ObstaclePlace.of(task.obstacles[int(each.name.removeprefix("obstacle"))])
        for each in stage.stage.obstacles
    )


def node_counts(task: Task, lengths: Sequence[float]) -> list[int]:
    """Number of stages of each phase."""
    usual = [HOLD_STEP if phase.resting else task.step for phase in task.phases]
    steps = [phase.step or step for phase, step in zip(task.phases, usual, strict=True)]
    # two stages at the ends of a free phase have lengths of their own
    least = [2 if phase.duration else 3 for phase in task.phases]
    rows = zip(lengths, steps, least, strict=True)
    return [max(fewest, round(length / step)) for length, step, fewest in rows]


def attitude(angles: Sequence[float]) -> Quaternion:
    """Quaternion of roll, pitch and yaw (rad)."""
    # not by NumPy's sine and cosine, whose last bit is the processor's
    state = example_state(0, 0).with_views(
        dict(zip(("roll", "pitch", "yaw"), angles, strict=True))
    )
    return state.quaternion


def goal_attitude(goal: Goal) -> Quaternion:
    """Attitude of a goal; level where none is stated, with the heading if that is."""
    return attitude(goal.attitude or (0.0, 0.0, goal.heading or 0.0))


def tip_below(task: Task, joints: Array) -> Array:
    """Position of the tip in base axes, m."""
    vehicle = task.vehicle
    if not vehicle.end_effector:
        return np.zeros(3)
    return float_array(frame_pose(vehicle, vehicle.frame(), tuple(joints.tolist())).p)


@immutable(eq=False)
class Outline:
    """Places of the base at the edges of the phases, and lengths of these: what seeds
    are made of.

    Attributes:
        bases: (phases + 1, 3) m. joints: of each edge. lengths: s.
    """

    bases: Array
    joints: Array
    lengths: list[float]


def outline(task: Task) -> Outline:
    """Straight outline of a task: the base above or below each tip goal, at rest in its
    posture.
    """
    joints = np.array(task.start.joints or task.vehicle.zeros)
    base = float_array(task.start.position)
    bases, postures, lengths = [base], [joints], []
    for phase in task.phases:
        goal = phase.to
        joints = np.array(goal.joints) if goal.joints else joints
        if goal.base is not None:
            base = float_array(goal.base)
        elif goal.tip is not None:
            base = float_array(goal.tip) - tip_below(task, joints)
        # from rest to rest at 6 m/s^2, first faster and then slower; 0.6 s for a phase
        # that only turns or folds. Both are chosen: the solver changes free lengths,
        # but the number of nodes follows from these
        usual = max(0.6, 2.0 * math.sqrt(norm(base - bases[-1]) / 6.0))
        lengths.append(phase.duration or usual)
        bases.append(base)
        postures.append(joints)
    return Outline(bases=np.array(bases), joints=np.array(postures), lengths=lengths)


def problem_of(
    task: Task,
    stage: CompiledStage,
    counts: Sequence[int],
    clearance: Array | float,
) -> PlanProblem:
    """Goals, limits and data of all stages of a task; ``clearance`` (m) of all nodes or
    of each.
    """
    example = dataclasses.replace(
        stage.stage.example(),
        obstacles=obstacle_places(task, stage),
        # half of a squared residual is a cost, so that a second costs the weight
        hurry=math.sqrt(2.0 * TIME_WEIGHTS[task.minimise]),
    )
    total = sum(counts)
    free = itertools.count()
    goals = np.zeros((total + 1, stage.goals.stop - stage.goals.start), dtype=bool)
    limits = np.ones((total + 1, len(stage.names)), dtype=bool)
    # the first state is given, and no input follows the last one
    limits[0, stage.input_limits :] = False
    limits[-1, : stage.input_limits] = False
    heading = stage.names.index("heading")
    endless = {
        f"torque of {each.name}"
        for each in task.vehicle.joints
        if math.isinf(float(each.effort_limit))
    }
    for k, name in enumerate(stage.names):
        # lengths of free phases are the unknowns of the first state
        limits[0, k] |= name.startswith("length of")
        # no input is left at the last node, but for a contact its torque follows from
        # the state
        limits[-1, k] |= (
            name.startswith("torque of") and task.phases[-1].contact is None
        )
        limits[:, k] &= name not in endless
    # without a goal any heading is right; where one is stated, see below
    limits[:, heading] = False
    rows: list[StageData] = []
    edge = 0
    for phase, following, count in zip(
        task.phases, [*task.phases[1:], None], counts, strict=True
    ):
        number = next(free) if phase.duration is None else None
        data = _data(example, phase, count, number, stage.stage.weight)
        rows += [data] * count
        last = edge + count
        for name in goal_names(phase.to):
            goals[last, stage.goal[name]] = True
        limits[last, heading] = phase.to.heading is not None
        if phase.resting:
            # the first state is given, so a goal there could not be met
            goals[edge + (edge == 0) : last + 1, stage.goal["tip_velocity"]] = True
        if phase.contact is not None and phase.contact.kind == "plane":
            # one node is free where the end is stated: else its place would be stated
            # twice
            goals[
                edge + (edge == 0) : last - (phase.to.tip is not None),
                stage.goal["lift"],
            ] = True
            stops = phase.to.rest or phase.to.tip_velocity is not None
            goals[last, stage.goal["lift"]] = not stops and _leaves(following)
        cone = [
            k
            for k, name in enumerate(stage.names)
            if name in ("contact force", "friction")
        ]
        # a bar is held around, so that its force may have any direction
        if cone and (phase.contact is None or phase.contact.kind == "bar"):
            limits[edge:last, cone] = False
        # the motion ends smoothly
        if phase.to.rest:
            goals[last - 1, stage.goal["inputs"]] = True
        edge = last
    # rotors begin without acceleration, which laws that follow a plan need
    goals[0, stage.goal["inputs"]] = True
    table = _stage_table(task, stage, rows, counts, clearance)
    return PlanProblem(data=table, goals=goals, limits=limits)


def _stage_table(
    task: Task,
    stage: CompiledStage,
    rows: Sequence[StageData],
    counts: Sequence[int],
    clearance: Array | float,
) -> Array:
    """Data of all stages (N + 1, leaves of StageData), with the goals at the edges."""
    example = rows[0]
    # goals at an edge have the numbers of the phase that ends there; its tilt is the
    # smaller one of both phases
    table = doubles([leaves(row) for row in (*rows, rows[-1])])
    names = _columns(example)
    table[:, names["upright"]] = NO_TILT
    edge = 0
    table[:, names["clearance"]] = np.reshape(clearance, (-1, 1))
    for phase, following, count in zip(
        task.phases, [*task.phases[1:], None], counts, strict=True
    ):
        span, most = slice(edge, edge + count + 1), phase.tilt or task.limits.tilt
        least = math.cos(most) if most < math.pi else NO_TILT
        table[span, names["upright"]] = np.maximum(table[span, names["upright"]], least)
        if phase.duration is None:
            short = [edge] * (edge == 0) + [edge + count - 1] * phase.to.rest
            # the shares of the other stages still add up to the whole free length
            table[edge : edge + count, names["free"]] *= count / (count - len(short))
            table[short, names["free"]], table[short, names["dt"]] = 0.0, SMOOTH_STEP
        edge += count
        ends = _data(example, phase, count, None, stage.stage.weight)
        # rest is a velocity, too, which the numbers of the next phase must not replace
        kept = ["velocity"] * phase.to.rest + ["tip_velocity"] * phase.resting
        kept += ["normal"] * (phase.contact is not None and _leaves(following))
        for field in (
            "tip",
            "tip_velocity",
            "base",
            "velocity",
            "attitude",
            "axis",
            "joints",
            "normal",
        ):
            if field in kept or _states(phase.to, field):
                table[edge, names[field]] = leaves(getattr(ends, field))
    return table


def _states(goal: Goal, field: str) -> bool:
    """True if a goal states a field of a stage's data."""
    given = {
        "axis": goal.tip_axis,
        "attitude": goal.attitude or goal.heading,
        "joints": goal.joints or None,
    }
    return given.get(field, getattr(goal, field, None)) not in (None, ())


def _leaves(following: PlanPhase | None) -> bool:
    """True if the tip is free behind a contact."""
    return following is None or following.kind == "go"


def _columns(example: StageData) -> dict[str, slice]:
    """Columns of a table of stage data, by field."""
    fields = parts(example)
    sizes = (len(leaves(each)) for each in fields.values())
    return dict(zip(fields, slices(sizes), strict=True))


def goal_names(goal: Goal) -> list[str]:
    """Names in :data:`skyarm.planning.stage.GOALS` of what the goal of a phase states;
    of rest, velocity once more.
    """
    names = [
        name
        for name in ("tip", "tip_velocity", "base", "velocity", "axis", "joints")
        if _states(goal, name)
    ]
    names += ["attitude"] * bool(goal.attitude) + ["heading"] * (
        goal.heading is not None
    )
    if goal.rest:
        names += ["velocity", "rate", "joint_rates", "still", "arm"]
    return names


# below every cosine, so that the limit never acts
NO_TILT = -2.0
"""Least cosine of the tilt where there is no limit."""

LEAST_PRESS = 0.02
"""Least force along the normal of a contact that presses, over the weight: the cone of
friction has no slope at 0."""


def _data(
    example: StageData, phase: PlanPhase, count: int, free: int | None, weight: float
) -> StageData:
    """Numbers of a stage of a phase; ``weight`` of the vehicle, N."""
    goal, contact = phase.to, phase.contact

    def numbers(v: Vec3 | None) -> Vec3:
        """Vector without whole numbers, which would be constants of compiled code."""
        return Vec3(*map(float, v)) if v else ZERO3_DATA

    return dataclasses.replace(
        example,
        dt=0.0 if phase.duration is None else phase.duration / count,
        # the step of a free phase is its length, a state, over its nodes
        free=tuple(1.0 / count if k == free else 0.0 for k in range(len(example.free))),
        tip=numbers(goal.tip),
        tip_velocity=numbers(goal.tip_velocity),
        base=numbers(goal.base),
        velocity=numbers(goal.velocity),
        attitude=goal_attitude(goal),
        axis=numbers(goal.tip_axis),
        joints=tuple(map(float, goal.joints or example.joints)),
        touching=float(contact is not None),
        normal=numbers(contact.normal if contact else None),
        friction=contact.friction if contact else 0.0,
        press=max(contact.force / weight, LEAST_PRESS) if contact else 0.0,
    )


def guess_from(
    task: Task,
    stage: CompiledStage,
    counts: Sequence[int],
    ways: Sequence[Array],
    shape: Outline,
    sense: float = 1.0,
) -> Guess:
    """Seed along given places of the base.

    Args:
        task: the task.
        stage: compiled.
        counts: stages of each phase.
        ways: for each phase the (points, 3) places from its beginning to its end, m.
        shape: of which the joints and lengths are taken.
        sense: 1 turns the short way, -1 the long way round where the attitude changes.
    """
    total, at = sum(counts), stage.stage.at
    x, u = np.zeros((total + 1, stage.nx)), np.zeros((total, stage.nu))
    edges = np.cumsum([0, *counts])
    turned = attitude(task.start.attitude)
    for k, (phase, way) in enumerate(zip(task.phases, ways, strict=True)):
        nodes = np.arange(edges[k], edges[k + 1] + 1)
        length = np.append(0.0, np.cumsum(lengths(np.diff(way, axis=0))))
        part = np.linspace(0.0, 1.0, len(nodes)) * length[-1]
        for axis in range(3):
            x[nodes, axis] = np.interp(part, length, way[:, axis])
        for j in range(task.vehicle.n):
            x[nodes, 13 + j] = np.linspace(
                shape.joints[k, j], shape.joints[k + 1, j], len(nodes)
            )
        after = turned if phase.resting else goal_attitude(phase.to)
        x[nodes, 3:7] = _turning(turned, after, len(nodes), sense)
        # the turn may end at the other sign of the same attitude; the next one begins
        # there
        turned = (
            after
            if x[nodes[-1], 3:7] @ np.array([*after]) > 0.0
            else Quaternion(*(-c for c in after))
        )
        # of a size that is chosen, 0.3 of the weight
        if phase.contact is not None:
            # along the normal, which is within every cone of friction
            u[edges[k] : edges[k + 1], -3:] = 0.3 * np.array([*phase.contact.normal])
    x[:, at.speeds] = 1.0
    # the trim of a level start, else a quarter of the thrust of hover
    joints = task.start.joints or task.vehicle.zeros
    trim = hover_trim(task.vehicle, joints, task.gravity)
    x[0, at.speeds] = (
        doubles(trim.speeds) / stage.stage.hover if is_level(task.start) else 0.5
    )
    free = [
        length
        for phase, length in zip(task.phases, shape.lengths, strict=True)
        if phase.duration is None
    ]
    x[:, stage.nx - len(free) :] = free
    return Guess(x, u)


def _turning(before: Quaternion, after: Quaternion, count: int, sense: float) -> Array:
    """Attitudes (count, 4) of a turn from one attitude to another at a constant
    rate.
    """
    turn = before.conjugate() * after
    vector = np.array([*turn])
    # the sign with the shorter turn; at half a turn rounding must not choose the side
    vector = -vector if vector[0] < -1e-9 else vector
    size = norm(vector[1:])
    # without a turn any axis is right, and 0 / 0 must not arise
    axis = vector[1:] / size if size > 1e-9 else np.array([0.0, 0.0, 1.0])
    angle = 2.0 * math.atan2(size, vector[0])
    angle = angle if sense > 0.0 else angle - 2.0 * math.pi * (size > 1e-9)
    half = 0.5 * np.linspace(0.0, angle, count)
    steps = Quaternion(np.cos(half), *(np.sin(half) * c for c in axis))
    return np.stack(np.broadcast_arrays(*(before * steps)), axis=1)


def is_level(start: Start) -> bool:
    """True if the base is level at the start."""
    return abs(start.attitude[0]) + abs(start.attitude[1]) < 1e-6


def plan(
    task: Task,
    *,
    seconds: float = 600.0,
    on_progress: Callable[[str], None] | None = None,
) -> Plan:
    """Plan a task: solve from several seeds and return the best plan, the same one
    however long that takes.

    A phase of free duration becomes longer until no rotor lags behind its command by
    more than ``limits.rotor_lag``: laws invert a small part of the lag, so what is
    missing of the thrusts is an error of the motion.

    Args:
        task: see :func:`skyarm.planning.task.load_task`.
        seconds: longest time of the whole search, s: an emergency end, after which
            there is no plan.
        on_progress: called with a line of text now and then.

    Raises:
        PlanError: no plan within the limits; one line with the phase, the constraint
            and how far it is off. Or no plan within ``seconds``.
    """
    begun = time.perf_counter()
    met: set[tuple[str, str]] = set()

    def watch(line: str) -> None:
        if time.perf_counter() - begun > seconds:
            raise TimeoutError(
                f"{task.name}: no plan within {seconds:g} s, {line}: take more time, or"
                " a larger step"
            )
        if on_progress is not None:
            on_progress(line)

    if reason := impossible(task):
        raise PlanError(f"{task.name}: {reason}")
    try:
        found, not_least = _with_free_lengths(task, watch, met)
        room = LENGTHS[0]
        for _ in range(STRETCHES):
            if (longer := _longer(task, found, room)) is None:
                break
            coarse = any(coarse_phases(found))
            try:
                found = _best_plan(
                    longer,
                    watch,
                    met,
                    _slower(found, longer),
                    # more nodes need more time rather than another penalty: see below
                    PENALTIES[: 1 if coarse else None],
                )
            except PlanError as error:
                # the limits alone are narrower there; the plan before keeps them
                if not coarse:
                    break
                if room > MOST_ROOM:
                    raise PlanError(
                        f"{error}; state the duration of each phase, or a larger step"
                    ) from None
                room *= ROOM
    except TimeoutError as error:
        raise PlanError(str(error)) from None
    return dataclasses.replace(
        found, task=task, not_least=not_least, seconds=time.perf_counter() - begun
    )


STRETCHES = 8
"""Largest number of plans with longer durations: together longer by a sixth at least,
25 times at most."""

ROOM, MOST_ROOM = 1.1, 1.2
"""Growth of the factor while a plan with more nodes, of longer durations, is not within
the limits; and when it ends.

Between nodes that are too few a limit of speed, for one, holds no longer: then the
duration was too short.
"""

COARSE = 1.1
"""Number of nodes that the duration of a phase needs, over those of its seed, from
which there are too few."""


def coarse_phases(found: Plan) -> list[bool]:
    """Phases of a plan with fewer nodes than their durations need: free ones that are
    longer than their seeds.
    """
    needed = node_counts(found.task, found.durations)
    return [
        bool(count > COARSE * few)
        for count, few in zip(needed, np.diff(found.edges), strict=True)
    ]


LENGTHS = (1.02, 1.5)
"""Least and largest factor by which a duration grows from plan to plan: not for ever,
and near to the motion before."""


def _with_free_lengths(
    task: Task, watch: Callable[[str], None], met: set[tuple[str, str]]
) -> tuple[Plan, str]:
    """Plan with its free durations as what is minimised has them, and why not; empty if
    it has.

    The least time is looked for beside the plan of least effort. Where rotors lag far
    in that one already, a still shorter one would have to become nearly as long.
    """
    gentle = _best_plan(dataclasses.replace(task, minimise="effort"), watch, met)
    free = [phase.duration is None for phase in task.phases]
    if task.minimise == "effort" or not any(free):
        return gentle, ""
    if (gentle.lags[free] > FAR * task.limits.rotor_lag).any():
        reason = f"not looked for, rotors lag by over {FAR:g} of limits.rotor_lag"
        return gentle, f"{reason} with the least effort"
    try:
        # one penalty: where it finds nothing, the plan of least effort is there already
        return _best_plan(task, watch, met, penalties=PENALTIES[:1]), ""
    except PlanError:
        # a plan within the limits is worth more than the least time
        reason = "no plan within the limits was found, this one has the least effort"
        return gentle, reason


FAR = 0.5
"""Share of ``limits.rotor_lag`` beyond which time cannot be shorter by more than a
fifth: a lag goes with its cube."""


def _longer(task: Task, found: Plan, room: float) -> Task | None:
    """Task with the durations of a plan, longer where its rotors lag too far or its
    nodes are too few; None if nowhere.

    A lag goes with the third power of time: thrusts with the second one, and they
    change in that time. More nodes are more limits, for which durations are longer by
    the factor ``room``.
    """
    over = found.lags / task.limits.rotor_lag
    phases, coarse = [*task.phases], coarse_phases(found)
    grows = False
    for k, (phase, length) in enumerate(zip(task.phases, found.durations, strict=True)):
        if phase.duration is None:
            # a phase whose duration is given is as hard as those beside it make it
            beside = [
                j
                for j in (k - 1, k + 1)
                if 0 <= j < len(over) and task.phases[j].duration is not None
            ]
            most = max(over[[k, *beside]])
            factor = room if coarse[k] else 1.0
            if most > 1.0:
                by_lag = min(max(most ** (1.0 / 3.0), LENGTHS[0]), LENGTHS[1])
                factor = max(by_lag, factor)
            grows |= factor > 1.0
            phases[k] = dataclasses.replace(phase, duration=float(factor * length))
    return dataclasses.replace(task, phases=tuple(phases)) if grows else None


def _slower(found: Plan, task: Task) -> Guess:
    """Motion of a plan in the durations of a task, at as many nodes as that has."""
    lengths = [float(phase.duration or 0.0) for phase in task.phases]
    counts, edges = node_counts(task, lengths), found.t[[*found.edges]]
    nodes = np.append(0, np.cumsum(counts))
    t = np.interp(np.arange(nodes[-1] + 1), nodes, edges)
    # the last node keeps its rates: rest, or what its goal states in any duration
    slow = np.append(np.repeat(np.diff(edges) / lengths, counts), 1.0)[:, None]
    at = found.stage.at
    # without the lengths of free phases: now all durations are stated
    x = states_at(found, t)[:, : at.arm.stop]
    # rates go with the inverse of time, accelerations with its square
    x[:, 7:13] *= slow
    x[:, at.joint_rates] *= slow
    x[:, at.arm] *= slow**2
    stages = np.searchsorted(found.t, t[:-1], side="right") - 1
    return Guess(x, found.u[np.clip(stages, 0, len(found.u) - 1)])


def _best_plan(
    task: Task,
    watch: Callable[[str], None],
    met: set[tuple[str, str]],
    first: Guess | None = None,
    penalties: Sequence[float] = PENALTIES,
) -> Plan:
    """Best plan of a task from several seeds, or from a first motion alone.

    ``met``: pairs of the vehicle's own bodies that a plan before went through, to which
    this one adds its own.

    Raises:
        PlanError: as :func:`plan`.
    """
    shape = outline(task)
    counts = node_counts(task, shape.lengths)
    stage = stage_of(task, met)
    clearance = np.full(sum(counts) + 1, task.limits.clearance)
    problem = problem_of(task, stage, counts, clearance)
    roll, pitch, _ = task.start.attitude
    # a base that is tilted far, by 115 degrees (chosen), turns upright about as fast
    # either way round
    senses = (1.0, -1.0) if abs(roll) + abs(pitch) > 2.0 else (1.0,)
    if first is not None:
        guesses = [first]
    else:
        guesses = [
            guess_from(task, stage, counts, ways, shape, sense)
            for ways in seeds(task, shape)
            for sense in senses
        ]
    best, tried = _best_of(stage, problem, guesses, watch, penalties=penalties)
    found: Plan | None = None
    for _ in range(ROUNDS):
        if best is None or not best.violation < TOLERANCE:
            break
        plan = _plan_of(task, stage, problem, counts, best, tried)
        nearest = nearest_of(plan)
        if nearest.gap >= 0.0:
            found = dataclasses.replace(plan, nearest=nearest)
            if task.limits.clearance - nearest.apart <= SLACK:
                return found
        # between bodies that did not count yet, or between the nodes, which keep off by
        # as much more
        met |= nearest.pairs
        clearance += nearest.missing
        last = best
        stage = stage_of(task, met)
        problem = problem_of(task, stage, counts, clearance)
        # the solution before is near, so that the first one that is solved is enough
        best, more = _best_of(
            stage, problem, [Guess(last.x, last.u), *guesses], watch, enough=1
        )
        tried += more
    else:
        if found is None:
            raise PlanError(
                f"{task.name}: {nearest.bodies} come within {nearest.gap:.3g} m at"
                f" {nearest.time:.3g} s"
            )
    if found is None:
        raise PlanError(f"{task.name}: {cause(task, stage, counts, best)}")
    return found


SLACK = 0.005
"""Distance (m) by which a vehicle may come nearer to an obstacle between nodes than the
limit says; chosen, a tenth of the default clearance. More takes another round."""

ENOUGH = 2
"""Number of solved seeds after which the best is taken; chosen: each one more costs a
whole solution."""

ROUNDS = 4
"""Largest number of solutions, each with the bodies that met in the one before;
chosen."""


def _best_of(
    stage: CompiledStage,
    problem: PlanProblem,
    guesses: Sequence[Guess],
    watch: Callable[[str], None],
    enough: int = ENOUGH,
    penalties: Sequence[float] = PENALTIES,
) -> tuple[Solution | None, int]:
    """Best solution from several seeds, and their number; ``enough`` solved ones end
    the search.
    """
    best: Solution | None = None
    tried = solved = 0
    for penalty, guess in itertools.product(penalties, guesses):
        # another seed may be better, but is not worth more than the best one was
        most = best.iterations if solved and best is not None else ITERATIONS
        last = None
        for last in PlanSolver(stage, penalty).steps(problem, guess, iterations=most):
            # chosen: the clock is looked at, and a line is told, now and then
            if last.iterations % 20 == 0:
                watch(
                    f"seed {tried + 1}: iteration {last.iterations}, violation"
                    f" {last.violation:.1e}"
                )
        tried += 1
        if last is not None and (best is None or _rank(last) < _rank(best)):
            best = last
        solved += last is not None and last.solved
        # other penalties are only for seeds of which none led to a plan
        if solved >= enough or (solved and tried % len(guesses) == 0):
            break
    return best, tried


def _plan_of(
    task: Task,
    stage: CompiledStage,
    problem: PlanProblem,
    counts: Sequence[int],
    best: Solution,
    tried: int,
) -> Plan:
    free = stage.stage.free
    x = best.x.copy()
    # q and -q are one attitude, but a reference interpolates between the numbers
    x[:, 3:7] = continuous(x[:, 3:7])
    steps = (
        problem.data[:-1, 0]
        + problem.data[:-1, 1 : 1 + free] @ best.x[0, stage.nx - free :]
    )
    return Plan(
        task=task,
        stage=stage.stage,
        compiled=stage,
        data=problem.data,
        t=np.append(0.0, np.cumsum(steps)),
        x=x,
        u=best.u,
        K=best.K,
        edges=tuple(map(int, np.cumsum([0, *counts]))),
        solution=best,
        seeds=tried,
    )


FINE = 1e-3
"""Time (s) between two instants at which the distances of a plan are looked at."""


def nearest_of(plan: Plan) -> Nearest:
    """Smallest distance between the vehicle's bodies and obstacles, and each other,
    every millisecond of a plan.
    """
    near = clearances(plan.task.vehicle, plan.task.obstacles)
    if not near.pairs:
        return Nearest()
    # every pair at every instant costs most here: steps of 10 ms find where a finer
    # look is due
    t = np.linspace(0.0, plan.t[-1], max(2, round(plan.t[-1] / (10.0 * FINE)) + 1))
    gaps = _gaps(plan, near, t)
    # finer where bodies are within 10 cm, or 2 cm of the nearest: chosen
    most = max(0.1, float(gaps.min()) + 0.02)
    close = t[gaps.min(axis=0) < most]
    fine = np.unique(
        np.clip((close[:, None] + np.arange(-10, 11) * FINE).ravel(), 0.0, plan.t[-1])
    )
    if len(fine):
        pairs = [
            pair for pair, row in zip(near.pairs, gaps, strict=True) if row.min() < most
        ]
        near = dataclasses.replace(near, pairs=tuple(pairs))
        t, gaps = fine, _gaps(plan, near, fine)
    limit = plan.task.limits.clearance
    outer = np.array([pair.surface is not None for pair in near.pairs])
    worst: list[tuple[float, float, str]] = []
    for rows in (np.flatnonzero(outer), np.flatnonzero(~outer)):
        if len(rows):
            i = int(rows[gaps[rows].min(axis=1).argmin()])
            k = int(gaps[i].argmin())
            pair = near.pairs[i]
            worst.append(
                (float(gaps[i, k]), float(t[k]), f"{pair.volume} and {pair.other}")
            )
    # of each instant, for the nodes before and after it; where phases meet, a goal may
    # say how far off the vehicle is
    after = np.searchsorted(plan.t, t[1:])
    lacks = limit - gaps[outer].min(axis=0, initial=limit)[1:]
    missing = np.zeros(len(plan.t))
    for nodes in (after - 1, after):
        np.maximum.at(missing, nodes, lacks)
    missing[[*plan.edges]] = 0.0
    gap, time, bodies = min(worst)
    meet = (gaps.min(axis=1) < 0.0) & ~outer
    return Nearest(
        gap=gap,
        apart=worst[0][0] if outer.any() else math.inf,
        time=time,
        bodies=bodies,
        pairs=frozenset(
            (near.pairs[i].volume, near.pairs[i].other) for i in np.flatnonzero(meet)
        ),
        short="; ".join(
            f"{who}, {d:.3g} m at {at:.3g} s"
            for d, at, who in worst
            if d < limit - SLACK
        ),
        missing=missing,
    )


def _gaps(plan: Plan, near: Clearances, t: Array) -> Array:
    """Distances (pairs, instants) at times of a plan, m."""
    x = states_at(plan, t)
    R = Quaternion(*x[:, 3:7].T).rotation()
    rows = near.distances(Vec3(*x[:, :3].T), R, tuple(x[:, plan.stage.at.joints].T))
    return stack_values(len(t), rows)


def states_at(plan: Plan, t: Array) -> Array:
    """States of a plan between its nodes, (instants, nx), by cubic Hermite
    interpolation of pose and joints.
    """
    at, nodes = plan.stage.at, plan.t
    k = np.clip(np.searchsorted(nodes, t, side="right") - 1, 0, len(nodes) - 2)
    h = (nodes[k + 1] - nodes[k])[:, None]
    s = (t - nodes[k])[:, None] / h
    q = Quaternion(*plan.x[:, 3:7].T).derivative(Vec3(*plan.x[:, 10:13].T))
    rates = np.zeros_like(plan.x)
    rates[:, :3] = plan.x[:, 7:10]
    rates[:, 3:7] = np.stack([*q], axis=1)
    rates[:, at.joints] = plan.x[:, at.joint_rates]
    a, b, va, vb = plan.x[k], plan.x[k + 1], rates[k], rates[k + 1]
    out = a + (b - a) * s
    # velocities and what follows have no rates in a plan, so they stay linear
    held = [*range(7), *range(at.joints.start, at.joints.stop)]
    cubic = (
        (2 * s**3 - 3 * s**2 + 1) * a
        + (3 * s**2 - 2 * s**3) * b
        + h * ((s**3 - 2 * s**2 + s) * va + (s**3 - s**2) * vb)
    )
    out[:, held] = cubic[:, held]
    out[:, 3:7] = unit_rows(out[:, 3:7])
    return out


def _rank(solution: Solution) -> tuple[bool, float]:
    """Sorting key of solutions: feasible ones by cost, then the others by violation."""
    feasible = solution.violation < TOLERANCE
    return not feasible, solution.cost if feasible else solution.violation


def seeds(task: Task, shape: Outline) -> list[list[Array]]:
    """Ways of the base for each phase, one list for each seed: straight ones, then ways
    around the obstacles.
    """
    reach = float(sum(boom_and_disc(task.vehicle)))
    each = [
        ways_around(task.obstacles, a, b, reach)
        for a, b in itertools.pairwise(shape.bases)
    ]
    return [
        # phases with fewer ways keep their last one
        [ways[min(k, len(ways) - 1)] for ways in each]
        for k in range(max(map(len, each)))
    ]


GOAL_WORDS = {
    "tip_velocity": "velocity of the tip",
    "lift": "velocity of the tip along the normal",
    "axis": "direction of the tip",
    "rate": "angular rate",
    "joint_rates": "joint rates",
    "still": "balance at rest",
    "arm": "joint accelerations at rest",
    "inputs": "rotor accelerations at rest",
}
"""Goals in messages, where their names do not say enough."""

LEAST_CAUSE = 1e-3
"""Least cost of a goal or limit that is named beside the one that costs most;
chosen."""

SMOOTH = ("arm", "inputs")
"""Goals that make a plan smooth at its ends, and are never why there is none."""


def cause(
    task: Task, stage: CompiledStage, counts: Sequence[int], last: Solution | None
) -> str:
    """One line: which constraint of which phase a motion violates most, and how far."""
    if last is None or not np.isfinite(last.violation):
        return "no motion was found"
    labels = [
        name for name, part in stage.goal.items() for _ in range(part.stop - part.start)
    ]
    # what a violation costs the motion, rather than its size: the units differ
    off = np.abs(last.goals), np.maximum(last.limits, 0.0)
    edges = np.cumsum([0, *counts])
    found: list[tuple[float, int, str]] = []
    for size, force, names in zip(
        off, last.forces, (labels, list(stage.names)), strict=True
    ):
        cost = size * np.abs(force)
        cost[:, [name in SMOOTH for name in names]] = 0.0
        node, k = map(int, np.unravel_index(int(cost.argmax()), cost.shape))
        # a node at an edge belongs to the phase that ends there
        after = int(np.searchsorted(edges, node, side="left"))
        phase = max(min(after, len(counts)) - 1, 0)
        found.append(
            (
                float(cost[node, k]),
                phase,
                f"{GOAL_WORDS.get(names[k], names[k])} is off by {size[node, k]:.3g}",
            )
        )
    # the goal that is missed, and the limit that is in its way
    _, at, lead = max(found)
    rows = [
        text
        for cost, phase, text in found
        if phase == at and (cost > LEAST_CAUSE or text == lead)
    ]
    text = rows[0] + "".join(
        f", {each.replace(' is off by', ' by')}" for each in rows[1:]
    )
    # one compiled stage serves scenes with other names
    for k, obstacle in enumerate(task.obstacles):
        text = re.sub(rf"\bobstacle{k}\b", obstacle.name, text)
    return (
        f"phases[{at}] {task.phases[at].name!r}: no motion within the limits was found:"
        f" {text}"
    )


def impossible(task: Task) -> str:
    """One line: which limit the start or a goal alone is beyond, so that no motion is
    within; empty if none is.
    """
    vehicle, limits = task.vehicle, task.limits
    near = clearances(vehicle, task.obstacles)
    own, start = attitude(task.start.attitude), task.start.joints or vehicle.zeros
    for pair, gap in zip(
        near.pairs,
        near.distances(task.start.position, own.rotation(), start),
        strict=True,
    ):
        if float(gap) < 0.0:
            return (
                f"start: {pair.volume} and {pair.other} overlap by {-float(gap):.3g} m"
            )
    # the start as a goal, within the tilt of the first phase
    begins = Goal(attitude=task.start.attitude, joints=start)
    places = [("start", 0, begins)] + [
        (f"phases[{k}] {phase.name!r}: to", k, phase.to)
        for k, phase in enumerate(task.phases)
    ]
    lift = limits.thrust_share * float(highest_thrust(vehicle))
    for at, k, goal in places:
        for joint, value in zip(vehicle.joints, goal.joints, strict=False):
            low, high = joint.ends
            if not low <= value <= high:
                return (
                    f"{at}.joints: {joint.name} = {value:.4g} is beyond its range,"
                    f" {low:.4g} to {high:.4g}"
                )
        up = float(goal_attitude(goal).rotation().rows[2].z)
        # rounding may take the cosine beyond 1
        lean = math.acos(max(-1.0, min(1.0, up)))
        stated, tilt = f"phases[{k}].tilt", task.phases[k].tilt
        if tilt is None:
            stated, tilt = "limits.tilt", limits.tilt
        if lean > tilt + TOLERANCE:
            return f"{at}.attitude: is tilted by {lean:.4g} rad, {stated} is {tilt:.4g}"
        fast = float(goal.velocity.norm()) if goal.velocity else 0.0
        if fast > limits.speed:
            return (
                f"{at}.velocity: is {fast:.4g} m/s, limits.speed is {limits.speed:.4g}"
            )
        if goal.rest and lift < (weight := float(vehicle.mass) * task.gravity):
            return (
                f"{at}.rest: hovering takes {weight:.4g} N, limits.thrust_share leaves"
                f" {lift:.4g} N"
            )
        for word, place, least in (
            ("tip", goal.tip, limits.clearance),
            ("base", goal.base, 0.0),
        ):
            for each in task.obstacles if place is not None else ():
                gap = float(free_distance([each], float_array(place or ())))
                if gap < least:
                    return (
                        f"{at}.{word}: is {gap:.3g} m from {each.name}, at least"
                        f" {least:.3g} m are needed"
                    )
    return without_support(task)


def without_support(task: Task) -> str:
    """One line: which plane the tip is off, or that nothing holds a tilted start; empty
    if neither.
    """
    below = tip_below(task, doubles(task.start.joints or task.vehicle.zeros))
    place = task.start.position + attitude(task.start.attitude).rotation().apply(
        Vec3(*below)
    )
    tip: Array | None = float_array(place) if task.vehicle.end_effector else None
    for k, phase in enumerate(task.phases):
        if phase.to.tip is not None:
            after: Array | None = float_array(phase.to.tip)
        else:
            # the plan chooses where a tip without a goal goes
            after = tip if phase.resting else None
        if (
            phase.contact is not None
            and phase.contact.kind == "plane"
            and tip is not None
            and after is not None
        ):
            off = float((after - tip) @ float_array(phase.contact.normal))
            if abs(off) > OFF_PLANE:
                return (
                    f"phases[{k}] {phase.name!r}: to.tip: is {off:.3g} m off the plane"
                    " on which the tip begins"
                )
        tip = after
    held = task.phases[0].contact is not None and task.phases[0].contact.kind != "plane"
    if not (held or is_level(task.start)):
        fix = (
            "must have roll and pitch 0, for nothing holds it; a first phase in"
            " contact, 'point' or 'bar', would"
        )
        return f"start.attitude = {shown(list(task.start.attitude))}: {fix}"
    return ""


OFF_PLANE = 1e-3
"""Largest distance (m) of a goal from the plane on which the tip slides: of goals that
are rounded to millimetres."""
