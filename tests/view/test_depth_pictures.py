"""Pictures of depth cameras in figures, films and the studio: those of the log."""

from __future__ import annotations

import tomllib
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import skyarm
from skyarm.scenario.scenario_record import NamedSensor
from skyarm.view.figures.flight_plot import plot
from skyarm.view.film.camera_paths import camera_named, hides
from skyarm.view.film.captions import Box
from skyarm.view.film.filmed_flight import film_flights
from skyarm.view.film.insets import insets_of, put_inset
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
    figure = plot(flown(), kind="depth", window=(0.05, 0.3))
    images = [ax.images[0] for ax in figure.axes if ax.images]
    frames = [each for name in ("wrist", "around") for each in flown().frames(name)]
    wanted = [each.depth for each in frames if each.time > 0.05]
    assert len(images) == len(wanted) == 4
    for image, depth in zip(images, wanted, strict=True):
        known = np.isfinite(depth)
        assert np.array_equal(image.get_array()[known], depth[known])
        assert (np.ma.getmaskarray(image.get_array()) == ~known).all()
    assert [ax.get_ylabel() for ax in figure.axes if ax.get_ylabel()] == 2 * [
        "depth [m]"
    ]


def test_depths_are_grey_from_near_to_far_and_black_for_none():
    depth = np.array([[2.0, np.inf, 3.0], [np.nan, 4.0, -np.inf]])
    wanted = [[255, 0, 157], [0, 60, 0]]
    pixels = depth_pixels(depth)
    assert pixels[..., 0].tolist() == wanted
    assert (pixels == pixels[..., :1]).all()
    assert not depth_pixels(np.full((2, 2), np.nan)).any()


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


def test_an_inset_is_the_latest_picture():
    times = np.array([0.0, 0.09, 0.1, 0.15, 0.2])
    boxes = [Box(20, 10, 160, 120)]
    ((box, seen),) = insets_of("wrist", boxes, [flown()], times)
    frames = [*flown().frames("wrist")]
    high, wide = 48, 64
    rows = (np.arange(high) + 0.5) * HEIGHT / high
    columns = (np.arange(wide) + 0.5) * WIDTH / wide
    for latest in (0, 0, 1, 1, 2):
        film = np.zeros((140, 200, 3), np.uint8)
        put_inset(film, (box, seen))
        inset = depth_pixels(frames[latest].depth)
        place = film[130 - high - 2 : 128, 180 - wide - 2 : 178]
        wanted = inset[rows.astype(int)][:, columns.astype(int)]
        assert np.array_equal(place, wanted)
        place[:] = 0
        assert not film.any()
    ((_, unknown),) = insets_of("nose", boxes, [flown()], times)
    with pytest.raises(ValueError, match=r"sensors.nose: must be one of wrist, around"):
        next(unknown)


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
