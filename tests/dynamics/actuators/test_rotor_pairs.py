"""Tilting rotors as pairs of fixed ones: the same wrench, Kamel's least squares by
NumPy, limits that are kept.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Vec3
from skyarm.dynamics.actuators import make_mixer, mix
from skyarm.dynamics.actuators.tilting import (
    WIDEST,
    as_pairs,
    ends,
    forces_of_pairs,
    speeds_of_pairs,
)

VOLIRO = skyarm.load_vehicle("voliro_like")
ANGLES = (0.4, -0.3, 0.2, 0.7, -0.6, 0.1)


def narrow(lower, upper):
    """The vehicle with servos of another range, its third rotor fixed."""
    rotors = [
        dataclasses.replace(
            r, tilt=dataclasses.replace(r.tilt, lower=lower, upper=upper)
        )
        for r in VOLIRO.rotors
    ]
    rotors[2] = dataclasses.replace(rotors[2], tilt=None)
    return dataclasses.replace(VOLIRO, rotors=tuple(rotors))


def pairs_matrix(vehicle):
    """Kamel's 6 x 2n matrix: columns of squared speed times cos and sin of the angle,
    written out with NumPy.
    """
    columns = []
    for rotor in vehicle.rotors:
        at, n, t = (
            np.array([float(c) for c in v])
            for v in (rotor.position, rotor.axis, rotor.tilt.axis)
        )
        for axis in (n, np.cross(t, n)):
            push = float(rotor.thrust_coefficient) * axis
            columns.append(
                [
                    *(
                        np.cross(at, push)
                        - rotor.direction * float(rotor.moment_coefficient) * push
                    ),
                    *push,
                ]
            )
    return np.array(columns).T


def test_allocation_is_the_least_norm_of_the_constant_matrix():
    mixer, A, rng = (
        make_mixer(as_pairs(VOLIRO), "priority", sideways=True),
        pairs_matrix(VOLIRO),
        np.random.default_rng(1),
    )
    weight = 9.81 * VOLIRO.mass
    for _ in range(10):
        wrench = np.array(
            [
                *rng.uniform(-0.3, 0.3, 3),
                *rng.uniform(-4.0, 4.0, 2),
                weight * rng.uniform(0.9, 1.2),
            ]
        )
        speeds, _ = mix(mixer, Vec3(*wrench[:3]), wrench[5], Vec3(*wrench[3:5], 0))
        least = (np.linalg.pinv(A) @ wrench).reshape(6, 2)
        forces = forces_of_pairs(VOLIRO, speeds)
        np.testing.assert_allclose(
            [f.push for f in forces], np.hypot(*least.T), rtol=1e-9
        )
        np.testing.assert_allclose(
            [f.angle for f in forces], np.arctan2(least[:, 1], least[:, 0]), atol=1e-9
        )


@pytest.mark.parametrize("limits", [(-1.5, 1.5), (-0.3, 0.5), (-0.1, 3.0)])
def test_speeds_and_angles_within_the_range_become_pairs_and_come_back(limits):
    vehicle = narrow(*limits)
    low, high = ends(vehicle.tilts[0])
    assert (low, high) == (max(limits[0], -WIDEST), min(limits[1], WIDEST))
    angles = np.linspace(low, high, 5)
    speeds = np.linspace(300.0, 800.0, 6)
    back = forces_of_pairs(vehicle, speeds_of_pairs(vehicle, speeds, angles))
    np.testing.assert_allclose([f.push for f in back], speeds**2, rtol=1e-12)
    np.testing.assert_allclose(
        [f.angle for f in back], [*angles[:2], 0.0, *angles[2:]], atol=1e-9
    )


@pytest.mark.parametrize("limits", [(-1.5, 1.5), (-0.3, 0.5)])
def test_a_pair_at_its_limit_never_asks_for_more_than_the_rotor_has(limits):
    vehicle = narrow(*limits)
    pairs, (low, high) = as_pairs(vehicle), ends(vehicle.tilts[0])
    top = float(vehicle.rotors[0].max_speed) ** 2
    most = float(pairs.rotors[0].max_speed)
    for first, second in ((most, most), (most, 0.0), (0.3 * most, most)):
        force = forces_of_pairs(
            vehicle, [first, second, *(0.0,) * (len(pairs.rotors) - 2)]
        )[0]
        assert force.push <= top * (1.0 + 1e-12)
        assert low - 1e-12 <= force.angle <= high + 1e-12
    both = forces_of_pairs(vehicle, [most, most, *(0.0,) * (len(pairs.rotors) - 2)])[0]
    assert both.push == pytest.approx(top)
    assert both.angle == pytest.approx(0.5 * (low + high))
    alone = forces_of_pairs(vehicle, [most, *(0.0,) * (len(pairs.rotors) - 1)])[0]
    assert alone.push == pytest.approx(top / (2.0 * math.cos(0.5 * (high - low))))


def test_hub_drag_of_a_pair_is_the_rotors_at_rest_in_hover():
    pairs = as_pairs(VOLIRO)
    speeds = speeds_of_pairs(VOLIRO, (470.0,) * 6, (0.0,) * 6)
    drag = sum(
        r.drag_coefficient * w for r, w in zip(pairs.rotors, speeds, strict=True)
    )
    assert drag == pytest.approx(sum(r.drag_coefficient * 470.0 for r in VOLIRO.rotors))
    assert as_pairs(pairs) is pairs


def test_an_angle_beyond_its_end_counts_as_the_end():
    speeds = speeds_of_pairs(VOLIRO, (400.0,) * 6, (1.2, *ANGLES[1:]))
    assert speeds[0] == 0.0
    assert speeds[1] > 0.0
