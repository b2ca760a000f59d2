"""Path governor: slows the reference in time where the nominal vehicle could not follow
it along its path.

The path stays as it is: no corner is cut. Errors are taken against the reference as it
is commanded at each instant, and the lag t - s(t) stands beside them. The plan is made
before the flight, from the law's model; the scenario keeps it as a curve of time
(:mod:`skyarm.reference.path_time`), so that every engine flies the same numbers.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Annotated

import numpy as np

from skyarm.algebra import ZERO3, Scalar
from skyarm.control.model import Model
from skyarm.dynamics import frame_pose
from skyarm.dynamics.actuators import make_mixer
from skyarm.dynamics.actuators.motion_demand import (
    ActuatorDemand,
    MotionSamples,
    attitude,
    demand_of_motion,
    motion_of,
)
from skyarm.dynamics.actuators.servo import Servo
from skyarm.records.arrays import Array, doubles
from skyarm.records.field_rules import accept_fields
from skyarm.records.files import Fields, errors_as, shown
from skyarm.records.immutable import immutable
from skyarm.records.leaves import field_names
from skyarm.records.read_table import record_from
from skyarm.records.units import nonnegative, positive
from skyarm.reference.path_time import by_flight_time
from skyarm.reference.signals import Derivatives
from skyarm.reference.task_records import TaskEvent
from skyarm.reference.trajectory import Reference, Trajectory
from skyarm.scenario.path_plan import Ceilings, Judge, PathPlan, plan
from skyarm.scenario.scenario_record import Scenario, ScenarioError

JUMP = 1e-9
"""Time (s) before a switch of the reference at which its value is taken to detect a
jump."""

CORNER = 0.02, 0.05
"""Largest jumps of velocity at a corner: m/s of the base, and rad/s or m/s of a
joint; chosen: a way of straight pieces jumps by its whole speed, an eased one not at
all, and a path with corners is led alike with half and twice of it (measured)."""

MISSED = 1.05
"""Fraction of a limit above which the governor warns that it cannot satisfy the
limit; chosen. Paths that can be slowed end at 0.83 to 1.00 of it (four measured), so
1.02 and 1.1 tell them apart as well."""

LONGEST = 1000.0
"""Longest flight (s) that is planned; longer ones take minutes."""


class GovernorWarning(RuntimeWarning):
    """Warning that a path governor cannot satisfy its limits."""


def govern(scenario: Scenario, **options: float) -> Scenario:
    """Return the scenario with a path governor, which slows the reference to feasible
    speeds.

    A reference that is feasible as commanded is not changed.

    Args:
        scenario: scenario with the reference and the law's model.
        options: reserve, tilt, turning, joint_speed, as ``[reference.governor]`` of a
            scenario file has them.

    Raises:
        ScenarioError: an option that there is not, or cannot be; a reference with
            phases that wait (until).
    """
    if not isinstance(scenario, Scenario):
        raise ScenarioError(f"scenario = {shown(scenario)}: must be a Scenario")
    names = field_names(GovernorOptions) or ()
    for name in options:
        if name not in names:
            raise ScenarioError(
                f"{name}: is no option of a governor; there are {', '.join(names)}"
            )
    with errors_as(ScenarioError):
        return governed_scenario(scenario, GovernorOptions(**options))


def governed_by_table(
    scenario: Scenario, table: object, events: Sequence[TaskEvent]
) -> Scenario:
    """Scenario with the path governor that [reference.governor] describes.

    Args:
        scenario: scenario with the reference to slow.
        table: true, or limits.
        events: events of the reference's phases.

    Raises:
        ValueError: one line.
    """
    if table is not True and not isinstance(table, Mapping):
        raise ValueError(
            f"reference.governor = {shown(table)}: must be true, false or a table of"
            " limits"
        )
    options = record_from(
        GovernorOptions,
        Fields({} if table is True else dict(table), "reference.governor"),
    )
    return governed_scenario(scenario, options, events)


def governed_scenario(
    scenario: Scenario, options: GovernorOptions, events: Sequence[TaskEvent] = ()
) -> Scenario:
    """Scenario whose reference is slowed to feasible speeds; unchanged if the reference
    is already feasible.

    Raises:
        ValueError: one line: events at fixed instants, after which a slowed vehicle
            would arrive; or a long flight.
    """
    if scenario.agent.reference.planned is not None:
        raise ValueError(
            "reference.governor: must be left out with a plan, which is within its"
            " limits in its own time"
        )
    bare = scenario.with_agent(replace(scenario.agent, path_time=None))
    for reason in _reasons_against(bare, events):
        raise ValueError(f"reference.governor: must be left out {reason}")
    plan = plan_of(bare, options)
    if plan.beyond > MISSED:
        name = PathLimits(bare.agent.model, options).names()[plan.limit]
        line = (
            f"asks for {plan.beyond:.3g} times its limit of {name} at {plan.at:.3g} s"
            " of the path, however slow"
        )
        warnings.warn(f"reference.governor: {line}", GovernorWarning, stacklevel=3)
    if plan.path_time is None:
        return bare
    return bare.with_agent(replace(bare.agent, path_time=plan.path_time))


def _reasons_against(scenario: Scenario, events: Sequence[TaskEvent]) -> Iterator[str]:
    """Reasons why the reference of a scenario cannot be slowed, such as phases that
    wait for contact.
    """
    if events:
        yield f"of a reference that picks or places something ({events[0].where})"
    if scenario.duration > LONGEST:
        yield f"of a flight of more than {LONGEST:g} s"
    for each in () if scenario.world is None else scenario.world.grippers:
        if each.closed.signal.switch_times():
            yield f"where gripper {each.name!r} closes or opens at an instant"
    if scenario.agent.payloads and scenario.agent.modelled_payloads:
        yield "where the law's model takes up payloads (believed = true)"
    if scenario.agent.reference.guards:
        yield "of a reference whose phases wait (until)"


def plan_of(scenario: Scenario, options: GovernorOptions) -> PathPlan:
    """Plan the time law along a scenario's reference with the nominal model of its
    control law.
    """
    trajectory = scenario.agent.reference
    limits = PathLimits(scenario.agent.model, options)
    ceilings = Ceilings(
        duration=float(scenario.duration), stops=_corners(trajectory, scenario)
    )

    def motion(s: Derivatives, time: Array) -> MotionSamples:
        return motion_of(by_flight_time(trajectory.at(s[0]), s), time)

    judge = Judge(motion=motion, shares=limits.shares, at_rest=limits.at_rest)
    return plan(judge, ceilings)


def _corners(trajectory: Trajectory, scenario: Scenario) -> list[float]:
    """Times (s) at which the path has a corner, or starts with nonzero speed from
    rest.
    """
    corners = []
    first = trajectory.at(0.0)
    # hover trim is at rest, whatever the reference begins with
    rest = replace(first, velocity=ZERO3, joint_rates=(0.0,) * len(first.joint_rates))
    if scenario.agent.initial is None and _is_corner(rest, first):
        corners.append(0.0)
    return [
        *corners,
        *(
            t
            for t in trajectory.switch_times()
            if 0.0 < t < scenario.duration
            and _is_corner(trajectory.at(t - JUMP), trajectory.at(t))
        ),
    ]


def _is_corner(before: Reference, after: Reference) -> bool:
    base = math.hypot(*map(float, after.velocity - before.velocity))
    joints = [
        abs(float(a) - float(b))
        for a, b in zip(before.joint_rates, after.joint_rates, strict=True)
    ]
    return base > CORNER[0] or max(joints, default=0.0) > CORNER[1]


SETTLES = 0.08
"""Averaging time (s) of the thrust direction that the planned attitude follows; the
average is taken twice. The attitude loop of a vehicle of this size reaches a commanded
tilt within about 0.15 s."""


_SLOWER = "lower values plan slower paths"


@immutable
class GovernorOptions:
    """Options of the path governor: reserve of the actuators, and limits of tilt,
    turning and joint speed.

    Attributes:
        reserve: share of rotors and joints that is left to the control: it plans with
            the rest.
        tilt: rad, of the base. turning: rad/s^2, angular acceleration of the base.
        joint_speed: rad/s or m/s, of every joint; servos have limits of their own
            besides.
    """

    reserve: Annotated[
        float,
        nonnegative(
            "",
            "fraction of rotor and joint limits reserved for feedback",
            high=0.9,
            effect="higher values plan slower paths and leave more for disturbances",
        ),
    ] = 0.2
    tilt: Annotated[
        float,
        positive(
            "rad", "largest tilt of the base on the governed path", effect=_SLOWER
        ),
    ] = 0.6
    turning: Annotated[
        float,
        positive(
            "rad/s^2",
            "largest angular acceleration of the base on the governed path",
            effect=_SLOWER,
        ),
    ] = 10.0
    joint_speed: Annotated[
        Scalar,
        positive(
            "rad/s or m/s",
            "largest speed of every joint on the governed path; servos add limits of"
            " their own",
            infinite=True,
            effect=_SLOWER,
        ),
    ] = math.inf

    def __post_init__(self) -> None:
        accept_fields(self, "reference.governor")
        # at pi/2 the thrust carries nothing
        if self.tilt > 1.5:
            raise ValueError(
                f"reference.governor.tilt = {self.tilt!r}: must be at most 1.5"
            )


class PathLimits:
    """Vehicle limits for the path governor, and the demands of a motion as fractions of
    these limits.

    Args:
        model: law's model. options: governor's options.
    """

    def __init__(self, model: Model, options: GovernorOptions) -> None:
        self._vehicle, self._options = model.vehicle, options
        self._gravity = float(model.gravity)
        mixer = make_mixer(model.vehicle)
        self._highest = np.array(mixer.highest, dtype=float)[:, None]
        # squared speeds that lift the weight without any torque
        weight = np.array([0.0, 0.0, 0.0, float(model.vehicle.mass) * self._gravity])
        lifting = np.array(mixer.inverse, dtype=float) @ weight
        # a rotor that lifts nothing in hover must not divide by 0
        self._hover = np.maximum(lifting[:, None], 1e-9 * self._highest)
        efforts = [
            # a passive joint asks no torque of anybody, so that it has no limit
            float(joint.effort_limit) or math.inf
            for joint in model.vehicle.joints
        ]
        self._efforts = np.array(efforts)[:, None]
        named = {each.name: each.drive for each in model.vehicle.drives}
        drives = [
            (i, named.get(joint.name)) for i, joint in enumerate(model.vehicle.joints)
        ]
        self._tip = model.vehicle.end_effector if model.vehicle.n else ""
        self._servos = [(i, drive) for i, drive in drives if isinstance(drive, Servo)]
        for i, servo in self._servos:
            self._efforts[i] = min(
                float(self._efforts[i, 0]), float(servo.largest_effort())
            )

    def names(self) -> list[str]:
        """Names of the vehicle limits, one for each row of the array of demands."""
        rotors = [rotor.name for rotor in self._vehicle.rotors]
        joints = self._vehicle.joint_names
        return [
            *(f"most of rotor {name!r}" for name in rotors),
            *(f"least of rotor {name!r}" for name in rotors),
            *(f"effort of joint {name!r}" for name in joints),
            *(f"speed of joint {name!r}" for name in joints),
            "tilt",
            "angular acceleration",
        ]

    def shares(self, motion: MotionSamples) -> Array:
        """Demands of a motion as fractions of the vehicle's limits, (limits, K): above
        1 is infeasible.
        """
        settled = self._window_means(motion.time)
        demand = demand_of_motion(self._vehicle, self._gravity, motion, settled)
        shares = self._shares(demand)
        if self._tip:
            # a law may hold the tip or the base: the vehicle must be able to do both
            motion = replace(
                motion, acceleration=motion.acceleration + self._shift(motion, settled)
            )
            demand = demand_of_motion(self._vehicle, self._gravity, motion, settled)
            shares = np.maximum(shares, self._shares(demand))
        return shares

    def _shift(self, motion: MotionSamples, settled: Callable[[Array], Array]) -> Array:
        """Extra base acceleration (m/s^2), shape (3, K), that keeps the tip on its path
        although the base tilts.
        """
        force = motion.acceleration + np.array([[0.0], [0.0], [self._gravity]])
        tip = frame_pose(
            self._vehicle, self._vehicle.frame(self._tip), tuple(motion.joints)
        ).p
        arm = np.stack([np.broadcast_to(doubles(c), len(motion.time)) for c in tip])
        c, s = np.cos(motion.yaw), np.sin(motion.yaw)
        level = np.stack([c * arm[0] - s * arm[1], s * arm[0] + c * arm[1], arm[2]])
        off = level - np.einsum("ijk,jk->ik", attitude(settled(force), motion.yaw), arm)
        velocity = np.gradient(off, motion.time, axis=1, edge_order=2)
        return settled(np.gradient(velocity, motion.time, axis=1, edge_order=2))

    def at_rest(self, motion: MotionSamples) -> Array:
        """Static demands of each posture of a motion as fractions of the limits,
        (limits, K): a lower bound.
        """
        nothing = np.zeros_like
        still = MotionSamples(
            time=motion.time,
            acceleration=nothing(motion.acceleration),
            yaw=motion.yaw,
            joints=motion.joints,
            rates=nothing(motion.rates),
            accelerations=nothing(motion.accelerations),
        )
        # turned by nothing but the posture, which does not change
        demand = demand_of_motion(self._vehicle, self._gravity, still, _upright)
        return self._shares(demand)

    def _shares(self, demand: ActuatorDemand) -> Array:
        most = 1.0 - float(self._options.reserve)
        up = demand.squared / (most * self._highest)
        # the least that a rotor is left with: the reserve's share of what it turns with
        # in hover
        least = (self._hover - demand.squared) / (self._hover * most)
        efforts = demand.effort_limits(self._efforts, self._servos)
        speeds = np.full_like(demand.rates, float(self._options.joint_speed))
        for i, servo in self._servos:
            speeds[i] = np.minimum(speeds[i], float(servo.speed_limit))
        attitude = [
            demand.tilt / float(self._options.tilt),
            demand.turning / float(self._options.turning),
        ]
        return np.vstack(
            [
                up,
                least,
                np.abs(demand.efforts) / (most * efforts),
                np.abs(demand.rates) / speeds,
                *attitude,
            ]
        )

    def _window_means(self, time: Array) -> Callable[[Array], Array]:
        """Smoothing function for a force: two moving averages over SETTLES seconds, a
        model of attitude lag.
        """
        step = float(time[1] - time[0]) if len(time) > 1 else SETTLES
        half = max(0, round(0.5 * SETTLES / step))

        def follow(force: Array) -> Array:
            for _ in range(2):
                force = _mean(force, half)
            return force

        return follow


def _upright(force: Array) -> Array:
    up = np.zeros_like(force)
    up[2] = 1.0
    return up


def _mean(rows: Array, half: int) -> Array:
    """Centred moving average over 2 half + 1 samples; the window shrinks symmetrically
    at the ends.
    """
    if half == 0:
        return rows
    padded = np.concatenate(
        [
            np.repeat(rows[:, :1], half, axis=1),
            rows,
            np.repeat(rows[:, -1:], half, axis=1),
        ],
        axis=1,
    )
    # differences of running sums: the cost does not grow with the window
    sums = np.cumsum(np.concatenate([np.zeros((len(rows), 1)), padded], axis=1), axis=1)
    width = 2 * half + 1
    return np.asarray((sums[:, width:] - sums[:, :-width]) / width)
