"""Course of a flight: the scenario in force, the changes that were made, and those that
are still to come.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from skyarm.records.files import shown
from skyarm.records.immutable import positional
from skyarm.scenario.in_flight import NONE, Overrides, try_changes, try_coming
from skyarm.scenario.payload_tables import scheduled_changes
from skyarm.scenario.scenario_record import Change, Scenario, ScenarioError, in_order
from skyarm.simulate.assemble_log import Piece, StoredPiece
from skyarm.simulate.command_delay import CommandRange


@positional
class Course:
    """Scenario in force during a flight, with the changes already made and those still
    scheduled.

    Attributes:
        begun: scenario with which the flight began.
        now: scenario in force, with the changes to come.
        made: changes that have taken hold, in order. coming: changes that have not.
        overrides: replacements by the changes made, in ``begun``.
        flown: pieces flown before the last change made.
    """

    begun: Scenario
    now: Scenario
    made: tuple[Change, ...] = ()
    coming: tuple[Change, ...] = ()
    overrides: Overrides = NONE
    flown: tuple[Piece | StoredPiece, ...] = ()

    @staticmethod
    def of(scenario: Scenario) -> Course:
        """Scenario schedule of a flight before its first control period: all scheduled
        changes are still to come.
        """
        return Course(
            scenario,
            scenario,
            coming=in_order(scheduled_changes(scenario), scenario.rates.control),
        )

    @property
    def command_ranges(self) -> dict[str, CommandRange]:
        """Numbers that each vehicle takes in a command, by its name."""
        return {name: CommandRange.of(each) for name, each in self.now.vehicles.items()}

    @property
    def plan(self) -> Scenario:
        """Scenario that reproduces the flight: the initial one with all changes made
        and still scheduled.
        """
        derived = scheduled_changes(self.begun)[len(self.begun.changes) :]
        every = (*self.made, *self.coming)
        rate = self.begun.rates.control
        by_hand = {
            each.tick(rate): i for i, each in enumerate(every) if each not in derived
        }
        # before a change by hand of the same instant a derived one stays, as it was
        # made before
        changes = tuple(
            each
            for i, each in enumerate(every)
            if each not in derived or i < by_hand.get(each.tick(rate), 0)
        )
        if changes == in_order(self.begun.changes, rate):
            return self.begun
        return replace(self.begun, changes=changes)

    def due(self, tick: int) -> bool:
        """True if a scheduled change takes effect in control period ``tick`` or
        earlier.
        """
        return (
            bool(self.coming) and self.coming[0].tick(self.begun.rates.control) <= tick
        )

    def with_due_changes(self, tick: int, piece: Piece) -> Course:
        """Scenario schedule after applying the changes that are due up to control
        period ``tick``.
        """
        rate = self.begun.rates.control
        overrides = self.overrides
        due = [change for change in self.coming if change.tick(rate) <= tick]
        for change in due:
            overrides = overrides.with_change(change)
        now = overrides.of(self.begun)
        return self._after(due, self.coming[len(due) :], overrides, now, piece)

    def with_values(self, tick: int, values: Mapping[str, Any], piece: Piece) -> Course:
        """Scenario schedule after changes by the user at the start of control period
        ``tick``.

        Raises:
            ScenarioError: one line: a path, or a value, that cannot be, or with which a
                change to come cannot be.
        """
        if not isinstance(values, Mapping):
            raise ScenarioError(
                f"values = {shown(values)}: must be a table of paths and values"
            )
        at = tick / self.begun.rates.control
        made = [Change(at=at, path=path, value=value) for path, value in values.items()]
        overrides, now = try_changes(
            self.begun, self.now, self.overrides, [("", change) for change in made]
        )
        try_coming(self.begun, now, overrides, self.coming)
        return self._after(made, self.coming, overrides, now, piece)

    def _after(
        self,
        made: Sequence[Change],
        coming: tuple[Change, ...],
        overrides: Overrides,
        now: Scenario,
        piece: Piece,
    ) -> Course:
        if coming:
            now = replace(now, changes=coming)
        # a change at the very beginning ends no piece
        flown = (*self.flown, piece) if len(piece.flown[0].states) else self.flown
        return Course(self.begun, now, (*self.made, *made), coming, overrides, flown)
