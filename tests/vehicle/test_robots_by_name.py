"""Robots of installed packages by name: files that come with a package, files that are
fetched, and neither.
"""

from __future__ import annotations

import sys

import pytest

from skyarm.vehicle import VehicleError
from skyarm.vehicle import vehicle_files as robots
from skyarm.vehicle.vehicle_files import load_vehicle
from support.cases import joint, limits, link, robot, saved

ARM = robot(link("b"), link("a"), joint("j", "b", "a", limits()))


@pytest.fixture
def nothing_installed(tmp_path, monkeypatch):
    """The package is not there; the folder on the path is empty."""
    monkeypatch.setattr(sys, "path", [str(tmp_path)])
    monkeypatch.setattr(sys, "prefix", str(tmp_path))
    return tmp_path


def carried(folder, name="one_arm"):
    place = folder / "cmeel.prefix" / robots.CARRIED / "some_description" / "urdf"
    place.mkdir(parents=True)
    return saved(place, ARM, f"{name}.urdf")


def test_without_the_packages_the_line_says_how_to_install_them(nothing_installed):
    with pytest.raises(
        VehicleError,
        match=r"^robot:one_arm: robot = 'robot:one_arm': needs the extra 'robots': ",
    ):
        load_vehicle("robot:one_arm")


def test_a_robot_whose_file_comes_with_its_package(nothing_installed):
    path = carried(nothing_installed)
    assert load_vehicle("robot:one_arm") == load_vehicle(path)
    toml = (
        'schema = 1\nname = "v"\nairframe = "hummingbird"\n[[attach]]\narm ='
        ' "robot:one_arm"\nprefix = "x_"\n'
    )
    vehicle = load_vehicle(saved(nothing_installed, toml, "v.toml"))
    assert [each.name for each in vehicle.links] == ["x_a"]
    with pytest.raises(
        VehicleError, match=r"did you mean 'one_arm'\? must be one of the 1 robots of"
    ):
        load_vehicle("robot:one_arn")


def test_the_robots_of_example_robot_data_load():
    """All those of the package are the census's (test_urdf_census.py)."""
    if not robots.carried_robots():
        pytest.skip("example-robot-data is not installed (400 MB of files)")
    ur5 = load_vehicle("robot:ur5_robot")
    assert (ur5.n, ur5.links[1].joint.effort_limit) == (6, 150.0)
