"""Recordings: flights as 3D scenes for an interactive viewer, in small files
(``.viser``).

The extra ``studio`` (viser) writes it and brings the player, one page without anything
from elsewhere.
"""

from __future__ import annotations

import base64
from collections.abc import Callable, Sequence
from pathlib import Path
from threading import RLock
from types import ModuleType, SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

from skyarm.log.flight_log import Log
from skyarm.records.arrays import Array, norm
from skyarm.records.files import PathLike, needs_extra, write_atomically
from skyarm.records.immutable import positional
from skyarm.view.film.camera_paths import (
    camera_named,
    free_azimuth,
    looking_towards,
    vehicle_reach,
)
from skyarm.view.film.captions import state_words
from skyarm.view.film.filmed_flight import FilmedFlight, film_flights
from skyarm.view.film.make_film import FilmSettings, Progress, frame_times
from skyarm.view.picture.frames import Flights, by_flight
from skyarm.view.picture.marks import (
    LEAST_FORCE,
    LEAST_SPEED,
    LONGEST_TOUCH,
    TOUCH,
    TOUCH_PER_NEWTON,
    WIND,
    paint_of,
    touch_arrows,
    wind_words,
)
from skyarm.view.picture.mujoco_sink import FIELD_OF_VIEW
from skyarm.view.picture.viser_sink import (
    DIGITS,
    Arrows,
    LineNodes,
    SolidNodes,
    VehicleNodes,
    add_light,
    bytes_of,
    segments,
)
from skyarm.world.scene.vehicle_shapes import rotor_turns

if TYPE_CHECKING:
    from viser import SceneApi
    from viser.infra import StateSerializer

SUFFIXES = ("viser", "html")
"""Suffixes of recordings."""

WORDS_PER_SECOND = 2.0
"""Update rate (Hz) of the numbers next to a vehicle; each change is one more message in
the file."""

ASPECT = 1.0
"""Aspect ratio of the window for which the camera is placed; a phone's is narrower, a
screen's wider."""

GRID, PATH_COLOR, GHOST = (150, 155, 162), (118, 124, 138), (0.45, 0.48, 0.55, 0.3)
"""Colours of grid, desired path and desired pose, between white and black of the
player's page."""

COARSE = 3
"""Decimals (m) of recorded force ends: 1 mm."""


@positional
class Recording:
    """Recorded 3D scene of flights.

    Attributes:
        content: bytes of a ``.viser`` file. seconds: how long it plays.
        html: function that makes one page with player and recording, without external
            files.
    """

    content: bytes
    seconds: float
    html: Callable[[], str]


def record(
    flights: Log | Sequence[Log],
    settings: FilmSettings | None = None,
    *,
    labels: Sequence[str] | None = None,
    progress: Progress | None = None,
) -> Recording:
    """Record flights as a 3D scene that plays in a browser.

    Args:
        flights: one log or several.
        settings: layout, span, speed, frames a second, ghost; the camera's first place.
        labels: name of each flight, as of a film.
        progress: function called after each frame, as of a film.

    Raises:
        ValueError: one line: what cannot be filmed, or the extra that is missing.
    """
    import_viser()
    chosen = settings or FilmSettings()
    logs = [flights] if isinstance(flights, Log) else list(flights)
    times = frame_times(logs, chosen)
    filmed = film_flights(logs, times, labels)
    content = _serialize(filmed, times, chosen, progress)
    return Recording(content, len(times) / chosen.fps, lambda: page_with(content))


def save_recording(recording: Recording, path: PathLike) -> Path:
    """Write a recording as NAME.viser, or with its player page as NAME.html."""
    target = Path(path)
    content = (
        recording.content
        if target.suffix.lower() == ".viser"
        else recording.html().encode()
    )
    return write_atomically(target, content)


class _Stage:
    """Viser scene and camera without a running server, whose messages are recorded.

    viser offers its scene on a running server only, so its parts are put together here:
    what a server sends to all pages (owner "") goes into a buffer that no page empties.
    """

    def __init__(self) -> None:
        viser = import_viser()
        from viser.infra._async_message_buffer import AsyncMessageBuffer

        # nobody waits for a message, so the event loop's only call wakes nobody
        loop: Any = SimpleNamespace(call_soon_threadsafe=lambda *_: None)
        self._sent = AsyncMessageBuffer(loop, persistent_messages=True)
        self._messages = viser.infra.WebsockMessageHandler()
        self._messages.get_message_buffer = lambda: self._sent
        everyone = SimpleNamespace(
            client_id="",
            _websock_connection=self._messages,
            _viser_server=SimpleNamespace(_scene_lifecycle_lock=RLock()),
        )
        self.scene = viser.SceneApi(everyone, None, loop)
        self.scene.set_background_image(None)
        self.initial_camera = viser.InitialCameraConfig(self._messages.queue_message)

    def get_scene_serializer(self) -> StateSerializer:
        """Make viser's serializer of all messages of the scene, past and future
        ones.
        """
        serializer: StateSerializer = self._messages.get_message_serializer(
            lambda message: message.include_in_scene_serialization
        )
        for message in list(self._sent.message_from_id.values()):
            serializer._insert_message(message)
        return serializer


