"""Gains and mixers that fit a model: defaults, and checks of those that are given."""

from __future__ import annotations

from typing import Any

from skyarm.actuation import Mixer, make_mixer
from skyarm.actuation.mixer import POLICIES
from skyarm.algebra import Mat3, Vec3
from skyarm.control.controller import ControllerError
from skyarm.control.model import GeometricGains, JointGains, Model
from skyarm.dynamics import mass_matrix
from skyarm.files import shown
from skyarm.records.coerce import concrete


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


ACCELERATION_GAINS = (150.0, 17.0)
"""Default joint gains on acceleration, 1/s^2 and 1/s: 12.2 rad/s as the paper's joint 2 (Table A1), damping 0.7."""


RATIO_POSITION, RATIO_VELOCITY = 4.0 / 0.806, 2.2 / 0.806


RATIO_ATTITUDE, RATIO_RATE = (0.7 / 0.007, 0.7 / 0.007, 0.035 / 0.012), (0.1 / 0.007, 0.1 / 0.007, 0.025 / 0.012)
