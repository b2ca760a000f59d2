"""Rigid-body plant: the equations of motion of the kinematic tree and their integrators.

RK4 takes one step per control period, the rotor lag solved exactly inside it; semi-implicit Euler at 1 kHz steps as
MuJoCo and Gazebo do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from skyarm import dynamics
from skyarm.algebra import ZERO3, Force, Motion, Quaternion, Vec3
from skyarm.algebra.scalars import Scalar, add, mul, sub
from skyarm.dynamics import State
from skyarm.dynamics.actuators import Command
from skyarm.dynamics.point_motion import PointMotion
from skyarm.dynamics.state import coordinate_acceleration
from skyarm.plant.interface import Truth
from skyarm.plant.largest_step import VERLET
from skyarm.plant.loads import (
    LOCKED,
    applied_force,
    changes_inertia,
    loaded_vehicle,
    rigid_loads,
    stuck_of,
    with_lag,
)
from skyarm.plant.surroundings import (
    Memories,
    Surroundings,
    after_euler_step,
    before_euler_step,
    bend_coupled,
    drift_coupled,
    push_coupled,
    slopes_of,
)
from skyarm.records.immutable import immutable
from skyarm.vehicle.vehicle_records import Vehicle
from skyarm.world.component import moved_by


@immutable
class Rate:
    """Time derivative of the vehicle state, without rotor speeds and tilt angles, which are solved exactly."""

    position: Vec3
    quaternion: Quaternion
    velocity: Vec3
    rate: Vec3
    joints: tuple[Scalar, ...]
    joint_rates: tuple[Scalar, ...]


def accelerate(world: Truth, state: State, command: Command, around: Surroundings) -> tuple[Motion, tuple[Scalar, ...]]:
    """Proper acceleration of the base (base axes) and joint accelerations."""
    force, torques = applied_force(world.vehicle, state, command, around)
    moving = loaded_vehicle(world.vehicle, around)
    return dynamics.forward_dynamics(moving, state.joints, state.rate, state.joint_rates, force, torques)


def derivative(world: Truth, state: State, command: Command, around: Surroundings) -> Rate:
    """Time derivative of the vehicle state by the equations of motion."""
    base, joint_accelerations = accelerate(world, state, command, around)
    linear, angular = coordinate_acceleration(state.quaternion.rotation(), base, world.gravity)
    return Rate(
        position=state.velocity,
        quaternion=state.quaternion.derivative(state.rate),
        velocity=linear,
        rate=angular,
        joints=state.joint_rates,
        joint_rates=joint_accelerations,
    )


Moved = tuple[State, Memories]
"""State, and internal states of coupled components, after a step."""


def coupled_rk4(world: Truth, state: State, command: Command, around: Surroundings, dt: Scalar) -> Moved:
    """Vehicle and contact state after one classical fourth-order Runge-Kutta step.

    The attitude is integrated as four numbers and normalised after the step, which keeps the order. The memories of
    coupled components are integrated with the state.
    Source: Kutta 1901; Hairer, Norsett, Wanner 1993, II.1.
    """
    half, whole = (with_lag(world.vehicle, state, command, part, around) for part in (0.5 * dt, dt))
    first = around.coupled_memories()

    def slope(at: State, memories: Memories) -> tuple[Rate, Memories]:
        now = around.with_coupled(memories)
        return derivative(world, at, command, now), slopes_of(world, at, now)

    k1, m1 = slope(state, first)
    k2, m2 = slope(_move_state(half, k1, 0.5 * dt), moved_by(first, m1, 0.5 * dt))
    k3, m3 = slope(_move_state(half, k2, 0.5 * dt), moved_by(first, m2, 0.5 * dt))
    k4, m4 = slope(_move_state(whole, k3, dt), moved_by(first, m3, dt))
    after, memories = whole, first
    for k, m, part in ((k1, m1, dt / 6.0), (k2, m2, dt / 3.0), (k3, m3, dt / 3.0), (k4, m4, dt / 6.0)):
        after, memories = _move_state(after, k, part), moved_by(memories, m, part)
    return replace(after, quaternion=after.quaternion.normalized()), memories


def _along(values: Sequence[Scalar], slopes: Sequence[Scalar], dt: Scalar) -> tuple[Scalar, ...]:
    """Values after an explicit Euler step: each plus ``dt`` times its time derivative."""
    return tuple(add(x, mul(dx, dt)) for x, dx in zip(values, slopes, strict=True))


def _move_state(state: State, rate: Rate, dt: Scalar) -> State:
    """Vehicle state after an explicit Euler increment: ``dt`` times a time derivative."""
    return replace(
        state,
        position=state.position + rate.position * dt,
        quaternion=state.quaternion.plus(rate.quaternion, dt),
        velocity=state.velocity + rate.velocity * dt,
        rate=state.rate + rate.rate * dt,
        joints=_along(state.joints, rate.joints, dt),
        joint_rates=_along(state.joint_rates, rate.joint_rates, dt),
    )


def coupled_euler(world: Truth, state: State, command: Command, around: Surroundings, dt: Scalar) -> Moved:
    """Vehicle and contact state after one semi-implicit Euler step: velocities first, then positions.

    The attitude moves by the exponential of the new rate, as MuJoCo's manifold update does, so that both plants make
    the same step; its length is corrected before it turns, when nothing waits for it. Memories of coupled components
    move by their rates before the step, bodies among them as the vehicle; bristles move before forces are taken, so
    that they follow the new velocities, too. First order.
    """
    around = before_euler_step(world, state, around, dt)
    rate = derivative(world, state, command, around)
    velocity = state.velocity + rate.velocity * dt
    w = state.rate + rate.rate * dt
    joint_rates = _along(state.joint_rates, rate.joint_rates, dt)
    slopes = slopes_of(world, state, around)
    after = replace(
        with_lag(world.vehicle, state, command, dt, around),
        position=state.position + velocity * dt,
        quaternion=state.quaternion.renormalized() * Quaternion.of_small_rotation(w, dt),
        velocity=velocity,
        rate=w,
        joints=_along(state.joints, joint_rates, dt),
        joint_rates=joint_rates,
    )
    return after, after_euler_step(around, slopes, dt)


def coupled_verlet(world: Truth, state: State, command: Command, around: Surroundings, dt: Scalar) -> Moved:
    """Vehicle and contact state after a Stoermer-Verlet step: positions half-way, velocities, positions to the end.

    Forces are taken once, in the middle of the step, with the velocities before the push: of second order and without
    a drift of the energy for springs, of first order for damping. The gyroscopic and centrifugal terms are those of
    the middle of the push, by one iteration of the implicit midpoint rule. Rotors lag exactly. Bristles are where the
    last push found them, and go on to this one first.
    Source: Hairer, Lubich, Wanner 2003, Geometric numerical integration illustrated by the Stoermer-Verlet method, 1.5.
    """
    half, vehicle = 0.5 * dt, world.vehicle
    middle = _drift(with_lag(vehicle, state, command, half, around), half)
    there = drift_coupled(around, half)
    motion = PointMotion(vehicle, middle, around.air_velocity, gravity=world.gravity, step=dt)
    there = bend_coupled(there, there.slopes(motion, middle.rotor_speeds), dt)
    moving, R = loaded_vehicle(vehicle, there), middle.quaternion.rotation()

    def push(at: State, beside: Surroundings, seconds: Scalar) -> State:
        """Vehicle state at mid-step, accelerated for ``seconds`` by the forces evaluated at given velocities."""
        force, torques = applied_force(vehicle, at, command, beside, step=dt)
        base, joints = dynamics.forward_dynamics(moving, at.joints, at.rate, at.joint_rates, force, torques)
        linear, angular = coordinate_acceleration(R, base, world.gravity)
        return replace(
            middle,
            velocity=middle.velocity + linear * seconds,
            rate=middle.rate + angular * seconds,
            joint_rates=_along(middle.joint_rates, joints, seconds),
        )

    pushed = push(middle, there, half), push_coupled(there, there, motion, half)
    felt = PointMotion(vehicle, pushed[0], around.air_velocity, gravity=world.gravity, step=dt)
    after = _drift(push(*pushed, dt), half)
    memories = drift_coupled(push_coupled(there, pushed[1], felt, dt), half).coupled_memories()
    q, whole = after.quaternion.renormalized(), with_lag(vehicle, state, command, dt, around)
    return replace(after, quaternion=q, rotor_speeds=whole.rotor_speeds, tilts=whole.tilts), memories


def _drift(state: State, dt: Scalar) -> State:
    """Vehicle state after ``dt`` (s) with constant velocities."""
    return replace(
        state,
        position=state.position + state.velocity * dt,
        quaternion=state.quaternion * Quaternion.of_small_rotation(state.rate, dt),
        joints=_along(state.joints, state.joint_rates, dt),
    )


def far_step(
    name: str, world: Truth, now: Moved, command: Command, around: Surroundings, dt: Scalar, rounds: int
) -> Moved:
    """Vehicle and contact state after one integration step while no contact can occur.

    Args:
        name: integrator's name.
        world: true vehicle and gravity.
        now: state, and memories of the coupled components.
        command: command of the period.
        around: surroundings of the period.
        dt: s.
        rounds: steps that the coupled components need in its place.
    """
    there = around.with_coupled(now[1])
    after, _ = COUPLED_STEP[name](world, now[0], command, there.without_coupled(), dt)
    return after, there.alone(dt, rounds, world.gravity)


COUPLED_STEP = {"rk4": coupled_rk4, "euler": coupled_euler, "rk4_staged": coupled_rk4, VERLET: coupled_verlet}


def after_impact(vehicle: Vehicle, state: State, around: Surroundings) -> State:
    """Vehicle state right after the impulse of a grasp or of a joint that gets stuck; unchanged without either.

    Both are inelastic impacts. With M the mass matrix before and M' the one after, the generalised momentum of vehicle
    and load does not change while the grasp or the brake acts for an instant: its forces are internal, and joint
    torques have no time to act. A load at rest brings none, hence M' v' = M v: linear and angular momentum of the whole
    are kept, kinetic energy is lost. Of a stuck joint M' holds it, and the others' momentum is kept. Only the change is
    computed, M' (v' - v) = -(momentum that the new parts lack): where nothing is grasped it is zero to the last bit.
    Source: Featherstone 2008, section 11.7 (impulsive dynamics), the load being part of the body that grasps it.

    Args:
        vehicle: vehicle without loads.
        state: state at the beginning of the period.
        around: surroundings of the period.
    """
    if not changes_inertia(around):
        return state
    motion, total = PointMotion(vehicle, state), Force(ZERO3, ZERO3)
    pushed: list[Scalar] = [0] * vehicle.n
    for payload, memory in rigid_loads(around):
        link, load = payload.body(vehicle, memory.caught)
        spin = load.inertia.apply(motion.angular_velocity(link))
        impulse = motion.velocity(load.com, link) * load.mass
        force, efforts = motion.generalized_force(-impulse, -motion.to_world(spin, link), load.com, link)
        total = total + force
        pushed = [add(a, b) for a, b in zip(pushed, efforts, strict=True)]
    for i, share in enumerate(stuck_of(around)):
        if type(share) is not int:
            pushed[i] = sub(pushed[i], mul(mul(LOCKED, share), state.joint_rates[i]))
    still = (0,) * vehicle.n
    jump, joints = dynamics.forward_dynamics(
        loaded_vehicle(vehicle, around), state.joints, ZERO3, still, total, tuple(pushed)
    )
    return replace(
        state,
        velocity=state.velocity + motion.rotation.apply(jump.linear),
        rate=state.rate + jump.angular,
        joint_rates=tuple(add(rate, change) for rate, change in zip(state.joint_rates, joints, strict=True)),
    )
