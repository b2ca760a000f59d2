"""A world in films, recordings and figures of one flight: places, forces and instants
are those of its log.
"""

from __future__ import annotations

import dataclasses
from functools import cache
from typing import Any

import numpy as np
import pytest
from matplotlib.colors import to_rgba

from skyarm.algebra import Vec3
from skyarm.view.figures.flight_plot import plot
from skyarm.view.film import camera_paths
from skyarm.view.film.camera_paths import (
    AZIMUTH,
    ELEVATION,
    free_azimuth,
    looking_towards,
)
from skyarm.view.film.captions import frame_layout, state_words
from skyarm.view.film.filmed_flight import FilmedFlight, film_flights
from skyarm.view.film.make_film import FilmSettings, film_frames, film_panels
from skyarm.view.picture.marks import (
    LONGEST_TOUCH,
    TOUCH,
    TOUCH_PER_NEWTON,
    touch_marks,
    vehicle_solids,
)
from skyarm.world.scene.scene import Scene
from skyarm.world.scene.shapes import OBJECT, SURFACE, Solid
from support.pictures import flight, needs_display
from support.worlds import WALL_ANGLE, touching

TIMES = np.arange(24) * 0.05
PAIR = 2
"""Column of the wall and the tip: ground and its two points stand before."""


@cache
def filmed() -> FilmedFlight:
    return film_flights([touching()], TIMES)[0]


def test_surfaces_and_objects_of_a_film_are_where_scenario_and_log_have_them() -> None:
    shown = {solid.shape.name: solid for solid in vehicle_solids(filmed())}
    wall, post, parcel = (shown[f"world/{name}"] for name in ("wall", "post", "parcel"))
    assert "world/ground" not in shown
    assert filmed().scene.ground == -0.3
    np.testing.assert_allclose(wall.position[-1], [0.29, 0.0, 0.45])
    np.testing.assert_allclose(
        wall.rotation[3][:, 0],
        [np.cos(WALL_ANGLE), np.sin(WALL_ANGLE), 0.0],
        atol=1e-12,
    )
    np.testing.assert_allclose(
        post.position[:, 0], 0.3 * np.sin(np.pi * TIMES), atol=1e-12
    )
    log = touching()
    at = np.searchsorted(log.time, TIMES - 1e-9)
    np.testing.assert_allclose(parcel.position, log.object_position[at], atol=1e-9)
    assert parcel.position[0, 2] - parcel.position[-1, 2] > 1.0, "it falls"
    assert (wall.rgba, parcel.rgba) == (SURFACE, OBJECT)
    ball = shown["point/skid"]
    np.testing.assert_allclose(
        ball.position[0], log.position[0] + [0.0, 0.1, -0.2], atol=1e-6
    )


def test_arrows_of_a_film_stand_on_the_tip_along_the_true_normal() -> None:
    log, (touch,) = touching(), filmed().scene.arrows
    assert touch.name == "touch/wall/tip"
    np.testing.assert_allclose(touch.spot, filmed().tip, atol=1e-12)
    size = np.interp(TIMES, log.time, log.contact_force[:, PAIR])
    assert size.max() > 0.5
    normal = np.array([-np.cos(WALL_ANGLE), -np.sin(WALL_ANGLE), 0.0])
    np.testing.assert_allclose(touch.force, size[:, None] * normal, atol=1e-9)
    for k in (0, int(np.argmax(size))):
        marks = touch_marks(filmed(), k, 0.2)
        assert len(marks) == (size[k] > 0.0)
        for mark in marks:
            length = min(TOUCH_PER_NEWTON * size[k], LONGEST_TOUCH)
            np.testing.assert_allclose(
                mark.end - mark.start, length * normal, atol=1e-9
            )
            assert mark.rgba == TOUCH
    arrow = dataclasses.replace(touch, force=100.0 * touch.force)
    strong = dataclasses.replace(filmed(), scene=Scene(arrows=(arrow,)))
    (mark,) = touch_marks(strong, int(np.argmax(size)), 0.2)
    np.testing.assert_allclose(mark.end - mark.start, LONGEST_TOUCH * normal, atol=1e-9)
    # after its end a flight pushes nothing
    (late,) = film_flights([log], np.array([log.time[-1], log.time[-1] + 1.0]))[
        0
    ].scene.arrows
    assert log.contact_force[-1, PAIR] > 0.0
    np.testing.assert_allclose(
        np.linalg.norm(late.force, axis=1),
        [log.contact_force[-1, PAIR], 0.0],
        atol=1e-12,
    )
    # the panel's marks hold them, too
    layout = frame_layout(320, 240, 1, "side", plot=False)
    (panel,) = film_panels([filmed()], TIMES, FilmSettings(), layout)
    drawn = [mark for mark in panel.marks(int(np.argmax(size))) if mark.rgba == TOUCH]
    assert len(drawn) == 1
    assert panel.ground == -0.3


