"""The paper's computed torque with hybrid control of force and motion at the tip.

Across the believed outward normal n the law is the paper's. Along n, from the first touch on, the tip has no position,
only damping: of the joints' wanted accelerations that part which moves the tip along n gives way to -d v_n, by the
pseudo-inverse of the row n'J. The order

    o = g (f_d + i),   i' = k (f_d - f . n)

stands as a known force n o of the surface on the tip: its joint torques J^T n o, its torque about the base and its
force are taken off the inverse dynamics, and the attitude turns for the rest. Nothing else that is observed is
answered, as the paper's law answers none. Touch, loss, ramp g, integral, damping and the shift of the reference with
which the base comes to the surface and follows it are those of the centroidal law's interaction.

Source: Raibert, Craig 1981, "Hybrid position/force control of manipulators"; Khatib 1987 (force feed-forward J^T f);
the law: Barakou et al. 2026, eq. (86)-(96).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

from skyarm.actuation import Command, mix
from skyarm.algebra import E_Z, Motion, Vec3, axis_rotation
from skyarm.control.blocks.geometric import attitude_loop, downward_acceleration
from skyarm.control.blocks.saturation import limit_efforts
from skyarm.control.controller import Controller
from skyarm.control.laws.paper.computed_torque import generalized_force, hybrid_computed_torque, joint_accelerations
from skyarm.control.laws.pressing.tip_observer import (
    PressingMemory,
    PressingParameters,
    Touch,
    listen,
    moved,
    pressing_controller,
)
from skyarm.control.model import GeometricGains, JointGains, Model
from skyarm.dynamics.kinematics import frame_pose
from skyarm.reference import Reference
from skyarm.scalars import add, divide, mul, sub
from skyarm.sensors.measurement import Measurement
from skyarm.vehicle.vehicle_records import Vehicle

VAGUE = 0.01
"""m/rad: joints that move the tip along the normal by less are left as they are."""


def hybrid_ct(
    memory: PressingMemory, measurement: Measurement, reference: Reference, dt: Any, *, par: PressingParameters
) -> tuple[PressingMemory, Command]:
    """The paper's computed torque across the normal, force along it."""
    after, touch = listen(memory, measurement, reference, dt, par)
    if touch is None:
        _, command = hybrid_computed_torque((), measurement, reference, dt, par=par)
        return dataclasses.replace(after, sent=command), command
    reference = moved(reference, touch.pressing.n, touch.pressing.shift)
    wanted = level_tip(par.model.vehicle, reference)
    gap = touch.pressing.n.dot(measurement.position + touch.at.R.apply(touch.at.tip) - wanted)
    command = pressed(par, measurement, reference, touch)
    held = dataclasses.replace(after.interaction, gap=gap)
    return dataclasses.replace(after, sent=command, interaction=held), command


def level_tip(vehicle: Vehicle, reference: Reference) -> Vec3:
    """Where a level base at its reference has the tip, m, world axes."""
    arm: Vec3 = axis_rotation(E_Z, reference.yaw).apply(frame_pose(vehicle, vehicle.frame(), reference.joints).p)
    return reference.position + arm


def pressed(par: PressingParameters, measurement: Measurement, reference: Reference, touch: Touch) -> Command:
    """The command with the order along the normal; with no order and no touch the paper's law."""
    vehicle, R = par.model.vehicle, measurement.quaternion.rotation()
    down = downward_acceleration(
        par.gains,
        vehicle.mass,
        par.model.gravity,
        position_error=measurement.position - reference.position,
        velocity_error=measurement.velocity - reference.velocity,
        acceleration=reference.acceleration,
    )
    known = touch.at.disturbance(touch.pressing.n * touch.pressing.order)
    alpha = attitude_loop(
        par.gains,
        vehicle.base.inertia,
        a_d=down + known.force * divide(1.0, vehicle.mass),
        yaw=reference.yaw,
        yaw_rate=reference.yaw_rate,
        R_WB=R,
        w_B=measurement.rate,
        rate_form=par.rate_error,
    )
    qdd = freed(touch, joint_accelerations(par, measurement, reference))
    force, torques = generalized_force(par, R, measurement, Motion(alpha, R.apply_T(-down)), qdd)
    efforts = [sub(torque, effort) for torque, effort in zip(torques, known.efforts, strict=True)]
    thrust = force.force.z - R.apply_T(known.force).z
    speeds, _ = mix(par.mixer, force.torque - known.torque, thrust)
    return Command(rotor_speeds=speeds, efforts=limit_efforts(par, efforts))


def freed(touch: Touch, wanted: Sequence[Any]) -> tuple[Any, ...]:
    """Joint accelerations that leave the tip damping alone along the normal, as far as it presses."""
    own = touch.at.R.apply_T(touch.pressing.n)
    row = [own.dot(column) for column in touch.at.columns]
    length, along = VAGUE * VAGUE, touch.pressing.damping * -touch.into
    for each, acceleration in zip(row, wanted, strict=True):
        length, along = add(length, mul(each, each)), add(along, mul(each, acceleration))
    step = mul(touch.pressing.share, divide(along, length))
    return tuple(sub(acceleration, mul(each, step)) for each, acceleration in zip(row, wanted, strict=True))


def make_hybrid_ct(
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
        joint_gains: on acceleration, 1/s^2 and 1/s.
        mixer_policy: see :class:`skyarm.actuation.Mixer`.
        observer: bandwidths of force, torque and joint torques, rad/s.
        interaction: N along the normal, above which the tip touches and below which it is lost.
    """
    given = {"gains": gains, "joint_gains": joint_gains, "mixer_policy": mixer_policy}
    return pressing_controller("hybrid_ct", hybrid_ct, model, observer, interaction, **given)
