"""Offset of a path: which phases take it back."""

from __future__ import annotations

import pytest

from skyarm.algebra import Vec3
from skyarm.reference.path_time import offset_reference
from skyarm.reference.trajectory import Reference

PLAN = Reference(position=Vec3(1.0, 2.0, 3.0), joints=())


@pytest.mark.parametrize(
    ("since", "left"),
    [(0.1, 0.0), (0.2, 0.0), (0.2 + 1e-12, 0.0), (0.201, 1.0), (0.3, 1.0), (0.5, 1.0)],
    ids=[
        "before",
        "as the phase begins",
        "then, but for rounding",
        "just after",
        "within",
        "after",
    ],
)
def test_a_phase_takes_back_what_began_before_it_and_nothing_else(since, left):
    moved = offset_reference(PLAN, Vec3(0.2, -0.1, 0.4), ((0.2, 0.4),), since, 0.45)
    assert [*(moved.position - PLAN.position)] == pytest.approx(
        [0.2 * left, -0.1 * left, 0.4 * left], abs=1e-12
    )


def test_rates_of_what_is_taken_back_are_those_of_its_position():
    def position(time):
        return offset_reference(
            PLAN, Vec3(0.2, 0.0, 0.0), ((0.2, 0.4),), 0.1, time
        ).position.x

    at, h = 0.27, 1e-5
    moved = offset_reference(PLAN, Vec3(0.2, 0.0, 0.0), ((0.2, 0.4),), 0.1, at)
    assert moved.velocity.x == pytest.approx(
        (position(at + h) - position(at - h)) / (2 * h), rel=1e-6
    )
    assert moved.acceleration.x == pytest.approx(
        (position(at + h) - 2 * position(at) + position(at - h)) / h**2, rel=1e-4
    )
