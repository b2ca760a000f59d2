"""Numbers that are known of a vehicle before it is identified, as the search has them;
and its file afterwards.
"""

from __future__ import annotations

import dataclasses
import json
import tomllib

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Sym3
from skyarm.dynamics.actuators.servo import PositionServo
from skyarm.identify.identified_file import (
    identified_file,
    is_around,
    read_surroundings,
)
from skyarm.identify.identified_numbers import NOT_SHOWN, Identified, IdentifiedNumber
from skyarm.identify.identified_parts import (
    IdentifiedSurroundings,
    numbers_around,
    of_a_body,
    surroundings_with,
    vehicle_with,
)
from skyarm.identify.identify_flights import known_of_search, weigh_vehicle
from skyarm.vehicle.vehicle_records import MountedDrive

QUAD, ARM = (
    skyarm.load_vehicle(name) for name in ("hummingbird", "hummingbird_arm2_rotors")
)


def moments(xx, yy, zz):
    return {
        f"base.inertia.{name}": value
        for name, value in (("xx", xx), ("yy", yy), ("zz", zz))
    }


def test_numbers_beside_the_moments_of_inertia_are_known_as_they_are():
    assert known_of_search(
        QUAD, {"delay": 0.004, "base.inertia.xy": 0.0}, "known."
    ) == (
        QUAD,
        {"delay": 0.004, "base.inertia.xy": 0.0},
    )


def test_known_moments_are_sums_of_second_moments_of_mass():
    start, found = known_of_search(
        QUAD, {**moments(0.009, 0.010, 0.013), "delay": 0.0}, "known."
    )
    assert start == QUAD
    x, y, z = (found.pop(f"base.second_moment.{axis}") for axis in "xyz")
    assert (y + z, x + z, x + y) == pytest.approx((0.009, 0.010, 0.013))
    assert found == {"delay": 0.0}


@pytest.mark.parametrize(
    ("name", "others"),
    [("xx", (0.01, 0.01)), ("yy", (0.01, 0.01)), ("zz", (0.01, 0.01))],
)
def test_a_flat_plate_has_a_moment_as_large_as_the_other_two_and_no_body_a_larger(
    name, others
):
    """In each of the three planes; the plate's second moment across it is as good as
    none, and not below.
    """
    flat = {**moments(0.01, 0.01, 0.01), f"base.inertia.{name}": sum(others)}
    _, found = known_of_search(QUAD, flat, "known.")
    assert found[f"base.second_moment.{name[0]}"] == pytest.approx(1e-6 * 0.04)
    with pytest.raises(
        ValueError,
        match=rf"^known\.base\.inertia\.{name} = 0\.0201: must be below .* two, 0\.02$",
    ):
        known_of_search(QUAD, {**flat, f"base.inertia.{name}": 0.0201}, "known.")


@pytest.mark.parametrize("name", ["xx", "yy", "zz"])
def test_a_moment_is_not_known_without_the_other_two_and_is_above_nought(name):
    some = moments(0.01, 0.01, 0.01)
    del some[f"base.inertia.{name}"]
    with pytest.raises(
        ValueError,
        match=(
            rf"^--known base\.inertia\.{name}: is missing: .* must be given together$"
        ),
    ):
        known_of_search(QUAD, some, "--known ")
    with pytest.raises(
        ValueError, match=rf"^known\.base\.inertia\.{name} = 0\.0: must be above 0"
    ):
        known_of_search(QUAD, {**some, f"base.inertia.{name}": 0.0}, "known.")


def test_a_weighed_vehicle_has_its_links_and_the_rest_in_the_base():
    links = sum(float(each.body.mass) for each in ARM.links)
    start, found = known_of_search(ARM, {"mass": 1.5}, "known.")
    assert found == {}
    assert float(start.mass) == pytest.approx(1.5)
    assert float(start.base.mass) == pytest.approx(1.5 - links)
    assert (start.links, start.base.inertia, start.base.com) == (
        ARM.links,
        ARM.base.inertia,
        ARM.base.com,
    )
    for mass, words in (
        (0.0, "mass = 0.0: must be above 0"),
        (0.08, "mass, less 0.09 kg of the links = -0.01"),
    ):
        with pytest.raises(ValueError, match=f"^{words}"):
            weigh_vehicle(ARM, mass, "mass")


