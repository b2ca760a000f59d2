"""Identification of command delays and of rotor and joint drive lags from a flight log.

They are found with what need not be modelled rightly, thrust, inertia, links and
friction, by the fit of a vehicle to windows that the engine flies (:mod:`window_fit`).

What is found is the time from a command to the *logged* rates. Where a log holds rates
as an on-board computer received them, their age is in it: of delays around a loop only
the sum is seen by what passes through it. A log of skyarm holds the true state, so that
its delay is that of the commands alone.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from skyarm.dynamics.actuators.servo import PositionServo
from skyarm.flight_data.flight_data import Channel, FlightData
from skyarm.flight_data.own_log import STATED
from skyarm.flight_data.quantities import GRAVITY
from skyarm.flight_data.series import middle
from skyarm.identify.identified_numbers import LAGS
from skyarm.identify.identified_parts import vehicle_with
from skyarm.identify.identify_windows import (
    FIRST,
    WHOLE,
    explained_shares,
    unknowns_of_sensors,
)
from skyarm.identify.logged_commands import time_constants
from skyarm.identify.unknowns import (
    USUAL_DELAY,
    Unknown,
    servo_of,
    unknowns_of,
    without_tilts,
)
from skyarm.identify.window_errors import WindowErrors
from skyarm.identify.window_fit import BLOCK, WindowFit, fit_windows
from skyarm.identify.windows import ClockedWindows, clock_step, on_clock
from skyarm.log.flight_log import Log
from skyarm.log.log_columns import drives_of, setpoints_of
from skyarm.records.arrays import Array, lengths
from skyarm.records.immutable import immutable
from skyarm.vehicle import MountedDrive, Vehicle


@immutable
class Estimated:
    """Estimated value with its 95 % confidence interval, SI units."""

    value: float
    low: float
    high: float

    @classmethod
    def of(cls, value: float, half: float) -> Estimated:
        """Create an estimate of a time with a symmetric confidence interval, cut at 0,
        the least possible value.
        """
        return cls(
            value=max(0.0, value),
            low=max(0.0, value - half),
            high=max(0.0, value + half),
        )


UNKNOWN = Estimated(value=math.nan, low=math.nan, high=math.nan)
"""Delay or lag that a log does not tell."""


@immutable
class Lag:
    """Identified command delay and time constants of the rotors or of one joint drive.

    Attributes:
        name: "rotors", or the joint's. together: s, dead time and lag, as a small swing
            meets them.
        delay: s, dead time. up, down: s, time constants of the first rotor; of a joint
            drive both are its own.
        factor: (up, down) ratio to the nominal time constants; NaN without nominal
            ones.
        explained: share of the motion, 0 to 1, that the commands explain once noise and
            slow disturbances are off.
        reason: why the log does not determine the lag, else empty. apart: whether delay
            and lag are separable.
    """

    name: str
    together: Estimated = UNKNOWN
    delay: Estimated = UNKNOWN
    up: Estimated = UNKNOWN
    down: Estimated = UNKNOWN
    explained: float = 0.0
    factor: tuple[float, float] = (math.nan, math.nan)
    reason: str = ""
    apart: bool = True

    @property
    def is_known(self) -> bool:
        """True if the flight log determines the actuator lag."""
        return not self.reason


@immutable
class LoopLags:
    """Command delays and actuator lags identified from a flight log.

    Attributes:
        period: s, of the control. seconds: duration of the log, s.
        rotors: lag of the rotors. joints: lags of torque-driven joints.
        left_out: joint -> reason why it was not identified.
    """

    period: float
    seconds: float
    rotors: Lag
    joints: tuple[Lag, ...]
    left_out: dict[str, str]


LONGEST, SLOWEST = 0.08, 0.5
"""Longest delay and time constant (s) that are considered."""

INSTANT, SHARE = 0.1, 0.01
"""Fractions of the control period and of the time itself that sampling and model errors
leave whatever the noise; no half-width of an interval is smaller than both together."""

CLEAR, WIDEST = 0.02, 0.01
"""Least fraction of the motion that commands must explain, and largest half-width (s)
of the interval of delay plus lag; otherwise the flight does not determine them."""

APART = 0.004
"""Half-width (s) of the delay's interval above which delay and lag cannot be
separated."""

STIRRING = 1e-5
"""Least change of commands per control period, as a fraction of their size."""

SHORTEST, UNEVEN = 1.0, 0.01
"""Shortest flight (s) that is analysed, and largest deviation of instants from an even
clock, as a fraction of a period."""

USUAL = 0.02
"""Assumed time constant (s) of joint drives."""

LATE, SLOW = 0.05, 1.5
"""Prior standard deviations of a delay (s) and of the logarithm of a time constant."""

SENSORS = ("gyro", "quaternion", "velocity", "joint_positions", "joint_rates")
"""Compared quantities; a position adds nothing to the velocity."""

ROTORS = "rotors"
"""Name of the rotors' lag."""

