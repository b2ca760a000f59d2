"""The rotors' forces beside their thrust, along a reference: their derivatives by small
steps of time.
"""

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Quaternion, Vec3
from skyarm.control.blocks.prediction import reference_drag
from skyarm.control.model import Model
from skyarm.dynamics import State

TILTED, FLAT = (
    skyarm.load_vehicle(name) for name in ("tilted_hexarotor", "hummingbird")
)


def along(vehicle, t, *, moving=True, sideways=False):
    """At a fixed attitude and fixed speeds of the rotors, at time t of a motion of
    third order.
    """
    rng = np.random.default_rng(4)
    p, v, a, j = (Vec3(*(float(x) for x in rng.normal(size=3))) for _ in range(4))
    base = [p, v + a * t + j * (0.5 * t * t), a + j * t, j, j * 0.0]
    speeds = tuple(float(x) for x in 300.0 + 50.0 * rng.random(len(vehicle.rotors)))
    zero = Vec3(0.0, 0.0, 0.0)
    turn = Quaternion(
        *(float(x) for x in np.array([0.9, 0.1, -0.3, 0.2]) / np.sqrt(0.95))
    )
    state = State(
        position=zero,
        quaternion=turn,
        velocity=zero,
        rate=zero,
        joints=(),
        joint_rates=(),
        rotor_speeds=speeds,
    )
    drag = reference_drag(
        Model(vehicle=vehicle), state, base, sideways=sideways, moving=moving
    )
    return np.array([[float(c) for c in each] for each in drag])


@pytest.mark.parametrize(
    ("vehicle", "sideways"), [(TILTED, False), (TILTED, True), (FLAT, False)]
)
def test_derivatives_of_the_drag_are_those_of_small_steps(vehicle, sideways):
    h = 1e-2
    before, now, after = (along(vehicle, t, sideways=sideways) for t in (-h, 0.0, h))
    assert now[1] == pytest.approx((after[0] - before[0]) / (2.0 * h), abs=1e-9)
    assert now[2] == pytest.approx((after[1] - before[1]) / (2.0 * h), abs=1e-9)
    assert np.abs(now[1]).max() > 1e-4
    still = along(vehicle, 0.0, moving=False, sideways=sideways)
    assert still.tolist() == [now[0].tolist(), [0.0] * 3, [0.0] * 3]


def test_only_tilted_rotors_push_across():
    # what they push is a force that is there at rest
    pushed, still = (
        [along(v, 0.0)[0] - along(v, 0.0, sideways=True)[0]] for v in (TILTED, FLAT)
    )
    assert np.abs(pushed).max() > 0.1
    assert np.abs(still).max() == 0.0
