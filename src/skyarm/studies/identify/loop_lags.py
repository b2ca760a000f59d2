"""Identification of command delays and of rotor and joint drive lags from a flight log.

Motion gives by inverse dynamics the forces that acted; commands, a dead time and a first-order lag give those that
should have. The dead time and the time constants by which both agree best are found by least squares
(:mod:`whitened_fit`), each with an interval. The strength of each row (roll, pitch, yaw, thrust) and the joints'
viscous friction are found with them: they need not be modelled rightly.

What is found is the time from a command to the *logged* rates. Where a log holds rates as an on-board computer received
them, their age is in it: of delays around a loop only the sum is seen by what passes through it. A log of skyarm holds
the true state, so that its delay is that of the commands alone.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import numpy as np

from skyarm.flight_data.quantities import GRAVITY
from skyarm.log.flight_log import Log
from skyarm.log.log_columns import setpoints_of
from skyarm.records.arrays import Array
from skyarm.records.files.toml import toml_key
from skyarm.records.immutable import immutable
from skyarm.studies.identify.lagged_inputs import (
    Needed,
    believed_lags,
    model_forces,
    pushes_of,
    require_finite,
    wrench_of_pushes,
)
from skyarm.studies.identify.logged_commands import highest_speeds, time_constants
from skyarm.studies.identify.rotor_lag import lag_response
from skyarm.studies.identify.whitened_fit import Fit, blocks_of, fit
from skyarm.vehicle.vehicle_records import Vehicle


@immutable
class Estimated:
    """Estimated number with its 95 % confidence interval, SI units."""

    value: float
    low: float
    high: float

    @classmethod
    def of(cls, value: float, half: float, *, least: float = 0.0) -> Estimated:
        """Create an estimate with a symmetric confidence interval, cut at the least possible value."""
        return cls(value=value, low=max(least, value - half), high=value + half)


@immutable
class Lag:
    """Identified command delay and time constants of the rotors or of one joint drive.

    Attributes:
        name: "rotors", or the joint's. together: s, dead time and lag, as a small swing meets them.
        delay: s, dead time. up, down: s, time constants of rotors; of a joint drive both are its own.
        factor: (up, down) ratio to the nominal time constants; NaN without nominal ones.
        explained: share of the motion, 0 to 1, that the commands explain once noise and slow disturbances are off.
        reason: why the log does not determine the lag, else empty. apart: whether delay and lag are separable.
    """

    name: str
    together: Estimated
    delay: Estimated
    up: Estimated
    down: Estimated
    explained: float
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
        period: s, of the control. seconds: of the log.
        rotors: lag of the rotors, None without any. joints: lags of torque-driven joints.
        left_out: joint -> reason why it was not identified.
    """

    period: float
    seconds: float
    rotors: Lag | None
    joints: tuple[Lag, ...]
    left_out: dict[str, str]


PHYSICS_STEP = 0.001
"""s, of the usual physics, of which a command's delay is a whole number."""


def lag_tables(found: LoopLags, measured: float = 0.0) -> str:
    """TOML tables of the identified delays, rotor time constants and joint drives; empty if none was identified.

    Args:
        found: in a log.
        measured: additional nominal measurement delay, s, of logs with true rates.
    """
    lines: list[str] = []
    rotors = found.rotors
    if rotors is not None and rotors.is_known:
        periods = round((measured + rotors.delay.value) / found.period)
        lines += [
            "# scenario: what the plant has, in whole physics steps",
            "[delays]",
            f"command = {round(rotors.delay.value / PHYSICS_STEP) * PHYSICS_STEP:.3f}  {_from(rotors.delay)}",
            "",
            "# what a law may be given, as an option of its law: centroidal, and others",
            f"# controller.delay = {periods * found.period:.6g}",
            f"# controller.delay_periods = {periods}",
            "",
            "# vehicle file, each of [[rotors]]",
            f"# time_constant_up = {rotors.up.value:.4f}  {_from(rotors.up)}",
            f"# time_constant_down = {rotors.down.value:.4f}  {_from(rotors.down)}",
            "",
        ]
    for joint in found.joints:
        # a lag that its interval does not tell from none is none; where delay and lag are one, it stands for both
        lagging = joint.up.low > PHYSICS_STEP if joint.apart else joint.together.low > found.period
        if joint.is_known and lagging:
            beside = f"beside a delay of {1e3 * joint.delay.value:.1f} ms"
            lines += [
                f"[plant.drives.{toml_key(joint.name)}]",
                'kind = "lagged_torque"',
                f"time_constant = {joint.up.value:.4f}  {_from(joint.up)}; {beside}",
                "",
            ]
    return "\n".join(lines)


def _from(found: Estimated) -> str:
    return f"# {1e3 * found.low:.2f} to {1e3 * found.high:.2f} ms"


LONGEST = 0.08
"""s, longest delay that is looked for."""

LOWEST_FACTOR, HIGHEST_FACTOR = 0.1, 8.0
"""Time constants that are looked for, over what is believed."""

