"""Rigid-body plant: the equations of motion of the kinematic tree and their
integrators.

RK4 takes one step per control period, the rotor lag solved exactly inside it;
semi-implicit Euler at 1 kHz steps as MuJoCo and Gazebo do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from skyarm import dynamics
from skyarm.algebra import ZERO3, Force, Motion, Quaternion, Scalar, Scalars, Vec3, sums
from skyarm.algebra.scalars import add, mul, sub
from skyarm.compile.tracing.lower import compiled_once
from skyarm.dynamics import State
from skyarm.dynamics.actuators import Command
from skyarm.dynamics.point_motion import PointMotion
from skyarm.dynamics.state import coordinate_acceleration
from skyarm.plant.interface import Truth
from skyarm.plant.largest_step import VERLET
from skyarm.plant.loads import (
    LOCKED,
    applied_force,
    before_euler_step,
    changes_inertia,
    follow_commands,
    held_frictions,
    loaded_vehicle,
    rigid_loads,
    stuck_of,
    with_armature,
    with_equivalent_rotors,
)
from skyarm.plant.surroundings import Memories, Surroundings, Together
from skyarm.records.immutable import immutable
from skyarm.vehicle import Vehicle
from skyarm.world.component import moved_by


@immutable
class Rate:
    """Time derivative of the vehicle state, without rotor speeds and tilt angles, which
    are solved exactly.
    """

    position: Vec3
    quaternion: Quaternion
    velocity: Vec3
    rate: Vec3
    joints: Scalars
    joint_rates: Scalars


def accelerate(
    worlds: Sequence[Truth],
    states: Sequence[State],
    commands: Sequence[Command],
    around: Together,
) -> list[tuple[Motion, Scalars]]:
    """Proper acceleration of the base (base axes) and joint accelerations of each
    vehicle.
    """
    return [
        accelerate_one(motion, command, around.of(i))
        for i, (motion, command) in enumerate(
            zip(around.motions(worlds, states), commands, strict=True)
        )
    ]


def accelerate_one(
    motion: PointMotion, command: Command, around: Surroundings
) -> tuple[Motion, Scalars]:
    """Proper acceleration of the base (base axes) and joint accelerations of one
    vehicle.

    Several of equal bodies share the code of their forward dynamics.
    """
    moving = loaded_vehicle(motion.vehicle, around)
    state = motion.state
    force, torques = applied_force(motion, command, around)
    Given = tuple[Scalars, Vec3, Scalars, Force, Scalars]

    def solve(given: Given) -> tuple[Motion, Scalars]:
        return dynamics.forward_dynamics(moving, *given)

    given = state.joints, state.rate, state.joint_rates, force, torques
    # code in place shares products with the forces: one vehicle has nothing to gain by
    # a function of its own
    return (
        compiled_once("forward dynamics", solve, given, moving)
        if len(motion.agents) > 1
        else solve(given)
    )


def derivative(
    worlds: Sequence[Truth],
    states: Sequence[State],
    commands: Sequence[Command],
    around: Together,
) -> tuple[tuple[Rate, ...], Memories]:
    """Time derivatives of the vehicle states by the equations of motion, and of the
    coupled models' memories.
    """
    motions = around.motions(worlds, states)
    rates = list[Rate]()
    for i, (motion, command) in enumerate(zip(motions, commands, strict=True)):
        state = motion.state
        base, joint_accelerations = accelerate_one(motion, command, around.of(i))
        linear, angular = coordinate_acceleration(motion.rotation, base, motion.gravity)
        rates.append(
            Rate(
                position=state.velocity,
                quaternion=state.quaternion.derivative(state.rate),
                velocity=linear,
                rate=angular,
                joints=state.joint_rates,
                joint_rates=joint_accelerations,
            )
        )
    return tuple(rates), around.slopes(motions)


Moved = tuple[tuple[State, ...], Memories]
"""State of each vehicle, and internal states of coupled components, after a step."""


def coupled_rk4(
    worlds: Sequence[Truth],
    states: Sequence[State],
    commands: Sequence[Command],
    around: Together,
    dt: Scalar,
) -> Moved:
    """Vehicle and contact states after one classical fourth-order Runge-Kutta step.

    The attitude is integrated as four numbers and normalised after the step, which
    keeps the order. The memories of coupled components are integrated with the states.
    Source: Kutta 1901; Hairer, Norsett, Wanner 1993, II.1.
    """
    half, whole = (
        follow_commands(worlds, states, commands, around, part)
        for part in (0.5 * dt, dt)
    )
    first = around.coupled_memories()

    turning, (begin, middle, end) = with_equivalent_rotors(
        worlds, (states, half, whole), commands, around, dt
    )

    def slope(
        at: Sequence[State], memories: Memories
    ) -> tuple[tuple[Rate, ...], Memories]:
        return derivative(turning, at, commands, around.with_coupled(memories))

    k1, m1 = slope(begin, first)
    k2, m2 = slope(_move(middle, k1, 0.5 * dt), moved_by(first, m1, 0.5 * dt))
    k3, m3 = slope(_move(middle, k2, 0.5 * dt), moved_by(first, m2, 0.5 * dt))
    k4, m4 = slope(_move(end, k3, dt), moved_by(first, m3, dt))
    # rotor speeds at the end are exact already: only the rest is summed up
    after, memories = whole, first
    for k, m, part in (
        (k1, m1, dt / 6.0),
        (k2, m2, dt / 3.0),
        (k3, m3, dt / 3.0),
        (k4, m4, dt / 6.0),
    ):
        after, memories = _move(after, k, part), moved_by(memories, m, part)
    return (
        tuple(replace(each, quaternion=each.quaternion.normalized()) for each in after),
        memories,
    )


def _move(
    states: Sequence[State], rates: Sequence[Rate], dt: Scalar
) -> tuple[State, ...]:
    """Vehicle states after an explicit Euler increment: ``dt`` times a time
    derivative.
    """
    return tuple(
        _move_state(state, rate, dt) for state, rate in zip(states, rates, strict=True)
    )


def _along(values: Sequence[Scalar], slopes: Sequence[Scalar], dt: Scalar) -> Scalars:
    """Values after an explicit Euler step: each plus ``dt`` times its time
    derivative.
    """
    return tuple(add(x, mul(dx, dt)) for x, dx in zip(values, slopes, strict=True))


def _move_state(state: State, rate: Rate, dt: Scalar) -> State:
    """Vehicle state after an explicit Euler increment: ``dt`` times a time
    derivative.
    """
    return replace(
        state,
        position=state.position + rate.position * dt,
        quaternion=state.quaternion.plus(rate.quaternion, dt),
        velocity=state.velocity + rate.velocity * dt,
        rate=state.rate + rate.rate * dt,
        joints=_along(state.joints, rate.joints, dt),
        joint_rates=_along(state.joint_rates, rate.joint_rates, dt),
    )


def coupled_euler(
    worlds: Sequence[Truth],
    states: Sequence[State],
    commands: Sequence[Command],
    around: Together,
    dt: Scalar,
) -> Moved:
    """Vehicle and contact states after one semi-implicit Euler step: velocities first,
    then positions.

    The attitude moves by the exponential of the new rate, as MuJoCo's manifold update
    does, so that both plants make the same step; its length is corrected before it
    turns, when nothing waits for it. Memories of coupled components move by their rates
    before the step, bodies among them as the vehicle; bristles move before forces are
    taken, so that they follow the new velocities, too. Joint friction is implicit.
    First order.
    """
    around = before_euler_step(worlds, states, around, dt)
    turning, (equivalent,) = with_equivalent_rotors(
        worlds, (states,), commands, around, dt, held=True
    )
    held = [
        replace(
            world,
            vehicle=with_armature(
                world.vehicle, held_frictions(world.vehicle, state, dt)
            ),
        )
        for world, state in zip(turning, states, strict=True)
    ]
    rates, slopes = derivative(held, equivalent, commands, around)
    after = []
    for before, rate, state in zip(
        states,
        rates,
        follow_commands(worlds, states, commands, around, dt),
        strict=True,
    ):
        velocity = before.velocity + rate.velocity * dt
        w = before.rate + rate.rate * dt
        joint_rates = _along(before.joint_rates, rate.joint_rates, dt)
        moved = replace(
            state,
            position=before.position + velocity * dt,
            quaternion=before.quaternion.renormalized()
            * Quaternion.of_small_rotation(w, dt),
            velocity=velocity,
            rate=w,
            joints=_along(before.joints, joint_rates, dt),
            joint_rates=joint_rates,
        )
        after.append(moved)
    return tuple(after), around.after_euler_step(slopes, dt)


def coupled_verlet(
    worlds: Sequence[Truth],
    states: Sequence[State],
    commands: Sequence[Command],
    around: Together,
    dt: Scalar,
) -> Moved:
    """Vehicle and contact states after a Stoermer-Verlet step: positions half-way,
    velocities, positions to the end.

    Forces are taken in the middle of the step, with velocities half-way through the
    push: of second order for springs, without a drift of the energy, and for joint
    friction; the damping of contacts is of first order. The gyroscopic and centrifugal
    terms are those of the middle of the push, by one iteration of the implicit midpoint
    rule. Rotors lag exactly. Bristles are where the last push found them, and go on to
    this one first.
    Source: Hairer, Lubich, Wanner 2003, Geometric numerical integration illustrated by
    the Stoermer-Verlet method, 1.5.
    """
    half = 0.5 * dt
    lags = [
        follow_commands(worlds, states, commands, around, part)
        for part in (0.5 * dt, dt)
    ]
    worlds, (_, begun, _) = with_equivalent_rotors(
        worlds, (states, *lags), commands, around, dt
    )
    middle = tuple(_drift(each, half) for each in begun)
    there = around.drift(half)
    motions = there.motions(worlds, middle, step=dt)
    there = there.bend(there.slopes(motions), dt)
    moving = [
        loaded_vehicle(world.vehicle, there.of(i)) for i, world in enumerate(worlds)
    ]

    def push(
        at: Sequence[PointMotion], beside: Together, seconds: Scalar
    ) -> tuple[State, ...]:
        """Vehicle states at mid-step, accelerated for ``seconds`` by the forces
        evaluated at given velocities.
        """
        after = []
        for i, (motion, command, still) in enumerate(
            zip(at, commands, middle, strict=True)
        ):
            now = motion.state
            applied = applied_force(motion, command, beside.of(i))
            # written out, as what depends on the positions alone is that of both pushes
            base, joints = dynamics.forward_dynamics(
                moving[i], now.joints, now.rate, now.joint_rates, *applied
            )
            linear, angular = coordinate_acceleration(
                motions[i].rotation, base, motion.gravity
            )
            moved = replace(
                still,
                velocity=still.velocity + linear * seconds,
                rate=still.rate + angular * seconds,
                joint_rates=_along(still.joint_rates, joints, seconds),
            )
            after.append(moved)
        return tuple(after)

    pushed, beside = push(motions, there, half), there.push(there, motions, half)
    felt = there.motions(worlds, pushed, step=dt)
    after = [_drift(each, half) for each in push(felt, beside, dt)]
    memories = there.push(beside, felt, dt).drift(half).coupled_memories()
    ends = zip(after, lags[1], strict=True)
    return (
        tuple(
            replace(
                each,
                quaternion=each.quaternion.renormalized(),
                rotor_speeds=end.rotor_speeds,
                tilts=end.tilts,
            )
            for each, end in ends
        ),
        memories,
    )


def _drift(state: State, dt: Scalar) -> State:
    """Vehicle state after ``dt`` (s) with constant velocities."""
    return replace(
        state,
        position=state.position + state.velocity * dt,
        quaternion=state.quaternion * Quaternion.of_small_rotation(state.rate, dt),
        joints=_along(state.joints, state.joint_rates, dt),
    )


def far_step(
    name: str,
    worlds: Sequence[Truth],
    now: Moved,
    commands: Sequence[Command],
    around: Together,
    dt: Scalar,
    rounds: int,
) -> Moved:
    """Vehicle and contact states after one integration step while no contact can occur.

    Args:
        name: integrator's name.
        worlds: true vehicles and gravity.
        now: states, and memories of the coupled components.
        commands: commands of the period.
        around: surroundings of the period.
        dt: s.
        rounds: steps that the coupled components need in its place.
    """
    there = around.with_coupled(now[1])
    after, _ = COUPLED_STEP[name](worlds, now[0], commands, there.without_coupled(), dt)
    # the first vehicle's gravity, whose motion shared models are given in contact, too
    return after, there.alone(dt, rounds, worlds[0].gravity)


COUPLED_STEP = {
    "rk4": coupled_rk4,
    "euler": coupled_euler,
    "rk4_staged": coupled_rk4,
    VERLET: coupled_verlet,
}


def after_impacts(
    worlds: Sequence[Truth], states: Sequence[State], around: Together
) -> tuple[State, ...]:
    """States of the vehicles right after the impulses of grasps or of joints that get
    stuck.
    """
    rows = enumerate(zip(worlds, states, strict=True))
    return tuple(
        after_impact(world.vehicle, state, around.of(i)) for i, (world, state) in rows
    )


def after_impact(vehicle: Vehicle, state: State, around: Surroundings) -> State:
    """Vehicle state right after the impulse of a grasp or of a joint that gets stuck;
    unchanged without either.

    Both are inelastic impacts. With M the mass matrix before and M' the one after, the
    generalised momentum of vehicle and load does not change while the grasp or the
    brake acts for an instant: its forces are internal, and joint torques have no time
    to act. A load at rest brings none, hence M' v' = M v: linear and angular momentum
    of the whole are kept, kinetic energy is lost. Of a stuck joint M' holds it, and the
    others' momentum is kept. Only the change is computed, M' (v' - v) = -(momentum that
    the new parts lack): where nothing is grasped it is zero to the last bit.
    Source: Featherstone 2008, section 11.7 (impulsive dynamics), the load being part of
    the body that grasps it.

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
        force, efforts = motion.generalized_force(
            -impulse, -motion.to_world(spin, link), load.com, link
        )
        total = total + force
        pushed = [*sums(pushed, efforts)]
    for i, share in enumerate(stuck_of(around)):
        if type(share) is not int:
            # the momentum that the huge inertia would have at the joint's rate
            pushed[i] = sub(pushed[i], mul(mul(LOCKED, share), state.joint_rates[i]))
    still = (0,) * vehicle.n
    # impulses in place of forces give jumps of velocity in place of accelerations
    jump, joints = dynamics.forward_dynamics(
        loaded_vehicle(vehicle, around),
        state.joints,
        ZERO3,
        still,
        total,
        tuple(pushed),
    )
    return replace(
        state,
        velocity=state.velocity + motion.rotation.apply(jump.linear),
        rate=state.rate + jump.angular,
        joint_rates=sums(state.joint_rates, joints),
    )
