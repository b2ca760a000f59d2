"""Records of an admittance: constants and memory."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.algebra import Vec3
from skyarm.control.blocks.compliance_table import compliance_of, require_moderate, rotation_of
from skyarm.control.blocks.outside_force import Hearing, HearingMemory, TorqueHearing, first_hearing
from skyarm.control.blocks.virtual_tip import AT_REST, Compliance, VirtualTip
from skyarm.control.blocks.virtual_turn import NOT_TURNED, RotationalCompliance, VirtualTurn
from skyarm.control.controller import ControllerError
from skyarm.control.laws.centroidal.interaction_records import SENSING
from skyarm.control.laws.centroidal.joint_room import Ends, ends_of
from skyarm.control.laws.centroidal.tip_force import ForceErrors
from skyarm.dynamics.kinematics import jacobian_columns
from skyarm.files import shown
from skyarm.records.units import Unit
from skyarm.scalars import Scalar
from skyarm.vehicle.vehicle_records import Vehicle

BENT = 0.4
"""rad or m, and its multiples: a posture in which no two joint axes of an arm are parallel unless they always are.

Any angles will do that are no multiples of pi / 2; only the number of directions is taken from it.
"""

ALONG = 1e-2
"""1 and m: what is left of a column of the Jacobian, below which it says nothing new.

