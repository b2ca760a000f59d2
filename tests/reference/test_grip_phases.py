"""Phases that take a handle: from when to when the tip grips, about which axis, and one
line for what cannot be.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from skyarm.reference.reference_tables import reference_from
from skyarm.reference.task_records import Setting

START = [0.6, 0.0, 1.2]
GRASP = {"kind": "grasp", "gripper": "hand", "dwell": 1.0}
DOOR = GRASP | {"center": [0.6, -0.8, 1.0]}
OPEN = {"kind": "open", "angle": 1.0, "duration": 4.0}
RELEASE = {"kind": "release", "gripper": "hand", "dwell": 0.6}
PRESS = {"kind": "press", "force": 2.0, "normal": [-2.0, 0.0, 0.0]}


def read(*phases):
    table = {"base": {"kind": "phases", "position": START, "phases": list(phases)}}
    return reference_from(table, 0, "reference", Setting(duration=60.0))


def push_at(trajectory, t):
    return [float(c) for c in trajectory.push.at(t)]


def test_a_handle_is_held_from_the_closing_of_the_gripper_to_its_opening():
    found = read(
        {"kind": "hold", "duration": 1.0},
        DOOR | {"force": -0.5},
        OPEN,
        RELEASE,
        {"kind": "retreat"},
    )
    # the gripper closes half-way through a dwell of 1 s from 1 s on, and opens half-way
    # through 0.6 s from 6 s on
    grips = [push_at(found, t)[5] for t in (0.5, 1.499, 1.5, 5.0, 6.299, 6.3, 7.0)]
    assert grips == [0.0, 0.0, 1.0, 1.0, 1.0, 0.0, 0.0]
    assert [push_at(found, t)[0] for t in (1.4, 1.6, 6.2, 6.4)] == [
        0.0,
        -0.5,
        -0.5,
        0.0,
    ]
    pivot, axis, normal = (
        push_at(found, 2.0)[6:9],
        push_at(found, 2.0)[9:],
        push_at(found, 0.0)[2:5],
    )
    assert (pivot, axis, normal) == ([0.6, -0.8, 1.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0])


def test_what_is_held_goes_about_its_own_axis():
    found = read(DOOR, OPEN)
    places = np.array(
        [[float(c) for c in found.at(t).position] for t in (0.0, 5.0, 9.0)]
    )
    turned = [0.6 - 0.8 * math.sin(1.0), -0.8 + 0.8 * math.cos(1.0), 1.2]
    np.testing.assert_allclose(places, [START, turned, turned], atol=1e-12)
    assert push_at(found, 1e4)[5] == 1.0, "nothing lets it go"
    other = read(DOOR | {"axis": [0.0, 0.0, -3.0]}, OPEN)
    assert float(other.at(9.0).position.x) == pytest.approx(0.6 + 0.8 * math.sin(1.0))


def test_a_move_after_a_turn_ends_where_it_is_told():
    found = read(
        DOOR,
        OPEN,
        RELEASE,
        {"kind": "go_to", "position": [0.2, 0.1, 1.5], "duration": 2.0},
    )
    turned = [0.6 - 0.8 * math.sin(1.0), -0.8 + 0.8 * math.cos(1.0), 1.2]
    places = np.array([[float(c) for c in found.at(t).position] for t in (5.5, 60.0)])
    np.testing.assert_allclose(places, [turned, [0.2, 0.1, 1.5]], atol=1e-12)


def test_a_grip_stands_beside_a_push_and_comes_again():
    found = read(DOOR, OPEN, RELEASE, PRESS, GRASP | DOOR, OPEN | {"angle": -1.0})
    ends = [phase.end for phase in found.phases]
    assert push_at(found, ends[3] - 0.01)[:6] == [2.0, 0.1, -1.0, 0.0, 0.0, 0.0]
    assert [push_at(found, ends[4] + d)[5] for d in (-0.6, -0.4)] == [0.0, 1.0]


def test_a_gripper_without_an_arc_asks_for_no_contact():
    assert read(GRASP, {"kind": "lift", "height": 0.1}, RELEASE).push is None


@pytest.mark.parametrize(
    ("phases", "words"),
    [
        (
            [GRASP | {"axis": [0, 0, 1]}],
            "phases[0].axis: must be left out without center",
        ),
        ([GRASP | {"force": 1.0}], "phases[0].force: must be left out without center"),
        (
            [{"kind": "grasp", "payload": "box", "center": [0, 0, 0]}],
            "phases[0].center: must be left out without grip",
        ),
        (
            [DOOR | {"center": [0.6, 0.0, 9.0]}],
            "phases[0].center = [0.6, 0.0, 9.0]: must be a place beside which",
        ),
        ([DOOR | {"axis": [0, 0, 0]}], "phases[0].axis"),
        ([DOOR | {"force": 2e4}], "phases[0].force = 20000: must be from"),
        ([DOOR | {"force": float("nan")}], "phases[0].force"),
        (
            [DOOR, OPEN | {"center": [0.6, -0.7, 1.0]}],
            "phases[1].center = [0.6, -0.7, 1.0]: must be left out, or as",
        ),
        (
            [DOOR, OPEN | {"axis": [1, 0, 0]}],
            "phases[1].axis = [1.0, 0.0, 0.0]: must be left out, or as",
        ),
        (
            [DOOR, OPEN | {"force": 1.0}],
            "phases[1].force = 1.0: must not press while a handle is held",
        ),
        (
            [DOOR, PRESS],
            "phases[1].kind = 'press': must not press while a handle is held",
        ),
        (
            [DOOR, RELEASE, DOOR | {"center": [0.5, -0.8, 1.0]}],
            "phases[2].center: a task goes about one axis only",
        ),
        ([RELEASE | {"center": [0, 0, 0]}], "center"),
        ([OPEN], "phases[0].center"),
    ],
)
def test_handles_that_cannot_be_get_one_line(phases, words):
    with pytest.raises(ValueError, match=r"^(reference.)?") as caught:
        read(*phases)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)
