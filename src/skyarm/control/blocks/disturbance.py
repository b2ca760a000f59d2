"""What pushes on base and joints beside the actuators and the model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.algebra import Vec3
from skyarm.records.units import Unit
from skyarm.scalars import add


@dataclass(frozen=True, kw_only=True, slots=True)
class Disturbance:
    """Forces that the model does not know: N, world axes, at the base origin; N m, base axes; of the joints."""

    force: Annotated[Vec3, Unit("N", "fed forward, world axes")]
    torque: Annotated[Vec3, Unit("N m", "fed forward, base axes")]
    efforts: Annotated[tuple[Any, ...], Unit("N m or N", "fed forward")]

    def __add__(self, other: Disturbance) -> Disturbance:
        return Disturbance(
            force=self.force + other.force,
            torque=self.torque + other.torque,
            efforts=tuple(add(a, b) for a, b in zip(self.efforts, other.efforts, strict=True)),
        )
