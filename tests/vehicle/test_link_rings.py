"""Links that form a ring are told as the ring they form, whoever hangs on it, in files
of either kind.
"""

from __future__ import annotations

import re

import pytest

from skyarm.vehicle.check import VehicleError
from skyarm.vehicle.description import tree_order


@pytest.mark.parametrize(
    ("parents", "ring"),
    [
        ({"a": "a"}, "a -> a"),
        ({"a": "b", "b": "a"}, "a -> b -> a"),
        ({"a": "b", "b": "c", "c": "a"}, "a -> b -> c -> a"),
        ({"a": "b", "b": "c", "c": "d", "d": "a"}, "a -> b -> c -> d -> a"),
        # two links hang on the ring, the walk begins with them
        ({"x": "y", "y": "a", "a": "b", "b": "c", "c": "a"}, "a -> b -> c -> a"),
        ({"good": "base", "x": "b", "a": "b", "b": "c", "c": "a"}, "b -> c -> a -> b"),
    ],
)
def test_a_ring_is_told_link_by_link_and_without_its_tail(parents, ring):
    first, second = ring.split(" -> ")[:2]
    message = (
        f"parent of {first} = '{second}': closed chains are not supported ({ring})"
    )
    with pytest.raises(VehicleError, match=re.escape(message)):
        tree_order(parents, "base", "parent of {}")


def test_a_tree_in_any_order_is_sorted_parents_first_and_else_as_given():
    parents = {
        "hand": "wrist",
        "wrist": "arm",
        "camera": "base",
        "arm": "base",
        "finger": "hand",
    }
    assert tree_order(parents, "base", "{}") == [
        "camera",
        "arm",
        "wrist",
        "hand",
        "finger",
    ]
