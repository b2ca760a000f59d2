"""Thresholds of the checks of a log that need no model: a damage a little below each is
passed over, above it told.
"""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pytest
from changed_channels import SOUND, VEHICLE, made, rows_of, then, times, times_of

from skyarm.flight_data.flight_data import Channel
from skyarm.flight_data.own_log import SIMULATED
from skyarm.identify.log_checks import channel_gaps, check_log, require_no_refusal
from skyarm.vehicle.thrust_table import ThrustTable

SPEED = "rotor_speed_commands"
MAX = float(VEHICLE.rotors[0].max_speed)


def told(flight, vehicle=VEHICLE):
    return [
        f"{each.severity} {each.channel}: {each.finding}"
        for each in check_log(flight, vehicle)
    ]


def rows(name, chosen):
    """Flight with some rows of a channel."""

    def of(flight):
        channel = flight[name]
        return flight.with_channels(
            {
                name: dataclasses.replace(
                    channel, time=channel.time[chosen], values=channel.values[chosen]
                )
            }
        )

    return of


def held(name, count, column=slice(None), begin=200):
    """Rows that hold the one before them for so many steps."""

    def values(rows):
        rows = rows.copy()
        rows[begin : begin + count + 1, column] = rows[begin, column]
        return rows

    return rows_of(name, values)


def repeated(name, share):
    """Single rows, evenly spread, that repeat the one before."""

    def values(rows):
        last = np.arange(len(rows))
        again = np.flatnonzero(np.diff(np.floor(share * last)) > 0.0) + 1
        return rows[np.where(np.isin(last, again), last - 1, last)]

    return rows_of(name, values)


def without(name, *parts):
    """Channel without the rows of some spans of time, s."""

    def of(flight):
        time = flight[name].time
        return rows(name, ~np.any([(time > a) & (time < b) for a, b in parts], axis=0))(
            flight
        )

    return of


def dropped(name, share):
    """Single rows, evenly spread, that are missing."""
    count = SOUND[name].time.size
    return rows(
        name, ~np.isin(np.arange(count), np.arange(5, count - 5, round(1.0 / share)))
    )


def on_lines(name):
    """Every second row, and the mean of both between."""

    def values(rows):
        rows = rows.copy()
        rows[1:-1:2] = 0.5 * (rows[:-2:2] + rows[2::2])
        return rows

    return rows_of(name, values)


def at_limit(*runs, limit=9.0):
    """Runs of rows of the gyro's x at one limit."""

    def values(rows):
        rows = rows.copy()
        for i, count in enumerate(runs):
            rows[100 * (i + 1) : 100 * (i + 1) + count, 0] = limit
        return rows

    return rows_of("gyro", values)


def beyond(name, share, value, sign=1.0):
    """Share of rows with one number beyond what is possible."""

    def values(rows):
        rows = rows.copy()
        rows[: round(share * len(rows)), 1] = sign * value
        return rows

    return rows_of(name, values)


def shares(flight):
    """Commands as shares of the full signal."""
    speeds = flight[SPEED]
    rest = {name: flight[name] for name in flight if name != SPEED}
    commands = dataclasses.replace(speeds, values=speeds.values / MAX)
    return dataclasses.replace(flight, channels={**rest, "rotor_commands": commands})


def quiet(noise, path, axes=(1.0, 1.0, 1.0)):
    """Flight whose gyro deviates by some rad/s about some axes and whose position moves
    along x by so many m.
    """
    return then(
        rows_of(
            "gyro",
            lambda rows: (
                noise
                * np.where(np.arange(len(rows)) % 2, 1.0, -1.0)[:, None]
                * np.array(axes)
            ),
        ),
        rows_of(
            "position",
            lambda rows: np.linspace(0.0, path, len(rows))[:, None] * [1.0, 0.0, 0.0],
        ),
    )


def noted(text):
    return lambda flight: flight.with_channels({}, text)


