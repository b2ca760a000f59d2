"""Warnings about numbers that are probably in other units, and about models of another mass."""

import dataclasses

import pytest

import skyarm
from skyarm.scenario.unlikely_numbers import unlikely_in_vehicle, unlikely_numbers

CASE = skyarm.load_scenario("case1")
OCTO = skyarm.load_vehicle("octo_coaxial_two_arms")


def with_joint(vehicle, index, **fields):
    links = list(vehicle.links)
    links[index] = dataclasses.replace(links[index], joint=dataclasses.replace(links[index].joint, **fields))
    return dataclasses.replace(vehicle, links=tuple(links))


@pytest.mark.parametrize(("kind", "unit"), [("revolute", "N m"), ("prismatic", "N")])
def test_one_number_is_said_in_the_unit_of_its_kind_of_joint(kind, unit):
    index = next(i for i, link in enumerate(OCTO.links) if link.joint.kind == kind)
    (line,) = unlikely_in_vehicle(with_joint(OCTO, index, effort_limit=1e6))
    assert f"effort_limit = 1e+06 {unit}: is more than" in line
    assert "more)" not in line


def test_many_numbers_of_a_field_are_one_line():
    vehicle, turning = OCTO, [i for i, link in enumerate(OCTO.links) if link.joint.kind == "revolute"]
    for index in turning:
        vehicle = with_joint(vehicle, index, effort_limit=1e6)
    (line,) = unlikely_in_vehicle(vehicle)
    assert line.endswith(f"(and {len(turning) - 1} more)")


@pytest.mark.parametrize(("share", "told"), [(0.01, False), (1e-4, True)])
def test_a_base_of_little_inertia_between_its_rotors_is_told(share, told):
    vehicle = skyarm.load_vehicle("hexarotor_arm6")
    moments = {axis: share * float(getattr(vehicle.base.inertia, axis)) for axis in ("xx", "yy", "zz")}
    base = dataclasses.replace(vehicle.base, inertia=dataclasses.replace(vehicle.base.inertia, **moments))
    lines = unlikely_in_vehicle(dataclasses.replace(vehicle, base=base))
    assert [line.startswith("base.inertia: has ") for line in lines] == [True] * told


@pytest.mark.parametrize("axis", ["xx", "yy", "zz"])
def test_a_base_of_little_inertia_about_one_axis_alone_is_told(axis):
    vehicle = skyarm.load_vehicle("hexarotor_arm6")
    inertia = dataclasses.replace(vehicle.base.inertia, **{"xx": 0.06, "yy": 0.06, "zz": 0.06, axis: 1e-5})
    base = dataclasses.replace(vehicle.base, inertia=inertia)
    (line,) = unlikely_in_vehicle(dataclasses.replace(vehicle, base=base))
    assert line.startswith("base.inertia: has 1e-05 kg m^2 about an axis")


@pytest.mark.parametrize("record", ["plant", "model"])
@pytest.mark.parametrize(("share", "told"), [(1.5, False), (1000.0, True)])
def test_a_plant_or_model_of_a_far_other_mass_is_told(record, share, told):
    base = CASE.plant.vehicle.base.mass
    other = skyarm.with_numbers(CASE, {f"{record}.vehicle.base.mass": float(base) * share})
    assert any("differ; kg, not g" in line for line in unlikely_numbers(other)) is told
