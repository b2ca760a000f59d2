"""Model and gains of a controller."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.actuation import Mixer
from skyarm.algebra import Vec3
from skyarm.control.controller import ControllerError
from skyarm.records import coerce
from skyarm.records.coerce import Rule
from skyarm.records.units import Unit
from skyarm.scalars import Scalar
from skyarm.vehicle import check
from skyarm.vehicle.check import VehicleError, accept, refuse
from skyarm.vehicle.vehicle_records import Vehicle


@dataclass(frozen=True, kw_only=True, slots=True)
class Model:
    """The controller's model: a vehicle and gravity (m/s^2). Never the truth."""

    vehicle: Vehicle
    gravity: Annotated[Scalar, Unit("m/s^2")] = 9.81

    def __post_init__(self) -> None:
        accept(self, "model", vehicle=coerce.one(Vehicle), gravity=coerce.number)
        check.number("model.gravity", self.gravity, low=0.0)


@dataclass(frozen=True, kw_only=True, slots=True)
class GeometricGains:
    """Gains of the geometric controller, per axis.

    Attributes:
        position: Kp, N/m. velocity: Kv, N s/m.
        attitude: KR, N m/rad. rate: Kw, N m s/rad.
    """

    position: Annotated[Vec3, Unit("N/m", "Kp")]
    velocity: Annotated[Vec3, Unit("N s/m", "Kv")]
    attitude: Annotated[Vec3, Unit("N m/rad", "KR")]
    rate: Annotated[Vec3, Unit("N m s/rad", "Kw")]

    def __post_init__(self) -> None:
        _accept(self, "controller.gains", _axes, ("position", "velocity", "attitude", "rate"))


@dataclass(frozen=True, kw_only=True, slots=True)
class JointGains:
    """Gains per joint: on torque (N m/rad, N m s/rad) or on acceleration (1/s^2, 1/s), as the law says."""

    stiffness: Annotated[tuple[Scalar, ...], Unit("1/s^2", "acceleration per error of the joint")]
    damping: Annotated[tuple[Scalar, ...], Unit("1/s", "acceleration per error of the joint's rate")]

    def __post_init__(self) -> None:
        _accept(self, "controller.joint_gains", _row, ("stiffness", "damping"))


TORQUE_GAINS: Mapping[str, Unit] = {
    "stiffness": Unit("N m/rad or N/m", "effort per error of the joint"),
    "damping": Unit("N m s/rad or N s/m", "effort per error of the joint's rate"),
}
"""What the fields of JointGains are in a law that closes the joints on torque."""


def _accept(record: Any, where: str, rule: Rule, names: tuple[str, ...]) -> None:
    try:
        accept(record, where, **dict.fromkeys(names, rule))
    except VehicleError as error:
        raise ControllerError(str(error)) from None


def _gain(field: str, value: Any) -> Any:
    """A finite number; lanes of a batch and nodes of a trace pass. The sign is the makers' to check."""
    held = coerce.number(field, value)
    check.number(field, held)
    return held


def _axes(field: str, value: Any) -> Vec3:
    if not isinstance(value, Vec3):
        refuse(field, value, "must be a Vec3")
    held = [_gain(f"{field}.{axis}", each) for axis, each in zip("xyz", value, strict=True)]
    # a structural zero is zero all the same, and folds
    return Vec3(*(old if type(old) is int else new for old, new in zip(value, held, strict=True)))


def _row(field: str, value: Any) -> tuple[Any, ...]:
    if not coerce.is_sequence(value):
        refuse(field, value, "must be numbers, one per joint")
    return tuple(_gain(f"{field}[{i}]", each) for i, each in enumerate(value))


@dataclass(frozen=True, kw_only=True, slots=True)
class Terms:
    """Parts of the computed torque law that an ablation may take away.

    Attributes:
        coriolis: velocity products C(q, qd) qd. Body coordinates have other velocity products than Euler rates: the
            body form without them takes rates for zero; the Euler form leaves the paper's C qd out, while (95) stays.
        coupling: inertial blocks between base and arm in body coordinates, M_t_eta and M_r_eta: the base's acceleration
            does not act on the joints and the joints' does not on the base. Weight and velocity products stay.
        full_gravity: gravity by the true attitude; False evaluates the joints' weight at R = 1 (the paper's eq. 78-79)
            and leaves the weight's torque on the base out.
        feedforward: accelerations of the reference.
    """

    coriolis: bool = True
    coupling: bool = True
    full_gravity: bool = True
    feedforward: bool = True

    def __post_init__(self) -> None:
        _accept(self, "controller.terms", coerce.flag, ("coriolis", "coupling", "full_gravity", "feedforward"))


@dataclass(frozen=True, kw_only=True, slots=True)
class Parameters:
    """All constants of a law: model, gains, mixer, choices.

    Attributes:
        friction_compensation: of the paper's laws, the share of each joint's believed friction that its torque gives
            back; () gives none back.
        rate_weights: of the paper's laws, what each joint's desired rate counts in the difference of rates (set-point
            weighting of the derivative, Astrom, Hagglund 2006, section 3.4); () is 1.
    """

    model: Model
    gains: GeometricGains
    joint_gains: JointGains
    mixer: Mixer
    rate_error: str = "rotors_sim"
    terms: Terms = Terms()
    friction_compensation: tuple[Scalar, ...] = ()
    rate_weights: tuple[Scalar, ...] = ()

    def __post_init__(self) -> None:
        _accept(self, "controller", _row, ("friction_compensation", "rate_weights"))