def added(name, values):
    return lambda flight: flight.with_channels(
        {
            name: Channel(
                time=flight["gyro"].time,
                values=np.full((flight["gyro"].time.size, 1), values),
                source="made",
            )
        }
    )


def gap_of_all(begin, end):
    return then(*(without(name, (begin, end)) for name in SOUND))


AROUND = {
    "rows without numbers": (
        noted("gyro: 200 of 1000 rows are without numbers."),
        noted("gyro: 201 of 1000 rows are without numbers."),
        "refused gyro: 201 of 1000 rows are without numbers",
    ),
    "frozen sensor": (
        held("position", 29),
        held("position", 31),
        "warned position: is frozen for 0.31 s at 2 s",
    ),
    "frozen needed sensor": (
        held("gyro", 29),
        held("gyro", 31),
        "refused gyro: is frozen for 0.31 s",
    ),
    "frozen axis": (
        held("gyro", 59, 1),
        held("gyro", 61, 1),
        "refused gyro: axis y is frozen for 0.61 s",
    ),
    "frozen axis of a pose": (
        held("position", 400, 1),
        held("position", 31),
        "warned position: is frozen",
    ),
    "stuck commands": (
        held(SPEED, 99),
        held(SPEED, 101),
        f"refused {SPEED}: is frozen for 1.01 s",
    ),
    "commands that seldom change": (
        held(SPEED, 370),
        held(SPEED, 330),
        f"refused {SPEED}: is frozen for 3.3 s",
    ),
    "frozen channel of few rows": (
        then(rows("position", slice(None, 792, 8)), held("position", 20, begin=40)),
        then(rows("position", slice(None, None, 8)), held("position", 20, begin=40)),
        "warned position: is frozen",
    ),
    "repeated rows": (
        repeated("gyro", 0.29),
        repeated("gyro", 0.31),
        (
            "warned gyro: 31 % of the rows repeat the one before, so that its rate is"
            " 69.1 Hz rather than 100 Hz"
        ),
    ),
    "lines between samples": (
        on_lines("velocity"),
        on_lines("gyro"),
        (
            "warned gyro: is on straight lines between samples of 50 Hz, rather than of"
            " 100 Hz"
        ),
    ),
    "a limit, in all": (
        at_limit(4),
        at_limit(5),
        "warned gyro: axis x is saturated at 9 in 5 samples",
    ),
    "a limit, in runs": (
        at_limit(3, 1, 1),
        at_limit(3, 3),
        "warned gyro: axis x is saturated at 9 in 6 samples",
    ),
    "a lower limit": (
        at_limit(4, limit=-9.0),
        at_limit(6, limit=-9.0),
        "warned gyro: axis x is saturated at -9 in 6",
    ),
    "a gap of a sensor": (
        without("position", (3.0, 3.085)),
        without("position", (3.0, 3.105)),
        "warned position: a gap of 0.11 s at 3 s",
    ),
    "a gap of commands": (
        without(SPEED, (3.0, 3.485)),
        without(SPEED, (3.0, 3.505)),
        f"refused {SPEED}: a gap of 0.51 s at 3 s",
    ),
    "a long gap": (
        without("accelerometer", (3.0, 3.085)),
        without("accelerometer", (3.0, 3.505)),
        "refused accelerometer: a gap of 0.51 s",
    ),
    "a short gap": (
        without("accelerometer", (3.0, 3.085)),
        without("accelerometer", (3.0, 3.495)),
        "warned accelerometer: a gap of 0.5 s",
    ),
    "gaps": (
        without("position", (3.0, 3.085), (5.0, 5.085)),
        without("position", (3.0, 3.2), (5.0, 5.3)),
        "warned position: 2 gaps, the longest of 0.3 s at 5 s",
    ),
    "a gap of the gyro": (
        without("gyro", (3.0, 3.085)),
        without("gyro", (3.0, 3.705)),
        "warned gyro: a gap of 0.71 s",
    ),
    "a jump": (
        gap_of_all(3.0, 3.085),
        gap_of_all(3.0, 3.605),
        "warned time: jumps by 0.61 s at 3 s in all channels",
    ),
    "missing samples": (
        dropped("velocity", 1 / 35),
        dropped("velocity", 1 / 32),
        "warned velocity: 3.1 % of the samples are missing, at 100 Hz",
    ),
    "an early end": (
        without("gyro", (7.005, 9.0)),
        without("gyro", (6.975, 9.0)),
        "warned gyro: ends 1.02 s before the flight",
    ),
    "spikes": (
        beyond("gyro", 0.009, 69.7),
        beyond("gyro", 0.009, 69.9, -1.0),
        "refused gyro: 7 of 800 samples are beyond 69.8, the first at 0 s",
    ),
    "another unit is no spike": (
        beyond("accelerometer", 0.011, 700.0),
        beyond("accelerometer", 0.009, 700.0),
        "refused accelerometer: 7 of 800 samples are beyond 628",
    ),
    "damaged shares": (
        then(shares, beyond("rotor_commands", 0.1, 1.05)),
        then(shares, beyond("rotor_commands", 0.009, 1.06)),
        "warned rotor_commands: 0.88 % of the rows are outside 0 to 1",
    ),
    "commands beyond full": (
        then(shares, rows_of("rotor_commands", lambda rows: 0.0 * rows + 1.05)),
        then(shares, rows_of("rotor_commands", lambda rows: 0.0 * rows + 1.06)),
        "refused rotor_commands: is 1.06 on the median, and flights have 0 to 1.05: ",
    ),
    "shares below 0": (
        then(shares, beyond("rotor_commands", 0.1, 0.05, -1.0)),
        then(shares, beyond("rotor_commands", 0.1, 0.051, -1.0)),
        "refused rotor_commands: 10 % of the rows are outside 0 to 1, from -0.051 to",
    ),
    "many damaged shares": (
        then(shares, beyond("rotor_commands", 0.009, 0.06, -1.0)),
        then(shares, beyond("rotor_commands", 0.011, 0.06, -1.0)),
        (
            r"refused rotor_commands: 1.1 % of the rows are outside 0 to 1, from -0.06"
            r" to [\d.]+: they are damaged"
        ),
    ),
    "accelerometer in another unit": (
        rows_of("accelerometer", times(0.6, 0.6, 0.6)),
        rows_of("accelerometer", times(0.4, 0.4, 0.4)),
        (
            "refused accelerometer: is .* on the median, and flights have 4.91 to"
            " 19.62: no unit fits"
        ),
    ),
    "accelerometer without gravity": (
        rows_of("accelerometer", lambda rows: rows + np.array([8.0, 0.0, 0.0])),
        rows_of("accelerometer", lambda rows: rows - [0.0, 0.0, 9.81]),
        "refused accelerometer: .* it looks as if gravity were taken off",
    ),
    "voltage": (
        added("voltage", 99.0),
        added("voltage", 1.1e4),
        "refused voltage: .* it looks like mV",
    ),
    "low voltage": (
        added("voltage", 1.1),
        added("voltage", 0.9),
        "refused voltage: .* no unit fits",
    ),
    "high voltage": (
        added("voltage", 100.0),
        added("voltage", 100.1),
        "refused voltage: .* no unit fits",
    ),
    "fast velocity": (
        rows_of("velocity", lambda rows: rows + np.array([0.0, 98.0, 0.0])),
        rows_of("velocity", lambda rows: rows + np.array([0.0, 102.0, 0.0])),
        (
            "refused velocity: is .* on the median, and flights have 0 to 100: it looks"
            " like mm/s"
        ),
    ),
    "angles": (
        rows_of("joint_positions", lambda rows: rows + 12.0),
        rows_of("joint_positions", lambda rows: rows + 50.0),
        "refused joint_positions: .* it looks like degrees",
    ),
    "a slow gyro": (
        times_of(tuple(SOUND), lambda time: time * 100.0 / 10.1),
        times_of(tuple(SOUND), lambda time: time * 100.0 / 9.9),
        "refused time: has 9.9 samples of the gyro in a second: times look like ms",
    ),
    "a fast gyro": (
        times_of(["gyro"], lambda time: time * 100.0 / 1.9e4),
        times_of(["gyro"], lambda time: time * 100.0 / 2.1e4),
        r"refused time: has 2.1e\+04 samples of the gyro in a second$",
    ),
    "too much lift": (
        rows_of(SPEED, times(*(2.49**0.5,) * 4)),
        rows_of(SPEED, times(*(2.51**0.5,) * 4)),
        f"refused {SPEED}: lift 2.51 times the weight",
    ),
    "too little lift": (
        rows_of(SPEED, times(*(0.53**0.5,) * 4)),
        rows_of(SPEED, times(*(0.47**0.5,) * 4)),
        f"refused {SPEED}: lift 0.47 times the weight",
    ),
    "rpm": (
        rows_of(SPEED, times(*(4.0,) * 4)),
        rows_of(SPEED, times(*(9.6,) * 4)),
        f"refused {SPEED}: lift .* they look like rpm",
    ),
    "turns in a second": (
        rows_of(SPEED, times(*(0.5,) * 4)),
        rows_of(SPEED, times(*(0.5 / np.pi,) * 4)),
        f"refused {SPEED}: lift .* they look like Hz",
    ),
    "speeds of motors behind gears": (
        rows_of(SPEED, times(*(4.0,) * 4)),
        rows_of(SPEED, times(*(7.0,) * 4)),
        f"refused {SPEED}: lift .* they look like rad/s of a motor behind a gear",
    ),
    "at rest": (
        quiet(0.0502, 0.0),
        quiet(0.0498, 0.0),
        f"refused {SPEED}: lift 1 of the weight: the flight never took off",
    ),
    "at rest but for one axis": (
        quiet(0.0502, 0.0, (0.0, 0.0, 1.0)),
        quiet(0.0498, 0.0, (0.0, 0.0, 1.0)),
        f"refused {SPEED}: lift 1 of the weight: the flight never took off",
    ),
    "still": (
        quiet(0.01, 0.0201),
        quiet(0.01, 0.0199),
        f"refused {SPEED}: lift 1 of the weight: the flight never took off",
    ),
}
"""Kind -> damage that is passed over, damage that is told, and its words."""