LEAST_LAG, MOST_LAG = 5e-4, 0.2
"""s, time constants of a joint drive that are looked for."""

INSTANT, SHARE = 0.1, 0.03
"""Of a control period and of the time itself: what sampling and a model that is never quite right leave, whatever the
noise; no half of an interval is smaller than both together."""

CLEAR, WIDEST = 0.02, 0.01
"""Least share of the motion that commands must explain, and the widest half of an interval of delay and lag together,
s: else the flight does not tell."""

APART = 0.004
"""Half of an interval of the delay alone, s, beyond which it cannot be separated from the lag."""

STIRRING = 1e-5
"""Of the size of commands, least change from one control period to the next."""

DELAY_STEP, FACTOR_STEP, GAIN_STEP = 2.5e-4, 0.03, 0.02
"""Of differences: s, and of logarithms."""


def loop_lags(log: Log, vehicle: Vehicle, gravity: float = GRAVITY) -> LoopLags:
    """Identify command delays and actuator lags from a flight log.

    Args:
        log: of one flight, a row a control period.
        vehicle: nominal model: masses, rotors, and the lags to compare with.
        gravity: m/s^2.

    Raises:
        ValueError: in one line: the log does not fit the vehicle or is too short, or SciPy is missing.
    """
    rotors = len(vehicle.rotors)
    if log.rotor_commands.shape[1] != rotors:
        count = log.rotor_commands.shape[1]
        raise ValueError(f"rotor_commands: the log has {count}, vehicle '{vehicle.name}' {rotors} rotors")
    require_finite(log, "rotor_commands", "efforts")
    motion = model_forces(vehicle, log, gravity)
    setpoints = setpoints_of(log.info)
    names = [link.joint.name for link in vehicle.links]
    left_out = {
        name: f"its drive takes a setpoint, {setpoints[name] or 'of its own'}" for name in names if name in setpoints
    }
    return LoopLags(
        period=motion.period,
        seconds=float(log.time[-1] - log.time[0]),
        rotors=rotor_lag(vehicle, log, motion) if rotors else None,
        joints=tuple(joint_lag(name, log, motion, i) for i, name in enumerate(names) if name not in setpoints),
        left_out=left_out,
    )


def rotor_lag(vehicle: Vehicle, log: Log, motion: Needed) -> Lag:
    """Identify the delay of the rotor commands and the rotors' time constants."""
    up, down = believed_lags(vehicle.rotors)
    commands = np.clip(log.rotor_commands, 0.0, highest_speeds(vehicle.rotors))
    if not _vary_enough(commands):
        return _unknown_lag("rotors", "the commands hardly change")
    matrix = wrench_of_pushes(vehicle.rotors)
    rows = [i for i in range(6) if np.abs(matrix[i]).max() > 1e-9 * np.abs(matrix).max()]

    def predict(numbers: Array) -> Array:
        factors = np.exp(numbers[:, 1:3])
        lags = factors[:, :1] * up, factors[:, 1:2] * down
        _, squares, _ = lag_response(commands[:-1], motion.period, numbers[:, 0], *lags)
        return pushes_of(vehicle.rotors, squares) @ matrix[rows].T

    found = _fit(
        predict,
        motion.wrench[:, rows],
        motion.period,
        starts=np.log([0.5, 1.0, 2.0, 4.0]),
        bounds=(math.log(LOWEST_FACTOR), math.log(HIGHEST_FACTOR)),
        constants=2,
    )
    lag = _lag("rotors", found, motion.period, np.array([up.mean(), down.mean()]))
    known = time_constants(vehicle.rotors)[0] > 0.0
    up_factor, down_factor = np.where(known, np.exp(found.values[1:3]), math.nan).tolist()
    return dataclasses.replace(lag, factor=(up_factor, down_factor))


def joint_lag(name: str, log: Log, motion: Needed, joint: int) -> Lag:
    """Identify the delay of a joint's commands and the lag of its drive."""
    commands = log.efforts[:, joint : joint + 1]
    if not _vary_enough(commands):
        return _unknown_lag(name, "the commands hardly change")
    rate = motion.joint_rates[:, joint : joint + 1]

    def predict(numbers: Array) -> Array:
        tau = np.exp(numbers[:, 1:2])
        return lag_response(commands[:-1], motion.period, numbers[:, 0], tau, tau)[0]

    scale = float(np.std(motion.efforts[:, joint])) / max(float(np.std(rate)), 1e-9)
    found = _fit(
        predict,
        motion.efforts[:, joint : joint + 1],
        motion.period,
        starts=np.log([0.001, 0.01, 0.03, 0.08]),
        bounds=(math.log(LEAST_LAG), math.log(MOST_LAG)),
        constants=1,
        friction=scale * rate,
    )
    return _lag(name, found, motion.period, np.ones(1))