MODELLED = ("rotors.thrust_coefficient", "base.second_moment.", "links.", "drives.")
"""Prefixes of parameters that need not be modelled correctly: response to commands, the
arm, its friction and servos."""

FEW, PARTS = 40, 16
"""Number of windows at the beginning of the search, and least number of a flight at its
end."""


def loop_lags(log: Log, vehicle: Vehicle, gravity: float = GRAVITY) -> LoopLags:
    """Identify command delays and actuator lags from a flight log.

    Args:
        log: log of one flight, a row a control period.
        vehicle: nominal model: masses, rotors, and the lags to compare with.
        gravity: m/s^2.

    Raises:
        ValueError: in one line: the log does not fit the vehicle or is too short, or
            SciPy is missing.
    """
    period = _control_period(log, vehicle)
    logged = {**STATED, "joint_efforts": "efforts", "joint_commands": "efforts"}
    channels = {
        name: Channel(time=log.time, values=log[array], source=array)
        for name, array in logged.items()
        if log[array].size
    }
    flight = FlightData(name="log", file="", channels=channels)
    # a servo that the vehicle does not have is that of the flight
    setpoints = setpoints_of(log.info)
    flown = drives_of(log.info)
    servos = [name for name in flown if setpoints.get(name) == PositionServo.takes]
    drives = {name: MountedDrive(name=name, drive=flown[name]) for name in servos}
    drives |= {each.name: each for each in vehicle.drives}
    start = replace(without_tilts(vehicle), drives=tuple(drives.values()))
    # a drive that takes setpoints is a loop of its own, whose lag is no torque's
    names = vehicle.joint_names
    searched = {
        name: _delay_and_lags(
            f"drives.{name}.latency", **{f"drives.{name}.time_constant": USUAL}
        )
        for name, efforts in zip(names, log.efforts.T, strict=True)
        if name not in setpoints and _vary(efforts)
    }
    believed = time_constants(vehicle.rotors)[0].tolist()
    if _vary(log.rotor_commands):
        searched[ROTORS] = _delay_and_lags(
            "delay", **dict(zip(LAGS[1:], believed, strict=True))
        )
    driven = [name not in setpoints for name in names]
    # of a drive with a lag the means over the control periods act
    given = {
        f"drives.{name}.hold": 1.0
        for name, each in flown.items()
        if hasattr(each, "time_constant")
    }
    given |= {
        f"drives.{name}.time_constant": USUAL for name in names if name not in searched
    }
    fitted = (
        _fit(flight, start, driven, searched, given | {"setpoint_hold": 1.0}, gravity)
        if searched
        else None
    )

    def lag(name: str) -> Lag:
        if fitted is None or name not in searched:
            return Lag(name=name, reason="the commands hardly change")
        errors, fit = fitted
        return _lag(name, searched[name], errors, fit, period)

    of_rotors = lag(ROTORS)
    factor = of_rotors.up.value / believed[0], of_rotors.down.value / believed[1]
    return LoopLags(
        period=period,
        seconds=float(log.time[-1] - log.time[0]),
        rotors=replace(of_rotors, factor=factor),
        joints=tuple(lag(name) for name in names if name not in setpoints),
        left_out={
            name: f"its drive takes a setpoint, {setpoints[name] or 'of its own'}"
            for name in names
            if name in setpoints
        },
    )


def _control_period(log: Log, vehicle: Vehicle) -> float:
    """Control period of a log, s.

    Raises:
        ValueError: in one line: the log does not fit the vehicle, is too short, or its
            clock is not even.
    """
    rotors, joints = log.rotor_commands.shape[1], log.joints.shape[1]
    if not rotors or rotors != len(vehicle.rotors):
        raise ValueError(
            f"rotor_commands: the log has {rotors}, vehicle '{vehicle.name}'"
            f" {len(vehicle.rotors)} rotors"
        )
    if joints != vehicle.n:
        raise ValueError(
            f"joints: the log has {joints}, vehicle '{vehicle.name}' {vehicle.n}"
        )
    steps = np.diff(log.time)
    # a billionth is rounding
    if not len(steps) or log.time[-1] - log.time[0] < SHORTEST * (1.0 - 1e-9):
        span = log.time[-1] - log.time[0] if log.time.size else 0.0
        raise ValueError(
            f"time: {span:g} s are too short; at least {SHORTEST:g} s of flight are"
            " needed"
        )
    period = float(np.median(steps))
    if not period > 0.0 or np.abs(steps - period).max() > UNEVEN * period:
        raise ValueError("time: must be evenly spaced, one row a control period")
    # the middle of two attitudes of opposite signs is near 0
    if lengths(middle(log.quaternion)).min() < 0.5:
        raise ValueError("quaternion: must be of unit length and without jumps")
    return period


