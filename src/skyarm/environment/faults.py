"""Actuators that lose part of their force during a flight: what the plant suffers and no controller is told."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

from skyarm.environment.effectiveness import Effectiveness
from skyarm.environment.wind import WindSample
from skyarm.files import Fields, number, shown
from skyarm.scalars import Scalar, mul, where
from skyarm.vehicle.check import concrete
from skyarm.vehicle.records import Vehicle


@dataclass(frozen=True, kw_only=True, slots=True)
class Fault:
    """One actuator's loss, from a time on.

    Attributes:
        rotor: name of the rotor, or joint: name of the joint whose drive it is; exactly one of them.
        effectiveness: share of the force that is left, from 0 (none) to 1 (all). A rotor keeps its speed and its lag.
        start: s, at least 0: the flight begins at 0, and so does a fault that was there before.
    """

    rotor: str = ""
    joint: str = ""
    effectiveness: Scalar
    start: Scalar

    def __post_init__(self) -> None:
        for field in ("rotor", "joint"):
            if not isinstance(getattr(self, field), str):
                raise ValueError(f"{field} = {shown(getattr(self, field))}: must be a name")
        if bool(self.rotor) == bool(self.joint):
            raise ValueError(f"rotor = {self.rotor!r}, joint = {self.joint!r}: must name one of the two")
        for field in ("effectiveness", "start"):
            value = getattr(self, field)
            if concrete(value) or not hasattr(value, "__mul__") or isinstance(value, (str, bytes, list, tuple)):
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


def afflicted(sample: WindSample, faults: tuple[Fault, ...], vehicle: Vehicle, t: Any) -> WindSample:
    """The sample of the surroundings with the faults at time t (s); unchanged without faults, at no cost.

    Shares of several faults of one actuator multiply.
    """
    if not faults:
        return sample
    rotors: dict[str, Any] = {rotor.name: 1 for rotor in vehicle.rotors}
    joints: dict[str, Any] = {link.joint.name: 1 for link in vehicle.links}
    for fault in faults:
        shares = rotors if fault.rotor else joints
        shares[fault.name] = mul(shares[fault.name], fault.share(t))
    left = Effectiveness(tuple(rotors.values()), tuple(joints.values()))
    return dataclasses.replace(sample, effectiveness=left)


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
