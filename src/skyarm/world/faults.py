"""Actuator faults: loss of force during a flight, in the plant only, not in the
controller's model.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from skyarm.algebra import Scalar
from skyarm.algebra.scalars import clip, maximum, mul, where
from skyarm.records.coerce import concrete
from skyarm.records.field_rules import accept_fields
from skyarm.records.files import Fields, shown
from skyarm.records.files.toml import Entry
from skyarm.records.immutable import field_if_any, immutable
from skyarm.records.read_table import record_entry
from skyarm.records.units import nonnegative
from skyarm.reference.signals import Signal, signal_from
from skyarm.vehicle import Vehicle
from skyarm.world.effectiveness import Effectiveness


@immutable
class Fault:
    """Actuator fault: one actuator loses force, or a joint gets stuck, from an instant
    on.

    Attributes:
        rotor: name of the rotor, or joint: name of the joint whose drive it is; exactly
            one of them.
        effectiveness: share from 0 (none) to 1 (all). A rotor keeps its speed and its
            lag.
        start: at least 0: the flight begins at 0, and so does a fault that was there
            before.
        stuck: the joint is held where it is from ``start`` on, exactly
            (:mod:`skyarm.plant.loads`); its drive then has no share of its effort to
            lose.
        signal: signal of time, times the effectiveness, within 0 and 1; None for a
            share that does not change.
    """

    rotor: str = ""
    joint: str = ""
    effectiveness: Annotated[
        Scalar,
        nonnegative("", "fraction of the actuator's force that remains", high=1.0),
    ] = 1.0
    start: Annotated[Scalar, nonnegative("s", "time at which the fault begins")] = 0.0
    stuck: bool = field_if_any(default=False)
    signal: Signal | None = field_if_any(default=None)

    def __post_init__(self) -> None:
        accept_fields(self, "")
        if bool(self.rotor) == bool(self.joint):
            raise ValueError(
                f"rotor = {self.rotor!r}, joint = {self.joint!r}: must name one of"
                " the two"
            )
        if self.stuck and not self.joint:
            raise ValueError(
                f"stuck = true: must be of a joint, not of the rotor {self.rotor!r}"
            )
        whole = (
            self.signal is None
            and concrete(self.effectiveness)
            and self.effectiveness == 1.0
        )
        if self.stuck and not whole:
            given = (
                self.effectiveness if self.signal is None else self.signal.to_entry()
            )
            raise ValueError(
                f"effectiveness = {shown(given)}: must be left out beside stuck, which"
                " holds the joint"
            )

    registered_as = "fault"

    def to_entry(self) -> Mapping[str, Entry | Scalar]:
        """Table of the fault for a scenario file, in which ``effectiveness`` is a
        number or a time signal.
        """
        table = record_entry(self)
        return (
            table | {"effectiveness": table.pop("signal", self.effectiveness)}
            if not self.stuck
            else table
        )

    @staticmethod
    def short_spellings(fields: Fields) -> dict[str, Signal | float]:
        """Read the effectiveness from a fault's TOML table: a number or time signal,
        required unless a joint sticks.
        """
        if "signal" in fields.table:
            given = shown(fields.take("signal"))
            raise ValueError(
                f"{fields.at('signal')} = {given}: must be left out; effectiveness may"
                " be a signal"
            )
        share = fields.table.get("effectiveness")
        if isinstance(share, (dict, list)):
            at = fields.at("effectiveness")
            return {
                "signal": signal_from(fields.take("effectiveness"), at),
                "effectiveness": 1.0,
            }
        if fields.table.get("stuck", False) is False and share is None:
            # raises: it is missing
            fields.take("effectiveness")
        return {}

    @property
    def name(self) -> str:
        """Name of the faulty rotor or joint."""
        return self.rotor or self.joint

    def check(self, vehicle: Vehicle) -> None:
        """Raise ValueError if the vehicle lacks the rotor or joint of the fault."""
        rotors = [r.name for r in vehicle.rotors]
        joints = vehicle.joint_names
        for kind, value, names in (
            ("rotor", self.rotor, rotors),
            ("joint", self.joint, joints),
        ):
            if value and value not in names:
                raise ValueError(
                    f"{kind} = {value!r}: must be one of {', '.join(names) or 'none'}"
                )

    def share(self, t: Scalar) -> Scalar:
        """Remaining fraction of the actuator's force at time t (s); 1 before the fault
        starts.
        """
        left = self.effectiveness
        if self.signal is not None:
            # a signal may leave 0 to 1, a share of a force may not
            left = clip(mul(left, self.signal.derivatives(t)[0]), 0.0, 1.0)
        return where(t >= self.start, left, 1.0)


def effectiveness_at(
    faults: tuple[Fault, ...], vehicle: Vehicle, t: Scalar
) -> Effectiveness | None:
    """Remaining effectiveness of all rotors and joint drives at time t (s); None
    without faults.

    Shares of several faults of one actuator multiply.
    """
    if not faults:
        return None
    rotors: dict[str, Scalar] = {rotor.name: 1 for rotor in vehicle.rotors}
    joints: dict[str, Scalar] = {joint.name: 1 for joint in vehicle.joints}
    stuck: dict[str, Scalar] = dict.fromkeys(joints, 0)
    for fault in faults:
        if fault.stuck:
            # stuck by any of several faults
            stuck[fault.joint] = maximum(
                stuck[fault.joint], where(t >= fault.start, 1.0, 0.0)
            )
            continue
        shares = rotors if fault.rotor else joints
        shares[fault.name] = mul(shares[fault.name], fault.share(t))
    flags = tuple(stuck.values()) if any(fault.stuck for fault in faults) else ()
    return Effectiveness(tuple(rotors.values()), tuple(joints.values()), flags)
