"""Slow adaptation of a mass at the tip, which enters the model itself.

The observer's joint torques of an unmodelled mass m are -m Y(q, qd, qdd_d), with Y the torques of a unit mass at the tip;
the mass moves along the normalised gradient, within [0, limit]. The linear force is not used: there a mass cannot be told
from wind and thrust error, which stay with the observer's force.
Source: Ioannou, Sun 1996, sections 4.3, 4.4 (normalised gradient with projection).
"""

from __future__ import annotations

import dataclasses
from typing import Any

from skyarm import dynamics
from skyarm.algebra import Mat3, Sym3, Vec3
from skyarm.algebra import Motion as Acceleration
from skyarm.control.exact.motion import Disturbance
from skyarm.control.exact.parameters import ExactParameters
from skyarm.control.exact.wishes import Wish
from skyarm.control.model import Model
from skyarm.dynamics import State
from skyarm.scalars import add, clip, divide, mul, sub
from skyarm.vehicle.records import BASE, Body, Vehicle

SMALL = 1e-3
"""(N m / kg)^2: a signal weaker than this teaches little."""


def believed(par: ExactParameters, tip_mass: Any) -> Model:
    """The model, with the adapted mass at its tip."""
    if not par.adapts:
        return par.model
    return dataclasses.replace(par.model, vehicle=par.model.vehicle.with_payload(tip_mass))


def unit_mass(vehicle: Vehicle) -> Vehicle:
    """The same arm without mass but for 1 kg at the tip."""
    empty = Body(mass=0, com=Vec3(0, 0, 0), inertia=Sym3(0, 0, 0), planar=True)
    frame = vehicle.frame()
    load = Body(mass=1.0, com=frame.position, inertia=Sym3(0, 0, 0), planar=True)
    links = tuple(
        dataclasses.replace(link, body=load if i == frame.link else empty) for i, link in enumerate(vehicle.links)
    )
    return dataclasses.replace(vehicle, base=load if frame.link == BASE else empty, links=links)


def adapted_mass(
    par: ExactParameters, tip_mass: Any, model: Model, state: State, wish: Wish, unknown: Disturbance, dt: Any
) -> Any:
    """The tip mass one period later, kg."""
    if not par.adapts:
        return tip_mass
    R: Mat3 = state.quaternion.rotation()
    linear = Vec3(0, 0, divide(wish.thrust, model.vehicle.mass)) + R.apply_T(unknown.force) * divide(1.0, model.vehicle.mass)
    _, regressor = dynamics.inverse_dynamics(
        unit_mass(par.model.vehicle), state.joints, state.rate, state.joint_rates, Acceleration(wish.alpha, linear), wish.joints
    )
    match: Any = 0
    size: Any = SMALL
    for y, d in zip(regressor, unknown.efforts, strict=True):
        match, size = sub(match, mul(y, d)), add(size, mul(y, y))
    step = mul(par.adaptation * dt, divide(match, size))
    return clip(tip_mass + step, 0.0, par.tip_mass_limit)
