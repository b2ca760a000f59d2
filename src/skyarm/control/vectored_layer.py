"""Layer for tilting rotors around a law for pairs of fixed rotors, with compensation of
the tilt servos' lag.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Annotated, Any, ClassVar

from skyarm.algebra import Scalar, Scalars, differences, inner_product, ldl_solve
from skyarm.algebra.scalars import (
    absolute,
    add,
    clip,
    cos,
    data,
    divide,
    exp,
    maximum,
    minimum,
    mul,
    sqrt,
    sub,
    total,
    where,
)
from skyarm.control.controller import Controller, ControllerError, Law, layers
from skyarm.control.law_checks import check_controller, checked_law
from skyarm.control.model import LayerParameters, Model
from skyarm.dynamics.actuators import Command, allocation_matrix
from skyarm.dynamics.actuators.tilting import (
    TiltedForce,
    angles_after,
    as_pairs,
    forces_of_pairs,
    speeds_of_pairs,
    turn_rotors,
)
from skyarm.records.immutable import immutable
from skyarm.records.leaves import as_data, is_record
from skyarm.records.units import Unit
from skyarm.reference import Reference
from skyarm.sensing.measurement import Measurement
from skyarm.vehicle import Rotor, Vehicle

MOST_LEAD = 3.0
"""Largest lead factor of a tilt servo's setpoint: it amplifies noise in the angle by as
much. Chosen."""

STILL = 0.02
"""Fraction of a rotor's largest squared speed below which its tilt angle, which hardly
matters then, moves slowly; chosen."""

STRONG = 4.0
"""Upper bound of a rotor's largest squared speed, over that of hover: a rotor may have
no largest speed. Chosen, twice the speed."""

TURNING = 200.0
"""Rate (1/s) of a tilt angle at the thrust below which it moves slowly, in proportion
to the thrust. At that thrust it moves at once in a period of 5 ms."""

YAW_DAMPING = 1.0
"""Damping of the yaw torque correction, over the rotors' squared reach in torque about
z at rest. Angles at which thrusts give no yaw torque then request none.

