"""Numbers that a flight shows and hardly any vehicle has, and known numbers that none
has.
"""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pytest
from planted_vehicles import NOMINAL

from skyarm.algebra import Sym3, Vec3
from skyarm.flight_data.flight_data import Channel, FlightData
from skyarm.identify.identified_numbers import NOT_SHOWN, Identified, IdentifiedNumber
from skyarm.identify.identified_parts import IdentifiedSurroundings
from skyarm.identify.log_checks import REFUSED, WARNED, require_no_refusal
from skyarm.identify.possible_numbers import doubtful_numbers, require_possible_numbers

START = NOMINAL
FULL = "rotors.thrust_at_100_percent"


def identified(name, value, start, *, explained=0.9, reason="", seconds=10.0, wide=0.1):
    number = IdentifiedNumber(
        name=name,
        unit="",
        value=value,
        low=value - wide * abs(value),
        high=value + wide * abs(value),
        start=start,
        data_share=0.9,
        reason=reason,
    )
    return Identified(
        numbers=(number,),
        correlation=np.eye(1),
        vehicle=START,
        surroundings=IdentifiedSurroundings(),
        explained={"specific_force.z": 0.9, "rate.x": explained, "rate.y": explained},
        deviation={},
        settled=True,
        seconds=seconds,
    )


@pytest.mark.parametrize(
    ("found", "words"),
    [
        (
            identified("base.inertia.xx", 0.3, 0.007),
            "base.inertia.xx: is 0.3 , 42.9 times the start vehicle's",
        ),
        (
            identified("rotors.thrust_coefficient", 1e-8, 8.5e-6),
            "rotors.thrust_coefficient: is 1e-08",
        ),
        (identified("delay", 0.09, 0.005), "delay: is 0.09 s, longer than any loop's"),
        (
            identified("delay", 0.01, 0.005, explained=0.001),
            "rotor commands: explain 0.1 % of the rotation",
        ),
    ],
)
def test_numbers_that_no_vehicle_has_are_refused(found, words):
    with pytest.raises(
        ValueError, match=f"^flight.csv: {re.escape(words)}[^\n]*; check [^\n]+$"
    ):
        require_no_refusal(doubtful_numbers(found, START, "flight.csv"))


def test_numbers_far_from_the_start_are_doubted_and_what_does_not_show_is_not():
    (doubt,) = doubtful_numbers(
        identified("rotors.time_constant_up", 0.06, 0.0125), START, "flight.csv"
    )
    assert doubt.severity == WARNED
    assert "4.8 times the start vehicle's" in doubt.words
    assert (
        doubtful_numbers(
            identified("base.inertia.xx", 0.012, 0.007), START, "flight.csv"
        )
        == ()
    )
    assert (
        doubtful_numbers(
            identified("base.inertia.xx", 0.3, 0.007, reason=NOT_SHOWN),
            START,
            "flight.csv",
        )
        == ()
    )


@pytest.mark.parametrize(
    ("found", "words"),
    [
        (
            identified("delay", -0.006, 0.005),
            "delay: is -6 ms: motion before its command",
        ),
        (
            identified("drives.elbow.latency", -0.004, 0.005),
            "drives.elbow.latency: is -4 ms: motion before",
        ),
        (
            identified("base.com.z", 0.1, 0.0),
            "base.com.z: is 100 mm, 0.59 of the rotors' distance off",
        ),
    ],
)
def test_numbers_that_hardly_any_vehicle_has_are_doubted(found, words):
    (doubt,) = doubtful_numbers(found, START, "flight.csv")
    assert doubt.severity == WARNED
    assert words in doubt.words


def several(**values):
    """Identified numbers by name, each with its start."""
    every = [
        identified(name.replace("__", "."), *pair).numbers[0]
        for name, pair in values.items()
    ]
    return dataclasses.replace(
        identified("delay", 0.005, 0.005),
        numbers=tuple(every),
        correlation=np.eye(len(every)),
    )


@pytest.mark.parametrize(
    ("factors", "doubted"),
    [
        ((1.7, 1.5, 1.6, 1.4), True),
        ((1.5, 1.4, 1.4, 1.3), False),
        ((2.4, 2.0, 2.0, 0.9), False),
        ((0.6,) * 4, True),
        ((0.82, 0.8, 0.81, 0.3), False),
    ],
)
def test_a_mass_is_doubted_if_thrust_and_inertia_are_off_alike(factors, doubted):
    names = (
        "rotors__thrust_coefficient",
        *(f"base__inertia__{axis}" for axis in ("xx", "yy", "zz")),
    )
    found = several(
        **{name: (factor, 1.0) for name, factor in zip(names, factors, strict=True)}
    )
    told = doubtful_numbers(found, START, "flight.csv")
    assert [each.channel for each in told] == (["mass"] if doubted else [])
    assert all(
        f"are {np.sqrt(np.prod(sorted(factors)[1:3])):.3g} times the start"
        in each.words
        for each in told
    )


