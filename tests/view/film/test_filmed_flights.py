"""What a film reads of a log: instants, places between two of them, the desired pose,
names, the end of a flight.
"""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace
from typing import Any, get_args

import numpy as np
import pytest

from skyarm import run, scenario_from
from skyarm.log.tip_positions import level_tip
from skyarm.view.film.camera_paths import CAMERAS
from skyarm.view.film.captions import Box, frame_layout
from skyarm.view.film.filmed_flight import film_flights, flight_labels
from skyarm.view.film.make_film import (
    Camera,
    FilmSettings,
    _seen_box,
    film_panels,
    frame_times,
    size_of,
)
from skyarm.view.picture.marks import (
    GHOST,
    TRAIL,
    desired_path,
    ghost_solids,
    marks_of,
    vehicle_solids,
    wind_arrow,
    wind_words,
)
from skyarm.view.picture.mujoco_sink import FIELD_OF_VIEW
from support.pictures import SECONDS, flight


def test_frames_are_the_instants_that_speed_and_rate_say() -> None:
    log = flight()
    times = frame_times([log], FilmSettings(fps=20))
    np.testing.assert_allclose(times, np.arange(20) / 20)
    slow = frame_times([log], FilmSettings(fps=20, speed=0.5, start=0.2, stop=0.7))
    np.testing.assert_allclose(slow, 0.2 + np.arange(20) / 40)
    with pytest.raises(
        ValueError,
        match=r"start = 5: must leave at least one frame before the end, 1 s",
    ):
        frame_times([log], FilmSettings(start=5.0))


def test_a_log_is_read_at_its_own_instants_as_it_is_and_between_them_linearly() -> None:
    log = flight()
    filmed = film_flights([log], log.time)[0]
    for mine, theirs in (
        (filmed.position, log.position),
        (filmed.joints, log.joints),
        (filmed.tip, log.tip),
    ):
        np.testing.assert_array_equal(mine, theirs)
    np.testing.assert_allclose(
        filmed.error, np.linalg.norm(log.tip - log.tip_reference, axis=1)
    )
    between = film_flights([log], 0.5 * (log.time[1:] + log.time[:-1]))[0]
    np.testing.assert_allclose(
        between.position, 0.5 * (log.position[1:] + log.position[:-1]), atol=1e-12
    )


def test_an_attitude_that_changes_its_sign_is_read_without_a_jump() -> None:
    log = flight()
    sign = np.where(np.arange(log.time.size) % 2, -1.0, 1.0)
    flipped = dataclasses.replace(log, quaternion=log.quaternion * sign[:, None])
    times = 0.5 * (log.time[1:] + log.time[:-1])
    a, b = (film_flights([each], times)[0].quaternion for each in (log, flipped))
    np.testing.assert_array_equal(a, b)
    # halfway between two attitudes 5 ms apart, not through zero
    assert np.linalg.norm(b, axis=1).min() > 0.999


def test_the_ghost_s_tip_is_the_tip_s_reference_and_the_vehicle_s_tip_is_the_tip() -> (
    None
):
    log = flight("centroidal_tip")
    filmed = film_flights([log], log.time)[0]
    for solids, tip in (
        (ghost_solids(filmed), log.tip_reference),
        (vehicle_solids(filmed), log.tip),
    ):
        (ball,) = (solid for solid in solids if solid.shape.role == "tip")
        # the log computes it by frame_pose_world, the film by the poses of links
        np.testing.assert_allclose(ball.position, tip, atol=1e-12)
    # grey and see-through, whatever the flight's colour is
    assert {solid.rgba for solid in ghost_solids(filmed)} == {GHOST}
    assert GHOST[3] < 0.5