@pytest.mark.parametrize("name", AROUND)
def test_a_damage_is_told_from_its_threshold_on(name):
    below, above, words = AROUND[name]
    passed, found = told(below(SOUND)), told(above(SOUND))
    assert any(re.match(words, each) for each in found), found
    kind = re.sub(r"[\d.]+ s?.*$", "", words)
    assert not any(
        re.match(words if kind == words else kind, each) for each in passed
    ), passed


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (rows_of("accelerometer", times(*(100.0,) * 3)), "it looks like mg or cm/s^2"),
        (rows_of("accelerometer", times(*(0.102,) * 3)), "it looks like g"),
        (
            rows_of("velocity", lambda rows: 100.0 * rows + [0.0, 300.0, 0.0]),
            "it looks like mm/s or cm/s",
        ),
        (
            rows_of("velocity", lambda rows: 1e3 * rows + [0.0, 2e4, 0.0]),
            "it looks like mm/s",
        ),
        (
            then(shares, rows_of("rotor_commands", lambda rows: 0.0 * rows + 90.0)),
            "it looks like percent or a byte",
        ),
        (
            then(shares, rows_of("rotor_commands", lambda rows: 0.0 * rows + 30.0)),
            "it looks like percent",
        ),
        (
            then(shares, rows_of("rotor_commands", lambda rows: 0.0 * rows + 150.0)),
            "it looks like a byte",
        ),
        (
            rows_of(SPEED, times(*(60.0**0.5,) * 4)),
            "look like rpm or rad/s of a motor behind a gear, or of poles",
        ),
    ],
)
def test_units_that_cannot_be_told_apart_are_all_named(change, words):
    (found,) = [each for each in told(change(SOUND)) if each.startswith("refused")]
    assert found.endswith(words)


