"""Each kind of fault in logging is undone by a change of the table: the channels are
the sound ones again.
"""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pytest
from changed_channels import (
    ARM,
    DEGREES,
    POSE,
    SOUND,
    VEHICLE,
    columns,
    rows_of,
    same,
    then,
    times,
    times_of,
)
from planted_flights import inverse, rotate

import skyarm
from skyarm.identify.channel_changes import ChannelChange, channel_changes
from skyarm.identify.log_checks import REFUSED, WARNED


def half_a_turn_of_the_base(flight):
    """All sensors in axes forward, right, down."""
    for name in ("gyro", "accelerometer"):
        flight = rows_of(name, times(1, -1, -1))(flight)
    return rows_of(
        "quaternion", lambda q: np.stack([-q[:, 1], q[:, 0], q[:, 3], -q[:, 2]], axis=1)
    )(flight)


def in_base_axes(flight):
    return rows_of(
        "velocity", lambda rows: rotate(inverse(flight["quaternion"].values), rows)
    )(flight)


def about_z(rows):
    """Axes of a board that stands a quarter of a turn about z."""
    return rows @ np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]).T


COSINE = 0.5**0.5
MAX = float(VEHICLE.rotors[0].max_speed)

UNDONE = {
    "a sign of the gyro": (
        rows_of("gyro", times(1, 1, -1)),
        "gyro",
        "the sign of z looks turned",
    ),
    "axes of the gyro swapped": (
        rows_of("gyro", columns(1, 0, 2)),
        "gyro",
        "x and y look swapped",
    ),
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
    "gyro in deg/s": (
        rows_of("gyro", times(*(DEGREES,) * 3)),
        "gyro",
        "it looks like deg/s",
    ),
    "gyro in mrad/s": (
        rows_of("gyro", times(*(1e3,) * 3)),
        "gyro",
        "it looks like mrad/s",
    ),
    "gyro read as deg/s": (
        rows_of("gyro", times(*(1.0 / DEGREES,) * 3)),
        "gyro",
        "it looks like rad/s read as deg/s",
    ),
    "accelerometer turned": (
        rows_of("accelerometer", about_z),
        "accelerometer",
        "the axes look swapped or turned",
    ),
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
    "attitude w first": (
        rows_of("quaternion", columns(3, 0, 1, 2)),
        "quaternion",
        "looks like w, x, y, z read as x",
    ),
    "attitude of FRD in NED": (
        rows_of("quaternion", times(1, 1, -1, -1)),
        "quaternion",
        "right, down in north, east, down",
    ),
    "attitude of FRD": (
        rows_of(
            "quaternion",
            lambda q: np.stack([-q[:, 1], q[:, 0], q[:, 3], -q[:, 2]], axis=1),
        ),
        "quaternion",
        "looks like that of forward, right, down",
    ),
    "attitude in NED": (
        rows_of(
            "quaternion",
            lambda q: np.stack([q[:, 1], -q[:, 0], q[:, 3], -q[:, 2]], axis=1),
        ),
        "quaternion",
        "looks like that in north, east, down",
    ),
    "velocity in NED": (
        rows_of("velocity", times(1, -1, -1)),
        "velocity",
        "signs of y and z look turned",
    ),
    "velocity in base axes": (in_base_axes, "velocity", "is in axes of the base"),
    "velocity in mm/s": (
        rows_of("velocity", times(1e3, 1e3, 1e3)),
        "velocity",
        "it looks like mm/s",
    ),
    "velocity in cm/s": (
        rows_of("velocity", times(1e2, 1e2, 1e2)),
        "velocity",
        "it looks like cm/s",
    ),
    "position in mm": (
        rows_of("position", times(1e3, 1e3, 1e3)),
        "position",
        "it looks like mm",
    ),
    "position in cm": (
        rows_of("position", times(1e2, 1e2, 1e2)),
        "position",
        "it looks like cm",
    ),
    "position, axes swapped": (
        rows_of("position", columns(1, 0, 2)),
        "position",
        "x and y look swapped",
    ),
    "world of east, north, up read as NED": (
        then(
            *(
                rows_of(name, lambda rows: rows[:, [1, 0, 2]] * [1, 1, -1])
                for name in ("position", "velocity")
            )
        ),
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
    "pose late": (
        times_of(POSE, lambda t: t + 0.2),
        "pose",
        "off by .200 ms, . is late",
    ),
    "velocity early": (
        times_of(["velocity"], lambda t: t - 0.05),
        "velocity",
        "off by -50 ms, . is late",
    ),
    "joints late": (
        times_of(["joint_positions", "joint_rates"], lambda t: t + 0.2),
        "joint_positions",
        "off by .200 ms, . is late",
    ),
    "all clocks": (
        times_of(tuple(SOUND), lambda t: 2.0 * t),
        "time",
        "runs 2 times as fast",
    ),
    "joints swapped": (
        then(
            rows_of("joint_positions", columns(1, 0)),
            rows_of("joint_rates", columns(1, 0)),
        ),
        "joint_positions",
        f"{ARM[0]} and {ARM[1]} look swapped",
    ),
    "a joint turned": (
        then(
            rows_of("joint_positions", times(1, -1)),
            rows_of("joint_rates", times(1, -1)),
        ),
        "joint_positions",
        f"the sign of {ARM[1]} looks turned",
    ),
    "all joints turned": (
        then(
            rows_of("joint_positions", times(-1, -1)),
            rows_of("joint_rates", times(-1, -1)),
        ),
        "joint_positions",
        f"the sign of {ARM[0]} and {ARM[1]} looks turned",
    ),
    "a rate turned": (
        rows_of("joint_rates", times(-1, 1)),
        "joint_rates",
        f"the sign of {ARM[0]} looks turned",
    ),
    "rates in deg/s": (
        rows_of("joint_rates", times(DEGREES, DEGREES)),
        "joint_rates",
        "it looks like deg/s",
    ),
    "an effort turned": (
        rows_of("joint_efforts", times(1, -1)),
        "joint_efforts",
        f"the sign of {ARM[1]} looks turned",
    ),
    "efforts in N mm": (
        rows_of("joint_efforts", times(1e3, 1e3)),
        "joint_efforts",
        "it looks like N mm",
    ),
    "zero of an encoder": (
        rows_of("joint_positions", lambda rows: rows + np.array([0.0, 0.15])),
        "joint_positions",
        f"zero of {ARM[1]} is off by 0.15",
    ),
    "scale of the gyro": (
        rows_of("gyro", times(*(1.25,) * 3)),
        "gyro",
        "is 1.25 times what fits",
    ),
    "scale of the accelerometer": (
        rows_of("accelerometer", times(*(0.8,) * 3)),
        "accelerometer",
        "is 0.8 times what fits",
    ),
}
"""Fault, and the change that undoes it: channel and words."""


@pytest.mark.parametrize("name", UNDONE)
def test_a_change_of_the_table_undoes_the_fault(name):
    spoil, channel, words = UNDONE[name]
    wrong = spoil(SOUND)
    assert not same(wrong, SOUND)
    undone = [
        f"{change.channel}: {change.words.format(amount)}"
        for change in channel_changes(wrong, VEHICLE)
        for amount in change.amounts
        if any(each in wrong for each in change.names)
        and same(change.of(wrong, amount), SOUND)
    ]
    assert any(re.match(f"{channel}: .*{words}", each) for each in undone), undone


def test_no_change_of_the_table_is_none():
    for change in channel_changes(SOUND, VEHICLE):
        for amount in change.amounts:
            if "even ones" not in change.words:
                assert not same(change.of(SOUND, amount), SOUND), (
                    f"{change.channel}: {change.words}"
                )


def test_stamps_with_jitter_become_even():
    late = np.random.default_rng(0).uniform(0.0, 0.004, SOUND["position"].time.size)
    wrong = times_of(POSE, lambda time: time + late)(SOUND)
    (change,) = [
        each for each in channel_changes(wrong, VEHICLE) if "even ones" in each.words
    ]
    for name in POSE:
        steps = np.diff(change.of(wrong, 1.0)[name].time)
        assert np.ptp(steps) < 1e-9
        assert steps.mean() == pytest.approx(0.01, abs=1e-5)


def test_axes_that_stand_at_an_angle_are_turned_back():
    turn = np.array([[COSINE, COSINE, 0.0], [-COSINE, COSINE, 0.0], [0.0, 0.0, 1.0]])
    half = np.cos(np.pi / 8), np.sin(np.pi / 8)

    def of_base(q):
        (w, x, y, z), (a, b) = q.T, half
        return np.stack(
            [w * a - z * b, x * a + y * b, y * a - x * b, z * a + w * b], axis=1
        )

    axes = [
        rows_of(name, lambda rows: rows @ turn.T) for name in ("gyro", "accelerometer")
    ]
    wrong = then(*axes, rows_of("quaternion", of_base))(SOUND)
    undone = [
        (change.channel, change.words.format(amount))
        for change in channel_changes(wrong, VEHICLE)
        for amount in change.amounts
        if same(change.of(wrong, amount), SOUND)
    ]
    assert undone == [
        (
            "rotor commands",
            "turn the vehicle as if it stood 45 deg about z from its rotors' places",
        )
    ]


def undoing(wrong, sound, vehicle=VEHICLE):
    """Changes of the table that give a sound flight back, as words with their
    channels.
    """
    return [
        f"{change.channel}: {change.words.format(amount)}"
        for change in channel_changes(wrong, vehicle)
        for amount in change.amounts
        if same(change.of(wrong, amount), sound)
    ]


@pytest.mark.parametrize("axis", ["x", "-x", "y", "-y", "-z"])
@pytest.mark.parametrize("degrees", [0.0, 90.0, -90.0, 180.0])
def test_a_board_that_lies_on_its_side_is_set_upright(axis, degrees):
    """Whatever it is turned by about z, once the thrust is along z."""
    down = np.eye(3)["xyz".index(axis[-1])] * (-1.0 if axis[0] == "-" else 1.0)
    side = np.roll(down, 1)
    # rows: axes of the vehicle in those of the board
    lying = np.stack([side, np.cross(down, side), down])
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ lying
    wrong = then(
        *(rows_of(name, lambda rows: rows @ turn) for name in ("gyro", "accelerometer"))
    )(SOUND)
    (words,) = undoing(wrong, SOUND)
    assert words.startswith(
        "gyro: axes look like forward, right, down or others, and the accelerometer"
        " measures the"
    )
    assert f"along {axis} rather than z" in words


HEXAROTOR = skyarm.load_vehicle("hexarotor_arm6")


def of_six(flight):
    """Six rotors' commands and six joints."""
    draw = np.random.default_rng(0)
    names = ("rotor_speed_commands", "joint_positions", "joint_rates", "joint_efforts")
    return flight.with_channels(
        {
            name: dataclasses.replace(
                flight[name], values=draw.normal(size=(len(flight[name].time), 6))
            )
            for name in names
        }
    )


@pytest.mark.parametrize(
    ("order", "words"),
    [
        ((0, 4, 2, 3, 1, 5), "rotors 2 and 5 look exchanged"),
        ((5, 4, 3, 2, 1, 0), "the order of the rotors looks reversed"),
        ((5, 0, 1, 2, 3, 4), "the rotors look ordered 2, 3, 4, 5, 6, 1"),
        ((1, 0, 5, 4, 3, 2), "the rotors look ordered 2, 1, 6, 5, 4, 3"),
    ],
)
def test_orders_of_six_rotors_are_undone(order, words):
    sound = of_six(SOUND)
    assert undoing(
        rows_of("rotor_speed_commands", columns(*order))(sound), sound, HEXAROTOR
    ) == [f"rotor commands: {words}"]


def test_commands_without_a_full_speed_have_no_other_range():
    rotors = [dataclasses.replace(each, max_speed=np.inf) for each in VEHICLE.rotors]
    words = [
        [
            each.words
            for each in channel_changes(SOUND, vehicle)
            if "begin at" in each.words
        ]
        for vehicle in (
            VEHICLE,
            *(
                dataclasses.replace(VEHICLE, rotors=(*rotors[:k], *VEHICLE.rotors[k:]))
                for k in (1, 4)
            ),
        )
    ]
    assert [len(each) for each in words] == [1, 0, 0]


def test_shares_of_the_full_signal_begin_elsewhere():
    sound = SOUND.with_channels(
        {"rotor_commands": dataclasses.replace(SOUND["rotor_speed_commands"])}
    )
    sound = dataclasses.replace(
        sound,
        channels={
            k: v for k, v in sound.channels.items() if k != "rotor_speed_commands"
        },
    )
    wrong = rows_of("rotor_commands", lambda rows: rows - 0.15)(sound)
    assert undoing(wrong, sound) == [
        "rotor commands: begin at -15 % of the full signal: their range is another"
    ]


def test_a_change_leaves_all_other_channels_and_passes_over_those_that_are_not_there():
    def make(own, amount):
        assert list(own) == ["gyro"]
        return {"accelerometer": own["gyro"]} if amount == 2.0 else {}

    change = ChannelChange("gyro", "", "", ("gyro", "voltage"), make)
    changed, out = change.of(SOUND, 2.0), change.of(SOUND, 1.0)
    assert set(changed) == set(out) == set(SOUND) - {"gyro"}
    assert changed["accelerometer"] is SOUND["gyro"]
    assert all(
        changed[name] is SOUND[name] for name in changed if name != "accelerometer"
    )


def test_only_stamps_that_are_not_even_are_no_reason_to_refuse_a_flight():
    for change in channel_changes(SOUND, VEHICLE):
        assert change.severity == (WARNED if "even ones" in change.words else REFUSED)


@pytest.mark.parametrize(
    "name", ["octo_coaxial_two_arms", "hummingbird", "tilted_hexarotor"]
)
def test_every_order_of_rotors_is_a_permutation(name):
    """Of rotors one above the other too: mirrored left for right, each stays in its
    plane.
    """
    vehicle = skyarm.load_vehicle(name)
    count = len(vehicle.rotors)
    commands = np.arange(float(count)) * np.ones((800, 1))
    flight = SOUND.with_channels(
        {"rotor_speed_commands": dataclasses.replace(SOUND["gyro"], values=commands)}
    )
    changes = [
        each
        for each in channel_changes(flight, vehicle)
        if "ordered" in each.words or "mirrored" in each.words
    ]
    for each in changes:
        (order,) = {
            tuple(rows) for rows in each.of(flight, 1.0)["rotor_speed_commands"].values
        }
        assert sorted(order) == [*range(count)], each.words
    places = [vehicle.rotors[i].position for i in range(count)]
    for each in (each for each in changes if "mirrored" in each.words):
        order = each.of(flight, 1.0)["rotor_speed_commands"].values[0].astype(int)
        for place, other in zip(places, (places[i] for i in order), strict=True):
            assert (other.x, other.y, other.z) == pytest.approx(
                (place.x, -place.y, place.z), abs=1e-6
            )