def test_the_ghost_turns_with_the_desired_yaw() -> None:
    log = flight()
    yaw = np.linspace(2.9, 3.4, log.time.size)  # across half a turn
    wrapped = np.arctan2(np.sin(yaw), np.cos(yaw))
    vehicle = log.scenario.plant.vehicle
    turned = dataclasses.replace(
        log,
        yaw_reference=wrapped,
        tool_reference=level_tip(
            vehicle, log.position_reference, yaw, log.joints_reference + 0.4
        ),
        joints_reference=log.joints_reference + 0.4,
    )
    for times in (log.time, 0.5 * (log.time[1:] + log.time[:-1])):
        filmed = film_flights([turned], times)[0]
        (ball,) = (solid for solid in ghost_solids(filmed) if solid.shape.role == "tip")
        # between two instants an arc is read as its chord
        np.testing.assert_allclose(ball.position, filmed.desired_tip, atol=1e-5)


def test_a_lost_flight_stays_where_it_was_lost() -> None:
    log = flight()
    lost = dataclasses.replace(log, info={**log.info, "status": "joint_limit"})
    times = np.array([0.0, 0.5, 5.0])
    filmed = film_flights([lost], times)[0]
    assert (filmed.lost, filmed.end) == ("joint limit", log.time[-1])
    np.testing.assert_array_equal(filmed.position[2], log.position[-1])
    assert film_flights([log], times)[0].lost == ""


def test_a_whole_flight_ends_after_its_last_period_and_its_own_frames() -> None:
    log = flight()
    whole = film_flights([log], log.time)[0]
    assert whole.end == pytest.approx(SECONDS)
    for fps in (1, 7, 30, 120):
        assert frame_times([log], FilmSettings(fps=fps))[-1] < whole.end


def test_names_tell_the_flights_apart() -> None:
    pd, tip = flight(), flight("centroidal_tip")
    assert flight_labels([pd, tip]) == ["decoupled_pd", "centroidal_tip"]
    assert flight_labels([pd, flight(scenario="case3")]) == [
        "decoupled_pd, case3_wind",
        "decoupled_pd, case3",
    ]
    assert flight_labels([pd, pd]) == ["1: decoupled_pd", "2: decoupled_pd"]
    with pytest.raises(
        ValueError, match=r"labels = .*: must be as many as the flights, 2"
    ):
        film_flights([pd, tip], np.zeros(1), ["one"])
    with pytest.raises(
        ValueError, match=r"flights = 7: must be from 1 to 6 in one film"
    ):
        film_flights([pd] * 7, np.zeros(1))


@pytest.mark.parametrize("name", sorted(CAMERAS))
def test_every_camera_has_the_vehicles_and_their_desired_places_in_view(
    name: str,
) -> None:
    times = np.arange(10) * 0.1
    flights = film_flights([flight(), flight("centroidal_tip")], times)
    path = CAMERAS[name](flights, times, 0.9)
    for each in flights:
        for places in (
            (each.desired_tip,)
            if name == "tip"
            else (each.position, each.tip, each.desired_position)
        ):
            # by a pinhole of the test's own: columns and rows from -1 to 1
            az, el = np.radians(path.azimuth), np.radians(path.elevation)
            away = np.stack(
                [np.cos(el) * np.cos(az), np.cos(el) * np.sin(az), np.sin(el)], axis=1
            )
            right = np.cross(away, [0.0, 0.0, 1.0])
            right /= np.linalg.norm(right, axis=1, keepdims=True)
            ray = places - path.look_at + path.distance[:, None] * away
            depth, slope = (
                np.sum(ray * away, axis=1),
                np.tan(np.radians(0.5 * FIELD_OF_VIEW)),
            )
            assert np.all(
                np.abs(np.sum(ray * right, axis=1)) < 0.95 * 0.9 * slope * depth
            )
            assert np.all(
                np.abs(np.sum(ray * np.cross(right, away), axis=1))
                < 0.95 * slope * depth
            )
    assert name in get_args(Camera)


