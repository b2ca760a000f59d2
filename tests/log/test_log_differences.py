"""Two logs compared: a difference that was put in is the one that is found, with its
time, name, unit and size.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

import skyarm
from skyarm.log.log_differences import Difference, log_differences
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.scenario_differences import ABSENT, scenario_differences

LOG = skyarm.run(skyarm.load_scenario("case3_wind", duration=0.2))


def put(name: str, row: int, index: int | None, value: float, log: Any = LOG) -> Any:
    array = getattr(log, name).copy()
    array[(row,) if index is None else (row, index)] += value
    return dataclasses.replace(log, **{name: array})


def test_a_log_equals_itself() -> None:
    found = log_differences(LOG, dataclasses.replace(LOG, position=LOG.position.copy()))
    assert found.equal
    assert (found.columns, found.unmatched, found.instants) == ((), (), (40, 40, 40))


@pytest.mark.parametrize(
    ("name", "index", "column", "unit"),
    [
        ("position", 1, "position_y", "m"),
        ("quaternion", 0, "quaternion_w", ""),
        ("joints", 1, "joint_2", "rad"),
        ("efforts", 0, "joint_effort_1", "N m"),
        ("rotor_speeds", 2, "rotor_speed_back", "rad/s"),
        ("tool", 2, "tip_z", "m"),
        ("yaw_held", None, "yaw_held", "rad"),
    ],
)
def test_one_number_is_found_with_its_name_unit_time_and_size(
    name: str, index: int | None, column: str, unit: str
) -> None:
    found = log_differences(LOG, put(name, 17, index, 0.25))
    (one,) = found.columns
    assert not found.equal
    assert (one.name, one.unit, one.time, one.at) == (column, unit, 17 / 200, 17 / 200)
    assert one.second - one.first == pytest.approx(0.25)
    assert one.largest == pytest.approx(0.25)


def test_the_earliest_is_first_and_the_largest_is_where_it_is() -> None:
    other = put(
        "position",
        30,
        0,
        5.0,
        put("position", 12, 0, -2.0, put("velocity", 3, 2, 1e-9)),
    )
    first, second = log_differences(LOG, other).columns
    assert (first.name, first.time) == ("velocity_z", 3 / 200)
    assert first.largest == pytest.approx(1e-9)
    assert (second.name, second.time, second.at) == ("position_x", 12 / 200, 30 / 200)
    assert (second.largest, second.second - second.first) == (
        pytest.approx(5.0),
        pytest.approx(-2.0),
    )


def test_what_is_within_the_tolerance_is_none() -> None:
    other = put("position", 12, 0, 1e-6)
    assert log_differences(LOG, other, 2e-6).equal
    assert [each.name for each in log_differences(LOG, other, 5e-7).columns] == [
        "position_x"
    ]


def test_a_difference_of_the_tolerance_is_within_it() -> None:
    other = put("position", 12, 0, 1e-6)
    size = abs(float(LOG.position[12, 0] - other.position[12, 0]))
    assert log_differences(LOG, other, size).equal
    assert not log_differences(LOG, other, float(np.nextafter(size, 0.0))).equal


def test_a_difference_is_followed_from_its_beginning_on() -> None:
    """One that is there only in the last quarter, always of one size, does not grow."""
    position = LOG.position.copy()
    position[30:, 1] += 1e-3
    (one,) = log_differences(LOG, dataclasses.replace(LOG, position=position)).columns
    assert one.time == 30 / 200


def test_what_is_infinite_in_both_is_no_difference() -> None:
    both = put("position", 20, 0, np.inf)
    (one,) = log_differences(both, put("position", 8, 0, 0.5, both)).columns
    assert (one.at, one.largest) == (8 / 200, pytest.approx(0.5))


def test_instants_are_matched_by_their_time() -> None:
    """A log of every second control period, from the fourth on, has the same numbers at
    its instants.
    """
    half = dataclasses.replace(
        LOG, **{name: array[4::2] for name, array in LOG.arrays().items()}
    )
    found = log_differences(LOG, half)
    assert (found.instants, found.columns) == ((18, 40, 18), ())


def test_numbers_that_are_not_finite_differ_from_finite_ones_only() -> None:
    broken = put("position", 8, 0, np.nan)
    assert log_differences(broken, broken).equal
    (one,) = log_differences(LOG, broken).columns
    assert (one.time, one.largest) == (8 / 200, np.inf)


def test_a_log_that_ends_earlier_is_compared_as_far_as_it_goes() -> None:
    arrays = {name: array[:25] for name, array in LOG.arrays().items()}
    short = dataclasses.replace(LOG, **arrays)
    found = log_differences(LOG, short)
    assert not found.equal
    assert (found.instants, found.columns) == ((25, 40, 25), ())


def test_flights_of_other_vehicles_say_what_only_one_has() -> None:
    bare = skyarm.load_vehicle("hummingbird")
    scenario = skyarm.load_scenario("case1", duration=0.2)
    other = dataclasses.replace(
        scenario,
        plant=dataclasses.replace(scenario.plant, vehicle=bare),
        controller=skyarm.make_controller("decoupled_pd", skyarm.Model(vehicle=bare)),
        reference=dataclasses.replace(scenario.reference, joints=()),
    )
    found = log_differences(skyarm.run(scenario), skyarm.run(other))
    assert "joint_1" in found.unmatched
    assert not found.equal
    assert isinstance(found.columns[0], Difference)


def test_scenarios_differ_by_the_sweeps_paths() -> None:
    scenario = skyarm.load_scenario("case3_wind", duration=0.2)
    other = with_numbers(
        scenario, {"plant.gravity": 9.7, "controller.gains.position.x": 9.0}
    )
    other = dataclasses.replace(
        other,
        seed=4,
        title="another",
        changes=(skyarm.Change(at=0.1, path="x", value=2),),
    )
    logs = [
        LOG.info["scenario_record"],
        skyarm.run(dataclasses.replace(other, changes=())).info["scenario_record"],
    ]
    found = scenario_differences(*logs)
    own = float(scenario.controller.par.gains.position.x)
    assert found == {
        "plant.gravity": (float(scenario.plant.gravity), 9.7),
        "controller.gains.position.x": (own, 9.0),
        "seed": (0, 4),
    }
    assert scenario_differences(logs[0], logs[0]) == {}
    assert scenario_differences(None, logs[0])["seed"] == (ABSENT, 0)


def test_changes_and_another_kind_of_wind_are_differences() -> None:
    from skyarm.records.plain import plain

    scenario = skyarm.load_scenario("case3_wind", duration=0.2)
    calm = dataclasses.replace(
        scenario,
        wind=skyarm.MovingAir(),
        changes=(skyarm.Change(at=0.1, path="plant.gravity", value=9.7),),
    )
    found = scenario_differences(plain(scenario), plain(calm))
    assert found["changes.0.path"] == (ABSENT, "plant.gravity")
    assert found["environment.wind.type"][1].endswith(":MovingAir")
