"""What pushes on base and joints beside the actuators and the model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.algebra import Vec3
from skyarm.control.blocks.select import data, vector_data
from skyarm.records.units import Unit
from skyarm.scalars import add, sub


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

    def __sub__(self, other: Disturbance) -> Disturbance:
        return Disturbance(
            force=self.force - other.force,
            torque=self.torque - other.torque,
            efforts=tuple(sub(a, b) for a, b in zip(self.efforts, other.efforts, strict=True)),
        )

    def filtered(self, new: Disturbance, share: Any, force_share: Any) -> Disturbance:
        """A share of the way towards a new one, and another share of its force: as a memory keeps it."""
        return Disturbance(
            force=vector_data(self.force + (new.force - self.force) * force_share),
            torque=vector_data(self.torque + (new.torque - self.torque) * share),
            efforts=tuple(data(b + (e - b) * share) for b, e in zip(self.efforts, new.efforts, strict=True)),
        )


def no_disturbance(joints: int) -> Disturbance:
    """None, as a memory keeps it."""
    zero = Vec3(0.0, 0.0, 0.0)
    return Disturbance(force=zero, torque=zero, efforts=(0.0,) * joints)
