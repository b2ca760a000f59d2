"""Wrong plants of a tuning: the README's spread for a vehicle, the wind among the forces of the excited flight.

With ``mixed`` each plant flies a motion of its own (:mod:`skyarm.tune.motion_mix`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from skyarm.compare.perturbed_plants import Spread, draw
from skyarm.compare.vehicle_spread import fitted_damping, spread_of
from skyarm.environment import ForceWind
from skyarm.scenario.scenario_record import Scenario
from skyarm.tune.motion_mix import draw_motions

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, slots=True)
class Plants:
    """Plants that are not what the law believes.

    Attributes:
        spread: how wrong they are. eased: share of the README's payload and wind that the spare thrust leaves room for.
        values: path of the scenario -> (plants,).
        kinds: (plants,) kind of motion that each flies; zeros where all fly the same.
    """

    spread: Spread
    eased: float
    values: dict[str, Array]
    kinds: npt.NDArray[np.int_]

    @property
    def count(self) -> int:
        """How many."""
        return len(next(iter(self.values.values())))

    def taken(self, which: npt.NDArray[np.int_]) -> Plants:
        """Those with these numbers."""
        values = {path: numbers[which] for path, numbers in self.values.items()}
        return Plants(spread=self.spread, eased=self.eased, values=values, kinds=self.kinds[which])


def draw_plants(scenario: Scenario, count: int, *, seed: int, mixed: bool = False) -> Plants:
    """Plants for a flight that :func:`skyarm.tune.excitation.excited` made.

    Args:
        scenario: its truth is the middle of the spread; its last force is the wind that is drawn.
        count: plants; the first ones do not depend on it.
        seed: key.
        mixed: a motion for each plant; the scenario flies that of :func:`skyarm.tune.motion_mix.motion`.
    """
    truth = scenario.world.vehicle
    own = float(scenario.delays.command)
    longest = scenario.delays.longest_command
    spread, eased = spread_of(truth, float(scenario.world.gravity), 0.0 if longest is None else longest - own)
    values = draw(scenario, spread, count, seed=seed)
    if not truth.end_effector:
        del values["plant.payload.mass"]
    if "delays.command" in values:
        values["delays.command"] = own + values["delays.command"]
    values = fitted_damping(scenario, spread, values)
    blown = len(scenario.forces) - 1
    for axis in "xyz":
        values[f"environment.forces.{blown}.force_W.{axis}"] = values.pop(f"environment.wind.force_W.{axis}")
    assert isinstance(scenario.forces[blown], ForceWind)
    kinds: npt.NDArray[np.int_] = np.zeros(count, dtype=int)
    if mixed:
        moved, kinds = draw_motions(truth, count, seed=seed)
        values |= moved
    return Plants(spread=spread, eased=eased, values=values, kinds=kinds)


def with_lost(pool: Plants, count: int, lost: npt.NDArray[np.bool_]) -> Plants:
    """The first plants of a pool, up to half of them replaced by others that were lost.

    Those come first that some candidates lost and some flew: they tell one from another. Then those that all lost.

    Args:
        pool: more plants than are wanted.
        count: of the plants that are wanted.
        lost: (candidates, plants of the pool).
    """
    times = lost[:, count:].sum(axis=0)
    order = np.lexsort((np.arange(len(times)), -times, times == len(lost)))
    taken = count + order[times[order] > 0][: count // 2]
    return pool.taken(np.concatenate([np.arange(count - len(taken)), np.sort(taken)]))
