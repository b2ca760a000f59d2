"""Pressing on a surface: force along its believed normal n, motion across; for any arm.

The observer stays as it is: it takes the surface for a disturbance, and a law that fed this back would push against
its own push. So along n the *wanted* force stands in place of the observed one: the joints give it, the base carries
it, and the tip has no position there, only damping. Across n everything is as without a surface.

Per period: the tip's force f out of the observed disturbance (:mod:`skyarm.control.laws.centroidal.tip_force`);
whether it touches (above ``touch`` it does, until f.n stayed below ``lost`` for ``loss_time`` seconds or, once g was
1, the tip went in faster than ``escape`` for ``escape_time``: before, it bounces, and the order drives it back as
fast); a share g that rises in ``rise`` and falls in ``fall`` seconds; the order o = g (f_d + i) with the bounded
integral i' = k (f_d - f.n), which stands still unless g = 1, and does not grow where a joint or rotor is at its limit;
and the shift s of the whole reference along n, by which the base comes to the surface, follows it while pressing, and
returns.
The base carries o + (1 - g) f.n: an impact pushes it back with more than the order of that instant.

The normal itself is corrected by sliding (:mod:`skyarm.control.laws.centroidal.surface_normal`).

A tip that grips touches for as long as it is told to: f_d and o may have either sign, nothing is lost, and the normal
may be the radius of an arc (:class:`skyarm.control.laws.centroidal.interaction_records.Wanted`).

Friction holds a tip that does not slide with any force within its cone, and joints and rotors bear what is left in it.
Where one of them comes near its limit the law answers less of the observed force across n; friction takes the
difference over, at rest, until there is room.
"""

from __future__ import annotations

import dataclasses
from typing import Any

from skyarm.algebra import Vec3
from skyarm.control.blocks.disturbance import Disturbance
from skyarm.control.blocks.filters import low_pass_share
from skyarm.control.blocks.select import vector_data
from skyarm.control.laws.centroidal.interaction_records import InteractionGains, InteractionMemory, Wanted
from skyarm.control.laws.centroidal.pressing import Pressing
from skyarm.control.laws.centroidal.tip_force import TipLevers, tip_force, without
from skyarm.scalars import (
    absolute,
    clip,
    data,
    logical_and,
    logical_not,
    logical_or,
    maximum,
    minimum,
    where,
)
from skyarm.vehicle.vehicle_records import Vehicle

PRESSED = 0.75
"""Above it a surface was not only met: the order has been there as a whole."""


def interact(
    gains: InteractionGains,
    memory: InteractionMemory,
    wanted: Wanted,
    vehicle: Vehicle,
    observed: Disturbance,
    at: TipLevers,
    into: Any,
    load: Any,
    dt: Any,
    felt: Vec3 | None = None,
) -> tuple[InteractionMemory, Pressing]:
    """One period of pressing.

    Args:
        gains: constants.
        memory: one period earlier.
        wanted: contact.
        vehicle: model.
        observed: what the observer holds.
        at: levers at its time.
        into: speed of the tip into the surface, m/s.
        load: of the joint or rotor nearest to its limit, the share of it that was sent last.
        dt: s.
        felt: N, the tip's force as a sensor tells it, world axes; None without one. It decides on touch and loss, and
            the integral follows it; what stands in the observer's place is the observer's own all the same.
    """
    n, asked = wanted.normal, wanted.asked
    force = tip_force(vehicle, gains.errors, at, without(observed, memory.bias))
    along = n.dot(force if felt is None else felt)
    touching, losing = touches(gains, memory, asked, along, into, dt)
    relieved = clip((load - gains.relief_start) / (gains.relief_end - gains.relief_start), 0.0, 1.0)
    kept = 1.0 - gains.relief * relieved
    if wanted.grips:
        kept = where(wanted.grip > 0.5, gains.yielding, kept)
        touching, losing = maximum(touching, wanted.grip), losing * (1.0 - wanted.grip)
    share = ramped(gains, memory.share, touching, dt)
    integral = integrated(gains, memory.integral, wanted.force, along, touching, share, relieved, dt, wanted.grips)
    presses = logical_or(touching > 0.5, share > 0.0)
    free = where(logical_or(presses, memory.touching > 0.5), 0.0, memory.free + dt)
    engaged = where(presses, 1.0, 0.0)
    shift = followed(gains, memory, asked, touching, wanted.speed, dt)
    after = dataclasses.replace(
        memory,
        touching=touching,
        losing=losing,
        share=share,
        integral=integral,
        found=where(asked, maximum(memory.found, where(share < 1.0, 0.5, 1.0) * touching), 0.0),
        shift=shift[0],
        shift_rate=shift[1],
        free=free,
        bias=learned(gains, memory.bias, observed, force, asked, free, dt),
        force=vector_data(force),
        felt=memory.felt if felt is None else vector_data(felt),
    )
    pressing = Pressing(
        n=n,
        share=share,
        damping=where(logical_and(into > gains.escape, memory.found > PRESSED), gains.catching, gains.damping),
        engaged=engaged,
        shift=shift,
        asked=asked,
        order=share * (wanted.force + integral),
        beyond=touching * (1.0 - share) * n.dot(force),
        force=force,
        kept=kept,
    )
    return after, pressing


