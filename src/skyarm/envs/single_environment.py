"""One episode at a time in the conventions of Gymnasium 1.x, by the same machine code as many."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np
import numpy.typing as npt

from skyarm.compile import leaves
from skyarm.envs.env_lanes import EnvLanes
from skyarm.envs.env_task import make_task, require_arguments, require_open, require_options, seed_of
from skyarm.envs.rendering import HUMAN, RENDER_MODES, LanePage, lane_pictures, options_of_modes
from skyarm.envs.vector_environment import spaces
from skyarm.records.files import shown
from skyarm.scenario.scenario_record import Scenario, ScenarioError
from skyarm.simulate.check_endings import find_ending
from skyarm.simulate.lane_numbers import checked_array
from skyarm.view.studio.server import has_viser

Array = npt.NDArray[Any]


class Environment(gymnasium.Env[Array, Array]):
    """A scenario whose commands come from actions.

    Args:
        scenario: record, name or path of a file.
        render_mode: None; "rgb_array": :meth:`render` gives a picture; "human": a page of the studio shows every step.
        render_options: of a picture: width, height, camera, ghost, fine, as a film has them; of a page: port, speed,
            plain, browser. Each mode takes its own of them.
        width, height: of a picture, pixels; in place of those in ``render_options``.
        task: further arguments of :func:`skyarm.envs.env_task.make_task`.

    Attributes:
        lanes: the one lane that flies: state, numbers drawn.
        page: that shows it; None but with "human".
        metadata: ``render_modes`` of this installation: "human" where the extra ``studio`` is installed.
    """

    metadata: dict[str, Any] = {"render_modes": [*RENDER_MODES, HUMAN]}  # noqa: RUF012 - Gymnasium has it so

    def __init__(
        self,
        *,
        scenario: Scenario | str = "case3",
        render_mode: str | None = None,
        render_options: Mapping[str, Any] | None = None,
        width: int | None = None,
        height: int | None = None,
        **task: Any,
    ) -> None:
        self.render_mode = render_mode
        self.page: LanePage | None = None
        pictures, page = options_of_modes(render_options, width, height)
        self._pictures = lane_pictures(render_mode, pictures, 1, human=True)
        require_arguments(task, make_task, "render_mode", "render_options", "width", "height")
        self.lanes = EnvLanes(make_task(scenario, **task), 1)
        if render_mode == HUMAN:
            self.page = LanePage(f"skyarm: {self.lanes.task.scenario.name}", page)
        self.observation_space, self.action_space = spaces(self.lanes)
        # Gymnasium's check_env renders all of these; the class has every mode, so that make() does not replace one
        modes = [*RENDER_MODES, *([HUMAN] if has_viser() else [])]
        self.metadata = {"render_modes": modes, "render_fps": self.scenario.rates.control}
        self._only = np.zeros(1, dtype=np.intp)
        self._begun = self._closed = False

    @property
    def scenario(self) -> Scenario:
        """Scenario of the task, before numbers are drawn for an episode."""
        return self.lanes.task.scenario

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        """Begin episode 0 of a seed, or the next episode without one."""
        require_open("reset", closed=self._closed)
        require_options(options, ())
        key = None if seed is None else seed_of(seed)
        super().reset(seed=None if seed is None else int(seed))
        if key is None and not self._begun:
            key = int(self.np_random.integers(2**32))
        if key is None:
            self.lanes.begin(self._only)
        else:
            self.lanes.reseed(self._only, np.array([key], dtype=np.uint64))
        self._begun = True
        if self.page is not None:
            self.page.begin(self.lanes)
        return self.lanes.observation[:, 0].copy(), {}

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Fly one control period.

        Args:
            action: (numbers,) in [-1, 1]; what is beyond counts as the bound.

        Returns:
            observation, reward, terminated, truncated, and where terminated ``{"status": word, "cause": sentence}``.

        Raises:
            ScenarioError: an action of another shape, no numbers, or numbers that are not finite; or the episode is
                over, or the environment closed.
        """
        require_open("step", closed=self._closed)
        lanes = self.lanes
        if not self._begun or lanes.ended[0] or lanes.truncated[0]:
            raise ScenarioError("step: must come after reset(), and before the end of the episode")
        size = lanes.actions.shape[:1]
        found = checked_array("action", action, [size], f"of real numbers, of shape {size}")
        if not np.isfinite(found).all():
            raise ScenarioError(f"action = {shown(found.tolist())}: must be finite")
        lanes.act(found[None])
        lanes.step()
        ended = bool(lanes.ended[0])
        info = self._why() if ended else {}
        if self.page is not None:
            self.page.show(lanes, info.get("cause", ""))
        return lanes.observation[:, 0].copy(), float(lanes.reward[0]), ended, bool(lanes.truncated[0]), info

    def _why(self) -> dict[str, Any]:
        """Status and cause of an episode that ended before its time."""
        lanes = self.lanes
        ending = int(lanes.ending[0])
        status = str(lanes.statuses[ending])
        if ending == len(lanes.statuses) - 1:
            return {"status": status, "cause": "the command was not finite"}
        scenario = lanes.lane_scenario(0)
        ticks, ratio = int(lanes.loop.ticks[0]), scenario.rates.control // scenario.rates.reference
        held = min(ticks, scenario.steps - 1) // ratio * ratio / scenario.rates.control
        goal = [float(c) for c in scenario.reference.at(held).position]
        x = [float(leaf[0]) for leaf in leaves(lanes.state)]
        ended = find_ending(scenario, ticks / scenario.rates.control, x, goal)
        return {"status": status, "cause": ended.cause if ended else status}

    def render(self) -> Any:
        """Draw the present state, as a frame of a film without its texts; a page shows it anyway.

        Returns:
            (height, width, 3) bytes; None with "human"; None, with a warning, of an environment that was made without
            ``render_mode``.

        Raises:
            ScenarioError: before the first ``reset()``, or after ``close()``.
            NoDisplayError: one line, a ValueError: nothing can be drawn on this machine, and what is missing.
        """
        require_open("render", closed=self._closed)
        if self.page is not None:
            return None
        if self._pictures is None:
            gymnasium.logger.warn('render: gives nothing; make the environment with render_mode="rgb_array"')
            return None
        if not self._begun:
            raise ScenarioError("render: must come after reset()")
        return self._pictures.draw(self.lanes)[0]

    def close(self) -> None:
        """End the threads, and release the resources of drawing; idempotent."""
        self._closed = True
        self.lanes.close()
        if self._pictures is not None:
            self._pictures.close()
        if self.page is not None:
            self.page.close()
