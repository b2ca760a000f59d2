"""The wanted contact of a reference: its table, and what delays and sums make of it."""

from __future__ import annotations

import numpy as np
import pytest

from skyarm.algebra import Vec3
from skyarm.reference.path_time import by_flight_time
from skyarm.reference.reference_tables import reference_from
from skyarm.reference.task_records import Setting
from skyarm.reference.tip_motion import counted_error
from skyarm.reference.trajectory import Trajectory

PUSH = {
    "force": {"kind": "constant", "value": 2.0, "start": 1.0, "stop": 3.0},
    "normal": [-3.0, 0.0, 4.0],
}


def trajectory(push=PUSH):
    return reference_from(
        {"push": push, "joints": [0.1]}, 1, "reference", Setting(duration=5.0)
    )


def test_force_speed_and_unit_normal_are_told():
    told = trajectory()
    assert told.at(2.0).push == pytest.approx((2.0, 0.1, -0.6, 0.0, 0.8))
    assert told.at(0.5).push[0] == told.at(3.0).push[0] == 0.0
    assert trajectory({**PUSH, "speed": 0.3}).at(0.0).push[1] == 0.3
    assert trajectory({**PUSH, "normal": [-3e-5, 0.0, 4e-5]}).at(
        2.0
    ).push == pytest.approx(told.at(2.0).push)
    assert Trajectory().at(0.0).push == ()
    assert {1.0, 3.0} <= set(told.switch_times())


def test_a_tip_that_grips_may_pull():
    assert trajectory({**PUSH, "force": -5.0, "grip": 1.0}).at(2.0).push[0] == -5.0
    back = {"kind": "sequence", "start": 0.5, "segments": [[1.0, 3.0], [2.0, 0.0]]}
    assert trajectory({**PUSH, "force": back}).at(4.0).push[0] == pytest.approx(
        0.0, abs=1e-6
    )


def test_the_force_waits_and_goes_with_the_motion():
    told, times = trajectory(), np.array([0.9, 1.1, 2.9, 3.1])
    assert [told.shifted(1.0).at(t + 1.0).push[0] for t in times] == [
        0.0,
        2.0,
        2.0,
        0.0,
    ]
    assert (Trajectory() + told).at(2.0).push == told.at(2.0).push
    assert (
        by_flight_time(told.at(2.0), (2.0, 0.5, 0.0, 0.0, 0.0)).push
        == told.at(2.0).push
    )
    with pytest.raises(ValueError, match="each have a push"):
        told + told


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        (
            {"normal": [0.0, 0.0, 0.0]},
            r"reference\.push\.normal = .*must point out of the surface",
        ),
        ({"normal": [1.0, 0.0]}, r"reference\.push\.normal"),
        (
            {"speed": 1e6},
            r"reference\.push\.speed = 1e\+06: must be above 0 and at most 10",
        ),
        (
            {"force": -5.0},
            r"push\.force = -5 N at 0 s: must be at least 0 without grip",
        ),
        (
            {"force": {"kind": "sine", "amplitude": 0.1, "frequency_hz": 1.0}},
            r"push\.force = -0\.1 N at .*without grip",
        ),
        (
            {"force": {"kind": "constant", "value": -1.0, "start": 1.0, "stop": 1.001}},
            r"push\.force = -1 N at 1 s",
        ),
        ({"force": 1e9}, r"push\.force = 1e\+09 N at 0 s: must be at most 10000 N"),
        (
            {"force": -1e9, "grip": 1.0},
            r"push\.force = -1e\+09 N at 0 s: must be at most 10000 N",
        ),
        ({"speed": 0.0}, r"reference\.push\.speed = 0: must be .*above 0"),
        ({"force": "hard"}, r"reference\.push\.force = 'hard'"),
        (
            {"pressure": 1.0},
            (
                r"reference\.push\.pressure.*allowed: normal, force, speed, grip,"
                r" pivot, axis"
            ),
        ),
    ],
)
def test_other_tables_are_refused_in_one_line(changed, message):
    with pytest.raises(ValueError, match=message) as error:
        trajectory({**PUSH, **changed})
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("push", "kept"),
    [
        ((), (0.3, 0.04, 0.2)),
        ((0.0, 0.1, 0.0, 0.0, 1.0), (0.3, 0.04, 0.2)),
        ((1.0, 0.1, 0.0, 0.0, 1.0), (0.3, 0.04, 0.0)),
        ((0.0, 0.1, 0.0, 0.0, 1.0, 0.4), (0.3, 0.04, 0.2)),
        ((0.0, 0.1, 0.0, 0.0, 1.0, 1.0), (0.3, 0.04, 0.0)),
        # out of an upright axis through (0, 0.5, 0) the tip at (1, 0.5, 7) is along x,
        # whatever the normal says
        (
            (0.0, 0.1, 0.0, 1.0, 0.0, 1.0, 0.0, 0.5, 0.0, 0.0, 0.0, 1.0),
            (0.0, 0.04, 0.2),
        ),
        (
            (-2.0, 0.1, 0.0, 1.0, 0.0, 1.0, 0.0, 0.5, 0.0, 0.0, 0.0, 1.0),
            (0.0, 0.04, 0.2),
        ),
        ((1.0, 0.1, 0.0, 1.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 1.0), (0.3, 0.0, 0.2)),
        # on the axis nothing points out of it
        ((1.0, 0.1, 0.0, 1.0, 0.0, 1.0, 1.0, 0.5, 0.0, 0.0, 0.0, 1.0), (0.3, 0.0, 0.2)),
    ],
)
def test_an_error_counts_where_a_place_is_held_and_not_a_force(push, kept):
    found = counted_error(Vec3(0.3, 0.04, 0.2), push, Vec3(1.0, 0.5, 7.0))
    np.testing.assert_allclose([float(c) for c in found], kept, atol=1e-9)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (
            {"base": {"kind": "hover", "position": [0.0, 0.0, 1e308]}},
            r"base\.z = 1e\+308 m at 0 s",
        ),
        (
            {
                "base": {
                    "kind": "signals",
                    "y": {"kind": "sine", "amplitude": 2e7, "frequency_hz": 0.1},
                }
            },
            r"base\.y = ",
        ),
        ({"yaw": -2e7}, r"yaw = -2e\+07 rad at 0 s"),
        (
            {
                "joints": [
                    {"kind": "ramp", "start": 1.0, "duration": 1.0, "height": 1e300}
                ]
            },
            r"joints\[0\] = 1e\+300 at 2 s",
        ),
    ],
)
def test_a_reference_beyond_all_lengths_is_refused(table, message):
    with pytest.raises(
        ValueError, match=rf"^reference\.{message}.*must be at most 1e\+07 in size$"
    ):
        reference_from(
            {"joints": [0.1], **table}, 1, "reference", Setting(duration=5.0)
        )
