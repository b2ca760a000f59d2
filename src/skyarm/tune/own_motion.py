"""The scenario's own motion as one more kind among those that the plants of a search fly.

Gains that are good on drawn motions alone may be worse on the flight that somebody wants. Every fourth plant flies that
one: the same number of flights, and the kind counts as any other does. Its reference may be of any shape, so that these
plants are a batch of their own.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from skyarm.metrics.windows import Window, Windows
from skyarm.records.leaves import parts
from skyarm.scenario.scenario_record import Scenario
from skyarm.tune.candidate_flights import CandidateFlights, Flown
from skyarm.tune.law_knobs import Knob
from skyarm.tune.motion_mix import KINDS
from skyarm.tune.plant_spread import Plants

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

OWN = len(KINDS)
"""Number of the kind."""

EVERY = 4
"""Plants, the last of which flies the scenario's own motion; no multiple of the other kinds, which stay balanced."""

LATEST, LOOKED_AT = 10.0, 5.0
"""s: errors along it count from here on at the latest, and for so long; later ones are left to the last check."""


def shortened(own: Scenario) -> Scenario:
    """The flight along the scenario's own motion for a search: until enough of its steady window is over.

    Args:
        own: as :func:`skyarm.tune.excitation.excited` makes it.
    """
    steady = Windows().of_flight(own.duration, own.windows).steady
    start = min(steady.start, LATEST)
    stop = min(steady.stop, start + LOOKED_AT)
    periods = math.ceil(stop * own.rates.control - 1e-9)
    return dataclasses.replace(own, duration=periods / own.rates.control, windows=Windows(steady=Window(start, stop)))


def with_own(plants: Plants) -> Plants:
    """Plants every fourth of which flies the scenario's own motion; what was drawn of theirs is not flown."""
    kinds = plants.kinds.copy()
    kinds[EVERY - 1 :: EVERY] = OWN
    return dataclasses.replace(plants, kinds=kinds)


class FlightsWithOwn:
    """Flies candidates through plants whose motions were drawn, and through those that fly the scenario's own.

    Args:
        flight: as :func:`skyarm.tune.excitation.excited` made it, with a gust. own: what :func:`shortened` made.
        knobs: of their law. plants: to fly, as :func:`with_own` made them.
        threads: results do not depend on it. seed: of the noise.
    """

    def __init__(
        self, flight: Scenario, own: Scenario, knobs: Sequence[Knob], plants: Plants, *, threads: int = 1, seed: int = 0
    ) -> None:
        self.plants = plants
        self._drawn = CandidateFlights(flight, knobs, plants, threads=threads, seed=seed, gust=True)
        self._own = CandidateFlights(own, knobs, _without_motions(plants), threads=threads, seed=seed)

    def fly(self, logs: Array, plants: int | None = None, others: Plants | None = None) -> Flown:
        """Fly every candidate through the first so many plants, as :meth:`CandidateFlights.fly` does."""
        flown = self.plants if others is None else others
        kinds = flown.kinds[:plants]
        found = []
        for flights, which in ((self._drawn, kinds != OWN), (self._own, kinds == OWN)):
            some = flown.taken(np.flatnonzero(which))
            some = _without_motions(some) if flights is self._own else some
            found.append((which, flights.fly(logs, others=some)))
        return _joined(found, kinds)

    def close(self) -> None:
        """End the threads."""
        self._drawn.close()
        self._own.close()


def of_drawn(flown: Flown) -> Flown:
    """What the flights along drawn motions left."""
    which = flown.kinds != OWN
    return Flown(**{name: table[..., which] for name, table in parts(flown).items()})


def _without_motions(plants: Plants) -> Plants:
    values = {path: numbers for path, numbers in plants.values.items() if not path.startswith("reference.")}
    return dataclasses.replace(plants, values=values)


def _joined(found: Sequence[tuple[Mask, Flown]], kinds: npt.NDArray[np.int_]) -> Flown:
    """Tables of all plants from those of some of them each."""
    tables = {}
    for name, like in parts(found[0][1]).items():
        table = np.empty((*like.shape[:-1], len(kinds)), dtype=like.dtype)
        for which, some in found:
            table[..., which] = getattr(some, name)
        tables[name] = table
    return Flown(**tables)
