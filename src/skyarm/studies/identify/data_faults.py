"""Faults of a measured flight, each with its channel, the finding and the remedy.

Channels are checked one by one (gaps, repeated and frozen samples, saturation, units) and against each other (see
:mod:`skyarm.studies.identify.data_compatibility`): a law that fails names the axes, the rotors, the attitude or the
clock by the change after which every law holds.
"""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from skyarm.dynamics.actuators.rotor import push
from skyarm.flight_data.flight_data import Channel, FlightData
from skyarm.flight_data.own_log import SIMULATED
from skyarm.flight_data.quantities import GRAVITY, QUANTITIES
from skyarm.log.periods import runs_of
from skyarm.records.arrays import Array, Mask
from skyarm.records.files.messages import one_line
from skyarm.records.immutable import immutable
from skyarm.studies.identify.channel_scales import REFUSED, WARNED, Found, wrong_units
from skyarm.studies.identify.fault_isolation import incompatible_channels
from skyarm.studies.identify.logged_commands import SETTLING, commanded_speeds, flying_spans
from skyarm.studies.identify.stretches import SHORTEST
from skyarm.vehicle.vehicle_records import Vehicle


@immutable
class Fault:
    """Fault of a measured flight.

    Attributes:
        severity: REFUSED or WARNED.
        file: of the flight.
        channel: quantity, or what the fault is about.
        finding: what is wrong, with its numbers.
        remedy: what to do.
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


NEEDED = ("gyro", "accelerometer")
"""Channels without which nothing is identified, beside the rotors' commands."""

COMMANDS = ("rotor_commands", "rotor_speed_commands")
"""Channels of commands to the rotors, of which one is needed."""

USED = (*NEEDED, *COMMANDS, "joint_positions")
"""Channels whose damage spoils numbers."""

NAME_IMU = 'name an inertial unit in the scenario ([sensors] imu = { kind = "imu" }) and fly it again'
"""Remedy for a simulated flight, which has true rates and no forces."""

SENSORS = ("gyro", "accelerometer", "quaternion", "position", "velocity", "rotor_speeds", "joint_positions")
"""Channels whose noise or motion never repeats a row for long."""


def find_faults(flight: FlightData, start: Vehicle) -> tuple[Fault, ...]:
    """Faults of a measured flight, the refused first.

    Args:
        flight: measured.
        start: vehicle that its numbers will be identified for: rotors, joints and data sheet.
    """
    return tuple(sorted(faults_of(_all_faults(flight, start), flight.file), key=lambda each: each.severity != REFUSED))


def faults_of(found: Iterable[Found], file: str) -> list[Fault]:
    """Faults of a flight's file, each once."""
    return [
        Fault(severity=severity, file=file, channel=channel, finding=finding, remedy=remedy)
        for severity, channel, finding, remedy in dict.fromkeys(found)
    ]


def require_no_refusal(faults: Sequence[Fault]) -> None:
    """Check that there is no fault for which a flight is refused.

    Raises:
        ValueError: one line: the first such fault.
    """
    for fault in faults:
        if fault.severity == REFUSED:
            raise ValueError(fault.words)


def _all_faults(flight: FlightData, start: Vehicle) -> Iterator[Found]:
    """Yield the faults of a flight, from those that hide others on."""
    empty = [name for name in flight if not flight[name].time.size]
    for name in empty:
        yield REFUSED if name in USED else WARNED, name, "has no sample in this part of the flight", "it is not used"
    if any(name in USED for name in empty):
        return
    flight = dataclasses.replace(flight, channels={name: flight[name] for name in flight if name not in empty})
    yield from _lost_rows(flight)
    spikes = list(_spikes(flight))
    if spikes:
        yield from spikes
        return
    missing = list(_missing(flight, start))
    units = list(wrong_units(flight, start))
    yield from missing
    yield from units
    if missing:
        return
    spans = flying_spans(commanded_speeds(flight, start), start)
    if not any(channel in COMMANDS for _, channel, _, _ in units):
        off_the_ground = list(_thrust_faults(flight, start, spans))
        yield from off_the_ground
        if off_the_ground:
            return
    if not spans:
        return
    inside = flight.section(spans[0][0] - SETTLING, spans[-1][1] + SETTLING)
    fast = list(_impossible_rates(inside))
    yield from fast
    yield from _clock_faults(flight, inside)
    still = [*_still_channels(inside, spans), *_stuck_commands(inside, spans)]
    yield from still
    if {channel for _, channel, _, _ in (*still, *units, *fast)} & {"gyro", *COMMANDS}:
        return
    for channel, finding, remedy, severe in incompatible_channels(inside, start):
        yield REFUSED if severe else WARNED, channel, finding, remedy


