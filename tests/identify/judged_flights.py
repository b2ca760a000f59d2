"""Sound and damaged flight logs, and what an identification makes of them: named,
repaired, silent or wrong.

A damage is one that logs of real vehicles have: units, axes, orders, clocks, scales,
filters, a wrong file. Nothing here knows how faults are looked for: only what
``skyarm.identify_flights`` returns, raises and warns of is judged.
"""

from __future__ import annotations

import dataclasses
import lzma
import re
import shutil
import tempfile
import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from planted_flights import SAMPLE, Case, inverse, measured, planted, rotate, rubbing

import skyarm
from skyarm.flight_data.flight_data import Channel, FlightData
from skyarm.vehicle.vehicle_records import Vehicle
from support.vehicles import (
    CRAZYFLIE_LOG,
    FLIGHTS,
    IRIS_LOG,
    TREFOIL_LOG,
    crazyflie,
    iris,
)

SECONDS, HOVERED = 30.0, 40.0
"""s, of the damaged flights, which are the beginnings of those of a minute; of the
hovers."""

Change = Callable[[FlightData], FlightData]
Rows = Callable[[np.ndarray], np.ndarray]


@dataclasses.dataclass(frozen=True)
class Judged:
    """What an identification said of a flight.

    Attributes:
        found: numbers; None if the flight was refused.
        told: refusal and warnings, as they were worded.
    """

    found: Any
    told: tuple[str, ...]

    def named(self, file: str) -> list[tuple[str, str]]:
        """What is named, a channel, another thing of the flight or a number, and what
        was found of each.
        """
        pairs = []
        for words in self.told:
            channel, _, finding = words.removeprefix(f"{file}: ").partition(": ")
            pairs.append(
                (channel.replace("_", " "), finding) if finding else ("", words)
            )
        return pairs

    def accused(self, file: str) -> list[tuple[str, str]]:
        """The same without doubts of single numbers, and without how much the model
        leaves unexplained.
        """
        return [
            pair
            for pair in self.named(file)
            if pair[0] != MODEL and not re.fullmatch(NUMBER, pair[0])
        ]


MODEL = "model"
"""What is said to leave more than noise, where no channel is: of flights of real
vehicles it always does."""

NUMBER = r"[\w ]+(\.[\w ]+)+|delay|joint delay|accelerometer delay|drift|sag"
"""Names of numbers, as they are named."""


def judge(flight: FlightData, start: Vehicle) -> Judged:
    """Identify a vehicle from a flight, and keep all that is said of it."""
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        try:
            found, refusal = skyarm.identify_flights([flight], start), ()
        except ValueError as error:
            found, refusal = None, (str(error),)
    warned = tuple(
        str(each.message) for each in told if issubclass(each.category, UserWarning)
    )
    return Judged(found, (*refusal, *warned))


MILLIMETRE, SHARE, FAR = 1e-3, 0.01, 2.0
"""m of lengths and share of other numbers within which a number is right beside its
interval; half-widths of it within which it is, as some of some dozen are outside by
chance.
"""

MAIN = (
    "base.inertia.xx",
    "base.inertia.yy",
    "base.inertia.zz",
    "base.com.",
    "place.",
    "rotors.thrust_coefficient",
    "rotors.moment_coefficient",
)
"""Numbers that must be that near; others may be five times as far."""


def wrong_numbers(found: Any, truth: Mapping[str, float]) -> list[str]:
    """Names of numbers that are said to be known and are neither near the truth nor
    have it about their interval.
    """
    wrong = []
    for each in found.numbers:
        if each.name not in truth or not each.is_known:
            continue
        true = truth[each.name]
        near = (
            MILLIMETRE
            if each.name.startswith(("base.com.", "place."))
            else SHARE * abs(true)
        )
        off, half = abs(each.value - true), 0.5 * (each.high - each.low)
        if off > max(near if each.name.startswith(MAIN) else 5.0 * near, FAR * half):
            wrong.append(each.name)
    return wrong


def change(name: str, values: Rows | None = None, time: Rows | None = None) -> Change:
    """Change of a channel's values, or of its times."""

    def made(flight: FlightData) -> FlightData:
        if name not in flight:
            return flight
        old = flight[name]
        rows = old.values if values is None else values(old.values)
        stamps = old.time if time is None else time(old.time)
        return flight.with_channels(
            {name: Channel(time=stamps, values=rows, source=old.source)}
        )

    return made


