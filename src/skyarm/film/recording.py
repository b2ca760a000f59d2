"""Recordings: a flight as a scene that is looked at from any side, in a file of some ten kilobytes (``.viser``).

The extra ``studio`` (viser) writes it and brings the player, one page without anything from elsewhere.
"""

from __future__ import annotations

import contextlib
import io
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.files import write_atomically
from skyarm.film.camera_paths import CAMERAS, FIELD_OF_VIEW, CameraPath, vehicle_reach
from skyarm.film.captions import state_words
from skyarm.film.film_settings import FilmSettings
from skyarm.film.filmed_flight import FilmedFlight, film_flights, frame_times
from skyarm.film.free_view import free_azimuth
from skyarm.film.marks import LEAST_FORCE, LEAST_SPEED, WIND, wind_words
from skyarm.film.recording_page import import_viser, page_with, player_page
from skyarm.film.recording_scene import PATH_COLOR, RecordedBodies, add_path, add_world
from skyarm.film.recording_touches import RecordedTouches, turn_x_onto
from skyarm.log.flight_log import Log

Array = npt.NDArray[np.float64]

SUFFIXES = ("viser", "html")
"""Of recordings; without a suffix a folder of a page and its recording is written."""

RECORDING_NAME, PLAYER_NAME = "flight.viser", "index.html"

WORDS_PER_SECOND = 2.0
"""How often the numbers beside a vehicle change."""

ASPECT = 1.0
"""Of the window for which the camera is placed: a phone's is narrower, a screen's wider."""

GRID = (208, 212, 218)


@dataclass(frozen=True, slots=True)
class Recording:
    """A recorded scene.

    Attributes:
        content: of a ``.viser`` file. seconds: how long it plays.
        html: of one page that holds player and recording, and asks for nothing from elsewhere.
    """

    content: bytes
    seconds: float
    html: Callable[[], str]


