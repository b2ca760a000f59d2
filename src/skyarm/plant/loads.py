"""Loads on the vehicle during a control period: payloads, stuck joints, and all forces
except gravity.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import reduce
from typing import TypeGuard

from skyarm.algebra import ZERO3, Force, Scalar, Scalars, Vec3, sums
from skyarm.algebra.scalars import add, data, maximum, mul, where
from skyarm.compile.tracing.lower import compute_where
from skyarm.dynamics.actuators import (
    Command,
    friction_per_rate,
    joint_force,
    rotor_forces,
    speeds_after,
    stop_force,
)
from skyarm.dynamics.actuators.rotor import (
    equivalent_speed_and_lag,
    has_short_lag,
    lag_of,
    short_lag,
    spin_torque,
)
from skyarm.dynamics.actuators.tilting import angles_after
from skyarm.dynamics.body_drag import body_drag
from skyarm.dynamics.point_motion import PointMotion
from skyarm.dynamics.state import State
from skyarm.plant.interface import Truth
from skyarm.plant.surroundings import AnyComponent, Surroundings, Together
from skyarm.records.leaves import Tree, as_data
from skyarm.vehicle import BASE, Rotor, Vehicle
from skyarm.world import Effectiveness, PayloadMemory, TimedPayload, WindSample, Wrench

LOCKED = 1e12
"""Inertia (kg m^2 or kg) of a stuck joint's motion. A torque of 1 N m moves it by 5e-13
rad in a second, less than rounding, and both plants solve for the other accelerations
as if the joint were fixed."""


def rigid_loads(around: Surroundings) -> list[tuple[TimedPayload, PayloadMemory]]:
    """Rigid payloads of the scenario, each with its internal state."""
    return [pair for pair in around.models if _is_rigid(pair)]


def _is_rigid(
    pair: tuple[AnyComponent, Tree],
) -> TypeGuard[tuple[TimedPayload, PayloadMemory]]:
    """True if a component, given with its internal state, is a rigid load on a body of
    the vehicle.
    """
    return pair[0].rigid


def stuck_of(around: Surroundings) -> Sequence[Scalar]:
    """Flag of each joint, 1 if it is stuck and 0 if not; an empty tuple if no fault can
    stick a joint.
    """
    return () if around.effectiveness is None else around.effectiveness.stuck


def changes_inertia(around: Surroundings) -> bool:
    """True if a payload or a stuck joint may change the vehicle's inertia during the
    flight.
    """
    return bool(rigid_loads(around)) or bool(stuck_of(around))


def loaded_vehicle(vehicle: Vehicle, around: Surroundings) -> Vehicle:
    """Vehicle including the payloads that it holds and its stuck joints."""
    for load, memory in rigid_loads(around):
        vehicle = vehicle.with_body(*load.body(vehicle, memory.held))
    return with_armature(vehicle, [mul(LOCKED, share) for share in stuck_of(around)])


def applied_force(
    motion: PointMotion, command: Command, around: Surroundings
) -> tuple[Force, Scalars]:
    """Force and torque on the base (about its origin, base axes) and joint torques,
    without gravity.

    Args:
        motion: motion of the true vehicle, whose rotors are turned to the angles of its
            state.
        command: setpoints of the joints' drives, torques or forces unless the drive
            defines another quantity, and rotor speeds that the rotors accelerate to,
            rad/s; empty for rotors at constant speed.
        around: air, forces, faults and drives of the period.
    """
    vehicle, state = motion.vehicle, motion.state
    speeds = state.rotor_speeds
    total, pushed = _outside(around.wrenches(motion), motion)
    left = _effectiveness(vehicle, around)
    total = _with_aerodynamics(total, motion, around.air_velocity(state.position), left)
    turning = (
        # the battery limits what reaches the motors, whose lag makes the spin torque
        around.rotor_commands(vehicle.rotors, command.rotor_speeds)
        if command.rotor_speeds
        else ()
    )
    total = total + Force(
        spin_torque(vehicle.rotors, speeds, turning, state.rate), ZERO3
    )
    torques = []
    for i, (link, setpoint, share, push) in enumerate(
        zip(vehicle.links, command.efforts, left.joints, pushed, strict=True)
    ):
        rate = state.joint_rates[i]
        effort = around.effort(i, setpoint, state.joints[i], rate)
        stop = stop_force(link.joint, state.joints[i], rate)
        torques.append(
            add(add(joint_force(link.joint, effort, rate, share), stop), push)
        )
    return total, tuple(torques)


def _effectiveness(vehicle: Vehicle, around: Surroundings) -> Effectiveness:
    """Shares of the actuators that faults leave: constants 1 without faults."""
    return around.effectiveness or Effectiveness(
        (1,) * len(vehicle.rotors), (1,) * vehicle.n
    )


def _with_aerodynamics(
    total: Force, motion: PointMotion, air_W: Vec3, left: Effectiveness
) -> Force:
    """Sum of a force on the base, the drag of the airframe and the forces of the rotors
    in moving air.
    """
    vehicle, state = motion.vehicle, motion.state
    v_air = motion.rotation.apply_T(state.velocity - air_W)
    total = total + Force(ZERO3, body_drag(vehicle.drag, v_air))
    return total + rotor_forces(
        vehicle.rotors, state.rotor_speeds, v_air, state.rate, left.rotors
    )


def wind_at(around: Surroundings, motion: PointMotion) -> WindSample:
    """Force on the base and air velocity at its origin, with all logged numbers of the
    environment models.

    The force is that of the environment models on the base, and what the motion of the
    air changes of the forces of rotors and airframe: their sum less that in calm air.
    """
    vehicle, state = motion.vehicle, motion.state
    force = ZERO3
    for component, memory in around.models:
        if component.coupled:
            # a coupled model logs its own forces
            continue
        for wrench in component.wrenches(
            memory, around.time, motion, state.rotor_speeds
        ):
            if wrench.body == BASE and wrench.agent in ("", motion.name):
                force = force + wrench.force_W
    air = around.air_velocity(state.position)
    # in calm air, of constant zeros, both sums are equal
    if any(type(c) is not int for c in air):
        left = _effectiveness(vehicle, around)
        none = Force(ZERO3, ZERO3)
        moved, calm = (
            _with_aerodynamics(none, motion, each, left).force for each in (air, ZERO3)
        )
        force = force + motion.to_world(moved - calm)
    own = list[Scalar]()
    for component, memory in around.models:
        if component.columns:
            own += component.logged(memory, motion)
    return WindSample(
        force_W=Vec3(*map(data, force)),
        air_velocity_W=Vec3(*map(data, air)),
        numbers=tuple(map(data, own)),
    )


def _outside(
    wrenches: Sequence[Wrench], motion: PointMotion
) -> tuple[Force, Sequence[Scalar]]:
    """Sum of wrenches on bodies, as a force and torque on the base and torques of the
    joints.
    """
    total, pushed = _sum([each for each in wrenches if type(each.acts) is int], motion)
    # an int is structure: it always acts; all others together cost one branch
    if seldom := [each for each in wrenches if type(each.acts) is not int]:
        none: tuple[Force, Scalars] = Force(ZERO3, ZERO3), (0,) * motion.vehicle.n
        force, efforts = compute_where(
            reduce(maximum, [each.acts for each in seldom]) > 0.5,
            lambda given: as_data(_sum(given, motion)),
            tuple(replace(each, acts=1) for each in seldom),
            as_data(none),
        )
        total, pushed = total + force, sums(pushed, efforts)
    return total, pushed


def _sum(wrenches: Sequence[Wrench], motion: PointMotion) -> tuple[Force, Scalars]:
    """Sum of wrenches that all act."""
    total = Force(ZERO3, ZERO3)
    pushed: Scalars = (0,) * motion.vehicle.n
    for wrench in wrenches:
        force, efforts = motion.generalized_force(
            wrench.force_W, wrench.torque_W, wrench.point, wrench.body
        )
        total = total + force
        pushed = sums(pushed, efforts)
    return total, pushed


STEADY = Surroundings()
"""Plant inputs without any environment model."""


def with_lag(
    vehicle: Vehicle,
    state: State,
    command: Command,
    dt: Scalar,
    around: Surroundings = STEADY,
) -> State:
    """Vehicle state whose rotor speeds and tilt angles have followed a constant command
    for ``dt`` seconds.
    """
    commands = around.rotor_commands(vehicle.rotors, command.rotor_speeds)
    return replace(
        state,
        rotor_speeds=speeds_after(vehicle.rotors, state.rotor_speeds, commands, dt),
        tilts=(
            angles_after(vehicle, state.tilts, command.tilts, dt)
            if vehicle.tilts
            else ()
        ),
    )


def follow_commands(
    worlds: Sequence[Truth],
    states: Sequence[State],
    commands: Sequence[Command],
    around: Together,
    dt: Scalar,
) -> tuple[State, ...]:
    """States of the vehicles, whose rotor speeds and tilt angles have followed constant
    commands for ``dt`` (s).
    """
    rows = enumerate(zip(worlds, states, commands, strict=True))
    return tuple(
        with_lag(world.vehicle, state, command, dt, around.of(i))
        for i, (world, state, command) in rows
    )


def with_equivalent_rotors(
    worlds: Sequence[Truth],
    stages: Sequence[Sequence[State]],
    commands: Sequence[Command],
    around: Together,
    dt: Scalar,
    *,
    held: bool = False,
) -> tuple[Sequence[Truth], Sequence[Sequence[State]]]:
    """Vehicles and states by which the rotors' forces have their impulse of a step of
    ``dt`` (s).

    Args:
        worlds: true vehicles and gravity.
        stages: states at the begin and within the step, each of all vehicles.
        commands: commands of each vehicle.
        around: surroundings of the period.
        dt: s.
        held: True if forces are held for the step; else only short lags need it.
    """
    if not held and not any(
        has_short_lag(rotor) for world in worlds for rotor in world.vehicle.rotors
    ):
        return worlds, stages
    made = list[Truth]()
    equivalent = list[list[State]]()
    # angles of tilting rotors are those of the middle of a step
    moved = (
        [follow_commands(worlds, stages[0], commands, around, 0.5 * dt)]
        if held
        else stages
    )
    for i, (world, command) in enumerate(zip(worlds, commands, strict=True)):
        rotors = world.vehicle.rotors
        turned = list[Rotor]()
        columns = list[Sequence[Scalar]]()
        received = around.of(i).rotor_commands(rotors, command.rotor_speeds)
        within = (stage[i].rotor_speeds for stage in stages)
        for rotor, demanded, *there in zip(rotors, received, *within, strict=True):
            speeds = there
            lag = lag_of(rotor, there[0], demanded)
            if held or has_short_lag(rotor):
                mean, until = equivalent_speed_and_lag(rotor, speeds[0], demanded, dt)
                short = held or lag < short_lag(rotor)
                speeds = [where(short, mean, each) for each in speeds]
                lag = where(short, until, lag)
            # one lag for both directions: within a step the direction is known
            turned.append(replace(rotor, time_constant_up=lag, time_constant_down=lag))
            columns.append(speeds)
        made.append(
            replace(world, vehicle=world.vehicle.with_checked(rotors=tuple(turned)))
        )
        rows = [tuple(column[k] for column in columns) for k in range(len(stages))]
        equivalent.append(
            [
                replace(s[i], rotor_speeds=row)
                for s, row in zip(moved, rows, strict=True)
            ]
        )
    return made, [*zip(*equivalent, strict=True)]


def held_frictions(vehicle: Vehicle, state: State, dt: Scalar) -> Scalars:
    """Armature (kg m^2 or kg) by which a semi-implicit Euler step of ``dt`` (s) takes
    each joint's friction at its end.

    With r the friction per rate at the begin, (M + dt r) (v' - v) = dt (F - r v) is M
    (v' - v) = dt (F - r v'): no friction turns a joint round within a step, however
    stiff, and it rests where it would.
    Source: Hairer, Wanner 1996, Solving Ordinary Differential Equations II, IV.15.
    """
    pairs = zip(vehicle.joints, state.joint_rates, strict=True)
    # dt r stands beside the inertia: as if the joint were heavier for this step
    return tuple(mul(dt, friction_per_rate(joint, rate)) for joint, rate in pairs)


def with_armature(vehicle: Vehicle, added: Sequence[Scalar]) -> Vehicle:
    """Vehicle with more armature (kg m^2 or kg) at its joints: an int 0 adds nothing,
    () none at any.
    """
    if all(type(more) is int for more in added):
        return vehicle
    links = list(vehicle.links)
    for i, more in enumerate(added):
        if type(more) is not int:
            joint = replace(links[i].joint, armature=add(links[i].joint.armature, more))
            links[i] = replace(links[i], joint=joint)
    return vehicle.with_checked(links=tuple(links))


def before_euler_step(
    worlds: Sequence[Truth], states: Sequence[State], around: Together, dt: Scalar
) -> Together:
    """Surroundings from which a semi-implicit Euler step evaluates forces: friction
    bristles are advanced.
    """
    return (
        around.bend(around.slopes(around.motions(worlds, states)), dt)
        if around.coupled
        else around
    )