def then(*changes: Change) -> Change:
    """Changes one after the other."""

    def made(flight: FlightData) -> FlightData:
        for each in changes:
            flight = each(flight)
        return flight

    return made


def held(channel: Channel, time: np.ndarray) -> np.ndarray:
    """Rows of a channel that were the newest at some times."""
    return channel.values[
        np.maximum(np.searchsorted(channel.time, time, side="right") - 1, 0)
    ]


def without_gravity(flight: FlightData) -> FlightData:
    """Linear acceleration of a phone's sensor fusion in place of the specific force."""
    old = flight["accelerometer"]
    up = rotate(
        inverse(held(flight["quaternion"], old.time)),
        np.tile([0.0, 0.0, 9.81], (old.time.size, 1)),
    )
    return flight.with_channels(
        {"accelerometer": Channel(time=old.time, values=old.values - up, source="made")}
    )


def in_body_axes(flight: FlightData) -> FlightData:
    """Velocity as an optical-flow sensor has it, in base axes."""
    old = flight["velocity"]
    rows = rotate(inverse(held(flight["quaternion"], old.time)), old.values)
    return flight.with_channels(
        {"velocity": Channel(time=old.time, values=rows, source="made")}
    )


def filtered(seconds: float) -> Rows:
    """First-order low pass of rows at 100 Hz."""

    def made(rows: np.ndarray) -> np.ndarray:
        share, now, found = 1.0 - np.exp(-0.01 / seconds), rows[0], np.empty_like(rows)
        for i, each in enumerate(rows):
            now = now + share * (each - now)
            found[i] = now
        return found

    return made


def resampled(rows: np.ndarray) -> np.ndarray:
    """Every tenth row, and straight lines between, as a table on one clock is made of a
    slow log.
    """
    kept, every = np.arange(0, len(rows), 10), np.arange(len(rows))
    return np.stack([np.interp(every, kept, column[kept]) for column in rows.T], axis=1)


def stuck(rows: np.ndarray) -> np.ndarray:
    """A bus that hangs for three seconds and repeats what it read last."""
    rows, begin = rows.copy(), len(rows) // 2
    rows[begin : begin + round(3.0 / SAMPLE)] = rows[begin]
    return rows


def clipped(rows: np.ndarray) -> np.ndarray:
    """An accelerometer whose range ends within the flight: the top tenth of its z axis
    reads the same.
    """
    rows = rows.copy()
    rows[:, 2] = np.minimum(rows[:, 2], np.quantile(rows[:, 2], 0.9))
    return rows


def rescaled_pulses(flight: FlightData) -> FlightData:
    """Pulses of 1100 to 1900 us that were read as shares of 1000 to 2000 us."""
    speeds = flight["rotor_speed_commands"]
    shares = 0.1 + 0.8 * speeds.values / 838.0
    rest = {name: flight[name] for name in flight if name != "rotor_speed_commands"}
    commands = Channel(time=speeds.time, values=shares, source="made")
    return dataclasses.replace(flight, channels={**rest, "rotor_commands": commands})


def as_shares(flight: FlightData) -> FlightData:
    """Commands as shares of the full speed."""
    speeds = flight["rotor_speed_commands"]
    rest = {name: flight[name] for name in flight if name != "rotor_speed_commands"}
    commands = Channel(time=speeds.time, values=speeds.values / 838.0, source="made")
    return dataclasses.replace(flight, channels={**rest, "rotor_commands": commands})


def all_times(factor: float) -> Change:
    """All clocks in another unit."""
    return lambda flight: dataclasses.replace(
        flight,
        channels={
            name: Channel(
                time=factor * each.time, values=each.values, source=each.source
            )
            for name, each in flight.channels.items()
        },
    )


def pose_of(other: tuple[str, int]) -> Change:
    """Pose and velocity of the motion capture's file of another flight, which is flown
    when they are taken.
    """

    def taken(flight: FlightData) -> FlightData:
        theirs = measured(planted(*other), "low", seconds=SECONDS)
        return flight.with_channels(
            {name: theirs[name] for name in ("position", "quaternion", "velocity")}
        )

    return taken


def on_arrival(flight: FlightData) -> FlightData:
    """Pose and velocity stamped as they arrive by radio: 80 ms late, and up to 6 ms
    more.
    """
    jitter = np.random.default_rng(2).uniform(0.0, 0.006, flight["position"].time.size)
    late = [
        change(name, time=lambda time: time + 0.08 + jitter)
        for name in ("position", "quaternion", "velocity")
    ]
    return then(*late)(flight)


