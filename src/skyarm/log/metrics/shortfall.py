"""Check of a finished flight for saturated actuators and missed references.

A flight that comes to its end is not yet a success: a diverged law may fly on with its
commands cut, a tip may never press. Every summary of a flight (command line, JSON,
pages) says the same of it, from :attr:`skyarm.Log.shortfall`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from skyarm.log.flight_log import Log, rows_of
from skyarm.log.flown_scenario import restored_at, written_at
from skyarm.log.log_columns import names_of
from skyarm.log.metrics.accumulate import ROUNDING
from skyarm.log.metrics.interaction import BAND
from skyarm.log.metrics.metric import ActuatorLimits
from skyarm.log.metrics.path_distance import path_distance
from skyarm.log.metrics.score import wanted_push
from skyarm.log.metrics.windows import Windows, windows_of
from skyarm.log.periods import contact_pairs, points_at_tip, runs_of
from skyarm.records.arrays import AnyArray as Array
from skyarm.records.arrays import lengths
from skyarm.records.immutable import positional

LARGEST_ERROR = 0.5
"""Largest mean error (m) at the end of a flight; a base or tip beyond it has not
tracked its reference. Comparisons count a flight as lost by the same number."""

TILTED = np.radians(80.0)
"""Tilt (rad) above which comparisons and checks count a flight as lost; chosen: short
of level thrust, which bears no weight. Ten shipped flights tilt by 22 degrees at most
(measured)."""

LARGEST_TURN = 0.2
"""Largest mean error (rad) of the heading at the end of a flight, the shorter way
round; chosen. Ten shipped flights end within 0.005 rad (measured), and a vehicle that
does not begin to turn round is off by pi."""

SELDOM = 0.01
"""Fraction of periods below which commands exactly at a limit are not reported; a step
of the reference causes some. Chosen; nine shipped flights have none (measured)."""

PLACES = ("rad", "m")
"""Units of position setpoints."""


@positional
class Saturation:
    """Saturation of a flight's actuators: fraction of periods at a limit, and the worst
    command.

    Attributes:
        share: share of the control periods in which any command is at a limit.
        actuator: the one whose largest command is furthest beyond its limit.
        command, limit: largest size of its command, and the limit on its side, in
            ``unit``.
    """

    share: float
    actuator: str
    command: float
    limit: float
    unit: str

    @property
    def counts(self) -> bool:
        """True if the saturation is worth reporting: frequent, or with a command beyond
        its limit.
        """
        # nan counts
        return self.share >= SELDOM or not abs(self.command) <= (1.0 + ROUNDING) * abs(
            self.limit
        )

    def __str__(self) -> str:
        return (
            f"saturation: commands at or beyond limits in {100.0 * self.share:.3g} % of"
            f" the periods, most of all {self.actuator}: {self.command:.6g}"
            f" {self.unit}, limit {self.limit:.6g}"
        )


@positional
class Unreached:
    """Reference that a flight did not reach: position, tip, heading, force or phase.

    Attributes:
        reference: "position", "tip", "heading", "force" or "phase". start, stop:
            interval that was examined, s.
        words: description, with actual and desired value.
    """

    reference: str
    start: float
    stop: float
    words: str

    def __str__(self) -> str:
        return f"not reached: {self.words}"


@positional
class Shortfall:
    """Actuator saturation and missed references of a flight.

    Attributes:
        saturation: None where every command stayed within its limits.
        unreached: references, in the order of position, tip, heading, force, phases.
    """

    saturation: Saturation | None
    unreached: tuple[Unreached, ...]

    @property
    def lines(self) -> tuple[str, ...]:
        """Sentences on saturation and missed references; empty if the flight is without
        fault.
        """
        saturated = self.saturation is not None and self.saturation.counts
        return (
            *((str(self.saturation),) if saturated else ()),
            *map(str, self.unreached),
        )


def shortfall(log: Log) -> Shortfall:
    """Find saturated actuators and missed references in a log."""
    if not log.time.size:
        return Shortfall(None, ())
    desired, pushing = _desired_force(log)
    return Shortfall(
        _saturation(log),
        (
            *_missed_motion(log, pushing),
            *_missed_forces(log, desired),
            *_missed_phases(log),
        ),
    )


def _saturation(log: Log) -> Saturation | None:
    """Saturation of the actuators; None if no command reached a limit or the log has no
    vehicle.
    """
    beyond = np.zeros(log.time.size, dtype=bool)
    limited = list[tuple[float, str, float, float, str]]()
    for actuator, unit, sent, low, high in _actuator_limits(log):
        at_limit = _cut(sent - high, high, unit) | _cut(low - sent, low, unit)
        beyond |= at_limit
        # a command that is not a number is beyond every limit
        over = np.where(np.isfinite(sent), np.maximum(sent - high, low - sent), np.inf)
        worst = int(np.argmax(np.where(at_limit, over, -np.inf)))
        lowest, highest = (
            float(np.broadcast_to(each, sent.shape)[worst]) for each in (low, high)
        )
        # the side on which the command is furthest out
        limit = lowest if lowest - sent[worst] > sent[worst] - highest else highest
        if at_limit.any():
            limited.append(
                (
                    # relative to the limit, so that speeds and torques can be compared;
                    # 1 at a limit of zero
                    over[worst] / (abs(limit) or 1.0),
                    actuator,
                    float(sent[worst]),
                    limit,
                    unit,
                )
            )
    if not limited:
        return None
    _, actuator, command, limit, unit = max(limited, key=lambda each: each[0])
    return Saturation(float(beyond.mean()), actuator, command, limit, unit)


def _cut(over: Array, limit: float | Array, unit: str) -> Array:
    """True where a command is by ``over`` beyond a limit, or at it, and is therefore
    cut; NaN counts.

    An angle or a place at the end of its range is carried out as it is, and so is a
    rotor at rest; a speed or an effort at its limit was cut.
    """
    size = np.abs(limit)
    least = np.where((size == 0.0) | (unit in PLACES), ROUNDING, -ROUNDING) * np.where(
        size == 0.0, 1.0, size
    )
    return np.isfinite(limit) & ~(over < least)


def _actuator_limits(
    log: Log,
) -> Iterator[tuple[str, str, Array, float | Array, float | Array]]:
    """Yield name, unit, commands (N,), lower and upper limit of each limited actuator;
    they may change.
    """
    vehicle = restored_at(log.info, "plant.vehicle")
    if vehicle is None:
        return
    setpoints = names_of(log).setpoints
    limits = ActuatorLimits.of(vehicle, [unit is not None for unit in setpoints])
    ranges = limits.rotor_ranges(tuple(log.component("battery_voltage").T))
    for rotor, sent, (low, high) in zip(
        vehicle.rotors, log.rotor_commands.T, ranges, strict=True
    ):
        yield f"rotor {rotor.name}", "rad/s", sent, low, high
    tilting = [rotor for rotor in vehicle.rotors if rotor.tilt is not None]
    for rotor, sent in zip(tilting, log.tilt_commands.T, strict=True):
        yield (
            f"tilt of rotor {rotor.name}",
            "rad",
            sent,
            float(rotor.tilt.lower),
            float(rotor.tilt.upper),
        )
    for link, sent, unit in zip(vehicle.links, log.efforts.T, setpoints, strict=True):
        joint, effort = link.joint, float(link.joint.effort_limit)
        if unit is None and effort > 0.0:  # a passive joint has no actuator
            yield f"joint {joint.name}", joint.units[1], sent, -effort, effort
        elif unit in ("rad", "m"):  # a rate has no limit of the joint's
            yield f"joint {joint.name}", unit, sent, *joint.ends


def _missed_motion(log: Log, pushing: Array) -> Iterator[Unreached]:
    """Yield references of base, tip and heading that the flight misses by a large mean
    error at its end.

    A reference may lag behind its plan: the distance to the path counts. While the tip
    presses its reference lies anywhere along the normal. The heading is the one that
    the law got.
    """
    duration, end = float(log.info["duration"]), float(log.time[-1])
    # the last seconds before the planned end; of a flight that ended early its last
    # instant
    start = min(duration - Windows().of_flight(duration, windows_of(log)).last, end)
    first = int(np.searchsorted(log.time, start))
    tail, free = rows_of(log, slice(first, None)), ~pushing[first:]
    arrays = {"position": ("base", "position")}
    if not np.array_equal(log.tip, log.position):
        arrays["tip"] = "tip", "tool"
    missed = dict[str, str]()
    for what, (body, name) in arrays.items():
        flown, desired = tail[name][free], f"{name}_reference"
        if log.path_time.size and not log.phase.size:
            errors = path_distance(flown, log[desired])
        else:
            errors = lengths(flown - tail[desired][free])
        error = float(errors.mean()) if errors.size else 0.0
        if not error <= LARGEST_ERROR:
            missed[what] = f"reference of the {body}, {error:.3g} m"
    # wrapped, because a heading of 359 degrees is one degree off
    off = tail.euler[:, 2] - tail.yaw_held
    turn = float(np.abs(np.arctan2(np.sin(off), np.cos(off))).mean())
    if not turn <= LARGEST_TURN:
        missed["heading"] = f"heading of the base, {math.degrees(turn):.3g} degrees"
    for what, of in missed.items():
        words = f"{of} off in the mean from {start:g} s on"
        yield Unreached(what, start, end, words)


def _desired_force(log: Log) -> tuple[Array, Array]:
    """Commanded contact force (N) over time, and a mask of the instants at which the
    tip presses or grips.
    """
    try:
        push = wanted_push(log) if written_at(log.info, "reference.push") else ()
    except ValueError:  # of a plugin that is not loaded
        push = ()
    if not push:
        return np.zeros(log.time.size), np.zeros(log.time.size, dtype=bool)
    # the sixth number is above 0.5 while the tip grips; a push without a grip has five
    gripping = push[5] > 0.5 if len(push) > 5 else np.zeros(log.time.size, dtype=bool)
    force = np.where(gripping, 0.0, push[0])  # what is gripped is not touched
    return force, (force > 0.0) | gripping


def _missed_forces(log: Log, desired: Array) -> Iterator[Unreached]:
    """Yield the commanded contacts whose force stayed too small."""
    force = _force_at_tip(log)
    for first, after in runs_of(desired > 0.0):
        most, aim = float(force[first:after].max()), float(desired[first:after].max())
        # as in the metric contact_held, so that both say the same of a force
        if most < (1.0 - BAND) * aim:
            start, stop = float(log.time[first]), float(log.time[after - 1])
            words = (
                f"force of the push from {start:g} to {stop:g} s, at most {most:.3g} N"
                f" of {aim:.3g} N"
            )
            yield Unreached("force", start, stop, words)


def _force_at_tip(log: Log) -> Array:
    """Sum of the contact forces (N) at the tip over time."""
    at_tip = points_at_tip(log)
    chosen = [k for k, (_, point) in enumerate(contact_pairs(log)) if point in at_tip]
    force = (
        log.component("contact_force")[:, chosen]
        if chosen
        else log.component("contact_force")
    )
    return force.sum(axis=1) if force.size else np.zeros(log.time.size)


def _missed_phases(log: Log) -> Iterator[Unreached]:
    """Yield a missed reference that names all phases that never ended."""
    ends = [0.0, *(end for _, end in log.phase_ends if end is not None)]
    names = [
        f"{number} ({name})"
        for number, (name, end) in enumerate(log.phase_ends, 1)
        if end is None
    ]
    if names:
        words = f"end of phase {', '.join(names)}"
        yield Unreached("phase", ends[-1], float(log.time[-1]), words)
