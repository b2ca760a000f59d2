"""Trial: a hover scenario with entries in place of its own, and numbers that are
expressions of a value.

Expressions name the value and facts of the vehicle (:mod:`skyarm.studies.trial.facts`),
so that one table serves every vehicle. ``library/motions.toml`` has motions by name,
and says what the words of a table mean.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, field
from importlib import resources
from typing import Any, ClassVar

from skyarm.records.arrays import Array, Columns
from skyarm.records.files import errors_as, must_be_one_of, shown
from skyarm.records.immutable import immutable
from skyarm.scenario.numbers import number_at, with_numbers
from skyarm.scenario.scenario_file import scenario_from
from skyarm.scenario.scenario_record import Scenario, ScenarioError
from skyarm.sensing.measurement import SensorNoise
from skyarm.studies.sweep.expressions import read_expression
from skyarm.studies.trial.facts import Facts, TrialSetting

NOISE = SensorNoise(
    position=0.001,
    velocity=0.01,
    attitude=0.002,
    rate=0.01,
    joints=0.001,
    joint_rates=0.01,
)
"""White noise of noisy trials: 1 mm, 1 cm/s, 2 mrad, 0.01 rad/s, joints 1 mrad and 0.01
rad/s."""

DELAY = 0.005
"""Age (s) of a measurement in noisy trials, one control period; laws with an option for
it receive it."""

NOISY: Mapping[str, Any] = {
    "sensors": asdict(NOISE),
    "delays": {"measurement": DELAY},
}
"""Entries of the scenario's file of a noisy trial."""

MOTIONS: Mapping[str, dict[str, Any]] = tomllib.loads(
    (resources.files("skyarm.studies.trial") / "library" / "motions.toml").read_text(
        "utf-8"
    )
)
"""Tables "parts", "bases" and "arms": entries of a scenario file by name."""

Maker = Callable[[Scenario, TrialSetting, float], Scenario]
"""Function that completes the scenario of a trial, of its vehicle and value, where no
entries of a file can."""


@immutable
class Trial:
    """Trial of any vehicle with an arm at several values, the easiest first.

    Attributes:
        name: short name. title: one line. unit: unit of the values as they are shown.
        values: values for the paper's vehicle, SI.
        share: share of the values that another vehicle is given, an expression.
        file: scenario that the entries change; empty for the hover of a vehicle.
        base, arm: motions of that hover by name; an empty base stands.
        entries: entries in place of those of the scenario's file; "*" is each joint by
            name.
        numbers: path -> expression, where values are data of one scenario; * is every
            joint or rotor, "now" the number that is there.
        made: name of a maker.
        noisy: sensor noise and a measurement that is 5 ms old, a delay that the law
            knows.
    """

    name: str
    title: str
    unit: str = ""
    values: tuple[float, ...]
    share: str = "1"
    file: str = ""
    base: str = ""
    arm: str = "still"
    entries: Mapping[str, Any] = field(default_factory=dict)
    numbers: Mapping[str, str] = field(default_factory=dict)
    made: str = ""
    noisy: bool = False

    makers: ClassVar[Mapping[str, Maker]] = {}
    """Makers by name."""

    def of(self, setting: TrialSetting) -> tuple[float, ...]:
        """Values of the trial, scaled to a vehicle, SI."""
        share = evaluate(self.share, setting.facts, "share")
        if share == 1.0:
            return tuple(map(float, self.values))
        # three digits, so that tables show the scaled values that fly
        return tuple(float(f"{value * share:.3g}") for value in self.values)

    def scenario(self, setting: TrialSetting, value: float) -> Scenario:
        """Scenario of the trial at one value."""
        built = self.built(setting, value)
        made = self.makers[self.made](built, setting, value) if self.made else built
        numbers = self.numbers_of(setting, value)
        with errors_as(ScenarioError, "numbers: "):
            return with_numbers(made, numbers)

    def built(self, setting: TrialSetting, value: float) -> Scenario:
        """Scenario of the trial at one value before its numbers."""
        facts = setting.facts | {"value": value}
        document = dict(setting.document)
        if not self.file:
            at = {"kind": "signals", "x": 0, "y": 0, "z": setting.facts["height"]}
            base = at | fill_in(MOTIONS["bases"].get(self.base, {}), facts, setting)
            arm = [
                fill_in(MOTIONS["arms"][self.arm], facts | joint, setting)
                for joint in setting.joints.values()
            ]
            document["reference"] = {"base": base, "joints": arm}
        if self.noisy:
            document = with_entries(document, NOISY)
        whole = with_entries(document, fill_in(self.entries, facts, setting))
        return scenario_from(whole, setting.folder, setting.given)

    def numbers_of(self, setting: TrialSetting, value: float) -> dict[str, float]:
        """Numbers by path in which a value differs from another; empty where each value
        is a scenario of its own.
        """
        facts = setting.facts | {"value": value}
        found = dict[str, float]()
        # building a scenario takes time: only "now" needs that of the value
        built = (
            self.built(setting, value)
            if "now" in " ".join(self.numbers.values())
            else setting.hover
        )
        for pattern, expression in self.numbers.items():
            for path, own in _each(pattern, setting):
                now = {"now": number_at(built, path)} if "now" in expression else {}
                found[path] = evaluate(
                    expression, facts | own | now, f'numbers."{pattern}"'
                )
        return found