def columns(*order: int) -> Rows:
    return lambda rows: rows[:, list(order)]


def times(*factors: float) -> Rows:
    return lambda rows: rows * np.array(factors)


def turned(rows: np.ndarray) -> np.ndarray:
    """Axes of a board that is mounted a quarter of a turn about z."""
    return rows @ np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def plus(*offsets: float) -> Rows:
    return lambda rows: rows + np.array(offsets)


@dataclasses.dataclass(frozen=True)
class Damage:
    """One damage of a log.

    Attributes:
        kind: of vehicle; the seed of one is its place in the table.
        make: of a sound flight.
        channels: any of which must be named; a name may begin so.
        finding: pattern of words, before those of a remedy, that say what kind of
            damage it is.
        how: in words.
        start: change of the start vehicle.
        without: channels that the flight lacks.
    """

    kind: str
    make: Change
    channels: tuple[str, ...]
    finding: str
    how: str
    start: Callable[[Vehicle], Vehicle] = lambda vehicle: vehicle
    without: tuple[str, ...] = ()


def _heavier(vehicle: Vehicle) -> Vehicle:
    base = dataclasses.replace(
        vehicle.base, mass=float(vehicle.base.mass) + 0.8 * float(vehicle.mass)
    )
    return dataclasses.replace(vehicle, base=base)


ROTORS = ("rotor commands", "rotor speed commands", "rotors")
POSE = ("position", "quaternion", "velocity", "pose")
UNIT = r"unit|look|\bmg\b|milli|rpm|deg|mm|\bms\b|times"
AXES = r"ax[ei]s|turn|swap|sign|world|base|body|frame|north|down|along|rotat"
LATE = r"late|behind|clock|delay|lag|ahead|early|time|another flight"

