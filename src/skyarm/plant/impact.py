"""Velocities right after a load is grasped, or a joint gets stuck: both are inelastic impacts.

With M the mass matrix before and M' the one after, the generalised momentum of vehicle and load does not change
while the grasp or the brake acts for an instant: its forces are internal, and joint torques have no time to act. A load
at rest brings none, hence M' v' = M v: linear and angular momentum of the whole are kept, kinetic energy is lost. Of a
stuck joint M' holds it, and the others' momentum is kept.

Source: Featherstone 2008, section 11.7 (impulsive dynamics), the load being part of the body that grasps it.
"""

from __future__ import annotations

import dataclasses

from skyarm import dynamics
from skyarm.algebra import ZERO3, Force, Vec3
from skyarm.dynamics.point_motion import PointMotion
from skyarm.dynamics.state import State
from skyarm.plant.loaded_vehicle import LOCKED, changes_inertia, loaded_vehicle, payloads_of, stuck_of
from skyarm.plant.surroundings import Around
from skyarm.scalars import add, mul, sub
from skyarm.vehicle.vehicle_records import Vehicle


def after_impact(vehicle: Vehicle, state: State, around: Around) -> State:
    """The state with the velocities that the period's grasps and stuck joints leave; the state itself where none can.

    Only the change is computed, M' (v' - v) = -(momentum that the new parts lack): where nothing is grasped it is zero
    to the last bit.

    Args:
        vehicle: without loads.
        state: when the period begins.
        around: of the period.
    """
    if not changes_inertia(around):
        return state
    motion, total, pushed = PointMotion(vehicle, state), Force(ZERO3, ZERO3), [0] * vehicle.n
    for payload, memory in payloads_of(around):
        link, load = payload.body(vehicle, memory.caught)
        spin = load.inertia.apply(motion.angular_velocity(link))
        impulse = motion.velocity(load.com, link) * load.mass
        force, efforts = motion.generalized(-impulse, -motion.turned(spin, link), load.com, link)
        total = total + force
        pushed = [add(a, b) for a, b in zip(pushed, efforts, strict=True)]
    for i, share in enumerate(stuck_of(around)):
        if type(share) is not int:
            pushed[i] = sub(pushed[i], mul(mul(LOCKED, share), state.joint_rates[i]))
    still = (0,) * vehicle.n
    jump, joints = dynamics.forward_dynamics(
        loaded_vehicle(vehicle, around), state.joints, Vec3(0, 0, 0), still, total, tuple(pushed)
    )
    return dataclasses.replace(
        state,
        velocity=state.velocity + motion.rotation.apply(jump.linear),
        rate=state.rate + jump.angular,
        joint_rates=tuple(add(rate, change) for rate, change in zip(state.joint_rates, joints, strict=True)),
    )
