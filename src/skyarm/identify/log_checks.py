"""Checks of a measured flight without a model: missing, cut off, frozen or saturated
channels, and wrong units.
"""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from skyarm.flight_data.flight_data import Channel, FlightData
from skyarm.flight_data.own_log import SIMULATED
from skyarm.flight_data.quantities import GRAVITY, QUANTITIES
from skyarm.identify.logged_commands import (
    AIRBORNE,
    SETTLING,
    command_samples,
    commanded_speeds,
    flying_spans,
    lift,
)
from skyarm.identify.slow_commands import slow_commands
from skyarm.log.periods import runs_of
from skyarm.records.arrays import Array, Mask, lengths
from skyarm.records.files import one_line, shipped_tables
from skyarm.records.immutable import immutable
from skyarm.vehicle import Vehicle

REFUSED, WARNED = "refused", "warned"
"""Severities: an identification from such a flight would be wrong, or less accurate."""


@immutable
class LogFault:
    """Fault of a measured flight.

    Attributes:
        severity: REFUSED or WARNED.
        file: file of the flight.
        channel: quantity, or what the fault is about.
        finding: text of what is wrong, with its numbers.
        remedy: text of what to do.
    """

    severity: str
    file: str
    channel: str
    finding: str
    remedy: str

    @property
    def words(self) -> str:
        """The fault as one line: file, channel, finding and remedy."""
        return one_line(f"{self.file}: {self.channel}: {self.finding}; {self.remedy}")


Found = tuple[str, str, str, str]
"""Severity, channel, finding, remedy."""

IMU, COMMANDS = ("gyro", "accelerometer"), ("rotor_commands", "rotor_speed_commands")
"""Channels without which identification is impossible; channels of rotor commands, one
of which is needed."""

USED = (*IMU, *COMMANDS, "joint_positions")
"""Channels whose damage spoils estimates."""

CUT, UNIT = (
    "cut the flight to a section without it (--begin, --end)",
    "state its unit in columns.toml",
)
RANGE = "state low and high in columns.toml"


def require_no_refusal(faults: Sequence[LogFault]) -> None:
    """Raise an error if any fault makes a flight unusable for identification.

    Raises:
        ValueError: one line: the first such fault.
    """
    for fault in faults:
        if fault.severity == REFUSED:
            raise ValueError(fault.words)


def check_log(flight: FlightData, start: Vehicle) -> list[LogFault]:
    """Faults of a measured flight that can be detected without a model, each listed
    once.

    Args:
        flight: measured.
        start: vehicle that its numbers will be identified for.
    """
    return faults_of(flight.file, _faults(flight, start))


def faults_of(file: str, rows: Iterable[Found]) -> list[LogFault]:
    """Convert the faults found in a flight file to records, without duplicates."""
    return [
        LogFault(severity=a, file=file, channel=b, finding=c, remedy=d)
        for a, b, c, d in dict.fromkeys(rows)
    ]


def _faults(flight: FlightData, start: Vehicle) -> Iterator[Found]:
    """Yield the faults of a measured flight, beginning with those that would hide
    others.
    """
    empty = [name for name in flight if not flight[name].time.size]
    for name in empty:
        yield (
            _severity(name),
            name,
            "has no sample in this part of the flight",
            "it is not used",
        )
    if any(name in USED for name in empty):
        return
    flight = dataclasses.replace(
        flight, channels={name: flight[name] for name in flight if name not in empty}
    )
    aside = [
        name
        for name in ("position", "velocity")
        if name in flight and "quaternion" not in flight
    ]
    if aside:
        yield (
            WARNED,
            aside[0],
            "no attitude is measured beside it",
            "it is not used; log the quaternion",
        )
    for check in (_lost_rows, _spikes, _missing, _sizes):
        yield from (faults := list(check(flight, start)))
        # a channel that is missing or in another unit would alarm all checks behind it
        if check is not _lost_rows and any(
            severity == REFUSED for severity, *_ in faults
        ):
            return
    spans = flying_spans(commanded_speeds(flight, start), start)
    yield from (faults := list(_ground(flight, start, spans)))
    if faults or not spans:
        return
    yield from ((REFUSED, *found) for found in slow_commands(flight, start, spans))
    inside = flight.section(spans[0][0] - SETTLING, spans[-1][1] + SETTLING)
    yield from _gaps(flight, inside)
    for name in inside:
        aloft = _within(inside[name], spans)
        yield from _still(name, inside[name], aloft)


