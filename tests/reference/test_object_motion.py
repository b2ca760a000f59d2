"""The desired pose of a carried body is smooth, and places on it move as on a rigid
body.
"""

from __future__ import annotations

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from skyarm.algebra import Vec3
from skyarm.records.files import Fields
from skyarm.reference.object_motion import motion_of_object
from skyarm.reference.signals import Constant, Ramp

PHASES = [
    {"kind": "hold", "duration": 1.0},
    {"kind": "lift", "height": 0.4, "duration": 1.5},
    {"kind": "carry", "by": [1.0, -0.5, 0.1], "duration": 2.0},
    {"kind": "turn", "angle": 1.2, "duration": 2.0},
    {"kind": "tilt", "pitch": 0.3, "roll": -0.2, "duration": 1.0},
    {"kind": "turn", "angle": -0.4, "duration": 1.0},
    {"kind": "place", "duration": 2.0},
]


def motion(phases=PHASES, **table):
    return motion_of_object(
        Fields({"phases": phases, **table}, "reference.object"), Vec3(0.2, 0.1, 0.3)
    )


def pose(t, phases=PHASES):
    """Pose by the phases alone, with the blend as the normalised integral of u^4 (1 -
    u)^4.
    """
    blend = (np.poly1d([1, 0, 0, 0, 0]) * np.poly1d([-1, 1]) ** 4).integ()
    p, angles, time = np.array([0.2, 0.1, 0.3]), np.zeros(3), 0.0
    for each in phases:
        u = np.clip((t - time) / each["duration"], 0.0, 1.0)
        s, kind = blend(u) / blend(1.0), each["kind"]
        if kind == "lift":
            p = p + s * np.array([0.0, 0.0, each["height"]])
        elif kind == "carry":
            p = p + s * np.array(each["by"])
        elif kind == "turn":
            angles = angles + s * np.array([0.0, 0.0, each["angle"]])
        elif kind == "tilt":
            angles = angles + s * (
                np.array([each["roll"], each["pitch"], angles[2]]) - angles
            )
        elif kind == "place":
            p = p + s * np.array([0.0, 0.0, 0.3 - p[2]])
            angles = angles * np.array([1.0 - s, 1.0 - s, 1.0])
        time += each["duration"]
    return p, Rotation.from_euler("ZYX", angles[::-1])


TIMES = [0.5, 1.7, 2.9, 5.2, 7.1, 8.3, 9.4, 11.0]


def test_a_nonic_ramp_has_its_derivatives_and_is_smooth_to_the_fourth():
    ramp, h = Ramp(start=1.0, duration=2.0, height=3.0, shape="nonic"), 1e-4
    assert np.allclose([*ramp.derivatives(1.0)], 0.0, atol=1e-12)
    assert np.allclose(
        [*ramp.derivatives(3.0 - 1e-12)], [3.0, 0.0, 0.0, 0.0, 0.0], atol=1e-8
    )
    for t in (1.3, 2.1, 2.6):
        before, after, here = (np.array(ramp.derivatives(t + s)) for s in (-h, h, 0.0))
        assert np.allclose(
            (after - before)[:4] / (2.0 * h), here[1:], rtol=1e-6, atol=1e-5
        )


@pytest.mark.parametrize("t", TIMES)
def test_the_pose_is_that_of_the_phases(t):
    p, R = pose(t)
    at = motion().at(t)
    assert np.allclose([*at.position], p, atol=1e-12)
    assert np.allclose([[*row] for row in at.R.rows], R.as_matrix(), atol=1e-12)


@pytest.mark.parametrize("t", TIMES)
def test_rates_are_those_of_the_pose(t):
    h, at = 1e-4, motion().at(t)
    (p0, R0), (p1, R1), (p2, R2) = pose(t - h), pose(t), pose(t + h)
    assert np.allclose([*at.velocity], (p2 - p0) / (2.0 * h), atol=1e-6)
    assert np.allclose([*at.acceleration], (p2 - 2.0 * p1 + p0) / (h * h), atol=1e-5)
    early, late = (R1 * R0.inv()).as_rotvec() / h, (R2 * R1.inv()).as_rotvec() / h
    assert np.allclose([*at.rate], 0.5 * (early + late), atol=1e-6)
    assert np.allclose([*at.turning], (late - early) / h, atol=1e-4)


