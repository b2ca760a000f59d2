"""What sensors of force feel: everything that pushes beyond their frame."""

from __future__ import annotations

from skyarm.algebra import ZERO3, Vec3
from skyarm.dynamics.point_motion import PointMotion
from skyarm.dynamics.state import State
from skyarm.plant.loaded_vehicle import payloads_of
from skyarm.plant.surroundings import Surroundings
from skyarm.scalars import Scalar, data, mul
from skyarm.sensors.sensor import Push
from skyarm.vehicle.linkage import BASE
from skyarm.vehicle.vehicle_records import Frame, Vehicle


def push_at(frame: Frame, around: Surroundings, vehicle: Vehicle, state: State, gravity: Scalar) -> Push:
    """Force and torque at a frame of all that pushes on its link and on the links that it carries.

    Of payloads it is the weight: what it takes to accelerate them is not there. All components are data, also where
    nothing can push, because sensors keep them in their memories.

    Args:
        frame: of the vehicle.
        around: surroundings of the period.
        vehicle: the true one.
        state: the truth.
        gravity: m/s^2.
    """
    motion, carried = PointMotion(vehicle, state, around.air_velocity), beyond(vehicle, frame.link)
    force, torque = ZERO3, ZERO3
    at = motion.position(frame.position, frame.link)
    for wrench in around.wrenches(motion, state.rotor_speeds):
        if wrench.body in carried:
            force = force + wrench.force_W
            torque = torque + wrench.torque_W + (motion.position(wrench.point, wrench.body) - at).cross(wrench.force_W)
    for payload, memory in payloads_of(around):
        link, load = payload.body(vehicle, memory.held)
        if link in carried:
            weight = Vec3(0, 0, mul(-gravity, load.mass))
            force = force + weight
            torque = torque + (motion.position(load.com, link) - at).cross(weight)
    axes = [motion.turned(axis, frame.link) for axis in (frame.rotation.column(k) for k in range(3))]
    return Push(
        force=Vec3(*(data(axis.dot(force)) for axis in axes)),
        torque=Vec3(*(data(axis.dot(torque)) for axis in axes)),
    )


def beyond(vehicle: Vehicle, link: int) -> set[int]:
    """Numbers of the links that move with one; all of them and the base for the base."""
    found = {link}
    if link == BASE:
        return {BASE, *range(len(vehicle.moving))}
    for i, each in enumerate(vehicle.moving):
        if each.parent in found:
            found.add(i)
    return found
