"""Force of one point on a surface: closed forms, the cone, sticking and sliding, and no
energy from nowhere.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from skyarm.algebra import ZERO3, Vec3
from skyarm.world.contact import Material
from skyarm.world.contact.contact_point import touch_of
from skyarm.world.contact.material import LIGHTEST

STEEL = Material(stiffness=5000.0, dissipation=1.0, friction=0.3, bristle_length=2e-4)
STEP = 1e-3


def still(bristle, normal):
    return np.array(
        [*STEEL.friction_force(Vec3(*bristle), Vec3(0.0, 0.0, 0.0), normal)]
    )


def test_the_normal_force_is_that_of_hunt_and_crossley_and_never_pulls():
    for depth, rate in ((1e-3, 0.0), (1e-3, 0.2), (1e-3, -0.2), (2e-3, -0.9)):
        assert STEEL.normal_force(depth, rate) == pytest.approx(
            5000.0 * depth * (1.0 + rate), rel=1e-12
        )
    assert STEEL.normal_force(1e-3, -1.1) == 0.0, "it never pulls"
    assert STEEL.normal_force(-1e-4, 0.0) == STEEL.normal_force(0.0, 0.0) == 0.0


def test_near_the_surface_it_is_the_mean_over_the_way_of_a_step():
    """Against the mean of 10 001 depths along the way; beyond half of the way it is the
    force itself.
    """
    rate, material = 0.3, Material(stiffness=5000.0, dissipation=0.0)
    way = rate * material.largest_step
    for depth in np.linspace(-0.6, 0.6, 13) * way:
        along = depth + way * np.linspace(-0.5, 0.5, 10001)
        mean = 5000.0 * np.maximum(along, 0.0).mean()
        assert material.normal_force(depth, rate) == pytest.approx(
            mean, abs=1e-4 * 5000.0 * way
        )
        assert material.normal_force(depth, -rate) == material.normal_force(depth, rate)


def test_a_touch_of_the_vehicle_is_smoothed_over_the_step_of_its_own_material():
    """k h^2 / (2 way) with h = way / 2 + d in the bend; where a step is told, the way
    is that which it makes.
    """
    soft, up, nothing = (
        Material(stiffness=500.0, dissipation=0.0, friction=0.0),
        Vec3(0.0, 0.0, 1.0),
        ZERO3,
    )
    depth, slip = 1e-5, Vec3(0.0, 0.0, -0.1)
    for mass, mean, used in (
        (LIGHTEST, None, soft.largest_step),
        (0.5, 1e-3, 1e-3),
        (LIGHTEST, 5e-4, 5e-4),
    ):
        found = touch_of(soft, depth, up, nothing, slip, nothing, 1e-4, mass, mean=mean)
        way = 0.1 * used
        assert found.normal == pytest.approx(
            500.0 * (0.5 * way + depth) ** 2 / (2.0 * way), rel=1e-9
        )


def test_a_bristle_bends_with_the_slip_and_then_slides_at_its_length():
    """dz/dt = v - z |v| / z_s: against SciPy in one step and in many, however long they
    are.
    """
    start, v = np.array([-1.2e-4, 1.1e-4]), np.array([0.06, 0.08])
    for seconds in (1e-4, 2e-3, 0.02):
        true = solve_ivp(
            lambda _t, z: v - z * 0.1 / 2e-4,
            (0.0, seconds),
            start,
            rtol=1e-11,
            atol=1e-15,
        ).y[:, -1]
        for steps in (1, 7):
            z, step = Vec3(*start, 0.0), seconds / steps
            for _ in range(steps):
                z = z + STEEL.bristle_rate(z, Vec3(*v, 0.0), 1e-3, step) * step
            assert [*z][:2] == pytest.approx(true, abs=1e-11)
    z, v = Vec3(*start, 0.0), Vec3(0.06, 0.08, 0.0)
    assert [*STEEL.bristle_rate(z, v, 1e-3, 1e-9)] == pytest.approx(
        [*STEEL.bending_rate(z, v)], rel=1e-5
    )
    sliding = Vec3(2e-4, 0.0, 0.0)
    assert [
        *STEEL.bristle_rate(sliding, Vec3(0.4, 0.0, 0.0), 1e-3, STEP)
    ] == pytest.approx([0.0] * 3, abs=1e-12)
    assert [*STEEL.bending_rate(sliding, Vec3(0.4, 0.0, 0.0))] == pytest.approx(
        [0.0] * 3, abs=1e-12
    )


def test_at_rest_nothing_is_undefined():
    upright, still_point = Vec3(0.0, 0.0, 0.0), Vec3(0.0, 0.0, 0.0)
    assert [*STEEL.bristle_rate(upright, still_point, 1e-3, STEP)] == [0.0] * 3
    assert [*STEEL.friction_force(upright, still_point, 1.0)] == pytest.approx(
        [0.0] * 3, abs=1e-12
    )


def test_without_contact_the_bristle_stands_up():
    assert STEEL.bristle_rate(
        Vec3(1e-4, 0.0, -2e-5), Vec3(1.0, 0.0, 0.0), -1e-6, STEP
    ).x == pytest.approx(-0.05)


def test_friction_stands_against_the_slip_with_the_share_that_the_bristle_is_bent():
    assert still((1e-4, 0.0, 0.0), 2.0) == pytest.approx(
        [-0.3 * 2.0 * 0.5, 0.0, 0.0], rel=1e-12
    )
    assert still((0.0, 2e-4, 0.0), 2.0) == pytest.approx([0.0, -0.6, 0.0], rel=1e-12)
    # s = min(5, 5 f) N s/m
    for normal, damping in ((0.1, 0.5), (3.0, 5.0)):
        force = STEEL.friction_force(Vec3(0.0, 0.0, 0.0), Vec3(1e-3, 0.0, 0.0), normal)
        assert force.x == pytest.approx(-damping * 1e-3, rel=1e-9)


def test_it_never_leaves_the_cone_and_is_nothing_without_pressure():
    rng = np.random.default_rng(3)
    drawn = (
        rng.normal(size=(300, 3)),
        rng.normal(size=(300, 3)),
        rng.exponential(3.0, 300),
    )
    for z, v, normal in zip(*drawn, strict=True):
        force = np.array(
            [*STEEL.friction_force(Vec3(*(1e-4 * z)), Vec3(*(0.2 * v)), normal)]
        )
        assert np.linalg.norm(force) <= 0.3 * normal * (1.0 + 1e-12)
    assert [*STEEL.friction_force(Vec3(1e-4, 0.0, 0.0), Vec3(0.1, 0.0, 0.0), 0.0)] == [
        0.0,
        0.0,
        0.0,
    ]


def test_stiffer_materials_and_shorter_bristles_ask_for_shorter_steps():
    """Half a percent above the natural frequency of 20 g; bristles mu k / z_s times a
    millimetre.
    """
    assert STEEL.largest_step == pytest.approx(
        0.85 * math.sqrt(0.02 / 5000.0), rel=1e-12
    )
    assert Material(stiffness=20000.0).largest_step == pytest.approx(
        0.5 * STEEL.largest_step, rel=1e-12
    )
    short = Material(friction=0.6, bristle_length=5e-5)
    assert short.largest_step == pytest.approx(
        1.5 * math.sqrt(0.02 / (0.6 * 5000.0 * 1e-3 / 5e-5)), rel=1e-12
    )
    assert Material(stiffness=100.0).largest_step == 2.5e-3


def test_left_out_a_material_is_that_of_the_measurements():
    """k 5000 N/m, c 1 s/m, mu 0.3, bristles of 0.2 mm."""
    assert Material() == Material(
        stiffness=5000.0, dissipation=1.0, friction=0.3, bristle_length=2e-4
    )
    assert Material(friction=0.0, dissipation=0.0).friction == 0.0
    assert Material(stiffness=0.05).stiffness == 0.05


@pytest.mark.parametrize(
    ("field", "value", "allowed"),
    [
        ("stiffness", 0.0, "above 0"),
        ("stiffness", -5.0, "above 0"),
        ("friction", -0.1, "at least 0"),
        ("dissipation", -1.0, "at least 0"),
        ("bristle_length", 0.0, "above 0"),
        ("friction", math.nan, "finite"),
    ],
)
def test_numbers_that_no_material_has_are_refused(field, value, allowed):
    with pytest.raises(ValueError, match=rf"{field} = .*{allowed}"):
        Material(**{field: value})


def test_a_material_that_brakes_a_hit_harder_asks_for_shorter_steps():
    """Damped by 5 s/m, a hit at 1.2 m/s is 1 + 2 * 6 times as stiff."""
    assert Material(dissipation=5.0).largest_step == pytest.approx(
        2.2 * math.sqrt(0.02 / (13.0 * 5000.0)), rel=1e-12
    )
