"""Slow adaptation of a mass at the tip, which enters the model itself.

The observer's joint torques of an unmodelled mass m are -m Y(q, qd, qdd_d), with Y the torques of a unit mass at the
tip; the mass moves along the normalised gradient, within [0, limit]. The linear force is not used: there a mass cannot
be told from wind and thrust error, which stay with the observer's force.
Source: Ioannou, Sun 1996, sections 4.3, 4.4 (normalised gradient with projection).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

from skyarm.algebra import E_Z, Vec3
from skyarm.control.exact.kinematics import derivative, moving, posture
from skyarm.control.exact.motion import Disturbance
from skyarm.control.exact.parameters import ExactParameters
from skyarm.control.exact.wishes import Wish
from skyarm.control.model import Model
from skyarm.control.parts.saturation import all_follow
from skyarm.dynamics import State
from skyarm.dynamics.kinematics import jacobian_columns
from skyarm.scalars import add, clip, divide, mul, sub, where
from skyarm.vehicle.records import Vehicle

SMALL = 1e-3
"""(N m / kg)^2: a signal weaker than this teaches little."""


def believed(par: ExactParameters, tip_mass: Any) -> Model:
    """The model, with the adapted mass at its tip."""
    if not par.adapts:
        return par.model
    return dataclasses.replace(par.model, vehicle=par.model.vehicle.with_payload(tip_mass))


def unit_efforts(vehicle: Vehicle, state: State, alpha: Vec3, linear: Vec3, accelerations: Sequence[Any]) -> list[Any]:
    """Joint torques that a mass of 1 kg at the tip asks for.

    The base accelerates by ``alpha`` and, proper, by ``linear`` in base axes, the joints by ``accelerations``.
    """
    w = state.rate
    tip = posture(vehicle, moving(state.joints, state.joint_rates, accelerations), 2).tip
    r, rd, rdd = (derivative(tip, k) for k in range(3))
    total = linear + alpha.cross(r) + w.cross(w.cross(r)) + w.cross(rd) * 2.0 + rdd
    return [column.linear.dot(total) for column in jacobian_columns(vehicle, vehicle.frame(), state.joints)]


def adapted_mass(
    par: ExactParameters,
    tip_mass: Any,
    model: Model,
    state: State,
    wish: Wish,
    unknown: Disturbance,
    dt: Any,
    obeyed: Sequence[Any] = (),
) -> Any:
    """The tip mass one period later, kg; the wished accelerations, as measured ones would close a loop through it.

    Where commands were changed on their way (an entry of ``obeyed`` is 0), what was wished is not what happens: the
    mass stands still.
    """
    if not par.adapts:
        return tip_mass
    share = divide(1.0, model.vehicle.mass)
    linear = E_Z * mul(wish.thrust, share) + state.quaternion.rotation().apply_T(unknown.force) * share
    match: Any = 0.0
    size: Any = SMALL
    for y, d in zip(unit_efforts(model.vehicle, state, wish.alpha, linear, wish.joints), unknown.efforts, strict=True):
        match, size = sub(match, mul(y, d)), add(size, mul(y, y))
    step = mul(par.adaptation * dt, divide(match, size))
    return where(all_follow(obeyed), clip(tip_mass + step, 0.0, par.tip_mass_limit), tip_mass)