def test_a_film_of_a_push_shows_force_and_the_error_across_the_believed_normal() -> (
    None
):
    log, k = touching(), len(TIMES) - 1
    away = log.tip - log.tip_reference
    pressing = log.time >= 0.1
    across = np.where(
        pressing, np.hypot(away[:, 1], away[:, 2]), np.linalg.norm(away, axis=1)
    )
    np.testing.assert_allclose(filmed().error_curve, across, atol=1e-12)
    assert across[-1] < 0.5 * abs(away[-1, 0])
    np.testing.assert_allclose(filmed().contact_curve, log.contact_force.sum(axis=1))
    np.testing.assert_array_equal(filmed().wanted_curve, np.where(pressing, 1.0, 0.0))
    words = state_words(filmed(), float(TIMES[k]), k)
    assert words.startswith(f"contact {log.contact_force[-1].sum():.1f} N, tip error ")
    assert state_words(filmed(), 0.0, 0).startswith("tip error ")
    free = film_flights([flight()], TIMES[:3])[0]
    assert (free.contact, free.contact_curve, free.wanted_curve, free.scene) == (
        None,
        None,
        None,
        Scene(),
    )


def test_a_camera_stands_where_no_surface_hides_the_tip() -> None:
    assert free_azimuth([film_flights([flight()], TIMES[:3])[0]]) == AZIMUTH
    azimuth = free_azimuth([filmed()])
    assert azimuth != AZIMUTH, "the wall is ahead, and so is the usual camera"
    (wall,) = (
        each for each in touching().scenario.worlds[0].surfaces if each.name == "wall"
    )

    def hidden(side: float) -> bool:
        way = filmed().tip[-1] - np.linspace(0.05, 2.0, 200)[:, None] * looking_towards(
            side, ELEVATION
        )
        return bool((wall.depth(Vec3(*way.T), 0, 0.0)[0] > 0.0).any())

    assert hidden(AZIMUTH)
    assert not hidden(azimuth)


@needs_display
def test_the_wall_is_seen_in_a_picture() -> None:
    settings = FilmSettings(width=160, height=120, plot=False, title="")
    last = _last(filmed())
    bare = dataclasses.replace(last, scene=Scene())
    # without surfaces the camera stands elsewhere: all are seen from where it stands
    # with them
    away = tuple(_moved(each, 100.0) for each in last.scene.solids)
    far = dataclasses.replace(
        last, scene=dataclasses.replace(last.scene, arrows=(), solids=away)
    )
    high = dataclasses.replace(far, scene=dataclasses.replace(far.scene, ground=0.0))
    assert free_azimuth([far]) == free_azimuth([bare]) == AZIMUTH
    azimuth = free_azimuth([last])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(camera_paths, "free_azimuth", lambda _: azimuth)
        world, empty, raised = (
            next(iter(film_frames([each], TIMES[-1:], settings))).astype(int)
            for each in (last, far, high)
        )
    assert 0.05 < (np.abs(world - empty).max(axis=2) > 12).mean() < 0.9
    assert (np.abs(raised - empty).max(axis=2) > 3).mean() > 0.02, (
        "the ground is where the world has it"
    )


def _moved(solid: Solid, away: float) -> Solid:
    return dataclasses.replace(
        solid, position=solid.position - away * np.array([0.0, 0.0, 1.0])
    )


def _last(shown: FilmedFlight) -> FilmedFlight:
    """A flight of one frame, its last, seen with the world as it is then."""
    return film_flights([touching()], TIMES[-1:])[0]


