"""How far sideways force reaches at a level hover, as a check says it: linear programs as oracle."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

import skyarm
from sideways_program import largest, lopsided
from skyarm.studies.assess.arm_poses import arm_poses
from skyarm.studies.assess.assessment import assess_vehicle
from skyarm.studies.assess.thrust import sideways_reach

HEXA = skyarm.load_vehicle("tilted_hexarotor")
ARM = dataclasses.replace(skyarm.load_vehicle("hummingbird_arm2_rotors"), base=HEXA.base, rotors=HEXA.rotors)
ANGLES = np.radians(np.arange(0.0, 360.0, 7.5))


def least(vehicle, com):
    weight = float(vehicle.mass) * 9.81
    return min(largest(vehicle, (math.cos(a), math.sin(a)), weight, com) for a in ANGLES)


def test_the_check_of_a_fully_actuated_vehicle_says_it_and_that_of_a_flat_one_does_not():
    (found,) = (f for f in assess_vehicle(HEXA, poses=4).findings if f.question == "sideways force")
    assert found.value == pytest.approx(least(HEXA, np.zeros(3)))
    assert f"{found.value:.3g} N" in found.text
    flat = assess_vehicle(skyarm.load_vehicle("hummingbird"), poses=4).findings
    assert not any(f.question == "sideways force" for f in flat)


@pytest.mark.parametrize("highest", [750.0, 540.0])
def test_an_arm_takes_some_of_it(highest):
    """Two links on a planar arm: centres of mass by hand. Slow rotors come to their highest speed before they stop."""
    rotors = tuple(dataclasses.replace(rotor, max_speed=highest) for rotor in HEXA.rotors)
    vehicle = lopsided(dataclasses.replace(ARM, rotors=rotors)).with_payload(0.3)
    (worst,) = sideways_reach(arm_poses(vehicle, 16))
    here = np.array([[0.9, -0.4]])
    (found,) = sideways_reach(dataclasses.replace(arm_poses(vehicle, 16), joints=here))
    assert worst.value < found.value
    assert found.joints == (0.9, -0.4)
    total, point, angle = np.array([0.0, 0.0, 0.0]), np.zeros(2), 0.0
    for link, q in zip(vehicle.links, found.joints, strict=True):
        assert [float(c) for c in link.joint.axis] == [0.0, 1.0, 0.0]
        at, com = (np.array([float(v.x), float(v.z)]) for v in (link.joint.position, link.body.com))
        turned = [np.array([[math.cos(a), math.sin(a)], [-math.sin(a), math.cos(a)]]) for a in (angle, angle + q)]
        point, angle = point + turned[0] @ at, angle + q
        x, z = point + turned[1] @ com
        total += float(link.body.mass) * np.array([x, 0.0, z])
    assert found.value == pytest.approx(least(vehicle, total / float(vehicle.mass)), rel=2e-3)
