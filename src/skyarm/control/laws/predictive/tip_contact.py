"""Tip contact in the predictive law: contact detection, and contact references over the
horizon.

The tip's force comes from the law's own observer. Touch and loss, the ramp of the
wanted force, its integral, and the shift of the reference along the estimated normal
are those of the centroidal law
(:mod:`skyarm.control.laws.centroidal.contact.interaction`); ramp and shift are foreseen
over the horizon.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from skyarm.algebra import E_Z, Scalar, Scalars, Vec3, axis_rotation
from skyarm.algebra.scalars import divide, logical_or, maximum, minimum, where
from skyarm.control.blocks.force_control import (
    InteractionGains,
    InteractionMemory,
    first_interaction,
    interact,
    wanted_of,
)
from skyarm.control.blocks.prediction import Disturbance
from skyarm.control.blocks.tip_force import levers
from skyarm.control.laws.predictive.cost import tip_velocity
from skyarm.control.laws.predictive.solver import Compiled, examples
from skyarm.control.model import Model
from skyarm.dynamics import State, frame_pose
from skyarm.records.arrays import Array, doubles
from skyarm.records.immutable import immutable
from skyarm.records.leaves import leaves

ENTRIES = 5
"""Number of used entries of a desired contact: force, speed, normal. A gripping tip is
controlled as a free one."""
KEPT = 0.6
"""Fraction of the observed force across the normal that a pressing plan includes:
friction balances the rest.