def _serialize(
    flights: Sequence[FilmedFlight],
    times: Array,
    settings: FilmSettings,
    progress: Progress | None,
) -> bytes:
    """Build a 3D scene of flights and play it once; returns the recording as bytes."""
    server = _Stage()
    shifts = _shifts(flights, settings)
    _surroundings(server, flights, shifts, times, settings)
    vehicles = [
        _RecordedFlight(server.scene, f"/flight{i + 1}", flight, shift, settings)
        for i, (flight, shift) in enumerate(zip(flights, shifts, strict=True))
    ]
    # before the serializer: the first frame is then part of the scene as it begins
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
    return serializer.serialize()


class _RecordedFlight:
    """Scene nodes of one flight in a recording: vehicle, desired pose, paths, label,
    wind and contact forces.
    """

    def __init__(
        self,
        scene: SceneApi,
        root: str,
        flight: FilmedFlight,
        shift: Array,
        settings: FilmSettings,
    ) -> None:
        self._flight = flight
        reach = self._reach = vehicle_reach(flight)
        self._blows = np.zeros(3)
        # the origin is the flight's own place
        scene.add_frame(root, show_axes=False, position=shift)
        paint = paint_of(flight.color)
        self._vehicle = VehicleNodes(
            scene,
            f"{root}/vehicle",
            flight.vehicle,
            paint,
            points=flight.scene.attached,
        )
        self._turns = rotor_turns(flight.vehicle, flight.tilts)
        self._ghost = (
            VehicleNodes(scene, f"{root}/desired", flight.vehicle, lambda _: GHOST)
            if settings.ghost
            else None
        )
        _add_path(scene, f"{root}/tip_path", flight.tip, bytes_of(flight.color), 2.0)
        _add_path(
            scene, f"{root}/desired_tip_path", flight.desired_tip, PATH_COLOR, 1.0
        )
        # places and sizes of words and arrows are shares of the reach, chosen by eye
        above = flight.desired_position.mean(axis=0) + np.array([0.0, 0.0, 1.3 * reach])
        self._words = scene.add_label(
            f"{root}/words", self._text(0), position=above, anchor="bottom-center"
        )
        self._wind_to = above - np.array([0.0, 0.0, 0.5 * reach])
        around = self._wind_to + reach * np.array([[-1.0], [1.0]])
        self._wind = Arrows(
            scene, f"{root}/wind", [bytes_of(WIND)], 0.04 * reach, around
        )
        spots = [each.spot for each in flight.scene.arrows] or [flight.position]
        reached = np.array([np.min(spots, axis=(0, 1)), np.max(spots, axis=(0, 1))])
        colors = [bytes_of(TOUCH)] * len(flight.scene.arrows)
        self._touches = Arrows(scene, f"{root}/touches", colors, 0.035 * reach, reached)
        self._lines = LineNodes(scene, f"{root}/lines")
        self._world = SolidNodes(scene, f"{root}/solids", paint)
        self._every = max(1, round(settings.fps / WORDS_PER_SECOND))

    def put(self, k: int) -> None:
        """Move the scene nodes to frame k of the recording."""
        flight = self._flight
        self._vehicle.place(flight.poses, self._turns, k)
        if self._ghost is not None:
            # nothing is wanted of the servos: the desired pose has them at rest
            self._ghost.place(flight.desired_poses, k=k)
        if k % self._every == 0:
            self._words.text = self._text(k)
        force, air = flight.force[k], flight.air[k]
        # a scenario states its wind as a force or as air: the arrow shows the force if
        # there is one
        wind, least = (
            (force, LEAST_FORCE)
            if np.linalg.norm(force) > LEAST_FORCE
            else (air, LEAST_SPEED)
        )
        size = norm(wind)
        along = wind / size if size > least else np.zeros(3)
        # of one length, and turned only by what is seen: turbulence would fill the file
        if k == 0 or (np.round(along, 1) != np.round(self._blows, 1)).any():
            self._blows = along
            self._wind.point(
                np.array([[self._wind_to - 0.9 * self._reach * along, self._wind_to]])
            )
        ends = touch_arrows(flight.scene.arrows, k, TOUCH_PER_NEWTON, LONGEST_TOUCH)
        # millimetres: every digit of a force that trembles costs bytes in each frame
        self._touches.point(np.round(ends, COARSE))
        self._world.place(flight.scene.solids, k)
        self._lines.place(flight.scene.lines, k)

    def _text(self, k: int) -> str:
        """Words next to a vehicle at frame k: its label, state and wind."""
        flight = self._flight
        time = float(flight.times[k])
        wind = wind_words(flight, k) if time < flight.end else ""
        return f"{flight.label}: {state_words(flight, time, k)}" + (
            f", {wind}" if wind else ""
        )