@pytest.mark.parametrize(
    ("height", "words"),
    [
        (0.49, "0.28 of the weight: the flight never took off"),
        (0.51, "0.28 times the weight of"),
    ],
)
def test_a_calm_flight_that_climbs_took_off_however_little_its_rotors_seem_to_lift(
    height, words
):
    rise = rows_of(
        "position",
        lambda rows: np.outer(np.linspace(0.0, height, len(rows)), [0.0, 0.0, 1.0]),
    )
    (found,) = told(
        then(quiet(0.01, 0.0), rise, rows_of(SPEED, times(*(0.28**0.5,) * 4)))(SOUND)
    )
    assert f"lift {words}" in found


def test_measured_speeds_are_offered_where_no_commands_were_logged():
    speeds = dataclasses.replace(SOUND[SPEED], source="measured")
    channels = {name: SOUND[name] for name in SOUND if name != SPEED} | {
        "rotor_speeds": speeds
    }
    (found,) = check_log(dataclasses.replace(SOUND, channels=channels), VEHICLE)
    assert (
        found.remedy
        == "log them, or map the measured rotor_speeds as rotor_speed_commands"
    )


def test_a_sound_flight_has_nothing_to_tell():
    assert told(SOUND) == told(made(2.05)) == told(shares(SOUND)) == []
    assert told(made(2.0)) == [
        "refused flight: 0.98 s in the air: too short, or cut off"
    ]