def _severity(name: str) -> str:
    """Severity of damage to a channel."""
    return REFUSED if name in USED else WARNED


LOST = re.compile(
    r"^(?P<channel>\w+): (?P<count>\d+) of (?P<all>\d+) rows (?P<words>.*)$"
)
"""Pattern of a reader's note on rows that it left out; the channel ``file`` denotes all
channels."""


def _lost_rows(flight: FlightData, start: Vehicle) -> Iterator[Found]:
    """Yield the rows and cells of a flight file that its reader found damaged."""
    for note in flight.notes:
        if lost := LOST.match(note):
            share = int(lost["count"]) / max(1, int(lost["all"]))
            # a fifth, chosen: fewer lost rows leave enough of a flight
            severity = (
                REFUSED
                if share > 0.2 and lost["channel"] in (*USED, "file")
                else WARNED
            )
            finding = (
                f"{lost['count']} of {lost['all']} rows {lost['words'].rstrip('.')}"
            )
            yield (
                severity,
                lost["channel"],
                finding,
                "check how the file was written, or cut the flight before it",
            )


RANGES = {"gyro": 4000.0 * math.pi / 180.0, "accelerometer": 64.0 * GRAVITY}
"""Channel -> largest range of such a sensor on a vehicle (rad/s, m/s^2)."""

RARE = 0.01
"""Largest fraction of samples beyond the range that counts as spikes; more suggest
another unit."""


def _spikes(flight: FlightData, start: Vehicle) -> Iterator[Found]:
    """Yield sensors with a few samples beyond the range of any such sensor."""
    for name, most in RANGES.items():
        beyond = (
            (np.abs(flight[name].values) > most).any(axis=1)
            if name in flight
            else np.zeros(0, dtype=bool)
        )
        if beyond.any() and beyond.mean() < RARE:
            at = float(flight[name].time[beyond][0])
            finding = (
                f"{int(beyond.sum())} of {beyond.size} samples are beyond {most:.3g},"
                f" the first at {at:.4g} s"
            )
            yield REFUSED, name, finding, "take them out of the file"


def _missing(flight: FlightData, start: Vehicle) -> Iterator[Found]:
    """Yield the channels that are missing, or whose number of columns does not match
    the vehicle.
    """
    # speeds before signals, in the order in which commands are read
    commands = [name for name in COMMANDS[::-1] if name in flight][:1]
    imu = "log it, or map its columns"
    if flight.facts.get("vehicle") == SIMULATED:
        imu = (
            'name an inertial unit in the scenario ([sensors] imu = { kind = "imu" })'
            " and fly it again"
        )
    measured = (
        "the measured rotor_speeds as rotor_speed_commands"
        if "rotor_speeds" in flight
        else "their columns"
    )
    required = dict.fromkeys(IMU, ("is", imu))
    if not commands:
        required[COMMANDS[0]] = ("are", f"log them, or map {measured}")
    if start.n:
        required["joint_positions"] = ("are", "log them: they move its mass")
    for name, (verb, remedy) in required.items():
        if name not in flight:
            yield REFUSED, name, f"{verb} not in this flight", remedy
    of_joints = ("joint_positions", "joint_commands", "joint_efforts", "joint_rates")
    every = dict.fromkeys(commands, (len(start.rotors), "rotors")) | dict.fromkeys(
        of_joints, (start.n, "joints")
    )
    for name, (count, parts) in every.items():
        columns = flight[name].values.shape[1] if name in flight else count
        if columns != count:
            yield (
                REFUSED,
                name,
                f"{columns} {parts}, vehicle '{start.name}' has {count}",
                "take the vehicle that flew",
            )


