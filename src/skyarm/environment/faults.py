"""Faults of actuators: a loss of force during a flight, in the plant only, unknown to the controller."""

from __future__ import annotations

import numbers
from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.environment.effectiveness import Effectiveness
from skyarm.files import Fields, number, shown
from skyarm.records.coerce import concrete, plain_number
from skyarm.records.units import Unit
from skyarm.scalars import Scalar, mul, where
from skyarm.vehicle.vehicle_records import Vehicle


@dataclass(frozen=True, kw_only=True, slots=True)
class Fault:
    """A fault is the loss of force of one actuator from a time on.

    Attributes:
        rotor: name of the rotor, or joint: name of the joint whose drive it is; exactly one of them.
        effectiveness: from 0 (none) to 1 (all). A rotor keeps its speed and its lag.
        start: at least 0: the flight begins at 0, and so does a fault that was there before.
    """

    rotor: str = ""
    joint: str = ""
    effectiveness: Annotated[Scalar, Unit("", "share of the force that is left", low=0.0, high=1.0)]
    start: Annotated[Scalar, Unit("s", low=0.0)]

    def __post_init__(self) -> None:
        for field in ("rotor", "joint"):
            if not isinstance(getattr(self, field), str):
                raise ValueError(f"{field} = {shown(getattr(self, field))}: must be a name")
        if bool(self.rotor) == bool(self.joint):
            raise ValueError(f"rotor = {self.rotor!r}, joint = {self.joint!r}: must name one of the two")
        for field in ("effectiveness", "start"):
            value = plain_number(getattr(self, field))
            several = isinstance(value, (str, bytes, list, tuple))
            if isinstance(value, numbers.Number) or several or not hasattr(value, "__mul__"):
                object.__setattr__(self, field, number(value, field, low=0.0))
        if concrete(self.effectiveness) and self.effectiveness > 1.0:
            raise ValueError(f"effectiveness = {self.effectiveness!r}: must be at most 1; a fault adds no force")

    @property
    def name(self) -> str:
        """Name of the actuator."""
        return self.rotor or self.joint

    def check(self, vehicle: Vehicle) -> None:
        """Raise ValueError unless the vehicle has the actuator."""
        rotors, joints = [r.name for r in vehicle.rotors], [link.joint.name for link in vehicle.links]
        for field, value, known in (("rotor", self.rotor, rotors), ("joint", self.joint, joints)):
            if value and value not in known:
                raise ValueError(f"{field} = {value!r}: must be one of {', '.join(known) or 'none'}")

    def share(self, t: Any) -> Any:
        """What is left at time t, s: 1 before the start."""
        return where(t >= self.start, self.effectiveness, 1.0)


def effectiveness_at(faults: tuple[Fault, ...], vehicle: Vehicle, t: Any) -> Effectiveness | None:
    """What faults leave of the actuators at time t (s); None without faults, at no cost.

    Shares of several faults of one actuator multiply.
    """
    if not faults:
        return None
    rotors: dict[str, Any] = {rotor.name: 1 for rotor in vehicle.rotors}
    joints: dict[str, Any] = {link.joint.name: 1 for link in vehicle.links}
    for fault in faults:
        shares = rotors if fault.rotor else joints
        shares[fault.name] = mul(shares[fault.name], fault.share(t))
    return Effectiveness(tuple(rotors.values()), tuple(joints.values()))


def faults_from(tables: Any, where: str) -> tuple[Fault, ...]:
    """Faults that a list of tables describes: { rotor or joint, effectiveness, start }.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    if not isinstance(tables, list):
        raise ValueError(f"{where} = {shown(tables)}: must be a list of tables")
    found = []
    for i, table in enumerate(tables):
        fields = Fields(table, f"{where}[{i}]")
        values = {
            "rotor": fields.take("rotor", ""),
            "joint": fields.take("joint", ""),
            "effectiveness": fields.number("effectiveness", low=0.0),
            "start": fields.number("start", 0.0, low=0.0),
        }
        fields.done()
        try:
            found.append(Fault(**values))
        except ValueError as error:
            raise ValueError(f"{fields.where}: {error}") from None
    return tuple(found)
