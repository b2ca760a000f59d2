"""Pictures of depth cameras in figures, films and the studio: those of the log."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import skyarm
from skyarm.log.flight_log import rows_of
from skyarm.scenario.scenario_record import NamedSensor
from skyarm.view.figures.flight_plot import plot
from skyarm.view.film.camera_paths import camera_named, hides
from skyarm.view.film.captions import INK, Box, frame_layout
from skyarm.view.film.filmed_flight import film_flights
from skyarm.view.film.insets import insets_of, put_inset
from skyarm.view.film.make_film import FilmSettings, film_frames
from skyarm.view.picture.depth_pixels import depth_pixels
from skyarm.view.picture.marks import vehicle_solids
from skyarm.view.picture.mujoco_sink import FramePanel, open_stage
from skyarm.view.studio.picture import SightNodes
from support.peers import Scene
from support.pictures import needs_display

EXAMPLES = Path(__file__).parents[2] / "examples"

WIDTH, HEIGHT = 32, 24


@cache
def scenario():
    tables = tomllib.loads((EXAMPLES / "see_with_the_wrist.toml").read_text("utf-8"))
    tables["duration"] = 0.21
    # rolled about its axis, and turned aside, as no free camera can look
    tables["sensors"]["wrist"] |= {
        "width": WIDTH,
        "height": HEIGHT,
        "rpy": [0.4, 1.45, 0.2],
        "noise": {},
    }
    return skyarm.scenario_from(tables, EXAMPLES)


@cache
def flown():
    return skyarm.run(scenario())


def test_a_figure_has_pictures_of_every_camera_with_depths_in_m():
    figure = plot(flown(), kind="depth", window=(0.05, 0.2))
    images = [ax.images[0] for ax in figure.axes if ax.images]
    frames = [each for name in ("wrist", "around") for each in flown().frames(name)]
    wanted = [each.depth for each in frames if each.time > 0.05]
    assert len(images) == len(wanted) == 4
    for image, depth in zip(images, wanted, strict=True):
        known = np.isfinite(depth)
        assert np.array_equal(image.get_array()[known], depth[known])
        assert (np.ma.getmaskarray(image.get_array()) == ~known).all()
    labels = [ax.get_ylabel() for ax in figure.axes if ax.get_ylabel()]
    assert labels == ["depth [m]", *2 * ["elevation [deg]"], "range [m]"]
    # a lidar's turn from left to right and from low to high, in its own shape
    lidar = [ax for ax in figure.axes if ax.get_ylabel() == "elevation [deg]"]
    sensor = scenario().agent.cameras["around"]
    for ax in lidar:
        assert ax.get_xlim() == pytest.approx(np.degrees(sensor.azimuth)[::-1])
        assert ax.get_ylim() == pytest.approx(np.degrees(sensor.elevation))
        high, wide = np.ptp(sensor.elevation), np.ptp(sensor.azimuth)
        assert ax.get_box_aspect() == pytest.approx(high / wide)
    assert [ax.get_xlabel() for ax in lidar] == ["", "azimuth [deg]"]


def test_a_figure_of_flights_has_the_pictures_nearest_to_the_same_instants():
    whole = flown()
    short = rows_of(whole, slice(0, np.searchsorted(whole.time, 0.12)))
    figure = plot({"a": whole, "b": short}, kind="depth", window=(0.0, 0.2))
    with pytest.raises(ValueError, match="in this window; a longer one has some of"):
        plot(whole, kind="depth", window=(0.01, 0.02))
    titles = [ax.get_title() for ax in figure.axes if ax.get_title()]
    names = [f"{flight}: {name}" for flight in "ab" for name in ("wrist", "around")]
    frames = {"a": (0, 0.1, 0.2), "b": (0, 0.1)}
    wanted = [f"{name}, {time:g} s" for name in names for time in frames[name[0]]]
    assert titles == wanted


def test_depths_are_grey_from_near_to_far_and_black_for_none():
    depth = np.array([[2.0, np.inf, 3.0], [np.nan, 4.0, -np.inf]])
    wanted = [[255, 0, 157], [0, 60, 0]]
    pixels = depth_pixels(depth)
    assert pixels[..., 0].tolist() == wanted
    assert (pixels == pixels[..., :1]).all()
    assert not depth_pixels(np.full((2, 2), np.nan)).any()


@needs_display
def test_a_film_of_a_camera_shows_no_more_than_the_camera_sees():
    settings = FilmSettings(camera="wrist", width=320, height=200, plot=False, title="")
    times = np.zeros(1)
    (film,) = film_frames(film_flights([flown()], times), times, settings)
    box = frame_layout(320, 200, 1, "side", plot=False).panels[0]
    drawn = (film[box.inside] != 255).any(axis=-1)
    rows, columns = drawn.any(axis=1).sum(), drawn.any(axis=0).sum()
    assert rows == box.height
    assert columns == round(box.height * WIDTH / HEIGHT) < box.width
    left = np.flatnonzero(drawn.any(axis=0))[0]
    assert left == (box.width - columns) // 2


@needs_display
def test_a_film_of_a_camera_shows_what_its_depth_picture_names():
    frames = [*flown().frames("wrist")]
    flights = film_flights([flown()], np.array([each.time for each in frames]))
    path = camera_named("wrist", flights)(flights, np.zeros(3), WIDTH / HEIGHT)
    solids = [
        each
        for each in vehicle_solids(flights[0])
        if not hides(flights[0], "wrist", each.shape)
    ]
    panel = FramePanel(0, 0, WIDTH, HEIGHT, path, solids, lambda _: [])
    with open_stage([panel], WIDTH, HEIGHT) as stage:
        drawn = stage.draw(2).astype(float)
    segment = frames[2].segment
    names = [frames[2].names.index(each) for each in ("table", "parcel")]
    assert all((segment == each).sum() > 40 for each in names)
    colors = np.array([np.median(drawn[segment == each], axis=0) for each in names])
    assert np.abs(colors[0] - colors[1]).max() > 20
    nearest = np.linalg.norm(drawn[..., None, :] - colors, axis=-1).argmin(axis=-1)
    here = np.isin(segment, names)
    found, parcel = nearest[here] == 1, segment[here] == names[1]
    assert (found & parcel).sum() > 0.85 * (found | parcel).sum()


def test_an_inset_is_the_latest_picture_in_a_frame_below_its_words():
    times = np.array([0.0, 0.09, 0.1, 0.15, 0.2])
    boxes = [Box(20, 10, 160, 120)]
    ((box, seen),) = insets_of("wrist", boxes, [flown()], times)
    frames = [*flown().frames("wrist")]
    high, wide = 48, 64
    rows = (np.arange(high) + 0.5) * HEIGHT / high
    columns = (np.arange(wide) + 0.5) * WIDTH / wide
    for latest in (0, 0, 1, 1, 2):
        film = np.full((140, 200, 3), 7, np.uint8)
        put_inset(film, (box, seen), 0.4)
        inset = depth_pixels(frames[latest].depth)
        place = film[130 - high - 3 : 127, 180 - wide - 3 : 177]
        wanted = inset[rows.astype(int)][:, columns.astype(int)]
        assert np.array_equal(place, wanted)
        place[:] = INK
        framed = film[130 - high - 4 - 12 : 128, 180 - wide - 4 : 178]
        words = framed[1:13, 1:-1].max(axis=-1) > 200
        assert words.any()
        framed[1:13, 1:-1] = INK
        assert (framed == INK).all()
        framed[:] = 7
        assert (film == 7).all()


def test_a_flight_without_the_camera_of_an_inset_is_named():
    boxes, times = 2 * [Box(20, 10, 160, 120)], np.zeros(1)
    words = r"inset = 'nose': flight 'see_with_the_wrist': must be one of wrist, around"
    with pytest.raises(ValueError, match=words):
        insets_of("nose", boxes, [flown()], times)
    bare = scenario().with_agent(replace(scenario().agent, sensors=()))
    blind = SimpleNamespace(scenario=bare, info={"scenario": "blind"})
    with pytest.raises(
        ValueError, match=r"flight 'blind': must be left out, there is no"
    ):
        insets_of("wrist", boxes, [flown(), blind], times)


def test_the_studio_shows_what_a_session_sees_on_the_cameras_link():
    scene, frame = Scene(), next(flown().frames("wrist"))
    nodes = SightNodes(scene, scenario(), dict.fromkeys(scenario().agents, "/law1"))
    nodes.draw(SimpleNamespace(frame={"wrist": frame}.get), 0)
    assert set(scene.nodes) == {"/law1/1/wrist"}
    picture = depth_pixels(frame.depth)
    assert np.array_equal(scene.nodes["/law1/1/wrist"].image, picture)


@pytest.mark.parametrize("name", ["follow", "fixed", "tip"])
def test_no_camera_has_the_name_of_a_films_view(name):
    sensor = scenario().agent.cameras["wrist"]
    with pytest.raises(ValueError, match=f"sensors: name = '{name}': must be none of"):
        NamedSensor(name=name, sensor=sensor)


def test_an_unknown_camera_of_a_film_is_refused():
    flights = film_flights([flown()], np.zeros(1))
    with pytest.raises(ValueError, match=r"must be one of follow, fixed, tip, wrist$"):
        camera_named("nose", flights)


def test_a_lidar_is_no_view_of_a_film_but_an_inset():
    flights = film_flights([flown()], np.zeros(1))
    words = r"must be one of follow, fixed, tip, wrist; inset = 'around' shows the"
    with pytest.raises(ValueError, match=words):
        camera_named("around", flights)
    with pytest.raises(ValueError, match=r"follow, fixed, tip; a cure$"):
        camera_named("wrist", cure="a cure")
