"""Metrics of a log, computed by the same functions as during a flight."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache, reduce
from itertools import compress

import numpy as np

from skyarm.algebra import Quaternion, Scalars, Vec3
from skyarm.compile import trace
from skyarm.compile.llvm.kernel import Kernel
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.compile.machine_code import NoMachineCodeError
from skyarm.compile.tracing.array_evaluation import evaluate
from skyarm.compile.tracing.program import trace_loop
from skyarm.dynamics import State
from skyarm.dynamics.actuators import Command
from skyarm.log.flight_log import PIECE, Log, rows_of
from skyarm.log.flown_scenario import restored_at, written_at
from skyarm.log.formats import as_log
from skyarm.log.log_columns import names_of
from skyarm.log.metrics.accumulate import (
    ADDED,
    CONTINUOUS,
    Total,
    Totals,
    advance_totals,
    first_totals,
    quantity,
)
from skyarm.log.metrics.interaction import TOTALS
from skyarm.log.metrics.metric import ActuatorLimits, MetricGoal, MetricInstant
from skyarm.log.metrics.metric_catalogue import names_by_agent, required_totals, values
from skyarm.log.metrics.windows import Window, Windows, windows_of
from skyarm.log.sensor_data import COMPONENTS
from skyarm.records.arrays import Array, doubles
from skyarm.records.files import PathLike, shown
from skyarm.records.leaves import Tree, leaves, rebuild
from skyarm.world.component import COLLISIONS, columns_of_agent


def score(
    log: Log | PathLike,
    metrics: Sequence[str] = ("standard",),
    windows: Windows | None = None,
) -> dict[str, float]:
    """Compute metrics of a logged flight, by metric name.

    Args:
        log: log of the flight, or the path of its file.
        metrics: names and groups (:mod:`skyarm.log.metrics.metric_catalogue`),
            registered ones too.
        windows: time windows, in place of those of the scenario.

    Returns:
        metric by name, of several vehicles as ``left/tilt_max``; NaN where no instant
        of the flight lies in its window: the flight ended before it.

    Raises:
        ValueError: no log, no windows, an unknown metric, or a window that ends after
            the planned flight.
    """
    log = as_log(log)
    if not isinstance(windows, (Windows, type(None))):
        raise ValueError(f"windows = {shown(windows)}: must be Windows or None")
    listed = names_by_agent(
        metrics, {name: _setpoints(own) for name, own in log.agents.items()}
    )
    return {
        name: number
        for agent, own in log.agents.items()
        for name, number in _score_of_agent(own, listed[agent], windows).items()
    }


def _setpoints(log: Log) -> list[bool]:
    """For each joint of a logged vehicle, True if its command is a setpoint in place of
    a torque.
    """
    return [unit is not None for unit in names_of(log).setpoints]


def _score_of_agent(
    log: Log, names: Mapping[str, str], windows: Windows | None
) -> dict[str, float]:
    """Metrics of one vehicle's log, by their names among the results."""
    joints = log.joints.shape[1]
    counted = required_totals([*names.values()], joints)
    at = (windows or Windows()).of_flight(float(log.info["duration"]), windows_of(log))
    masks = at.masks(log.time)
    used = tuple(dict.fromkeys(window for _, window, _ in counted))
    totals = first_totals(counted)
    # the user's own metric may have changed since a program was made with it
    own = any(kind == ADDED and name not in TOTALS for kind, _, name in counted)
    make = _make_counter if own else _kept_counter
    memory: Sequence[float] = [float(each) for each in leaves(totals)]
    for begin in range(0, max(log.time.size, 1), PIECE):
        # with the instant before the piece, whose commands are the ones before
        rows = slice(max(begin - 1, 0), begin + PIECE)
        instants = _instants(rows_of(log, rows), whole=True)
        columns = [doubles(leaf) for leaf in leaves(instants)]
        columns += [masks[name][rows].astype(float) for name in used]
        example = rebuild(instants, [0.0] * len(leaves(instants)))
        count_on = make(tuple(counted), used, totals, example)
        memory = count_on(memory, np.stack(columns, axis=1)[begin - rows.start :])
    last = dict(
        zip(counted, rebuild(totals, [np.array([x]) for x in memory]), strict=True)
    )
    count = {name: np.array([int(mask.sum())]) for name, mask in masks.items()}
    period = 1.0 / float(log.info["rates_hz"]["control"])
    scores = values([*names.values()], last, count, joints, period)
    return {name: float(scores[each][0]) for name, each in names.items()}


def _make_counter(
    counted: tuple[Total, ...],
    used: tuple[str, ...],
    totals: Totals,
    instant: MetricInstant,
) -> Callable[[Sequence[float], Array], Sequence[float]]:
    """Make the function that updates the totals of metrics over all instants (N,
    numbers) of a log.

    Args:
        counted: definitions of the totals.
        used: windows that they count in.
        totals: totals to begin with, as an example.
        instant: an instant, as an example.
    """

    def step(
        before: Totals, _: Tree, row: tuple[MetricInstant, Scalars], __: Scalars
    ) -> tuple[Totals, tuple[()]]:
        now, flags = row
        inside = {name: flag > 0.5 for name, flag in zip(used, flags, strict=True)}
        return advance_totals(before, counted, now, inside), ()

    loop = trace_loop(step, totals, (), (instant, (0.0,) * len(used)))
    try:
        # effort 0: the code counts one log at a time, so that it is to be made quickly
        kernel = Kernel(loop, Lanes(1), effort=0)
    # without machine code the same loop runs in Python floats
    except NoMachineCodeError:
        count = loop.stepper()
        return lambda start, rows: reduce(
            lambda memory, row: count((*memory, *row)), rows.tolist(), tuple(start)
        )
    return lambda start, rows: kernel.run(np.array([start]).T, np.zeros((0, 1)), rows)[
        0
    ][:, 0].tolist()


