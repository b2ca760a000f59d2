"""What a law is told of the loop's clocks, the longest flight, and the scenario of a
log.
"""

from __future__ import annotations

from pathlib import Path

import pytest

import skyarm
from skyarm.records.identity import identity
from skyarm.records.plain import plain
from skyarm.scenario.controller_table import loop_facts
from skyarm.scenario.endings import JointLimits
from skyarm.scenario.scenario_differences import scenario_differences
from skyarm.scenario.scenario_record import Change, Delays, Rates, ScenarioError
from skyarm.scenario.unlikely_numbers import _size


def test_a_law_is_told_the_periods_and_the_age_of_its_measurements() -> None:
    told = loop_facts(
        Rates(physics=1000, control=250, reference=50),
        Delays(measurement=0.008, command=0.002),
    )
    assert told == pytest.approx(
        {
            "control_period": 0.004,
            "reference_period": 0.02,
            "delay": 0.008,
            "age": 0.008,
            "delay_periods": 2,
        }
    )


def test_a_flight_of_more_periods_than_a_log_can_hold_is_refused() -> None:
    assert skyarm.load_scenario("case1", duration=50_000.0).steps == 10_000_000
    with pytest.raises(
        ScenarioError,
        match=r"duration = 50001\.0: must be at most 50000 s at this control rate",
    ):
        skyarm.load_scenario("case1", duration=50_001.0)


def test_the_scenario_of_a_log_is_read_and_a_folder_of_its_name_is_one_line(
    tmp_path: Path,
) -> None:
    flown = skyarm.load_scenario("case1", duration=0.1)
    file = tmp_path / "flight.npz"
    skyarm.run(flown).save_npz(file)
    assert identity(skyarm.load_scenario(file)) == identity(flown)
    (tmp_path / "folder.npz").mkdir()
    with pytest.raises(ScenarioError, match=r"folder\.npz: "):
        skyarm.load_scenario(tmp_path / "folder.npz")


def test_a_joint_that_touches_its_hard_stop_ends_the_flight_unless_that_is_said() -> (
    None
):
    assert JointLimits() == JointLimits(stops=True) != JointLimits(stops=False)


def test_a_list_is_as_unlikely_as_its_largest_number() -> None:
    assert (_size((1.0, 7.0, 2.0)), _size(())) == (7.0, 0.0)


def test_a_change_beyond_the_longest_flight_is_refused_and_one_at_its_end_is_none() -> (
    None
):
    assert Change(at=1e7, path="plant.gravity", value=9.8).at == 1e7
    with pytest.raises(
        ScenarioError, match=r"^at = 10000001\.0: must be at most 1e\+07 s"
    ):
        Change(at=1e7 + 1.0, path="plant.gravity", value=9.8)


def test_another_kind_of_wind_differs_by_its_class_not_by_a_field_of_one() -> None:
    step, calm, blown = (
        plain(skyarm.load_scenario(name)) for name in ("case1", "case3", "case3_wind")
    )
    assert "environment.wind.type" in scenario_differences(calm, blown)
    found = scenario_differences(step, calm)
    assert any(path.startswith("reference.") for path in found)
    assert not any(path.endswith(".type") for path in found)