LOST = re.compile(r"^(?P<channel>\w+): (?P<count>\d+) of (?P<all>\d+) rows (?P<words>.*)$")
"""Note of a reader on rows that it left out."""


FILE = "file"
"""Word for all channels of a note."""


def _lost_rows(flight: FlightData) -> Iterator[Found]:
    """Yield the rows and cells that the reader found damaged."""
    for note in flight.notes:
        lost = LOST.match(note)
        if lost is None:
            continue
        share = int(lost["count"]) / max(1, int(lost["all"]))
        severity = REFUSED if share > 0.2 and lost["channel"] in (*USED, FILE) else WARNED
        finding = f"{lost['count']} of {lost['all']} rows {lost['words'].rstrip('.')}"
        yield severity, lost["channel"], finding, "check how the file was written, or cut the flight before it"


def _missing(flight: FlightData, start: Vehicle) -> Iterator[Found]:
    """Yield the channels that are not there or have not the columns of the vehicle."""
    told = [name for name in ("rotor_speed_commands", "rotor_commands") if name in flight]
    for name in NEEDED:
        if name not in flight:
            simulated = flight.facts.get("vehicle") == SIMULATED
            yield REFUSED, name, "is not in this flight", NAME_IMU if simulated else "log it, or map its columns"
    if not told:
        yield REFUSED, "rotor_commands", "are not in this flight", "log them, or map their columns"
    of_joints = ("joint_positions", "joint_commands", "joint_efforts", "joint_rates")
    wanted = dict.fromkeys(told[:1], (len(start.rotors), "rotors")) | dict.fromkeys(of_joints, (start.n, "joints"))
    for name, (count, parts) in wanted.items():
        held = flight[name].values.shape[1] if name in flight else count
        if held != count:
            yield REFUSED, name, f"{held} {parts}, vehicle '{start.name}' has {count}", "take the vehicle that flew"
    if start.n and "joint_positions" not in flight:
        yield REFUSED, "joint_positions", "are not in this flight", "log them: they move its mass"


WEIGHTS = (0.4, 2.5)
"""Mean thrust over the weight that a wrong thrust curve explains."""

MOVING = 0.05
"""rad/s, deviation of the gyro of a vehicle that flies."""

SPEED_UNITS = {"rpm": 30.0 / np.pi, "Hz": 0.5 / np.pi, "rad/s of a motor behind a gear, or of poles": 7.0}


def _thrust_faults(flight: FlightData, start: Vehicle, spans: Sequence[tuple[float, float]]) -> Iterator[Found]:
    """Yield: it never flew, or its commands do not bear the vehicle's weight."""
    speeds = commanded_speeds(flight, start)
    name = "rotor_speed_commands" if "rotor_speed_commands" in flight else "rotor_commands"
    gyro = flight["gyro"]
    weight = GRAVITY * float(start.mass)

    def thrusts(rows: Array) -> Array:
        pairs = zip(start.rotors, rows.T, strict=True)
        return np.asarray(sum(float(r.thrust_coefficient) * push(r, np.abs(w)) for r, w in pairs))

    moving = float(np.median(np.std(_pieces(gyro), axis=1).max(axis=1))) if gyro.time.size else 0.0
    turning = speeds.values[np.median(np.abs(speeds.values), axis=1) > 0.0]
    share = float(np.median(thrusts(turning))) / weight if len(turning) else 0.0
    if not spans and (moving < MOVING or share < 1e-3):
        finding = f"lift {share:.2g} of the weight at most on the median: the flight never took off"
        yield REFUSED, name, finding, "take a log of a flight"
        return
    aloft = thrusts(np.concatenate([speeds.section(*each).values for each in spans])) if spans else np.array([share])
    share = float(np.median(aloft)) / weight if spans else share
    if not WEIGHTS[0] < share < WEIGHTS[1]:
        finding = f"lift {share:.3g} times the weight of '{start.name}' ({float(start.mass):.3g} kg) in the air"
        remedy = "check mass, thrust curve and units of the commands"
        if name == "rotor_speed_commands":
            for unit, scale in SPEED_UNITS.items():
                if 0.6 < share / scale**2 < 1.6:
                    finding += f": they look like {unit}"
        yield REFUSED, name, finding, remedy
        return
    if "position" in flight and moving < MOVING:
        place = flight["position"]
        if float(np.ptp(place.values, axis=0).max()) < 0.02:
            yield REFUSED, "position", "stays within 0.02 m: the flight never took off", "take a log of a flight"
            return
    airborne = sum(b - a for a, b in spans)
    if airborne < SHORTEST:
        yield REFUSED, "flight", f"{airborne:.2g} s in the air: too short, or cut off", "take a flight of 10 s or more"


