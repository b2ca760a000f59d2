"""Pictures of a film, decoded again: the vehicles are where a pinhole camera of our own
sees their poses.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from skyarm.algebra import Vec3
from skyarm.view.film.camera_paths import CAMERAS
from skyarm.view.film.filmed_flight import FilmedFlight, film_flights
from skyarm.view.film.make_film import FilmSettings, film_frames, make_film
from skyarm.view.picture.marks import ghost_solids, vehicle_solids
from skyarm.view.picture.mujoco_sink import (
    FIELD_OF_VIEW,
    CameraPath,
    FramePanel,
    open_stage,
)
from skyarm.world.contact.surface import Surface
from skyarm.world.scene.shapes import Shape, Solid, solid_shape
from support.pictures import flight, needs_display

pytestmark = needs_display

WIDTH, HEIGHT = 160, 120
TIMES = np.arange(10) * 0.1


def pixel(path: CameraPath, k: int, place: np.ndarray) -> np.ndarray:
    """Column and row of a place: a pinhole that looks along the azimuth and the
    elevation, z up.
    """
    az, el = np.radians(path.azimuth[k]), np.radians(path.elevation[k])
    forward = np.array([np.cos(el) * np.cos(az), np.cos(el) * np.sin(az), np.sin(el)])
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    down = np.cross(forward, right)
    ray = place - (path.look_at[k] - path.distance[k] * forward)
    scale = 0.5 * HEIGHT / np.tan(np.radians(0.5 * FIELD_OF_VIEW)) / (ray @ forward)
    return np.array(
        [0.5 * WIDTH + scale * (ray @ right), 0.5 * HEIGHT + scale * (ray @ down)]
    )


def pictures(
    path: CameraPath, solids: list[Solid], frames: list[int]
) -> list[np.ndarray]:
    panel = FramePanel(0, 0, WIDTH, HEIGHT, path, solids, lambda _k: [])
    with open_stage([panel], WIDTH, HEIGHT) as stage:
        return [stage.draw(k).astype(int) for k in frames]


def filmed(*laws: str) -> list[FilmedFlight]:
    return film_flights([flight(law) for law in laws], TIMES)


def centre_of_change(picture: np.ndarray, empty: np.ndarray) -> np.ndarray:
    rows, columns = np.nonzero(np.abs(picture - empty).max(axis=2) > 12)
    assert rows.size > 3
    return np.array([columns.mean() + 0.5, rows.mean() + 0.5])


def only(solids: list[Solid], role: str) -> list[Solid]:
    """The solids of a role, three times as large and not see-through, so that they
    cover some pixels.
    """
    return [
        dataclasses.replace(
            s,
            rgba=(1.0, 0.0, 0.0, 1.0),
            shape=dataclasses.replace(
                s.shape, size=tuple(3.0 * a for a in s.shape.size)
            ),
        )
        for s in solids
        if s.shape.role == role
    ]


def test_hull_and_tip_of_vehicle_and_ghost_are_drawn_where_a_pinhole_sees_them() -> (
    None
):
    (one,) = filmed("paper_pd")
    path = CAMERAS["follow"]([one], TIMES, WIDTH / HEIGHT)
    frames = [0, 9]
    empty = pictures(path, [], frames)
    for solids, base, tip in (
        (vehicle_solids(one), one.position, one.tip),
        (ghost_solids(one), one.desired_position, one.desired_tip),
    ):
        for role, places in (("hull", base), ("tip", tip)):
            for k, drawn, nothing in zip(
                frames, pictures(path, only(solids, role), frames), empty, strict=True
            ):
                wanted = pixel(path, k, places[k])
                # a ball's outline is off its centre by less than a pixel at this size
                if 4 < wanted[0] < WIDTH - 4 and 4 < wanted[1] < HEIGHT - 4:
                    np.testing.assert_allclose(
                        centre_of_change(drawn, nothing), wanted, atol=1.0
                    )


def test_a_panel_is_drawn_where_it_stands_in_the_frame() -> None:
    (one,) = filmed("paper_pd")
    path = CAMERAS["fixed"]([one], TIMES, WIDTH / HEIGHT)
    drawn = []
    for solids in (only(vehicle_solids(one), "hull"), []):
        panels = [FramePanel(30, 50, WIDTH, HEIGHT, path, solids, lambda _k: [])]
        with open_stage(panels, WIDTH + 70, HEIGHT + 60) as stage:
            drawn.append(stage.draw(9).astype(int))
    np.testing.assert_allclose(
        centre_of_change(*drawn),
        pixel(path, 9, one.position[9]) + np.array([30, 50]),
        atol=1.0,
    )


def test_the_vehicle_moves_in_the_picture() -> None:
    """Without this the test above could pass on a flight that hangs still."""
    (one,) = filmed("paper_pd")
    path = CAMERAS["fixed"]([one], TIMES, WIDTH / HEIGHT)
    assert (
        np.linalg.norm(
            pixel(path, 9, one.position[9]) - pixel(path, 0, one.position[0])
        )
        > 10
    )


@pytest.mark.parametrize(
    "layout", ["over", pytest.param("side", marks=pytest.mark.thorough)]
)
def test_both_vehicles_are_in_the_picture_and_the_ghost_when_it_is_wanted(
    layout: str,
) -> None:
    flights = filmed("paper_pd", "centroidal_tip")
    settings = FilmSettings(
        layout=layout, width=320, height=240, camera="fixed", plot=False
    )
    shown, hidden = (
        list(film_frames(flights, TIMES, dataclasses.replace(settings, ghost=ghost)))[
            -1
        ].astype(int)
        for ghost in (True, False)
    )
    for each in flights:
        # of the vehicle's own colour in the light: the hue stays
        hue = np.array(each.color) / max(each.color)
        bright = hidden.max(axis=2, keepdims=True)
        near = (np.abs(hidden / np.maximum(bright, 1) - hue).max(axis=2) < 0.15) & (
            bright[:, :, 0] > 60
        )
        below_heads = near[60:]
        assert below_heads.sum() > 20, each.label
    assert (np.abs(shown - hidden).max(axis=2) > 8).sum() > 50


def test_two_pictures_of_one_instant_are_the_same() -> None:
    flights = filmed("paper_pd")
    settings = FilmSettings(width=WIDTH, height=HEIGHT)
    first, second = (list(film_frames(flights, TIMES[:2], settings)) for _ in range(2))
    for a, b in zip(first, second, strict=True):
        np.testing.assert_array_equal(a, b)


def test_an_animated_picture_has_its_frames_its_size_and_its_time(
    tmp_path: Path,
) -> None:
    told = []
    settings = FilmSettings(width=WIDTH, height=HEIGHT, fps=30, stop=10 / 30)
    file = make_film(
        flight(),
        tmp_path / "a.webp",
        settings,
        progress=lambda *done: told.append(done),
    )
    assert told == [(k + 1, 10) for k in range(10)]
    with Image.open(file) as picture:
        assert (picture.size, picture.n_frames, picture.info["loop"]) == (
            (WIDTH, HEIGHT),
            10,
            0,
        )
        frames, lengths = [], []
        for k in range(10):
            picture.seek(k)
            frames.append(np.asarray(picture.convert("RGB")).astype(int))
            lengths.append(picture.info["duration"])
    assert sum(lengths) == pytest.approx(10 / 30 * 1e3, abs=1)
    _require_drawn(frames)


@pytest.mark.thorough
def test_an_mp4_has_its_frames_its_size_and_its_time(tmp_path: Path) -> None:
    import av

    settings = FilmSettings(width=WIDTH, height=HEIGHT, fps=25, stop=0.4)
    file = make_film(flight(), tmp_path / "a.mp4", settings)
    with av.open(str(file)) as container:
        stream = container.streams.video[0]
        assert (stream.codec_context.name, stream.codec_context.pix_fmt) == (
            "h264",
            "yuv420p",
        )
        assert float(stream.average_rate) == 25.0
        frames = [
            frame.to_ndarray(format="rgb24").astype(int)
            for frame in container.decode(stream)
        ]
    assert len(frames) == 10
    assert frames[0].shape == (HEIGHT, WIDTH, 3)
    _require_drawn(frames)
    # the table of frames stands before them, so that a browser plays what it has
    content = file.read_bytes()
    assert content.index(b"moov") < content.index(b"mdat")


def _require_drawn(frames: list[np.ndarray]) -> None:
    """Neither blank nor still, and as they were drawn."""
    flights = film_flights([flight()], np.arange(10) / 30)
    settings = FilmSettings(width=WIDTH, height=HEIGHT, title=flight().scenario.title)
    drawn = next(film_frames(flights, np.arange(10) / 30, settings)).astype(int)
    # lossy; an unlike picture is off by 30 and more
    assert np.abs(frames[0] - drawn).mean() < 6.0
    assert frames[0].std() > 10.0
    assert (np.abs(frames[9] - frames[0]).max(axis=2) > 30).sum() > 30


def test_fine_pictures_have_shadows_and_smooth_edges() -> None:
    flights = filmed("paper_pd")
    settings = FilmSettings(width=WIDTH, height=HEIGHT, plot=False)
    coarse, fine = (
        next(film_frames(flights, TIMES, dataclasses.replace(settings, fine=f)))
        for f in (False, True)
    )
    assert len(np.unique(fine.reshape(-1, 3), axis=0)) > len(
        np.unique(coarse.reshape(-1, 3), axis=0)
    )


def ring(outer: float) -> Shape:
    """A plate with a hole."""
    size = (0.01, 0.02, 0.002, outer, 0.03)
    return Shape(name=str(outer), role="object", kind="hole", body=0, size=size)


def octahedron(reach: float) -> Shape:
    """A hull with corners on its axes."""
    corners = np.vstack([np.eye(3), -np.eye(3)]) * reach
    vertices = tuple(map(Vec3.from_numbers, corners))
    it = Surface(name=str(reach), shape="hull", vertices=vertices)
    return solid_shape(it, str(reach), "object", 0)


@pytest.mark.parametrize("shape_of", [ring, octahedron])
def test_each_solid_with_a_mesh_has_its_own_in_the_picture(
    shape_of: Callable[[float], Shape],
) -> None:
    """A wide one on the left, a narrow one on the right: a third as wide, so a ninth of
    the pixels.
    """
    (one,) = filmed("paper_pd")
    path = CAMERAS["fixed"]([one], TIMES, WIDTH / HEIGHT)
    az = np.radians(path.azimuth[0])
    right = np.array([np.sin(az), -np.cos(az), 0.0])
    rings = []
    for sign, outer in ((-1.0, 0.24), (1.0, 0.08)):
        place = np.repeat(
            (path.look_at[0] + sign * 0.3 * right)[None], len(TIMES), axis=0
        )
        rings.append(
            Solid(
                shape_of(outer),
                place,
                np.repeat(np.eye(3)[None], len(TIMES), axis=0),
                (1.0, 0.0, 0.0, 1.0),
            )
        )
    (drawn,) = pictures(path, rings, [0])
    red = drawn[:, :, 0] - drawn[:, :, 1] > 60
    left, other = red[:, : WIDTH // 2].sum(), red[:, WIDTH // 2 :].sum()
    assert left > 4 * other > 0