UNITS: Mapping[str, Mapping[str, Any]] = shipped_tables(__file__)
"""Channel -> plausible range of its median size in SI units, and other units with their
size in SI."""

LEAST_SHARE = 0.15
"""Least share of the full signal in flight, by which units of rotor commands are told
apart."""


def _sizes(flight: FlightData, start: Vehicle) -> Iterator[Found]:
    """Yield the channels of implausible magnitude: another unit, missing gravity, or
    damage.
    """
    turns = [joint.turns for joint in start.joints]
    for name, usual in UNITS.items():
        low, high = usual["low"], usual["high"]
        if name not in flight or (name == "rotor_commands" and COMMANDS[1] in flight):
            continue
        values = np.abs(flight[name].values)
        if "joint" in name:
            # of turning joints alone, because a sliding one has no degrees
            size = float(np.quantile(values[:, turns], 0.95)) if any(turns) else 0.0
        else:
            size = float(
                np.median(
                    lengths(values) if name in ("accelerometer", "velocity") else values
                )
            )
        if low <= size <= high:
            continue
        least = LEAST_SHARE if name == COMMANDS[0] else low
        fitting = [
            unit
            for unit, factor in usual["units"].items()
            if least * factor <= size <= high * factor
        ]
        looks = f"it looks like {' or '.join(fitting)}" if fitting else "no unit fits"
        if (
            name == "accelerometer"
            and np.linalg.norm(flight[name].values.mean(axis=0)) < STEADY * size
        ):
            looks = "it looks as if gravity were taken off"
        finding = (
            f"is {size:.4g} on the median, and flights have {low:.3g} to {high:.4g}:"
            f" {looks}"
        )
        yield REFUSED, name, finding, RANGE if name == COMMANDS[0] else UNIT
    yield from _damaged_shares(flight)
    if not RATES[0] <= (rate := flight["gyro"].rate) <= RATES[1]:
        unit = ": times look like ms" if rate < RATES[0] else ""
        yield (
            REFUSED,
            "time",
            f"has {rate:.3g} samples of the gyro in a second{unit}",
            UNIT,
        )


RATES, STEADY = (10.0, 2e4), 0.7
"""Plausible rates (Hz) of gyroscopes in logs; least mean of the accelerometer over its
size, which is gravity."""


def _damaged_shares(flight: FlightData) -> Iterator[Found]:
    """Yield a fault for rotor commands outside 0 to 1, the valid range of shares of the
    full signal.
    """
    if COMMANDS[0] not in flight or COMMANDS[1] in flight:
        return
    share = flight[COMMANDS[0]].values
    # 5 %, chosen: trims and rounding may pass the ends by as much
    outside = float(((share < -0.05) | (share > 1.05)).any(axis=1).mean())
    # a median beyond them is of another unit, and reported as that
    if outside and np.median(share) <= 1.05:
        span = (
            f"{100.0 * outside:.2g} % of the rows are outside 0 to 1, from"
            f" {share.min():.4g} to {share.max():.4g}"
        )
        yield (
            REFUSED if outside > RARE else WARNED,
            COMMANDS[0],
            f"{span}: they are damaged",
            CUT,
        )


WEIGHTS = (0.4, 2.5)
"""Range of mean thrust over weight that a wrong thrust curve explains."""

MOVING, RESTING, SHORTEST_FLIGHT = 0.05, 0.02, 1.0
"""Standard deviation of the gyroscope (rad/s) and of the position (m) above which the
vehicle flies; least time (s) in the air."""

CLIMBED = 0.5
"""Height (m) over which a vehicle that flew moves, and the estimate of one on the
ground hardly drifts."""

