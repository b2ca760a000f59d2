"""A reference that names nothing is one that stands at the origin: as is that of a
trajectory without signals.
"""

from __future__ import annotations

import dataclasses

import pytest

from skyarm.algebra import Vec3
from skyarm.reference import Reference, Trajectory


@pytest.mark.parametrize(
    "reference",
    [Reference(), Trajectory().at(0.7), Reference().dense()],
    ids=["record", "signals", "data"],
)
def test_what_is_not_named_is_zero(reference):
    for field in dataclasses.fields(reference):
        value = getattr(reference, field.name)
        parts = [*value] if isinstance(value, (Vec3, tuple)) else [value]
        assert [float(part) for part in parts] == [0.0] * len(parts), field.name


def test_what_is_not_named_is_structure_so_that_it_folds():
    assert all(
        type(getattr(Reference(), name)) is int
        for name in ("yaw", "yaw_rate", "yaw_acceleration")
    )
    assert all(type(part) is int for part in (*Reference().position, *Reference().snap))
