"""Phases from tables: what they ask for, when, and one line for what cannot be."""

from __future__ import annotations

import math

import numpy as np
import pytest

from skyarm.records.files import Fields
from skyarm.reference.contact_phases import MOST_TURNS
from skyarm.reference.phases import KINDS, phases_table
from skyarm.reference.reference_tables import reference_from
from skyarm.reference.task_records import Setting
from skyarm.reference.waypoints import MOST_POINTS

START = [0.2, 0.0, 0.8]
PRESS = {"kind": "press", "force": 2.0, "normal": [-2.0, 0.0, 0.0]}
SPIRAL = {"kind": "search", "pitch": 0.002, "radius": 0.006, "pace": 0.01}


def read(*phases):
    setting = Setting(duration=60.0)
    table = {"base": {"kind": "phases", "position": START, "phases": list(phases)}}
    return reference_from(table, 0, "reference", setting), setting


def force_at(trajectory, t):
    return float(trajectory.push.at(t)[0])


def place_at(trajectory, t):
    return np.array([float(c) for c in trajectory.at(t).position])


def test_a_press_asks_waits_and_holds():
    trajectory, _ = read(
        {"kind": "hold", "duration": 1.0}, PRESS | {"duration": 0.5, "speed": 0.2}
    )
    (guard,) = trajectory.guards
    assert (guard.begin, guard.at, guard.phase) == (1.0, 1.05, 1)
    # half the force, for 0.1 s, and it must come
    assert (guard.force, guard.hold, guard.timeout, guard.fails, guard.early) == (
        1.0,
        0.1,
        10.0,
        True,
        False,
    )
    assert guard.direction == (-1.0, 0.0, 0.0)
    assert [(phase.name, phase.end) for phase in trajectory.phases] == [
        ("hold", 1.0),
        ("press", 1.55),
    ]
    # at its end, where the reference may wait, it presses still
    assert [force_at(trajectory, t) for t in (1.0, 1.00001, 1.55, 1.55001)] == [
        0.0,
        2.0,
        2.0,
        0.0,
    ]
    assert trajectory.push.at(1.2)[1:] == (0.2, -1.0, 0.0, 0.0)


def test_a_force_holds_on_until_the_tip_is_in_free_flight_again():
    there = [0.2, 0.1, 0.8]
    slide, retreat = (
        {"kind": "slide", "position": there, "duration": 2.0},
        {
            "kind": "retreat",
            "duration": 0.5,
        },
    )
    trajectory, _ = read(
        PRESS, slide, {"kind": "insert", "distance": 0.01, "force": 3.0}, retreat
    )
    ends = {phase.name: phase.end for phase in trajectory.phases}
    halves = [force_at(trajectory, end - 0.01) for end in ends.values()]
    assert halves == [2.0, 2.0, 3.0, 0.0]
    insert = trajectory.guards[-1]
    assert (insert.distance, insert.fails, insert.phase) == (0.01, True, 2)
    np.testing.assert_allclose(place_at(trajectory, ends["slide"]), there, atol=1e-12)
    with pytest.raises(ValueError, match=r"phases\[2\]\.force: is missing"):
        read(PRESS, {"kind": "hold", "duration": 1.0}, slide)


def test_a_retreat_leaves_along_the_normal():
    """By 5 cm in 1 s, 0.4 s after the force, of where it stands; without a normal or a
    clearance it stays.
    """
    there, turning = (
        [0.2, 0.1, 0.8],
        {
            "kind": "open",
            "angle": 0.5,
            "duration": 2.0,
            "center": [0.2, 0.3, 0.8],
            "axis": [0.0, 0.0, 1.0],
        },
    )
    slide = {"kind": "slide", "position": there, "duration": 2.0}
    for phase, length, seconds in (
        ({}, 0.05, 1.0),
        ({"clearance": 0.2, "duration": 3.0}, 0.2, 3.0),
        ({"clearance": 0.0}, 0.0, 1.0),
        ({"clearance": 0.0, "duration": 0.5}, 0.0, 0.5),
    ):
        trajectory, _ = read(
            PRESS | {"normal": [-3.0, 0.0, 4.0]}, slide, {"kind": "retreat", **phase}
        )
        begin, end = (each.end for each in trajectory.phases[1:])
        wait = 0.4 if length else 0.0
        assert end - begin == pytest.approx(seconds + wait)
        away = place_at(trajectory, end) - there
        np.testing.assert_allclose(
            place_at(trajectory, begin + wait), there, atol=1e-12
        )
        np.testing.assert_allclose(away, [-0.6 * length, 0.0, 0.8 * length], atol=1e-12)
        middle = place_at(trajectory, 0.5 * (begin + wait + end)) - there
        np.testing.assert_allclose(middle, 0.5 * away, atol=1e-12)
        assert force_at(trajectory, end - 0.01) == 0.0
    trajectory, _ = read(turning, {"kind": "retreat"})
    np.testing.assert_array_equal(place_at(trajectory, 2.0), place_at(trajectory, 3.0))
    for wrong in ({"clearance": 0.1}, {"clearance": -0.1}):
        with pytest.raises(ValueError, match=r"phases\[1\]\.clearance = "):
            read(turning, {"kind": "retreat", **wrong})