def test_a_narrow_picture_is_looked_at_from_as_far_as_a_low_one() -> None:
    flights = film_flights([flight()], np.arange(3) * 0.1)
    narrow, square, wide = (
        CAMERAS["tip"](flights, np.arange(3) * 0.1, aspect).distance[0]
        for aspect in (0.5, 1.0, 2.0)
    )
    assert square == wide, "the height decides"
    # half the width: the ball's radius over the sine of the half angle whose tangent is
    # half as large
    half = np.radians(0.5 * FIELD_OF_VIEW)
    assert narrow / square == pytest.approx(
        np.sin(half) / np.sin(np.arctan(0.5 * np.tan(half)))
    )


def test_a_camera_turns_to_what_it_follows_within_its_time_and_without_lag() -> None:
    times = np.arange(400) * 0.02
    (filmed,) = film_flights([flight()], times)
    step = np.where(times < 4.0, 0.0, 1.0)[:, None] * np.array([1.0, 0.0, 0.0])
    along = CAMERAS["tip"](
        [dataclasses.replace(filmed, desired_tip=step)], times, 1.0
    ).look_at[:, 0]
    # a low-pass forwards and backwards: exponentials to both sides of the step
    expected = np.where(
        times < 4.0,
        0.5 * np.exp((times - 4.0) / 0.6),
        1.0 - 0.5 * np.exp((4.0 - times) / 0.6),
    )
    np.testing.assert_allclose(along, expected, atol=0.02)


def test_pictures_side_by_side_share_the_distance_that_the_widest_flight_needs() -> (
    None
):
    times = np.arange(10) * 0.1
    first, second = film_flights([flight(), flight("centroidal_tip")], times)
    away = np.linspace(0.0, 3.0, 10)[:, None] * np.array([1.0, 1.0, 0.0])
    far = dataclasses.replace(second, desired_position=second.desired_position + away)
    layout = frame_layout(640, 360, 2, "side", plot=False)
    near, wide = film_panels([first, far], times, FilmSettings(camera="fixed"), layout)
    np.testing.assert_array_equal(near.camera.distance, wide.camera.distance)
    aspect = layout.panels[0].width / layout.panels[0].height
    assert wide.camera.distance[0] == CAMERAS["fixed"]([far], times, aspect).distance[0]


def test_an_arrow_is_as_long_as_the_wind_is_strong_up_to_a_limit() -> None:
    (filmed,) = film_flights([flight()], np.zeros(1))
    for force, air, length in (
        (2.0, 5.0, 0.4),
        (50.0, 0.0, 0.6),
        (0.0, 5.0, 0.4),
        (0.0, 100.0, 0.6),
    ):
        blown = dataclasses.replace(
            filmed, force=np.array([[0.0, force, 0.0]]), air=np.array([[0.0, air, 0.0]])
        )
        (arrow,) = wind_arrow(blown, 0, 0.2)
        np.testing.assert_allclose(
            arrow.end - arrow.start, [0.0, length, 0.0], atol=1e-12
        )


def test_a_following_camera_lets_a_lost_vehicle_go() -> None:
    times = np.arange(10) * 0.1
    (filmed,) = film_flights([flight()], times)
    far = dataclasses.replace(
        filmed, position=filmed.position + np.linspace(0.0, 1e6, 10)[:, None]
    )
    assert CAMERAS["follow"]([far], times, 1.0).distance.max() < 10.0


@pytest.mark.parametrize("layout", ["side", "over"])
@pytest.mark.parametrize(
    ("width", "height", "count"),
    [(1280, 720, 3), (160, 120, 2), (400, 800, 6), (64, 64, 1)],
)
def test_parts_of_a_frame_lie_inside_it_and_apart(
    layout: str, width: int, height: int, count: int
) -> None:
    found = frame_layout(width, height, count, layout, plot=True)
    parts = [
        found.title,
        *found.panels,
        *found.heads,
        *([found.plot] if found.plot else []),
    ]
    covered = np.zeros((height, width), int)
    for box in parts:
        assert min(box.left, box.top) >= 0
        assert min(box.width, box.height) >= 1
        assert box.left + box.width <= width
        assert box.top + box.height <= height
        covered[box.top : box.top + box.height, box.left : box.left + box.width] += 1
    assert covered.max() == 1
    assert covered.mean() > 0.9
    assert len(found.panels) == (count if layout == "side" else 1)
    assert (found.plot is None) == (height < 240)