@pytest.mark.parametrize(
    ("turn", "doubted"), [(0.35, True), (-0.35, True), (0.15, False)]
)
def test_a_zero_is_doubted_if_a_link_s_centre_of_mass_is_turned_about_its_joint(
    turn, doubted
):
    link = START.links[1]
    was = np.array([*link.body.com], dtype=float)
    # about y, of a link that hangs along z
    at = np.array([was[2] * np.sin(turn), 0.0, was[2] * np.cos(turn)])
    assert tuple(link.joint.axis) == (0, 1, 0)
    numbers = {
        f"links__{link.name}__com__{axis}": (at[i], was[i])
        for i, axis in enumerate("xyz")
    }
    found = several(**numbers)
    narrow = [
        dataclasses.replace(each, low=each.value - 1e-4, high=each.value + 1e-4)
        for each in found.numbers
    ]
    told = doubtful_numbers(
        dataclasses.replace(found, numbers=tuple(narrow)), START, "flight.csv"
    )
    assert [each.channel for each in told] == (["joint_positions"] if doubted else [])
    if doubted:
        assert f"zero of {link.joint.name} looks 0.35 rad off" in told[0].finding


def test_a_small_offset_of_the_centre_of_mass_and_a_late_accelerometer_are_plausible():
    assert (
        doubtful_numbers(identified("base.com.z", 0.02, 0.0), START, "flight.csv") == ()
    )
    assert (
        doubtful_numbers(
            identified("accelerometer_delay", -0.004, 0.0), START, "flight.csv"
        )
        == ()
    )


def faults(*found, flights=()):
    return [
        (each.severity, each.channel)
        for one in found
        for each in doubtful_numbers(one, START, "flight.csv", flights)
    ]


@pytest.mark.parametrize(
    ("name", "times", "severity"),
    [
        ("base.inertia.xx", 3.9, None),
        ("base.inertia.xx", 4.1, WARNED),
        ("base.inertia.xx", 7.9, WARNED),
        ("base.inertia.xx", 8.1, REFUSED),
        ("base.inertia.xx", 1.0 / 3.9, None),
        ("base.inertia.xx", 1.0 / 7.9, WARNED),
        ("base.inertia.xx", 1.0 / 8.1, REFUSED),
        ("base.inertia.xx", -1.0, REFUSED),
        ("rotors.moment_coefficient", 8.1, WARNED),
        ("rotors.time_constant_down", 4.1, WARNED),
        ("rotors.drag_coefficient", 9.0, None),
    ],
)
def test_numbers_are_doubted_and_refused_from_some_times_the_start_s_on(
    name, times, severity
):
    assert faults(identified(name, 0.01 * times, 0.01)) == (
        [] if severity is None else [(severity, name)]
    )
    assert faults(identified(name, 0.01 * times, 0.0)) == [], (
        "a start of none tells nothing"
    )


@pytest.mark.parametrize(
    ("name", "value", "told"),
    [
        ("delay", 0.0598, []),
        ("delay", 0.0602, [(REFUSED, "delay")]),
        ("delay", -0.0602, [(WARNED, "delay"), (REFUSED, "delay")]),
        ("accelerometer_delay", -0.0598, []),
        ("accelerometer_delay", -0.0602, [(REFUSED, "accelerometer_delay")]),
        ("drives.elbow.latency", 0.2, []),
    ],
)
def test_a_dead_time_is_refused_beyond_that_of_any_loop(name, value, told):
    assert faults(identified(name, value, 0.005)) == told


def test_a_dead_time_whose_interval_reaches_nought_is_not_doubted():
    assert faults(identified("delay", -0.001, 0.005, wide=1.5)) == []
    assert faults(identified("delay", -0.001, 0.005, wide=0.5)) == [(WARNED, "delay")]


@pytest.mark.parametrize(
    ("share", "told"), [(0.021, []), (0.019, [(REFUSED, "rotor commands")])]
)
def test_commands_that_explain_no_axis_of_the_rotation_are_refused(share, told):
    found = identified("delay", 0.005, 0.005, explained=share)
    assert faults(found) == told
    assert (
        faults(dataclasses.replace(found, explained={**found.explained, "rate.z": 0.5}))
        == []
    )
    assert faults(dataclasses.replace(found, explained={"specific_force.z": 0.0})) == []


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(4.9, "fly for longer, or check their order"), (5.1, "check their order")],
)
def test_a_short_flight_may_be_too_short(seconds, words):
    (fault,) = doubtful_numbers(
        identified("delay", 0.005, 0.005, explained=0.0, seconds=seconds),
        START,
        "flight.csv",
    )
    assert fault.remedy.startswith(words)


