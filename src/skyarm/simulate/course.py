"""The course of a flight: which scenario holds in which control period, and what was flown under each.

A flight whose scenario changes is flown by one engine after the other, each of which takes over the loop's state where
the one before it stopped (:func:`skyarm.simulate.loop_state.carried`).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from skyarm.files import shown
from skyarm.scenario.change_checks import try_change
from skyarm.scenario.changes import Change, in_order
from skyarm.scenario.in_flight import NONE, Overrides
from skyarm.scenario.scenario_record import Scenario, ScenarioError
from skyarm.simulate.assemble_log import Piece


@dataclass(frozen=True, slots=True)
class Course:
    """What holds at an instant of a flight, and how it came to be.

    Attributes:
        begun: the scenario with which the flight began, or by which it was replaced; its changes are in ``made`` and
            ``coming``.
        made: changes that have taken hold, in order. coming: those that have not.
        overrides: what they made of ``begun``.
        flown: what engines before the present one flew.
    """

    begun: Scenario
    made: tuple[Change, ...] = ()
    coming: tuple[Change, ...] = ()
    overrides: Overrides = NONE
    flown: tuple[Piece, ...] = ()

    @staticmethod
    def of(scenario: Scenario) -> Course:
        """The course of a flight that is about to begin."""
        return Course(begun=scenario, coming=in_order(scenario.changes, scenario.rates.control))

    @property
    def now(self) -> Scenario:
        """The scenario as it holds now, with the changes to come."""
        if not (self.made or self.coming):
            return self.begun
        return dataclasses.replace(self.overrides.of(self.begun), changes=self.coming)

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
        return Course(
            begun=self.begun,
            made=(*self.made, *due),
            coming=self.coming[len(due) :],
            overrides=overrides,
            flown=_and(self.flown, piece),
        )

    def with_values(self, tick: int, values: Mapping[str, Any], piece: Piece) -> Course:
        """The course after changes made by hand, before this control period.

        Raises:
            ScenarioError: one line: a path, or a value, that cannot be.
        """
        if not isinstance(values, Mapping):
            raise ScenarioError(f"values = {shown(values)}: must be a table of paths and values")
        overrides, made = self.overrides, []
        bare = dataclasses.replace(self.begun, changes=()) if self.begun.changes else self.begun
        for path, value in values.items():
            change = Change(at=tick / self.begun.rates.control, path=path, value=value)
            overrides = try_change(bare, overrides, change, "")
            made.append(change)
        flown = _and(self.flown, piece)
        return dataclasses.replace(self, made=(*self.made, *made), overrides=overrides, flown=flown)

    def replaced(self, tick: int, scenario: Scenario, piece: Piece) -> Course:
        """The course after the whole scenario is replaced; what it would have changed by now holds."""
        fresh = Course.of(scenario)
        late = dataclasses.replace(fresh, flown=self.flown)
        return late.then(tick, piece)


def _and(flown: Sequence[Piece], piece: Piece) -> tuple[Piece, ...]:
    return (*flown, piece) if len(piece.flown.states) else tuple(flown)
