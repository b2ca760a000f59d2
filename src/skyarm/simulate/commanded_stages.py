"""The stages of a session's period, in which a command from outside may take the law's place."""

from __future__ import annotations

from typing import Any

from skyarm.actuation import Command
from skyarm.reference import Reference
from skyarm.sensors.measurement import Measurement
from skyarm.simulate.loop_state import blend
from skyarm.simulate.stages import Stages


class CommandedStages(Stages):
    """Stages whose law is passed over where a command is given.

    Attributes:
        given: 1 where there is one. command: it.
    """

    given: Any = 0.0
    command: Any = None

    def decide(self, memory: Any, measurement: Measurement, reference: Reference) -> tuple[Any, Command]:
        """The law, or the command that is given; the law's memory stays then."""
        following, wanted = super().decide(memory, measurement, reference)
        own = self.given < 0.5
        return blend(own, following, memory), blend(own, wanted, self.command)