def test_identified_numbers_are_those_of_the_first_rotor_and_others_in_proportion():
    """The second rotor is half as strong and a third slower; places and directions
    stay.
    """
    first, second, *rest = QUAD.rotors
    weak = dataclasses.replace(
        second,
        thrust_coefficient=0.5 * first.thrust_coefficient,
        time_constant_up=4 / 3 * first.time_constant_up,
    )
    start = dataclasses.replace(QUAD, rotors=(first, weak, *rest))
    numbers = {
        "rotors.thrust_coefficient": 1e-5,
        "rotors.time_constant_up": 0.03,
        "rotors.inertia": 2e-5,
    }
    for checked in (True, False):
        one, two, *_ = vehicle_with(start, numbers, checked=checked).rotors
        assert (one.thrust_coefficient, two.thrust_coefficient) == pytest.approx(
            (1e-5, 0.5e-5)
        )
        assert (one.time_constant_up, two.time_constant_up) == pytest.approx(
            (0.03, 0.04)
        )
        assert one.inertia == two.inertia == 2e-5
        assert (two.time_constant_down, two.direction) == (
            second.time_constant_down,
            second.direction,
        )
        assert tuple(two.position) == tuple(second.position)
    higher = vehicle_with(start, {"rotors.drag_height": 0.02}, checked=True)
    for one, other in zip(higher.rotors, start.rotors, strict=True):
        assert tuple(one.position) == pytest.approx(
            (*list(other.position)[:2], other.position.z + 0.02)
        )


def test_what_the_links_gain_the_base_loses_and_scaled_links_turn_as_heavily():
    numbers = {
        "links.link1.mass": 0.06,
        "links.link1.com.z": -0.1,
        "links.link2.inertia": 2.0,
        "links.link2.joint.damping": -0.1,
        "links.link2.joint.coulomb": 0.003,
        "base.com.x": 0.004,
    }
    found = vehicle_with(ARM, numbers, checked=True)
    assert float(found.mass) == pytest.approx(float(ARM.mass))
    assert float(found.base.mass) == pytest.approx(float(ARM.base.mass) - 0.02)
    one, two = found.links
    assert (one.body.mass, one.body.com.z, one.body.com.x) == (
        0.06,
        -0.1,
        ARM.links[0].body.com.x,
    )
    assert one.body.inertia == ARM.links[0].body.inertia
    assert two.body.inertia.entries == pytest.approx(
        [2.0 * each for each in ARM.links[1].body.inertia.entries]
    )
    # of a vehicle that flies, what is found below nought is nought
    assert (two.joint.damping, two.joint.coulomb, one.joint.damping) == (
        0.0,
        0.003,
        ARM.links[0].joint.damping,
    )
    assert vehicle_with(ARM, numbers).links[1].joint.damping == -0.1
    assert tuple(found.base.com) == (0.004, ARM.base.com.y, ARM.base.com.z)


def test_second_moments_and_products_are_the_base_s_inertia():
    numbers = {
        "base.second_moment.x": 0.003,
        "base.second_moment.z": 0.001,
        "base.inertia.xz": 2e-4,
    }
    inertia = vehicle_with(QUAD, numbers, checked=True).base.inertia
    y = 0.5 * float(QUAD.base.inertia.xx + QUAD.base.inertia.zz - QUAD.base.inertia.yy)
    assert inertia.entries == pytest.approx(
        (y + 0.001, 0.004, 0.003 + y, 0.0, 2e-4, 0.0)
    )