@pytest.mark.parametrize("t", TIMES)
def test_a_place_moves_with_the_body_and_may_move_on_it(t):
    place = (
        Constant(-0.5),
        Ramp(start=2.0, duration=4.0, height=0.2, shape="nonic"),
        Constant(0.02),
    )

    def point(time):
        p, R = pose(time)
        return p + R.apply([float(each.derivatives(time)[0]) for each in place])

    h = 1e-4
    rows = np.array([each.derivatives(t) for each in motion().path_of(place)])
    assert np.allclose(rows[:, 0], point(t), atol=1e-12)
    assert np.allclose(rows[:, 1], (point(t + h) - point(t - h)) / (2.0 * h), atol=1e-6)
    fine = np.array(
        [
            [each.derivatives(t + s)[1:4] for s in (-h, h)]
            for each in motion().path_of(place)
        ]
    )
    assert np.allclose(rows[:, 2:], (fine[:, 1] - fine[:, 0]) / (2.0 * h), atol=1e-4)


def test_it_says_when_the_body_leaves_its_support_and_stands_again():
    whole = motion()
    assert (whole.lift, whole.stop) == (1.0, 10.5)
    assert motion(PHASES[:3]).stop > 1e6  # it is never set down
    assert motion(PHASES[1:]).lift == 0.0  # it hangs from the start


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"phases": []}, "phases = []: must be a list of phases"),
        (
            {"phases": [{"kind": "fly", "duration": 1.0}]},
            "phases[0].kind = 'fly': must be one of",
        ),
        (
            {"phases": [{"kind": "lift", "height": 1.0, "duration": 0.0}]},
            "phases[0].duration = 0.0: must be above 0",
        ),
        (
            {"phases": PHASES[:1]},
            "phases: must have a phase of kind 'lift' after one of kind 'hold'",
        ),
        (
            {"phases": [{"kind": "hold", "duration": 1.0, "height": 1.0}]},
            "phases[0].height",
        ),
        ({"phases": PHASES, "posture": 1.0}, "posture"),
    ],
)
def test_a_wrong_table_is_refused_in_one_line(table, words):
    with pytest.raises(ValueError, match=r"reference\.object") as refused:
        motion_of_object(Fields(table, "reference.object"), Vec3(0.0, 0.0, 0.0))
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("kinds", "message"),
    [
        (
            ("hold", "place", "lift"),
            "phases[1].kind = 'place': must come after a phase of kind 'lift'",
        ),
        (
            ("hold", "lift", "place", "lift"),
            "phases[3].kind = 'lift': must be 'hold', after a phase of kind 'place'",
        ),
        (
            ("hold", "lift", "place", "carry"),
            "phases[3].kind = 'carry': must be 'hold', after a phase of kind 'place'",
        ),
    ],
)
def test_phases_in_an_order_that_nobody_can_carry_are_refused(kinds, message):
    numbers = {"lift": {"height": 0.5}, "carry": {"by": [1.0, 0.0, 0.0]}}
    phases = [
        {"kind": kind, "duration": 1.0, **numbers.get(kind, {})} for kind in kinds
    ]
    with pytest.raises(ValueError, match=re.escape(message)):
        motion_of_object(Fields({"phases": phases}, ""), Vec3(0.0, 0.0, 0.0))


def test_a_lift_has_a_height_above_zero():
    phases = [{"kind": "lift", "height": 0.0, "duration": 1.0}]
    with pytest.raises(ValueError, match=r"phases\[0\]\.height = 0.*: must be above 0"):
        motion_of_object(Fields({"phases": phases}, ""), Vec3(0.0, 0.0, 0.0))
