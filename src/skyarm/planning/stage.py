"""One stage of a plan as a function of scalars: the state after it, costs, goals and
limits; compiled for a horizon.

The state is that of the predictive law's model with joint accelerations, and the
lengths of free phases as constant states; inputs are rotor accelerations, joint jerks
and the force of a contact on the tip. Joint torques follow by inverse dynamics, and are
limits. Derivatives are exact: Taylor series of first order serve as dual numbers, one
direction a lane, the stages as rows.

Tangent of a state: position, rotation vector (body axes), velocity, rate, joints, joint
rates, rotor speeds, joint accelerations, lengths.
Source: Diehl, Bock, Diedam, Wieber 2006 (multiple shooting); Griewank, Walther 2008,
chapter 3 (forward mode).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import field, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from skyarm import dynamics
from skyarm.algebra import (
    E_Z,
    ZERO3,
    ZERO3_DATA,
    Motion,
    Quaternion,
    Scalar,
    Scalars,
    Vec3,
    differences,
    sums,
)
from skyarm.algebra.scalars import data, sqrt
from skyarm.algebra.scalars.taylor import Taylor, as_series
from skyarm.compile.llvm.kernel import Kernel
from skyarm.compile.tracing.program import trace_loop
from skyarm.control.blocks.prediction import Disturbance, no_disturbance
from skyarm.control.laws.predictive.prediction import (
    StageInputs,
    base_accelerations,
    runge_kutta_step,
    slope_of,
)
from skyarm.control.model import Model
from skyarm.dynamics import State
from skyarm.dynamics.actuators.hover import hover_trim
from skyarm.dynamics.kinematics import jacobian_columns
from skyarm.dynamics.state import proper_acceleration
from skyarm.planning.task import TaskLimits
from skyarm.records.arrays import Array
from skyarm.records.immutable import immutable
from skyarm.records.leaves import Tree, leaves, rebuild
from skyarm.world.contact.surface import Surface
from skyarm.world.scene.clearance import Clearances

ARM_UNIT = 20.0
"""Joint acceleration (rad/s^2 or m/s^2) of 1 in a state; chosen as the units below, so
that numbers of a quick motion are of order one, as the weights and tolerances take
them."""

JERK_UNIT = 200.0
"""Joint jerk (rad/s^3 or m/s^3) of an input of 1."""

SPIN_UNIT = 20.0
"""Rotor acceleration of an input of 1, hover speeds per second."""


@immutable
class StageWeights:
    """Weights of what a plan minimises beside its limits, per second of the motion.

    Attributes:
        thrust: squared deviation of each rotor's thrust from that in hover, over the
            latter. torque: squared torque of each joint over its limit. state: squared
            rates of the base and of the joints and joint positions.
        spin, arm, jerk: squared rotor accelerations, joint accelerations and jerks, in
            units of an input or state.
        force: squared contact force over the weight.
        across: squared force of tilted rotors across the base's z axis, over the
            weight: laws lean by the force alone.

    The defaults are chosen; ``across`` is so large that a plan has hardly any.
    """

    thrust: float = 0.2
    torque: float = 0.1
    state: float = 0.01
    spin: float = 0.3
    arm: float = 1e-3
    jerk: float = 1e-3
    force: float = 0.1
    across: float = 300.0


@immutable
class ObstaclePlace:
    """Size (m), position (m) and angles (rad) of an obstacle as data: none of its zeros
    is structure.
    """

    size: Scalars
    position: Vec3
    angles: Vec3

    @classmethod
    def of(cls, surface: Surface) -> ObstaclePlace:
        """Place of a surface."""
        numbers = [
            tuple(map(float, each))
            for each in (surface.size, surface.position, surface.angles)
        ]
        return cls(
            size=numbers[0], position=Vec3(*numbers[1]), angles=Vec3(*numbers[2])
        )


def slices(sizes: Iterable[int], first: int = 0) -> Iterator[slice]:
    """Slices of parts of given sizes, one after the other."""
    ends = itertools.accumulate(sizes, initial=first)
    return itertools.starmap(slice, itertools.pairwise(ends))


class Slices(NamedTuple):
    """Slices of a state: joints, their rates, rotor speeds over those of hover, and
    joint accelerations.
    """

    joints: slice
    joint_rates: slice
    speeds: slice
    arm: slice


@immutable
class StageData:
    """Numbers of one stage that are not unknown: its length, goals and contact.

    Attributes:
        dt: s, the fixed length. free: share of each free phase length that is added.
        tip, tip_velocity, base, velocity: goals, m and m/s, world axes. attitude: goal
            of the base.
        axis: goal of the tip frame's z axis, world axes. joints: goal, rad or m.
        touching: 1 in contact, else 0. normal: unit vector out of the surface.
            friction: coefficient.
        press: least normal force over the weight. hurry: root of twice the cost of a
            second.
        upright: least cosine of the tilt. clearance: least distance, m. obstacles:
            shapes of the scene.
    """

    dt: Scalar = 0.0
    free: Scalars
    tip: Vec3 = ZERO3_DATA
    tip_velocity: Vec3 = ZERO3_DATA
    base: Vec3 = ZERO3_DATA
    velocity: Vec3 = ZERO3_DATA
    attitude: Quaternion = Quaternion(1.0, 0.0, 0.0, 0.0)
    axis: Vec3 = ZERO3_DATA
    joints: Scalars
    touching: Scalar = 0.0
    normal: Vec3 = ZERO3_DATA
    friction: Scalar = 0.0
    press: Scalar = 0.0
    hurry: Scalar = 0.0
    upright: Scalar = 0.0
    clearance: Scalar = 0.0
    obstacles: tuple[ObstaclePlace, ...] = ()


GOALS = (
    "tip",
    "tip_velocity",
    "lift",
    "axis",
    "base",
    "heading",
    "attitude",
    "velocity",
    "rate",
    "joints",
    "joint_rates",
    "still",
    "arm",
    "inputs",
)
"""Names of the goals that a stage may have, in the order of their rows."""


@immutable
class StageValues:
    """Values of one stage.

    Attributes:
        end: state after it, of x. costs: residuals, half of whose squared sum is the
            cost.
        goals: errors by name. limits: names and values, of which none may be above 0;
            those of ``inputs`` first.
    """

    end: list[Scalar]
    costs: list[Scalar]
    goals: dict[str, Sequence[Scalar]]
    inputs: list[tuple[str, Scalar]]
    limits: list[tuple[str, Scalar]]


@immutable(eq=False, slots=False)
class PlanStage:
    """Function of one stage for one model, its limits and weights.

    Attributes:
        model: of the plan. limits, weights: see there; of the limits tilt, clearance
            and lag are not the stage's. contact: whether the tip may be in contact.
        ranges: lowest and highest position of each joint, rad or m; empty: those of the
            vehicle.
        free: number of free phase lengths.
        clearances: pairs of bodies whose distances are limits; its obstacles give the
            shapes, the data the places.
        nearer: m, by which each of these pairs may be nearer than the data say; empty:
            none may.
        hover: unit of all rotor speeds in a state, rad/s: root mean square in hover.
            Rotors that hardly turn in hover would have a tiny unit of their own.
    """

    model: Model
    limits: TaskLimits = TaskLimits()
    ranges: tuple[tuple[float, float], ...] = ()
    weights: StageWeights = StageWeights()
    contact: bool = False
    free: int = 0
    clearances: Clearances | None = None
    nearer: tuple[float, ...] = ()
    hover: float = field(init=False)

    def __post_init__(self) -> None:
        vehicle = self.model.vehicle
        trim = hover_trim(vehicle, vehicle.zeros, self.model.gravity)
        mean = math.sqrt(
            sum(max(float(w), 0.0) for w in trim.squared) / len(trim.squared)
        )
        object.__setattr__(self, "hover", mean)

    @property
    def sizes(self) -> tuple[int, int, int]:
        """Numbers of a state, of its tangent and of the inputs."""
        vehicle = self.model.vehicle
        nt = 12 + 3 * vehicle.n + len(vehicle.rotors) + self.free
        return nt + 1, nt, len(vehicle.rotors) + vehicle.n + 3 * self.contact

    @property
    def at(self) -> Slices:
        """Slices of a state after the thirteen numbers of the base."""
        n, m = self.model.vehicle.n, len(self.model.vehicle.rotors)
        return Slices(*slices((n, n, m, n), 13))

    @property
    def weight(self) -> float:
        """Weight of the vehicle, N."""
        return float(self.model.vehicle.mass) * float(self.model.gravity)

    def state(self, x: Sequence[Scalar]) -> State:
        """State of the vehicle from the numbers of a state."""
        return State(
            position=Vec3(*x[:3]),
            quaternion=Quaternion(*x[3:7]),
            velocity=Vec3(*x[7:10]),
            rate=Vec3(*x[10:13]),
            joints=tuple(x[self.at.joints]),
            joint_rates=tuple(x[self.at.joint_rates]),
            rotor_speeds=tuple(a * self.hover for a in x[self.at.speeds]),
        )

    @property
    def obstacles(self) -> tuple[Surface, ...]:
        """Obstacles that the clearances name, each once."""
        pairs = self.clearances.pairs if self.clearances is not None else ()
        return tuple(
            {
                pair.other: pair.surface for pair in pairs if pair.surface is not None
            }.values()
        )

    def example(self) -> StageData:
        """Example of a stage's numbers, for tracing."""
        still = self.model.vehicle.zeros
        return StageData(
            free=(0.0,) * self.free,
            joints=still,
            obstacles=tuple(map(ObstaclePlace.of, self.obstacles)),
        )

    def length(self, x: Sequence[Scalar], data: StageData) -> Scalar:
        """Length of the stage, s."""
        return sum(
            (a * b for a, b in zip(x[len(x) - self.free :], data.free, strict=True)),
            data.dt,
        )

    def force(self, u: Sequence[Scalar], data: StageData) -> Vec3:
        """Contact force on the tip, N, world axes."""
        if not self.contact:
            return ZERO3
        return Vec3(*(a * (data.touching * self.weight) for a in u[len(u) - 3 :]))

    def across(self, state: State) -> list[Scalar]:
        """Forces (N) of the rotors along x and y of the base; empty where all rotors
        push along z.
        """
        rows = [*zip(self.model.vehicle.rotors, state.rotor_speeds, strict=True)]
        sides = [
            [
                (float(r.thrust_coefficient) * float(getattr(r.axis, c)), w)
                for r, w in rows
            ]
            for c in "xy"
        ]
        return [
            sum(k * (w * w) for k, w in side)
            for side in sides
            # rounding of an upright axis is no force that costs anything
            if any(abs(k) > 1e-12 for k, _ in side)
        ]

    def accelerations(
        self, state: State, joints: Scalars, push: Vec3
    ) -> tuple[Vec3, Vec3, list[Motion], Vec3]:
        """Accelerations of the base under given joint accelerations, tip Jacobian and
        tip position, base axes.
        """
        vehicle, R = self.model.vehicle, state.rotation
        pressed, tip = no_disturbance(vehicle.n), ZERO3
        columns: list[Motion] = []
        if vehicle.end_effector:
            frame = vehicle.frame()
            columns = jacobian_columns(vehicle, frame, state.joints)
            tip = dynamics.frame_pose(vehicle, frame, state.joints).p
            if self.contact:
                pressed = Disturbance(
                    force=push,
                    torque=tip.cross(R.apply_T(push)),
                    efforts=(0,) * vehicle.n,
                )
        return *base_accelerations(self.model, state, joints, pressed), columns, tip

    def __call__(
        self, x: Sequence[Scalar], u: Sequence[Scalar], data: StageData
    ) -> StageValues:
        """Values of the stage from its state, its inputs and its numbers."""
        vehicle, weights = self.model.vehicle, self.weights
        n, m, at = vehicle.n, len(vehicle.rotors), self.at
        state, dt, push = self.state(x), self.length(x, data), self.force(u, data)
        spins = tuple(a * (SPIN_UNIT * self.hover) for a in u[:m])
        joints = tuple(a * ARM_UNIT for a in x[at.arm])
        jerks = tuple(a * JERK_UNIT for a in u[m : m + n])
        inputs = StageInputs(rotor_accelerations=spins, efforts=())

        def slope(now: State, later: Scalar) -> State:
            # joint accelerations are linear over a stage, as their jerks are constant
            turned = tuple(a + later * j for a, j in zip(joints, jerks, strict=True))
            return slope_of(
                now, inputs, *self.accelerations(now, turned, push)[:2], turned
            )

        linear, angular, columns, tip = self.accelerations(state, joints, push)
        after = runge_kutta_step(
            state, slope_of(state, inputs, linear, angular, joints), slope, dt
        )
        ends = [
            a + dt * (j * (JERK_UNIT / ARM_UNIT))
            for a, j in zip(x[at.arm], u[m : m + n], strict=True)
        ]
        numbers = list(leaves(after))
        scaled = [a * (1.0 / self.hover) for a in numbers[at.speeds]]
        end = [*numbers[: at.speeds.start], *scaled, *ends, *x[at.arm.stop :]]
        R = state.rotation
        proper = proper_acceleration(R, linear, angular, self.model.gravity)
        _, torques = dynamics.inverse_dynamics(
            vehicle, state.joints, state.rate, state.joint_rates, proper, joints
        )
        held = R.apply_T(push)
        efforts = [
            t - c.linear.dot(held)
            for t, c in zip(torques, columns or [Motion(ZERO3, ZERO3)] * n, strict=True)
        ]
        # a square of it makes each cost an integral over the stage, so that more nodes
        # do not cost more
        root = sqrt(dt)
        costs = [
            (w * w - 1.0) * (math.sqrt(weights.thrust) * root) for w in x[at.speeds]
        ]
        costs += [
            t * (math.sqrt(weights.torque) / largest(joint.effort_limit) * root)
            for t, joint in zip(efforts, vehicle.joints, strict=True)
        ]
        moving = (*state.rate, *state.joints, *state.joint_rates)
        for weight, values in (
            (weights.state, moving),
            (weights.spin, u[:m]),
            (weights.arm, x[at.arm]),
            (weights.jerk, u[m : m + n]),
        ):
            costs += [a * (math.sqrt(weight) * root) for a in values]
        forces = (weights.force, [*push] if self.contact else [])
        for weight, values in (forces, (weights.across, self.across(state))):
            costs += [a * (math.sqrt(weight) / self.weight * root) for a in values]
        if self.free:
            costs.append(root * data.hurry)
        return StageValues(
            end=end,
            costs=costs,
            goals=self._goals(state, data, columns, tip)
            | {"inputs": [*u[:m]], "arm": [*x[at.arm]]},
            inputs=self._input_limits(x, u, efforts, data),
            limits=self._state_limits(x, state, data),
        )

    def _goals(
        self, state: State, data: StageData, columns: list[Motion], tip: Vec3
    ) -> dict[str, Sequence[Scalar]]:
        """Errors of the goals, by name."""
        vehicle, R = self.model.vehicle, state.rotation
        moving = state.rate.cross(tip)
        axis = E_Z
        for column, rate in zip(columns, state.joint_rates, strict=False):
            moving = moving + column.linear * rate
        if vehicle.end_effector:
            axis = dynamics.frame_pose(vehicle, vehicle.frame(), state.joints).R.column(
                2
            )
        turn = data.attitude.conjugate() * state.quaternion
        # at rest nothing moves and nothing begins to: the rotors balance the weight
        linear, angular = self.accelerations(state, vehicle.zeros, ZERO3)[:2]
        ahead = data.attitude.rotation().column(0)
        nose = R.column(0)
        tip_velocity = state.velocity + R.apply(moving)
        return {
            "lift": [data.normal.dot(tip_velocity)],
            "tip": [*(state.position + R.apply(tip) - data.tip)],
            "tip_velocity": [*(tip_velocity - data.tip_velocity)],
            "axis": [*(R.apply(axis) - data.axis)],
            "base": [*(state.position - data.base)],
            "heading": [ahead.x * nose.y - ahead.y * nose.x],
            "attitude": [2.0 * turn.x, 2.0 * turn.y, 2.0 * turn.z],
            "velocity": [*(state.velocity - data.velocity)],
            "rate": [*state.rate],
            "joints": differences(state.joints, data.joints),
            "joint_rates": [*state.joint_rates],
            # in units of gravity and of 50 rad/s^2, so that both errors are of like
            # size
            "still": [*(linear * (1.0 / 9.81)), *(angular * 0.02)],
        }

    def _input_limits(
        self,
        x: Sequence[Scalar],
        u: Sequence[Scalar],
        efforts: Sequence[Scalar],
        data: StageData,
    ) -> list[tuple[str, Scalar]]:
        """Limits of rotor accelerations (by the lag), joint torques, joint rates
        between nodes, the contact force.
        """
        vehicle, limits = self.model.vehicle, self.limits
        n, m, at = vehicle.n, len(vehicle.rotors), self.at
        out = []
        for rotor, w, spin in zip(vehicle.rotors, x[at.speeds], u[:m], strict=True):
            most = float(rotor.max_speed) / self.hover
            for tau, end, sign in (
                (rotor.time_constant_up, most, 1.0),
                (rotor.time_constant_down, 0.0, -1.0),
            ):
                # at the end of the stage, where a speed that goes up or down is nearest
                # to its own end
                lag = self.length(x, data) * SPIN_UNIT + SPIN_UNIT * max(
                    float(tau), 1e-3
                )
                out.append(
                    (
                        f"acceleration of {rotor.name}",
                        sign * (spin * lag + w - end) * (1.0 / most),
                    )
                )
        for link, effort in zip(vehicle.links, efforts, strict=True):
            most = largest(link.joint.effort_limit) * limits.torque_share
            out += _both_ways(f"torque of {link.joint.name}", effort * (1.0 / most))
        # a rate between two nodes is within the hull of three control points: both
        # ends, and this one
        half = self.length(x, data) * (0.5 * ARM_UNIT)
        for link, rate, a in zip(
            vehicle.links, x[at.joint_rates], x[at.arm], strict=True
        ):
            control = (rate + half * a) * (1.0 / limits.joint_rate)
            out += _both_ways(f"rate of {link.joint.name}", control)
        if self.contact:
            f = Vec3(*u[m + n : m + n + 3])
            along = f.dot(data.normal)
            across = f - data.normal * along
            # the cone's square: smooth at its tip
            out.append(("contact force", data.press - along))
            out.append(
                (
                    "friction",
                    across.dot(across)
                    - data.friction * data.friction * (along * along),
                )
            )
        return out

    def _state_limits(
        self, x: Sequence[Scalar], state: State, data: StageData
    ) -> list[tuple[str, Scalar]]:
        """Limits of the state: rotor thrust, joints, tilt, speed, clearance, and
        lengths of free phases.
        """
        vehicle, limits = self.model.vehicle, self.limits
        R = state.rotation
        out: list[tuple[str, Scalar]] = []
        for rotor, w in zip(vehicle.rotors, x[self.at.speeds], strict=True):
            share = w * (1.0 / (float(rotor.max_speed) / self.hover))
            out += [
                (f"thrust of {rotor.name}", each)
                # thrust goes with the square of speed, so at speed 0 it would not react
                # to a change
                for each in (share - math.sqrt(limits.thrust_share), 0.02 - share)
            ]
        ranges = self.ranges or [joint.ends for joint in vehicle.joints]
        for link, (low, high), q, rate in zip(
            vehicle.links, ranges, state.joints, state.joint_rates, strict=True
        ):
            joint = link.joint
            for end, sign in ((high, 1.0), (low, -1.0)):
                if math.isfinite(end):
                    out.append((f"position of {joint.name}", sign * (q - end)))
            out += _both_ways(f"rate of {joint.name}", rate * (1.0 / limits.joint_rate))
        out.append(("tilt", data.upright - R.rows[2].z))
        # the goal's sine alone is zero for the reversed heading, too; twice the cosine
        # outweighs it on the way round
        ahead, nose = data.attitude.rotation().column(0), R.column(0)
        out.append(("heading", -2.0 * (ahead.x * nose.x + ahead.y * nose.y)))
        for name, vector, most in (
            ("speed", state.velocity, limits.speed),
            ("rate", state.rate, limits.rate),
        ):
            # squared, since a norm has no slope at 0
            if math.isfinite(most):
                out.append((name, vector.dot(vector) * (1.0 / most**2) - 1.0))
        if self.clearances is not None:
            placed = {
                each.name: replace(
                    each, size=at.size, position=at.position, angles=at.angles
                )
                for each, at in zip(self.obstacles, data.obstacles, strict=True)
            }
            pairs = [
                (
                    pair
                    if pair.surface is None
                    else replace(pair, surface=placed[pair.other])
                )
                for pair in self.clearances.pairs
            ]
            near = replace(self.clearances, pairs=tuple(pairs))
            gaps = near.distances(state.position, R, state.joints)
            nearer = self.nearer or (0.0,) * len(pairs)
            for pair, gap, less in zip(pairs, gaps, nearer, strict=True):
                out.append(
                    (
                        f"clearance of {pair.volume} and {pair.other}",
                        data.clearance - (gap + less if less else gap),
                    )
                )
        out += [
            # in a stage of no length the inputs would move nothing
            (f"length of free phase {k}", 0.05 - length)
            for k, length in enumerate(x[len(x) - self.free :])
        ]
        return out


