"""Changes that undo faults of channels, and the verdict on a flight that the model does not explain."""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pytest

import skyarm
from planted_flights import inverse, rotate
from skyarm.flight_data.flight_data import Channel, FlightData
from skyarm.studies.identify import isolate_fault
from skyarm.studies.identify.channel_changes import LEFT_OUT, channel_changes
from skyarm.studies.identify.isolate_fault import ALARM, CLEAR, DOUBTFUL, GAIN, ODD, PUSHES, Left, find_faults
from skyarm.studies.identify.log_checks import REFUSED, WARNED

VEHICLE = skyarm.load_vehicle("hummingbird_arm2_rotors")
ARM = [link.joint.name for link in VEHICLE.links]


def unit(rows):
    return rows / np.linalg.norm(rows, axis=1, keepdims=True)


def made(seconds=8.0, rate=100.0):
    """Channels of smooth random motion, which no vehicle flies, at the lift of a hover."""
    draw, time = np.random.default_rng(3), np.arange(0.0, seconds, 1.0 / rate)

    def smooth(width, size=1.0):
        waves = [np.sin(draw.uniform(1.0, 4.0, width) * time[:, None] + draw.uniform(0, 6, width)) for _ in range(3)]
        return size * sum(waves) + 0.01 * draw.normal(size=(len(time), width))

    hover = np.sqrt(9.81 * VEHICLE.mass / 4.0 / VEHICLE.rotors[0].thrust_coefficient)
    rows = {
        "gyro": smooth(3),
        "accelerometer": smooth(3, 0.5) + np.array([0.0, 0.0, 9.81]),
        "position": smooth(3),
        "velocity": smooth(3),
        "quaternion": unit(smooth(4, 0.1) + np.array([1.0, 0.0, 0.0, 0.0])),
        "rotor_speed_commands": smooth(4, 5.0) + hover,
        "joint_positions": smooth(2, 0.3),
        "joint_rates": smooth(2),
        "joint_efforts": smooth(2, 0.1),
    }
    channels = {name: Channel(time=time, values=each, source=name) for name, each in rows.items()}
    return FlightData(name="flight", file="flight.csv", channels=channels)


SOUND = made()


def rows_of(name, values):
    return lambda flight: flight.with_channels(
        {name: dataclasses.replace(flight[name], values=values(flight[name].values))}
    )


def times_of(names, time):
    return lambda flight: flight.with_channels(
        {name: dataclasses.replace(flight[name], time=time(flight[name].time)) for name in names if name in flight}
    )


def then(*changes):
    def both(flight):
        for each in changes:
            flight = each(flight)
        return flight

    return both


def columns(*order):
    return lambda rows: rows[:, list(order)]


def times(*factors):
    return lambda rows: rows * np.array(factors)


def half_a_turn_of_the_base(flight):
    """All sensors in axes forward, right, down."""
    for name in ("gyro", "accelerometer"):
        flight = rows_of(name, times(1, -1, -1))(flight)
    return rows_of("quaternion", lambda q: np.stack([-q[:, 1], q[:, 0], q[:, 3], -q[:, 2]], axis=1))(flight)


def in_base_axes(flight):
    return rows_of("velocity", lambda rows: rotate(inverse(flight["quaternion"].values), rows))(flight)


def about_z(rows):
    """Axes of a board that stands a quarter of a turn about z."""
    return rows @ np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]).T


COSINE = 0.5**0.5
POSE = ("position", "quaternion", "velocity")
DEGREES = 180.0 / np.pi
MAX = float(VEHICLE.rotors[0].max_speed)

