"""Rendered images of a running simulation, one instant at a time, for learning environments."""

from __future__ import annotations

import weakref
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import replace
from typing import Any

import numpy as np

from skyarm.log.flight_log import Log
from skyarm.plant.loads import wind_at
from skyarm.records.arrays import Array, Pixels, doubles
from skyarm.records.files import must_be_one_of, shown
from skyarm.records.immutable import immutable
from skyarm.records.leaves import leaves
from skyarm.scenario.scenario_record import Scenario, first_state
from skyarm.simulate.assemble_log import AgentPiece, LoggedSamples, log_of_agent
from skyarm.simulate.inputs import EpisodeInputs, episode_inputs
from skyarm.simulate.loop_state import LoopState
from skyarm.simulate.stages import Stages
from skyarm.view.film.camera_paths import CAMERAS, free_azimuth
from skyarm.view.film.captions import DESIGNED
from skyarm.view.film.filmed_flight import FilmedFlight, film_flight
from skyarm.view.film.make_film import FilmSettings
from skyarm.view.picture.camera import CameraPath
from skyarm.view.picture.marks import (
    COLORS,
    THICK,
    THIN,
    desired_path,
    ghost_solids,
    scene_lines,
    touch_marks,
    vehicle_solids,
    wind_arrow,
)
from skyarm.view.picture.mujoco_sink import FramePanel, Stage, open_stage
from skyarm.world import WindSample
from skyarm.world.scene.vehicle_shapes import longest_boom

OPTIONS = {"width": 480, "height": 480, "camera": "follow", "ghost": True, "fine": False}
"""Fields of :class:`FilmSettings` of a picture, with their defaults."""

LOOKS = 300
"""Largest number of instants at which the whole reference is evaluated, for its line and for a fixed camera."""

FARTHEST = 1e6
"""Largest value of a drawable state; otherwise the vehicle is drawn at its last drawable one."""


@immutable(slots=False)
class InstantLog(Log):
    """Log of single instants of a running simulation, with the scenario that is flown.

    Attributes:
        flown: the scenario.
    """

    flown: Scenario

    @property
    def scenario(self) -> Scenario:
        """Scenario of the running simulation."""
        return self.flown


def picture_settings(given: Mapping[str, Any]) -> FilmSettings:
    """Check the image options of a learning environment and convert them to film settings.

    Raises:
        ValueError: one line: an option that there is not, or a value that cannot be.
    """
    for name in given:
        if name not in OPTIONS:
            raise ValueError(f"{shown(name)}: {must_be_one_of(OPTIONS, name)}")
    return FilmSettings(plot=False, **{**OPTIONS, **given})


def instant_log(inputs: EpisodeInputs, row: int, states: Array, wind: WindSample) -> InstantLog:
    """Make a log of some control instants from states and wind alone, without commands and measurements.

    Args:
        inputs: inputs of the episode.
        row: number of the first instant.
        states: (N, numbers) leaves of the plant's state.
        wind: wind of all these instants.
    """
    empty, zeros = np.zeros((len(states), 0)), np.zeros_like(states)
    samples = LoggedSamples(
        states=states, commands=zeros, measurement=None, readings=(), wind=wind, found=empty, led=empty
    )
    info = {"status": "completed", "rates_hz": {"control": inputs.scenario.rates.control}}
    log = log_of_agent(inputs.scenario, [AgentPiece(inputs.scenario, inputs, row, samples)], None, info=info)
    return InstantLog(**vars(log), flown=inputs.scenario)


class EpisodePictures:
    """Renderer of images of running simulations, one episode after another.

    Args:
        settings: size, camera, ghost, fine.
    """

    def __init__(self, settings: FilmSettings) -> None:
        self._settings = settings
        self._scale = min(settings.height / DESIGNED, settings.width / (1.2 * DESIGNED))
        self._open = ExitStack()
        # also where nobody closes it: before the interpreter ends, the context is given back
        self._finalizer = weakref.finalize(self, self._open.close)
        self._stage: Stage | None = None

    def begin(self, scenario: Scenario) -> None:
        """Start another episode, given its scenario with the sampled parameters."""
        self.close()
        self._scenario, self._inputs = scenario, episode_inputs(scenario)
        self._stages, self._last = Stages(scenario), first_state(scenario)
        self._whole: FilmedFlight | None = None

    def draw(self, now: LoopState) -> Pixels:
        """Render a simulation state as a new image array (height, width, 3).

        Raises:
            NoDisplayError: one line: nothing can be drawn on this machine.
        """
        settings, panel = self._settings, self._panel(now)
        if self._stage is None:
            stage = open_stage([panel], settings.width, settings.height, fine=settings.fine)
            self._stage = self._open.enter_context(stage)
        self._stage.move([panel])
        return self._stage.draw(0).copy()

    def close(self) -> None:
        """Release the graphics context."""
        self._stage = None
        self._open.close()

    def _panel(self, now: LoopState) -> FramePanel:
        settings, scenario = self._settings, self._scenario
        ticks = float(now.ticks)
        time, row = ticks / scenario.rates.control, min(int(ticks), scenario.steps - 1)
        if all(abs(number) < FARTHEST for number in leaves(now.agent.state)):
            self._last = now.agent.state
        state, last = self._last, now.with_agent(replace(now.agent, state=self._last))
        around = self._stages.surroundings(last, time)
        (motion,) = self._stages.motions(last, around)
        wind, numbers = wind_at(around.of(0), motion), doubles([leaves(state)])
        whole = self._whole = self._whole or self._reference(numbers.size, wind)
        log = instant_log(self._inputs, row, numbers, wind)
        # just before the end of the record, so that what touches is drawn
        times = np.array([np.nextafter(log.time[0], -1.0)])
        flight = film_flight(log, scenario.name, COLORS[0], times, whole.desired_tip)
        solids = vehicle_solids(flight) + (ghost_solids(flight) if settings.ghost else [])
        reach = longest_boom(flight.vehicle)
        marks = [
            *desired_path(whole, THIN * self._scale),
            *scene_lines(flight, 0, THICK * self._scale),
            *touch_marks(flight, 0, reach),
            *wind_arrow(flight, 0, reach),
        ]
        camera = self._camera(whole, flight, time)
        at, ground = (0, 0, settings.width, settings.height), flight.scene.ground or 0.0
        return FramePanel(*at, camera, solids, lambda _: marks, ground)

    def _reference(self, numbers: int, wind: WindSample) -> FilmedFlight:
        """Make the film data of an ideal flight that follows its reference exactly."""
        steps, control = self._scenario.steps, self._scenario.rates.control
        states = np.zeros((steps, numbers))
        states[:, 3] = 1.0
        log = instant_log(self._inputs, 0, states, wind)
        times = np.linspace(0.0, (steps - 1) / control, min(steps, LOOKS))
        flight = film_flight(log, self._scenario.name, COLORS[0], times)
        return replace(
            flight,
            position=flight.desired_position,
            quaternion=flight.desired_quaternion,
            joints=flight.desired_joints,
            tip=flight.desired_tip,
        )

    def _camera(self, whole: FilmedFlight, flight: FilmedFlight, time: float) -> CameraPath:
        """Camera at one instant: following the vehicle, or fixed with the whole reference in view."""
        settings = self._settings
        along = settings.camera in ("follow", "tip")
        path = CAMERAS[settings.camera]
        seen = path([flight if along else whole], np.array([time]), settings.width / settings.height)
        return replace(seen, azimuth=np.array([free_azimuth([whole])])) if along else seen
