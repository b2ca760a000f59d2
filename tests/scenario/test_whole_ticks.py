"""What must be a whole number of ticks, or equal to a clock's, is refused when off to
either side.
"""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

import skyarm
from skyarm.dynamics.array_front import unit_quaternion
from skyarm.plant.interface import whole_steps
from skyarm.scenario.controller_table import _require_clock
from skyarm.scenario.scenario_checks import (
    check_quaternion,
    clocks_of_law_agree,
    require_whole,
)
from skyarm.scenario.scenario_file import load_scenario
from skyarm.scenario.scenario_record import ScenarioError
from skyarm.simulate import Delays

SIDES = pytest.mark.parametrize("side", [-1.0, 1.0], ids=["less", "more"])
OFF = pytest.mark.parametrize("off", [1e-5, 0.2, 0.4])


@SIDES
@OFF
@pytest.mark.parametrize("count", [1, 3, 29])
def test_a_time_off_its_ticks_is_refused(count, off, side):
    """0.145 s at 200 Hz is 28.999999999999996 ticks: whole up to rounding."""
    require_whole("duration", count * 0.005, 200, "control periods")
    assert whole_steps(count * 0.005, 0.005) == count
    seconds = (count + side * off) * 0.005
    with pytest.raises(ValueError, match="whole number of control periods"):
        require_whole("duration", seconds, 200, "control periods")
    with pytest.raises(ValueError, match="whole number of physics steps"):
        whole_steps(seconds, 0.005)


def test_no_time_is_no_tick_and_less_than_half_a_tick_is_none():
    require_whole("delay", 0.0, 200, "control periods")
    for seconds in (0.0, 1e-12):
        with pytest.raises(ValueError, match="whole number of physics steps"):
            whole_steps(seconds, 0.005)
    with pytest.raises(ValueError, match="whole number of control periods"):
        require_whole("delay", 1e-12, 200, "control periods")


@pytest.mark.parametrize("steps", [0, 3, 12])
def test_a_command_delay_of_whole_physics_steps_is_stepped(steps):
    scenario = load_scenario("case1", duration=0.05)
    late = dataclasses.replace(
        scenario, kind="mujoco", delays=Delays(command=steps * 0.001)
    )
    skyarm.Session(late)


@SIDES
@OFF
def test_a_command_delay_off_the_physics_steps_is_refused_where_they_are_stepped(
    off, side
):
    scenario = load_scenario("case1", duration=0.05)
    # machine code takes any delay up to a longest one
    late = Delays(command=(3 + side * off) * 0.001, longest_command=0.02)
    with pytest.raises(
        ScenarioError, match=r"delays\.command = .*whole number of physics steps"
    ):
        skyarm.Session(dataclasses.replace(scenario, kind="mujoco", delays=late))


@SIDES
@OFF
@pytest.mark.parametrize("name", ["control_period", "reference_period"])
def test_a_law_that_believes_another_clock_is_refused(name, off, side):
    scenario = load_scenario("case1", duration=0.05)
    rate = {
        "control_period": scenario.rates.control,
        "reference_period": scenario.rates.reference,
    }[name]

    def believing(period):
        par = SimpleNamespace(**{name: period})
        return SimpleNamespace(
            agent=SimpleNamespace(controller=SimpleNamespace(par=par)),
            rates=scenario.rates,
        )

    clocks_of_law_agree(believing(1.0 / rate))
    with pytest.raises(ValueError, match=f"controller.{name} = "):
        clocks_of_law_agree(believing((1.0 + side * off) / rate))


@SIDES
@OFF
def test_a_table_that_names_another_control_period_is_refused(off, side):
    def fields(value):
        return SimpleNamespace(
            table={"control_period": value}, at=lambda name: f"controller.{name}"
        )

    _require_clock(fields(0.005), {"control_period": 0.005})
    with pytest.raises(
        ValueError, match=r"controller\.control_period = .*as rates\.control has it"
    ):
        _require_clock(fields(0.005 * (1.0 + side * off)), {"control_period": 0.005})


@SIDES
@OFF
def test_a_quaternion_too_short_or_too_long_is_refused(off, side):
    q = np.array([0.5, -0.5, 0.5, 0.5])
    check_quaternion(tuple(q.tolist()))
    unit_quaternion(q)
    with pytest.raises(ValueError, match="of length 1 within"):
        check_quaternion(tuple((q * (1.0 + side * off)).tolist()))
    with pytest.raises(ValueError, match="quaternion_wxyz: length"):
        unit_quaternion(q * (1.0 + side * off))
    # one bad row of many, and it is the one that is named
    rows = np.stack([q, q * (1.0 + side * off), q])
    with pytest.raises(ValueError, match=f"length {1.0 + side * off:.9g}"):
        unit_quaternion(rows)