# by the metrics' names, with which logs are asked again; 32 is chosen: a miss costs up
# to 0.1 s (measured)
_kept_counter = lru_cache(maxsize=32)(_make_counter)

SETTLING_BAND = 0.02
"""Distance (m) from its steady mean within which the position error has settled;
chosen, as the paper tells no rule. In Case 3 half and twice of it give 22.8 and 21.9 s
for 22.0 s (measured)."""


def settling_time(log: Log, steady: Window, *, continuous: bool = False) -> float:
    """Time (s) from which the position error stays within 0.02 m of its steady mean;
    NaN if it never does.

    Args:
        log: log of the flight.
        steady: window of the mean.
        continuous: against the continuous reference in place of the held samples.

    Returns:
        NaN if it never settles, or no instant lies in the window.
    """
    error = over_log(log, f"position{CONTINUOUS}" if continuous else "position")
    values = error[steady.of(log)]
    if not values.size:
        return float("nan")
    outside = np.flatnonzero(np.abs(error - values.mean()) > SETTLING_BAND)
    # the first instant after the last one outside
    after = int(outside[-1]) + 1 if outside.size else 0
    return float(log.time[after]) if after < log.time.size else float("nan")


def over_log(log: Log, name: str) -> Array:
    """Compute the time series (N,) of a named quantity, such as the position error,
    from a log.
    """
    instants = _instants(log)
    columns = leaves(instants)
    program = trace(
        lambda now: quantity(name, now), rebuild(instants, [0.0] * len(columns))
    )
    row: Array = evaluate(program, columns, log.time.size)[0]
    return row


def _instants(log: Log, *, whole: bool = False) -> MetricInstant:
    """Convert a log to the input of the metrics: one dataclass with an array (N,) for
    every number.
    """

    def rows(table: Array) -> tuple[Array, ...]:
        return tuple(table.T)

    def goal(kind: str) -> MetricGoal:
        position, joints, tool = (
            getattr(log, f"{name}_{kind}") for name in ("position", "joints", "tool")
        )
        return MetricGoal(
            position=Vec3(*position.T), joints=rows(joints), tool=Vec3(*tool.T)
        )

    state = State(
        position=Vec3(*log.position.T),
        quaternion=Quaternion(*log.quaternion.T),
        velocity=Vec3(*log.velocity.T),
        rate=Vec3(*log.rate.T),
        joints=rows(log.joints),
        joint_rates=rows(log.joint_rates),
        rotor_speeds=rows(log.rotor_speeds),
        tilts=rows(log.tilts),
    )
    parts = _parts(log) if whole else ()
    # at the first instant nothing has changed yet
    before = np.vstack([log.rotor_commands[:1], log.rotor_commands[:-1]])
    return MetricInstant(
        state=state,
        tool=Vec3(*log.tool.T),
        command=Command(
            rotor_speeds=rows(log.rotor_commands),
            efforts=rows(log.efforts),
            tilts=rows(log.tilt_commands),
        ),
        before=rows(before),
        held=goal("held"),
        continuous=goal("reference"),
        lag=log.time - log.path_time if log.path_time.size else np.zeros(log.time.size),
        phase=log.phase if log.phase.size else np.zeros(log.time.size),
        time=log.time,
        push=wanted_push(log) if parts else (),
        parts=parts,
        limits=_limits(log) if whole else None,
    )


def _limits(log: Log) -> ActuatorLimits | None:
    """Actuator limits of a log as arrays (N,); None if the log does not describe its
    vehicle.
    """
    vehicle = restored_at(log.info, "plant.vehicle")
    if vehicle is None:
        return None
    limits = ActuatorLimits.of(vehicle, _setpoints(log))
    return rebuild(
        limits, [np.full(log.time.size, float(limit)) for limit in leaves(limits)]
    )


def _parts(log: Log) -> tuple[tuple[str, tuple[Array, ...]], ...]:
    """Logged arrays and constants of a flight's wind, force and contact models, as
    arrays by name.
    """
    arrays = tuple(
        (name.partition(".")[2], tuple(each.T))
        for name, each in log.received.items()
        if name.startswith(COMPONENTS)
    )
    # a log without its scenario knows neither constants nor whose columns are whose
    if not arrays or not log.info.get("scenario_record"):
        return arrays
    scenario = log.scenario
    # each log of a team is scored with itself as the only vehicle of its scenario
    own = columns_of_agent(scenario.components, next(iter(scenario.agents)))
    constants = [
        each
        for component in scenario.components
        for each in component.constants.items()
    ]
    return (
        *(
            # the scenario of one of several knows its own pairs of bodies alone
            (
                name,
                columns if name in COLLISIONS else tuple(compress(columns, own[name])),
            )
            for name, columns in arrays
        ),
        *(
            (name, tuple(np.full(log.time.size, float(c)) for c in numbers))
            for name, numbers in constants
        ),
    )


def wanted_push(log: Log) -> tuple[Array, ...]:
    """Commanded contact force, direction and grip at every instant of a log; () for a
    flight without any.

    Raises:
        ValueError: as of :attr:`skyarm.Log.scenario`.
    """
    path = "reference.push"
    if written_at(log.info, path) is None:
        return ()
    # the reference alone, which needs no plugin of the law
    push = restored_at(log.info, path) or log.scenario.agent.reference.push
    # the push is planned over the time of the path
    times = log.path_time if log.path_time.size else log.time
    program = trace(lambda t: tuple(push.at(t)), 0.0)
    return tuple(evaluate(program, [times], log.time.size))