@pytest.mark.parametrize(
    ("share", "told"), [(0.48, []), (0.52, [(WARNED, "base.com.x")])]
)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_centre_of_mass_off_by_half_of_the_rotors_distance_is_doubted(
    share, told, sign
):
    arm = max(
        np.hypot(np.hypot(each.position.x, each.position.y), each.position.z)
        for each in START.rotors
    )
    assert faults(identified("base.com.x", sign * share * float(arm), 0.0)) == told
    assert (
        faults(identified("base.com.x", sign * share * float(arm), 0.0, wide=1.1)) == []
    ), "the drawing's is within"
    # it is the way from the drawing's that counts
    moved = identified(
        "base.com.x", sign * (share + 1.0) * float(arm), sign * float(arm), wide=0.01
    )
    assert faults(moved) == told


def test_it_is_the_farthest_rotor_by_which_a_centre_of_mass_is_doubted():
    first, arm = (
        START.rotors[0],
        max(np.linalg.norm([*map(float, each.position)]) for each in START.rotors),
    )
    far = dataclasses.replace(first, position=Vec3(2.0 * arm, 0.0, 0.0))
    for rotors in ((far, *START.rotors[1:]), (*START.rotors[1:], far)):
        wide = dataclasses.replace(START, rotors=rotors)
        for share, doubts in ((0.96, 0), (1.04, 1)):
            assert (
                len(
                    doubtful_numbers(
                        identified("base.com.x", share * arm, 0.0), wide, "flight.csv"
                    )
                )
                == doubts
            )


@pytest.mark.parametrize(
    ("turn", "told"), [(0.19, []), (0.21, [(WARNED, "joint_positions")])]
)
@pytest.mark.parametrize("wide", [0.0, 0.1])
def test_a_zero_is_doubted_beyond_what_its_centre_of_mass_is_known_to(turn, told, wide):
    """The centre's interval across the joint counts in rad."""
    link = START.links[1]
    was = np.array([*link.body.com], dtype=float)
    far = turn + wide
    at = np.array([was[2] * np.sin(far), 0.0, was[2] * np.cos(far)])
    off = wide * abs(was[2])
    numbers = [
        dataclasses.replace(
            identified(f"links.{link.name}.com.{axis}", at[i], was[i]).numbers[0],
            low=at[i] - off,
            high=at[i] + off,
        )
        for i, axis in enumerate("xyz")
    ]
    found = dataclasses.replace(
        identified("delay", 0.005, 0.005), numbers=tuple(numbers), correlation=np.eye(3)
    )
    assert faults(found) == told
    assert (
        faults(
            dataclasses.replace(
                found, numbers=tuple(numbers[:2]), correlation=np.eye(2)
            )
        )
        == []
    )


@pytest.mark.parametrize(
    ("turn", "told"), [(0.29, []), (0.31, [(WARNED, "joint_positions")])]
)
@pytest.mark.parametrize("aside", [-0.2, 0.0, 0.2])
def test_a_centre_of_mass_beside_its_joint_s_plane_looks_turned_by_the_same_angle(
    turn, aside, told
):
    """What lies along the joint does not turn; the widest interval counts, here of 0.1
    rad along x.
    """
    link, far = START.links[1], 0.1
    at = far * np.array([np.sin(turn), aside / far, np.cos(turn)])
    numbers = [
        dataclasses.replace(
            identified(
                f"links.{link.name}.com.{axis}", at[i], [0.0, aside, far][i]
            ).numbers[0],
            low=at[i] - off,
            high=at[i] + off,
        )
        for i, (axis, off) in enumerate(
            zip("xyz", (0.1 * far, 1e-4, 1e-3), strict=True)
        )
    ]
    found = dataclasses.replace(
        identified("delay", 0.005, 0.005), numbers=tuple(numbers), correlation=np.eye(3)
    )
    assert faults(found) == told
    # a centre that the drawing has on the joint's axis tells no angle
    bare = [
        dataclasses.replace(each, start=[0.0, aside, 0.0][i])
        for i, each in enumerate(numbers)
    ]
    assert faults(dataclasses.replace(found, numbers=tuple(bare))) == []