SPEED_UNITS = {
    "rpm": 30.0 / np.pi,
    "Hz": 0.5 / np.pi,
    # seven pairs, of the usual motor with 14 poles
    "rad/s of a motor behind a gear, or of poles": 7.0,
}


def _ground(
    flight: FlightData, start: Vehicle, spans: Sequence[tuple[float, float]]
) -> Iterator[Found]:
    """Yield a fault if a flight never took off, was too short, or its commanded thrust
    does not match the weight.
    """
    name = COMMANDS[1] if COMMANDS[1] in flight else COMMANDS[0]
    weight = GRAVITY * float(start.mass)
    speeds = commanded_speeds(flight, start)
    gyro = flight["gyro"]
    rows = (
        np.concatenate([speeds.section(*each).values for each in spans])
        if spans
        else speeds.values
    )
    # rotors that stand tell nothing of the weight
    rows = rows[np.median(np.abs(rows), axis=1) > 0.0]
    share = float(np.median(lift(start, rows))) / weight if len(rows) else 0.0
    # pieces of half a second, chosen: in each of them the spread of the rates is taken
    size = max(2, round(0.5 * gyro.rate))
    pieces = [
        gyro.values[i : i + size].std(axis=0).max()
        for i in range(0, max(1, gyro.time.size - size), size)
    ]
    rests = float(np.median(pieces)) < MOVING
    # without a position it neither rests nor climbs: NaN is on no side of a bound
    extent = np.full(3, np.nan)
    if "position" in flight:
        extent = np.ptp(flight["position"].values, axis=0)
    # at rest, the gyroscope and a position agree; a gyroscope alone may be quiet
    still = bool(extent.max() < RESTING)
    # a calm flight rests like one on the ground, but for its climb
    climbed = bool(extent[2] > CLIMBED)
    airborne = sum(b - a for a, b in spans)
    brief = (
        REFUSED,
        "flight",
        f"{airborne:.2g} s in the air: too short, or cut off",
        "take a flight of 10 s or more",
    )
    # a thousandth of the weight, chosen: rotors that idle or stand
    if flight.duration < SHORTEST_FLIGHT:
        yield brief
    elif (not spans and not climbed and (rests or share < 1e-3)) or (rests and still):
        yield (
            REFUSED,
            name,
            f"lift {share:.2g} of the weight: the flight never took off",
            "take a log of a flight",
        )
    elif not WEIGHTS[0] < share < WEIGHTS[1] or (share < AIRBORNE and not spans):
        finding = (
            f"lift {share:.3g} times the weight of '{start.name}'"
            f" ({float(start.mass):.3g} kg) in the air"
        )
        # thrust goes with the square of the speed, and so with that of its unit; bounds
        # chosen: a thrust curve that is wrong by so much leaves the unit to be told
        looks = [
            unit for unit, scale in SPEED_UNITS.items() if 0.6 < share / scale**2 < 1.6
        ]
        finding += (
            f": they look like {' or '.join(looks)}"
            if looks and name == COMMANDS[1]
            else ""
        )
        yield (
            REFUSED,
            name,
            finding,
            "check mass, thrust curve and units of the commands",
        )
    elif airborne < SHORTEST_FLIGHT:
        yield brief


SENSOR_GAP, HELD_GAP, FEWEST_SAMPLES = 0.1, 0.5, 20
"""Shortest reported gap (s) of a sensor and of a held command; number of samples from
which a channel's rate is known."""

DROPPED, EARLY = 0.03, 1.0
"""Least reported fraction of missing samples; time (s) by which a needed channel may
end before the flight."""


def channel_gaps(name: str, channel: Channel) -> list[tuple[float, float]]:
    """Gaps between the samples of a channel: start and length (s)."""
    if channel.time.size < FEWEST_SAMPLES:
        return []
    steps = np.diff(channel.time)
    is_held = QUANTITIES[name].held
    # a command stays until the next one, so its rows may be farther apart; 20 and 5
    # usual steps are chosen
    most = max(
        HELD_GAP if is_held else SENSOR_GAP,
        (20.0 if is_held else 5.0) * float(np.median(steps)),
    )
    return [
        (float(channel.time[i]), float(steps[i])) for i in np.flatnonzero(steps > most)
    ]