With 1, at rest, half of the torque is asked of the thrusts and half is left to come
with the angles."""


@immutable
class VectoredParameters(LayerParameters):
    """Constants of a law inside the tilting-rotor layer, whose mixer is for pairs of
    fixed rotors.

    Attributes:
        lead: lead factor of each servo's setpoint.
    """

    lead: Annotated[
        Scalars,
        Unit(
            "",
            "lead factor of each tilt servo's setpoint, times its remaining angle",
            effect="higher values turn the servo faster and amplify noise",
        ),
    ]

    turns_rotors: ClassVar[bool] = True

    @property
    def inner_model(self) -> Model:
        """Model for the inner law: two fixed rotors in place of each tilting rotor."""
        return pairs_model(self.model)


@immutable
class VectoredMemory:
    """Internal state of a law with the tilting-rotor layer: state of the law, desired
    and modelled servo angles.

    Attributes:
        inner: memory of the law.
        goals: angles of the last desired wrench. angles: angles that the modelled
            servos have reached.
        matched: angles of servos that would lag just as the motors do, as the law
            reckons.
    """

    inner: Any
    goals: Annotated[Scalars, Unit("rad", "tilt angles that the last wrench requires")]
    angles: Annotated[Scalars, Unit("rad", "tilt angles of the modelled servos")]
    matched: Annotated[
        Scalars, Unit("rad", "tilt angles of servos with the lag of the motors")
    ]

    def inside(self, par: VectoredParameters, command: Command) -> Command:
        """Command to the pairs of fixed rotors that act as the tilting ones do at the
        modelled angles.
        """
        speeds = speeds_of_pairs(par.model.vehicle, command.rotor_speeds, self.angles)
        return replace(command, rotor_speeds=speeds, tilts=())


def law_inside(controller: Controller) -> Controller:
    """Controller inside a layer: inside the allocation to tilting rotors it has a pair
    of fixed rotors for each.
    """
    # without the check of its results
    layer: Any = getattr(controller.law, "keywords", {}).get("law", controller.law)
    inner = layer.keywords["inner"]
    memory = controller.memory.inner
    return replace(controller, law=inner, par=controller.par.own, memory=memory)


def turns_rotors(controller: Controller) -> bool:
    """True if a law, inside any layers, commands angles of tilting rotors."""
    return any(getattr(par, "turns_rotors", False) for par in layers(controller.par))


def pairs_model(model: Model) -> Model:
    """Model with two fixed rotors in place of each tilting one."""
    return replace(model, vehicle=as_pairs(model.vehicle))


def with_tilting(controller: Controller, model: Model) -> Controller:
    """Wrap a law for pairs of fixed rotors so that it commands speeds and angles of
    tilting rotors.

    The law's wrench is a sum of forces, one for each rotor: its size is a squared
    speed, its direction an angle. Servos are slow beside motors, so the thrusts are
    those that give torque and thrust of the wrench at the angles that are reached now,
    with the least change from the wanted forces' parts along the axes as they stand.
    The force across the thrust comes as the angles come. Angles are measured; where a
    measurement has none, they are the modelled servos'.

    Raises:
        ControllerError: the model's vehicle has no rotor that tilts, or the law has the
            layer already.
    """
    check_controller(controller)
    if getattr(controller.par, "turns_rotors", False):
        raise ControllerError(f"law {controller.name!r} has its tilting rotors already")
    vehicle = model.vehicle
    if not vehicle.tilts:
        raise ControllerError(
            f"model.vehicle = {vehicle.name!r}: must have a rotor with a tilt"
        )
    rest = (0.0,) * len(vehicle.tilts)
    law = partial(vectored_law, inner=checked_law(controller))
    return replace(
        controller,
        law=law,
        par=VectoredParameters.around(
            controller.par, model=model, lead=_leads(vehicle)
        ),
        memory=VectoredMemory(
            inner=controller.memory, goals=rest, angles=rest, matched=rest
        ),
    )


def with_leads(par: Any) -> Any:
    """Constants of a law's layers, with the lead factors of tilt servos that follow
    from the model.
    """

    def refit(layer: Any) -> Any:
        if isinstance(layer, VectoredParameters):
            return replace(layer, lead=_leads(par.model.vehicle))
        inner = getattr(layer, "inner", None)
        return replace(layer, inner=refit(inner)) if is_record(inner) else layer

    return refit(par)


def _leads(vehicle: Vehicle) -> Scalars:
    """Lead factor on each tilt servo's setpoint that makes its lag equal to the rotor's
    motor lag.
    """
    rows = [
        (rotor.tilt.time_constant, _motor_lag(rotor))
        for rotor in vehicle.rotors
        if rotor.tilt is not None
    ]
    return tuple(
        # a servo that is quicker than its motor is not slowed: 1 sends the goal itself
        minimum(maximum(1.0, divide(servo, motor)), MOST_LEAD)
        for servo, motor in rows
    )


def _motor_lag(rotor: Rotor) -> Scalar:
    """Mean of a rotor's two motor time constants (s), for rising and falling speed."""
    return mul(0.5, add(rotor.time_constant_up, rotor.time_constant_down))


def vectored_law(
    memory: VectoredMemory,
    measurement: Measurement,
    reference: Reference,
    dt: Scalar,
    *,
    par: VectoredParameters,
    inner: Law,
) -> tuple[VectoredMemory, Command]:
    """Step of a law for pairs of fixed rotors, with its command converted to rotor
    speeds and angles.
    """
    vehicle = par.model.vehicle
    own = par.own
    angles = angles_seen(measurement, memory.angles)
    turning = speeds_of_pairs(vehicle, measurement.rotor_speeds, angles)
    inner_measurement = replace(measurement, rotor_speeds=turning, tilts=())
    following, command = inner(memory.inner, inner_measurement, reference, dt, par=own)
    forces = forces_of_pairs(vehicle, command.rotor_speeds)
    goals = goal_angles(par.model, forces, memory.goals, dt)
    setpoints = tuple(
        clip(add(now, mul(lead, sub(goal, now))), tilt.lower, tilt.upper)
        for now, goal, lead, tilt in zip(
            angles, goals, par.lead, vehicle.tilts, strict=True
        )
    )
    ahead = zip(goals, angles, memory.matched, strict=True)
    # angles that lag as motors do need no correction: thrusts are as late
    squares = squares_at(
        vehicle, forces, [add(goal, sub(now, due)) for goal, now, due in ahead]
    )
    # servos with the lag of the motors, one period later
    rotors = [each for each in vehicle.rotors if each.tilt is not None]
    matched = tuple(
        add(goal, mul(sub(now, goal), exp(divide(sub(0.0, dt), _motor_lag(rotor)))))
        for rotor, now, goal in zip(rotors, memory.matched, goals, strict=True)
    )
    moved = VectoredMemory(
        inner=following,
        goals=as_data(goals),
        angles=as_data(angles_after(vehicle, angles, setpoints, dt)),
        matched=as_data(matched),
    )
    speeds = tuple(data(sqrt(maximum(each, 0.0))) for each in squares)
    return moved, Command(
        rotor_speeds=speeds, efforts=command.efforts, tilts=as_data(setpoints)
    )


