"""The stepped law's feed-forward of a turning thrust direction, seen from a body that
points elsewhere.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from published_laws import (
    MODEL,
    NODES,
    NOTHING,
    UP,
    differentiated,
    gentle,
    measured,
    rotation,
    vec,
    wanted,
)

from skyarm.control.catalogue import make_controller
from skyarm.control.laws.ladder import _force_series, _turn
from support.laws import scalars


@pytest.mark.parametrize("seed", range(4))
def test_without_gains_the_body_keeps_the_rate_of_the_wanted_attitude_as_it_sees_it(
    seed,
):
    """d/dt of R^T W_d, with W_d the wanted attitude's angular velocity in world axes,
    by interpolation of attitudes.

    R^T W_d' - w x R^T W_d: only where R and R_d differ does it matter which of them
    turns a vector.
    """
    state = gentle(seed)
    reference = dataclasses.replace(wanted(seed), yaw_rate=0.7, yaw_acceleration=-0.4)
    controller = make_controller("ct_ladder", MODEL, steps=4)
    still = dataclasses.replace(
        controller.par.gains, attitude=vec(np.zeros(3)), rate=vec(np.zeros(3))
    )
    par = dataclasses.replace(controller.par, gains=still)
    R, now = (
        measured(state).quaternion.rotation(),
        float(MODEL.vehicle.mass) * (np.array([2.0, -1.5, 0.5]) + UP),
    )
    series = _force_series(vec(now), measured(state), reference, R, NOTHING, par)
    f, f1, f2 = (np.array([float(c.derivative(k)) for c in series]) for k in range(3))

    def attitude(t):
        force, yaw = (
            f + f1 * t + 0.5 * f2 * t * t,
            reference.yaw + 0.7 * t - 0.2 * t * t,
        )
        b3 = force / np.linalg.norm(force)
        b2 = np.cross(b3, [np.cos(yaw), np.sin(yaw), 0.0])
        b2 = b2 / np.linalg.norm(b2)
        return np.stack([np.cross(b2, b3), b2, b3], axis=1)

    # within 20 ms the force moves by a part of itself
    values = differentiated([attitude(0.1 * t).ravel() for t in NODES], 2, 0.1)
    R_d, first, second = (value.reshape(3, 3) for value in values)
    S = first @ R_d.T
    A = second @ R_d.T - S @ S
    W, W_dot = (np.array([m[2, 1], m[0, 2], m[1, 0]]) for m in (S, A))
    seen = rotation(state).inv()
    expected = seen.apply(W_dot) - np.cross(state.velocity[3:6], seen.apply(W))
    found = scalars(_turn(vec(now), measured(state), reference, R, NOTHING, par))
    # interpolation differentiates twice to about 1e-8 of the attitude's second
    # derivative
    np.testing.assert_allclose(
        found, expected, atol=1e-6 * (1.0 + np.abs(expected).max())
    )