def test_a_retreat_to_a_place_waits_for_a_force_alone():
    """0.4 s after a press, in which the reference stays; none after anything else."""
    there = [0.1, 0.0, 0.9]
    leave, middle = (
        {"kind": "retreat", "position": there, "duration": 1.0},
        0.5 * (np.array(START) + there),
    )
    trajectory, _ = read(PRESS, leave)
    begin, end = (each.end for each in trajectory.phases)
    assert end - begin == pytest.approx(1.4)
    for t, place in ((begin + 0.4, START), (begin + 0.9, middle), (end, there)):
        np.testing.assert_allclose(place_at(trajectory, t), place, atol=1e-12)
    trajectory, _ = read({"kind": "hold", "duration": 1.0}, leave)
    np.testing.assert_allclose(place_at(trajectory, 1.5), middle, atol=1e-12)


def test_a_retreat_keeps_the_offset_of_a_search_so_that_it_pulls_straight_out():
    trajectory, _ = read(
        PRESS,
        SPIRAL,
        {"kind": "insert", "distance": 0.01},
        {"kind": "retreat"},
        {"kind": "go_to", "position": START},
    )
    assert [phase.back is None for phase in trajectory.phases] == [
        True,
        True,
        True,
        True,
        False,
    ]


def test_a_force_holds_on_while_the_tip_rests_between_two_phases():
    slide = {
        "kind": "slide",
        "position": [0.2, 0.1, 0.8],
        "duration": 2.0,
        "start": 20.0,
        "force": 3.0,
    }
    trajectory, _ = read(
        PRESS,
        slide,
        {"kind": "hold", "duration": 1.0, "start": 30.0},
        PRESS | {"start": 40.0},
    )
    press, first, _, again = (phase.end for phase in trajectory.phases)
    times = (press, press + 0.01, 19.99, 20.01, first, first + 0.01, 29.0, 39.0, again)
    assert [force_at(trajectory, t) for t in times] == [
        2.0,
        2.0,
        2.0,
        3.0,
        3.0,
        0.0,
        0.0,
        0.0,
        2.0,
    ]


def test_joints_do_not_move_in_a_phase_that_may_be_skipped():
    with pytest.raises(
        ValueError,
        match=r"phases\[1\]\.joints: must be left out of a phase that may end early",
    ):
        read(PRESS, SPIRAL | {"joints": {"finger": 0.01}})
    # in the phase after it they may
    with pytest.raises(ValueError, match=r"needs a vehicle"):
        read(
            PRESS, SPIRAL, {"kind": "hold", "duration": 1.0, "joints": {"finger": 0.01}}
        )


def test_a_tip_that_approaches_stands_off_the_surface():
    trajectory, _ = read(
        {
            "kind": "approach",
            "position": [0.5, 0.0, 0.8],
            "normal": [-1, 0, 0],
            "clearance": 0.1,
        },
        PRESS,
    )
    np.testing.assert_allclose(place_at(trajectory, 100.0), [0.4, 0.0, 0.8], atol=1e-12)


