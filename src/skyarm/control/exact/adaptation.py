"""What is learned slowly of an unknown load at the tip and of friction in the joints, and fed forward.

The observer finds any disturbance, but late. Of two the course is known beforehand: a mass m at the tip pushes with
-m Y on base and joints, Y that of 1 kg in the *planned* motion, and damping b takes b qd_d of a joint's torque. With d
what the observer still finds at the joints, m and b move along their normalised gradients within their bounds:

    mdot = gamma_m (-Y.d) / (s_m + Y.Y),      bdot = -gamma_b (d - level) qd_d / (s_b + qd_d^2)

``level`` is d's slow mean: a constant torque is no friction, however the projection would rectify it. Regressors are
those of the references (desired compensation): neither noise nor an oscillation of the closed loop enters them, and
since what is learned never multiplies a measurement, the loop's margins are those without it. The force on the base is
not used to learn the mass: it cannot be told from wind and thrust error there.
Sources: Sadegh, Horowitz 1990 (desired compensation); Ioannou, Sun 1996, 4.3, 4.4 (normalised gradient, projection).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from skyarm.algebra import Vec3
from skyarm.control.exact.disturbance import Disturbance
from skyarm.control.exact.kinematics import derivative, posture
from skyarm.control.exact.memory import Learned, data, vector_data
from skyarm.control.exact.parameters import ExactParameters
from skyarm.control.exact.wishes import Planned
from skyarm.dynamics.kinematics import jacobian_columns
from skyarm.scalars import add, clip, divide, exp, mul, sub
from skyarm.vehicle.records import Vehicle

SMALL = 1e-3
"""(N m / kg)^2: a load's signal weaker than this teaches little."""

SLOW = {"revolute": 0.1, "prismatic": 1e-3}
"""(rad/s)^2 and (m/s)^2: a joint's motion slower than this teaches little."""

LEVEL = 1.0
"""1/s, of the slow mean of what the observer finds at a joint."""

STICKIEST = 100.0
"""1/s: the largest damping that is learned, over the inertia of the joint on a fixed base."""


def first_learned(joints: int) -> Learned:
    """Memory before the first measurement: nothing is known."""
    still, zero = (0.0,) * joints, Vec3(0.0, 0.0, 0.0)
    return Learned(tip_mass=0.0, damping=still, level=still, force=zero, torque=zero, efforts=still)


def known(learned: Learned) -> Disturbance:
    """What is fed forward."""
    return Disturbance(force=learned.force, torque=learned.torque, efforts=learned.efforts)


def adapted(
    par: ExactParameters, learned: Learned, planned: Planned, left: Sequence[Any], free: Sequence[Any], dt: Any
) -> Learned:
    """Memory one period later.

    Args:
        par: constants.
        learned: memory.
        planned: motion without errors.
        left: joint torques or forces that the observer still finds.
        free: 1 or 0 for the base and each joint; 0 holds what an actuator at its limit, or under guard, would teach.
        dt: s.
    """
    nothing = Vec3(0.0, 0.0, 0.0)
    load = Disturbance(force=nothing, torque=nothing, efforts=(0.0,) * len(learned.damping))
    mass, damping, level = learned.tip_mass, learned.damping, learned.level
    if par.adapts_load:
        unit = unit_load(par.model.vehicle, planned)
        mass = _mass(par, mass, unit.efforts, left, free[1:], dt)
        load = Disturbance(
            force=unit.force * mass, torque=unit.torque * mass, efforts=tuple(mul(mass, y) for y in unit.efforts)
        )
    rates = [q.derivative(1) for q in planned.references]
    if par.adapts_friction:
        damping = _damping(par, learned, rates, left, free[1:], dt)
        level = tuple(_moved(mean, d, f, dt) for mean, d, f in zip(level, left, free[1:], strict=True))
    taken = (mul(b, rate) for b, rate in zip(damping, rates, strict=True))
    return Learned(
        tip_mass=mass,
        damping=damping,
        level=level,
        force=vector_data(load.force),
        torque=vector_data(load.torque),
        efforts=tuple(data(sub(d, t)) for d, t in zip(load.efforts, taken, strict=True)),
    )


def unit_load(vehicle: Vehicle, planned: Planned) -> Disturbance:
    """What a mass of 1 kg at the tip does to base and joints in a planned motion: -Y, by d'Alembert."""
    tip = posture(vehicle, planned.joints, 2).tip
    r, rd, rdd = (derivative(tip, k) for k in range(3))
    w = planned.rate
    pull = -(planned.proper + planned.alpha.cross(r) + w.cross(w.cross(r)) + w.cross(rd) * 2.0 + rdd)
    columns = jacobian_columns(vehicle, vehicle.frame(), [q.derivative(0) for q in planned.joints])
    return Disturbance(
        force=planned.R.apply(pull),
        torque=r.cross(pull),
        efforts=tuple(column.linear.dot(pull) for column in columns),
    )


def _mass(
    par: ExactParameters, mass: Any, unit: Sequence[Any], left: Sequence[Any], free: Sequence[Any], dt: Any
) -> Any:
    match: Any = 0.0
    size: Any = SMALL
    for y, d, f in zip(unit, left, free, strict=True):
        match, size = add(match, mul(f, mul(y, d))), add(size, mul(y, y))
    return clip(mass + mul(par.adaptation * dt, divide(match, size)), 0.0, par.tip_mass_limit)


def _damping(
    par: ExactParameters, learned: Learned, rates: Sequence[Any], left: Sequence[Any], free: Sequence[Any], dt: Any
) -> tuple[Any, ...]:
    found = []
    for i, (b, mean, qd, d) in enumerate(zip(learned.damping, learned.level, rates, left, strict=True)):
        step = divide(mul(sub(d, mean), qd), add(mul(qd, qd), par.slow[i]))
        found.append(clip(sub(b, mul(par.friction_adaptation * dt, mul(free[i], step))), 0.0, par.damping_limit[i]))
    return tuple(found)


def _moved(mean: Any, d: Any, free: Any, dt: Any) -> Any:
    return add(mean, mul(mul(free, 1.0 - exp(-(LEVEL * dt))), sub(d, mean)))
