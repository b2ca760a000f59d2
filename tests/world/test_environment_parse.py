"""Winds and payloads from tables."""

import math
import tomllib

import pytest

from skyarm.algebra import E_X
from skyarm.records.leaves import leaves
from skyarm.world import NO_WIND, ForceWind, Gust, MovingAir, wind_from
from skyarm.world import wind as module
from skyarm.world.dryden import DrydenMemory
from support.worlds import wind


def examples():
    """The tables of the module's docstring, as TOML."""
    blocks = module.__doc__.split("[environment.wind]\n")[1:]
    lines = [[line.strip() for line in block.splitlines()] for block in blocks]
    return [tomllib.loads("\n".join(block[: block.index("")])) for block in lines]


def test_the_documented_examples_load():
    rotors, air, none = (wind_from(table, "x") for table in examples())
    assert isinstance(rotors, ForceWind)
    assert list(wind(rotors, 8.0).force_W) == [4.0, 0, 0]
    assert list(wind(rotors, 11.0).air_velocity_W) == [2.0, 0, 0]
    assert isinstance(air, MovingAir)
    assert wind(
        air, 6.0, DrydenMemory(0, 0, 0, 0, 0)
    ).air_velocity_W.y == pytest.approx(3.0)
    assert air.turbulence.airspeed == 5.0
    assert list(air.turbulence.scale_length)[2] == 6.0
    assert none is NO_WIND


def test_zeros_of_the_table_are_structure_and_other_numbers_data():
    par = wind_from({"mode": "force_wind", "force": [1, 0, 0.0]}, "x")
    assert leaves(par) == [1.0]


def test_turbulence_lies_along_the_mean_wind():
    table = {
        "mode": "moving_air",
        "velocity": [3, -4, 0],
        "turbulence": {"altitude": 10, "wind_20ft": 5},
    }
    par = wind_from(table, "x")
    assert list(par.turbulence.direction_W) == pytest.approx([0.6, -0.8, 0.0])
    calm = wind_from(
        {"mode": "moving_air", "turbulence": {"altitude": 10, "wind_20ft": 5}}, "x"
    )
    assert calm.turbulence.direction_W == E_X
    assert calm.turbulence.airspeed == 1.0


def test_the_gust_is_read_field_by_field():
    table = {
        "mode": "moving_air",
        "gust": {"velocity": [0, 3, 1], "start": 5, "duration": 2},
    }
    gust = wind_from(table, "x").gust
    assert gust == Gust(peak=gust.peak, start=5.0, duration=2.0, shape="step")
    assert list(gust.peak) == [0, 3.0, 1.0]


GUST = {"force": [2, 0, 0], "start": 7.5, "duration": 3}
AIR = {"altitude": 10, "wind_20ft": 5}


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({}, "f.toml: wind.mode: is missing"),
        (
            {"mode": "storm"},
            "f.toml: wind.mode = 'storm': must be one of none, force_wind, disturbance",
        ),
        (
            {"mode": "none", "force": [1, 0, 0]},
            "f.toml: wind.force = [1, 0, 0]: unknown field",
        ),
        (
            {"mode": "force_wind", "velocity": [1, 0, 0]},
            "f.toml: wind.velocity = [1, 0, 0]: unknown field",
        ),
        (
            {"mode": "force_wind", "force": 2},
            "f.toml: wind.force = 2: must be three numbers",
        ),
        (
            {"mode": "force_wind", "force": [1, 0]},
            "f.toml: wind.force = [1, 0]: must be three numbers",
        ),
        (
            {"mode": "force_wind", "force": [1, math.nan, 0]},
            "f.toml: wind.force[1] = nan: must be a finite number",
        ),
        (
            {"mode": "force_wind", "force": [1, True, 0]},
            "f.toml: wind.force[1] = True: must be a finite number",
        ),
        ({"mode": "force_wind", "gust": 3}, "f.toml: wind.gust = 3: must be a table"),
        (
            {"mode": "force_wind", "gust": GUST | {"duration": 0}},
            "f.toml: wind.gust.duration = 0: must be above 0",
        ),
        (
            {"mode": "force_wind", "gust": GUST | {"speed": 1}},
            "f.toml: wind.gust.speed = 1: unknown field",
        ),
        (
            {"mode": "force_wind", "gust": GUST | {"shape": "one_minus_cosine"}},
            "f.toml: wind.gust.shape = 'one_minus_cosine': must be step",
        ),
        (
            {"mode": "moving_air", "gust": GUST},
            "f.toml: wind.gust.velocity: is missing",
        ),
        (
            {"mode": "moving_air", "turbulence": AIR | {"altitude": 2}},
            "f.toml: wind.turbulence.altitude = 2: must be at least 3.048",
        ),
        (
            {"mode": "moving_air", "turbulence": AIR | {"altitude": 400}},
            "f.toml: wind.turbulence.altitude = 400.0: must be at most 304.8 m",
        ),
        (
            {"mode": "moving_air", "turbulence": AIR | {"wind_20ft": -1}},
            "f.toml: wind.turbulence.wind_20ft = -1: must be at least 0",
        ),
    ],
)
def test_a_wrong_wind_gets_one_line_with_field_value_and_what_is_allowed(
    table, message
):
    with pytest.raises(ValueError) as caught:  # noqa: PT011
        wind_from(table, "f.toml: wind")
    assert str(caught.value).startswith(message)
    assert "\n" not in str(caught.value)


def test_turbulence_passes_with_the_whole_speed_of_the_mean_wind():
    found = wind_from(
        {"mode": "moving_air", "velocity": [3.0, 0.0, 4.0], "turbulence": AIR}, "wind"
    )
    assert found.turbulence.airspeed == 5.0