def _add_path(
    scene: SceneApi, name: str, places: Array, color: tuple[int, ...], width: float
) -> None:
    """Add a line through points (F, 3) to the scene."""
    points = segments(np.round(places, DIGITS)).astype(np.float32)
    if len(points):
        shade = np.array(color, np.uint8)
        scene.add_line_segments(
            name, points=points, colors=shade, thickness=width, thickness_units="screen"
        )


def _surroundings(
    server: _Stage,
    flights: Flights,
    shifts: Sequence[Array],
    times: Array,
    settings: FilmSettings,
) -> None:
    """Set up ground, light and initial camera of a recording."""
    scene = server.scene
    scene.set_up_direction("+z")
    add_light(scene, 1.2)
    centre = np.mean(
        [
            f.desired_position.mean(axis=0) + s
            for f, s in zip(flights, shifts, strict=True)
        ],
        axis=0,
    )
    scene.add_grid(
        "/ground",
        width=40.0,
        height=40.0,
        position=(float(centre[0]), float(centre[1]), flights[0].scene.ground or 0.0),
        cell_size=0.5,
        cell_color=GRID,
        section_size=2.0,
        section_color=GRID,
    )
    seconds = (times - times[0]) / settings.speed
    # the player sets its camera once: to follow, all of the flight must be in view
    name = "fixed" if settings.camera == "follow" else settings.camera
    cure = "what a depth camera sees is in a film, .mp4 or .webp"
    path = camera_named(name, cure=cure)(flights, seconds, ASPECT)
    along = looking_towards(float(path.azimuth[0]), float(path.elevation[0]))
    # farther back by half the row of vehicles, which the path of the camera does not
    # know
    eye = (
        path.look_at[0]
        - (path.distance[0] + 0.5 * norm(shifts[-1] - shifts[0])) * along
    )
    server.initial_camera.position = tuple(eye)
    server.initial_camera.look_at = tuple(path.look_at[0])
    server.initial_camera.fov = np.radians(FIELD_OF_VIEW)
    server.initial_camera.up = (0.0, 0.0, 1.0)


def _shifts(flights: Flights, settings: FilmSettings) -> list[Array]:
    """Offset (m) of each flight in a recording: zero to overlay flights, else side by
    side.
    """
    teams = by_flight(flights)
    if settings.layout == "over" or len(teams) == 1:
        return [np.zeros(3) for _ in flights]
    # to the camera's right
    turn = np.radians(free_azimuth(flights))
    right = np.array([np.sin(turn), -np.cos(turn), 0.0])
    along = np.concatenate(
        [places @ right for f in flights for places in (f.desired_position, f.position)]
    )
    # long paths may overlap: beyond 3 m, chosen, flights do not move farther apart
    # 2.4: a reach of each neighbour, and a fifth for room
    apart = min(float(np.ptp(along)), 3.0) + 2.4 * max(map(vehicle_reach, flights))
    middle = 0.5 * (len(teams) - 1)
    return [apart * (i - middle) * right for i, team in enumerate(teams) for _ in team]


def page_with(content: bytes) -> str:
    """Make an HTML page with the player and a recording, which also opens as a local
    file.
    """
    text = base64.b64encode(content).decode("ascii")
    dark = 'matchMedia("(prefers-color-scheme: dark)").matches'
    script = (
        f'<script>window.__VISER_EMBED_DATA__="{text}";'
        f"window.__VISER_EMBED_CONFIG__={{darkMode:{dark}}};</script>"
    )
    player = (
        Path(str(import_viser().__file__)).parent / "client" / "build" / "index.html"
    ).read_text("utf-8")
    return player.replace("</head>", f"{script}</head>", 1)


def import_viser() -> ModuleType:
    """Import viser, with an error that names it if it is not installed.

    Raises:
        ValueError: it is missing.
    """
    try:
        import viser
    except ImportError:
        raise ValueError(
            f"viser: is missing; a recording {needs_extra('studio')}"
        ) from None
    return viser