@pytest.mark.parametrize(
    ("name", "least", "most"),
    [("position", 0.09, 0.11), ("rotor_commands", 0.49, 0.51), ("voltage", 0.09, 0.11)],
)
@pytest.mark.parametrize("count", [19, 20, 60])
def test_gaps_are_told_of_channels_whose_rate_is_known(name, least, most, count):
    """A sensor may miss five of its usual times between samples, a held command
    twenty.
    """
    times = 20.0 if name == "rotor_commands" else 5.0
    for usual in (0.01, 0.1):
        for gap, found in (
            (max(least, 0.98 * times * usual), False),
            (max(most, 1.02 * times * usual), True),
        ):
            time = np.arange(count) * usual
            time[10:] += gap - usual
            gaps = channel_gaps(
                name, Channel(time=time, values=np.zeros((count, 1)), source="made")
            )
            expected = (
                [(pytest.approx(9.0 * usual), pytest.approx(gap))]
                if found and count >= 20
                else []
            )
            assert gaps == expected


@pytest.mark.parametrize(
    ("rest", "words"),
    [(1.9, []), (2.1, ["warned gyro: ends 2.1 s before the flight: it is cut off"])],
)
def test_of_a_long_flight_a_twentieth_may_lack(rest, words):
    flight = made(40.0, 20.0)
    assert told(rows("gyro", slice(None, round(20.0 * -rest)))(flight)) == words


def test_what_hides_other_damage_is_told_alone():
    empty = rows("gyro", slice(0))(
        then(held("position", 40), held("accelerometer", 40))(SOUND)
    )
    assert told(empty) == ["refused gyro: has no sample in this part of the flight"]
    unused = rows("velocity", slice(0))(held("position", 40)(SOUND))
    assert told(unused) == [
        "warned velocity: has no sample in this part of the flight",
        "warned position: is frozen for 0.4 s at 2 s",
    ]
    lost = noted("gyro: 900 of 1000 rows are lost.")(held("position", 40)(SOUND))
    assert told(lost) == [
        "refused gyro: 900 of 1000 rows are lost",
        "warned position: is frozen for 0.4 s at 2 s",
    ]
    wrong = then(
        beyond("gyro", 0.005, 99.0), rows_of("accelerometer", times(0.1, 0.1, 0.1))
    )(SOUND)
    assert [each.channel for each in check_log(wrong, VEHICLE)] == ["gyro"], (
        "units are looked at without spikes"
    )


