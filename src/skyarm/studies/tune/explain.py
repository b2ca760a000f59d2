"""Causes of insufficient margins, and remedies: each part of a loop changed alone, the margins computed again.

The loop is linearised in hover. First mismatches of plant and model and delays are removed, one at a time: the margin
that is gained is the cost of that cause. Then every group of gains is slowed and quickened alone: the group that helps
most, and the least change of it that meets the requirement. Thrust is a matter of statics: a vehicle that needs most of
it to hover saturates before a linear loop shows it. Groups of gains are recognised by the words of their paths, so that
any law has them; a knob whose path says nothing is a group of its own.
"""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from skyarm.scenario.numbers import number_at
from skyarm.scenario.scenario_record import Delays, Scenario
from skyarm.studies.compare.perturbed_plants import thrust_margin
from skyarm.studies.stability.along import Instant
from skyarm.studies.stability.frozen_scenario import LAGS
from skyarm.studies.stability.margins import margins
from skyarm.studies.stability.settled_hover import SettledHover
from skyarm.studies.tune.front import LoopMargins, Required
from skyarm.studies.tune.gain_search import exponent
from skyarm.studies.tune.hover_margins import Edges, one_blas_thread, required_margins
from skyarm.studies.tune.law_knobs import Knob

WORDS: Sequence[tuple[str, str]] = (
    ("observer", r"observ|filter|predict|cutoff|estimat|adapt|trim|answer|switch"),
    ("arm", r"joint|arm|elbow|shoulder|stiffness|damping"),
    ("tip", r"\btip|tool|ee\b"),
    ("base attitude", r"attitude|rate|tilt|yaw|roll|pitch|angular"),
    ("base position", r"position|velocity|pull|base|linear|height|altitude"),
)
"""Group of gains -> words of its paths; the first that is found counts."""

TIME_CONSTANTS = ("time_constant_up", "time_constant_down")
MOMENTS = ("xx", "yy", "zz", "xy", "xz", "yz")

TOLERANCE = 0.05
"""Relative mismatch of plant and model that is not reported."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Difference:
    """Mismatch of plant and model.

    Attributes:
        name: of the part. words: what differs, with both numbers.
        believed: path of the plant -> the believed number.
    """

    name: str
    words: str
    believed: Mapping[str, float]


def group_of(knob: Knob) -> str:
    """The part of the loop that a knob belongs to."""
    for group, words in WORDS:
        if re.search(words, knob.path.replace("_", " ") + " "):
            return group
    return knob.path.split(".")[0]


def groups(knobs: Sequence[Knob]) -> dict[str, list[Knob]]:
    """Knobs by part of the loop, in the order of :data:`WORDS`, then those that stand alone."""
    found: dict[str, list[Knob]] = {name: [] for name, _ in WORDS}
    for knob in knobs:
        found.setdefault(group_of(knob), []).append(knob)
    return {name: members for name, members in found.items() if members}


def slow_gains(members: Sequence[Knob], share: float) -> dict[str, float]:
    """Path of the controller -> number, with the group's bandwidth times a share: stiffness by its square."""
    return {
        f"controller.{'.'.join(place)}": number * share ** exponent(knob)
        for knob in members
        for place, number in knob.numbers
    }


def differences(scenario: Scenario) -> list[Difference]:
    """Mismatches of plant and model in numbers that a loop in hover depends on."""
    plant, belief = scenario.plant.vehicle, scenario.controller.par.model.vehicle
    found: list[Difference] = []
    if len(plant.rotors) == len(belief.rotors):
        lags = [f"rotors.{i}.{name}" for i in range(len(plant.rotors)) for name in TIME_CONSTANTS]
        found += _difference(
            scenario, "motor lag", lags, "the motors' time constants are {ratio:.3g} of those believed"
        )
        thrust = [f"rotors.{i}.thrust_coefficient" for i in range(len(plant.rotors))]
        found += _difference(scenario, "thrust", thrust, "the rotors' thrust is {ratio:.3g} of that believed")
    if plant.n == belief.n:
        for name, bodies in (("arm", [f"links.{i}.body" for i in range(plant.n)]), ("base", ["base"])):
            paths = [f"{body}.mass" for body in bodies]
            more = [f"{body}.inertia.{moment}" for body in bodies for moment in MOMENTS]
            more += [f"{body}.com.{axis}" for body in bodies for axis in "xyz"]
            words = f"the {name} weighs {{ratio:.3g}} of what is believed"
            found += _difference(scenario, name, paths, words, more)
    return found


