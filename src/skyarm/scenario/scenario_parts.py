"""Parts of a scenario: its clocks, its dead times, sensors and drives by name."""

from __future__ import annotations

import numbers
from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.actuation.drive import Drive
from skyarm.estimate.estimator import FULL_STATE
from skyarm.files import shown
from skyarm.records.coerce import concrete
from skyarm.records.field_rules import accept_fields
from skyarm.records.units import Unit
from skyarm.scalars import Scalar
from skyarm.sensors.sensor import Sensor

HIGHEST_RATE = 1_000_000
"""Hz: a clock beyond this is a slip of units."""


class ScenarioError(ValueError):
    """A scenario's description is wrong."""


def whole(value: Any) -> int | None:
    """A whole number, NumPy's too, as Python's; None for anything else."""
    return int(value) if not isinstance(value, bool) and isinstance(value, numbers.Integral) else None


@dataclass(frozen=True, kw_only=True, slots=True)
class Rates:
    """Clock rates in Hz; physics / control and control / reference must be whole numbers."""

    physics: int = 1000
    control: int = 200
    reference: int = 50

    def __post_init__(self) -> None:
        for name in ("physics", "control", "reference"):
            value = getattr(self, name)
            held = whole(value)
            if held is None or not 1 <= held <= HIGHEST_RATE:
                allowed = f"must be a whole number of Hz from 1 to {HIGHEST_RATE}"
                raise ScenarioError(f"rates.{name} = {shown(value)}: {allowed}")
            object.__setattr__(self, name, held)
        for fast, slow in (("physics", "control"), ("control", "reference")):
            if getattr(self, fast) % getattr(self, slow):
                raise ScenarioError(
                    f"rates.{slow} = {getattr(self, slow)}: must divide rates.{fast} = {getattr(self, fast)}"
                )


@dataclass(frozen=True, kw_only=True, slots=True)
class Delays:
    """Dead times of the loop.

    ``measurement`` is a whole number of control periods, the others are of physics steps. ``rotors`` and ``joints`` are
    what the rotors' and the joints' part of a command takes on top of ``command``; an int of 0 is structure: they
    travel together. ``longest_command`` is the longest that ``command`` and the larger of the two get together in a
    batch that varies them from episode to episode; its episodes may have any delay from 0 to that. None: all episodes
    have the same.
    """

    measurement: Annotated[float, Unit("s", "age of the measurement", low=0.0)] = 0.0
    command: Annotated[Scalar, Unit("s", "before a command takes effect", low=0.0)] = 0.0
    longest_command: Annotated[float | None, Unit("s", low=0.0, strict=True)] = None
    rotors: Annotated[Scalar, Unit("s", "before the rotors hear of it, on top", low=0.0)] = 0
    joints: Annotated[Scalar, Unit("s", "before the joints hear of it, on top", low=0.0)] = 0

    def __post_init__(self) -> None:
        accept_fields(self, "delays", ScenarioError)

    @property
    def apart(self) -> bool:
        """Whether rotors and joints hear of a command at different times."""
        return any(not concrete(value) or value != 0 for value in (self.rotors, self.joints))

    @property
    def longest(self) -> float:
        """Of all commands, s; numbers that vary have their longest."""
        if self.longest_command is not None:
            return self.longest_command
        return float(self.command) + max(float(self.rotors), float(self.joints))


@dataclass(frozen=True, kw_only=True, slots=True)
class NamedSensor:
    """A sensor beside the full state; its readings reach the estimator under this name."""

    name: str
    sensor: Sensor

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name.isidentifier() or self.name == FULL_STATE:
            raise ScenarioError(f"sensors: name = {shown(self.name)}: must be a word, and not {FULL_STATE!r}")
        if not isinstance(self.sensor, Sensor):
            raise ScenarioError(f"sensors.{self.name} = {shown(self.sensor)}: must be a Sensor")


@dataclass(frozen=True, kw_only=True, slots=True)
class JointDrive:
    """The drive of one joint, by the joint's name."""

    joint: str
    drive: Drive

    def __post_init__(self) -> None:
        if not isinstance(self.joint, str):
            raise ScenarioError(f"drives: joint = {shown(self.joint)}: must be the name of a joint")
        if not isinstance(self.drive, Drive):
            raise ScenarioError(f"drives.{self.joint} = {shown(self.drive)}: must be a Drive")