def test_a_film_that_begins_later_has_no_more_lines_in_its_trail() -> None:
    (filmed,) = film_flights([flight()], np.zeros(1))
    moving = np.arange(2000)[:, None] * np.array([0.02, 0.0, 0.0])
    shown = dataclasses.replace(
        filmed, tip=moving, desired_tip=moving[:1], force=0 * moving, air=0 * moving
    )
    times = (first + np.arange(2000) / 250.0 for first in (0.0, 20.0))
    early, late = (
        marks_of([dataclasses.replace(shown, times=each)], 0.2, 1.0)(1990)
        for each in times
    )
    assert len(early) == len(late) < 100


def test_a_desired_path_has_no_more_lines_than_its_pieces() -> None:
    (filmed,) = film_flights([flight()], np.zeros(1))
    for count in (319, 320, 639, 640, 5000):
        path = np.arange(count)[:, None] * np.array([0.02, 0.0, 0.0])
        shown = dataclasses.replace(filmed, desired_tip=path)
        assert min(count - 1, 200) <= len(desired_path(shown, 1.0)) <= 320


def test_the_trail_goes_back_some_seconds_and_the_arrow_blows_with_the_wind() -> None:
    times = np.arange(200) * 0.1
    (filmed,) = film_flights([flight()], times)
    moving = np.stack([0.1 * times, 0 * times, 0 * times], axis=1)
    filmed = dataclasses.replace(filmed, tip=moving, desired_tip=np.zeros((200, 3)))
    marks = marks_of([filmed], 0.2, 1.0)(150)
    trail = [mark for mark in marks if mark.kind == "line"]
    assert trail[0].start[0] == pytest.approx(0.1 * (15.0 - TRAIL), abs=0.02)
    np.testing.assert_array_equal(trail[-1].end, moving[150])
    (arrow,) = (mark for mark in marks if mark.kind == "arrow")
    along = arrow.end - arrow.start
    np.testing.assert_allclose(
        along / np.linalg.norm(along),
        filmed.force[150] / np.linalg.norm(filmed.force[150]),
    )
    # 2 N, and the drag of 2 m/s at the rotors
    assert wind_words(filmed, 150) == "force 2.3 N, wind 2.0 m/s"
    assert (
        wind_words(dataclasses.replace(filmed, air=0 * filmed.air), 150)
        == "force 2.3 N"
    )
    still = dataclasses.replace(filmed, force=0 * filmed.force, air=0 * filmed.air)
    assert all(mark.kind == "line" for mark in marks_of([still], 0.2, 1.0)(150))
    assert wind_words(still, 150) == ""


@pytest.mark.parametrize(
    ("wrong", "line"),
    [
        (
            {"layout": "sid"},
            r"layout = 'sid': did you mean 'side'\? must be one of side, over",
        ),
        ({"camera": ""}, r"camera = '': must be one of follow, fixed, tip"),
        ({"width": 161}, r"width = 161: must be an even number"),
        ({"height": 8000}, r"height = 8000: must be at most 4096"),
        ({"fps": 0}, r"fps = 0: must be at least 1"),
        ({"speed": float("nan")}, r"speed = nan"),
        ({"speed": 0.0}, r"speed = 0.0: must be at least 0.01"),
        ({"start": -1.0}, r"start = -1.0"),
        ({"start": 3.0, "stop": 2.0}, r"stop = 2.0: must be larger than start = 3"),
    ],
)
def test_a_wrong_setting_is_refused_in_one_line(
    wrong: dict[str, object], line: str
) -> None:
    with pytest.raises(ValueError, match=line):
        FilmSettings(**wrong)  # type: ignore[arg-type]