def _difference(
    scenario: Scenario, name: str, paths: Sequence[str], words: str, more: Sequence[str] = ()
) -> list[Difference]:
    pairs = [tuple(number_at(scenario, f"{side}.vehicle.{path}") for side in ("plant", "model")) for path in paths]
    true, believed = (sum(column) for column in zip(*pairs, strict=True)) if pairs else (0.0, 0.0)
    if not pairs or believed <= 0.0 or abs(true / believed - 1.0) <= TOLERANCE:
        return []
    there = {f"plant.vehicle.{path}": number_at(scenario, f"model.vehicle.{path}") for path in (*paths, *more)}
    return [Difference(name=name, words=words.format(ratio=true / believed), believed=there)]


WORTH = 1.1
"""Gain in margins from which on a cause is named."""

THRUST = 1.5
"""Largest thrust over that of a hover: below, wind and turns leave too little for torques."""

SHARES = (0.25, 0.4, 0.6, 0.8, 1.25, 1.6, 2.5)
"""Of a group's bandwidth that are tried."""

SETTLING = (1.0, 0.6, 0.35)
"""Shares of all bandwidths with which a hover is flown to linearise there; the first that settles."""

ALL = "all gains"


@dataclass(frozen=True, kw_only=True, slots=True)
class Change:
    """A change of a loop: a cause of a lack of margin taken away, or gains of one group that are a remedy.

    A mismatch of plant and model is a cause whatever it costs: not all of it shows in a hover.

    Attributes:
        part: that is changed. words: of a cause. after: the loop then; None where no hover settles, or statics decide.
        relief: factor by which the margins grow. meets: whether that is enough.
        share: of the group's bandwidth. gains: path of the controller -> number.
    """

    part: str
    words: str = ""
    after: Edges | None
    relief: float
    meets: bool = False
    share: float = 1.0
    gains: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True, slots=True)
class Explanation:
    """Explanation of a loop: its margins now, the required ones, causes and remedies, the best first.

    ``now`` is None where no hover settles at all.
    """

    now: Edges | None
    required: Required
    thrust_margin: float
    causes: tuple[Change, ...]
    remedies: tuple[Change, ...]

    @property
    def short(self) -> bool:
        """True if any margin is below the required one."""
        low = self.thrust_margin < THRUST
        return low or self.now is None or self.now.shortness(self.required) > 1.0

    @property
    def parts(self) -> tuple[str, ...]:
        """Parts that are named, the one that costs most first: causes, then the gains that help most."""
        best = [remedy.part for remedy in self.remedies[:1]] if self.short else []
        return tuple(dict.fromkeys([*(cause.part for cause in self.causes), *best]))


def words(found: Explanation) -> list[str]:
    """An explanation for a terminal, a line each."""
    wanted = f"delay {1e3 * found.required.delay:.3g} ms, gains {1 / found.required.gain:.2f}-{found.required.gain:.2f}"
    if found.now is None:
        lines = ["no hover settles, not even with slow gains: thrust, torques or the belief are far off"]
    else:
        stable = found.now.growth <= 0.0
        state = "stable" if stable else f"UNSTABLE, grows {found.now.growth:.3g} 1/s"
        lines = [f"hover: {state}; {_in_words(found.now.margins)}; wanted: {wanted}"]
        if found.now.frequency > 0.0:
            lines.append(f"{'nearest to swinging' if stable else 'swings'} at {found.now.frequency:.2g} Hz")
    for cause in found.causes:
        without = "; in a hover that costs no margin" if cause.relief < WORTH else ""
        if cause.after is not None and not without:
            without = f"; without: {_in_words(cause.after.margins)}"
        lines.append(f"{cause.part}: {cause.words}{without if cause.after is not None else ''}")
    if not found.short:
        lines.append("nothing is short of margin")
    for remedy in found.remedies:
        assert remedy.after is not None
        enough = "enough" if remedy.meets else "helps, not enough"
        lines.append(
            f"{remedy.part} at {remedy.share:g} of its bandwidth: {_in_words(remedy.after.margins)} ({enough})"
        )
    return lines


def _in_words(margins: LoopMargins) -> str:
    """Margins on one line."""
    delay = f"{1e3 * margins.delay:.3g} ms" if math.isfinite(margins.delay) else "over 100 ms"
    rotors, joints = (
        "-".join("none" if k in (0.0, math.inf) else f"{k:.2f}" for k in pair)
        for pair in (margins.rotors, margins.joints)
    )
    return f"delay {delay}, rotors {rotors}, joints {joints}"


