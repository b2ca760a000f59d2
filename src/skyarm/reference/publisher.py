"""Publishing a trajectory: samples at one rate, held for a controller that runs at another."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from skyarm.reference.trajectory import Reference, Trajectory


@dataclass(frozen=True, kw_only=True, slots=True)
class Publisher:
    """Holds samples of a trajectory.

    Attributes:
        control_rate: Hz, of the controller's ticks.
        reference_rate: Hz, of the samples; divides the control rate.
    """

    control_rate: float
    reference_rate: float

    def __post_init__(self) -> None:
        for name in ("control_rate", "reference_rate"):
            value = getattr(self, name)
            if not 0.0 < value < float("inf"):
                raise ValueError(f"{name} = {value!r}: must be a finite number of Hz above 0")
        quotient = self.control_rate / self.reference_rate
        # 1e-9: rates such as 1000/3 Hz are given rounded
        if round(quotient) < 1 or abs(quotient - round(quotient)) > 1e-9 * quotient:
            raise ValueError(
                f"reference_rate = {self.reference_rate!r}: must divide control_rate = {self.control_rate!r} Hz"
            )

    @property
    def ratio(self) -> int:
        """Control ticks per sample."""
        return round(self.control_rate / self.reference_rate)

    def held_tick(self, tick: Any) -> Any:
        """Control tick (0, 1, 2 ...) at which the sample held at ``tick`` was taken; an array gives an array."""
        return tick // self.ratio * self.ratio

    def held_time(self, tick: Any) -> Any:
        """Time of that sample, s; one division, so that 10.5 s is 10.5 and meets the switch times."""
        return self.held_tick(tick) / self.control_rate

    def held(self, trajectory: Trajectory, tick: int) -> Reference:
        """Sample the controller sees at a tick, as data."""
        return trajectory.at(self.held_time(tick)).dense()