def _both_ways(name: str, share: Scalar) -> list[tuple[str, Scalar]]:
    """Limits of a share, between -1 and 1, of what a quantity may be either way."""
    return [(name, share - 1.0), (name, -share - 1.0)]


def largest(effort: Scalar) -> float:
    """Effort limit of a joint (N m or N), or 1 where there is none."""
    most = float(effort)
    return most if math.isfinite(most) and most > 0.0 else 1.0


def retraction(x: Sequence[Scalar], d: Sequence[Scalar]) -> list[Scalar]:
    """State moved by a tangent: the quaternion by q (1, d/2), normalised."""
    q = Quaternion(*x[3:7]) * Quaternion(1.0, 0.5 * d[3], 0.5 * d[4], 0.5 * d[5])
    return [*sums(x[:3], d[:3]), *q.normalized(), *sums(x[7:], d[6:])]


def gap(end: Sequence[Scalar], following: Sequence[Scalar]) -> list[Scalar]:
    """Tangent from a state to the end of the stage before it."""
    # twice the vector part is the rotation vector to first order
    turn = Quaternion(*following[3:7]).conjugate() * Quaternion(*end[3:7])
    return [
        *differences(end[:3], following[:3]),
        *(2.0 * c for c in (turn.x, turn.y, turn.z)),
        *differences(end[7:], following[7:]),
    ]