DAMAGED: Mapping[str, Damage] = {
    "accelerometer in mg": Damage(
        "quad",
        change("accelerometer", times(*(1e3 / 9.80665,) * 3)),
        ("accelerometer",),
        UNIT,
        "m/s^2 written as mg",
    ),
    "accelerometer without gravity": Damage(
        "quad",
        without_gravity,
        ("accelerometer",),
        r"gravity|weight|thrust|free fall",
        "linear acceleration of a fusion",
    ),
    "board turned by 90 deg": Damage(
        "quad",
        then(change("gyro", turned), change("accelerometer", turned)),
        ("gyro", "accelerometer", "quaternion", "axes", "imu", *ROTORS),
        AXES,
        "gyro and accelerometer of a board mounted a quarter of a turn about z",
    ),
    "quaternion of the other convention": Damage(
        "quad",
        change("quaternion", times(1, -1, -1, -1)),
        ("quaternion",),
        r"inverse|conjugate|other way|world to base",
        "world to base",
    ),
    "velocity in base axes": Damage(
        "quad", in_body_axes, ("velocity",), AXES, "as optical flow has it"
    ),
    "position and velocity in NED": Damage(
        "arm2",
        then(
            change("position", times(1, -1, -1)), change("velocity", times(1, -1, -1))
        ),
        ("position", "velocity"),
        AXES,
        "north, east, down beside an attitude to z up",
    ),
    "position in mm": Damage(
        "quad",
        change("position", times(*(1e3,) * 3)),
        ("position", "velocity"),
        UNIT,
        "m written as mm",
    ),
    "velocity filtered": Damage(
        "quad",
        change("velocity", filtered(0.25)),
        ("velocity",),
        rf"{LATE}|filter|slope",
        "first order of 0.25 s",
    ),
    "pose of another flight": Damage(
        "quad",
        pose_of(("quad", 7)),
        POSE,
        r"another|other flight|agree|fit|belong|unlike|explain",
        "file of another vehicle on a like path",
    ),
    "pose stamped on arrival": Damage(
        "arm2", on_arrival, POSE, LATE, "80 ms late, with 6 ms of jitter"
    ),
    "pulses of 1100 to 1900": Damage(
        "quad",
        rescaled_pulses,
        ROTORS,
        r"range|pulse|scale|offset|curve|share|unit",
        "read as 1000 to 2000",
    ),
    "motors of another autopilot": Damage(
        "quad",
        change("rotor_speed_commands", columns(3, 0, 2, 1)),
        ROTORS,
        r"order|exchang|swap|mirror|revers",
        "columns 4, 1, 3, 2",
    ),
    "speeds in rpm": Damage(
        "arm3",
        change("rotor_speed_commands", times(*(30.0 / np.pi,) * 6)),
        ROTORS,
        UNIT,
        "rad/s written as rpm",
    ),
    "times in ms": Damage(
        "quad",
        all_times(1e3),
        ("time", "clock", "flight", "gyro"),
        rf"{UNIT}|rate",
        "all clocks",
    ),
    "joints swapped": Damage(
        "arm2",
        then(
            change("joint_positions", columns(1, 0)),
            change("joint_rates", columns(1, 0)),
        ),
        ("joint",),
        r"swap|order|exchang",
        "positions and rates, not the efforts",
    ),
    "zero of an encoder": Damage(
        "arm2",
        change("joint_positions", plus(0.0, 0.35)),
        ("joint positions", "joints", "joint"),
        r"zero|offset|off|shift",
        "second joint reads 0.35 rad more",
    ),
    "joints 0.1 s late": Damage(
        "arm3",
        then(
            *(
                change(name, time=lambda time: time + 0.1)
                for name in ("joint_positions", "joint_rates")
            )
        ),
        ("joint",),
        LATE,
        "positions and rates of a slow bus",
    ),
    "sign of an effort": Damage(
        "arm3",
        change("joint_efforts", times(1, -1, 1)),
        ("joint",),
        r"sign|turned|direction|revers",
        "current of a drive that is mounted the other way",
    ),
    "gyro stuck": Damage(
        "arm2",
        change("gyro", stuck),
        ("gyro",),
        r"frozen|stuck|repeat|change|constant",
        "for 3 s",
    ),
    "accelerometer clipped": Damage(
        "quad",
        change("accelerometer", clipped),
        ("accelerometer",),
        r"saturat|clip|range|limit",
        "top tenth of z",
    ),
    "log of 50 Hz": Damage(
        "quad",
        then(change("gyro", resampled), change("accelerometer", resampled)),
        ("gyro", "accelerometer", "imu", "time"),
        r"line|interpolat|resampl|filter|rate|smooth",
        "gyro and accelerometer on straight lines between rows 20 ms apart",
    ),
    "start of another vehicle": Damage(
        "quad",
        lambda flight: flight,
        (*ROTORS, "mass", "vehicle", "start"),
        r"weight|mass|lift|another|start vehicle",
        "start that weighs 1.8 times as much",
        start=_heavier,
    ),
}
"""Damages by name."""


def damaged(name: str) -> tuple[FlightData, Case, Vehicle]:
    """Damaged flight, the vehicle that flew it, and the start that is told."""
    damage = DAMAGED[name]
    # the eighth lends its pose
    case = planted(damage.kind, list(DAMAGED).index(name) % 7)
    flight = measured(case, "low", damage.without, seconds=SECONDS)
    made = damage.make(flight)
    return dataclasses.replace(made, file="flight.csv"), case, damage.start(case.start)


NAMED, REPAIRED, MISREAD, SILENT, WRONG = (
    "named",
    "repaired",
    "misread",
    "silent",
    "wrong",
)
"""Channel and kind are told; the numbers are right; the channel, not the kind; wrong
numbers; another channel."""


def verdict(name: str) -> tuple[str, str]:
    """What an identification makes of a damaged flight, and the words for it."""
    flight, case, start = damaged(name)
    damage, said = DAMAGED[name], judge(flight, start)
    accused = said.accused(flight.file)
    for channel, finding in said.named(flight.file):
        if channel.startswith(damage.channels) and re.search(
            damage.finding, finding.partition(";")[0], re.I
        ):
            return NAMED, f"{channel}: {finding}"
    if accused:
        channels = [
            f"{channel}: {finding}"
            for channel, finding in accused
            if channel.startswith(damage.channels)
        ]
        if channels:
            return MISREAD, channels[0]
        return WRONG, f"{accused[0][0]}: {accused[0][1]}"
    assert said.found is not None
    wrong = wrong_numbers(said.found, case.truth)
    doubts = "; ".join(said.told)
    return (
        (SILENT, f"wrong: {', '.join(wrong)}. {doubts}")
        if wrong
        else (REPAIRED, f"all numbers right. {doubts}")
    )


