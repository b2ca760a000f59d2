"""Environment with one episode at a time and the interface of Gymnasium 1.x."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import Any, Protocol

import gymnasium
import numpy as np

from skyarm.envs.env_lanes import EnvLanes
from skyarm.envs.env_task import Info, make_task, require_open, seed_of
from skyarm.envs.vector_environment import spaces
from skyarm.records.arrays import AnyArray as Array
from skyarm.records.arrays import Pixels
from skyarm.records.files import errors_as, shown
from skyarm.records.leaves import leaves, rebuild
from skyarm.scenario.scenario_record import Scenario, ScenarioError
from skyarm.simulate.check_endings import find_ending
from skyarm.simulate.lane_numbers import checked_array
from skyarm.simulate.loop_state import LoopState

RENDER_MODES = ("rgb_array",)

PICTURES = "skyarm.view.film.episode_pictures"
"""Module that draws pictures, imported by name only when pictures are requested."""


class EpisodeRenderer(Protocol):
    """Interface of a renderer that draws the images of an episode."""

    def begin(self, scenario: Scenario) -> None:
        """Prepare the renderer for an episode, given its scenario."""

    def draw(self, now: LoopState) -> Pixels:
        """Render a simulation state as an image."""
        ...

    def close(self) -> None:
        """Release the resources of the renderer."""


class Environment(gymnasium.Env[Array, Array]):
    """Gymnasium environment that simulates one episode of a scenario at a time.

    Args:
        scenario: record, name or path of a file.
        render_mode: None; "rgb_array": :meth:`render` gives a picture.
        render_options: options of a picture: width, height, camera, ghost, fine, as a
            film has them.
        task: further arguments of :func:`skyarm.envs.env_task.make_task`.

    Attributes:
        lanes: the one lane that flies: state, numbers drawn.
    """

    # Gymnasium has it so
    metadata: dict[str, Any] = {"render_modes": list(RENDER_MODES)}  # noqa: RUF012

    def __init__(
        self,
        *,
        scenario: Scenario | str = "case3",
        render_mode: str | None = None,
        render_options: Mapping[str, Any] | None = None,
        **task: Any,
    ) -> None:
        self.render_mode = render_mode
        self._pictures = _pictures_of(render_mode, render_options)
        self._drawn = False
        self.lanes = EnvLanes(make_task(scenario, **task), 1)
        self.observation_space, self.action_space = spaces(self.lanes)
        self.metadata = {
            "render_modes": list(RENDER_MODES),
            "render_fps": self.scenario.rates.control,
        }
        self._only = np.zeros(1, dtype=np.intp)
        self._begun = self._closed = False

    @property
    def scenario(self) -> Scenario:
        """Scenario of the learning task with its nominal parameters."""
        return self.lanes.task.scenario

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, Info]:
        """Start episode 0 of a random seed, or the next episode without a seed."""
        require_open("reset", closed=self._closed)
        key = None if seed is None else seed_of(seed)
        super().reset(seed=None if seed is None else int(seed))
        if key is None and not self._begun:
            # a key has 32 bits
            key = int(self.np_random.integers(2**32))
        if key is None:
            self.lanes.begin(self._only)
        else:
            self.lanes.reseed(self._only, [key])
        self._begun, self._drawn = True, False
        return self.lanes.view(0), {}

    def step(self, action: Array) -> tuple[Array, float, bool, bool, Info]:
        """Simulate one control period with an action, as Gymnasium's ``step``.

        Args:
            action: (numbers,) in [-1, 1]; what is beyond counts as the bound.

        Returns:
            observation, reward, terminated, truncated, and where terminated
            ``{"status": word, "cause": sentence}``.

        Raises:
            ScenarioError: an action of another shape, no numbers, or numbers that are
                not finite; or the episode is over, or the environment closed.
        """
        require_open("step", closed=self._closed)
        lanes = self.lanes
        if not self._begun or lanes.ended[0] or lanes.truncated[0]:
            raise ScenarioError(
                "step: must come after reset(), and before the end of the episode"
            )
        size = lanes.actions.shape[:1]
        checked = checked_array(
            "action", action, [size], f"of real numbers, of shape {size}"
        )
        if not np.isfinite(checked).all():
            raise ScenarioError(f"action = {shown(checked.tolist())}: must be finite")
        lanes.act(checked[None])
        lanes.step()
        ended = bool(lanes.ended[0])
        info = self._ending() if ended else {}
        return (
            lanes.view(0),
            float(lanes.reward[0]),
            ended,
            bool(lanes.truncated[0]),
            info,
        )

    def _ending(self) -> Info:
        """Status and cause of an early termination, as a Gymnasium info."""
        lanes = self.lanes
        ending = int(lanes.ending[0])
        status = str(lanes.statuses[ending])
        # no state tells of it: the plant stopped before the command
        if ending == len(lanes.statuses) - 1:
            return {"status": status, "cause": "the command was not finite"}
        scenario = lanes.lane_scenario(0)
        ticks = int(lanes.loop.ticks[0])
        ratio = scenario.rates.control // scenario.rates.reference
        # the reference is held between its samples, and after the last period
        held = min(ticks, scenario.steps - 1) // ratio * ratio
        instant = held / scenario.rates.control
        goal = [float(c) for c in scenario.agent.reference.at(instant).position]
        x = [float(leaf[0]) for leaf in leaves(lanes.state)]
        ended = find_ending(scenario, ticks / scenario.rates.control, x, goal)
        return {"status": status, "cause": ended.cause if ended else status}

    def render(self) -> Pixels | None:
        """Render the present vehicle state as an image without text.

        Returns:
            (height, width, 3) bytes; None, with a warning, of an environment that was
            made without ``render_mode``.

        Raises:
            ScenarioError: before the first ``reset()``, or after ``close()``.
            NoDisplayError: one line, a ValueError: nothing can be drawn on this
                machine, and what is missing.
        """
        require_open("render", closed=self._closed)
        if self._pictures is None:
            gymnasium.logger.warn(
                "render: gives nothing; make the environment with"
                ' render_mode="rgb_array"'
            )
            return None
        if not self._begun:
            raise ScenarioError("render: must come after reset()")
        # a renderer is begun at the first picture, which many episodes never ask for
        if not self._drawn:
            self._pictures.begin(self.lanes.lane_scenario(0))
            self._drawn = True
        loop = self.lanes.loop
        now = rebuild(loop, [float(leaf[0]) for leaf in leaves(loop)])
        return self._pictures.draw(now)

    def close(self) -> None:
        """Stop the worker threads and release the renderer."""
        self._closed = True
        self.lanes.close()
        if self._pictures is not None:
            self._pictures.close()


def _pictures_of(
    mode: str | None, options: Mapping[str, Any] | None
) -> EpisodeRenderer | None:
    """Renderer of an environment's images; None without a render mode.

    Raises:
        ScenarioError: one line with field, value and what is allowed.
    """
    if mode is None:
        return None
    if mode not in RENDER_MODES:
        raise ScenarioError(f"render_mode = {shown(mode)}: must be rgb_array or None")
    if not isinstance(options, (Mapping, type(None))):
        raise ScenarioError(
            f"render_options = {shown(options)}: must be a table, as {{'width': 320}}"
        )
    # by name: environments import nothing that draws
    drawing = import_module(PICTURES)
    with errors_as(ScenarioError, "render_options: "):
        pictures: EpisodeRenderer = drawing.EpisodePictures(
            drawing.picture_settings(options or {})
        )
    return pictures