def test_a_recording_has_the_world_and_shows_a_force_while_it_acts() -> None:
    pytest.importorskip("viser", reason="no extra 'studio'")
    from recorded_scenes import place_at, unpacked

    from skyarm.view.film.recording import record

    recording = unpacked(record(touching(), FilmSettings(fps=20)).content)
    messages = recording["messages"]
    root = "/flight1/solids/world"
    np.testing.assert_allclose(
        place_at(messages, f"{root}/wall", "SetPositionMessage", "position", 0.0),
        [0.29, 0.0, 0.45],
        atol=1e-4,
    )
    (sent,) = [
        m["props"]["vertices"]
        for _, m in messages
        if m["type"] == "MeshMessage" and m["name"].endswith("wall")
    ]
    (index,) = (each for each in sent.values() if type(each) is int)
    corners = np.frombuffer(recording["buffers"][index], np.float32).reshape(-1, 3)
    np.testing.assert_allclose(np.ptp(corners, axis=0), [0.1, 2.0, 0.9], rtol=1e-6)
    for k in (0, 10, 23):
        height = np.interp(k / 20, touching().time, touching().object_position[:, 2])
        place = place_at(
            messages, f"{root}/parcel", "SetPositionMessage", "position", k / 20
        )
        np.testing.assert_allclose(place, [-1.0, 0.0, height], atol=2e-4)
    name = "/flight1/touches"
    seen = [
        (at, m["visible"])
        for at, m in messages
        if "Visibility" in m["type"] and m["name"] == name
    ]
    first = TIMES[np.flatnonzero(filmed().contact > 0.02)[0]]
    assert not any(visible for at, visible in seen if at < first - 1e-9)
    assert seen[-1][1]
    (ground,) = [m for _, m in messages if m["type"] == "GridMessage"]
    assert (
        place_at(messages, ground["name"], "SetPositionMessage", "position", 0.0)[2]
        == -0.3
    )


def test_contact_figures_have_forces_desired_forces() -> None:
    log = touching()
    (ax,) = plot({"a": log}, kind="contact").axes
    lines = {line.get_label(): line for line in ax.get_lines()}
    assert ax.get_ylabel() == "wall, tip [N]"
    np.testing.assert_array_equal(lines["a"].get_ydata(), log.contact_force[:, PAIR])
    np.testing.assert_array_equal(
        lines["desired"].get_ydata(), np.where(log.time >= 0.1, 1.0, 0.0)
    )


def test_a_path_is_drawn_from_above_and_from_the_right_beside_its_world() -> None:
    log = touching()
    figure = plot({"a": log}, kind="path")
    above, right = figure.axes
    for ax, columns in ((above, (0, 1)), (right, (0, 2))):
        lines = {line.get_label(): line for line in ax.get_lines()}
        np.testing.assert_array_equal(lines["a"].get_xydata(), log.tip[:, columns])
        np.testing.assert_array_equal(
            lines["desired"].get_xydata(), log.tip_reference[:, columns]
        )
    # a plane is drawn where it is seen from its edge
    sides = [
        [patch.get_label() for patch in ax.patches].count("world/side")
        for ax in (above, right)
    ]
    assert sides == [1, 0]
    walls = [patch for patch in above.patches if patch.get_label() == "world/wall"]
    (wall,) = (each for each in log.scenario.worlds[0].surfaces if each.name == "wall")
    corners = walls[0].get_xy()
    places = Vec3(corners[:, 0], corners[:, 1], np.full(len(corners), 0.5))
    np.testing.assert_allclose(wall.depth(places, 0, 0.0)[0], 0.0, atol=1e-12)
    # what moves is drawn where it is at last, too, as a line
    fills = [
        patch.get_facecolor()
        for patch in right.patches
        if patch.get_label() == "world/parcel"
    ]
    assert len(fills) == 2
    assert fills[1] == to_rgba("none")
    assert len(walls) == 1
    spans: list[Any] = [
        patch for patch in right.patches if not patch.get_label().startswith("world/")
    ]
    assert max(patch.get_y() + patch.get_height() for patch in spans) == pytest.approx(
        -0.3
    )
