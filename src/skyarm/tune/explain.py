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
from dataclasses import dataclass
from typing import Any

import numpy as np

from skyarm.compare.vehicle_spread import thrust_margin
from skyarm.scenario.numbers import number_at
from skyarm.scenario.scenario_record import Delays, Scenario
from skyarm.stability.open_loop import LAGS
from skyarm.stability.settled_hover import SettledHover
from skyarm.tune.blas_threads import threadpool_limits
from skyarm.tune.front import LoopMargins, Required
from skyarm.tune.hover_margins import required
from skyarm.tune.law_knobs import Knob
from skyarm.tune.loop_edges import Edges, edges, with_dead_time
from skyarm.tune.loop_parts import differences, groups, slowed

SHARES = (0.25, 0.4, 0.6, 0.8, 1.25, 1.6, 2.5)
"""Of a group's bandwidth that are tried."""

SETTLING = (1.0, 0.6, 0.35)
"""Shares of all bandwidths with which a hover is flown to linearise there; the first that settles."""

WORTH = 1.1
"""Gain in margins from which on a cause is named."""

THRUST = 1.5
"""Largest thrust over that of a hover: below, wind and turns leave too little for torques."""

ALL = "all gains"

DeadTimes = tuple[int, float, float, float]
"""Of measurements, in control periods; of all commands, and on top of it of the rotors' and of the joints', s."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Cause:
    """What costs margin: the part, what of it, the loop without it, and by what factor the margins grow then.

    What the plant has otherwise than believed is a cause whatever it costs: not all of it shows in a hover.
    """

    part: str
    words: str
    without: Edges | None
    relief: float


@dataclass(frozen=True, kw_only=True, slots=True)
class Remedy:
    """A change of one group of gains.

    Attributes:
        part: the group. share: of its bandwidth. after: the loop then. meets: whether that is enough.
        relief: factor by which the margins grow.
        gains: path of the controller -> number.
    """

    part: str
    share: float
    after: Edges
    meets: bool
    relief: float
    gains: Mapping[str, float]


@dataclass(frozen=True, kw_only=True, slots=True)
class Explanation:
    """Of a loop: its margins now, what is required, causes and remedies, the best first.

    ``now`` is None where no hover settles at all.
    """

    now: Edges | None
    required: Required
    thrust_margin: float
    causes: tuple[Cause, ...]
    remedies: tuple[Remedy, ...]

    @property
    def short(self) -> bool:
        """Whether anything is short of what is required."""
        low = self.thrust_margin < THRUST
        return low or self.now is None or self.now.shortness(self.required) > 1.0

    @property
    def parts(self) -> tuple[str, ...]:
        """Parts that are named, the one that costs most first: causes, then the gains that help most."""
        best = [remedy.part for remedy in self.remedies[:1]] if self.short else []
        return tuple(dict.fromkeys([*(cause.part for cause in self.causes), *best]))


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


def words(found: Explanation) -> list[str]:
    """What was found, a line each."""
    wanted = f"delay {1e3 * found.required.delay:.3g} ms, gains {1 / found.required.gain:.2f}-{found.required.gain:.2f}"
    if found.now is None:
        lines = ["no hover settles, not even with slow gains: thrust, torques or the belief are far off"]
    else:
        stable = found.now.growth <= 0.0
        state = "stable" if stable else f"UNSTABLE, grows {found.now.growth:.3g} 1/s"
        lines = [f"hover: {state}; {margins_in_words(found.now.margins)}; wanted: {wanted}"]
        where = "swings" if not stable else "nearest to swinging"
        if found.now.frequency > 0.0:
            lines.append(f"{where} at {found.now.frequency:.2g} Hz")
    for cause in found.causes:
        lines.append(f"{cause.part}: {cause.words}{_without(cause)}")
    if not found.short:
        lines.append("nothing is short of margin")
    for remedy in found.remedies:
        enough = "enough" if remedy.meets else "helps, not enough"
        lines.append(
            f"{remedy.part} at {remedy.share:g} of its bandwidth: {margins_in_words(remedy.after.margins)} ({enough})"
        )
    return lines


def _without(cause: Cause) -> str:
    if cause.without is None:
        return ""
    if cause.relief < WORTH:
        return "; in a hover that costs no margin"
    return f"; without: {margins_in_words(cause.without.margins)}"


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


def margins_in_words(margins: LoopMargins) -> str:
    """Margins on one line."""
    delay = f"{1e3 * margins.delay:.3g} ms" if math.isfinite(margins.delay) else "over 50 ms"
    rotors, joints = (
        "-".join("none" if k in (0.0, math.inf) else f"{k:.2f}" for k in pair)
        for pair in (margins.rotors, margins.joints)
    )
    return f"delay {delay}, rotors {rotors}, joints {joints}"


def plain(found: Explanation) -> dict[str, Any]:
    """What was found as plain data; what is not finite becomes null in JSON."""
    return {
        "short": found.short,
        "parts": list(found.parts),
        "thrust_margin": found.thrust_margin,
        "required": {"delay_margin_s": found.required.delay, "gain_margin": found.required.gain},
        "now": None if found.now is None else _plain_edges(found.now),
        "causes": [
            {
                "part": cause.part,
                "words": cause.words,
                "relief": cause.relief,
                "without": None if cause.without is None else _plain_edges(cause.without),
            }
            for cause in found.causes
        ],
        "remedies": [
            {
                "part": remedy.part,
                "bandwidth": remedy.share,
                "enough": remedy.meets,
                "relief": remedy.relief,
                "after": _plain_edges(remedy.after),
                "gains": dict(remedy.gains),
            }
            for remedy in found.remedies
        ],
    }


def _plain_edges(found: Edges) -> dict[str, Any]:
    margins = found.margins
    return {
        "growth_1_s": found.growth,
        "frequency_hz": found.frequency,
        "delay_margin_s": margins.delay,
        "rotor_gain": margins.rotors,
        "joint_gain": margins.joints,
    }
