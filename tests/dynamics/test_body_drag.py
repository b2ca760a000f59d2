"""Drag of the airframe: by hand, its power, its slope at rest, and zeros that are
structure next to data.
"""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from skyarm.algebra import ZERO3, Vec3
from skyarm.compile import trace
from skyarm.dynamics.body_drag import body_drag
from skyarm.vehicle import BodyDrag

VELOCITY = (2.0, -3.0, 6.0)
"""m/s; its length is 7."""


def test_body_drag_by_hand():
    par = BodyDrag(area=Vec3(0.01, 0.02, 0.05))
    # |v| = 3: -1/2 1.225 3 = -1.8375, times area and component
    force = body_drag(par, Vec3(2.0, -1.0, 2.0))
    assert list(force) == pytest.approx(
        [-1.8375 * 0.02, 1.8375 * 0.02, -1.8375 * 0.1], rel=1e-14
    )


def test_body_drag_takes_power_out_in_every_direction():
    par = BodyDrag(area=Vec3(0.01, 0.02, 0.05))
    for v in np.random.default_rng(1).normal(size=(20, 3)).tolist():
        assert body_drag(par, Vec3(*v)).dot(Vec3(*v)) < 0.0


def test_body_drag_at_rest_is_zero_with_a_zero_slope():
    par = BodyDrag(area=Vec3(0.01, 0.02, 0.05))
    assert list(body_drag(par, Vec3(0.0, 0.0, 0.0))) == [0.0, 0.0, 0.0]
    jax = pytest.importorskip("jax")
    slope = jax.grad(lambda v: body_drag(par, Vec3(v, 0.0, 0.0)).x)(0.0)
    # N s/m, from the 1e-12 m/s under the root; NaN without it
    assert abs(slope) < 1e-10


def test_no_drag_folds_away():
    assert body_drag(BodyDrag(), Vec3(1.0, 2.0, 3.0)) == ZERO3


@pytest.mark.parametrize(
    "area", list(itertools.product((0, 0.03, 1, -0.0), repeat=3)), ids=str
)
def test_drag_acts_on_every_axis_that_has_an_area(area):
    """-1/2 1.2 7 area_i v_i by hand; tolerance: five roundings. Structure is only what
    is zero on all axes.
    """
    par = BodyDrag(area=Vec3(*area), air_density=1.2)
    force = body_drag(par, Vec3(*VELOCITY))
    np.testing.assert_allclose(
        [float(c) for c in force], -4.2 * np.array(area) * VELOCITY, rtol=1e-14, atol=0
    )
    folded = [type(c) is int for c in force]
    # a float zero is data: it may be a lane of a batch
    assert folded == [type(a) is int and a == 0 for a in area]


def test_a_vehicle_without_drag_costs_no_operation_and_one_axis_its_own_only():
    def operations(area):
        def force(x, y, z):
            return body_drag(BodyDrag(area=Vec3(*area)), Vec3(x, y, z))

        return sum(
            node.op not in ("input", "const")
            for node in trace(force, *VELOCITY).lowered.nodes
        )

    assert operations((0, 0, 0)) == 0
    assert (
        0
        < operations((0, 0.1, 0))
        < operations((0.2, 0.1, 0))
        < operations((0.2, 0.1, 0.3))
    )


def test_an_area_of_lanes_or_of_a_trace_is_data_whatever_its_value():
    """Zero in one lane is none in the other: nobody may ask a lane, or a node of a
    trace, whether it is zero.
    """
    lanes = np.array([0.0, 0.05])
    force = body_drag(
        BodyDrag(area=Vec3(lanes, lanes, 2.0 * lanes), air_density=1.2), Vec3(*VELOCITY)
    )
    np.testing.assert_allclose(
        np.array(list(force)),
        -4.2 * np.outer([2.0, -3.0, 12.0], lanes),
        rtol=1e-14,
        atol=0,
    )

    def drag(area):
        return body_drag(
            BodyDrag(area=Vec3(area, area, area), air_density=1.2), Vec3(*VELOCITY)
        )

    program = trace(drag, 0.0)
    assert list(program(0.05)) == list(drag(0.05))
    # structure on two axes does not hide the third
    assert list(
        body_drag(BodyDrag(area=Vec3(0, 0, lanes)), Vec3(*VELOCITY)).z < 0.0
    ) == [False, True]