def _each(pattern: str, setting: TrialSetting) -> Iterator[tuple[str, Facts]]:
    """Paths of a pattern with the facts of the joint of each."""
    if "*" not in pattern:
        yield pattern, {}
    elif ".rotors." in pattern:
        yield from (
            (pattern.replace("*", str(i)), {})
            for i, _ in enumerate(setting.truth.rotors)
        )
    else:
        for i, (name, own) in enumerate(setting.joints.items()):
            # a path names the joint of a drive, and numbers all other joints
            yield pattern.replace("*", name if ".drives." in pattern else str(i)), own


def evaluate(text: str, facts: Facts, field: str = "expression") -> float:
    """Number of an expression of facts.

    Args:
        text: the expression, with or without the = by which entries tell it from a
            word.
        facts: numbers by name.
        field: name of the field in messages.

    Raises:
        ExpressionError: one line that begins with the field.
    """
    return float(read_expression(text.removeprefix("="), facts, field).value(facts))


def columns_of(
    numbers: Mapping[str, str], scenario: Scenario, draws: Mapping[str, Array]
) -> Columns:
    """Numbers of flights: parameter path -> values (flights,).

    Args:
        numbers: path -> expression of the draws and of "now", the number of the
            scenario.
        scenario: scenario that all flights have in common.
        draws: name -> values (flights,).

    Raises:
        ExpressionError: one line that begins with the path.
    """
    every = {
        path: read_expression(text, (*draws, "now"), f'numbers."{path}"')
        for path, text in numbers.items()
    }
    return {
        path: each.value({**draws, "now": number_at(scenario, path)})
        for path, each in every.items()
    }


def fill_in(
    entry: Any, facts: Facts, setting: TrialSetting, at: str = "entries"
) -> Any:
    """Entry of a scenario file with its expressions and named parts filled in; ``at``
    is its place, in messages.

    Raises:
        ValueError: one line: an expression that cannot be read, or a part that is not
            there.
    """
    match entry:
        case dict():
            filled = {
                key: fill_in(each, facts, setting, f"{at}.{key}")
                for key, each in entry.items()
                if key != "*"
            }
            if "*" in entry:
                for name, own in setting.joints.items():
                    filled[name] = fill_in(
                        entry["*"], facts | own, setting, f"{at}.{name}"
                    )
            return filled
        case list():
            return [
                fill_in(each, facts, setting, f"{at}[{i}]")
                for i, each in enumerate(entry)
            ]
        case str() if entry.startswith("="):
            return evaluate(entry, facts, at)
        case "value":
            raise ValueError(f"{at} = 'value': must be '= value', an expression")
        case str() if entry.startswith("{"):
            name = entry.strip("{}")
            there = setting.words | MOTIONS["parts"]
            if name not in there:
                raise ValueError(
                    f"{at} = {shown(entry)}: {must_be_one_of(there, name)}"
                )
            return fill_in(there[name], facts, setting, at)
    return entry


def with_entries(
    table: Mapping[str, Any], entries: Mapping[str, Any]
) -> dict[str, Any]:
    """Table of a file with entries in place of its own, tables key by key; a table for
    a list in each of its tables.
    """
    changed = dict(table)
    for key, entry in entries.items():
        match table.get(key), entry:
            case dict() as own, dict():
                changed[key] = with_entries(own, entry)
            case list() as own, dict():
                changed[key] = [with_entries(each, entry) for each in own]
            case _:
                changed[key] = entry
    return changed