def _gaps(flight: FlightData, inside: FlightData) -> Iterator[Found]:
    """Yield gaps, missing samples, and channels that end early."""
    gaps = {name: channel_gaps(name, inside[name]) for name in inside}
    every = [name for name in gaps if name in (*IMU, *COMMANDS)]

    def all_begin(when: float, names: Sequence[str]) -> bool:
        return all(
            any(abs(when - other) < SENSOR_GAP for other, _ in gaps[name])
            for name in names
        )

    # three lines at most, which is chosen: a log may jump again and again
    for when, long in [
        each for each in gaps.get("gyro", []) if all_begin(each[0], every)
    ][:3]:
        finding = f"jumps by {long:.3g} s at {when:.4g} s in all channels"
        yield (
            WARNED,
            "time",
            finding,
            "the stretches before and after it are taken apart",
        )
    for name, rows in gaps.items():
        steps = np.diff(inside[name].time)
        if not QUANTITIES[name].held and steps.size >= FEWEST_SAMPLES:
            usual = float(np.median(steps))
            lost = float(
                np.maximum(np.round(steps[steps < SENSOR_GAP] / usual) - 1.0, 0.0).sum()
            )
            if (share := lost / (steps.size + lost)) > DROPPED:
                finding = (
                    f"{100.0 * share:.2g} % of the samples are missing, at"
                    f" {1.0 / usual:.4g} Hz"
                )
                yield WARNED, name, finding, "log fewer channels, or at a lower rate"
        # gaps of all channels at once are the clock's, and one line above
        if alone := [each for each in rows if not all_begin(each[0], every)]:
            when, long = max(alone, key=lambda each: each[1])
            count = f"{len(alone)} gaps, the longest" if len(alone) > 1 else "a gap"
            severity = (
                REFUSED
                if name in USED and name != "gyro" and long > HELD_GAP
                else WARNED
            )
            yield (
                severity,
                name,
                f"{count} of {long:.3g} s at {when:.4g} s: samples are missing",
                CUT,
            )
    for name in every:
        rest = flight.end - float(flight[name].time[-1])
        # a twentieth of a long flight, chosen
        if rest > max(EARLY, 0.05 * flight.duration):
            yield (
                WARNED,
                name,
                f"ends {rest:.3g} s before the flight: it is cut off",
                "the rest is not used",
            )


FROZEN, ALONE, STUCK, BUSY = 0.3, 0.6, 1.0, 0.5
"""Reported runs (s) of equal rows in the air of a sensor, of one axis, and of a
command; fraction of the command's rows that change otherwise."""

JUMP = 3.0
"""Largest change of a joint that comes to rest or begins to move, in steps of its
encoder; chosen. A sensor that froze in motion is further off when it goes on."""

REPEATED, SPARSE = 0.3, 0.7
"""Least fraction of repeated rows that is reported; largest ratio of sampling to
logging rate that counts as resampled."""

AT_LIMIT = 5
"""Least number of samples at the same extreme value of a saturated axis, in runs of
three or more."""

MANY = 100
"""Least number of rows of a sensor that is checked."""

NEVER_STILL = (
    *IMU,
    "quaternion",
    "position",
    "velocity",
    "rotor_speeds",
    "joint_positions",
)
"""Channels whose noise or motion prevents long runs of equal rows."""


def _within(channel: Channel, spans: Sequence[tuple[float, float]]) -> Mask:
    """Mask (N - 1,) of a channel's sample intervals that end within given time spans
    (s).
    """
    time = channel.time[1:]
    return np.asarray(
        np.any([(time > begin) & (time <= end) for begin, end in spans], axis=0)
    )


