"""Faults of actuators: a loss of force during a flight, in the plant only, unknown to the controller."""

from __future__ import annotations

import numbers
from dataclasses import dataclass, field
from typing import Annotated, Any

from skyarm.environment.effectiveness import Effectiveness
from skyarm.files import Fields, number, shown
from skyarm.records.coerce import concrete, plain_number
from skyarm.records.plain import WRITTEN_IF_ANY
from skyarm.records.units import Unit
from skyarm.reference.signal_tables import signal_from
from skyarm.reference.signals import Signal
from skyarm.scalars import Scalar, clip, maximum, mul, where
from skyarm.vehicle.vehicle_records import Vehicle


@dataclass(frozen=True, kw_only=True, slots=True)
class Fault:
    """A fault is the loss of force of one actuator from a time on.

    Attributes:
        rotor: name of the rotor, or joint: name of the joint whose drive it is; exactly one of them.
        effectiveness: from 0 (none) to 1 (all). A rotor keeps its speed and its lag.
        start: at least 0: the flight begins at 0, and so does a fault that was there before.
        stuck: the joint is held where it is from ``start`` on, exactly (:mod:`skyarm.plant.loads`); its drive
            then has no share of its effort to lose.
        signal: of time, times the effectiveness, within 0 and 1; None for a share that does not change.
    """

    rotor: str = ""
    joint: str = ""
    effectiveness: Annotated[Scalar, Unit("", "share of the force that is left", low=0.0, high=1.0)] = 1.0
    start: Annotated[Scalar, Unit("s", low=0.0)] = 0.0
    stuck: bool = field(default=False, metadata=WRITTEN_IF_ANY)
    signal: Signal | None = field(default=None, metadata=WRITTEN_IF_ANY)

    def __post_init__(self) -> None:
        for actuator in ("rotor", "joint"):
            if not isinstance(getattr(self, actuator), str):
                raise ValueError(f"{actuator} = {shown(getattr(self, actuator))}: must be a name")
        if bool(self.rotor) == bool(self.joint):
            raise ValueError(f"rotor = {self.rotor!r}, joint = {self.joint!r}: must name one of the two")
        for name in ("effectiveness", "start"):
            value = plain_number(getattr(self, name))
            several = isinstance(value, (str, bytes, list, tuple))
            if isinstance(value, numbers.Number) or several or not hasattr(value, "__mul__"):
                object.__setattr__(self, name, number(value, name, low=0.0))
        if concrete(self.effectiveness) and self.effectiveness > 1.0:
            raise ValueError(f"effectiveness = {self.effectiveness!r}: must be at most 1; a fault adds no force")
        if not isinstance(self.stuck, bool):
            raise ValueError(f"stuck = {shown(self.stuck)}: must be true or false")
        if self.stuck and not self.joint:
            raise ValueError(f"stuck = True: must be of a joint, not of the rotor {self.rotor!r}")
        if not isinstance(self.signal, (Signal, type(None))):
            raise ValueError(f"signal = {shown(self.signal)}: must be a Signal of time")
        if self.stuck:
            self._require_all_of_a_stuck_drive()

    def _require_all_of_a_stuck_drive(self) -> None:
        """Refuse a share of the effort of a joint that is held, which would have no effect."""
        words = "for a joint that is stuck: nothing that its drive gives moves it"
        if self.signal is not None:
            raise ValueError(f"signal = {shown(self.signal)}: must be None {words}")
        if not (concrete(self.effectiveness) and self.effectiveness == 1.0):
            raise ValueError(f"effectiveness = {shown(self.effectiveness)}: must be 1 {words}")

    @property
    def name(self) -> str:
        """Name of the actuator."""
        return self.rotor or self.joint

    def check(self, vehicle: Vehicle) -> None:
        """Raise ValueError unless the vehicle has the actuator."""
        rotors, joints = [r.name for r in vehicle.rotors], [link.joint.name for link in vehicle.links]
        for kind, value, known in (("rotor", self.rotor, rotors), ("joint", self.joint, joints)):
            if value and value not in known:
                raise ValueError(f"{kind} = {value!r}: must be one of {', '.join(known) or 'none'}")

    def share(self, t: Any) -> Any:
        """What is left at time t, s: 1 before the start."""
        left = self.effectiveness
        if self.signal is not None:
            left = clip(mul(left, self.signal.derivatives(t)[0]), 0.0, 1.0)
        return where(t >= self.start, left, 1.0)


def effectiveness_at(faults: tuple[Fault, ...], vehicle: Vehicle, t: Any) -> Effectiveness | None:
    """What faults leave of the actuators at time t (s); None without faults, at no cost.

    Shares of several faults of one actuator multiply.
    """
    if not faults:
        return None
    rotors: dict[str, Any] = {rotor.name: 1 for rotor in vehicle.rotors}
    joints: dict[str, Any] = {link.joint.name: 1 for link in vehicle.links}
    stuck: dict[str, Any] = dict.fromkeys(joints, 0)
    for fault in faults:
        if fault.stuck:
            stuck[fault.joint] = maximum(stuck[fault.joint], where(t >= fault.start, 1.0, 0.0))
            continue
        shares = rotors if fault.rotor else joints
        shares[fault.name] = mul(shares[fault.name], fault.share(t))
    held = tuple(stuck.values()) if any(fault.stuck for fault in faults) else ()
    return Effectiveness(tuple(rotors.values()), tuple(joints.values()), held)


def _what_is_left(fields: Fields) -> dict[str, Any]:
    """Share of the force: a number, or a signal of time; or a joint that is stuck."""
    if "stuck" in fields.table:
        stuck = fields.take("stuck")
        if "effectiveness" in fields.table:
            raise ValueError(f"{fields.at('effectiveness')}: must be left out beside stuck")
        return {"stuck": stuck, "effectiveness": 1.0}
    if isinstance(fields.table.get("effectiveness"), (dict, list)):
        return {"signal": signal_from(fields.take("effectiveness"), fields.at("effectiveness")), "effectiveness": 1.0}
    return {"effectiveness": fields.number("effectiveness", low=0.0)}


def faults_from(tables: Any, where: str) -> tuple[Fault, ...]:
    """Faults that a list of tables describes: { rotor or joint, effectiveness or stuck, start }.

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
            "start": fields.number("start", 0.0, low=0.0),
            **_what_is_left(fields),
        }
        fields.done()
        try:
            found.append(Fault(**values))
        except ValueError as error:
            raise ValueError(f"{fields.where}: {error}") from None
    return tuple(found)