def explain(scenario: Scenario, knobs: Sequence[Knob]) -> Explanation:
    """Look at a scenario's loop in hover.

    Args:
        scenario: plant, model, law and delays.
        knobs: of its law.

    Raises:
        ScenarioError: the loop cannot be linearised: one line.
    """
    with one_blas_thread():
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
        plant = {path for each in self._differences for path in each.believed}
        self._base = slow_gains(knobs, 1.0) | {path: number_at(scenario, path) for path in sorted(plant)}
        # the code has no delays: they are put into the linearised loop
        prompt = scenario.with_words(delays=Delays(), payloads=())
        self._loops = SettledHover(prompt, tuple(self._base))
        self._required = required_margins(scenario)
        delays, rate = scenario.delays, scenario.rates.control
        self._delays = {
            "measurement_delay": round(delays.measurement * rate),
            "command_delay": float(delays.command),
            "rotors_delay": float(delays.rotors),
            "joints_delay": float(delays.joints),
        }

    def explanation(self) -> Explanation:
        """Margins now, causes, remedies."""
        spare = thrust_margin(self._scenario.plant.vehicle, float(self._scenario.plant.gravity))
        now = self._edges({})
        causes = [] if now is None else self._causes(now)
        if spare < THRUST:
            words = f"a hover takes {1.0 / spare:.0%} of the thrust; at most {1.0 / THRUST:.0%} are wanted"
            causes.insert(0, Change(part="thrust margin", words=words, after=None, relief=math.inf))
        remedies = [] if now is None or now.shortness(self._required) <= 1.0 else self._remedies(now)
        return Explanation(
            now=now,
            required=self._required,
            thrust_margin=spare,
            causes=tuple(causes),
            remedies=tuple(remedies),
        )

    def _causes(self, now: Edges) -> list[Change]:
        found = [self._change(now, each.name, each.believed, words=each.words) for each in self._differences]
        measured, command = self._delays["measurement_delay"], self._delays["command_delay"]
        late = command + max(self._delays["rotors_delay"], self._delays["joints_delay"])
        delays = []
        if late > 0.0:
            prompt = {"command_delay": 0.0, "rotors_delay": 0.0, "joints_delay": 0.0}
            delays.append(self._change(now, "delay", {}, prompt, words=f"commands take {1e3 * late:.3g} ms"))
        if measured:
            age = 1e3 * measured / self._scenario.rates.control
            words = f"measurements are {age:.3g} ms old"
            delays.append(self._change(now, "delay", {}, {"measurement_delay": 0}, words=words))
        found += [each for each in delays if each.relief >= WORTH]
        return sorted(found, key=lambda cause: -cause.relief)

    def _remedies(self, now: Edges) -> list[Change]:
        found = []
        for name, members in {**groups(self._knobs), ALL: list(self._knobs)}.items():
            tried = [self._change(now, name, slow_gains(members, share), share=share) for share in SHARES]
            settled = [each for each in tried if each.after is not None]
            best = min(settled, key=_order, default=None)
            if best is not None and best.relief >= WORTH:
                found.append(best)
        # all gains at once come last among equals
        return sorted(found, key=lambda each: (*_order(each), each.part == ALL, -each.relief))

    def _change(
        self,
        now: Edges,
        part: str,
        numbers: Mapping[str, float],
        delays: Mapping[str, float] | None = None,
        *,
        words: str = "",
        share: float = 1.0,
    ) -> Change:
        after = self._edges(numbers, delays) if delays else self._edges(numbers)
        short = math.inf if after is None else after.shortness(self._required)
        relief = now.shortness(self._required) / max(short, 1e-9)
        return Change(
            part=part, words=words, after=after, relief=relief, meets=short <= 1.0, share=share, gains=numbers
        )

    def _edges(self, changes: Mapping[str, float], delays: Mapping[str, float] | None = None) -> Edges | None:
        """Edges of the loop with some numbers and delays changed; None where no hover settles."""
        numbers = {path: changes.get(path, value) for path, value in self._base.items()}
        settled = self._settle(numbers)
        if settled is None:
            return None
        values = [numbers[path] for path in self._loops.paths]
        late: Any = self._delays | dict(delays or {})
        loops = {lag: dataclasses.replace(self._loops.open_loop(settled, values, lag), **late) for lag in LAGS}
        by_lag = {lag: margins(loop, measured=False) for lag, loop in loops.items()}
        return Edges.of(Instant(hover=True, time=0.0, by_lag=by_lag, swings=math.nan))

    def _settle(self, numbers: Mapping[str, float]) -> Any:
        """A settled hover with these numbers, or with all gains slower: where the loop would rest if it were stable."""
        usual = slow_gains(self._knobs, 1.0)
        slower = [slow_gains(self._knobs, share) for share in SETTLING]
        lanes = [dict(numbers) | {path: numbers[path] * slow[path] / usual[path] for path in usual} for slow in slower]
        values = {path: np.array([lane[path] for lane in lanes]) for path in self._loops.paths}
        return next((each for each in self._loops.settle(values) if each is not None), None)

    def close(self) -> None:
        """End the threads."""
        self._loops.close()


def _order(change: Change) -> tuple[bool, float]:
    """Least change that is enough first, then the one that helps most."""
    return not change.meets, abs(math.log(change.share)) if change.meets else -change.relief