def _still(name: str, channel: Channel, aloft: Mask) -> Iterator[Found]:
    """Yield a fault if a channel freezes in flight, holds repeated or interpolated
    samples, or saturates.
    """
    # commands may rest, so they have limits of their own
    command = name in (*COMMANDS, "joint_efforts")
    if not (command or name in NEVER_STILL) or channel.time.size < (
        FEWEST_SAMPLES if command else MANY
    ):
        return
    same = (channel.values[1:] == channel.values[:-1]) & aloft[:, None]
    whole = same.all(axis=1)
    # an arm at rest on a coarse encoder repeats one value, too: only a frozen one jumps
    # when it comes back
    if name == "joint_positions":
        whole &= ~_rests(channel, whole)
    share = float(whole.sum()) / max(1, int(aloft.sum()))
    severity = _severity(name)
    runs = [("", whole, STUCK if command else FROZEN)]
    runs += [
        (f"axis {axis} ", column, ALONE)
        for axis, column in zip("xyz", same.T, strict=False)
        if name in IMU
    ]
    for axis, rows, most in runs:
        long, when = _longest_run(rows, channel.time)
        if long > most and not (command and share > BUSY):
            yield (
                REFUSED if command else severity,
                name,
                f"{axis}is frozen for {long:.3g} s at {when:.4g} s",
                CUT,
            )
            return
    if name not in (*IMU, "joint_positions"):
        return
    sampled = command_samples(channel).rate
    if share > REPEATED:
        finding = (
            f"{100.0 * share:.2g} % of the rows repeat the one before, so that its"
            " rate is "
        )
        finding += (
            f"{channel.rate * (1.0 - share):.3g} Hz rather than {channel.rate:.3g} Hz"
        )
        yield WARNED, name, finding, "remove repeated rows"
    elif 0.0 < sampled < SPARSE * channel.rate:
        finding = (
            f"is on straight lines between samples of {sampled:.3g} Hz, rather than of"
            f" {channel.rate:.3g} Hz"
        )
        yield WARNED, name, finding, "log it as it was sampled, without interpolation"
    for axis, column in (
        zip("xyz", channel.values[1:][~whole].T, strict=False) if name in IMU else ()
    ):
        for limit in (column.max(), column.min()):
            at = (column == limit).astype(int)
            # a saturated sensor stays at its limit for samples on end, and a peak does
            # not
            triples = np.convolve(at, np.ones(3, dtype=int), "valid") == 3
            if (
                at.sum() >= AT_LIMIT
                and triples.sum() >= 2
                and abs(limit - np.median(column)) > np.std(column)
            ):
                finding = (
                    f"axis {axis} is saturated at {limit:.4g} in {int(at.sum())}"
                    " samples"
                )
                yield (
                    WARNED,
                    name,
                    finding,
                    "cut the flight to gentler sections, or widen the sensor's range",
                )


def _rests(channel: Channel, whole: Mask) -> Mask:
    """Mask (N - 1,) of repeated rows before and after which no joint jumps: of joints
    at rest on coarse encoders.
    """
    step = np.abs(np.diff(channel.values, axis=0))
    at_rest = np.zeros(whole.size, dtype=bool)
    # the least change that occurs is taken for a step of the encoder
    least = np.min(step, axis=0, initial=np.inf, where=step > 0.0)
    for begin, end in runs_of(whole):
        at_rest[begin:end] = np.all(
            step[[max(begin - 1, 0), min(end, whole.size - 1)]] <= JUMP * least
        )
    return at_rest


def _longest_run(rows: Mask, time: Array) -> tuple[float, float]:
    """Longest time (s) over which a mask (N - 1,) of sample intervals stays true, and
    its start.
    """
    spans = [
        (float(time[end] - time[begin]), float(time[begin]))
        for begin, end in runs_of(rows)
    ]
    return max(spans, key=lambda each: each[0], default=(0.0, 0.0))
