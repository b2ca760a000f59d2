"""A reference that rests at some instants and goes on later, as a whole."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.records.field_rules import accept_fields
from skyarm.records.units import Unit
from skyarm.reference.signals import Derivatives, Signal
from skyarm.reference.trajectory import Trajectory
from skyarm.scalars import Scalar, where


@dataclass(frozen=True, kw_only=True, slots=True)
class Paused(Signal):
    """A signal that rests for ``seconds`` from ``start`` on and then goes on where it was."""

    signal: Signal
    start: Annotated[Scalar, Unit("s")]
    seconds: Annotated[Scalar, Unit("s", low=0.0)]

    def __post_init__(self) -> None:
        accept_fields(self, "paused")

    def derivatives(self, t: Any) -> Derivatives:
        """Those of the signal at the time that has passed for it; none while it rests."""
        end = self.start + self.seconds
        value, *rest = self.signal.derivatives(where(t < self.start, t, where(t < end, self.start, t - self.seconds)))
        d1, d2, d3, d4 = (self._moving(t, end, each) for each in rest)
        return value, d1, d2, d3, d4

    def _moving(self, t: Any, end: Any, value: Any) -> Any:
        return value if type(value) is int else where(t < self.start, value, where(t < end, 0.0, value))

    def switch_times(self) -> tuple[float, ...]:
        """Both ends of the rest, and the signal's own times."""
        start, seconds = float(self.start), float(self.seconds)
        own = (t if t < start else t + seconds for t in self.signal.switch_times())
        return tuple(sorted({start, start + seconds, *own}))


def paused(trajectory: Trajectory, rests: Sequence[tuple[float, float]]) -> Trajectory:
    """The trajectory that rests, as a whole, for so many seconds from each (start, seconds) on, in order of time."""
    for start, seconds in rests:
        if seconds <= 0.0:
            continue

        def pause(signal: Signal, start: float = start, seconds: float = seconds) -> Signal:
            return Paused(signal=signal, start=start, seconds=seconds)

        tip = trajectory.tip
        if tip is not None:
            tip = dataclasses.replace(tip, x=pause(tip.x), y=pause(tip.y), z=pause(tip.z))
        push = trajectory.push
        if push is not None:
            push = push.with_signals(pause)
        trajectory = dataclasses.replace(
            trajectory,
            x=pause(trajectory.x),
            y=pause(trajectory.y),
            z=pause(trajectory.z),
            yaw=pause(trajectory.yaw),
            joints=tuple(pause(signal) for signal in trajectory.joints),
            tip=tip,
            push=push,
            load=None if trajectory.load is None else pause(trajectory.load),
        )
    return trajectory