WHOLE = np.ones(1)
"""Share of a whole step."""


class CompiledStage:
    """Machine code of a stage: values along a step of several lengths, and exact first
    derivatives.

    Attributes:
        costs, goals, limits: slices of the outputs behind the gap. goal: slice of each
            goal by name, within ``goals``.
        names: names of the limits. input_limits: number of them that belong to inputs,
            the first ones.
    """

    def __init__(self, stage: PlanStage) -> None:
        self.stage = stage
        nx, nt, nu = stage.sizes
        parts: dict[str, Any] = {}

        def outputs(
            x: Sequence[Scalar],
            u: Sequence[Scalar],
            following: Sequence[Scalar],
            given: StageData,
        ) -> list[Scalar]:
            values = stage(x, u, given)
            # names and sizes are known only from a call, which the trace makes
            parts["values"] = values
            goals = [error for name in GOALS for error in values.goals[name]]
            bounds = [value for _, value in (*values.inputs, *values.limits)]
            return [*gap(values.end, following), *values.costs, *goals, *bounds]

        def along(
            carry: Tree, par: Any, row: Any, _uniforms: Tree
        ) -> tuple[Tree, Scalars]:
            x, u, following, given, dx, du, dnext = row
            scaled = partial(map, lambda d: par[0] * d)
            moved = retraction(x, list(scaled(dx)))
            pushed = sums(u, list(scaled(du)))
            later = retraction(following, list(scaled(dnext)))
            # an output that is structure, as of an axis without force, is a column, too
            return carry, tuple(map(data, outputs(moved, pushed, later, given)))

        def slopes(
            carry: Tree, par: Any, row: Any, _uniforms: Tree
        ) -> tuple[Tree, Scalars]:
            (dx, du), (x, u, following, given) = par, row
            turned = Quaternion(*x[3:7]) * Quaternion(
                0, 0.5 * dx[3], 0.5 * dx[4], 0.5 * dx[5]
            )
            # derivative of the retraction at a step of 0
            direction = [*dx[:3], *turned, *dx[6:]]
            X = [Taylor(pair) for pair in zip(x, direction, strict=True)]
            U = [Taylor(pair) for pair in zip(u, du, strict=True)]
            fixed = rebuild(given, [as_series(a, 1) for a in leaves(given)])
            after = [as_series(a, 1) for a in following]
            return carry, tuple(
                data(o.c[1]) if isinstance(o, Taylor) else 0.0
                for o in outputs(X, U, after, fixed)
            )

        row = ((0.0,) * nx, (0.0,) * nu, (0.0,) * nx, stage.example())
        tangent = ((0.0,) * nt, (0.0,) * nu)
        # what each row gives is logged; the loop carries nothing from row to row
        self._slopes = Kernel(trace_loop(slopes, (0.0,), tangent, row), logging=True)
        self._values = Kernel(
            trace_loop(along, (0.0,), (0.0,), (*row, *tangent, (0.0,) * nt)),
            logging=True,
        )
        values = parts["values"]
        self.nx, self.nt, self.nu = nx, nt, nu
        self.names = tuple(name for name, _ in (*values.inputs, *values.limits))
        self.input_limits = len(values.inputs)
        sizes = [len(values.goals[name]) for name in GOALS]
        self.costs, self.goals, self.limits = slices(
            (len(values.costs), sum(sizes), len(self.names)), nt
        )
        self.goal = dict(zip(GOALS, slices(sizes), strict=True))
        self._directions = np.eye(nt + nu)

    def values(
        self,
        x: Array,
        u: Array,
        data: Array,
        step: tuple[Array, Array] | None = None,
        shares: Array = WHOLE,
    ) -> Array:
        """Outputs of all stages at shares of a step: (shares, N + 1, outputs); the last
        stage has no gap.

        Args:
            x: (N + 1, nx) states.
            u: (N, nu) inputs.
            data: (N + 1, leaves of StageData).
            step: (N + 1, nt) and (N, nu) changes; none if left out.
            shares: (lanes,) of the step.
        """
        if step is None:
            step = np.zeros((len(x), self.nt)), np.zeros(u.shape)
        dx, du = step
        # the last node has no input
        last = np.zeros((1, self.nu))
        rows = [
            x,
            np.vstack([u, last]),
            after(x),
            data,
            dx,
            np.vstack([du, last]),
            after(dx),
        ]
        _, log = self._values.run(
            np.zeros((1, len(shares))), shares[None, :], np.hstack(rows)
        )
        return np.ascontiguousarray(log.transpose(2, 0, 1))

    def jacobians(self, x: Array, u: Array, data: Array) -> Array:
        """Derivatives of the outputs by the tangents of state and inputs: (N + 1,
        outputs, nt + nu).
        """
        # the last state has no input after it
        rows = np.hstack([x, np.vstack([u, np.zeros((1, self.nu))]), after(x), data])
        _, log = self._slopes.run(
            np.zeros((1, self.nt + self.nu)), self._directions, rows
        )
        return log

    def retract(self, x: Array, d: Array) -> Array:
        """States (N + 1, nx) moved by tangents (N + 1, nt)."""
        columns: list[Any] = retraction(list(x.T), list(d.T))
        return np.stack(columns, axis=1)


def after(rows: Array) -> Array:
    """Rows one stage later; the last one stays."""
    return np.vstack([rows[1:], rows[-1:]])
