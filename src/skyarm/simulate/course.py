"""The course of a flight: which scenario holds in which control period, and what was flown under each.

A flight whose scenario changes is flown by one engine after the other, each of which takes over the loop's state where
the one before it stopped (:func:`skyarm.simulate.loop_state.carried`).
"""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from skyarm.files import shown
from skyarm.scenario.in_flight import NONE, Overrides, try_changes, try_coming
from skyarm.scenario.scenario_record import Change, Scenario, ScenarioError, in_order
from skyarm.simulate.assemble_log import Piece


@dataclass(frozen=True, slots=True)
class Course:
    """What holds at an instant of a flight, and how it came to be.

    Attributes:
        begun: the scenario with which the flight began, or by which it was replaced.
        now: as it is, with the changes to come.
        made: changes that have taken hold, in order. coming: those that have not.
        overrides: what they made of ``begun``.
        flown: what was flown before the last of them.
    """

    begun: Scenario
    now: Scenario
    made: tuple[Change, ...] = ()
    coming: tuple[Change, ...] = ()
    overrides: Overrides = NONE
    flown: tuple[Piece, ...] = ()

    @staticmethod
    def of(scenario: Scenario) -> Course:
        """The course of a flight that is about to begin."""
        return Course(scenario, scenario, coming=in_order(scenario.changes, scenario.rates.control))

    @property
    def plan(self) -> Scenario:
        """The scenario that flies this again: as it began, with the changes made since and those to come."""
        changes = (*self.made, *self.coming)
        if changes == in_order(self.begun.changes, self.begun.rates.control):
            return self.begun
        return dataclasses.replace(self.begun, changes=changes)

    def due(self, tick: int) -> bool:
        """Whether a change takes hold in this control period."""
        return bool(self.coming) and self.coming[0].tick(self.begun.rates.control) <= tick

    def then(self, tick: int, piece: Piece) -> Course:
        """The course once the changes of this control period have taken hold; ``piece`` was flown until now."""
        rate, overrides = self.begun.rates.control, self.overrides
        due = [change for change in self.coming if change.tick(rate) <= tick]
        for change in due:
            overrides = overrides.then(change)
        now = overrides.of(self.begun)
        return self._after(due, self.coming[len(due) :], overrides, now, piece)

    def with_values(self, tick: int, values: Mapping[str, Any], piece: Piece) -> Course:
        """The course after changes made by hand, before this control period.

        Raises:
            ScenarioError: one line: a path, or a value, that cannot be, or with which a change to come cannot be.
        """
        if not isinstance(values, Mapping):
            raise ScenarioError(f"values = {shown(values)}: must be a table of paths and values")
        at = tick / self.begun.rates.control
        made = [Change(at=at, path=path, value=value) for path, value in values.items()]
        overrides, now = try_changes(self.begun, self.now, self.overrides, [("", change) for change in made])
        try_coming(self.begun, now, overrides, self.coming)
        return self._after(made, self.coming, overrides, now, piece)

    def _after(
        self, made: Sequence[Change], coming: tuple[Change, ...], overrides: Overrides, now: Scenario, piece: Piece
    ) -> Course:
        if coming:
            now = dataclasses.replace(now, changes=coming)
        flown = (*self.flown, piece) if len(piece.flown.states) else self.flown
        return Course(self.begun, now, (*self.made, *made), coming, overrides, flown)

    def replaced(self, tick: int, scenario: Scenario, piece: Piece) -> Course:
        """The course after the whole scenario is replaced; what it would have changed by now holds."""
        return dataclasses.replace(Course.of(scenario), flown=self.flown).then(tick, piece)


@dataclass(frozen=True, slots=True)
class Flying:
    """What flew at a snapshot: copies of the snapshot have it in common, since machine code is not copied.

    Attributes:
        engine: it. held: what it keeps of that instant.
    """

    engine: Any
    held: Any

    def __deepcopy__(self, memo: dict[int, Any]) -> Flying:
        return Flying(self.engine, copy.deepcopy(self.held, memo))


@dataclass(frozen=True, slots=True)
class Snapshot:
    """A session at an instant, to go back to; it may be restored more than once.

    Attributes:
        course: scenario and changes as they were then. tick: control periods flown.
        flying: what flew then.
        session: number of the session that it is of.
    """

    course: Course
    tick: int
    flying: Flying
    session: int