def test_a_spiral_stays_across_the_normal_with_its_pitch_and_pace():
    trajectory, _ = read(PRESS, SPIRAL)
    begin, end = (phase.end for phase in trajectory.phases)
    times = np.linspace(begin, end, 201)
    places = np.array([place_at(trajectory, t) for t in times]) - START
    assert np.abs(places[:, 0]).max() < 1e-15
    radius, angle = (
        np.hypot(*places[:, 1:].T),
        np.unwrap(np.arctan2(places[:, 2], places[:, 1])),
    )
    assert radius[-1] == pytest.approx(0.006)
    turns = np.abs(angle - angle[3]) / (2.0 * math.pi)
    np.testing.assert_allclose(
        np.diff(radius)[20:-20] / np.diff(turns)[20:-20], 0.002, rtol=1e-3
    )
    speed = np.linalg.norm(np.diff(places, axis=0), axis=1) / (times[1] - times[0])
    assert np.median(speed) > 0.85 * 0.01
    assert speed.max() < 1.02 * 0.01
    assert end - begin < math.pi * 0.006**2 / 0.002 / 0.01 + 2.5
    guard = trajectory.guards[-1]
    assert (guard.early, guard.fails, guard.at) == (True, True, end)


@pytest.mark.parametrize("radius", [0.0065, 0.0071])
def test_a_slide_leads_from_where_a_spiral_of_any_part_of_a_turn_ends_to_its_place(
    radius,
):
    slide = {"kind": "slide", "position": [0.2, 0.05, 0.8], "duration": 2.0}
    trajectory, _ = read(PRESS, SPIRAL | {"radius": radius}, slide)
    end = trajectory.phases[1].end
    np.testing.assert_allclose(
        place_at(trajectory, end + 1e-6), place_at(trajectory, end - 1e-6), atol=1e-9
    )
    assert np.linalg.norm(place_at(trajectory, end) - START) == pytest.approx(radius)
    np.testing.assert_allclose(
        place_at(trajectory, 50.0), slide["position"], atol=1e-12
    )


def test_a_turn_goes_about_its_axis_the_right_way():
    turn = {
        "kind": "turn",
        "center": [0.2, 0.3, 0.5],
        "axis": [0, 0, 2],
        "angle": math.pi / 2,
        "duration": 2.0,
    }
    trajectory, _ = read(turn)
    # from 0.3 m on the -y side of the axis, counter-clockwise from above: to its +x
    # side
    np.testing.assert_allclose(place_at(trajectory, 2.0), [0.5, 0.3, 0.8], atol=1e-12)
    np.testing.assert_allclose(place_at(trajectory, 9.0), [0.5, 0.3, 0.8], atol=1e-12)
    middle = place_at(trajectory, 1.0)
    np.testing.assert_allclose(
        middle,
        [0.2 + 0.3 * math.sqrt(0.5), 0.3 - 0.3 * math.sqrt(0.5), 0.8],
        atol=1e-12,
    )
    h = 1e-4
    slope = (place_at(trajectory, 0.7 + h) - place_at(trajectory, 0.7 - h)) / (2 * h)
    np.testing.assert_allclose(
        [float(c) for c in trajectory.at(0.7).velocity], slope, rtol=1e-6, atol=1e-9
    )
    assert trajectory.push is None


def test_what_is_written_is_at_rest_in_each_corner():
    corners = [[0.2, 0.1, 0.8], [0.2, 0.1, 0.9], [0.2, 0.0, 0.9]]
    trajectory, _ = read(PRESS, {"kind": "write", "points": corners, "duration": 6.0})
    begin, end = (phase.end for phase in trajectory.phases)
    assert end - begin == pytest.approx(6.0)
    for k, corner in enumerate(corners, 1):
        sample = trajectory.at(begin + 2.0 * k)
        np.testing.assert_allclose(
            [float(c) for c in sample.position], corner, atol=1e-9
        )
        np.testing.assert_allclose([float(c) for c in sample.velocity], 0.0, atol=1e-9)


def test_the_phase_after_one_that_ends_early_takes_the_reference_back():
    back = {"kind": "go_to", "position": [0.0, 0.0, 1.0]}
    trajectory, _ = read(
        PRESS,
        SPIRAL,
        {"kind": "slide", "position": [0.2, 0.1, 0.8]},
        back,
        back | {"position": START},
    )
    ends = [phase.end for phase in trajectory.phases]
    assert trajectory.returns == ((ends[2], ends[3]),)
    # without a motion it has a second of its own
    early = {"kind": "hold", "duration": 1.0, "until": {"error": 1.0, "early": True}}
    trajectory, _ = read(PRESS, early, {"kind": "retreat", "position": START})
    begin, end = trajectory.returns[0]
    assert end - begin == pytest.approx(1.0)