def test_a_search_passes_impossible_inertias_and_a_flying_vehicle_has_the_nearest():
    numbers = {
        "base.second_moment.x": -0.001,
        "base.second_moment.y": 0.003,
        "base.second_moment.z": 0.001,
    }
    assert vehicle_with(QUAD, numbers).base.inertia.entries[:3] == pytest.approx(
        (0.004, 0.0, 0.002)
    )
    nearest = vehicle_with(QUAD, numbers, checked=True).base.inertia
    assert nearest.entries[:3] == pytest.approx((0.004, 0.001, 0.003), abs=1e-5)


def test_areas_of_drag_are_not_below_nought_in_a_vehicle_that_flies():
    numbers = {"drag.area.x": -0.01, "drag.area.z": 0.02}
    assert tuple(vehicle_with(QUAD, numbers, checked=True).drag.area) == (
        0.0,
        QUAD.drag.area.y,
        0.02,
    )
    assert vehicle_with(QUAD, numbers).drag.area.x == -0.01


def test_numbers_of_a_servo_that_no_joint_has_change_nothing():
    servo = PositionServo(inertia=0.001, stiffness=2.0, damping=0.09)
    start = dataclasses.replace(ARM, drives=(MountedDrive(name="joint1", drive=servo),))
    numbers = {
        "drives.joint1.stiffness": 3.0,
        "drives.joint1.latency": -0.01,
        "drives.joint2.stiffness": 9.0,
    }
    (found,) = vehicle_with(start, numbers, checked=True).drives
    assert found.drive == dataclasses.replace(servo, stiffness=3.0, latency=0.0)
    (same,) = vehicle_with(start, {"drives.joint2.stiffness": 9.0}, checked=True).drives
    assert same.drive == servo


def test_the_nearest_inertia_of_a_body_keeps_the_axes_and_what_a_body_has():
    """Principal second moments 0.4, 0.3 and -0.1 along turned axes: the last becomes a
    thousandth of their sum.
    """
    axes, _ = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))

    def inertia(*sizes):
        second = axes @ np.diag(sizes) @ axes.T
        return np.trace(second) * np.eye(3) - second

    def entries(rows):
        return Sym3(
            *(
                float(rows[i, j])
                for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
            )
        )

    body = entries(inertia(0.4, 0.3, 0.0008))
    assert of_a_body(body) is body
    found = of_a_body(entries(inertia(0.4, 0.3, -0.1)))
    assert found.entries == pytest.approx(
        entries(inertia(0.4, 0.3, 0.6e-3)).entries, abs=1e-12
    )


def test_surroundings_and_their_numbers_are_the_same_but_for_the_thrust():
    about = IdentifiedSurroundings(
        delay=0.006,
        place=(0.01, -0.02, 0.03),
        torque=(0.1, 0.2, 0.3),
        setpoint_hold=1.0,
        thrust=1.1,
    )
    numbers = numbers_around(about)
    assert numbers["delay"] == 0.006
    assert [numbers[f"place.{axis}"] for axis in "xyz"] == [0.01, -0.02, 0.03]
    assert "thrust" not in numbers
    assert surroundings_with(numbers) == dataclasses.replace(about, thrust=1.0)
    assert surroundings_with({}) == IdentifiedSurroundings()
    assert surroundings_with({"thrust": 1.1, "place.y": 0.5}) == IdentifiedSurroundings(
        thrust=1.1, place=(0.0, 0.5, 0.0)
    )
    assert [
        is_around(name)
        for name in ("delay", "place.x", "base.com.x", "rotors.inertia", "gyro_bias.z")
    ] == [
        *(True, True),
        *(False, False),
        True,
    ]


def number(name, value=1.0, **changed):
    usual = {"unit": "m", "low": 0.9, "high": 1.1, "start": 2.0, "data_share": 0.9}
    return IdentifiedNumber(name=name, value=value, **{**usual, **changed})


def found_with(*numbers, vehicle=QUAD, **changed):
    usual = {"explained": {}, "deviation": {}, "settled": True, "seconds": 31.234}
    return Identified(
        numbers=numbers,
        correlation=np.eye(len(numbers)),
        vehicle=vehicle,
        **{**usual, "surroundings": IdentifiedSurroundings(delay=0.0061), **changed},
    )


