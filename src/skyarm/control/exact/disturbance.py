"""What pushes on base and joints beside the actuators and the model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from skyarm.algebra import Vec3
from skyarm.scalars import add


@dataclass(frozen=True, kw_only=True, slots=True)
class Disturbance:
    """Forces that the model does not know: N, world axes, at the base origin; N m, base axes; of the joints."""

    force: Vec3
    torque: Vec3
    efforts: tuple[Any, ...]

    def __add__(self, other: Disturbance) -> Disturbance:
        return Disturbance(
            force=self.force + other.force,
            torque=self.torque + other.torque,
            efforts=tuple(add(a, b) for a, b in zip(self.efforts, other.efforts, strict=True)),
        )
