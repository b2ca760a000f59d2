"""What a vehicle's file leaves out is what docs/vehicle_files.md says, and its
published numbers are the published.
"""

from __future__ import annotations

import math
import re
from dataclasses import MISSING, fields
from pathlib import Path

import pytest

import skyarm
from skyarm.vehicle import BodyDrag, Joint, Rotor
from skyarm.vehicle.vehicle_files import load_vehicle
from support.pages import cells_of

PAGE = (Path(__file__).parents[2] / "docs" / "vehicle_files.md").read_text("utf-8")
BLOCKS = {Joint: "joint", Rotor: "rotors", BodyDrag: "drag"}
WORDS = {"no limit": math.inf, "`[0, 0, 1]`": (0, 0, 1), '`"revolute"`': "revolute"}


def table(record):
    """Field -> the text of its default, for every row of the page's table of a
    record.
    """
    (block,) = re.findall(
        rf"<!-- generated: vehicle {BLOCKS[record]} -->\n(.*?)<!-- /generated -->",
        PAGE,
        re.DOTALL,
    )
    return {row[0].strip("`"): row[2] for row in cells_of(block)}


def default(record, name):
    (field,) = [each for each in fields(record) if each.name == name]
    assert field.default is not MISSING, f"{record.__name__}.{name} must be given"
    return tuple(field.default) if hasattr(field.default, "x") else field.default


@pytest.mark.parametrize(
    ("record", "name"),
    [
        *(
            (Joint, name)
            for name in ("kind", "effort_limit", "damping", "coulomb", "coulomb_rate")
        ),
        *(
            (Rotor, name)
            for name in (
                "axis",
                "drag_coefficient",
                "rolling_moment_coefficient",
                "max_speed",
            )
        ),
        *((Rotor, name) for name in ("time_constant_up", "time_constant_down")),
        *((BodyDrag, name) for name in ("air_density",)),
    ],
    ids=lambda each: each if isinstance(each, str) else each.__name__,
)
def test_a_number_that_is_left_out_is_the_one_of_the_page(record, name):
    text = table(record)[name]
    wanted = WORDS[text] if text in WORDS else float(text.strip("`"))
    assert default(record, name) == wanted


def test_limits_of_a_joint_are_none_if_left_out():
    assert table(Joint)["lower"] == table(Joint)["upper"] == "no limit"
    assert (default(Joint, "lower"), default(Joint, "upper")) == (-math.inf, math.inf)


def test_the_rotors_lags_are_those_of_rotors_and_of_its_hummingbird():
    """RotorS's motor model: default time constants 1/80 s up and 1/40 s down, which its
    xacro repeats.
    """
    shipped = skyarm.load_vehicle("hummingbird").rotors[0]
    for name, rate in (("time_constant_up", 80.0), ("time_constant_down", 40.0)):
        assert default(Rotor, name) == getattr(shipped, name) == 1.0 / rate


def test_the_air_is_that_of_the_standard_atmosphere_at_sea_level():
    """p / (R T) of ISO 2533: 101325 Pa, 287.05287 J/(kg K), 288.15 K."""
    density = 101325.0 / (287.05287 * 288.15)
    assert default(BodyDrag, "air_density") == pytest.approx(density, rel=5e-5)


BARE = """
schema = 1
name = "bare"
[base]
mass = 1.0
inertia = [0.01, 0.01, 0.01]
[[links]]
name = "arm"
parent = "base"
mass = 0.2
inertia = [0.001, 0.001, 0.001]
joint = { name = "shoulder", axis = [0, 1, 0] }
[[rotors]]
name = "front"
position = [0.2, 0, 0]
direction = "ccw"
thrust_coefficient = 1e-5
moment_coefficient = 0.01
"""


def test_a_file_that_leaves_everything_out_has_the_defaults_of_the_records(tmp_path):
    path = tmp_path / "bare.toml"
    path.write_text(BARE, encoding="utf-8")
    found = load_vehicle(path)
    (link,), (rotor,) = found.links, found.rotors
    for name in (
        "kind",
        "lower",
        "upper",
        "effort_limit",
        "damping",
        "coulomb",
        "coulomb_rate",
    ):
        assert getattr(link.joint, name) == default(Joint, name), name
    for name in (
        "drag_coefficient",
        "rolling_moment_coefficient",
        "time_constant_up",
        "time_constant_down",
    ):
        assert getattr(rotor, name) == default(Rotor, name), name
    assert (rotor.max_speed, tuple(rotor.axis)) == (math.inf, (0, 0, 1))
    assert (tuple(found.drag.area), found.drag.air_density) == ((0, 0, 0), 1.225)