def test_a_vehicle_file_names_flights_start_and_what_is_no_part_of_the_vehicle():
    found = found_with(
        number("delay", 0.0061, unit="s"),
        number("sag", reason=NOT_SHOWN),
        number("drift", unit=""),
    )
    lines = identified_file(found, QUAD, ["a.csv", "b.csv"], {}).splitlines()
    assert lines[:4] == [
        "# Identified by skyarm from 2 flights, 31.2 s:",
        "#   a.csv",
        "#   b.csv",
        (
            "# Start vehicle: hummingbird. Behind each number its 95 % interval; what"
            " the flights do not show is the"
        ),
    ]
    around = lines.index(
        "# Not part of a vehicle, but of its computer, sensors and battery:"
    )
    assert lines[around + 1 : around + 4] == [
        "#   delay = 0.0061 (0.9 to 1.1) s, start 2",
        "#   drift = 1 (0.9 to 1.1), start 2",
        "# In a scenario: [delays] command = 0.0061",
    ]
    early = found_with(
        number("delay"), surroundings=IdentifiedSurroundings(delay=-0.002)
    )
    text = identified_file(early, QUAD, ["a.csv"], {})
    assert text.startswith("# Identified by skyarm from 1 flight, ")
    assert "# In a scenario: [delays] command = 0\n" in text
    assert "Not part of a vehicle" not in identified_file(
        found_with(number("base.com.x")), QUAD, ["a.csv"], {}
    )


def test_numbers_of_a_vehicle_file_stand_at_their_fields_with_their_source():
    """What the flights show has them as its source, what they do not show keeps its
    own, and what was given is told.
    """
    heavier = dataclasses.replace(
        QUAD, base=dataclasses.replace(QUAD.base, mass=QUAD.base.mass + 0.01)
    )
    numbers = (
        number("base.com.x", 0.0012),
        number("base.com.z", reason=NOT_SHOWN),
        number("base.second_moment.y", unit="kg m^2"),
        number("rotors.thrust_coefficient", 9e-6, unit="N s^2/rad^2"),
        number("rotors.inertia", reason=NOT_SHOWN),
    )
    found = found_with(*numbers, vehicle=heavier)
    text = identified_file(
        found,
        QUAD,
        ["a.csv"],
        {"rotors.moment_coefficient": 0.0161234567, "base.com.y": 0.0},
    )
    table, lines = tomllib.loads(text), text.splitlines()
    com = lines.index("com = [0.0, 0.0, 0.0]")
    assert lines[com - 3 : com] == [
        "# x: 0.0012 (0.9 to 1.1) m, start 2",
        "# z: not in this data",
        "# given: base.com.y = 0",
    ]
    for line in (
        "mass = 0.726  # what the links leave of the total mass, which is given",
        "inertia = [0.007, 0.007, 0.012]  # y: 1 (0.9 to 1.1) kg m^2, start 2",
        "thrust_coefficient = 8.54858e-06  # 9e-06 (0.9 to 1.1) N s^2/rad^2, start 2",
        "moment_coefficient = 0.016  # given: rotors.moment_coefficient = 0.0161235",
        "inertia = 0.0  # not in this data",
    ):
        assert line in lines, line
    assert table["name"] == "hummingbird_identified"
    sources = table["sources"]
    told = {
        name
        for name, each in sources.items()
        if each == "identified from a.csv (31.2 s)"
    }
    assert told == {"base.com", "base.inertia", "rotor_defaults.thrust_coefficient"}
    assert {name: each for name, each in sources.items() if name not in told} == {
        name: each for name, each in QUAD.sources if name not in told
    }
    # a mass that was not given is not said to be, and a vehicle that is identified
    # again keeps its name
    same = dataclasses.replace(QUAD, name="hummingbird_identified")
    again = identified_file(found_with(number("delay")), same, ["a.csv", "b.csv"], {})
    assert "which is given" not in again
    assert tomllib.loads(again)["name"] == "hummingbird_identified"


