"""How much of its force each actuator still gives."""

from __future__ import annotations

from dataclasses import dataclass

from skyarm.scalars import Scalar


@dataclass(frozen=True, slots=True)
class Effectiveness:
    """Shares of the force of whole actuators; a structural 1 is an actuator that no fault touches and folds away.

    Attributes:
        rotors: of thrust and drag torque, one per rotor.
        joints: of the drive's effort, one per joint; friction stays.
    """

    rotors: tuple[Scalar, ...]
    joints: tuple[Scalar, ...]
