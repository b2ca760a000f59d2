"""How hard a law pulls: the acceleration it asks per metre and per metre a second, measured at its actuators."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

from skyarm.actuation.hover import hover_trim
from skyarm.algebra import Vec3
from skyarm.control.controller import Controller
from skyarm.control.law_checks import checked_law
from skyarm.reference import Reference
from skyarm.sensors.measurement import blank_measurement

STEP = 1e-3
"""m and m/s: small, so that no limit of the law's own is met."""

SETTLING = 40
"""Calls in which the motors' speeds follow the commands: a law that inverts their lag then commands what it wants."""

PERIOD = 0.005
"""s; the stiffness of a law hardly depends on it."""

USUAL = (5.0, 2.7)
"""1/s^2 and 1/s, RotorS's Hummingbird: for a law whose thrust does not answer a vertical error, or cannot be asked."""


def law_stiffness(controller: Controller) -> tuple[float, float]:
    """(1/s^2, 1/s): vertical acceleration asked per position and per velocity error, in hover at the model's zero pose.

    Vertical, because there the thrust answers in the same period; horizontal gains are taken to be the same. Each call
    starts from the first memory, so that an observer has nothing to learn.

    A law that cannot be traced is taken for a usual one: a predictive one spreads its answer over its horizon, so
    that its first command tells little of its pull, and each first memory may cost it seconds.
    """
    if not controller.compiled:
        return USUAL
    still = _thrust(controller, 0.0, 0.0)
    mass = float(controller.par.model.vehicle.mass)
    found = []
    for position, velocity, usual in ((STEP, 0.0, USUAL[0]), (0.0, STEP, USUAL[1])):
        slope = (_thrust(controller, position, velocity) - still) / (mass * STEP)
        found.append(slope if 0.1 * usual < slope < math.inf else usual)
    return found[0], found[1]


def _thrust(controller: Controller, position: float, velocity: float) -> float:
    """Thrust along body z, N, of the model's rotors at the speeds a law settles on with these errors of z."""
    model = controller.par.model
    vehicle, joints = model.vehicle, (0.0,) * model.vehicle.n
    trim = hover_trim(vehicle, joints, model.gravity)
    arm: dict[str, Any] = {f"joint{word}": joints for word in ("s", "_rates", "_accelerations", "_jerks", "_snaps")}
    wanted = dataclasses.replace(
        Reference(**arm), position=Vec3(0.0, 0.0, position), velocity=Vec3(0.0, 0.0, velocity)
    ).dense()
    weight = Vec3(0.0, 0.0, float(model.gravity))
    resting = dataclasses.replace(blank_measurement(vehicle.n, len(vehicle.rotors)), specific_force=weight)
    speeds = tuple(float(speed) for speed in trim.speeds)
    law = checked_law(controller)
    for _ in range(SETTLING):
        seen = dataclasses.replace(resting, rotor_speeds=speeds)
        _, command = law(controller.memory, seen, wanted, PERIOD, par=controller.par)
        speeds = tuple(float(speed) for speed in command.rotor_speeds)
    shares = (rotor.axis.z * rotor.thrust_coefficient for rotor in vehicle.rotors)
    return sum(float(share) * speed * speed for share, speed in zip(shares, speeds, strict=True))