def test_a_thrust_curve_has_points_beside_its_table_and_a_drag_height_at_its_places():
    rises = {f"rotors.rise_to_{k}_percent": 1.0 + 0.01 * k for k in (25, 50, 75, 100)}
    curved = vehicle_with(QUAD, rises, checked=True)
    assert curved.rotors[0].table.thrust == pytest.approx((1.25, 2.75, 4.5, 6.5))
    assert curved.rotors[0].table.speed == pytest.approx(
        [k * 8.38 for k in (25, 50, 75, 100)]
    )
    assert (
        curved.rotors[1].thrust_coefficient
        == curved.rotors[1].table.thrust_coefficient
        > 0.0
    )
    numbers = (
        number("rotors.thrust_at_50_percent", 2.75, unit="N"),
        number("rotors.drag_height", 0.02),
    )
    text = identified_file(found_with(*numbers, vehicle=curved), QUAD, ["a.csv"], {})
    assert "# thrust_at_50_percent: 2.75 (0.9 to 1.1) N, start 2" in text
    assert text.count("# z, of the hub drag: 0.02 (0.9 to 1.1) m, start 2") == 4
    sources = tomllib.loads(text)["sources"]
    assert (
        sources["rotor_defaults.thrust_table"]
        == sources["rotors.position"]
        == "identified from a.csv (31.2 s)"
    )


def written(folder, **changed):
    """File of all numbers of an identification."""
    document = {
        "start": "hummingbird",
        "surroundings": dataclasses.asdict(
            IdentifiedSurroundings(delay=0.006, place=(0.1, 0.2, 0.3))
        ),
        "known": {"voltage": 12.5},
        "numbers": [
            {"name": "thrust.b", "value": 1.2},
            {"name": "thrust.c", "value": None},
        ],
    }
    file = folder / "identified.json"
    file.write_text(json.dumps({**document, **changed}))
    return file


def test_surroundings_are_read_with_the_thrust_of_one_flight_and_the_voltage(tmp_path):
    file, about = (
        written(tmp_path),
        IdentifiedSurroundings(delay=0.006, place=(0.1, 0.2, 0.3)),
    )
    assert read_surroundings(file) == ("hummingbird_identified", about, 12.5)
    assert read_surroundings(file, "b")[1] == dataclasses.replace(about, thrust=1.2)
    assert read_surroundings(file, "c")[1] == read_surroundings(file, "d")[1] == about
    assert read_surroundings(written(tmp_path, known={}))[2] == 0.0
    older = read_surroundings(written(tmp_path, surroundings={"delay": 0.01}))[1]
    assert older == IdentifiedSurroundings(delay=0.01)


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"surroundings": None}, "must hold 'surroundings' and 'known'"),
        ({"known": []}, "must hold 'surroundings' and 'known'"),
        ({"numbers": [1]}, "must hold 'numbers', a list of tables"),
        ({"numbers": None}, "must hold 'numbers', a list of tables"),
        (
            {"surroundings": {"delay": "late"}},
            "surroundings.delay = 'late': must be a finite number",
        ),
        (
            {"surroundings": {"place": [1.0, 2.0]}},
            r"surroundings.place = \[1.0, 2.0\]: must be 3 numbers",
        ),
        (
            {"surroundings": {"place": [1.0, 2.0, "a"]}},
            "surroundings.place = 'a': must be a finite number",
        ),
        ({"known": {"voltage": -1.0}}, "known.voltage = -1.0: must be at least 0"),
        (
            {"numbers": [{"name": "thrust.b", "value": 0.0}]},
            "thrust.b = 0.0: must be above 0",
        ),
    ],
)
def test_a_file_of_numbers_that_does_not_fit_is_one_line(tmp_path, changed, words):
    with pytest.raises(ValueError, match=words) as error:
        read_surroundings(written(tmp_path, **changed), "b")
    assert "identified.json: " in str(error.value)
    assert "\n" not in str(error.value)