UNDONE = {
    "a sign of the gyro": (rows_of("gyro", times(1, 1, -1)), "gyro", "the sign of z looks turned"),
    "axes of the gyro swapped": (rows_of("gyro", columns(1, 0, 2)), "gyro", "x and y look swapped"),
    "axes of the gyro turned": (
        rows_of("gyro", columns(1, 2, 0)),
        "gyro",
        "the axes look swapped or turned: z, x, y stand",
    ),
    "gyro of FRD": (
        rows_of("gyro", times(1, -1, -1)),
        "gyro",
        "signs of y and z look turned, as of forward, right, down",
    ),
    "gyro in deg/s": (rows_of("gyro", times(*(DEGREES,) * 3)), "gyro", "it looks like deg/s"),
    "gyro in mrad/s": (rows_of("gyro", times(*(1e3,) * 3)), "gyro", "it looks like mrad/s"),
    "gyro read as deg/s": (rows_of("gyro", times(*(1.0 / DEGREES,) * 3)), "gyro", "it looks like rad/s read as deg/s"),
    "accelerometer turned": (rows_of("accelerometer", about_z), "accelerometer", "the axes look swapped or turned"),
    "accelerometer upside down": (
        rows_of("accelerometer", times(1, 1, -1)),
        "accelerometer",
        "measures the thrust along -z rather than z",
    ),
    "accelerometer of another axis": (
        rows_of("accelerometer", columns(2, 1, 0)),
        "accelerometer",
        "measures the thrust along x rather than z",
    ),
    "board turned": (
        then(rows_of("gyro", about_z), rows_of("accelerometer", about_z)),
        "gyro",
        "axes look turned by 90 deg about z",
    ),
    "all of FRD": (half_a_turn_of_the_base, "gyro", "forward, right, down"),
    "attitude inverse": (
        rows_of("quaternion", times(1, -1, -1, -1)),
        "quaternion",
        "turns the other way: it looks inverse",
    ),
    "attitude x, y, z, w": (
        rows_of("quaternion", columns(1, 2, 3, 0)),
        "quaternion",
        "looks like x, y, z, w read as w",
    ),
    "attitude w first": (rows_of("quaternion", columns(3, 0, 1, 2)), "quaternion", "looks like w, x, y, z read as x"),
    "attitude of FRD in NED": (
        rows_of("quaternion", times(1, 1, -1, -1)),
        "quaternion",
        "right, down in north, east, down",
    ),
    "attitude of FRD": (
        rows_of("quaternion", lambda q: np.stack([-q[:, 1], q[:, 0], q[:, 3], -q[:, 2]], axis=1)),
        "quaternion",
        "looks like that of forward, right, down",
    ),
    "attitude in NED": (
        rows_of("quaternion", lambda q: np.stack([q[:, 1], -q[:, 0], q[:, 3], -q[:, 2]], axis=1)),
        "quaternion",
        "looks like that in north, east, down",
    ),
    "velocity in NED": (rows_of("velocity", times(1, -1, -1)), "velocity", "signs of y and z look turned"),
    "velocity in base axes": (in_base_axes, "velocity", "is in axes of the base"),
    "velocity in mm/s": (rows_of("velocity", times(1e3, 1e3, 1e3)), "velocity", "it looks like mm/s"),
    "velocity in cm/s": (rows_of("velocity", times(1e2, 1e2, 1e2)), "velocity", "it looks like cm/s"),
    "position in mm": (rows_of("position", times(1e3, 1e3, 1e3)), "position", "it looks like mm"),
    "position in cm": (rows_of("position", times(1e2, 1e2, 1e2)), "position", "it looks like cm"),
    "position, axes swapped": (rows_of("position", columns(1, 0, 2)), "position", "x and y look swapped"),
    "world of east, north, up read as NED": (
        then(*(rows_of(name, lambda rows: rows[:, [1, 0, 2]] * [1, 1, -1]) for name in ("position", "velocity"))),
        "position",
        "the axes look swapped or turned: y, x, -z stand",
    ),
    "motors of another autopilot": (
        rows_of("rotor_speed_commands", columns(3, 0, 2, 1)),
        "rotor commands",
        "the rotors look ordered 2, 4, 3, 1",
    ),
    "motors exchanged": (
        rows_of("rotor_speed_commands", columns(2, 1, 0, 3)),
        "rotor commands",
        "rotors 1 and 3 look exch",
    ),
    "motors reversed": (
        rows_of("rotor_speed_commands", columns(3, 2, 1, 0)),
        "rotor commands",
        "the order of the rotors looks reversed",
    ),
    "motors mirrored": (
        rows_of("rotor_speed_commands", columns(0, 3, 2, 1)),
        "rotor commands",
        "the rotors look mirrored, left for right",
    ),
    "commands of another range": (
        rows_of("rotor_speed_commands", lambda rows: rows + 0.06 * MAX),
        "rotor commands",
        "begin at 6 % of the full signal",
    ),
    "commands late": (
        times_of(["rotor_speed_commands"], lambda t: t + 0.05),
        "rotor commands",
        "off by .50 ms, . is late",
    ),
    "pose late": (times_of(POSE, lambda t: t + 0.2), "pose", "off by .200 ms, . is late"),
    "velocity early": (times_of(["velocity"], lambda t: t - 0.05), "velocity", "off by -50 ms, . is late"),
    "joints late": (
        times_of(["joint_positions", "joint_rates"], lambda t: t + 0.2),
        "joint_positions",
        "off by .200 ms, . is late",
    ),
    "all clocks": (times_of(tuple(SOUND), lambda t: 2.0 * t), "time", "runs 2 times as fast"),
    "joints swapped": (
        then(rows_of("joint_positions", columns(1, 0)), rows_of("joint_rates", columns(1, 0))),
        "joint_positions",
        f"{ARM[0]} and {ARM[1]} look swapped",
    ),
    "a joint turned": (
        then(rows_of("joint_positions", times(1, -1)), rows_of("joint_rates", times(1, -1))),
        "joint_positions",
        f"the sign of {ARM[1]} looks turned",
    ),
    "all joints turned": (
        then(rows_of("joint_positions", times(-1, -1)), rows_of("joint_rates", times(-1, -1))),
        "joint_positions",
        f"the sign of {ARM[0]} and {ARM[1]} looks turned",
    ),
    "a rate turned": (rows_of("joint_rates", times(-1, 1)), "joint_rates", f"the sign of {ARM[0]} looks turned"),
    "rates in deg/s": (rows_of("joint_rates", times(DEGREES, DEGREES)), "joint_rates", "it looks like deg/s"),
    "an effort turned": (rows_of("joint_efforts", times(1, -1)), "joint_efforts", f"the sign of {ARM[1]} looks turned"),
    "efforts in N mm": (rows_of("joint_efforts", times(1e3, 1e3)), "joint_efforts", "it looks like N mm"),
    "zero of an encoder": (
        rows_of("joint_positions", lambda rows: rows + np.array([0.0, 0.15])),
        "joint_positions",
        f"zero of {ARM[1]} is off by 0.15",
    ),
    "scale of the gyro": (rows_of("gyro", times(*(1.25,) * 3)), "gyro", "is 1.25 times what fits"),
    "scale of the accelerometer": (
        rows_of("accelerometer", times(*(0.8,) * 3)),
        "accelerometer",
        "is 0.8 times what fits",
    ),
}
"""Fault, and the change that undoes it: channel and words."""