def test_lift_carry_grasp_and_release():
    trajectory, setting = read(
        {"kind": "grasp", "payload": "box", "dwell": 0.4},
        {"kind": "lift", "height": 0.3},
        {"kind": "carry", "position": [0.5, 0.0, 1.1], "duration": 2.0},
        {"kind": "release", "payload": "box"},
    )
    assert [(event.kind, event.payload) for event in setting.events] == [
        ("pick", "box"),
        ("place", "box"),
    ]
    assert setting.events[0].time == pytest.approx(0.2)
    np.testing.assert_allclose(place_at(trajectory, 100.0), [0.5, 0.0, 1.1], atol=1e-12)


def test_a_payload_is_left_along_the_way_of_the_approach():
    there, approach = [1.0, 0.2, 0.6], [0.05, -0.03, 0.2]
    trajectory, _ = read(
        {
            "kind": "pick",
            "payload": "box",
            "position": there,
            "approach": approach,
            "dwell": 0.4,
        }
    )
    np.testing.assert_allclose(
        place_at(trajectory, 100.0), np.add(there, approach), atol=1e-12
    )


GUARD = {"kind": "hold", "duration": 1.0}


@pytest.mark.parametrize(
    ("phases", "message"),
    [
        ([{"kind": "pres"}], "phases[0].kind = 'pres': did you mean 'press'?"),
        (
            [{"kind": "press", "force": 1.0}],
            "phases[0].normal: is missing; must be a vector out of the surface",
        ),
        ([PRESS | {"force": -1.0}], "phases[0].force = -1.0: must be above 0"),
        (
            [PRESS | {"force": math.nan}],
            "phases[0].force = nan: must be a finite number",
        ),
        (
            [PRESS | {"normal": [0, 0, 0]}],
            "phases[0].normal = [0.0, 0.0, 0.0]: must be a vector that points",
        ),
        ([PRESS | {"normal": [1e300, 0, 0]}], "must be a vector that points somewhere"),
        (
            [PRESS, PRESS | {"normal": [0, 0, 1]}],
            "phases[1].normal = [0.0, 0.0, 1.0]: must be the same in all",
        ),
        (
            [PRESS | {"speed": 0.1}, PRESS | {"speed": 0.2}],
            "phases[1].speed = 0.2: must be the same in all",
        ),
        ([PRESS | {"duration": 0}], "phases[0].duration = 0: must be from 0.001"),
        (
            [PRESS, SPIRAL | {"pitch": 1e-9}],
            "phases[1].pitch = 1e-09: must be at least 0.00015 for its radius",
        ),
        ([PRESS, {"kind": "insert"}], "phases[1].distance: is missing"),
        (
            [PRESS, {"kind": "slide", "position": START}],
            "[1].position = [0.2, 0.0, 0.8]: must be 0.001 m or more",
        ),
        (
            [PRESS, {"kind": "write", "points": []}],
            "phases[1].points = []: must be 1 to",
        ),
        (
            [PRESS, {"kind": "write", "points": [START]}],
            (
                "[1].points[0] = [0.2, 0.0, 0.8]: must be 0.001 m or more "
                "from where the task is already"
            ),
        ),
        (
            [PRESS, {"kind": "write", "points": [[0, 0, 1], [0, 0, 1]]}],
            (
                "points[1] = [0.0, 0.0, 1.0]: must be 0.001 m "
                "or more from the point before"
            ),
        ),
        (
            [{"kind": "go_to", "via": [START], "position": [0, 0, 1]}],
            "phases[0].via[0] = [0.2, 0.0, 0.8]: must be 0.0",
        ),
        (
            [{"kind": "go_to", "via": [[0, 0, 1]], "position": [0, 0, 1]}],
            "phases[0].position = [0.0, 0.0, 1.0]: must",
        ),
        (
            [{"kind": "lift", "height": 0}],
            "phases[0].height = 0: must be 0.001 m or more, up or down",
        ),
        ([PRESS | {"force": 1e9}], "phases[0].force = 1e+09: must be from 0 to 10000"),
        ([PRESS | {"speed": 1e6}], "phases[0].speed = 1e+06: must be from 0 to 10"),
        (
            [
                {
                    "kind": "turn",
                    "center": START,
                    "axis": [1, 0, 0],
                    "angle": 1.0,
                    "duration": 1,
                }
            ],
            "beside which the tip",
        ),
        (
            [
                {
                    "kind": "turn",
                    "center": [0, 0, 0],
                    "axis": [1, 0, 0],
                    "angle": 0,
                    "duration": 1,
                }
            ],
            "angle = 0: must",
        ),
        (
            [{"kind": "approach", "position": START, "clearance": 0.1}],
            "clearance = 0.1: must be left out without",
        ),
        (
            [GUARD | {"until": {}}],
            (
                "phases[0].until = {}: must have one of error, force, force_below,"
                " distance"
            ),
        ),
        ([GUARD | {"until": 3}], "phases[0].until = 3: must be a table"),
        (
            [GUARD | {"until": {"force": 1.0}}],
            "phases[0].until.direction: is missing; must be a vector out of",
        ),
        (
            [GUARD | {"until": {"error": 0.0}}],
            "phases[0].until.error = 0.0: must be above 0",
        ),
        (
            [GUARD | {"until": {"error": 0.1, "timeout": math.inf}}],
            "until.timeout = inf: must be a finite number",
        ),
        (
            [GUARD | {"until": {"error": 0.1, "on_timeout": "stop"}}],
            "on_timeout = 'stop': must be one of go_on, fail",
        ),
        (
            [GUARD | {"until": {"error": 0.1, "early": 1}}],
            "phases[0].until.early = 1: must be true or false",
        ),
        (
            [GUARD | {"until": {"eror": 0.1}}],
            "phases[0].until.eror = 0.1: unknown field; did you mean 'error'?",
        ),
        (
            [PRESS | {"until": {"force": 1.0, "force_below": 0.5}}],
            "until.force_below = 0.5: must be above force",
        ),
        (
            [{"kind": "grasp", "payload": ""}],
            "phases[0].payload = '': must be the name of a payload",
        ),
    ],
)
def test_a_phase_that_cannot_be_gets_one_line(phases, message):
    with pytest.raises(ValueError) as caught:  # noqa: PT011
        read(*phases)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_push_of_its_own_stands_nowhere_beside_phases_that_press():
    table = {"base": {"kind": "phases", "position": START, "phases": [PRESS]}}
    push = {"force": 1.0, "normal": [0, 0, 1]}
    with pytest.raises(
        ValueError, match=r"^reference\.push: must be left out beside phases that press"
    ):
        reference_from(table | {"push": push}, 0, "reference", Setting())
    two = {"base": [table["base"], table["base"]]}
    with pytest.raises(
        ValueError, match="two tasks whose phases press or grip do not add"
    ):
        reference_from(two, 0, "reference", Setting())


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_whatever_a_phase_holds_the_answer_is_one_line(kind):
    junk = (
        None,
        True,
        -1.0,
        1e308,
        math.nan,
        "x",
        [],
        [1.0, 2.0, math.inf],
        {},
        [[0, 0, 1]],
    )
    for name in (
        "position",
        "duration",
        "force",
        "normal",
        "until",
        "points",
        "payload",
        "angle",
        "pitch",
        "height",
    ):
        for value in junk:
            fields = Fields(
                {"position": START, "phases": [PRESS, {"kind": kind, name: value}]}, "x"
            )
            try:
                phases_table(fields, Setting(duration=9.0))
            except ValueError as error:
                assert "\n" not in str(error)


def test_the_most_points_and_the_narrowest_spiral_are_let_pass():
    zigzag = [[0.2, 0.002 * (1 + i), 0.8] for i in range(MOST_POINTS)]
    trajectory, _ = read(PRESS, {"kind": "write", "points": zigzag})
    np.testing.assert_allclose(
        place_at(trajectory, trajectory.phases[-1].end), zigzag[-1], atol=1e-9
    )
    with pytest.raises(
        ValueError,
        match=rf"points = {MOST_POINTS + 1} points: must be 1 to {MOST_POINTS} points",
    ):
        read(PRESS, {"kind": "write", "points": [*zigzag, START]})
    narrow = SPIRAL | {
        "pitch": 0.25 * SPIRAL["pitch"],
        "radius": MOST_TURNS * 0.25 * SPIRAL["pitch"],
    }
    read(PRESS, narrow)
    with pytest.raises(ValueError, match=r"phases\[1\]\.pitch = .*: must be at least"):
        read(PRESS, narrow | {"radius": 1.001 * narrow["radius"]})
