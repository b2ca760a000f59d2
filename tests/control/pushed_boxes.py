"""Flights that push a box of drawn friction, in up to 0.3 N of wind."""

from __future__ import annotations

import numpy as np

from skyarm.simulate.batch import Batch
from support.worlds import START


def worlds(scenario, count, seed):
    """Metrics, statuses and way of the box (m) in worlds of drawn friction and up to
    0.3 N of wind.
    """
    rng = np.random.default_rng(seed)
    strength, angle = (
        0.3 * np.sqrt(rng.uniform(0.0, 1.0, count)),
        rng.uniform(0.0, 2.0 * np.pi, count),
    )
    values = {
        "world.surfaces.table.material.friction": rng.uniform(0.15, 0.28, count),
        "environment.wind.force_W.0": strength * np.cos(angle),
        "environment.wind.force_W.1": strength * np.sin(angle),
    }
    batch = Moved(scenario, tuple(values), metrics=("contact", "standard"))
    flown = batch.fly(values, seed=seed, episodes=np.arange(count))
    box = next(
        memory for memory in batch.last.components if hasattr(memory, "carried")
    ).carried[0]
    return np.asarray(flown.status) == "completed", box.position.x - START, values


class Moved(Batch):
    """A batch that keeps the last state of its worlds."""

    def _fly_legs(self, *told):
        ends, log = super()._fly_legs(*told)
        self.last = ends[-1][0]
        return ends, log