TUMBLING = 2.5
"""rad, root mean square of what the gyro's x or y sums up to in half a second: more is no flight of a multirotor."""


def _impossible_rates(flight: FlightData) -> Iterator[Found]:
    """Yield a gyro by which the vehicle would tumble all the time."""
    if "quaternion" in flight or flight["gyro"].time.size < 100:
        return  # the attitude tells its unit
    turned = 0.5 * _pieces(flight["gyro"]).mean(axis=1)[:, :2]
    size = float(np.sqrt((turned**2).mean(axis=0)).max())
    if size > TUMBLING:
        finding = f"turns by {size:.3g} rad in half a second throughout the flight: it looks like deg/s"
        yield REFUSED, "gyro", finding, "state its unit in columns.toml"


RANGES = {"gyro": 4000.0 * math.pi / 180.0, "accelerometer": 64.0 * GRAVITY}
"""Channel -> largest range that such a sensor has on a vehicle, rad/s and m/s^2."""

RARE = 0.01
"""Share of samples beyond the range up to which these are spikes, and not a unit."""


def _spikes(flight: FlightData) -> Iterator[Found]:
    """Yield sensors of which a few samples lie beyond what any reads."""
    for name, most in RANGES.items():
        beyond = (np.abs(flight[name].values) > most).any(axis=1) if name in flight else np.zeros(0, dtype=bool)
        if beyond.any() and beyond.mean() < RARE:
            at = float(flight[name].time[beyond][0])
            finding = f"{int(beyond.sum())} of {beyond.size} samples are beyond {most:.3g}, the first at {at:.4g} s"
            yield REFUSED, name, finding, "take them out of the file"