def _lag(name: str, found: Fit, period: float, nominal: Array) -> Lag:
    """Identified delay and time constants, with confidence intervals, from the parameters of a least-squares fit.

    Args:
        name: of the group.
        found: its parameters are the dead time, then the logarithms of each time constant over the nominal one.
        period: s, of the control.
        nominal: time constants, s: one of a joint drive, that up and that down of rotors.
    """
    taus = np.exp(found.values[1 : 1 + len(nominal)]) * nominal
    # the mean rate is what a small swing meets
    middle = len(taus) / (1.0 / taus).sum()
    weights = [1.0, *(middle**2 / (len(taus) * taus))]
    total = float(found.values[0] + middle)
    floor = INSTANT * period + SHARE * total
    halves = [_half(found, row.tolist()) for row in np.eye(1 + len(taus))]
    constants = [_constant(float(tau), half, floor) for tau, half in zip(taus, halves[1:], strict=True)]
    lag = Lag(
        name=name,
        together=Estimated.of(total, math.hypot(_half(found, weights), floor)),
        delay=Estimated.of(float(found.values[0]), math.hypot(halves[0], floor)),
        up=constants[0],
        down=constants[-1],
        explained=found.explained,
    )
    return _with_verdict(lag, found)


def _fit(
    predicted: Callable[[Array], Array],
    measured: Array,
    period: float,
    *,
    starts: Array,
    bounds: tuple[float, float],
    constants: int,
    friction: Array | None = None,
) -> Fit:
    """Least-squares fit of dead time, time constants, a gain per signal, and optionally viscous friction.

    Args:
        predicted: (candidates, own parameters) -> (candidates, N, rows).
        measured: (N, rows).
        period: s.
        starts: logarithms of the time constants at which the search may begin.
        bounds: of these logarithms.
        constants: how many time constants there are.
        friction: (N, 1) effect of a friction coefficient of 1.
    """
    own, rows, more = 1 + constants, measured.shape[1], int(friction is not None)
    aim = np.cumsum(measured, axis=0) * period

    def left(candidates: Array) -> Array:
        # candidates that differ in strength alone share a prediction
        dynamic, place = np.unique(candidates[:, :own], axis=0, return_inverse=True)
        force = predicted(dynamic)[place.ravel()] * np.exp(candidates[:, None, own : own + rows])
        if friction is not None:
            force = force - candidates[:, None, own + rows :] * friction
        return aim - np.cumsum(force, axis=1) * period

    # a constant force explains a straight line: what is left of it is what commands could explain
    time = np.linspace(-1.0, 1.0, len(aim))[:, None]
    moved = aim - aim.mean(axis=0) - time * (time * aim).sum(axis=0) / (time**2).sum()
    gains, (low, high) = [1.5] * rows + [3.0] * more, bounds
    first = [[delay, *[x] * constants, *[0.0] * len(gains)] for delay in np.arange(0.0, 0.045, 0.005) for x in starts]
    return fit(
        left,
        moved,
        np.array(first),
        (
            np.array([0.0, *[low] * constants, *(-each for each in gains)]),
            np.array([LONGEST, *[high] * constants, *gains]),
        ),
        np.array([DELAY_STEP, *[FACTOR_STEP] * constants, *[GAIN_STEP] * len(gains)]),
        blocks_of(len(measured) * period),
        measured.std(axis=0) * period,
    )


def _half(found: Fit, weights: list[float]) -> float:
    return found.half_width([*weights, *[0.0] * (len(found.values) - len(weights))])


def _constant(value: float, half: float, floor: float) -> Estimated:
    """Estimated time constant, s, with a confidence interval from the half-width of its logarithm."""
    width = math.hypot(min(half, 5.0), floor / value)
    return Estimated(value=value, low=value * math.exp(-width), high=value * math.exp(width))


def _with_verdict(lag: Lag, found: Fit) -> Lag:
    """Identified lag with the reason, if any, why the flight log does not determine it."""
    half = lag.together.high - lag.together.value
    alone = lag.delay.high - lag.delay.value
    reason = ""
    if not np.isfinite(found.covariance).all() or not math.isfinite(half):
        reason = "the commands do not show in the motion"
    elif found.beyond.any():
        reason = "the best of them lies at the end of what is looked for"
    elif found.explained < CLEAR:
        reason = f"the commands explain {found.explained:.1%} of the motion, under {CLEAR:.0%}"
    elif half > WIDEST:
        reason = f"delay and lag together are known to {1e3 * half:.0f} ms only, over {1e3 * WIDEST:.0f} ms"
    return dataclasses.replace(lag, reason=reason, apart=alone <= APART)


def _vary_enough(commands: Array) -> bool:
    """True if logged commands (N, actuators) vary enough to identify the actuators' lag."""
    return bool(np.std(np.diff(commands, axis=0)) > STIRRING * np.sqrt(np.mean(commands**2)))


def _unknown_lag(name: str, reason: str) -> Lag:
    none = Estimated(value=math.nan, low=math.nan, high=math.nan)
    return Lag(name=name, together=none, delay=none, up=none, down=none, explained=0.0, reason=reason)