def hover(kind: str, noise: str) -> Callable[[], tuple[FlightData, Vehicle]]:
    def made() -> tuple[FlightData, Vehicle]:
        case = planted(kind, 0, "hover", HOVERED)
        return measured(case, noise), case.start

    return made


def sound_flight(
    kind: str,
    seed: int,
    motion: str,
    noise: str,
    without: Sequence[str] = (),
    make: Change | None = None,
    **how: bool,
) -> Callable[[], tuple[FlightData, Vehicle]]:
    def made() -> tuple[FlightData, Vehicle]:
        case = (
            planted(kind, seed, motion)
            if motion == "excited"
            else planted(kind, seed, motion, HOVERED)
        )
        flight = measured(case, noise, without, seconds=HOVERED, **how)
        return (make(flight) if make else flight), case.start

    return made


def friction_off() -> tuple[FlightData, Vehicle]:
    """Three joints that move slowly, whose torque is mostly friction, of a start with
    three quarters of it.
    """
    case = planted("arm3", 1, "gentle", HOVERED)
    return measured(case, "low"), rubbing(case, 0.75)


def published(
    path: Path, start: Callable[[], Vehicle]
) -> Callable[[], tuple[FlightData, Vehicle]]:
    return lambda: (skyarm.load_flight(path), start())


def unpacked(folder: str, name: str) -> FlightData:
    """Packed flight of a folder."""
    with tempfile.TemporaryDirectory() as into:
        shutil.copy(FLIGHTS / folder / "columns.toml", into)
        file = Path(into) / f"{name}.csv"
        file.write_bytes(
            lzma.decompress((FLIGHTS / folder / f"{name}.csv.xz").read_bytes())
        )
        return skyarm.load_flight(file)


SOUND: Mapping[str, Callable[[], tuple[FlightData, Vehicle]]] = {
    "hover of a quadrotor": hover("quad", "low"),
    "hover of a quadrotor, noisy": hover("quad", "high"),
    "hover with two joints": hover("arm2", "low"),
    "hover with two joints, noisy": hover("arm2", "high"),
    "hover with three joints": hover("arm3", "low"),
    "hover with three joints, noisy": hover("arm3", "high"),
    "three joints": sound_flight("arm3", 1, "excited", "low"),
    "three joints, noisy, no rates": sound_flight(
        "arm3", 2, "excited", "high", ("joint_rates",)
    ),
    "three joints, no pose": sound_flight(
        "arm3", 3, "excited", "low", ("pose", "velocity")
    ),
    "three joints, slow, friction 25 % off": friction_off,
    "two joints, encoders of 1.5 mrad, no rates": sound_flight(
        "arm2", 1, "excited", "coarse", ("joint_rates",)
    ),
    "two joints, gentle": sound_flight("arm2", 1, "gentle", "low"),
    "quadrotor, gentle and noisy": sound_flight("quad", 1, "gentle", "high"),
    "two joints, pose of another clock": sound_flight(
        "arm2", 2, "excited", "low", other_clock=True
    ),
    "quadrotor, pose held on the gyro's rows": sound_flight(
        "quad", 2, "excited", "low", on_rows=True
    ),
    "quadrotor, shares, no velocity": sound_flight(
        "quad", 3, "excited", "low", ("velocity",), as_shares
    ),
    "Crazyflie, 3 s": published(CRAZYFLIE_LOG, crazyflie),
    "NanoBench's trefoil, 3 s": published(TREFOIL_LOG, crazyflie),
    "Gazebo's Iris, 3 s": published(IRIS_LOG, iris),
    "Gazebo's Iris": lambda: (unpacked("gazebo_iris", "quadrotor_model"), iris()),
    "NanoBench's star": lambda: (
        unpacked("nanobench", "B8_star_fast_rep1"),
        crazyflie(),
    ),
    "NanoBench's star again": lambda: (
        unpacked("nanobench", "B8_star_fast_rep2"),
        crazyflie(),
    ),
}
"""Flights of which nothing may be said against a channel."""

SHORT = r"too short|fly longer|no stretch|long enough"
"""Words of what a cut of three seconds is refused for, which accuse no channel."""


def accusations(name: str) -> list[str]:
    """What an identification says against a sound flight."""
    flight, start = SOUND[name]()
    accused = judge(flight, start).accused(flight.file)
    return [
        f"{channel}: {finding}"
        for channel, finding in accused
        if not re.search(SHORT, f"{channel} {finding}")
    ]