def test_a_size_is_two_numbers() -> None:
    assert size_of("1280x720") == size_of("1280X720") == (1280, 720)
    for text in ("", "x", "12", "1x2x3", "-2x4", "1e3x2", "9" * 30 + "x2"):
        with pytest.raises(
            ValueError, match=r"size = .*: must be WIDTHxHEIGHT in pixels"
        ):
            size_of(text)


def test_a_flight_is_one_second_long() -> None:
    assert flight().time[-1] == pytest.approx(SECONDS, abs=0.01)


def test_a_payload_is_drawn_where_it_is_taken_held_and_left() -> None:
    phases = [
        {
            "kind": "pick",
            "payload": "box",
            "position": [0.0, 0.0, 0.7],
            "approach": [0, 0, 0],
            "dwell": 0.4,
        },
        {"kind": "go_to", "position": [0.15, 0.0, 0.7], "duration": 0.8},
        {
            "kind": "place",
            "payload": "box",
            "position": [0.15, 0.0, 0.7],
            "approach": [0, 0, 0],
            "dwell": 0.4,
        },
        {"kind": "go_to", "position": [0.0, 0.0, 0.7], "duration": 0.8},
    ]
    tip = {
        "posture": [0.4, -0.8],
        "path": {"kind": "phases", "position": [0.0, 0.0, 0.7], "phases": phases},
    }
    document = {
        "name": "w",
        "duration": 2.4,
        "plant": {"vehicle": "hummingbird_arm2_rotors"},
    }
    document |= {"controller": {"preset": "paper_ct"}, "reference": {"tip": tip}}
    log = run(
        scenario_from(
            document
            | {"payloads": [{"name": "box", "mass": 0.02, "com": [0.0, 0.0, -0.04]}]}
        )
    )
    filmed = film_flights([log], log.time)[0]
    (ball,) = [
        solid for solid in vehicle_solids(filmed) if solid.shape.role == "payload"
    ]
    # it is drawn about its own middle, in the axes of the frame that holds it
    box = dataclasses.replace(
        ball, position=ball.position + 0.04 * ball.rotation[:, :, 2]
    )
    (held,) = np.nonzero(log.payload_mass[:, 0])
    np.testing.assert_allclose(box.position[held], log.tip[held], atol=1e-9)
    np.testing.assert_allclose(
        box.position[: held[0]], np.tile(log.tip[held[0]], (held[0], 1)), atol=1e-9
    )
    left = len(log.time) - 1 - held[-1]
    assert left > 100
    np.testing.assert_allclose(
        box.position[held[-1] + 1 :], np.tile(log.tip[held[-1]], (left, 1)), atol=1e-9
    )
    assert np.linalg.norm(log.tip[-1] - box.position[-1]) > 0.1
    # no frame shows it held: nothing is drawn
    early = film_flights([log], log.time[: held[0]])[0]
    assert not [
        solid for solid in vehicle_solids(early) if solid.shape.role == "payload"
    ]


@pytest.mark.parametrize(
    ("shape", "seen"),
    [
        # 0.75 of its width is the height of the panel: as much is free at both sides
        ((30, 40), Box(110, 20, 80, 60)),
        # a tenth of it: as much is free above and below
        ((4, 40), Box(10, 36, 280, 28)),
    ],
)
def test_a_camera_s_picture_is_in_the_middle_of_its_panel(
    shape: tuple[int, int], seen: Box
) -> None:
    flown: Any = [SimpleNamespace(cameras={"eye": SimpleNamespace(shape=shape)})]
    panel = Box(10, 20, 280, 60)
    assert _seen_box(panel, "eye", flown) == seen
    assert _seen_box(panel, "follow", flown) == panel
