"""Pictures that parallel episodes observe, taken outside of the traced program."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.envs.observed_quantities import Observed
from skyarm.records.arrays import AnyArray as Array
from skyarm.records.leaves import leaves, rebuild
from skyarm.scenario.scenario_record import Scenario
from skyarm.simulate.eyes import Eyes
from skyarm.simulate.loop_state import LoopState
from skyarm.simulate.pictures import Shutter


class LanePictures:
    """Newest pictures that have arrived in parallel episodes, and those on their way.

    Args:
        scenario: scenario of the episodes.
        observation: observed quantities, of which some are pictures.
        lanes: number of episodes. dtype: type of the numbers.

    Attributes:
        images: sensor -> (lanes, rows, columns, 1), observed numbers in [0, 1].
    """

    def __init__(
        self,
        scenario: Scenario,
        observation: Sequence[Observed],
        lanes: int,
        dtype: npt.DTypeLike,
    ) -> None:
        self._rate = scenario.rates.control
        self._seen: dict[str, Any] = {
            each.sees: each for each in observation if each.sees
        }
        sensors = {each.name: each.sensor for each in scenario.agent.cameras}
        self.images = {
            name: np.zeros((lanes, *sensors[name].shape, 1), dtype)
            for name in self._seen
        }
        self._shutters = {name: Shutter.of(scenario, name) for name in self._seen}
        # in the place of a picture comes that which is taken once it has arrived
        self._taken = {
            name: np.repeat(self.images[name][None], shutter.on_their_way + 1, axis=0)
            for name, shutter in self._shutters.items()
        }
        self._eyes = Eyes(scenario) if self._seen else None

    def look(
        self,
        loop: LoopState,
        lanes: Array,
        seeds: Array,
        episodes: Array,
        numbers: Mapping[str, Array],
    ) -> None:
        """Take the pictures of this instant in some lanes, and show those that have
        arrived.

        Args:
            loop: state of the loop, its scalars (lanes,) of all.
            lanes: (m,) numbers of the lanes.
            seeds, episodes, numbers: of all lanes.
        """
        ticks = np.asarray(loop.ticks)[lanes].astype(int)
        for name, shutter in self._shutters.items():
            taken = self._taken[name]
            due = ticks % shutter.every == 0
            if due.any() and self._eyes is not None:
                some = lanes[due]
                own = [leaf[some].astype(float) for leaf in leaves(loop)]
                depths = self._eyes.lane_depths(
                    name,
                    rebuild(loop, iter(own)),
                    ticks[due] / self._rate,
                    ticks[due],
                    episodes[some],
                    seeds=seeds[some],
                    numbers={
                        path: each[some].astype(float) for path, each in numbers.items()
                    },
                )
                place = ticks[due] // shutter.every % len(taken)
                taken[place, some, ..., 0] = self._seen[name].share(depths)
            newest = shutter.newest(ticks)
            self.images[name][lanes] = taken[newest % len(taken), lanes]

    def observation(self, numbers: Array, pictures: dict[str, Array]) -> Any:
        """Observation of an episode: its vector of numbers, with pictures a table of
        both.
        """
        if not pictures:
            return numbers
        return {**({"state": numbers} if numbers.shape[-1] else {}), **pictures}