A tip that sticks is held by friction with any force that is asked of it: a plan that
reckons with all of it pushes against its own push, and the arm of six joints swings up.
"""


@immutable
class ContactState:
    """Tip contact in one control period: flags, and forces (N), displacements (m),
    speeds (m/s) along the normal.

    Attributes:
        normal: (3,) out of the surface, world axes.
        asked, touching: 1 where contact is requested, and where the surface holds the
            tip.
        rising: 1 while the order rises. share: part of the desired force so far. force:
            desired force as a whole.
        damping: 1/s, of the tip.
        shift, shift_rate: offset of the reference and its rate. gap: distance of the
            tip from it.
        speed: speed of the tip's approach.
        free: leaves of the disturbance without the surface's force along the normal
            while it holds the tip.
        pressed: leaves of the disturbance with the commanded force in place of the
            observed one.
        tip_force: (3,) of the surface on the tip, estimated, world axes.
    """

    normal: Scalars
    asked: Scalar
    touching: Scalar
    rising: Scalar
    share: Scalar
    force: Scalar
    damping: Scalar
    shift: Scalar
    shift_rate: Scalar
    gap: Scalar
    speed: Scalar
    free: Scalars
    pressed: Scalars
    tip_force: Scalars


class TipContact:
    """Compiled contact detection, and the disturbance without the contact force.

    Args:
        model: the controller's. gains: constants of contact force control. dt: control
            period, s.
    """

    def __init__(self, model: Model, gains: InteractionGains, dt: float) -> None:
        vehicle = model.vehicle
        state, _, disturbance, _ = examples(vehicle.n, len(vehicle.rotors))
        first = first_interaction(vehicle.n)
        self.gains, self.first = gains, first

        def step(
            memory: InteractionMemory,
            now: State,
            observed: Disturbance,
            push: Sequence[Scalar],
            signals: Sequence[Scalar],
        ) -> tuple[InteractionMemory, ContactState]:
            x, y, z, yaw, *joints = signals
            desired = wanted_of(push)
            at = levers(vehicle, now.rotation, now.joints)
            n, into = desired.normal, -desired.normal.dot(tip_velocity(model, now))
            after, pressing = interact(
                gains, memory, desired, observed, at, into, 0.0, dt
            )
            # the reference's base carries the desired tip as if it were level
            arm = axis_rotation(E_Z, yaw).apply(
                frame_pose(vehicle, vehicle.frame(), tuple(joints)).p
            )
            way = now.position + at.R.apply(at.tip) - Vec3(x, y, z) - arm
            after = replace(after, gap=n.dot(way) - after.shift)
            along = n * n.dot(pressing.force)
            unanswered = along + (pressing.force - along) * (1.0 - KEPT)
            free = observed + at.disturbance(unanswered * -pressing.engaged)
            pressed = free + at.disturbance(n * (pressing.order * pressing.engaged))
            # once the ramp has ended, its order is 0 too: 0 over 1e-9, no division by 0
            left = divide(after.order, maximum(after.share, 1e-9))
            rising = where(desired.requests_contact, after.touching, 0.0)
            return after, ContactState(
                normal=tuple(n),
                asked=where(desired.requests_contact, 1.0, 0.0),
                # while the ramp falls the surface still bears what is left of the order
                touching=where(logical_or(rising > 0.5, after.share > 0.0), 1.0, 0.0),
                rising=rising,
                share=after.share,
                force=where(
                    desired.requests_contact, desired.force + after.integral, left
                ),
                damping=pressing.damping,
                shift=after.shift,
                shift_rate=after.shift_rate,
                gap=after.gap,
                speed=where(
                    after.found > 0.0,
                    minimum(desired.speed, gains.again),
                    desired.speed,
                ),
                free=tuple(leaves(free)),
                pressed=tuple(leaves(pressed)),
                tip_force=tuple(after.force),
            )

        push, signals = (0.0,) * ENTRIES, (0.0,) * (4 + vehicle.n)
        self.step = Compiled(step, first, state, disturbance, push, signals)

    def at(
        self,
        before: InteractionMemory | None,
        estimate: Array,
        push: Sequence[Scalar],
        signals: Array,
    ) -> tuple[InteractionMemory, ContactState]:
        """Next state of the contact force controller, and the contact in this period.

        Args:
            before: memory a period earlier; None before the first.
            estimate: leaves of state and disturbance at the measurement.
            push: requested by the reference.
            signals: (4 + joints,) of the reference now.
        """
        memory = doubles(leaves(before or self.first))
        return self.step.record(memory, estimate, doubles(push[:ENTRIES]), signals)


def shift_ahead(
    gains: InteractionGains, touch: ContactState, later: Array
) -> tuple[Array, Array, Array]:
    """Predicted reference offset along the normal (m), with two derivatives, at given
    times from now.

    A tip that comes keeps its speed; what follows the surface, or returns, does so as a
    critically damped swing.
    """
    s = float(touch.shift)
    rate = float(touch.shift_rate)
    speed = float(touch.speed)
    t = later
    if touch.asked and not touch.rising:
        coming = float(gains.coming)
        late = np.exp(-coming * t)
        off = rate + speed
        place = s - speed * t + off * (1.0 - late) / coming
        far = -float(gains.furthest)
        inside = place > far
        going = np.where(inside, off * late - speed, 0.0)
        return (
            np.maximum(place, far),
            going,
            np.where(inside, -coming * off * late, 0.0),
        )
    w = float(gains.follow)
    end = s + float(touch.gap) if touch.rising else 0.0
    away, slope = s - end, rate + w * (s - end)
    late = np.exp(-w * t)
    place = away + slope * t
    return (
        end + place * late,
        (slope - w * place) * late,
        (w * w * place - 2.0 * w * slope) * late,
    )


def contact_goals(gains: InteractionGains, touch: ContactState, later: Array) -> Array:
    """Contact references of the horizon, an array (N + 1, 6) with the fields of
    ``cost.ContactGoal``.

    The wanted force goes on rising, or falling after a loss or in a release, as its
    ramp does. The damping is that of a stage's length: a force that is held over it
    would turn the tip back by more than its velocity.
    """
    down = gains.fall if touch.asked else gains.rise
    ramp = float(touch.share) + later / float(gains.rise if touch.rising else -down)
    force = float(touch.force) * np.clip(ramp, 0.0, 1.0)
    steps = np.append(np.diff(later), later[-1] - later[-2])
    damping = (1.0 - np.exp(-float(touch.damping) * steps)) / steps
    touching = np.full_like(later, touch.touching)
    return np.column_stack(
        [np.tile(np.array(touch.normal), (len(later), 1)), touching, force, damping]
    )