@pytest.mark.parametrize(("share", "told"), [(0.94, [(WARNED, FULL)]), (0.96, [])])
def test_a_thrust_beyond_all_commands_is_extrapolated(share, told):
    most = float(START.rotors[0].max_speed)

    def flown(share):
        speeds = Channel(
            time=np.arange(50.0), values=np.full((50, 4), share * most), source="made"
        )
        return FlightData(
            name="flight", file="flight.csv", channels={"rotor_speed_commands": speeds}
        )

    found = identified(FULL, 9.0, 8.0)
    assert faults(found, flights=[flown(0.3), flown(share)]) == told
    assert faults(found) == [], "no flight tells what was commanded"
    assert (
        faults(identified(FULL, 9.0, 8.0, reason=NOT_SHOWN), flights=[flown(share)])
        == []
    )
    # the curve is that of the first rotor, whatever the others reach
    others = tuple(
        dataclasses.replace(each, max_speed=2.0 * most) for each in START.rotors[1:]
    )
    mixed = dataclasses.replace(START, rotors=(START.rotors[0], *others))
    assert len(doubtful_numbers(found, mixed, "flight.csv", [flown(share)])) == len(
        told
    )
    words = [
        each.finding
        for each in doubtful_numbers(found, START, "flight.csv", [flown(0.8)])
    ]
    assert words == ["is extrapolated: commands reach 80 % of the full speed"]


def size_of(vehicle):
    """Largest of a vehicle's lengths: rotors, radius of gyration, centre of mass."""
    places = [vehicle.base.com, *(each.position for each in vehicle.rotors)]
    moments = [
        vehicle.base.inertia.xx,
        vehicle.base.inertia.yy,
        vehicle.base.inertia.zz,
    ]
    gyration = np.sqrt(max(map(float, moments)) / float(vehicle.mass))
    return max(
        gyration, *(float(np.linalg.norm([each.x, each.y, each.z])) for each in places)
    )


WIDE = dataclasses.replace(
    START, base=dataclasses.replace(START.base, com=Vec3(0.0, 0.0, -2.0))
)
HEAVY = dataclasses.replace(
    START,
    base=dataclasses.replace(
        START.base, inertia=Sym3(xx=9.0, yy=9.0, zz=16.0, xy=0.0, xz=0.0, yz=0.0)
    ),
)


@pytest.mark.parametrize("start", [START, WIDE, HEAVY])
@pytest.mark.parametrize(
    ("name", "most"),
    [
        (
            "base.inertia.zz",
            lambda vehicle: 4.0 * float(vehicle.mass) * size_of(vehicle) ** 2,
        ),
        ("base.com.z", lambda vehicle: 4.0 * size_of(vehicle)),
        ("place.x", lambda vehicle: 4.0 * size_of(vehicle)),
        ("rotors.drag_height", lambda vehicle: 4.0 * size_of(vehicle)),
        ("delay", lambda vehicle: 1.0),
        ("joint_delay", lambda vehicle: 1.0),
        ("accelerometer_delay", lambda vehicle: 1.0),
        ("rotors.time_constant_up", lambda vehicle: 1.0),
        ("rotors.time_constant_down", lambda vehicle: 1.0),
        ("drives.elbow.latency", lambda vehicle: 1.0),
        (f"links.{START.links[0].name}.mass", lambda vehicle: float(vehicle.mass)),
    ],
)
def test_known_numbers_are_bounded_by_mass_and_size(start, name, most):
    for sign in (1.0, -1.0):
        require_possible_numbers(start, {name: sign * 0.99 * most(start)}, "known.")
        with pytest.raises(
            ValueError,
            match=(
                rf"^known.{re.escape(name)} = [^\n]+: must be at most"
                rf" {most(start):.3g} "
            ),
        ):
            require_possible_numbers(start, {name: sign * 1.01 * most(start)}, "known.")


def test_known_numbers_of_other_kinds_have_no_bound():
    require_possible_numbers(
        START,
        {"rotors.thrust_coefficient": 1e9, f"links.{START.links[0].name}.inertia": 9e9},
        "",
    )


def test_slow_rotors_may_be_slower_than_a_brief_flight():
    rotors = [dataclasses.replace(each, time_constant_up=3.0) for each in START.rotors]
    start = dataclasses.replace(START, rotors=tuple(rotors))
    require_possible_numbers(start, {"rotors.time_constant_up": 2.9}, "")
    with pytest.raises(
        ValueError, match="must be at most 3 s in size, the shortest flight that counts"
    ):
        require_possible_numbers(start, {"rotors.time_constant_up": 3.1}, "")