def same(one, other):
    """True for flights of the same channels; an attitude and its opposite are the same."""
    if set(one) != set(other):
        return False
    return all(
        np.allclose(one[name].time, other[name].time, atol=1e-9)
        and (
            np.allclose(one[name].values, other[name].values, atol=1e-9)
            or (name == "quaternion" and np.allclose(one[name].values, -other[name].values, atol=1e-9))
        )
        for name in one
    )


@pytest.mark.parametrize("name", UNDONE)
def test_a_change_of_the_table_undoes_the_fault(name):
    spoil, channel, words = UNDONE[name]
    wrong = spoil(SOUND)
    assert not same(wrong, SOUND)
    undone = [
        f"{change.channel}: {change.words.format(amount)}"
        for change in channel_changes(wrong, VEHICLE)
        for amount in change.amounts
        if any(each in wrong for each in change.names) and same(change.of(wrong, amount), SOUND)
    ]
    assert any(re.match(f"{channel}: .*{words}", each) for each in undone), undone


def test_no_change_of_the_table_is_none():
    for change in channel_changes(SOUND, VEHICLE):
        for amount in change.amounts:
            if "even ones" not in change.words:
                assert not same(change.of(SOUND, amount), SOUND), f"{change.channel}: {change.words}"


def test_stamps_with_jitter_become_even():
    late = np.random.default_rng(0).uniform(0.0, 0.004, SOUND["position"].time.size)
    wrong = times_of(POSE, lambda time: time + late)(SOUND)
    (change,) = [each for each in channel_changes(wrong, VEHICLE) if "even ones" in each.words]
    for name in POSE:
        steps = np.diff(change.of(wrong, 1.0)[name].time)
        assert np.ptp(steps) < 1e-9
        assert steps.mean() == pytest.approx(0.01, abs=1e-5)


