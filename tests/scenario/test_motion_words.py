"""Which words lead to the numbers of a base's motion: those of the kind it is, told by
all of its axes.
"""

from __future__ import annotations

import dataclasses

import pytest

from skyarm.records.leaves import part
from skyarm.records.path_names import path_names
from skyarm.reference import Constant, Sine, Sum, Trajectory, circle, hover

CIRCLE = circle(
    center=(0.1, 0.2, 1.5), radius=0.4, frequency_hz=0.3, start=1.0, stop=9.0
)
HOVER = hover((0.1, 0.2, 1.5))
SWING = Sine(amplitude=0.2, frequency_hz=0.5)
ROUND = {"radius", "frequency_hz", "center", "start", "stop"}
AXES = {"x", "y", "z"}


def words(motion):
    return set(path_names(motion)["base"])


def listed(signal):
    """A signal as a list of motions is read: added to one that rests at zero."""
    return Sum((Constant(0.0), signal))


def test_a_circle_is_told_by_both_of_its_axes():
    assert words(CIRCLE) == AXES | ROUND
    for axis in "xy":
        for other in (SWING, Constant(0.1), CIRCLE.z):
            assert words(dataclasses.replace(CIRCLE, **{axis: other})) == AXES
    # its height may do what it likes
    assert words(dataclasses.replace(CIRCLE, z=SWING)) == AXES | ROUND


@pytest.mark.parametrize("axis", "xyz")
def test_a_place_to_hover_at_is_told_by_three_axes_that_rest(axis):
    assert words(HOVER) == AXES | {"position"}
    assert words(dataclasses.replace(HOVER, **{axis: SWING})) == AXES


@pytest.mark.parametrize("axis", "xyz")
def test_a_list_of_motions_is_told_by_three_lists(axis):
    lists = Trajectory(
        x=listed(SWING),
        y=listed(Constant(0.3)),
        z=listed(Constant(1.0)),
        yaw=Constant(0.0),
        joints=(),
    )
    assert words(lists) == {"0"}
    assert words(dataclasses.replace(lists, **{axis: Constant(2.0)})) == AXES


def leaf(motion, *path):
    found = path_names(motion)["base"]
    for name in path:
        found = found[name]
    return {part(motion, place) for place in found}


def test_every_word_of_a_circle_leads_to_its_number():
    assert leaf(CIRCLE, "radius") == {0.4}
    assert leaf(CIRCLE, "frequency_hz") == {0.3}
    assert leaf(CIRCLE, "start") == {1.0}
    assert leaf(CIRCLE, "stop") == {9.0}
    assert [leaf(CIRCLE, "center", axis) for axis in "xyz"] == [{0.1}, {0.2}, {1.5}]
    assert [leaf(HOVER, "position", axis) for axis in "xyz"] == [{0.1}, {0.2}, {1.5}]
