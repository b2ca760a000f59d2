"""Warnings about numbers that are probably in other units, and about models of another
mass.
"""

import dataclasses
from typing import Annotated

import pytest

import skyarm
from skyarm.records.units import Unit
from skyarm.reference.signals import Constant, Signal
from skyarm.scenario.scenario_file import LIBRARY as SCENARIOS
from skyarm.scenario.unlikely_numbers import (
    unlikely_in_vehicle,
    unlikely_numbers,
    unlikely_units,
)
from skyarm.vehicle.vehicle_files import LIBRARY as VEHICLES
from skyarm.world.component import Component

CASE = skyarm.load_scenario("case1")
OCTO = skyarm.load_vehicle("octo_coaxial_two_arms")


def with_joint(vehicle, index, **fields):
    links = list(vehicle.links)
    links[index] = dataclasses.replace(
        links[index], joint=dataclasses.replace(links[index].joint, **fields)
    )
    return dataclasses.replace(vehicle, links=tuple(links))


@pytest.mark.parametrize(("kind", "unit"), [("revolute", "N m"), ("prismatic", "N")])
def test_one_number_is_said_in_the_unit_of_its_kind_of_joint(kind, unit):
    index = next(i for i, link in enumerate(OCTO.links) if link.joint.kind == kind)
    (line,) = unlikely_in_vehicle(with_joint(OCTO, index, effort_limit=1e6))
    assert f"effort_limit = 1e+06 {unit}: is more than" in line
    assert "more)" not in line


def test_many_numbers_of_a_field_are_one_line():
    vehicle, turning = (
        OCTO,
        [i for i, link in enumerate(OCTO.links) if link.joint.kind == "revolute"],
    )
    for index in turning:
        vehicle = with_joint(vehicle, index, effort_limit=1e6)
    (line,) = unlikely_in_vehicle(vehicle)
    assert line.endswith(f"(and {len(turning) - 1} more)")


@pytest.mark.parametrize(("share", "told"), [(0.01, False), (1e-4, True)])
def test_a_base_of_little_inertia_between_its_rotors_is_told(share, told):
    vehicle = skyarm.load_vehicle("hexarotor_arm6")
    moments = {
        axis: share * float(getattr(vehicle.base.inertia, axis))
        for axis in ("xx", "yy", "zz")
    }
    base = dataclasses.replace(
        vehicle.base, inertia=dataclasses.replace(vehicle.base.inertia, **moments)
    )
    lines = unlikely_in_vehicle(dataclasses.replace(vehicle, base=base))
    assert [line.startswith("base.inertia: has ") for line in lines] == [True] * told


@pytest.mark.parametrize("axis", ["xx", "yy", "zz"])
def test_a_base_of_little_inertia_about_one_axis_alone_is_told(axis):
    vehicle = skyarm.load_vehicle("hexarotor_arm6")
    inertia = dataclasses.replace(
        vehicle.base.inertia, **{"xx": 0.06, "yy": 0.06, "zz": 0.06, axis: 1e-5}
    )
    base = dataclasses.replace(vehicle.base, inertia=inertia)
    (line,) = unlikely_in_vehicle(dataclasses.replace(vehicle, base=base))
    assert line.startswith("base.inertia: has 1e-05 kg m^2 about an axis")


@pytest.mark.parametrize("record", ["plant", "model"])
@pytest.mark.parametrize(("share", "told"), [(1.5, False), (1000.0, True)])
def test_a_plant_or_model_of_a_far_other_mass_is_told(record, share, told):
    base = CASE.plant.vehicle.base.mass
    other = skyarm.with_numbers(
        CASE, {f"{record}.vehicle.base.mass": float(base) * share}
    )
    assert any("differ; kg, not g" in line for line in unlikely_numbers(other)) is told


MOUNTED = """
[sensors.imu]
kind = "imu"
{imu}
[sensors.mocap]
kind = "pose"
[sensors.encoders]
kind = "encoders"
[estimator]
kind = "ekf"
{filter}
[[world.surfaces]]
name = "wall"
shape = "box"
size = [1.0, 1.0, 1.0]
position = [50.0, 0.0, 0.5]
{surface}
"""


@pytest.mark.parametrize(
    ("table", "text", "line"),
    [
        ("imu", "rpy = [0.0, 90.0, 0.0]", "sensors.imu.rpy = 90 rad: is more than"),
        ("imu", "rpy = [-180.0, 0.0, 0.0]", "sensors.imu.rpy = 180 rad: is more than"),
        (
            "imu",
            "position = [200.0, 0.0, 0.0]",
            "sensors.imu.position = 200 m: is more than 10; m, not mm?",
        ),
        (
            "filter",
            "imu_rpy = [0.0, 0.0, 45.0]",
            "estimator.imu_rpy = 45 rad: is more than",
        ),
        (
            "filter",
            "imu_position = [0.0, 200.0, 0.0]",
            "estimator.imu_position = 200 m: is more than 10",
        ),
        (
            "surface",
            "angles = [0.0, 0.0, 90.0]",
            "world.surfaces[wall].angles = 90 rad: is more than",
        ),
    ],
)
def test_degrees_and_millimetres_of_a_mount_are_told(tmp_path, table, text, line):
    tables = dict.fromkeys(("imu", "filter", "surface"), "")
    file = tmp_path / "mounted.toml"
    lines = []
    for given in ("", text):
        file.write_text(
            (SCENARIOS / "case1.toml").read_text("utf-8")
            + MOUNTED.format(**tables | {table: given})
        )
        lines.append(unlikely_numbers(skyarm.load_scenario(file)))
    without, (found,) = lines
    assert without == ()
    assert found.startswith(line)


@pytest.mark.parametrize("angles", ["0.0, 90.0, 0.0", "0.0, 0.0, -30.0"])
def test_a_frame_of_degrees_is_refused(tmp_path, angles):
    text = (VEHICLES / "hummingbird_arm2_rotors.toml").read_text("utf-8")
    frame = '\n[[frames]]\nname = "camera"\nposition = [0.1, 0.0, 0.0]\nrpy = '
    file = tmp_path / "degrees.toml"
    file.write_text(f"{text}{frame}[0.0, 0.0, 3.1]\n")
    assert skyarm.load_vehicle(file).frame("camera")
    file.write_text(f"{text}{frame}[{angles}]\n")
    with pytest.raises(
        ValueError, match=r"degrees\.toml: frames\[camera\]\.rpy = .* rad, not degrees"
    ):
        skyarm.load_vehicle(file)


@dataclasses.dataclass(frozen=True)
class Nodding(Component):
    """A user's own force whose angle is a signal."""

    angle: Annotated[Signal, Unit("rad", "angle of the force")] = Constant(90.0)


def test_an_angle_that_is_a_signal_is_no_number_to_look_at():
    environment = dataclasses.replace(CASE.environment, forces=(Nodding(),))
    assert unlikely_units(dataclasses.replace(CASE, environment=environment)) == ()
