"""Faults that are planted in a sound flight are named, each by its channel and finding;
a sound flight has none.
"""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pytest
from planted_vehicles import NOMINAL, fly_designed

import skyarm
from skyarm.flight_data.flight_data import Channel
from skyarm.identify.isolate_fault import find_faults
from skyarm.identify.log_checks import REFUSED, WARNED, check_log, require_no_refusal
from support.vehicles import (
    CRAZYFLIE_LOG,
    IRIS_LOG,
    TREFOIL_LOG,
    crazyflie,
    iris,
    logged,
)

SEED, SECONDS = 0, 34.0
START = NOMINAL


@pytest.fixture(scope="module")
def sound():
    """A vehicle with an arm under noise, its battery's voltage and its joints'
    commanded positions.
    """
    flight = fly_designed(SEED, SECONDS)[2]
    joints, speeds = flight["joint_positions"], flight["rotor_speed_commands"]
    late = Channel(time=joints.time - 0.02, values=joints.values, source="made")
    volts = Channel(
        time=speeds.time, values=np.full((speeds.time.size, 1), 11.7), source="made"
    )
    made = flight.with_channels({"joint_commands": late, "voltage": volts})
    return dataclasses.replace(made, file="flight.csv")


def change(flight, name, values=None, time=None):
    """The flight with other values or times of a channel."""
    channel = flight[name]
    values = channel.values if values is None else values(channel.values)
    time = channel.time if time is None else time(channel.time)
    return flight.with_channels(
        {name: Channel(time=time, values=values, source=channel.source)}
    )


def keep(flight, rows, *names):
    """The flight with some rows of channels, by their times."""
    found = flight
    for name in names or tuple(flight):
        channel = flight[name]
        kept = rows(channel.time)
        found = found.with_channels(
            {
                name: Channel(
                    time=channel.time[kept],
                    values=channel.values[kept],
                    source=channel.source,
                )
            }
        )
    return found


def axes(name, mapping):
    return lambda flight: change(
        flight, name, lambda rows: rows @ np.array(mapping, dtype=float).T
    )


def scaled(name, factor):
    return lambda flight: change(flight, name, lambda rows: factor * rows)


def stretched(factor):
    """A flight on a clock that goes wrong by a factor; its readings stay."""
    return lambda flight: dataclasses.replace(
        flight,
        channels={
            name: Channel(
                time=factor * each.time, values=each.values, source=each.source
            )
            for name, each in flight.channels.items()
        },
    )


def order(name, *places):
    return lambda flight: change(flight, name, lambda rows: rows[:, list(places)])


def late(name, seconds):
    return lambda flight: change(flight, name, time=lambda time: time + seconds)


def shares(flight, factor=1.0, base=0.0):
    """Commands as shares of the full signal in some unit."""
    speeds = flight["rotor_speed_commands"]
    top = np.array([each.max_speed for each in START.rotors])
    made = Channel(
        time=speeds.time, values=base + factor * speeds.values / top, source="made"
    )
    rest = {name: flight[name] for name in flight if name != "rotor_speed_commands"}
    return dataclasses.replace(flight, channels={**rest, "rotor_commands": made})


