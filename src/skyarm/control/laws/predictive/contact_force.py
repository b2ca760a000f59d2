"""The contact force that a plan foresees: what a surface gives to a tip that it holds at rest along its normal.

While the tip touches, the plan's tip has along the believed outward normal n no motion of its own but that

    n . a = -c n . v,

and the surface gives what this takes: with a(f) the tip's acceleration under a force f of the surface along n, which is
affine in f,

    f = (-c n.v - n.a(0)) / (n.a(1) - n.a(0)).

f depends on rotors and joint torques of the stage, and the cost wants it to be the wanted force. c is the damping of a
tip that bounces: where the surface gives the wanted force and no more, the real tip has n . a = -c n . v.

Source: Featherstone 2008, section 11.1 (single point contact); Baumgarte 1972 (damping); Neunert et al. 2018
(contact forces in a whole-body plan). A force of one sign is not enforced: the cost keeps it near the wanted one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from skyarm.algebra import Vec3
from skyarm.control.blocks.disturbance import Disturbance
from skyarm.control.blocks.series_kinematics import derivative, moving, posture
from skyarm.control.laws.centroidal.tip_force import levers
from skyarm.control.laws.predictive.motion_plan import accelerations
from skyarm.control.model import Model
from skyarm.dynamics import State
from skyarm.scalars import Scalar, divide


@dataclass(frozen=True, kw_only=True, slots=True)
class Contact:
    """Wanted contact at a stage.

    Attributes:
        normal: out of the believed surface, world axes.
        touching: 1 where the surface holds the tip along the normal, 0 in free flight.
        force: N, wanted. damping: 1/s, c above.
    """

    normal: Vec3
    touching: Scalar
    force: Scalar
    damping: Scalar


def tip_acceleration(model: Model, state: State, linear: Vec3, angular: Vec3, joints: tuple[Any, ...]) -> Vec3:
    """Acceleration of the tip, m/s^2, world axes, from those of base (world, base axes) and joints."""
    tip = posture(model.vehicle, moving(state.joints, state.joint_rates, joints), 2).tip
    p, v, a = (derivative(tip, k) for k in range(3))
    w = state.rate
    return linear + state.quaternion.rotation().apply(a + angular.cross(p) + w.cross(v * 2.0 + w.cross(p)))


def tip_velocity(model: Model, state: State) -> Vec3:
    """Velocity of the tip, m/s, world axes."""
    tip = posture(model.vehicle, moving(state.joints, state.joint_rates), 1).tip
    p, v = derivative(tip, 0), derivative(tip, 1)
    return state.velocity + state.quaternion.rotation().apply(v + state.rate.cross(p))


def under_contact(
    model: Model,
    state: State,
    efforts: tuple[Any, ...],
    disturbance: Disturbance,
    dry_rates: tuple[Any, ...] | None,
    contact: Contact | tuple[()],
) -> tuple[Disturbance, Any]:
    """What else pushes with the surface's force in it, and that force (N); unchanged and 0 where no contact is known.

    Args:
        model: the belief.
        state: of it.
        efforts: of the joints, N m or N.
        disturbance: without the surface's force along the normal.
        dry_rates: of the joints, at which dry friction is taken.
        contact: wanted.
    """
    if not isinstance(contact, Contact):
        return disturbance, 0
    n = contact.normal
    unit = levers(model.vehicle, state.quaternion.rotation(), state.joints).disturbance(n)

    def along(pushed: Disturbance) -> Any:
        return n.dot(tip_acceleration(model, state, *accelerations(model, state, efforts, pushed, dry_rates)))

    free, moved = along(disturbance), along(disturbance + unit)
    force = divide(-contact.damping * n.dot(tip_velocity(model, state)) - free, moved - free) * contact.touching
    held = Disturbance(
        force=disturbance.force + unit.force * force,
        torque=disturbance.torque + unit.torque * force,
        efforts=tuple(e + u * force for e, u in zip(disturbance.efforts, unit.efforts, strict=True)),
    )
    return held, force
