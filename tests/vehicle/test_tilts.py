"""Tilting rotors in a vehicle file: the servo's axis and numbers, what refuses them,
and a record read back.
"""

from __future__ import annotations

import dataclasses
import math
import re
from importlib.resources import files

import numpy as np
import pytest

import skyarm
from skyarm.records.plain import plain
from skyarm.records.restore import restore
from skyarm.vehicle.tilt import Tilt

TEXT = (files("skyarm.vehicle") / "library" / "voliro_like.toml").read_text("utf-8")
VOLIRO = skyarm.load_vehicle("voliro_like")


def loaded(tmp_path, old, new):
    assert old in TEXT
    path = tmp_path / "v.toml"
    path.write_text(TEXT.replace(old, new, 1), "utf-8")
    return skyarm.load_vehicle(str(path))


def test_servos_turn_about_their_arms_unless_the_file_says_another_axis(tmp_path):
    for rotor in VOLIRO.rotors:
        arm = np.array([float(c) for c in rotor.position])
        axis = np.array([float(c) for c in rotor.tilt.axis])
        np.testing.assert_allclose(axis, arm / np.linalg.norm(arm), atol=1e-12)
        assert (rotor.tilt.time_constant, rotor.tilt.max_rate) == (0.05, 6.0)
    own = (
        "tilt = { axis = [0.0, 3.0, 0.0], lower = -0.2, upper = 0.5, time_constant ="
        " 0.1 }"
    )
    first = (
        loaded(tmp_path, 'name = "rotor0"', f'name = "rotor0"\n{own}').rotors[0].tilt
    )
    assert [float(c) for c in first.axis] == [0.0, 1.0, 0.0]
    assert (first.lower, first.upper, first.time_constant, first.max_rate) == (
        -0.2,
        0.5,
        0.1,
        math.inf,
    )


def test_a_hub_above_the_origins_plane_turns_about_the_level_part_of_its_arm(tmp_path):
    raised = loaded(
        tmp_path, "position = [0.3, 0.0, 0.0]", "position = [0.3, 0.0, 0.1]"
    ).rotors[0]
    np.testing.assert_allclose(
        [float(c) for c in raised.tilt.axis], [1.0, 0.0, 0.0], atol=1e-12
    )


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        (
            "lower = -1.5707963268",
            "lower = 0.3",
            r"rotors\[rotor0\].tilt.lower = 0.3: must be from -pi to 0 rad",
        ),
        (
            "upper = 1.5707963268",
            "upper = 4.0",
            r"rotors\[rotor0\].tilt.upper = 4.0: must be from 0 to pi rad",
        ),
        (
            "time_constant = 0.05\nmax_rate",
            "max_rate",
            r"rotor_defaults.tilt.time_constant: is missing",
        ),
        (
            "time_constant = 0.05\nmax_rate",
            "time_constant = 0.0\nmax_rate",
            "time_constant = 0.0: must be above 0",
        ),
        ("max_rate = 6.0", "max_rate = -1.0", "max_rate = -1.0: must be above 0"),
        ("max_rate = 6.0", "speed = 6.0", "rotor_defaults.tilt.speed"),
        (
            "max_rate = 6.0",
            "axis = [0.0, 0.0, 2.0]",
            r"rotors\[rotor0\].tilt.axis.*perpendicular",
        ),
        (
            "position = [0.3, 0.0, 0.0]",
            "position = [0.0, 0.0, 0.2]",
            r"rotors\[rotor0\].tilt.axis = \(missing\)",
        ),
    ],
)
def test_what_no_servo_has_is_refused_in_one_line(tmp_path, old, new, line):
    with pytest.raises(skyarm.VehicleError) as error:
        loaded(tmp_path, old, new)
    assert "\n" not in str(error.value)
    assert re.search(line, str(error.value))


def test_a_range_of_nothing_is_refused():
    tilt = dataclasses.replace(VOLIRO.rotors[0].tilt, lower=0.0, upper=0.0)
    rotors = (dataclasses.replace(VOLIRO.rotors[0], tilt=tilt),)
    with pytest.raises(
        skyarm.VehicleError, match=r"lower = 0\.0: must be below upper = 0\.0"
    ):
        dataclasses.replace(VOLIRO, rotors=rotors)
    with pytest.raises(ValueError, match="must be a number"):
        Tilt(axis=(1, 0, 0), lower="a", upper=1.0, time_constant=0.1)


def test_a_record_is_read_back_and_one_without_servos_is_written_as_before():
    assert restore(plain(VOLIRO)) == VOLIRO
    assert "tilt" not in str(plain(skyarm.load_vehicle("tilted_hexarotor"))["rotors"])