def frozen(name, column=slice(None)):
    def values(rows):
        rows = rows.copy()
        rows[len(rows) // 2 :, column] = rows[len(rows) // 2, column]
        return rows

    return lambda flight: change(flight, name, values)


def stuck(name):
    """A channel that holds one value for two seconds."""

    def values(rows):
        rows = rows.copy()
        middle = len(rows) // 2
        rows[middle : middle + round(2.0 * len(rows) / SECONDS)] = rows[middle]
        return rows

    return lambda flight: change(flight, name, values)


def saturated(name, column):
    def values(rows):
        rows = rows.copy()
        rows[:, column] = np.minimum(
            rows[:, column], np.quantile(rows[:, column], 0.95)
        )
        return rows

    return lambda flight: change(flight, name, values)


def repeated(flight):
    """Every second row of the gyro holds the one before."""
    return change(flight, "gyro", lambda rows: rows[np.arange(len(rows)) // 2 * 2])


def on_lines(flight):
    """Every tenth row of the gyro, and straight lines between."""

    def values(rows):
        kept, every = np.arange(0, len(rows), 10), np.arange(len(rows))
        return np.stack(
            [np.interp(every, kept, column[kept]) for column in rows.T], axis=1
        )

    return change(flight, "gyro", values)


def forward_right_down(flight):
    """Every channel in the axes forward, right, down, which are said to be forward,
    left, up.
    """
    for name in ("gyro", "accelerometer"):
        flight = axes(name, np.diag([1.0, -1.0, -1.0]))(flight)
    return change(
        flight,
        "quaternion",
        lambda q: np.stack([-q[:, 1], q[:, 0], q[:, 3], -q[:, 2]], axis=1),
    )


def turned(flight):
    """The base axes of all sensors turned by 45 degrees about z."""
    c = 0.5**0.5
    for name in ("gyro", "accelerometer"):
        flight = axes(name, [[c, c, 0], [-c, c, 0], [0, 0, 1]])(flight)
    half = np.cos(np.pi / 8), np.sin(np.pi / 8)

    def right(q):
        w, x, y, z = q.T
        a, b = half
        return np.stack(
            [w * a - z * b, x * a + y * b, y * a - x * b, z * a + w * b], axis=1
        )

    return change(flight, "quaternion", right)


def noted(words):
    return lambda flight: flight.with_channels({}, words)


def on_the_ground(flight):
    """The motors turn, and nothing moves."""
    noise = np.random.default_rng(0)
    flight = change(flight, "rotor_speed_commands", lambda rows: 0.1 * rows)
    flight = change(
        flight, "gyro", lambda rows: noise.normal(scale=0.003, size=rows.shape)
    )
    flight = change(
        flight, "position", lambda rows: noise.normal(scale=0.001, size=rows.shape)
    )
    return change(
        flight,
        "accelerometer",
        lambda rows: noise.normal([0.0, 0.0, 9.81], 0.02, rows.shape),
    )


def without(*names):
    return lambda flight: dataclasses.replace(
        flight, channels={name: flight[name] for name in flight if name not in names}
    )


def gone(begin, end, *names):
    return lambda flight: keep(
        flight, lambda time: (time < begin) | (time > end), *names
    )


def dropped(flight):
    draw = np.random.default_rng(1)
    return keep(
        flight,
        lambda time: draw.uniform(size=time.size) > 0.15,
        "gyro",
        "accelerometer",
    )


SWAP_XY, SWAP_YZ = [[0, 1, 0], [1, 0, 0], [0, 0, 1]], [[1, 0, 0], [0, 0, 1], [0, 1, 0]]
FLIP = {
    axis: np.diag([-1.0 if axis == each else 1.0 for each in "xyz"]) for axis in "xyz"
}
ONLY_RATES = without("quaternion", "position", "velocity")


def then(*changes):
    def made(flight):
        for each in changes:
            flight = each(flight)
        return flight

    return made


PLANTED = {
    # the file
    "cut off": (
        lambda f: f.section(0.0, 0.7),
        REFUSED,
        "flight: .* s in the air: too short, or cut off",
    ),
    "gyro cut off": (
        gone(9.0, 99.0, "gyro"),
        WARNED,
        "gyro: ends .* s before the flight: it is cut off",
    ),
    "time jump": (
        gone(5.0, 7.0),
        WARNED,
        "time: jumps by 2.* s at 4.995 s in all channels",
    ),
    "repeated stamps": (
        noted("gyro: 700 of 2000 rows are left out, as their times do not rise."),
        REFUSED,
        "gyro: 700 of 2000 rows are left out, as their times do not rise",
    ),
    "numbers that are none": (
        noted("accelerometer: 12 of 2000 rows are without numbers and are left out."),
        WARNED,
        "accelerometer: 12 of 2000 rows are without numbers",
    ),
    "dropped samples": (dropped, WARNED, r"gyro: 1\d % of the samples are missing"),
    "commands missing": (
        gone(4.0, 6.0, "rotor_speed_commands"),
        REFUSED,
        "rotor_speed_commands: a gap of 2.* s at 3.995 s: samples are missing",
    ),
    "no accelerometer": (
        without("accelerometer"),
        REFUSED,
        "accelerometer: is not in this flight",
    ),
    "never took off": (
        on_the_ground,
        REFUSED,
        "rotor_speed_commands: .*: the flight never took off",
    ),
    # one channel
    "frozen gyro": (frozen("gyro"), REFUSED, "gyro: is frozen for .* s"),
    "frozen axis": (frozen("gyro", 1), REFUSED, "gyro: axis y is frozen for .* s"),
    "frozen position": (frozen("position"), WARNED, "position: is frozen for .* s"),
    "frozen joints": (
        frozen("joint_positions"),
        REFUSED,
        "joint_positions: is frozen for .* s",
    ),
    "joints frozen for a while": (
        stuck("joint_positions"),
        REFUSED,
        "joint_positions: is frozen for 2 s",
    ),
    "saturated gyro": (saturated("gyro", 0), WARNED, "gyro: axis x is saturated at"),
    "saturated accelerometer": (
        saturated("accelerometer", 2),
        WARNED,
        "accelerometer: axis z is saturated at 1",
    ),
    "lines between samples": (
        on_lines,
        WARNED,
        "gyro: is on straight lines between samples of 20 Hz, rather than of 200 Hz",
    ),
    "rows repeated": (
        repeated,
        WARNED,
        r"gyro: [45]\d % of the rows repeat the one before",
    ),
    # units
    "gyro in deg/s": (scaled("gyro", 57.29578), REFUSED, "gyro: it looks like deg/s"),
    "gyro in deg/s without attitude": (
        then(ONLY_RATES, scaled("gyro", 57.29578)),
        REFUSED,
        "gyro: it looks like deg/s",
    ),
    "accelerometer in g": (
        scaled("accelerometer", 1 / 9.80665),
        REFUSED,
        "accelerometer: .* it looks like g",
    ),
    "commands of 16 bit": (
        lambda f: shares(f, 65535.0),
        REFUSED,
        "rotor_commands: .* it looks like a word of 16 bit",
    ),
    "commands as pulses": (
        lambda f: shares(f, 1000.0, 1000.0),
        REFUSED,
        "rotor_commands: .* like a pulse width",
    ),
    "speeds in rpm": (
        scaled("rotor_speed_commands", 9.5493),
        REFUSED,
        "rotor_speed_commands: .* look like rpm",
    ),
    "times in ms": (
        stretched(1e3),
        REFUSED,
        "time: has 0.2 samples of the gyro in a second: times look like ms",
    ),
    "accelerometer without gravity": (
        lambda f: change(f, "accelerometer", lambda rows: rows - [0.0, 0.0, 9.81]),
        REFUSED,
        "accelerometer: is .* on the median, .*: it looks as if gravity were taken off",
    ),
    "voltage in mV": (scaled("voltage", 1e3), REFUSED, "voltage: .* it looks like mV"),
    "joints in degrees": (
        scaled("joint_positions", 57.29578),
        REFUSED,
        "joint_positions: .* it looks like degrees",
    ),
    "joint rates in deg/s": (
        scaled("joint_rates", 57.29578),
        REFUSED,
        "joint_rates: it looks like deg/s",
    ),
    "velocity in mm/s": (
        scaled("velocity", 1e3),
        REFUSED,
        "velocity: .* it looks like mm/s",
    ),
    # scales
    "gyro of 9 % more": (
        scaled("gyro", 1.09),
        REFUSED,
        r"gyro: is 1\.(08|09|1)\d* times what fits",
    ),
    "times of 1.9": (stretched(1.9), REFUSED, r"time: runs 1\.[89]\d* times as fast"),
    "times of 0.92": (
        stretched(0.92),
        REFUSED,
        r"time: runs 0\.9[123]\d* times as fast",
    ),
    "accelerometer of 1.5": (
        scaled("accelerometer", 1.5),
        REFUSED,
        r"accelerometer: is 1\.(4|5)\d* times what fits",
    ),
    "accelerometer of 0.91": (
        scaled("accelerometer", 0.91),
        REFUSED,
        r"accelerometer: is 0\.9\d* times what fits",
    ),
    "accelerometer of 1.5 without attitude": (
        then(ONLY_RATES, scaled("accelerometer", 1.5)),
        REFUSED,
        r"accelerometer: is 1\.(4|5)\d* times what fits",
    ),
    "velocity of 1.1": (
        scaled("velocity", 1.1),
        REFUSED,
        r"velocity: is 1\.(0[89]|1)\d* times what fits",
    ),
    # axes
    "gyro x and y": (axes("gyro", SWAP_XY), REFUSED, "gyro: x and y look swapped"),
    "gyro y and z": (axes("gyro", SWAP_YZ), REFUSED, "gyro: y and z look swapped"),
    "gyro x turned": (
        axes("gyro", FLIP["x"]),
        REFUSED,
        "gyro: the sign of x looks turned",
    ),
    "gyro y turned": (
        axes("gyro", FLIP["y"]),
        REFUSED,
        "gyro: the sign of y looks turned",
    ),
    "gyro z turned": (
        axes("gyro", FLIP["z"]),
        REFUSED,
        "gyro: the sign of z looks turned",
    ),
    "gyro x and y without attitude": (
        then(ONLY_RATES, axes("gyro", SWAP_XY)),
        REFUSED,
        "gyro: x and y look swapped",
    ),
    "gyro turned without attitude": (
        then(ONLY_RATES, axes("gyro", [[0, 1, 0], [0, 0, 1], [1, 0, 0]])),
        REFUSED,
        "gyro: the axes look swapped or turned: z, x, y stand for x, y, z",
    ),
    "gyro FRD": (
        axes("gyro", np.diag([1.0, -1.0, -1.0])),
        REFUSED,
        "gyro: the signs of y and z look turned, as of forward, right, down",
    ),
    "all FRD": (
        forward_right_down,
        REFUSED,
        "gyro: .*forward, right, down.*accelerometer .* along -z",
    ),
    "accelerometer upside down": (
        axes("accelerometer", FLIP["z"]),
        REFUSED,
        "accelerometer: measures the thrust along -z rather than z",
    ),
    "accelerometer y and z": (
        axes("accelerometer", SWAP_YZ),
        REFUSED,
        "accelerometer: measures the thrust along y rather than z",
    ),
    "axes turned": (
        turned,
        REFUSED,
        r"rotor commands: .* as if it stood -?45 deg about z from its rotors' places",
    ),
    "velocity in north, east, down": (
        axes("velocity", np.diag([1.0, -1.0, -1.0])),
        REFUSED,
        "velocity: the signs of y and z look turned",
    ),
    "position x and y": (
        axes("position", SWAP_XY),
        REFUSED,
        "position: x and y look swapped",
    ),
    # attitude
    "quaternion x, y, z, w": (
        order("quaternion", 1, 2, 3, 0),
        REFUSED,
        "quaternion: looks like x, y, z, w read as w",
    ),
    "quaternion w first": (
        order("quaternion", 3, 0, 1, 2),
        REFUSED,
        "quaternion: looks like w, x, y, z read as x",
    ),
    "quaternion inverse": (
        axes("quaternion", np.diag([1.0, -1.0, -1.0, -1.0])),
        REFUSED,
        "quaternion: turns the other way: it looks inverse",
    ),
    "quaternion late": (
        late("quaternion", 0.08),
        WARNED,
        "quaternion: is (79|80|81) ± . ms late against the gyro",
    ),
    # rotors
    "rotors exchanged": (
        order("rotor_speed_commands", 2, 1, 0, 3),
        REFUSED,
        "rotor commands: rotors 1 and 3 look exchanged",
    ),
    "rotors reversed": (
        order("rotor_speed_commands", 3, 2, 1, 0),
        REFUSED,
        "rotor commands: the order of the rotors looks reversed",
    ),
    "rotors mirrored": (
        order("rotor_speed_commands", 0, 3, 2, 1),
        REFUSED,
        "rotor commands: the rotors look mirrored, left for right",
    ),
    "rotors of another order": (
        order("rotor_speed_commands", 1, 2, 3, 0),
        REFUSED,
        "rotor commands: the rotors look ordered 4, 1, 2, 3",
    ),
    "commands early": (
        late("rotor_speed_commands", -0.08),
        REFUSED,
        r"rotor commands: stamps are off by -\d+ ms",
    ),
    "commands stuck": (
        stuck("rotor_speed_commands"),
        REFUSED,
        "rotor_speed_commands: is frozen for 2 s at 17 s",
    ),
    # joints
    "joints exchanged": (
        then(order("joint_positions", 1, 0), order("joint_rates", 1, 0)),
        REFUSED,
        "joint_positions: .* look swapped",
    ),
    "joints exchanged, of efforts": (
        then(
            without("joint_commands"),
            order("joint_positions", 1, 0),
            order("joint_rates", 1, 0),
        ),
        REFUSED,
        "joint_positions: .* look swapped",
    ),
    "joint turned, of efforts": (
        then(
            without("joint_commands"),
            axes("joint_positions", np.diag([1.0, -1.0])),
            axes("joint_rates", np.diag([1.0, -1.0])),
        ),
        REFUSED,
        "joint_positions: the sign of .* looks turned",
    ),
    "joint rates turned": (
        axes("joint_rates", np.diag([-1.0, 1.0])),
        REFUSED,
        "joint_rates: the sign of .* looks turned",
    ),
    "joint turned": (
        then(without("joint_rates"), axes("joint_positions", np.diag([1.0, -1.0]))),
        REFUSED,
        "joint_positions: the sign of .* looks turned",
    ),
}


def test_a_sound_flight_has_no_fault(sound):
    assert find_faults(sound, START) == ()


@pytest.mark.thorough
def test_a_sound_flight_with_fewer_channels_has_no_fault(sound):
    assert find_faults(ONLY_RATES(sound), START) == ()
    assert find_faults(shares(sound), START) == ()
    assert find_faults(without("joint_commands")(sound), START) == ()


def test_sensors_within_their_data_sheets_have_no_fault(sound):
    biased = change(
        sound, "accelerometer", lambda rows: rows + np.array([0.2, -0.2, 0.25])
    )
    assert find_faults(scaled("gyro", 1.03)(biased), START) == ()
    # as a published one
    assert find_faults(ONLY_RATES(scaled("accelerometer", 1.055)(sound)), START) == ()


def test_joints_at_rest_on_coarse_encoders_are_not_frozen(sound):
    """An arm at rest reads one value; it begins to move by one step of the encoder."""
    step = 2.0 * np.pi / 2**12

    def coarse(rows):
        # still at both ends
        ramp = np.clip(np.linspace(-0.2, 1.2, len(rows)), 0.0, 1.0)[:, None]
        return step * np.round(rows[:1] / step + ramp * 600.0)

    flight = change(sound, "joint_positions", coarse)
    # a search for why the joints jump would take minutes
    found = check_log(flight, START)
    assert [each for each in found if "frozen" in each.finding] == []


def test_an_empty_channel_does_not_hide_the_faults_of_others(sound):
    early = gone(4.0, 99.0, "voltage")(
        scaled("accelerometer", 1 / 9.80665)(sound)
    ).section(5.0, 14.0)
    told = [(each.severity, each.channel) for each in find_faults(early, START)]
    assert (REFUSED, "accelerometer") in told
    assert (WARNED, "voltage") in told
    (blind,) = find_faults(gone(4.0, 99.0, "gyro")(sound).section(5.0, 14.0), START)
    assert (blind.severity, blind.channel) == (REFUSED, "gyro")


def test_only_lost_rows_of_what_is_needed_refuse_a_flight(sound):
    words = "3000 of 4001 rows are without numbers and are left out."
    (fault,) = find_faults(noted(f"position: {words}")(sound), START)
    assert fault.severity == WARNED
    for name in ("gyro", "file"):
        (fault,) = find_faults(noted(f"{name}: {words}")(sound), START)
        assert fault.severity == REFUSED


ORDINARY = (
    "cut off, time jump, repeated stamps, numbers that are none, commands missing,"
    " never took off, frozen gyro, accelerometer in g, commands of 16 bit, speeds in"
    " rpm, times in ms, accelerometer without gravity, voltage in mV, joints in"
    " degrees, commands stuck, gyro in deg/s, quaternion inverse, joint turned"
)
"""Faults that every run of the tests plants; the others, which take seconds each, wait
for the nightly run."""


def planted(names):
    """Cases of faults; those beyond the ordinary ones are thorough."""
    return [
        (
            each
            if re.search(rf"(^|, ){re.escape(each)}(,|$)", ORDINARY)
            else pytest.param(each, marks=THOROUGH)
        )
        for each in names
    ]


THOROUGH = pytest.mark.thorough


@pytest.mark.parametrize("name", planted(PLANTED))
def test_a_planted_fault_is_named(sound, name):
    plant, severity, words = PLANTED[name]
    faults = find_faults(plant(sound), START)
    told = "\n".join(each.words for each in faults)
    named = [
        each
        for each in faults
        if re.fullmatch(f"flight.csv: {words}.*; .+", each.words)
    ]
    assert named, told or "no fault"
    assert named[0].severity == severity
    if severity == REFUSED:
        with pytest.raises(ValueError, match=r"^flight.csv: [^\n]+$"):
            require_no_refusal(faults)


GYRO_AND_ROTORS = [
    "frozen gyro",
    "frozen axis",
    "rows repeated",
    "gyro in deg/s without attitude",
    "accelerometer in g",
    "commands of 16 bit",
    "commands as pulses",
    "gyro x and y without attitude",
    "accelerometer upside down",
    "accelerometer y and z",
    "cut off",
    "dropped samples",
    "no accelerometer",
    "saturated gyro",
]
ATTITUDE = [
    "gyro in deg/s",
    "accelerometer in g",
    "gyro x and y",
    "gyro y and z",
    "gyro x turned",
    "gyro y turned",
    "gyro z turned",
    "gyro FRD",
    "quaternion inverse",
    "accelerometer upside down",
    "frozen gyro",
    "rows repeated",
    "cut off",
]


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("path", "start"),
    [(IRIS_LOG, iris()), (TREFOIL_LOG, crazyflie()), (CRAZYFLIE_LOG, crazyflie())],
)
def test_of_published_flights_no_channel_is_accused(path, start):
    """What their models leave is told once, by how much."""
    (fault,) = find_faults(logged(path), start)
    assert (fault.severity, fault.channel) == (WARNED, "model")
    assert re.fullmatch(
        r"does not explain (\w+ \([\d.]+ times its noise\)(, )?)+", fault.finding
    )


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("path", "start", "name"),
    [(CRAZYFLIE_LOG, crazyflie(), name) for name in GYRO_AND_ROTORS]
    + [(IRIS_LOG, iris(), name) for name in ATTITUDE],
)
def test_a_fault_planted_in_a_published_flight_is_named(path, start, name):
    plant, severity, words = PLANTED[name]
    flight = logged(path)
    if "rotor_commands" in flight and name.startswith("commands"):
        factor, base = (65535.0, 0.0) if "16" in name else (1000.0, 1000.0)
        wrong = change(flight, "rotor_commands", lambda rows: base + factor * rows)
    else:
        wrong = plant(flight)
    told = [
        each
        for each in find_faults(wrong, start)
        if re.fullmatch(f"flight.csv: {words}.*; .+", each.words)
    ]
    assert told, "\n".join(each.words for each in find_faults(wrong, start))
    assert told[0].severity == severity


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("places", "words"),
    [
        ((1, 0, 2, 3), "rotors 1 and 2 look exchanged"),
        (
            (3, 2, 1, 0),
            "the order of the rotors looks reversed|mirrored, left for right",
        ),
        ((2, 3, 0, 1), "the rotors look ordered 3, 4, 1, 2"),
    ],
)
def test_rotors_of_a_published_flight_in_another_order_are_named(places, words):
    wrong = order("rotor_commands", *places)(logged(CRAZYFLIE_LOG))
    assert re.search(
        words, "\n".join(each.words for each in find_faults(wrong, crazyflie()))
    )


@pytest.mark.parametrize(
    ("start", "words"),
    [
        (
            skyarm.load_vehicle("hexarotor_arm6"),
            "4 rotors, vehicle 'hexarotor_arm6' has 6",
        ),
        (skyarm.load_vehicle("hummingbird"), "2 joints, vehicle 'hummingbird' has 0"),
        (
            dataclasses.replace(
                START, base=dataclasses.replace(START.base, mass=3.5 * START.base.mass)
            ),
            "lift 0.[23].* times the weight of 'hummingbird_arm2_rotors'",
        ),
    ],
)
def test_another_vehicle_is_named(sound, start, words):
    assert re.search(words, "\n".join(each.words for each in find_faults(sound, start)))


@pytest.mark.parametrize(("name", "value"), [("gyro", 1e6), ("accelerometer", -1e300)])
def test_one_sample_that_no_sensor_reads_is_named(sound, name, value):
    def spoil(rows):
        rows = rows.copy()
        rows[rows.shape[0] // 2, 1] = value
        return rows

    faults = find_faults(change(sound, name, spoil), START)
    (fault,) = [each for each in faults if "samples are beyond" in each.finding]
    assert (fault.severity, fault.channel) == (REFUSED, name)
    assert fault.finding.startswith("1 of ")
