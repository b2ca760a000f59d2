"""Axes and rotations that are rounded are made exact in Python as in a file, and others
are refused or left alone.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import skyarm
from skyarm.algebra import Mat3, Quaternion, Vec3
from skyarm.compile import trace
from skyarm.records.coerce import (
    RecordError,
    near_unit_quaternion,
    proper_rotation,
    unit_vector,
)
from skyarm.world import Dryden

HALF = math.sqrt(0.5)


def turned(axis: object) -> skyarm.Vehicle:
    vehicle = skyarm.load_vehicle("hummingbird_arm2_rotors")
    first = vehicle.links[0]
    joint = dataclasses.replace(first.joint, axis=axis, rotation=Mat3.identity())
    return dataclasses.replace(
        vehicle, links=(dataclasses.replace(first, joint=joint), *vehicle.links[1:])
    )


def test_a_rounded_axis_gives_the_mass_matrix_of_the_exact_one() -> None:
    at = ([0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.3, -0.2])
    rounded, exact = (
        skyarm.mass_matrix(turned(axis), *at)
        for axis in ([0.707107, 0, 0.707107], [HALF, 0, HALF])
    )
    np.testing.assert_allclose(rounded, exact, rtol=0.0, atol=1e-15)


@pytest.mark.parametrize("axis", [[0.6, 0.0, 0.8], [0.0, 0.0, 1.0], [HALF, 0.0, HALF]])
def test_an_exact_axis_keeps_its_bits(axis: list[float]) -> None:
    assert list(unit_vector("axis", axis)) == axis


def test_the_rotors_axis_is_made_exact_too() -> None:
    rotor = skyarm.load_vehicle("hummingbird").rotors[0]
    assert np.linalg.norm(
        dataclasses.replace(rotor, axis=(0.0, 0.0995037, 0.9950372)).axis
    ) == pytest.approx(1.0, abs=1e-15)


def test_an_axis_of_another_length_is_refused_by_its_vehicle() -> None:
    with pytest.raises(
        skyarm.VehicleError, match=r"must be a unit vector, its length is 1.1"
    ):
        turned([1.1, 0.0, 0.0])


@pytest.mark.parametrize("off", [4e-7, -4e-7, 9.99e-7, -9.99e-7])
def test_a_rounded_quaternion_becomes_a_unit_one(off: float) -> None:
    exact = np.array([0.5, -0.5, 0.5, 0.5])
    found = near_unit_quaternion(Quaternion(*(exact * (1.0 + off)).tolist()))
    np.testing.assert_allclose(list(found), exact, rtol=0.0, atol=1e-15)


@pytest.mark.parametrize("off", [1.004e-6, -1.004e-6])
def test_a_length_a_millionth_off_and_more_is_refused(off: float) -> None:
    with pytest.raises(RecordError, match=r"^axis = .*: must be a unit vector"):
        unit_vector("axis", [0.6 * (1.0 + off), 0.0, 0.8 * (1.0 + off)])


def test_traced_axes_pass() -> None:
    program = trace(
        lambda axis: skyarm.Joint(name="j", axis=axis).axis, Vec3(1.0, 0.5, 0.25)
    )
    assert tuple(program(Vec3(0.9999999, 0.0, 0.0))) == (0.9999999, 0.0, 0.0)


@pytest.mark.parametrize("digits", [6, 7, 9])
@pytest.mark.parametrize("frame", [False, True])
def test_a_rounded_rotation_becomes_the_nearest_one(digits: int, frame: bool) -> None:
    """Against the singular value decomposition, which shares no line with the
    iteration.
    """
    given = np.round(Rotation.from_euler("zyx", [0.4, -0.7, 1.1]).as_matrix(), digits)
    left, _, right = np.linalg.svd(given)
    if frame:
        held = skyarm.Frame(
            name="f", link=-1, position=(0, 0, 0), rotation=given
        ).rotation
    else:
        held = skyarm.Joint(name="j", rotation=given).rotation
    # rounding of the decomposition
    np.testing.assert_allclose(np.array(held), left @ right, rtol=0.0, atol=2e-15)
    assert proper_rotation("again", held) == held


def test_what_is_no_rotation_is_refused() -> None:
    with pytest.raises(
        RecordError,
        match=r"^bent = .*: must be a rotation \(orthogonal, determinant \+1\)$",
    ):
        proper_rotation("bent", np.eye(3) + 1e-3)


def test_a_rounded_quaternion_of_a_state_is_made_exact() -> None:
    scenario = skyarm.load_scenario("case1")
    state = skyarm.run(dataclasses.replace(scenario, duration=0.005))
    start = skyarm.State(
        position=state.position[0],
        quaternion=(0.9950042, 0.0, 0.0, 0.0998334),
        velocity=[0, 0, 0],
        rate=[0, 0, 0],
        joints=[0, 0],
        joint_rates=[0, 0],
        rotor_speeds=state.rotor_speeds[0],
    )
    held = dataclasses.replace(scenario, initial=start).initial
    assert held is not None
    assert math.sqrt(sum(c * c for c in held.quaternion)) == pytest.approx(
        1.0, abs=2e-16
    )
    exact = Quaternion(HALF, 0.0, HALF, 0.0)
    assert near_unit_quaternion(exact) is exact


def test_the_turbulence_blows_along_a_unit_vector() -> None:
    one = (1.0, 1.0, 1.0)
    rounded = Dryden(
        intensity=one,
        scale_length=one,
        airspeed=1.0,
        direction_W=[0.707107, 0.707107, 0.0],
    )
    assert np.linalg.norm(rounded.direction_W) == pytest.approx(1.0, abs=2e-16)
    with pytest.raises(
        RecordError, match=r"^turbulence.direction_W = .*must be a unit vector"
    ):
        Dryden(
            intensity=one, scale_length=one, airspeed=1.0, direction_W=(2.0, 0.0, 0.0)
        )
