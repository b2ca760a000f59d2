"""Why a loop is short of margin, and what would help: each part changed alone, the margins looked at again.

The loop is linearised in hover. First what the plant has otherwise than the law believes, and delays, are taken away,
one at a time: what the margins gain is what that cause costs. Then every group of gains is slowed and quickened alone:
the group that helps most, and the least change of it that meets the requirement. Thrust is a matter of statics: a
vehicle that needs most of it to hover saturates before a loop that is linear knows.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from skyarm.compare.vehicle_spread import thrust_margin
from skyarm.scenario.numbers import number_at
from skyarm.scenario.scenario_record import Delays, Scenario
from skyarm.stability.open_loop import LAGS
from skyarm.stability.settled_hover import SettledHover
from skyarm.tune.blas_threads import threadpool_limits
from skyarm.tune.explanation import THRUST, WORTH, Cause, Explanation, Remedy
from skyarm.tune.hover_margins import required
from skyarm.tune.law_knobs import Knob
from skyarm.tune.loop_edges import Edges, edges, with_dead_time
from skyarm.tune.loop_parts import differences, groups, slowed

SHARES = (0.25, 0.4, 0.6, 0.8, 1.25, 1.6, 2.5)
"""Of a group's bandwidth that are tried."""

SETTLING = (1.0, 0.6, 0.35)
"""Shares of all bandwidths with which a hover is flown to linearise there; the first that settles."""

ALL = "all gains"

DeadTimes = tuple[int, float, float, float]
"""Of measurements, in control periods; of all commands, and on top of it of the rotors' and of the joints', s."""


def explain(scenario: Scenario, knobs: Sequence[Knob]) -> Explanation:
    """Look at a scenario's loop in hover.

    Args:
        scenario: plant, belief, law and delays.
        knobs: of its law.

    Raises:
        ScenarioError: the loop cannot be linearised: one line.
    """
    with threadpool_limits(1, user_api="blas"):
        probe = _Probe(scenario, knobs)
        try:
            return probe.explanation()
        finally:
            probe.close()


class _Probe:
    """The loop of a scenario with other numbers and delays; code is made once."""

    def __init__(self, scenario: Scenario, knobs: Sequence[Knob]) -> None:
        self._scenario, self._knobs = scenario, tuple(knobs)
        self._differences = differences(scenario)
        own = slowed(knobs, 1.0)
        plant = {path for each in self._differences for path in each.believed}
        self._base = own | {path: number_at(scenario, path) for path in sorted(plant)}
        # the code has no delays: they are put into the linearised loop
        prompt = dataclasses.replace(scenario, delays=Delays(), payloads=())
        self._loops = SettledHover(prompt, tuple(self._base))
        self._required = required(scenario)
        delays, rate = scenario.delays, scenario.rates.control
        self._delays = (
            round(delays.measurement * rate),
            float(delays.command),
            float(delays.rotors),
            float(delays.joints),
        )

    def explanation(self) -> Explanation:
        """Margins now, causes, remedies."""
        vehicle, gravity = self._scenario.world.vehicle, float(self._scenario.world.gravity)
        spare = thrust_margin(vehicle, gravity)
        now = self._edges({})
        causes = [] if now is None else self._causes(now)
        if spare < THRUST:
            words = f"a hover takes {1.0 / spare:.0%} of the thrust; at most {1.0 / THRUST:.0%} are wanted"
            causes.insert(0, Cause(part="thrust margin", words=words, without=None, relief=math.inf))
        remedies = [] if now is None or now.shortness(self._required) <= 1.0 else self._remedies(now)
        return Explanation(
            now=now,
            required=self._required,
            thrust_margin=spare,
            causes=tuple(causes),
            remedies=tuple(remedies),
        )

    def _causes(self, now: Edges) -> list[Cause]:
        found = []
        for each in self._differences:
            without = self._edges(each.believed)
            found.append(self._cause(each.name, each.words, now, without))
        measured, command, rotors, joints = self._delays
        late = command + max(rotors, joints)
        if late > 0.0:
            without = self._edges({}, (measured, 0.0, 0.0, 0.0))
            found.append(self._cause("delay", f"commands take {1e3 * late:.3g} ms", now, without))
        if measured:
            age = 1e3 * measured / self._scenario.rates.control
            without = self._edges({}, (0, command, rotors, joints))
            found.append(self._cause("delay", f"measurements are {age:.3g} ms old", now, without))
        differ = len(self._differences)
        named = [cause for i, cause in enumerate(found) if i < differ or cause.relief >= WORTH]
        return sorted(named, key=lambda cause: -cause.relief)

    def _cause(self, part: str, words: str, now: Edges, without: Edges | None) -> Cause:
        return Cause(part=part, words=words, without=without, relief=self._relief(now, without))

    def _remedies(self, now: Edges) -> list[Remedy]:
        found = []
        for name, members in {**groups(self._knobs), ALL: list(self._knobs)}.items():
            tried = []
            for share in SHARES:
                gains = slowed(members, share)
                after = self._edges(gains)
                if after is not None:
                    tried.append((share, gains, after))
            if not tried:
                continue
            meeting = [each for each in tried if each[2].shortness(self._required) <= 1.0]
            near = min(meeting, key=lambda each: abs(math.log(each[0])), default=None)
            share, gains, after = near or min(tried, key=lambda each: each[2].shortness(self._required))
            relief = self._relief(now, after)
            if relief >= WORTH:
                found.append(
                    Remedy(part=name, share=share, after=after, meets=bool(meeting), relief=relief, gains=gains)
                )
        # least change that is enough first, then what helps most; all gains at once come last among equals
        return sorted(
            found,
            key=lambda r: (not r.meets, abs(math.log(r.share)) if r.meets else -r.relief, r.part == ALL, -r.relief),
        )

    def _relief(self, now: Edges, after: Edges | None) -> float:
        if after is None:
            return 0.0
        return now.shortness(self._required) / max(after.shortness(self._required), 1e-9)

    def _edges(
        self, changes: Mapping[str, float], delays: tuple[int, float, float, float] | None = None
    ) -> Edges | None:
        """Of the loop with some numbers changed; None where no hover settles."""
        numbers = {path: changes.get(path, value) for path, value in self._base.items()}
        settled = self._settled(numbers)
        if settled is None:
            return None
        values = [numbers[path] for path in self._loops.paths]
        loops = [self._loops.opened(settled, values, lag) for lag in LAGS]
        return edges([with_dead_time(loop, *(delays or self._delays)) for loop in loops])

    def _settled(self, numbers: Mapping[str, float]) -> Any:
        """A settled hover with these numbers, or with all gains slower: where the loop would rest if it were stable."""
        lanes = [dict(numbers) | self._slower(numbers, share) for share in SETTLING]
        values = {path: np.array([lane[path] for lane in lanes]) for path in self._loops.paths}
        return next((each for each in self._loops.settle(values) if each is not None), None)

    def _slower(self, numbers: Mapping[str, float], share: float) -> dict[str, float]:
        usual, slow = slowed(self._knobs, 1.0), slowed(self._knobs, share)
        return {path: numbers[path] * slow[path] / usual[path] for path in usual}

    def close(self) -> None:
        """End the threads."""
        self._loops.close()
