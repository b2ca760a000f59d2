"""Vectorized environment with the interface of Gymnasium 1.x: thousands of episodes per
call.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.spaces import Box, Dict
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from skyarm.envs.env_lanes import EnvLanes
from skyarm.envs.env_program import LARGEST
from skyarm.envs.env_task import KEYS, Info, make_task, require_open, seeds_of
from skyarm.records.arrays import AnyArray as Array
from skyarm.records.files import must_be_one_of, shown
from skyarm.scenario.scenario_record import Scenario, ScenarioError
from skyarm.simulate.lane_numbers import lane_mask, require_count


class VectorEnvironment(VectorEnv[Array, Array, Array]):
    """Gymnasium environment that simulates many episodes of a scenario in parallel.

    Lane k of ``reset(seed=s)`` flies the episodes of a single environment with
    ``reset(seed=s + k)``, to the bit.

    Args:
        num_envs: number of lanes.
        scenario: record, name or path of a file.
        autoreset_mode: ``"NextStep"`` or ``"SameStep"``, or
            :class:`gymnasium.vector.AutoresetMode`.
        copy: give observations that stay; else views on one buffer, which every call
            writes anew.
        threads: largest number of threads.
        task: further arguments of :func:`skyarm.envs.env_task.make_task`.

    Attributes:
        lanes: the episodes: state, numbers drawn, causes.
    """

    def __init__(
        self,
        num_envs: int = 1,
        *,
        scenario: Scenario | str = "case3",
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        copy: bool = True,
        threads: int = 1,
        **task: Any,
    ) -> None:
        self._mode = _mode(autoreset_mode)
        count = require_count("num_envs", num_envs)
        if not isinstance(copy, (bool, np.bool_)):
            raise ScenarioError(f"copy = {shown(copy)}: must be True or False")
        made = make_task(scenario, **task)
        self.lanes = EnvLanes(made, count, threads=require_count("threads", threads))
        self.num_envs, self._copy = count, bool(copy)
        rate = made.scenario.rates.control
        self.metadata = {
            "render_modes": [],
            "render_fps": rate,
            "autoreset_mode": self._mode,
        }
        self.single_observation_space, self.single_action_space = spaces(self.lanes)
        self.observation_space = batch_space(self.single_observation_space, count)
        self.action_space = batch_space(self.single_action_space, count)
        # lanes whose episode was over after the last step
        self._over: Array = np.zeros(0, dtype=np.intp)
        self._begun = False

    @property
    def scenario(self) -> Scenario:
        """Scenario of the learning task with its nominal parameters."""
        return self.lanes.task.scenario

    @property
    def observations(self) -> Any:
        """Current observations (num_envs, length), as a view that every step
        overwrites; with pictures a table of views.
        """
        return self.lanes.view(slice(None), copy=False)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Array, Info]:
        """Start a new episode in all SIMD lanes, or in those that a mask selects.

        Args:
            seed: lane k takes ``seed + k``, or the k-th of a list; without one its next
                episode begins.
            options: ``{"reset_mask": (num_envs,) True or False}``.
        """
        require_open("reset", closed=self.closed)
        mask = (options or {}).get("reset_mask")
        chosen = lane_mask(mask, self.num_envs)
        if mask is not None and not chosen.any():
            raise ScenarioError("reset_mask: must be True for at least one lane")
        given = seeds_of(seed, self.num_envs)
        # Gymnasium's own generator takes one number; a list is the lanes' alone
        if seed is None or isinstance(seed, (int, np.integer)):
            super().reset(seed=None if seed is None else int(seed))
        if not self._begun:
            # what nobody gave a seed gets one of its own: one is drawn, the others
            # follow it
            first = int(self.np_random.integers(KEYS))
            fresh = [(first + k) % KEYS for k in range(self.num_envs)]
            self.lanes.reseed(np.arange(self.num_envs), fresh)
            given = [
                own if each is None else each
                for each, own in zip(given, fresh, strict=True)
            ]
            self._begun = True
        seeded = {
            k: key for k, key in enumerate(given) if chosen[k] and key is not None
        }
        going = np.setdiff1d(np.flatnonzero(chosen), [*seeded])
        if seeded:
            self.lanes.reseed(np.array([*seeded]), [*seeded.values()])
        if going.size:
            self.lanes.begin(going)
        self._over = np.flatnonzero(self.lanes.ended | self.lanes.truncated)
        return self._observe(), {}

    def step(self, actions: Array) -> tuple[Array, Array, Array, Array, Info]:
        """Simulate one control period of all parallel episodes, as Gymnasium's
        ``step``.

        Args:
            actions: (num_envs, numbers) in [-1, 1]; what is beyond counts as the bound.

        Returns:
            observations (num_envs, numbers), rewards, terminations, truncations, all
            (num_envs,), and infos: where an episode ended before its time ``status``,
            and in the mode SAME_STEP ``final_obs`` and ``final_info``.

        Raises:
            ScenarioError: actions of another shape, no numbers, or numbers that are not
                finite.
        """
        require_open("step", closed=self.closed)
        lanes, over = self.lanes, self._over
        if not self._begun:
            raise ScenarioError("step: must come after reset()")
        lanes.act(actions)
        lanes.step()
        if over.size:
            # all lanes step; what those did that were over is replaced by a beginning
            lanes.begin(over)
        rewards = lanes.reward.copy()
        ended, truncated = lanes.ended.copy(), lanes.truncated.copy()
        self._over = np.flatnonzero(ended | truncated)
        infos = self._infos(ended) if self._over.size else {}
        if self._over.size and self._mode is AutoresetMode.SAME_STEP:
            infos = self._final(infos)
            lanes.begin(self._over)
            self._over = self._over[:0]
        return self._observe(), rewards, ended, truncated, infos

    def close_extras(self, **_: object) -> None:
        """Stop the worker threads when Gymnasium closes the environment."""
        # one that failed while it was made is closed, too, when it is deleted
        if hasattr(self, "lanes"):
            self.lanes.close()

    def _observe(self) -> Any:
        return self.lanes.view(slice(None), copy=self._copy)

    def _infos(self, ended: Array) -> Info:
        """Gymnasium infos with status and cause of early terminations."""
        which = np.flatnonzero(ended)
        if not which.size:
            return {}
        # of objects, so that it is filled with None
        status = np.empty(self.num_envs, dtype=object)
        status[which] = self.lanes.statuses[self.lanes.ending[which].astype(np.intp)]
        return {"status": status, "_status": ended.copy()}

    def _final(self, infos: Info) -> Info:
        """Final observations and infos of the episodes that have ended."""
        mask = np.zeros(self.num_envs, dtype=bool)
        mask[self._over] = True
        final = np.empty(self.num_envs, dtype=object)
        for lane in self._over.tolist():
            # the view is written anew when the next episode begins
            final[lane] = self.lanes.view(lane)
        return {
            "final_obs": final,
            "_final_obs": mask,
            "final_info": infos,
            "_final_info": mask.copy(),
        }


def spaces(lanes: EnvLanes) -> tuple[Any, Box]:
    """Observation and action space of one episode; with pictures a Dict of ``state``
    and each sensor.
    """
    seen, size = len(lanes.observation), len(lanes.actions)
    observed: Any = Box(-LARGEST, LARGEST, (seen,), lanes.dtype)
    if lanes.pictures:
        images = {
            name: Box(0.0, 1.0, each.shape[1:], lanes.dtype)
            for name, each in lanes.pictures.items()
        }
        observed = Dict({"state": observed, **images})
    return observed, Box(-1.0, 1.0, (size,), lanes.dtype)


def _mode(given: AutoresetMode | str) -> AutoresetMode:
    # not DISABLED: all lanes step together, so one that is over must begin anew
    modes = {
        mode.value: mode for mode in (AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP)
    }
    name = getattr(given, "value", given)
    if name not in modes:
        raise ScenarioError(
            f"autoreset_mode = {shown(name)}: {must_be_one_of(modes, name)}"
        )
    return modes[name]