def test_axes_that_stand_at_an_angle_are_turned_back():
    turn = np.array([[COSINE, COSINE, 0.0], [-COSINE, COSINE, 0.0], [0.0, 0.0, 1.0]])
    half = np.cos(np.pi / 8), np.sin(np.pi / 8)

    def of_base(q):
        (w, x, y, z), (a, b) = q.T, half
        return np.stack([w * a - z * b, x * a + y * b, y * a - x * b, z * a + w * b], axis=1)

    axes = [rows_of(name, lambda rows: rows @ turn.T) for name in ("gyro", "accelerometer")]
    wrong = then(*axes, rows_of("quaternion", of_base))(SOUND)
    undone = [
        (change.channel, change.words.format(amount))
        for change in channel_changes(wrong, VEHICLE)
        for amount in change.amounts
        if same(change.of(wrong, amount), SOUND)
    ]
    assert undone == [("rotor commands", "turn the vehicle as if it stood 45 deg about z from its rotors' places")]


class Fits:
    """In place of fits: sizes of rows by how far a flight is from one that would be white.

    Args:
        sizes: flight -> size of the rows of each sensor.
        unusual: flight -> how far the numbers are from the start's.
        delay: s, of the commands.
    """

    def __init__(self, sizes, unusual=lambda flight: 0.0, delay=0.005):
        self.sizes, self.unusual, self.delay, self.count = sizes, unusual, delay, 0

    def __call__(self, start):
        return self

    def rows(self, flight, most, turns):
        self.count += 1
        found = self.sizes(flight)
        sensors = [
            name for name in flight if name in ("gyro", "accelerometer", *POSE, "joint_positions", "joint_rates")
        ]
        rows = {(name, axis): found.get(name, 1.0) for name in sensors for axis in range(flight[name].values.shape[1])}
        rows |= {(name, 0): found.get(name, 0.0) for name in PUSHES}
        return Left(rows, self.unusual(flight), self.delay)


def isolated(monkeypatch, sizes, flight=SOUND, **others):
    fits = Fits(sizes, **others)
    monkeypatch.setattr(isolate_fault, "Leavings", fits)
    monkeypatch.setattr(isolate_fault, "align_poses", lambda flight: (flight, None))
    return find_faults(flight, VEHICLE), fits


def differs(flight, name):
    """Whether a flight's channel is none or not that of the sound one."""
    rows, sound = (each[name].values if name in each else np.zeros(0) for each in (flight, SOUND))
    return rows.shape != sound.shape or not np.allclose(rows, sound, atol=1e-6)


@pytest.mark.parametrize(("size", "searched"), [(0.98 * ALARM, False), (1.02 * ALARM, True)])
def test_a_row_alarms_from_some_times_its_noise_on(monkeypatch, size, searched):
    found, fits = isolated(monkeypatch, lambda flight: {"gyro": size})
    assert found == ()
    assert (fits.count > 1) is searched


def test_what_no_change_mends_is_said_of_the_model(monkeypatch):
    (fault,), _ = isolated(monkeypatch, lambda flight: {"gyro": 14.2, "position": 1.02 * DOUBTFUL, "velocity": 1.2})
    assert (fault.severity, fault.channel) == (WARNED, "model")
    assert fault.finding == "does not explain gyro (14 times its noise), position (3.1 times its noise)"
    found, _ = isolated(monkeypatch, lambda flight: {"position": 0.98 * DOUBTFUL})
    assert found == ()


def test_the_change_that_makes_all_white_is_named_with_what_it_does(monkeypatch):
    wrong = rows_of("gyro", times(DEGREES, DEGREES, DEGREES))(SOUND)
    found, fits = isolated(monkeypatch, lambda flight: {"gyro": 47.0 if differs(flight, "gyro") else 1.1}, wrong)
    assert [each.words for each in found] == [
        "flight.csv: gyro: it looks like deg/s: the residual of gyro falls from 47 times its noise to 1.1; "
        "state its unit in columns.toml"
    ]
    assert found[0].severity == REFUSED
    everything = sum(len(each.amounts) for each in channel_changes(wrong, VEHICLE))
    assert fits.count < 0.5 * everything, "an attitude decides: what makes all white ends the search"


@pytest.mark.parametrize(("share", "named"), [(1.1, "gyro"), (0.9, "model")])
def test_a_change_that_leaves_something_is_named_only_if_it_gains_much(monkeypatch, share, named):
    wrong = rows_of("gyro", times(1, -1, 1))(SOUND)
    count = 20  # rows of the flight
    fall = np.exp(share * GAIN * count / 3.0)

    def sizes(flight):
        return {"gyro": 400.0 if differs(flight, "gyro") else 400.0 / fall, "position": 1.5}

    (fault,), _ = isolated(monkeypatch, sizes, wrong)
    assert fault.channel == named