def angles_seen(measurement: Measurement, believed: Scalars) -> Scalars:
    """Servo angles (rad): measured, or modelled where a measurement is missing or not
    finite.
    """
    if not measurement.tilts:
        return believed
    rows = zip(measurement.tilts, believed, strict=True)
    return tuple(
        where(absolute(seen) < math.inf, seen, modelled) for seen, modelled in rows
    )


def goal_angles(
    model: Model, forces: Sequence[TiltedForce], last: Sequence[Scalar], dt: Scalar
) -> Scalars:
    """Servo angles (rad) of the desired rotor forces, which change slowly where a force
    is near zero.
    """
    vehicle = model.vehicle
    lift = total(each.thrust_coefficient for each in vehicle.rotors)
    hover = divide(mul(vehicle.mass, model.gravity), lift)
    # without gravity nothing hovers, so only the rotor's own largest speed counts
    strongest = where(hover > 0.0, mul(STRONG, hover), math.inf)
    rows = [
        (r, f)
        for r, f in zip(vehicle.rotors, forces, strict=True)
        if r.tilt is not None
    ]
    angles = []
    for (rotor, force), before in zip(rows, last, strict=True):
        top = minimum(mul(rotor.max_speed, rotor.max_speed), strongest)
        # a direction of hardly any force is that of its noise, so the angle follows
        # slowly
        share = minimum(mul(divide(force.push, mul(STILL, top)), mul(TURNING, dt)), 1.0)
        angles.append(add(before, mul(share, sub(force.angle, before))))
    return tuple(angles)


def squares_at(
    vehicle: Vehicle, forces: Sequence[TiltedForce], angles: Sequence[Scalar]
) -> list[Scalar]:
    """Squared rotor speeds that give the desired torque and thrust at given rotor
    angles.

    Beginning with each wanted force's part along its rotor's axis as it stands, the
    least change (in squares) gives the four rows; as much of it is taken as the rotors'
    limits leave room for. Torque about z, which thrusts alone may hardly give, is
    damped.
    """
    desired = [
        force.angle
        for rotor, force in zip(vehicle.rotors, forces, strict=True)
        if rotor.tilt is not None
    ]
    left = iter(angles)
    stand = [next(left) if rotor.tilt is not None else 0 for rotor in vehicle.rotors]
    along = [
        maximum(mul(f.push, cos(sub(f.angle, now))), 0.0)
        for f, now in zip(forces, stand, strict=True)
    ]
    # the wrench that the forces would give at their own angles, which the servos lack
    # yet
    goal = _times(
        allocation_matrix(turn_rotors(vehicle, desired)),
        [force.push for force in forces],
    )
    A = allocation_matrix(turn_rotors(vehicle, angles))
    short = differences(goal, _times(A, along))
    gram = [[inner_product(a, b) for b in A] for a in A]
    at_rest = allocation_matrix(vehicle)[2]
    gram[2][2] = add(gram[2][2], mul(YAW_DAMPING, inner_product(at_rest, at_rest)))
    weights = ldl_solve(gram, short)
    change = [inner_product([row[i] for row in A], weights) for i in range(len(along))]
    tops = [mul(rotor.max_speed, rotor.max_speed) for rotor in vehicle.rotors]
    # one share for all rotors keeps the direction of the correction in torque and
    # thrust
    share: Scalar = 1.0
    for value, by, top in zip(along, change, tops, strict=True):
        room = where(by > 0.0, sub(top, value), value)
        size = where(by > 0.0, by, sub(0.0, by))
        share = minimum(
            share,
            where(
                size > room,
                divide(maximum(room, 0.0), where(size > 0.0, size, 1.0)),
                1.0,
            ),
        )
    return [
        minimum(add(value, mul(share, by)), top)
        for value, by, top in zip(along, change, tops, strict=True)
    ]


def _times(A: Sequence[Sequence[Scalar]], column: Sequence[Scalar]) -> list[Scalar]:
    return [inner_product(row, column) for row in A]
