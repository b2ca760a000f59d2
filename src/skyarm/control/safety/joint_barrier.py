"""Braking before the joints' limits: a barrier on the acceleration that a torque would cause by the model."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from skyarm import dynamics
from skyarm.actuation import rotor_force
from skyarm.algebra import ZERO3, Force, Mat3, ldl_solve
from skyarm.control.model import Model
from skyarm.control.safety.limits import Limits
from skyarm.scalars import add, clip, logical_or, maximum, minimum, mul, sub, where
from skyarm.sensors.measurement import Measurement


def apply_joint_barrier(
    model: Model, limits: Limits, measurement: Measurement, efforts: Sequence[Any]
) -> tuple[Any, ...]:
    """Return joint efforts under which no joint runs into its limits.

    With d the distance to a limit (less the margin) and k the pole, d'' + 2 k d' + k^2 d >= 0 bounds the acceleration
    towards it; 4 k (speed - rate) bounds it near the largest speed. The model says which accelerations the efforts and
    the rotors' present thrust cause; to a joint whose own is out of bounds its entry of M_free (bounded - caused) is
    added, with M_free the inertia the joints feel on a floating base: enough, and more if others may move.

    Source: Ames et al. 2019, "Control barrier functions: theory and applications", exponential barrier of degree two.
    """
    caused = _accelerations(model, measurement, efforts)
    allowed = _bounded(model, limits, measurement, caused)
    added = floating_inertia_times(model, measurement.joints, [sub(a, b) for a, b in zip(allowed, caused, strict=True)])
    # other joints keep their torques: where a drive is dead the model is wrong about what they cause
    return tuple(
        where(logical_or(kept < qdd, kept > qdd), add(tau, more), tau)
        for kept, qdd, tau, more in zip(allowed, caused, efforts, added, strict=True)
    )


def _accelerations(model: Model, measurement: Measurement, efforts: Sequence[Any]) -> tuple[Any, ...]:
    """Joint accelerations by the model: rotors at their measured speeds, calm air."""
    total = Force(ZERO3, ZERO3)
    for rotor, speed in zip(model.vehicle.rotors, measurement.rotor_speeds, strict=True):
        total = total + rotor_force(rotor, speed, ZERO3)
    return dynamics.forward_dynamics(
        model.vehicle, measurement.joints, measurement.rate, measurement.joint_rates, total, efforts
    )[1]


def _bounded(model: Model, limits: Limits, measurement: Measurement, caused: Sequence[Any]) -> list[Any]:
    """Accelerations within the barrier."""
    found: list[Any] = []
    k = limits.joint_pole
    for q, rate, qdd, link, speed, margin in zip(
        measurement.joints,
        measurement.joint_rates,
        caused,
        model.vehicle.links,
        limits.joint_speed,
        limits.joint_margin,
        strict=True,
    ):
        damp, square = mul(2.0 * k, rate), k * k
        above, below = sub(sub(link.joint.upper, margin), q), sub(add(link.joint.lower, margin), q)
        top = minimum(sub(mul(square, above), damp), mul(4.0 * k, sub(speed, rate)))
        bottom = maximum(sub(mul(square, below), damp), mul(4.0 * k, sub(0.0 - speed, rate)))
        found.append(minimum(maximum(qdd, bottom), top))
    return found


def floating_inertia_times(model: Model, joints: Sequence[Any], change: Sequence[Any]) -> list[Any]:
    """Joint torques that change the joints' accelerations by ``change`` while nothing more pushes on the base.

    [M_bb M_bj; M_jb M_jj] [a; change] = [0; torque].
    """
    M = dynamics.mass_matrix(model.vehicle, Mat3.identity(), joints)
    n = len(joints)
    pushed = [_row(M[i][6:], change) for i in range(6)]
    base = ldl_solve([row[:6] for row in M[:6]], [0.0 - value for value in pushed])
    return [add(_row(M[6 + i][:6], base), _row(M[6 + i][6:], change)) for i in range(n)]


def _row(entries: Sequence[Any], values: Sequence[Any]) -> Any:
    total: Any = 0
    for entry, value in zip(entries, values, strict=True):
        total = add(total, mul(entry, value))
    return total


def within_efforts(limits: Limits, efforts: Sequence[Any]) -> tuple[Any, ...]:
    """Efforts within their limits; NaN stays NaN."""
    return tuple(clip(effort, 0.0 - most, most) for effort, most in zip(efforts, limits.effort, strict=True))