def test_what_fits_as_well_is_told_beside(monkeypatch):
    """Without an attitude an order of the rotors may stand for axes of the gyro."""
    blind = dataclasses.replace(SOUND, channels={name: SOUND[name] for name in SOUND if name not in POSE})
    wrong = rows_of("gyro", columns(1, 0, 2))(blind)

    def sizes(margin):
        def of(flight):
            if not differs(flight, "gyro"):
                return {"gyro": 1.0}
            turned = np.allclose(
                flight["rotor_speed_commands"].values, SOUND["rotor_speed_commands"].values[:, [0, 3, 2, 1]]
            )
            return {"gyro": margin if turned else 50.0}

        return of

    near = float(np.exp(0.5 * CLEAR * 10 / 3.0))
    (fault,), _ = isolated(monkeypatch, sizes(near), wrong)
    assert fault.channel == "gyro"
    assert "x and y look swapped, or rotor commands: the rotors look mirrored, left for right" in fault.finding
    (fault,), _ = isolated(monkeypatch, sizes(6.0), wrong)
    assert ", or " not in fault.finding


def test_a_channel_is_left_out_only_if_nothing_mends_it(monkeypatch):
    wrong = rows_of("position", times(1, -1, -1))(SOUND)
    foreign = then(wrong and rows_of("position", times(1, -1, -1)), rows_of("quaternion", columns(2, 1, 0, 3)))(SOUND)

    def sizes(flight):
        bad = any(name in flight and differs(flight, name) for name in ("position", "quaternion"))
        return {"position": 20.0, "quaternion": 20.0} if bad else {}

    (fault,), _ = isolated(monkeypatch, sizes, wrong)
    assert fault.channel == "position"
    (fault,), _ = isolated(monkeypatch, sizes, foreign)
    assert (fault.severity, fault.channel) == (REFUSED, "pose")
    assert "does not belong to this flight: the residual of" in fault.finding
    assert "is 20 times its noise, and without it all others are at most 1" in fault.finding


def test_leaving_out_costs_more_than_a_change_that_leaves_little(monkeypatch):
    wrong = rows_of("velocity", times(1.25, 1.25, 1.25))(SOUND)
    left = float(np.exp(0.4 * LEFT_OUT * 20 / 3.0))

    def sizes(flight):
        if "velocity" not in flight:
            return {}
        return {"velocity": left if not differs(flight, "velocity") else 90.0}

    (fault,), _ = isolated(monkeypatch, sizes, wrong)
    assert "is 1.25 times what fits" in fault.finding


@pytest.mark.parametrize(("size", "channel"), [(1.5, []), (90.0, ["pose"])])
def test_a_channel_is_left_out_only_if_that_is_worth_its_price(monkeypatch, size, channel):
    foreign = rows_of("quaternion", columns(2, 1, 0, 3))(SOUND)

    def sizes(flight):
        if "quaternion" not in flight:
            return {}
        return {"quaternion": size if same(flight, foreign) else 200.0}

    found, _ = isolated(monkeypatch, sizes, foreign)
    assert [each.channel for each in found] == channel


def test_an_amount_between_those_of_the_table_is_found(monkeypatch):
    wrong = rows_of("gyro", times(*(1.15,) * 3))(SOUND)

    def sizes(flight):
        if flight["gyro"].time.size != SOUND["gyro"].time.size:
            return {"gyro": 90.0}
        off = np.abs(flight["gyro"].values - SOUND["gyro"].values).max() / np.abs(SOUND["gyro"].values).max()
        return {"gyro": 1.0 + 300.0 * off}

    (fault,), _ = isolated(monkeypatch, sizes, wrong)
    scale = float(re.search(r"is ([\d.]+) times what fits", fault.finding)[1])
    assert scale == pytest.approx(1.15, abs=0.02)


def test_channels_that_a_check_names_alarm_no_more(monkeypatch):
    frozen = SOUND["position"].values.copy()
    frozen[400:500] = frozen[400]
    wrong = rows_of("position", lambda rows: frozen)(SOUND)
    found, fits = isolated(monkeypatch, lambda flight: {"position": 30.0}, wrong)
    assert [each.channel for each in found] == ["position"]
    assert "is frozen" in found[0].finding
    assert fits.count <= 2


def test_a_force_that_nothing_explains_alarms(monkeypatch):
    (fault,), _ = isolated(monkeypatch, lambda flight: {"unexplained force": 5.0})
    assert fault.finding == "does not explain unexplained force (5 times its noise)"