def _vary(commands: Array) -> bool:
    """True if logged commands, a row per control period, vary enough to identify the
    actuators' lag.
    """
    # of a ramp the steps are all alike: only their change shows a lag
    return bool(
        np.std(np.diff(commands, axis=0)) > STIRRING * np.sqrt(np.mean(commands**2))
    )


def _delay_and_lags(delay: str, **lags: float) -> list[Unknown]:
    """Search variables for a delay and time constants, from their names and usual time
    constants (s).
    """
    constants = [
        Unknown(name=name, unit="s", start=tau, spread=SLOW, positive=True)
        for name, tau in lags.items()
    ]
    return [Unknown(name=delay, unit="s", start=USUAL_DELAY, spread=LATE), *constants]


def _fit(
    flight: FlightData,
    start: Vehicle,
    driven: Sequence[bool],
    searched: Mapping[str, list[Unknown]],
    given: Mapping[str, float],
    gravity: float,
) -> tuple[WindowErrors, WindowFit]:
    """Fit delays and time constants by group to windows of a flight, together with
    nuisance parameters.
    """
    clocked = on_clock(
        flight,
        start,
        clock_step([flight], start),
        sections=[(-math.inf, math.inf)],
        sensors=SENSORS,
    )
    servoed = [
        not moved and servo_of(start, i) is not None for i, moved in enumerate(driven)
    ]
    usual = unknowns_of(
        start, curve=False, velocity=False, voltage=True, driven=driven, servoed=servoed
    )
    unknowns = [each for group in searched.values() for each in group]
    unknowns += [each for each in usual if each.name.startswith(MODELLED)]
    # no pose: that of a log is true, and not late
    unknowns += unknowns_of_sensors([])
    errors = WindowErrors(
        ClockedWindows([clocked], start, FIRST, FEW),
        start,
        unknowns,
        given,
        driven,
        servoed,
        gravity,
    )
    first = fit_windows(errors, np.array([each.begin for each in unknowns]))
    # the speeds of slow rotors follow from more of the past
    slow = vehicle_with(start, errors.numbers(first.values))
    part = min(BLOCK, max(FIRST, flight.duration / PARTS))
    errors = errors.over(ClockedWindows([clocked], slow, min(WHOLE, part)))
    return errors, fit_windows(errors, first.values, noise=first.noise, block=part)


def _lag(
    name: str,
    searched: list[Unknown],
    errors: WindowErrors,
    fit: WindowFit,
    period: float,
) -> Lag:
    """Identified delay and time constants of an actuator group, with intervals, or a
    reason if they are not determined.

    Args:
        name: name of the group.
        searched: unknown dead time, then time constants.
        errors: errors of the windows.
        fit: fit to them.
        period: s, of the control.
    """
    place = [errors.names.index(each.name) for each in searched]
    delay, *taus = errors.values(fit.values)[place].tolist()
    # the mean rate is what a small swing meets
    swing = len(taus) / sum(1.0 / tau for tau in taus)
    rows = np.zeros((1 + len(place), len(fit.values)))
    # slopes by the logarithms of the time constants, which are searched
    rows[0, place] = [1.0, *(swing**2 / (len(taus) * tau) for tau in taus)]
    rows[range(1, len(rows)), place] = [1.0, *taus]
    halves = fit.half_widths(rows)
    # errors of the model do not shrink with the number of windows, so they come on top
    halves = np.hypot(halves, INSTANT * period + SHARE * (abs(delay) + swing))
    numbers = zip((delay + swing, delay, *taus), halves.tolist(), strict=True)
    together, alone, up, *more = (Estimated.of(value, half) for value, half in numbers)
    shares, _ = explained_shares(errors, fit)
    rates = (
        [f"rate.{axis}" for axis in "xyz"] if name == ROTORS else [f"{name}.position"]
    )
    group_shares = [shares[each] for each in rates if each in shares]
    explained = sum(group_shares) / max(len(group_shares), 1)
    reason = ""
    if not np.isfinite(halves).all():
        reason = "the commands do not show in the motion"
    elif delay > LONGEST or max(taus) > SLOWEST:
        reason = "the best of them lies at the end of what is looked for"
    elif explained < CLEAR:
        reason = (
            f"the commands explain {explained:.1%} of the motion, under {CLEAR:.0%}"
        )
    elif halves[0] > WIDEST:
        reason = (
            f"delay and lag together are known to {1e3 * halves[0]:.0f} ms only, over"
            f" {1e3 * WIDEST:.0f} ms"
        )
    return Lag(
        name=name,
        together=together,
        delay=alone,
        up=up,
        down=more[0] if more else up,
        explained=explained,
        reason=reason,
        apart=bool(halves[1] <= APART),
    )
