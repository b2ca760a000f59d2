"""Film of one or several flights: settings, frames, file."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

import numpy as np

from skyarm.log.flight_log import Log
from skyarm.records.arrays import Array, Pixels, doubles
from skyarm.records.field_rules import accept_fields
from skyarm.records.files import PathLike, shown
from skyarm.records.immutable import immutable
from skyarm.records.units import Unit, nonnegative, units
from skyarm.simulate.drawn_scenario import drawn_scenario
from skyarm.view.figures.flight_facts import end_time
from skyarm.view.film.camera_paths import CAMERAS, camera_named, hides
from skyarm.view.film.captions import Box, Captions, FrameLayout, frame_layout
from skyarm.view.film.filmed_flight import FilmedFlight, film_flights
from skyarm.view.film.insets import insets_of, put_inset
from skyarm.view.film.video_files import FILM_FORMATS, require_film_format
from skyarm.view.picture.frames import Flights, by_flight
from skyarm.view.picture.marks import ghost_solids, marks_of, vehicle_solids
from skyarm.view.picture.mujoco_sink import CameraPath, FramePanel, open_stage
from skyarm.world.scene.vehicle_shapes import longest_boom

Progress = Callable[[int, int], None]
"""Callback (frames drawn, total frames)."""


def make_film(
    flights: Log | Sequence[Log],
    file: PathLike,
    settings: FilmSettings | None = None,
    *,
    labels: Sequence[str] | None = None,
    progress: Progress | None = None,
) -> Path:
    """Render logs as a film and write it as MP4 or animated WebP, by the file's suffix.

    Args:
        flights: one log or several, at most MOST_FLIGHTS.
        file: appears whole or not at all.
        settings: size, speed, camera, layout.
        labels: name of each flight; its law, or its scenario where the laws are the
            same.
        progress: called after each frame.

    Raises:
        ValueError: one line: settings, a log that cannot be filmed, or what is missing
            on this machine.
        OSError: the file cannot be written.
    """
    chosen = settings or FilmSettings()
    path = Path(file)
    write = FILM_FORMATS[require_film_format(path)]
    logs = [flights] if isinstance(flights, Log) else list(flights)
    times = frame_times(logs, chosen)
    filmed = film_flights(logs, times, labels)
    frames = film_frames(filmed, times, _with_title(chosen, logs), progress, logs)
    return write(path, frames, (chosen.width, chosen.height), chosen.fps, len(times))


def frame_times(logs: Sequence[Log], settings: FilmSettings) -> Array:
    """Compute the flight time (s) of each frame of a film, up to the end of the longest
    flight.

    Raises:
        ValueError: a log has no instants, or none is left of them all.
    """
    for log in logs:
        if not log.time.size:
            raise ValueError(
                f"log = {log.info.get('scenario')!r}: must hold at least one control"
                " instant to be filmed"
            )
    longest = max(map(end_time, logs))
    stop = longest if settings.stop is None else min(settings.stop, longest)
    count = round((stop - settings.start) * settings.fps / settings.speed)
    if count < 1:
        raise ValueError(
            f"start = {settings.start:g}: must leave at least one frame before the end,"
            f" {stop:g} s"
        )
    return doubles(settings.start + np.arange(count) * (settings.speed / settings.fps))


def film_frames(
    flights: Sequence[FilmedFlight],
    times: Array,
    settings: FilmSettings,
    progress: Progress | None = None,
    logs: Sequence[Log] = (),
) -> Iterator[Pixels]:
    """Yield the rendered frames of a film as byte arrays (height, width, 3); an inset
    needs the logs.

    Raises:
        NoDisplayError: nothing can be drawn on this machine.
    """
    width, height = settings.width, settings.height
    agents = [len(team) for team in by_flight(flights)]
    layout = frame_layout(
        width, height, len(agents), settings.layout, plot=settings.plot, agents=agents
    )
    panels = zip(layout.panels, _together(flights, settings), strict=True)
    layout = replace(
        layout,
        panels=tuple(_seen_box(box, settings.camera, each) for box, each in panels),
    )
    name = settings.inset
    insets = [] if name is None else insets_of(name, layout.panels, logs, times)
    captions = Captions(flights, times, layout, settings.title or "")
    with open_stage(
        film_panels(flights, times, settings, layout), width, height, fine=settings.fine
    ) as stage:
        for k in range(len(times)):
            picture = captions.frame(stage.draw(k), k)
            for each in insets:
                put_inset(picture, each, layout.scale)
            yield picture
            if progress is not None:
                progress(k + 1, len(times))


def film_panels(
    flights: Flights, times: Array, settings: FilmSettings, layout: FrameLayout
) -> list[FramePanel]:
    """Make the 3D panels of a film: camera, solids, lines and arrows of their
    flights.
    """
    together = _together(flights, settings)
    paths = _cameras(together, times, settings, layout)
    panels = []
    for box, inside, path in zip(layout.panels, together, paths, strict=True):
        solids = [
            solid
            for flight in inside
            for solid in vehicle_solids(flight)
            if not hides(flight, settings.camera, solid.shape)
        ]
        # a sensor sees neither desired poses nor marks
        free = settings.camera in CAMERAS
        if settings.ghost and free:
            solids += [
                solid
                for flight in by_flight(inside)[0]
                for solid in ghost_solids(flight)
            ]
        booms = max(longest_boom(flight.vehicle) for flight in inside)
        marks = marks_of(inside, booms, layout.scale) if free else lambda _: ()
        panels.append(
            FramePanel(
                box.left,
                box.top,
                box.width,
                box.height,
                path,
                solids,
                marks,
                inside[0].scene.ground or 0.0,
            )
        )
    return panels


def _together(flights: Flights, settings: FilmSettings) -> Sequence[Flights]:
    """Flights of each panel."""
    return [list(flights)] if settings.layout == "over" else by_flight(flights)


def _seen_box(box: Box, camera: str, flights: Flights) -> Box:
    """Part of a panel that a depth camera's picture fills, in its middle; the panel of
    another camera.
    """
    sensors = (each.cameras[camera] for each in flights if camera in each.cameras)
    if (sensor := next(sensors, None)) is None:
        return box
    rows, columns = sensor.shape
    wide = min(box.width, max(1, round(box.height * columns / rows)))
    high = min(box.height, max(1, round(box.width * rows / columns)))
    left, top = box.left + (box.width - wide) // 2, box.top + (box.height - high) // 2
    return Box(left, top, wide, high)


def _cameras(
    together: Sequence[Flights],
    times: Array,
    settings: FilmSettings,
    layout: FrameLayout,
) -> list[CameraPath]:
    """Compute the camera path of each panel; flights with one desired path share
    one.
    """
    seconds = (times - times[0]) / settings.speed
    every = [flight for inside in together for flight in inside]
    # the narrowest panel decides, if one camera serves them all
    aspect = min(box.width / box.height for box in layout.panels)
    desired = [
        np.stack([flight.desired_position for flight in inside]) for inside in together
    ]
    # 1 mm, which no picture shows
    if settings.camera in CAMERAS and all(
        each.shape == desired[0].shape and np.allclose(each, desired[0], atol=1e-3)
        for each in desired
    ):
        return [CAMERAS[settings.camera](every, seconds, aspect)] * len(together)
    paths = [
        camera_named(settings.camera, inside)(inside, seconds, box.width / box.height)
        for inside, box in zip(together, layout.panels, strict=True)
    ]
    # a camera each, but one distance: sizes can be compared between panels
    distance = np.max([each.distance for each in paths], axis=0)
    return [replace(each, distance=distance) for each in paths]


def _with_title(settings: FilmSettings, logs: Sequence[Log]) -> FilmSettings:
    """Fill in the title of a film from its scenarios if the settings have none."""
    if settings.title is not None:
        return settings
    scenarios = dict.fromkeys(
        str(drawn_scenario(log).title or log.info["scenario"]) for log in logs
    )
    return replace(settings, title=", ".join(scenarios))


Layout = Literal["side", "over"]
Camera = Literal["follow", "fixed", "tip"]
Side = Annotated[
    int, Unit("pixels", "edge of the picture, an even number", low=64, high=4096)
]


@immutable
class FilmSettings:
    """Settings of a film.

    Attributes:
        layout: "side" (a panel for each flight, side by side) or "over" (all flights in
            one).
        camera: "follow" (goes with the desired position), "fixed" (stands still and
            sees all of the flight), "tip" (close to the desired place of the tip) or
            the name of a depth camera of the flights.
        inset: name of a depth camera, whose picture is in a corner of its panel.
        width, height: pixels, even numbers.
        fps: frames a second of the film. speed: seconds of flight a second of the film.
        start, stop: s of flight; to the end if ``stop`` is left out.
        ghost: whether the desired pose is drawn. plot: whether the tip's error is
            plotted below.
        fine: shadows, smooth edges and rounder shapes; a frame takes some four times as
            long.
        title: above; the scenario's if left out.
    """

    layout: Layout = "side"
    camera: str = "follow"
    inset: str | None = None
    width: Side = 1280
    height: Side = 720
    fps: Annotated[int, Unit("1/s", "frames a second of the film", low=1, high=120)] = (
        30
    )
    speed: Annotated[
        float,
        Unit(
            "",
            "seconds of flight in a second of the film",
            low=0.01,
            high=100.0,
            effect="above 1 plays faster than the flight",
        ),
    ] = 1.0
    start: Annotated[
        float, nonnegative("s", "first instant of the flight in the film")
    ] = 0.0
    stop: Annotated[
        float | None,
        nonnegative("s", "last instant of the flight in the film; None: its end"),
    ] = None
    ghost: bool = True
    plot: bool = True
    fine: bool = False
    title: str | None = None

    def __post_init__(self) -> None:
        accept_fields(self, "")
        if not self.camera:
            camera_named("")
        for field in ("width", "height"):
            if (side := getattr(self, field)) % 2:
                raise ValueError(f"{field} = {side}: must be an even number")
        if self.stop is not None and self.stop <= self.start:
            raise ValueError(
                f"stop = {self.stop!r}: must be larger than start = {self.start:g}"
            )


def size_of(text: str) -> tuple[int, int]:
    """Parse a size such as 1280x720 into width and height.

    Raises:
        ValueError: one line.
    """
    edges = re.fullmatch("([0-9]+)x([0-9]+)", text.lower())
    # no size has so many digits, and int() of a long text takes long
    if not edges or len(text) > 12:
        raise ValueError(
            f"size = {shown(text)}: must be WIDTHxHEIGHT in pixels, such as 1280x720"
        )
    size = int(edges[1]), int(edges[2])
    bounds = units(FilmSettings)["width"]
    if not all(bounds.low <= side <= bounds.high and side % 2 == 0 for side in size):
        raise ValueError(
            f"size = {shown(text)}: must be even numbers from {bounds.low:g} to"
            f" {bounds.high:g}"
        )
    return size
