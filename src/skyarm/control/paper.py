"""The paper's laws as controllers: gains scaled to the model, ablations, where the law is defined."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

from skyarm.actuation import Command, Mixer, make_mixer
from skyarm.actuation.mixer import POLICIES
from skyarm.algebra import Mat3, Vec3
from skyarm.control import laws
from skyarm.control.controller import Controller, ControllerError, Law
from skyarm.control.geometric import RATE_ERRORS
from skyarm.control.model import GeometricGains, JointGains, Model, Parameters, Terms
from skyarm.dynamics import mass_matrix
from skyarm.dynamics.measurement import Measurement
from skyarm.files import shown
from skyarm.reference import Reference
from skyarm.vehicle.check import concrete


def hybrid_computed_torque_euler(
    memory: Any, measurement: Measurement, reference: Reference, dt: Any, *, par: Parameters
) -> tuple[Any, Command]:
    """The law in the paper's Euler-angle equations, which are read when they are first flown.

    Source: Barakou et al. 2026, eq. (86)-(96).
    """
    from skyarm.control import computed_torque_euler as euler

    return euler.hybrid_computed_torque_euler(memory, measurement, reference, dt, par=par)


PAPER_LAWS: Mapping[str, Law] = {
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
    M = mass_matrix(model.vehicle, Mat3.identity(), (0.0,) * n)
    own = [M[6 + i][6 + i] for i in range(n)]
    return JointGains(
        stiffness=tuple(k * j for k, j in zip(stiffness, own, strict=True)),
        damping=tuple(d * j for d, j in zip(damping, own, strict=True)),
    )


def fitting_mixer(model: Model, policy: str) -> Mixer:
    """The mixer of a model's rotors.

    Raises:
        ControllerError: unknown policy.
        AllocationError: the model's rotors do not span torque and thrust.
    """
    if policy not in POLICIES:
        raise ControllerError(f"controller.mixer = {shown(policy)}: must be one of {', '.join(POLICIES)}")
    return make_mixer(model.vehicle, policy)


def fitting_gains(
    name: str, model: Model, gains: GeometricGains | None, joint_gains: JointGains | None
) -> tuple[GeometricGains, JointGains]:
    """Gains as given, or the law's defaults.

    Raises:
        ControllerError: of another kind, below zero, or for another number of joints.
    """
    kinds: tuple[tuple[str, Any, type], ...] = (
        ("gains", gains, GeometricGains),
        ("joint_gains", joint_gains, JointGains),
    )
    for option, value, kind in kinds:
        if value is not None and not isinstance(value, kind):
            raise ControllerError(f"controller.{option} = {shown(value)}: must be {kind.__name__}")
    joint_gains = joint_gains or default_joint_gains(name, model)
    for field, values in (("stiffness", joint_gains.stiffness), ("damping", joint_gains.damping)):
        if len(values) != model.vehicle.n:
            raise ControllerError(
                f"controller.joint_gains.{field}: {len(values)} values, must be {model.vehicle.n} (one per joint)"
            )
    rows = [(f"joint_gains.{field}", getattr(joint_gains, field)) for field in ("stiffness", "damping")]
    if gains is not None:
        rows += [(f"gains.{field}", getattr(gains, field)) for field in ("position", "velocity", "attitude", "rate")]
    for field, values in rows:
        for i, value in enumerate(values):
            if concrete(value) and value < 0.0:
                raise ControllerError(f"controller.{field}[{i}] = {value!r}: must be at least 0")
    return gains or default_gains(model), joint_gains


def make_paper_controller(
    model: Model,
    *,
    name: str,
    gains: GeometricGains | None = None,
    joint_gains: JointGains | None = None,
    mixer_policy: str = "rotors_clip",
    rate_error: str = "rotors",
    terms: Terms | None = None,
) -> Controller:
    """One of the paper's laws as a controller.

    Args:
        model: what it believes.
        name: a key of ``PAPER_LAWS``.
        gains: of the base; RotorS's Hummingbird's scaled to the model if left out.
        joint_gains: of the joints; :func:`default_joint_gains` if left out.
        mixer_policy: see :class:`skyarm.actuation.Mixer`.
        rate_error: see :func:`skyarm.control.geometric.rate_error`.
        terms: ablation of the computed torque.

    Raises:
        ControllerError: unknown rate error, gains that do not fit the joints, or an ablation the law does not
            know.
        AllocationError: the model's rotors do not span torque and thrust.
    """
    if rate_error not in RATE_ERRORS:
        raise ControllerError(f"controller.rate_error = {shown(rate_error)}: must be one of {', '.join(RATE_ERRORS)}")
    if name == "hybrid_computed_torque_euler":
        from skyarm.control.computed_torque_euler import require_paper_vehicle

        try:
            require_paper_vehicle(model.vehicle)
        except ValueError as error:
            raise ControllerError(f"controller.law = {name!r}: {error}") from None
    if terms is not None and not isinstance(terms, Terms):
        raise ControllerError(f"controller.terms = {shown(terms)}: must be Terms")
    _require_known_terms(name, terms or Terms())
    gains, joint_gains = fitting_gains(name, model, gains, joint_gains)
    par = Parameters(
        model=model,
        gains=gains,
        joint_gains=joint_gains,
        mixer=fitting_mixer(model, mixer_policy),
        rate_error=rate_error,
        terms=terms or Terms(),
    )
    if name == "hybrid_computed_torque_euler":
        return Controller(name=name, law=PAPER_LAWS[name], par=par, margin=_euler_margin, limit=EULER_LIMIT)
    return Controller(name=name, law=PAPER_LAWS[name], par=par)


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
    from skyarm.control import computed_torque_euler as euler

    return euler.distance_to_singularity(quaternion) - euler.SINGULAR_COSINE * euler.SINGULAR_COSINE
