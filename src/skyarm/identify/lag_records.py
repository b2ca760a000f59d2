"""What a log tells of how late a vehicle's loops act: numbers with intervals, and why there are none."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True, slots=True)
class Estimated:
    """A number with the interval that holds it in 95 of 100 flights; SI."""

    value: float
    low: float
    high: float

    @classmethod
    def of(cls, value: float, half: float, *, least: float = 0.0) -> Estimated:
        """Within half a width, and not below what it can be."""
        return cls(value=value, low=max(least, value - half), high=value + half)


@dataclass(frozen=True, kw_only=True, slots=True)
class Lag:
    """How late a group of actuators acts.

    Attributes:
        name: "rotors", or the joint's. together: s, dead time and lag, as a small swing meets them.
        delay: s, dead time. up, down: s, time constants of rotors; of a joint drive both are its own.
        factor: (up, down) over what is believed; NaN where nothing is.
        explained: share of the motion, 0 to 1, that the commands explain once noise and slow disturbances are off.
        reason: why the flight does not tell; empty where it does. apart: whether delay and lag are told apart.
    """

    name: str
    together: Estimated
    delay: Estimated
    up: Estimated
    down: Estimated
    factor: tuple[float, float]
    explained: float
    reason: str = ""
    apart: bool = True

    @property
    def known(self) -> bool:
        """Whether the flight tells."""
        return not self.reason


@dataclass(frozen=True, kw_only=True, slots=True)
class LoopLags:
    """What a log tells of its loops.

    Attributes:
        period: s, of the control. seconds: of the log.
        rotors: None of a vehicle without any. joints: of those whose drives take a torque.
        left_out: joint -> why it was not asked.
    """

    period: float
    seconds: float
    rotors: Lag | None
    joints: tuple[Lag, ...]
    left_out: dict[str, str]