def record(
    flights: Log | Sequence[Log],
    settings: FilmSettings | None = None,
    *,
    labels: Sequence[str] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Recording:
    """Record flights.

    Args:
        flights: one log or several.
        settings: layout, span, speed, frames a second, ghost; the camera's first place.
        labels: as of a film.
        progress: as of a film.

    Raises:
        ValueError: one line: what cannot be filmed, or the extra that is missing.
    """
    import_viser()
    chosen = settings or FilmSettings()
    logs = [flights] if isinstance(flights, Log) else list(flights)
    times = frame_times(logs, chosen)
    filmed = film_flights(logs, times, labels)
    with _server() as server:
        content = _recorded(server, filmed, times, chosen, progress)
    return Recording(content, len(times) / chosen.fps, lambda: page_with(content))


def save_recording(recording: Recording, path: str | os.PathLike[str]) -> list[Path]:
    """Write a recording: NAME.viser alone, NAME.html (page and recording in one), or a folder of both.

    Returns:
        What was written.
    """
    target = Path(path)
    if target.suffix.lower() == ".viser":
        return [write_atomically(target, recording.content)]
    if target.suffix.lower() == ".html":
        return [write_atomically(target, recording.html().encode())]
    written = [write_atomically(target / RECORDING_NAME, recording.content)]
    return [*written, write_atomically(target / PLAYER_NAME, player_page(RECORDING_NAME).encode())]


@contextlib.contextmanager
def _server() -> Iterator[Any]:
    """A server of viser that nobody is told of: scenes are made on one. It listens on loopback for that long."""
    with contextlib.redirect_stdout(io.StringIO()):
        server = import_viser().ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        yield server
    finally:
        with contextlib.redirect_stdout(io.StringIO()):
            server.stop()


def _recorded(
    server: Any,
    flights: Sequence[FilmedFlight],
    times: Array,
    settings: FilmSettings,
    progress: Callable[[int, int], None] | None,
) -> bytes:
    """Build the scene, then play the flights into its serializer."""
    shifts = _shifts(flights, settings)
    _surroundings(server, flights, shifts, times, settings)
    vehicles = [
        _Recorded(server.scene, f"/flight{i + 1}", flight, shift, times, settings)
        for i, (flight, shift) in enumerate(zip(flights, shifts, strict=True))
    ]
    for vehicle in vehicles:
        vehicle.put(0)
    serializer = server.get_scene_serializer()
    for k in range(len(times)):
        if k:
            for vehicle in vehicles:
                vehicle.put(k)
        serializer.insert_sleep(1.0 / settings.fps)
        if progress is not None:
            progress(k + 1, len(times))
    content: bytes = serializer.serialize()
    return content


class _Recorded:
    """One flight in the scene: vehicle, ghost, its tip's path, name and error, wind, its world and what touches it."""

    def __init__(
        self, scene: Any, root: str, flight: FilmedFlight, shift: Array, times: Array, settings: FilmSettings
    ) -> None:
        self._flight, self._times = flight, times
        reach = vehicle_reach(flight)
        self._bodies = [RecordedBodies(scene, f"{root}/vehicle", flight, shift, ghost=False)]
        if settings.ghost:
            self._bodies.append(RecordedBodies(scene, f"{root}/desired", flight, shift, ghost=True))
        color = tuple(round(255 * c) for c in flight.color)
        add_path(scene, f"{root}/tip_path", flight.tip + shift, color, 2.0)
        add_path(scene, f"{root}/desired_tip_path", flight.desired_tip + shift, PATH_COLOR, 1.0)
        above = flight.desired_position.mean(axis=0) + shift + np.array([0.0, 0.0, 1.3 * reach])
        self._words = scene.add_label(f"{root}/words", self._text(0), position=above, anchor="bottom-center")
        self._wind = scene.add_arrows(
            f"{root}/wind",
            points=np.array([[[-0.9 * reach, 0.0, 0.0], [0.0, 0.0, 0.0]]], np.float32),
            colors=np.array([round(255 * c) for c in WIND[:3]], np.uint8),
            shaft_radius=0.04 * reach,
            head_radius=0.1 * reach,
            head_length=0.22 * reach,
        )
        self._touches = RecordedTouches(scene, root, flight, shift, reach)
        self._world = add_world(scene, root, flight, shift)
        self._wind_from = above - np.array([0.0, 0.0, 0.5 * reach])
        self._reach = reach
        self._every = max(1, round(settings.fps / WORDS_PER_SECOND))
        self._blows: tuple[float, ...] | None = (np.nan,)

    def put(self, k: int) -> None:
        for bodies in self._bodies:
            bodies.put(k)
        if k % self._every == 0:
            self._words.text = self._text(k)
        self._put_wind(k)
        self._touches.put(k)
        for node in self._world:
            node.put(k)

    def _put_wind(self, k: int) -> None:
        """Turn the arrow into the wind, hide it without one."""
        force, air = self._flight.force[k], self._flight.air[k]
        wind, least = (force, LEAST_FORCE) if np.linalg.norm(force) > LEAST_FORCE else (air, LEAST_SPEED)
        size = float(np.linalg.norm(wind))
        blows = tuple(np.round(wind / size, 1)) if size > least else None
        if blows == self._blows:
            return
        self._blows = blows
        self._wind.visible = blows is not None
        if blows is not None:
            along = wind / size
            self._wind.wxyz = turn_x_onto(along)
            self._wind.position = self._wind_from - 0.9 * self._reach * along

    def _text(self, k: int) -> str:
        flight = self._flight
        wind = wind_words(flight, k) if self._times[k] < flight.end else ""
        return f"{flight.label}: {state_words(flight, float(self._times[k]), k)}" + (f", {wind}" if wind else "")


def _surroundings(
    server: Any, flights: Sequence[FilmedFlight], shifts: Sequence[Array], times: Array, settings: FilmSettings
) -> None:
    """Ground, light and the first place of the camera."""
    scene = server.scene
    scene.set_up_direction("+z")
    # shadows and a map of the surroundings take seconds a frame where no GPU draws
    scene.configure_default_lights(enabled=True, cast_shadow=False)
    scene.configure_environment_map(None)
    scene.add_light_ambient("/light", intensity=1.2)
    centre = np.mean([f.desired_position.mean(axis=0) + s for f, s in zip(flights, shifts, strict=True)], axis=0)
    scene.add_grid(
        "/ground",
        width=40.0,
        height=40.0,
        position=(float(centre[0]), float(centre[1]), flights[0].ground),
        cell_size=0.5,
        cell_color=GRID,
        section_size=2.0,
        section_color=GRID,
    )
    seconds = (times - times[0]) / settings.speed
    path = CAMERAS["fixed" if settings.camera == "follow" else settings.camera](flights, seconds, ASPECT)
    wide = float(np.linalg.norm(shifts[-1] - shifts[0]))
    eye, target = _eye(path, 0.5 * wide)
    server.initial_camera.position, server.initial_camera.look_at = tuple(eye), tuple(target)
    server.initial_camera.fov = np.radians(FIELD_OF_VIEW)
    server.initial_camera.up = (0.0, 0.0, 1.0)


def _shifts(flights: Sequence[FilmedFlight], settings: FilmSettings) -> list[Array]:
    """Where each flight's world stands: all in one place, or side by side as the camera sees them."""
    if settings.layout == "over" or len(flights) == 1:
        return [np.zeros(3) for _ in flights]
    # to the camera's right
    turn = np.radians(free_azimuth(flights))
    right = np.array([np.sin(turn), -np.cos(turn), 0.0])
    along = np.concatenate([places @ right for f in flights for places in (f.desired_position, f.position)])
    apart = min(float(np.ptp(along)), 3.0) + 2.4 * max(vehicle_reach(flight) for flight in flights)
    middle = 0.5 * (len(flights) - 1)
    return [apart * (i - middle) * right for i in range(len(flights))]


def _eye(path: CameraPath, wider: float) -> tuple[Array, Array]:
    """Place of the camera and what it looks at, at the first frame."""
    azimuth, elevation = np.radians(path.azimuth[0]), np.radians(path.elevation[0])
    along = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    target = path.look_at[0]
    return target - (path.distance[0] + wider) * along, target
