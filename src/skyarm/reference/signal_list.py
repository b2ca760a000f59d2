"""Several signals of time side by side, one for each component of a quantity."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from skyarm.files import shown
from skyarm.records.field_rules import accept_fields
from skyarm.reference.signal_tables import signal_from
from skyarm.reference.signals import Constant, Signal


@dataclass(frozen=True, slots=True)
class SignalList:
    """A signal for each component; in a file a list, each entry a number, a table or a list of signals."""

    signals: tuple[Signal, ...]

    def __post_init__(self) -> None:
        accept_fields(self, "signals")

    @classmethod
    def from_table(cls, entry: Any, where: str) -> SignalList:
        """Read what a file holds; raises ValueError with one line."""
        if not isinstance(entry, list) or not entry:
            raise ValueError(f"{where} = {shown(entry)}: must be a list of signals of time, one for each component")
        found = (
            Constant(0) if type(each) in (int, float) and each == 0.0 else signal_from(each, f"{where}[{i}]")
            for i, each in enumerate(entry)
        )
        return cls(tuple(found))

    def at(self, t: Any) -> tuple[Any, ...]:
        """Values at time t, s; a structural zero for a signal that is not there."""
        return tuple(signal.derivatives(t)[0] for signal in self.signals)
