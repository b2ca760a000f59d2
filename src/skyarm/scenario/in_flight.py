"""What changes in flight make of a scenario: which numbers and parts hold from which control period on.

Changes replace, they do not add up: at any instant the scenario is the one that began, with each path's latest value
in the place of its own. A payload that a change sets is therefore the payload on top of what the vehicle carried at
the start, whatever was set in between. A part that is replaced as a whole takes the changes below it along: a law that
is changed begins with gains of its own. Parts are replaced first, then numbers.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from skyarm.scenario.changes import Change, in_order
from skyarm.scenario.numbers import number_at, require_apart, with_numbers
from skyarm.scenario.scenario_record import Scenario, ScenarioError
from skyarm.scenario.whole_parts import WHOLE_PARTS, below, with_part


@dataclass(frozen=True, slots=True)
class Overrides:
    """What holds in the place of a scenario's own: path -> value, the latest last.

    Attributes:
        parts: whole parts, as a file has them. numbers: by path.
    """

    parts: tuple[tuple[str, Any], ...] = ()
    numbers: tuple[tuple[str, Any], ...] = ()

    def then(self, change: Change) -> Overrides:
        """With one more change."""
        path, value = change.path, change.table
        if not is_part(path, value):
            kept = tuple(pair for pair in self.numbers if pair[0] != path)
            return Overrides(self.parts, (*kept, (path, value)))
        hidden = below(path)
        parts = tuple(pair for pair in self.parts if not _within(pair[0], path, hidden))
        numbers = tuple(pair for pair in self.numbers if not _within(pair[0], path, hidden))
        return Overrides((*parts, (path, value)), numbers)

    def data(self, scenario: Scenario, paths: Sequence[str] = ()) -> Overrides:
        """These as code reads them: the same order whichever was changed last, where order does not matter.

        Args:
            scenario: as the flight began.
            paths: whose numbers are read too where nothing holds in their place, as far as there are any.
        """
        parts, numbers = self.parts_of(scenario), dict(self.numbers)
        for path in paths:
            if path not in numbers:
                with suppress(ScenarioError):
                    numbers[path] = number_at(parts, path)
        if sum("payload" in path for path in numbers) <= 1:  # loads add up, and sums depend on their order
            with suppress(ScenarioError):
                require_apart(parts, tuple(numbers))
                numbers = dict(sorted(numbers.items()))
        return Overrides(self.parts, tuple(numbers.items()))

    def hides(self, path: str) -> bool:
        """Whether a number of the scenario's own no longer counts: another holds in its place, or its part is gone."""
        gone = any(_within(path, own, below(own)) for own, _ in self.parts)
        return gone or any(path == own for own, _ in self.numbers)

    def parts_of(self, scenario: Scenario) -> Scenario:
        """The scenario with its parts replaced, its numbers not yet; without changes to come."""
        if scenario.changes:
            scenario = dataclasses.replace(scenario, changes=())
        for path, value in self.parts:
            scenario = with_part(scenario, path, value)
        return scenario

    def of(self, scenario: Scenario) -> Scenario:
        """The scenario as it is with these; without changes to come."""
        return with_numbers(self.parts_of(scenario), dict(self.numbers))


NONE = Overrides()
"""Nothing is other than it was at the start."""


def is_part(path: str, value: Any) -> bool:
    """Whether a part is replaced as a whole; a yaw that is given as a number is the number that stands there."""
    return path in WHOLE_PARTS and (path != "reference.yaw" or isinstance(value, (str, bool, list, tuple, Mapping)))


def _within(path: str, part: str, hidden: str) -> bool:
    return path == part or path.startswith(hidden)


@dataclass(frozen=True, slots=True)
class Stretch:
    """Control periods of a flight between changes.

    Attributes:
        start: number of the first. overrides: what holds in them.
    """

    start: int
    overrides: Overrides


def stretches(scenario: Scenario) -> tuple[Stretch, ...]:
    """The stretches of a flight, the first as it began, which is of no period where a change takes hold in the first.

    Changes beyond its end come in none.
    """
    rate, found = scenario.rates.control, [Stretch(0, Overrides())]
    for change in in_order(scenario.changes, rate):
        tick = change.tick(rate)
        if tick >= scenario.steps:
            break
        following = Stretch(tick, found[-1].overrides.then(change))
        if tick == found[-1].start and len(found) > 1:
            found[-1] = following
        else:
            found.append(following)
    return tuple(found)


def is_traceable(scenario: Scenario) -> bool:
    """Whether every law of a flight can be traced, so that all of it flies in machine code."""
    return all(stretch.overrides.parts_of(scenario).controller.compiled for stretch in stretches(scenario))


def overrides_at(scenario: Scenario, tick: int) -> Overrides:
    """What holds in a control period."""
    return [stretch for stretch in stretches(scenario) if stretch.start <= tick][-1].overrides


def sources(scenario: Scenario, tick: int) -> dict[str, int]:
    """Which change, by its number in the scenario, sets each number that holds in a control period."""
    rate, found = scenario.rates.control, dict[str, int]()
    for i in sorted(range(len(scenario.changes)), key=lambda i: scenario.changes[i].tick(rate)):
        change = scenario.changes[i]
        if change.tick(rate) > tick:
            break
        if is_part(change.path, change.value):
            hidden = below(change.path)
            found = {path: k for path, k in found.items() if not _within(path, change.path, hidden)}
        else:
            found[change.path] = i
    return found
