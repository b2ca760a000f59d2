"""Stages of a control period whose law is passed over, for commands from outside."""

from __future__ import annotations

from typing import Any

from skyarm.actuation import Command
from skyarm.actuation.tilting import with_rest
from skyarm.records.leaves import blend
from skyarm.reference import Reference
from skyarm.scenario.scenario_record import Scenario
from skyarm.sensors.measurement import Measurement
from skyarm.simulate.stages import Stages


class StagesByActions(Stages):
    """Stages that never ask the law."""

    def __init__(self, scenario: Scenario, command: Command) -> None:
        super().__init__(scenario)
        self._command = command

    def decide(
        self, memory: Any, measurement: Measurement, reference: Reference, path_time: Any = ()
    ) -> tuple[Any, Command]:
        """The command from outside."""
        return memory, with_rest(self.scenario.world.vehicle, self._command)


class CommandedStages(Stages):
    """Stages whose law is passed over where a command is given.

    Attributes:
        given: 1 where there is one. command: it.
    """

    given: Any = 0.0
    command: Any = None

    def decide(
        self, memory: Any, measurement: Measurement, reference: Reference, path_time: Any = ()
    ) -> tuple[Any, Command]:
        """The law, or the command that is given; the law's memory stays then."""
        following, wanted = super().decide(memory, measurement, reference, path_time)
        own = self.given < 0.5
        return blend(own, following, memory), blend(own, wanted, self.command)