def touches(
    gains: InteractionGains, memory: InteractionMemory, asked: Any, along: Any, into: Any, dt: Any
) -> tuple[Any, Any]:
    """Whether the tip touches (1 or 0), with hysteresis; and how far it is on its way to a loss, 1 at it."""
    was = memory.touching > 0.5
    weak, through = (
        where(along < gains.lost, dt / gains.loss_time, 0.0),
        where(logical_and(into > gains.escape, memory.found > PRESSED), dt / gains.escape_time, 0.0),
    )
    step = maximum(weak, through)
    losing = where(logical_and(was, step > 0.0), memory.losing + step, 0.0)
    # a sum of periods is not exactly their number times one
    # what a tip feels that still goes in, soon after a loss, is what is left in the observer or a sensor's filter
    begins = logical_and(along > gains.touch, logical_or(into < gains.escape, memory.free > gains.rebound))
    found: Any = where(was, where(losing > 1.0 - 1e-9, 0.0, 1.0), where(begins, 1.0, 0.0))
    return where(asked, found, 0.0), losing


def ramped(gains: InteractionGains, share: Any, touching: Any, dt: Any) -> Any:
    """The share of the wanted force one period later."""
    return clip(share + where(touching > 0.5, dt / gains.rise, -dt / gains.fall), 0.0, 1.0)


def integrated(
    gains: InteractionGains,
    integral: Any,
    wanted: Any,
    along: Any,
    touching: Any,
    share: Any,
    relieved: Any,
    dt: Any,
    signed: bool = False,
) -> Any:
    """The bounded integral of the force's error, N: still while the ramp runs, none where contact is lost.

    ``relieved`` (0 to 1) says how near to its limit the nearest joint or rotor is: there the order does not grow.
    """
    most = gains.integral_share * (absolute(wanted) if signed else wanted) + gains.integral_least
    step = where(share < 1.0, 0.0, gains.integral * dt) * (wanted - along)
    step = where(step * (wanted + integral) > 0.0, step * (1.0 - relieved), step)
    return where(touching > 0.5, clip(integral + step, -most, most), 0.0)


def followed(
    gains: InteractionGains, memory: InteractionMemory, asked: Any, touching: Any, speed: Any, dt: Any
) -> tuple[Any, Any, Any]:
    """Shift of the reference along the normal with two derivatives: it comes, follows the surface, or returns."""
    s, rate, w = memory.shift, memory.shift_rate, gains.follow
    speed = where(memory.found > 0.0, minimum(speed, gains.again), speed)
    coming = where(s > -gains.furthest, -speed, 0.0)
    back = -(w * w) * s - 2.0 * w * rate
    follow = (w * w) * memory.gap - 2.0 * w * rate
    free = where(asked, gains.coming * (coming - rate), back)
    limit = gains.follow_limit
    acceleration = clip(where(touching > 0.5, follow, free), -limit, limit)
    moved = rate + acceleration * dt
    return s + (rate + moved) * (0.5 * dt), moved, acceleration


def learned(
    gains: InteractionGains, bias: Disturbance, d: Disturbance, force: Vec3, asked: Any, free: Any, dt: Any
) -> Disturbance:
    """The bias one period later: all of it in free flight, the base's force by what the tip's does not explain."""
    learns = logical_and(logical_not(asked), free > gains.rest)
    share = where(learns, low_pass_share(gains.bias_rate, dt), 0.0)
    wind = where(learns, share, where(asked, low_pass_share(gains.wind_rate, dt), 0.0))
    unexplained = d.force - force * where(learns, 0.0, 1.0)
    return Disturbance(
        force=vector_data(bias.force + (unexplained - bias.force) * wind),
        torque=vector_data(bias.torque + (d.torque - bias.torque) * share),
        efforts=tuple(data(b + (e - b) * share) for b, e in zip(bias.efforts, d.efforts, strict=True)),
    )


def rested(gains: InteractionGains, memory: InteractionMemory) -> Any:
    """1 where nothing of a contact is left in what is observed, else 0."""
    return where(maximum(memory.free - gains.rest, 0.0) > 0.0, 1.0, 0.0)
