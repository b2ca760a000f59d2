"""The paper's baseline on a reference that a virtual mass moves along the surface's normal: force by admittance.

Along the believed outward normal n the reference of the base is shifted by s,

    M s'' + D s' = f . n - f_d,     D = f_d / v,     M = D / rate,

with f the observed force of the surface on the tip, f_d the wanted one and v the speed with which the tip comes: in
free flight f_d drives the virtual mass towards the surface at v, on it s rests where the wanted force acts. Nothing of
it depends on the vehicle. Where no contact is asked for, s returns. The base's soft position loop is what presses; the
joints bear the wanted force by J^T n f_d, ramped as the centroidal law does, and keep the arm's posture by PD.

Source: Hogan 1985; the pattern of admittance around a position-controlled aerial robot as in Augugliaro, D'Andrea 2013,
"Admittance control for physical human-quadrocopter interaction", ECC. The laws: Barakou et al. 2026.
"""

from __future__ import annotations

import dataclasses
from typing import Any

from skyarm.actuation import Command
from skyarm.control.blocks.default_gains import default_joint_gains
from skyarm.control.blocks.saturation import limit_efforts
from skyarm.control.controller import Controller
from skyarm.control.laws.paper.computed_torque import decoupled_pd
from skyarm.control.laws.pressing.tip_observer import (
    PressingMemory,
    PressingParameters,
    Touch,
    listen,
    moved,
    pressing_controller,
)
from skyarm.control.model import GeometricGains, JointGains, Model
from skyarm.reference import Reference
from skyarm.scalars import clip, divide, maximum, minimum, sub, where
from skyarm.sensors.measurement import Measurement

RATE = 4.0
"""1/s, D / M: the virtual mass takes the speed of coming in a quarter of a second."""

BACK = 4.0
"""rad/s, critically damped, with which the shift returns."""

LEAST = 0.01
"""N and m/s, below which a wanted force or speed sets no damping."""


def admittance_pd(
    memory: PressingMemory, measurement: Measurement, reference: Reference, dt: Any, *, par: PressingParameters
) -> tuple[PressingMemory, Command]:
    """The paper's baseline, its reference shifted by the virtual mass."""
    after, touch = listen(memory, measurement, reference, dt, par)
    if touch is not None:
        shift = yielded(par, memory, touch, dt)
        held = dataclasses.replace(after.interaction, shift=shift[0], shift_rate=shift[1])
        after, reference = dataclasses.replace(after, interaction=held), moved(reference, touch.pressing.n, shift)
    _, command = decoupled_pd((), measurement, reference, dt, par=par)
    if touch is not None:
        borne = touch.at.disturbance(touch.pressing.n * (touch.pressing.share * touch.force)).efforts
        efforts = [sub(effort, each) for effort, each in zip(command.efforts, borne, strict=True)]
        command = dataclasses.replace(command, efforts=limit_efforts(par, efforts))
    return dataclasses.replace(after, sent=command), command


def yielded(par: PressingParameters, memory: PressingMemory, touch: Touch, dt: Any) -> tuple[Any, Any, Any]:
    """Place, velocity and acceleration of the virtual mass one period later, m along the normal."""
    s, rate = memory.interaction.shift, memory.interaction.shift_rate
    damping = divide(maximum(touch.force, LEAST), maximum(touch.speed, LEAST))
    driven = divide(touch.along - touch.force, damping)  # m/s, at which it would settle
    # a hard surface pushes no faster back than the tip came
    driven = minimum(driven, touch.speed)
    after = where(touch.pressing.asked, (rate + RATE * dt * driven) / (1.0 + RATE * dt), 0.0)
    back = (rate - BACK * BACK * dt * s) / (1.0 + 2.0 * BACK * dt + BACK * BACK * dt * dt)
    velocity = where(touch.pressing.asked, after, back)
    far = par.interaction.furthest
    place = clip(s + dt * velocity, -far, far)
    velocity = divide(place - s, dt)  # none at the end of its way
    return place, velocity, divide(velocity - rate, dt)


def make_admittance_pd(
    model: Model,
    *,
    gains: GeometricGains | None = None,
    joint_gains: JointGains | None = None,
    mixer_policy: str = "clip",
    observer: tuple[float, float, float] = (25.0, 30.0, 40.0),
    interaction: tuple[float, float] = (0.3, 0.1),
) -> Controller:
    """The law for any vehicle whose joints move a tip.

    Args:
        model: what it believes.
        gains: of the base, as the paper's.
        joint_gains: on torque, as the paper's baseline has them.
        mixer_policy: see :class:`skyarm.actuation.Mixer`.
        observer: bandwidths of force, torque and joint torques, rad/s.
        interaction: N along the normal, above which the tip touches and below which it is lost.
    """
    given = {
        "gains": gains,
        "joint_gains": joint_gains or default_joint_gains("decoupled_pd", model),
        "mixer_policy": mixer_policy,
    }
    return pressing_controller("admittance_pd", admittance_pd, model, observer, interaction, **given)