def test_rotors_that_turn_the_other_way_may_have_negative_speeds():
    """Whether their thrust is that of a coefficient or of a table."""
    first = VEHICLE.rotors[0]
    speeds = tuple(MAX * share for share in (0.25, 0.5, 0.75, 1.0))
    table = ThrustTable(
        speed=speeds,
        thrust=tuple(first.thrust_coefficient * speed**2 for speed in speeds),
    )
    own = {"table": table, "thrust_coefficient": table.thrust_coefficient}
    rotors = [dataclasses.replace(each, **own) for each in VEHICLE.rotors]
    signed = rows_of(SPEED, times(1, -1, 1, -1))(SOUND)
    assert (
        told(signed)
        == told(signed, dataclasses.replace(VEHICLE, rotors=tuple(rotors)))
        == []
    )


def test_a_warning_is_no_reason_to_refuse_a_flight_and_the_first_fault_is_named():
    faults = check_log(
        then(held("position", 40), held("gyro", 40), held(SPEED, 120))(SOUND), VEHICLE
    )
    assert [each.severity for each in faults] == ["refused", "warned", "refused"]
    require_no_refusal(faults[1:2])
    require_no_refusal(())
    with pytest.raises(ValueError, match=r"^flight\.csv: gyro: is frozen for 0\.4 s"):
        require_no_refusal([faults[1], faults[0], faults[2]])


def test_speeds_tell_more_than_shares():
    both = SOUND.with_channels(
        {
            "rotor_commands": dataclasses.replace(
                SOUND[SPEED], values=70.0 + SOUND[SPEED].values
            )
        }
    )
    assert told(both) == []


def test_a_flight_of_the_simulator_is_told_how_to_log_more():
    flight = dataclasses.replace(
        SOUND,
        channels={
            name: SOUND[name]
            for name in SOUND
            if name not in ("gyro", SPEED, "joint_positions")
        },
    )
    remedies = {each.channel: each.remedy for each in check_log(flight, VEHICLE)}
    assert remedies == {
        "gyro": "log it, or map its columns",
        "rotor_commands": "log them, or map their columns",
        "joint_positions": "log them: they move its mass",
    }
    ours = dataclasses.replace(flight, facts={"vehicle": SIMULATED})
    remedies = {each.channel: each.remedy for each in check_log(ours, VEHICLE)}
    assert remedies["gyro"].startswith("name an inertial unit in the scenario")


def test_a_position_or_velocity_without_an_attitude_is_not_used():
    blind = dataclasses.replace(
        SOUND, channels={name: SOUND[name] for name in SOUND if name != "quaternion"}
    )
    assert "warned position: no attitude is measured beside it" in told(blind)
    assert not any("attitude" in each for each in told(SOUND))


def test_a_flight_below_a_second_is_short_rather_than_on_the_ground():
    assert told(made(seconds=0.9)) == [
        "refused flight: 0 s in the air: too short, or cut off"
    ]


def test_the_cure_of_commands_in_percent_is_their_range():
    shares = SOUND["rotor_speed_commands"].values / MAX
    percent = dataclasses.replace(SOUND["rotor_speed_commands"], values=100.0 * shares)
    channels = {name: SOUND[name] for name in SOUND if name != SPEED} | {
        "rotor_commands": percent
    }
    (fault,) = check_log(dataclasses.replace(SOUND, channels=channels), VEHICLE)
    assert fault.finding.endswith("it looks like percent or a byte")
    assert fault.remedy == "state low and high in columns.toml"


@pytest.mark.parametrize("name", ["joint_positions", "joint_commands"])
def test_angles_beyond_two_turns_look_like_degrees(name):
    channel = SOUND["joint_positions"]
    for size, refused in ((4.0 * np.pi - 0.05, False), (4.0 * np.pi + 0.05, True)):
        values = np.full_like(channel.values, size)
        flight = SOUND.with_channels(
            {name: dataclasses.replace(channel, values=values)}
        )
        assert (
            any(f"{name}: is" in each and "degrees" in each for each in told(flight))
            is refused
        )