def test_a_refused_log_is_not_flown(monkeypatch):
    wrong = rows_of("accelerometer", times(*(0.1,) * 3))(SOUND)
    found, fits = isolated(monkeypatch, lambda flight: {"gyro": 9.0}, wrong)
    assert [each.channel for each in found] == ["accelerometer"]
    assert fits.count == 0


@pytest.mark.parametrize(("share", "named"), [(0.98, []), (1.02, ["accelerometer"])])
def test_what_only_an_odd_vehicle_explains_is_searched(monkeypatch, share, named):
    """A search that is long enough explains a wrong scale by masses and lengths that no vehicle has."""
    wrong = rows_of("accelerometer", times(0.8, 0.8, 0.8))(SOUND)

    def unusual(flight):
        mean, true = (np.linalg.norm(each["accelerometer"].values, axis=1).mean() for each in (flight, SOUND))
        off = mean / true - 1.0
        return share * ODD * abs(off) / 0.2

    found, _ = isolated(monkeypatch, lambda flight: {}, wrong, unusual=unusual)
    assert [each.channel for each in found] == named
    if named:
        assert re.match(r"is 0\.[78]\d* times what fits: the start vehicle is 14 standard dev", found[0].finding)


def test_of_two_changes_the_one_that_leaves_the_vehicle_as_it_was_is_named(monkeypatch):
    """Without an attitude a unit of the gyro and a clock explain the same, with other moments of inertia."""
    blind = dataclasses.replace(SOUND, channels={name: SOUND[name] for name in SOUND if name not in POSE})
    wrong = rows_of("gyro", columns(1, 0, 2))(blind)

    def mirrored(flight):
        return np.allclose(flight["rotor_speed_commands"].values, SOUND["rotor_speed_commands"].values[:, [0, 3, 2, 1]])

    def sizes(flight):
        return {"gyro": 1.0 if mirrored(flight) or not differs(flight, "gyro") else 50.0}

    (fault,), _ = isolated(monkeypatch, sizes, wrong, unusual=lambda flight: 60.0 * mirrored(flight))
    assert fault.finding.startswith("x and y look swapped: the")
    (fault,), _ = isolated(monkeypatch, sizes, wrong, unusual=lambda flight: 60.0 * (not mirrored(flight)))
    assert fault.finding.startswith("the rotors look mirrored, left for right: the")


@pytest.mark.parametrize(("late", "words"), [(0.059, ""), (0.085, "off by -80 ms"), (-0.07, r"off by \+75 ms")])
def test_commands_that_act_too_late_or_too_early_are_on_another_clock(monkeypatch, late, words):
    found, _ = isolated(monkeypatch, lambda flight: {}, delay=late)
    assert [each.channel for each in found] == ["rotor commands"] * bool(words)
    assert all(re.match(f"stamps are {words}, . is late: they act", each.finding) for each in found)


def test_a_gyro_beyond_what_any_reads_is_of_the_unit_that_fits_best(monkeypatch):
    """A real flight leaves so much whatever is changed that the gain of the right unit may be small."""
    wrong = rows_of("gyro", times(DEGREES, DEGREES, DEGREES))(SOUND)
    found, _ = isolated(monkeypatch, lambda flight: {"gyro": 20.0, "position": 20.0 + differs(flight, "gyro")}, wrong)
    assert [each.channel for each in found] == ["gyro"]
    assert found[0].finding.startswith("it looks like deg/s")
    slow = rows_of("gyro", times(2.0, 2.0, 2.0))(SOUND)
    found, _ = isolated(monkeypatch, lambda flight: {"gyro": 20.0, "position": 20.0 + differs(flight, "gyro")}, slow)
    assert [each.channel for each in found] == ["model"]


def test_a_flight_that_cannot_be_flown_is_searched(monkeypatch):
    wrong = rows_of("joint_rates", times(DEGREES, DEGREES))(SOUND)

    def sizes(flight):
        return dict.fromkeys(flight, np.inf) if differs(flight, "joint_rates") else {}

    (fault,), _ = isolated(monkeypatch, sizes, wrong)
    assert fault.channel == "joint_rates"
    assert fault.finding == "it looks like deg/s: the motion under the commands is no number without this change"
    found, _ = isolated(monkeypatch, lambda flight: dict.fromkeys(flight, np.inf))
    assert found == (), "the search says that the start vehicle does not fly"