def _pieces(channel: Channel) -> Array:
    """Samples in pieces of half a second (pieces, samples, k), without the rest."""
    size = max(2, round(0.5 * channel.rate))
    count = max(1, channel.time.size // size)
    rows = channel.values[: count * size]
    return rows.reshape(count, -1, rows.shape[1])


GAP, HELD_GAP = 0.1, 0.5
"""Shortest gap of a sensor and of a held command, s, that is reported."""

DROPPED = 0.03
"""Least share of missing samples that is reported."""

EARLY = 1.0
"""s, by which a needed channel may end before the flight."""


FEWEST = 20
"""Samples of a channel whose usual rate is known."""


def channel_gaps(name: str, channel: Channel) -> list[tuple[float, float]]:
    """Gaps of a channel of some quantity: begin and length, s."""
    time, held = channel.time, QUANTITIES[name].held
    if time.size < FEWEST:
        return []
    steps = np.diff(time)
    usual = float(np.median(steps))
    wide = np.flatnonzero(steps > max(HELD_GAP if held else GAP, (20.0 if held else 5.0) * usual))
    return [(float(time[i]), float(steps[i])) for i in wide]


def _clock_faults(flight: FlightData, inside: FlightData) -> Iterator[Found]:
    """Yield gaps, missing samples, and channels that end early."""
    gaps: dict[str, list[tuple[float, float]]] = {}
    for name in inside:
        gaps[name] = channel_gaps(name, inside[name])
        time = inside[name].time
        if QUANTITIES[name].held or time.size < FEWEST:
            continue
        steps, usual = np.diff(time), float(np.median(np.diff(time)))
        lost = float(np.maximum(np.round(steps[steps < GAP] / usual) - 1.0, 0.0).sum())
        if lost > DROPPED * time.size:
            finding = f"{100.0 * lost / (time.size + lost):.2g} % of the samples are missing, at {1.0 / usual:.4g} Hz"
            yield WARNED, name, finding, "log fewer channels, or at a lower rate"
    every = [name for name in gaps if name in (*NEEDED, *COMMANDS)]
    common = [
        (when, long)
        for when, long in gaps.get("gyro", [])
        if all(any(abs(when - w) < GAP for w, _ in gaps[name]) for name in every)
    ]
    for when, long in common[:3]:
        yield (
            WARNED,
            "time",
            f"jumps by {long:.3g} s at {when:.4g} s in all channels",
            "the stretches before and after it are taken apart",
        )
    for name, rows in gaps.items():
        alone = [(when, long) for when, long in rows if not any(abs(when - w) < GAP for w, _ in common)]
        if not alone:
            continue
        when, long = max(alone, key=lambda each: each[1])
        count = f"{len(alone)} gaps, the longest" if len(alone) > 1 else "a gap"
        needed = name in USED and name != "gyro"
        finding = f"{count} of {long:.3g} s at {when:.4g} s: samples are missing"
        yield REFUSED if needed and long > HELD_GAP else WARNED, name, finding, "cut the flight to sections without it"
    ends = {name: flight[name].time[-1] for name in flight if flight[name].time.size}
    for name in every:
        rest = flight.end - float(ends[name])
        if rest > max(EARLY, 0.05 * flight.duration):
            yield WARNED, name, f"ends {rest:.3g} s before the flight: it is cut off", "the rest is not used"


FROZEN = 0.3
"""s, run of equal rows in the air that no sensor has."""

REPEATED = 0.3
"""Least share of rows that repeat the one before, of a channel that was sampled up."""

AT_LIMIT = 5
"""Fewest samples at the same largest or smallest number of a saturated axis, in runs of three or more."""


def _still_channels(flight: FlightData, spans: Sequence[tuple[float, float]]) -> Iterator[Found]:
    """Yield channels that freeze, repeat rows or saturate in the air."""
    for name in SENSORS:
        if name not in flight or flight[name].time.size < 100:
            continue
        channel = flight[name]
        same = channel.values[1:] == channel.values[:-1]
        aloft = _inside(channel, spans)
        whole = same.all(axis=1) & aloft
        long, when = _longest_run(whole, channel.time)
        needed = name in (*NEEDED, "joint_positions")
        if long > FROZEN:
            finding = f"is frozen for {long:.3g} s at {when:.4g} s"
            yield REFUSED if needed else WARNED, name, finding, "cut the flight to sections without it"
            continue
        if needed:
            for axis, column in zip("xyz", (same & aloft[:, None]).T, strict=False):
                long, when = _longest_run(column, channel.time)
                if long > 3.0 * FROZEN:
                    finding = f"axis {axis} is frozen for {long:.3g} s at {when:.4g} s"
                    yield REFUSED, name, finding, "cut the flight to sections without it"
        share = float(whole.sum()) / max(1, int(aloft.sum()))
        if share > REPEATED and needed:
            finding = f"{100.0 * share:.2g} % of the rows repeat the one before, so that its rate is "
            finding += f"{channel.rate * (1.0 - share):.3g} Hz rather than {channel.rate:.3g} Hz"
            yield WARNED, name, finding, "remove repeated rows"
        if name in NEEDED:
            yield from _saturation(name, channel, whole)


def _inside(channel: Channel, spans: Sequence[tuple[float, float]]) -> Mask:
    """Steps (N - 1,) of a channel that end within spans of time (s)."""
    found = np.zeros(max(0, channel.time.size - 1), dtype=bool)
    for begin, end in spans:
        found |= (channel.time[1:] > begin) & (channel.time[1:] <= end)
    return found


STUCK, BUSY = 1.0, 0.5
"""s, run of equal commands in the air of a channel of which so many rows change."""


def _stuck_commands(flight: FlightData, spans: Sequence[tuple[float, float]]) -> Iterator[Found]:
    """Yield commands that stop in the air although they usually change."""
    for name in ("rotor_commands", "rotor_speed_commands", "joint_efforts"):
        if name not in flight or flight[name].time.size < FEWEST:
            continue
        channel = flight[name]
        same = (channel.values[1:] == channel.values[:-1]).all(axis=1)
        inside = _inside(channel, spans)
        long, when = _longest_run(same & inside, channel.time)
        if long > STUCK and float(np.mean(~same[inside])) > BUSY:
            finding = f"do not change for {long:.3g} s at {when:.4g} s: they are missing there"
            yield REFUSED, name, finding, "cut the flight to sections without it"


def _saturation(name: str, channel: Channel, repeated: Mask) -> Iterator[Found]:
    """Yield axes that stay at their largest or smallest number while the others go on."""
    rows = channel.values[1:][~repeated]
    for axis, column in zip("xyz", rows.T, strict=True):
        for limit in (column.max(), column.min()):
            at = (column == limit).astype(int)
            runs = np.convolve(at, np.ones(3, dtype=int), "valid") == 3
            if at.sum() >= AT_LIMIT and runs.sum() >= 2 and abs(limit - np.median(column)) > np.std(column):
                finding = f"axis {axis} is saturated at {limit:.4g} in {int(at.sum())} samples"
                yield WARNED, name, finding, "cut the flight to gentler sections, or widen the sensor's range"


def _longest_run(rows: Mask, time: Array) -> tuple[float, float]:
    """Longest time (s) over which rows (N - 1,) of steps between times (N,) are all true, and its begin."""
    spans = [(float(time[end] - time[begin]), float(time[begin])) for begin, end in runs_of(rows)]
    return max(spans, key=lambda each: each[0], default=(0.0, 0.0))
