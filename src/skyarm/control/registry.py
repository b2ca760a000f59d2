"""Controllers by name: a law, its constants, its first memory."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from skyarm.actuation import make_mixer
from skyarm.algebra import Vec3
from skyarm.control import laws
from skyarm.control.computed_torque_euler import (
    SINGULAR_COSINE,
    distance_to_singularity,
    hybrid_computed_torque_euler,
    require_paper_vehicle,
)
from skyarm.control.geometric import RATE_ERRORS
from skyarm.control.model import GeometricGains, JointGains, Model, Parameters, Terms
from skyarm.files import shown

Law = Callable[..., tuple[Any, Any]]

LAWS: Mapping[str, Law] = {
    "rotors_position": laws.rotors_position,
    "decoupled_pd": laws.decoupled_pd,
    "hybrid_computed_torque": laws.hybrid_computed_torque,
    "hybrid_computed_torque_euler": hybrid_computed_torque_euler,
}

ABLATIONS: Mapping[str, tuple[str, ...]] = {
    "rotors_position": (),
    "decoupled_pd": (),
    "hybrid_computed_torque": ("coriolis", "coupling", "full_gravity", "feedforward"),
    "hybrid_computed_torque_euler": ("coriolis", "feedforward"),
}
"""The terms of :class:`skyarm.control.model.Terms` that each law can leave out."""

RATIO_POSITION, RATIO_VELOCITY = 4.0 / 0.806, 2.2 / 0.806
RATIO_ATTITUDE, RATIO_RATE = (0.7 / 0.007, 0.7 / 0.007, 0.035 / 0.012), (0.1 / 0.007, 0.1 / 0.007, 0.025 / 0.012)
ACCELERATION_GAINS = (150.0, 17.0)
"""Default joint gains on acceleration, 1/s^2 and 1/s: 12.2 rad/s as the paper's joint 2 (Table A1), damping 0.7."""


class ControllerError(ValueError):
    """A controller's description is wrong."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Controller:
    """A law ready to fly.

    Attributes:
        name: key of ``LAWS``. law: the step function. memory: its first memory.
        par: its constants, a record that holds the belief as ``model`` and the ``mixer``.
        margin: distance of an attitude (quaternion) to where the law is not defined, negative beyond; None if it is
            defined everywhere.
        limit: that place in words.
    """

    name: str
    law: Law
    par: Any
    memory: Any = ()
    margin: Callable[[Any], Any] | None = None
    limit: str = ""


def default_gains(model: Model) -> GeometricGains:
    """RotorS's Hummingbird gains (Table A1) scaled to another vehicle's mass and base inertia."""
    mass, J = model.vehicle.mass, model.vehicle.base.inertia
    moments = (J.xx, J.yy, J.zz)
    return GeometricGains(
        position=Vec3(*(RATIO_POSITION * mass,) * 3),
        velocity=Vec3(*(RATIO_VELOCITY * mass,) * 3),
        attitude=Vec3(*(r * j for r, j in zip(RATIO_ATTITUDE, moments, strict=True))),
        rate=Vec3(*(r * j for r, j in zip(RATIO_RATE, moments, strict=True))),
    )


def default_joint_gains(name: str, model: Model) -> JointGains:
    """Acceleration gains for the computed torque laws; the same times the joint's own inertia for torque PD.

    Friction is not in the laws: a joint of inertia J with damping d lags by d rate / (J stiffness), which is large on a
    light link behind a real gear. Give such joints their own gains.
    """
    n = model.vehicle.n
    stiffness, damping = (ACCELERATION_GAINS[0],) * n, (ACCELERATION_GAINS[1],) * n
    if name != "decoupled_pd":
        return JointGains(stiffness=stiffness, damping=damping)
    from skyarm.algebra import Mat3
    from skyarm.dynamics import mass_matrix

    M = mass_matrix(model.vehicle, Mat3.identity(), (0.0,) * n)
    own = [M[6 + i][6 + i] for i in range(n)]
    return JointGains(
        stiffness=tuple(k * j for k, j in zip(stiffness, own, strict=True)),
        damping=tuple(d * j for d, j in zip(damping, own, strict=True)),
    )


def make_controller(
    name: str,
    model: Model,
    *,
    gains: GeometricGains | None = None,
    joint_gains: JointGains | None = None,
    mixer_policy: str = "rotors_clip",
    rate_error: str = "rotors",
    terms: Terms | None = None,
) -> Controller:
    """A controller by its law's name.

    Args:
        name: a key of ``LAWS``.
        model: what it believes.
        gains: of the base; RotorS's Hummingbird's scaled to the model if left out.
        joint_gains: of the joints; :func:`default_joint_gains` if left out.
        mixer_policy: see :class:`skyarm.actuation.Mixer`.
        rate_error: see :func:`skyarm.control.geometric.rate_error`.
        terms: ablation of the computed torque.

    Raises:
        ControllerError: unknown law or rate error, gains that do not fit the joints, or an ablation the law does not
            know.
        AllocationError: the model's rotors do not span torque and thrust.
    """
    if not isinstance(name, str) or name not in LAWS:
        raise ControllerError(f"controller.law = {shown(name)}: must be one of {sorted(LAWS)}")
    if not isinstance(model, Model):
        raise ControllerError(f"model = {shown(model)}: must be a Model of vehicle and gravity")
    if rate_error not in RATE_ERRORS:
        raise ControllerError(f"controller.rate_error = {rate_error!r}: must be one of {list(RATE_ERRORS)}")
    if name == "hybrid_computed_torque_euler":
        try:
            require_paper_vehicle(model.vehicle)
        except ValueError as error:
            raise ControllerError(f"controller.law = {name!r}: {error}") from None
    _require_known_terms(name, terms or Terms())
    gains = gains or default_gains(model)
    joint_gains = joint_gains or default_joint_gains(name, model)
    for field, values in (("stiffness", joint_gains.stiffness), ("damping", joint_gains.damping)):
        if len(values) != model.vehicle.n:
            raise ControllerError(
                f"controller.joint_gains.{field}: {len(values)} values, must be {model.vehicle.n} (one per joint)"
            )
    par = Parameters(
        model=model,
        gains=gains,
        joint_gains=joint_gains,
        mixer=make_mixer(model.vehicle, mixer_policy),
        rate_error=rate_error,
        terms=terms or Terms(),
    )
    if name == "hybrid_computed_torque_euler":
        return Controller(name=name, law=LAWS[name], par=par, margin=_euler_margin, limit=EULER_LIMIT)
    return Controller(name=name, law=LAWS[name], par=par)


def _require_known_terms(name: str, terms: Terms) -> None:
    """An ablation that a law would silently fly without is refused."""
    taken = [field.name for field in dataclasses.fields(terms) if not getattr(terms, field.name)]
    for field in taken:
        if field not in ABLATIONS[name]:
            raise ControllerError(
                f"controller.terms.{field} = False: '{name}' has no such term to leave out; it can leave out "
                f"{list(ABLATIONS[name]) or 'nothing'}"
            )


EULER_LIMIT = "pitch near 90 degrees: Euler angles are singular; use hybrid_computed_torque (body coordinates)"


def _euler_margin(quaternion: Any) -> Any:
    return distance_to_singularity(quaternion) - SINGULAR_COSINE * SINGULAR_COSINE
