"""Rendered images of a running simulation, one instant at a time, for learning
environments.
"""

from __future__ import annotations

import weakref
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import replace
from typing import Any

import numpy as np

from skyarm.records.arrays import Pixels
from skyarm.records.files import must_be_one_of, shown
from skyarm.records.leaves import leaves
from skyarm.scenario.scenario_record import Scenario, first_state
from skyarm.simulate.inputs import episode_inputs
from skyarm.simulate.loop_state import LoopState
from skyarm.view.film.camera_paths import camera_named, free_azimuth
from skyarm.view.film.captions import DESIGNED
from skyarm.view.film.make_film import FilmSettings
from skyarm.view.picture.frames import FlightFrames, frames_now
from skyarm.view.picture.marks import (
    THIN,
    desired_path,
    ghost_solids,
    marks_of,
    vehicle_solids,
)
from skyarm.view.picture.mujoco_sink import CameraPath, FramePanel, Renderer, open_stage
from skyarm.world.scene.vehicle_shapes import longest_boom

OPTIONS = {
    "width": 480,
    "height": 480,
    "camera": "follow",
    "ghost": True,
    "fine": False,
}
"""Fields of :class:`FilmSettings` of a picture, with their defaults."""

LOOKS = 300
"""Largest number of instants at which the whole reference is evaluated, for its line
and for a fixed camera."""

FARTHEST = 1e6
"""Largest value of a drawable state, at which the renderer's floats of 32 bits are 6 cm
apart; otherwise the vehicle is drawn at its last drawable one."""


def picture_settings(given: Mapping[str, Any]) -> FilmSettings:
    """Check the image options of a learning environment and convert them to film
    settings.

    Raises:
        ValueError: one line: an option that there is not, or a value that cannot be.
    """
    for name in given:
        if name not in OPTIONS:
            raise ValueError(f"{shown(name)}: {must_be_one_of(OPTIONS, name)}")
    settings = FilmSettings(plot=False, **{**OPTIONS, **given})
    camera_named(settings.camera, cure="skyarm.envs.Depth observes a depth camera")
    return settings


class EpisodePictures:
    """Renderer of images of running simulations, one episode after another.

    Args:
        settings: size, camera, ghost, fine.
    """

    def __init__(self, settings: FilmSettings) -> None:
        self._settings = settings
        # as in a film (frame_layout): 1.2 is the narrowest shape with texts of full
        # size
        self._scale = min(settings.height / DESIGNED, settings.width / (1.2 * DESIGNED))
        self._open = ExitStack()
        # also where nobody closes it: before the interpreter ends, the context is given
        # back
        self._finalizer = weakref.finalize(self, self._open.close)
        self._stage: Renderer | None = None

    def begin(self, scenario: Scenario) -> None:
        """Start another episode, given its scenario with the sampled parameters."""
        self.close()
        self._scenario = scenario
        self._last = first_state(scenario)
        self._inputs = episode_inputs(scenario)
        self._whole: FlightFrames | None = None

    def draw(self, now: LoopState) -> Pixels:
        """Render a simulation state as a new image array (height, width, 3).

        Raises:
            NoDisplayError: one line: nothing can be drawn on this machine.
        """
        settings = self._settings
        panel = self._panel(now)
        if self._stage is None:
            stage = open_stage(
                [panel], settings.width, settings.height, fine=settings.fine
            )
            self._stage = self._open.enter_context(stage)
        self._stage.move([panel])
        # overwritten by the next picture: the caller's must stay
        return self._stage.draw(0).copy()

    def close(self) -> None:
        """Release the graphics context."""
        self._stage = None
        self._open.close()

    def _panel(self, now: LoopState) -> FramePanel:
        """Make the panel of a simulation state: camera, solids, lines and arrows."""
        settings = self._settings
        scenario = self._scenario
        time = float(now.ticks) / scenario.rates.control
        # the numbers of a diverged vehicle cannot be drawn, nor can NaN
        if all(abs(number) < FARTHEST for number in leaves(now.agent.state)):
            self._last = now.agent.state
        drawn = now.with_agent(replace(now.agent, state=self._last))
        whole = self._whole = self._whole or self._reference(drawn, time)
        flight = frames_now(
            self._inputs, drawn, time, np.array([time]), whole.desired_tip
        )
        solids = vehicle_solids(flight) + (
            ghost_solids(flight) if settings.ghost else []
        )
        reach = longest_boom(flight.vehicle)
        # of one instant there is neither a trail nor a path, which the whole reference
        # gives
        marks = [
            *desired_path(whole, THIN * self._scale),
            *marks_of([flight], reach, self._scale)(0),
        ]
        camera = self._camera(whole, flight, time)
        return FramePanel(
            0,
            0,
            settings.width,
            settings.height,
            camera,
            solids,
            lambda _: marks,
            flight.scene.ground or 0.0,
        )

    def _reference(self, now: LoopState, time: float) -> FlightFrames:
        """Make the frames of an ideal flight that follows its reference exactly."""
        steps = self._scenario.steps
        control = self._scenario.rates.control
        frames = frames_now(
            self._inputs,
            now,
            time,
            np.linspace(0.0, (steps - 1) / control, min(steps, LOOKS)),
        )
        return replace(frames, position=frames.desired_position, tip=frames.desired_tip)

    def _camera(
        self, whole: FlightFrames, flight: FlightFrames, time: float
    ) -> CameraPath:
        """Camera at one instant: following the vehicle, or fixed with the whole
        reference in view.
        """
        settings = self._settings
        along = settings.camera in ("follow", "tip")
        path = camera_named(settings.camera)
        seen = path(
            [flight if along else whole],
            np.array([time]),
            settings.width / settings.height,
        )
        return (
            replace(seen, azimuth=np.array([free_azimuth([whole])])) if along else seen
        )