Far above rounding (1e-15), below the arms and sines of a vehicle whose joints do turn its tip.
"""


@dataclass(frozen=True, kw_only=True, slots=True)
class ArmTurn:
    """Memory: the offset of the joints."""

    joints: Annotated[tuple[Scalar, ...], Unit("rad or m", "offset of the joints from their reference")]
    joint_rates: Annotated[tuple[Scalar, ...], Unit("rad/s or m/s", "of the offset")]


@dataclass(frozen=True, kw_only=True, slots=True)
class TurnWeights:
    """Weights of the arm's motion; what they reach is in docs/giving_way.md, Measured.

    Attributes:
        length: m, of the tip's motion that counts as 1 rad of its turning: long, so that turning comes first.
        idle: weight of joints that rest on their references: singular values of J_w below it turn the tip late.
    """

    length: Annotated[
        Scalar, Unit("m", "of the tip's motion that counts as 1 rad of its turning", low=1e-3, high=1e3)
    ] = 2.0
    idle: Annotated[
        Scalar, Unit("", "weight of joints on their references against 1 rad of turning", low=1e-4, high=1e3)
    ] = 0.02


@dataclass(frozen=True, kw_only=True, slots=True)
class RotationGains:
    """Constants of giving way to a torque; ``ends`` says which joints have limits."""

    body: RotationalCompliance
    threshold: Annotated[Scalar, Unit("N m", "about the tip, above which a torque is heard", low=0.0)]
    arm: TurnWeights = TurnWeights()
    ends: Ends = ()

    def __post_init__(self) -> None:
        require_moderate("controller.admittance.rotation.body", "inertia", self.body)


@dataclass(frozen=True, kw_only=True, slots=True)
class RotationMemory:
    """Memory of giving way to a torque."""

    body: VirtualTurn
    arm: ArmTurn
    hearing: TorqueHearing
    torque: Annotated[Vec3, Unit("N m", "about the tip, believed, world axes")]
    felt: Annotated[Vec3 | tuple[()], Unit("N m", "by a sensor at the tip, filtered, axes of the tip")] = ()


@dataclass(frozen=True, kw_only=True, slots=True)
class AdmittanceGains:
    """Constants of giving way."""

    tip: Compliance
    hearing: Hearing = Hearing()
    errors: ForceErrors = ForceErrors()
    rest: Annotated[Scalar, Unit("s", "after a force, from which on a law learns loads, friction and lag")] = 0.5
    sensing: Annotated[Scalar, Unit("rad/s", "filter of a force sensor")] | None = None
    rotation: RotationGains | None = None

    def __post_init__(self) -> None:
        require_moderate("controller.admittance.tip", "mass", self.tip)

    @property
    def senses(self) -> bool:
        """Whether a force sensor tells the force: structure."""
        return self.sensing is not None

    @property
    def senses_torque(self) -> bool:
        """Whether it tells the torque, too."""
        return self.senses and self.rotation is not None


@dataclass(frozen=True, kw_only=True, slots=True)
class AdmittanceMemory:
    """Memory of giving way."""

    tip: VirtualTip
    hearing: HearingMemory
    force: Annotated[Vec3, Unit("N", "at the tip, believed, world axes")]
    felt: Annotated[Vec3 | tuple[()], Unit("N", "by a sensor at the tip, filtered, axes of the tip")] = ()
    rotation: RotationMemory | tuple[()] = ()


def admittance_gains(
    table: Any, mode: str, vehicle: Vehicle, sensor: bool, lead: float, others: Mapping[str, bool]
) -> AdmittanceGains | None:
    """Constants of the option ``admittance``; None where it is left out.

    Args:
        table: mass, damping, stiffness; normal, threshold; rotation.
        mode: of the law.
        vehicle: model.
        sensor: whether a force sensor tells the force.
        lead: s, by how long the observer is late.
        others: options that cannot fly beside it, and whether they are used.

    Raises:
        ControllerError: a table that is none, or a law without a tip to lead.
    """
    if table is None:
        return None
    at = "controller.admittance"
    if mode != "tip" or not vehicle.n:
        raise ControllerError(f"{at} = {shown(table)}: must be left out but in mode 'tip' with joints")
    for name, used in others.items():
        if used:
            raise ControllerError(f"{at} = {shown(table)}: must be left out beside {name}")
    lag = 1.0 / SENSING if sensor else lead
    tip, hearing = compliance_of(table, at, lag)
    turns, rotation = rotation_of(table, at, lag, tip.axes), None
    if turns is not None:
        require_turning(vehicle, at, table["rotation"], sensor)
        rotation = RotationGains(body=turns[0], threshold=turns[1], ends=ends_of(vehicle))
    gains = AdmittanceGains(tip=tip, hearing=hearing, rotation=rotation)
    return dataclasses.replace(gains, sensing=SENSING) if sensor else gains


def first_admittance(joints: int, gains: AdmittanceGains) -> AdmittanceMemory:
    """At rest on the reference, nothing known."""
    zero, sensor = Vec3(0.0, 0.0, 0.0), gains.senses
    return AdmittanceMemory(
        tip=AT_REST,
        hearing=first_hearing(joints, sensor),
        force=zero,
        felt=zero if sensor else (),
        rotation=() if gains.rotation is None else first_rotation(joints, sensor),
    )


def first_rotation(joints: int, sensor: bool) -> RotationMemory:
    """At rest on the reference, nothing known."""
    zero, still = Vec3(0.0, 0.0, 0.0), (0.0,) * joints
    felt: Vec3 | tuple[()] = zero if sensor else ()
    return RotationMemory(
        body=NOT_TURNED,
        arm=ArmTurn(joints=still, joint_rates=still),
        hearing=TorqueHearing(heard=0.0, quiet=0.0, felt=felt),
        torque=zero,
        felt=felt,
    )


def require_turning(vehicle: Vehicle, at: str, table: Any, sensor: bool) -> None:
    """Refuse an arm that does not turn its tip about every axis, or that cannot tell a torque there from a force.

    Raises:
        ControllerError: one line with field, value and what is allowed.
    """
    bent = [BENT * (1.0 + 0.37 * i) for i in range(vehicle.n)]
    columns = jacobian_columns(vehicle, vehicle.frame(), bent)
    if _independent([[*each.angular] for each in columns]) < 3:
        allowed = f"must be left out: the joints of {vehicle.name!r} do not turn its tip about three axes"
        raise ControllerError(f"{at}.rotation = {shown(table)}: {allowed}")
    if not sensor and _independent([[*each.angular, *each.linear] for each in columns]) < 6:
        few = f"the joints of {vehicle.name!r} do not move its tip in six directions, so that they tell no torque there"
        raise ControllerError(f"{at}.rotation = {shown(table)}: must be left out without force_sensor: {few}")


def _independent(vectors: list[list[Any]]) -> int:
    """How many of some vectors point where those before do not: Gram, Schmidt."""
    found: list[list[float]] = []
    for vector in vectors:
        left = [float(c) for c in vector]
        for unit in found:
            along = sum(a * b for a, b in zip(left, unit, strict=True))
            left = [a - along * b for a, b in zip(left, unit, strict=True)]
        length = math.sqrt(sum(c * c for c in left))
        if length > ALONG:
            found.append([c / length for c in left])
    return len(found)
