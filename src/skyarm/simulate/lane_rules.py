"""Numbers of a batch's lanes pass the rules of the fields that they name, as those of a scenario do."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from skyarm.actuation.servo import Servo
from skyarm.records.leaves import part
from skyarm.scenario.in_flight import require_changes
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.paths import places_of
from skyarm.scenario.scenario_record import Scenario, ScenarioError
from skyarm.simulate.draws import draws_needed

TRIED = 1e-3
"""A noise that no field refuses."""

REFUSALS = (ValueError, ArithmeticError)
"""What records raise of a number that they do not take."""


def require_draws(scenario: Scenario, paths: Sequence[str]) -> None:
    """Refuse to vary noise that the scenario has not: no random numbers were put by for it.

    Raises:
        ScenarioError: names the path.
    """
    drawn = draws_needed(scenario)
    for path in paths:
        if path.startswith("sensors.") and draws_needed(with_numbers(scenario, {path: TRIED})) != drawn:
            raise ScenarioError(
                f"paths: {path}: is 0 in this scenario, and a batch draws no numbers for noise that is not there; give "
                "it a small one there"
            )


def require_latencies(scenario: Scenario, paths: Sequence[str]) -> None:
    """Refuse to make the latency of a servo a number of compiled code: the code's queue has one length.

    Raises:
        ScenarioError: names the path.
    """
    for path in paths:
        if path.endswith(".latency"):
            place = places_of(scenario, path)[0]
            if isinstance(part(scenario, place[:-1]), Servo):
                words = "says how many setpoints are on their way, the same for all episodes; fly one study for each"
                raise ScenarioError(f"path = {path!r}: {words}")


class LaneRules:
    """Looks at the lanes in which a path has its least or greatest number, each with all of its numbers.

    What lies between numbers that passed once is not looked at again: a batch flies many times. A lane with a NaN is
    left out: it never flies, and its status says so.

    Args:
        scenario: of the batch. paths: its varied numbers.
    """

    def __init__(self, scenario: Scenario, paths: Sequence[str]) -> None:
        self._scenario, self._paths = scenario, tuple(paths)
        self._passed: dict[str, tuple[float, float]] = {}

    def require(self, values: Mapping[str, Any]) -> None:
        """Refuse numbers with which the scenario could not be made.

        Args:
            values: path -> (lanes,) or one number for all; some of the paths, the others are the scenario's.

        Raises:
            ScenarioError: one line with path, value and what is allowed.
        """
        named = {path: np.asarray(values[path], dtype=float) for path in self._paths if path in values}
        if not named or not all(column.size for column in named.values()):
            return
        table = np.array(np.broadcast_arrays(*named.values())).reshape(len(named), -1)
        lanes = np.flatnonzero(~np.isnan(table).any(axis=0))
        if not lanes.size:
            return
        table = table[:, lanes]
        least, most = table.argmin(axis=1), table.argmax(axis=1)
        looked_at: dict[int, None] = {}
        for path, row, first, last in zip(named, table, least, most, strict=True):
            low, high = self._passed.get(path, (np.inf, -np.inf))
            looked_at |= {int(k): None for k in (first, last) if not low <= row[k] <= high}
        for k in looked_at:
            self._look_at(dict(zip(named, table[:, k].tolist(), strict=True)), int(lanes[k]))
        for path, row, first, last in zip(named, table, least, most, strict=True):
            low, high = self._passed.get(path, (np.inf, -np.inf))
            self._passed[path] = float(min(low, row[first])), float(max(high, row[last]))

    def _look_at(self, numbers: dict[str, float], lane: int) -> None:
        """Make the scenario of one lane; of a refusal the number is named that alone would be refused."""
        words = self._refusal(numbers)
        if words is None:
            return
        for path, value in numbers.items():
            alone = self._refusal({path: value})
            if alone is not None:
                raise ScenarioError(f"values[{path!r}] = {value:g} (lane {lane}): {alone}")
        raise ScenarioError(f"values of lane {lane}: {words}")

    def _refusal(self, numbers: dict[str, float]) -> str | None:
        """What the scenario says of some numbers; None where it takes them."""
        try:
            made = with_numbers(self._scenario, numbers)
            if self._scenario.changes:
                require_changes(made)
        except REFUSALS as error:
            return " ".join(str(error).split())
        return None
