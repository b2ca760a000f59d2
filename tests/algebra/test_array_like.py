"""Vectors, quaternions and matrices as arrays: numbers out, NumPy's scalars in, nothing
of a traced one.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from skyarm.algebra import Mat3, Quaternion, Vec3
from skyarm.compile import trace

V, Q = Vec3(1.0, -2.0, 3.0), Quaternion(0.5, -0.5, 0.5, -0.5)
M = Mat3(Vec3(1.0, 2.0, 3.0), Vec3(4.0, 5.0, 6.0), Vec3(7.0, 8.0, 10.0))


@pytest.mark.parametrize(
    ("of", "numbers"),
    [
        (V, [1.0, -2.0, 3.0]),
        (Q, [0.5, -0.5, 0.5, -0.5]),
        (M, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 10.0]]),
    ],
    ids=["vector", "quaternion", "matrix"],
)
def test_an_array_of_it_has_its_numbers(of: Any, numbers: Any) -> None:
    found = np.array(of)
    assert found.dtype == float
    assert found.tolist() == numbers
    assert np.array(of, dtype=np.float32).dtype == np.float32
    assert np.asarray(of).shape == np.shape(numbers)
    assert len(of) == len(numbers)
    with pytest.raises(ValueError, match="an array of them is a copy"):
        np.array(of, copy=False)


def test_parts_are_named_by_number_and_slice() -> None:
    assert (V[0], V[-1], V[:2], V[::-1]) == (1.0, 3.0, (1.0, -2.0), (3.0, -2.0, 1.0))
    assert (Q[0], Q[1:]) == (0.5, (-0.5, 0.5, -0.5))
    assert np.array(M[1]).tolist() == [4.0, 5.0, 6.0]
    assert [np.array(row).tolist() for row in M[:2]] == [
        [1.0, 2.0, 3.0],
        [4.0, 5.0, 6.0],
    ]
    with pytest.raises(IndexError):
        V[3]


@pytest.mark.parametrize("kind", [np.float64, np.float32, np.int64])
def test_a_numpy_number_times_it_is_still_one(kind: Any) -> None:
    for product in (kind(2) * V, V * kind(2)):
        assert type(product) is Vec3
        assert np.array(product).tolist() == [2.0, -4.0, 6.0]
    for scaled in (kind(2) * M, M * kind(2)):
        assert type(scaled) is Mat3
        assert np.array(scaled)[2, 2] == 20.0


def test_an_array_of_numbers_in_each_component_is_an_array_behind() -> None:
    batch = Vec3(np.zeros(5), np.ones(5), np.full(5, 2.0))
    assert np.array(batch).shape == (3, 5)
    assert type(np.linspace(0.0, 1.0, 5) * batch) is Vec3


def test_vectors_do_not_mix_with_arrays_silently() -> None:
    with pytest.raises((TypeError, AttributeError)):
        np.ones(3) + V


@pytest.mark.parametrize(
    "make", [lambda v: v, lambda v: Quaternion(1.0, *v), lambda v: Mat3(v, v, v)]
)
def test_an_array_of_a_traced_one_is_refused_in_one_line(make: Any) -> None:
    def function(v: Vec3) -> Vec3:
        return Vec3(*np.array(make(v)).flat[:3])

    with pytest.raises(
        TypeError,
        match=(
            r"^(Vec3|Quaternion|Mat3) of Node: has no values yet, so that no array can"
            r" be made of it$"
        ),
    ):
        trace(function, V)
