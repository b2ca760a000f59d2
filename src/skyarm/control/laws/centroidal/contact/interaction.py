"""Contact force control in the centroidal law: force control along the surface normal,
motion control across.

Force, touch and loss are those of :mod:`skyarm.control.blocks.force_control`; along n
the tip has damping alone, across n everything is as without a surface. While the tip
presses with its full force and its reference moves along the surface, sliding corrects
the normal: the tip moves along the surface, so that its velocity along n is an error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from skyarm.algebra import Scalar, Vec3
from skyarm.algebra.scalars import (
    absolute,
    clip,
    divide,
    logical_and,
    logical_not,
    logical_or,
    maximum,
    mul,
    sqrt,
    where,
)
from skyarm.algebra.scalars.taylor import Taylor
from skyarm.control.blocks.disturbance_observer import disturbance
from skyarm.control.blocks.filters import low_pass
from skyarm.control.blocks.force_control import (
    DesiredContact,
    InteractionGains,
    InteractionMemory,
    Pressing,
    contact_cleared,
    first_interaction,
    interact,
    wanted_of,
)
from skyarm.control.blocks.prediction import Disturbance
from skyarm.control.blocks.tip_force import TipLevers, levers
from skyarm.control.blocks.torque_scale import first_scale
from skyarm.control.laws.centroidal.parameters import (
    CentroidalParameters,
    OptionalPart,
    Step,
)
from skyarm.control.laws.centroidal.step_records import AccelerationDemand, Effect
from skyarm.dynamics.actuators import Command
from skyarm.dynamics.kinematics import frame_pose
from skyarm.records.leaves import as_data
from skyarm.vehicle import Vehicle


@dataclass(frozen=True, kw_only=True, slots=True)
class Interaction(InteractionGains, OptionalPart):
    """Contact force control as an optional part of the centroidal law; ``geared``: a
    joint has armature inertia.
    """

    geared: bool = False

    def start(self, joints: int) -> InteractionMemory:
        """Initial state of the contact force controller: no contact."""
        scale = () if self.tolerances is None else first_scale(joints)
        return replace(first_interaction(joints, self.sensing is not None), scale=scale)

    def adjust_gains(
        self, memory: InteractionMemory, par: CentroidalParameters, dt: Scalar
    ) -> CentroidalParameters:
        """Reduce the accelerometer's bandwidth while the tip presses, since the surface
        reacts to the base's motion.
        """
        heard = par.observer.accelerometer
        if heard is None:
            return par
        heard = replace(
            heard, force=heard.force * (1.0 - (1.0 - PRESSING) * memory.share)
        )
        return replace(par, observer=replace(par.observer, accelerometer=heard))

    def affect(
        self, memory: InteractionMemory, step: Step, effect: Effect
    ) -> tuple[InteractionMemory, Effect]:
        """Replace the observed contact force by the commanded one, and stop adaptation
        during contact.
        """
        if not step.reference.push:
            return memory, effect
        observed = step.seen.observed
        state = step.state
        dt = step.dt
        vehicle = step.par.model.vehicle
        then = levers(vehicle, observed.quaternion.rotation(), observed.joints)
        now = levers(vehicle, state.rotation, state.joints)
        planned = wanted_of(step.reference.push).about_the_pivot(
            state.position + now.R.apply(now.tip)
        )
        desired = replace(planned, normal=estimated_normal(planned.normal, memory.lean))
        velocity = now.velocity(state.velocity, state.rate, state.joint_rates)
        course = Vec3(*(signal.derivative(1) for signal in effect.signals[:3]))
        across = course - desired.normal * desired.normal.dot(course)
        slides: Scalar = across.dot(across) > SLIDES * SLIDES
        # while it slides friction is at its cone: less compensation would slow the tip
        # and relieve nothing
        effort = where(slides, 0.0, _effort(vehicle, step.memory.sent))
        felt = None
        reading = step.measurement.tip_force
        load = step.memory.parts.load
        if memory.felt and reading and self.sensing is not None:
            # the sensor measures the weight of a load too, which the surface does not
            # carry
            weight = mul(load.mass, step.par.model.gravity) if load else 0
            turned = then.R @ frame_pose(vehicle, vehicle.frame(), observed.joints).R
            felt = low_pass(
                memory.felt,
                turned.apply(Vec3(*reading)) + Vec3(0, 0, weight),
                self.sensing,
                dt,
            )
        moving = motion_share(self, memory.moving, across, dt)
        into = -desired.normal.dot(velocity)
        seen, memory = self._at_scale(memory, step, then, desired)
        memory, pressing = interact(
            self, memory, desired, seen, then, into, effort, dt, felt, moving
        )
        # until the full force acts the tip still moves along the normal, which is no
        # lean
        slides = logical_and(slides, memory.share > 1.0 - 1e-9)
        lean = update_lean(
            memory.lean,
            desired.normal,
            velocity,
            self.tilting,
            desired.presses,
            slides,
            dt,
        )
        given = pressing.with_order(effect.unknown, then, now)
        force = observed.force + given.force - effect.unknown.force
        if self.geared:
            given = with_slow_wind(
                given,
                pressing,
                effect.unknown.force - pressing.force,
                memory.bias.force,
            )
        effect = replace(
            effect,
            signals=shift_reference(pressing, effect.signals),
            unknown=given,
            force=force,
            external=pressing.engaged,
            pressing=pressing,
        )
        # until the first contact the lag is estimated all the same
        before = where(memory.free > SETTLED, 1.0 - memory.met, 0.0)
        effect = effect.isolating(contact_cleared(self, memory), before)
        return (
            replace(memory, lean=as_data(lean), moving=moving),
            effect,
        )

    def _at_scale(
        self,
        memory: InteractionMemory,
        step: Step,
        at: TipLevers,
        desired: DesiredContact,
    ) -> tuple[Disturbance, InteractionMemory]:
        """Observed disturbance corrected for joint torque scales, and next state with
        their updated estimate.
        """
        seen = disturbance(step.seen.observed)
        scale = memory.scale
        by = self.tolerances
        if not scale or by is None:
            return seen, memory
        # not on the way to the surface either: an observer is late, and would learn of
        # the touch
        efforts = step.timing.acted.efforts
        alone = logical_not(desired.requests_contact)
        for grasp in step.holds:
            alone = logical_and(alone, grasp < 0.5)
        free = logical_and(alone, logical_or(memory.free > self.rest, scale.met < 0.5))
        rate = where(memory.free > self.rest, self.bias_rate, 0.0)
        after = scale.learn(
            by, self.errors, at, seen, efforts, desired.normal, free, rate, step.dt
        )
        after = replace(after, met=maximum(scale.met, memory.touching))
        return scale.correct(by, self.errors, at, seen, efforts), replace(
            memory, scale=after
        )

    def learn(
        self, memory: InteractionMemory, effect: Effect, demand: AccelerationDemand
    ) -> InteractionMemory:
        """Store the distance of the tip from its reference along the surface normal."""
        if effect.pressing is None:
            return memory
        return replace(memory, gap=effect.pressing.n.dot(demand.missed))


PRESSING = 0.5
"""Fraction of the accelerometer's bandwidth that is left while the tip presses. With 1
the rotors of a hexarotor that presses 7 N with a bent elbow stand still for a quarter
of the time, with 0.5 they never do."""

SETTLED = 0.15
"""Time (s) from the start of a flight after which the lag is estimated until the first
contact. A touch holds what is found until then, and loses the loop where it is too
little. Before, the observers answer the start."""

SLIDES = 0.01
"""Reference speed (m/s) along the surface from which friction is at its cone and cannot
be released."""

MOVES = 0.001
"""Speed (m/s) along the surface below which the reference counts as at rest: friction
may hold the tip off it."""


def motion_share(
    gains: InteractionGains, share: Scalar, across: Vec3, dt: Scalar
) -> Scalar:
    """Sliding flag, ramped between 0 (rest) and 1 (sliding), from the reference
    velocity (m/s) along the surface.
    """
    square: Scalar = across.dot(across)
    step = where(
        square > MOVES * MOVES, divide(dt, gains.starting), -divide(dt, gains.rise)
    )
    return where(square > SLIDES * SLIDES, 1.0, clip(share + step, 0.0, 1.0))


def _effort(vehicle: Vehicle, sent: Command) -> Scalar:
    """Largest actuator load as a share of the limit: of joint efforts and squared rotor
    speeds.
    """
    most: Scalar = 0.0
    for link, effort in zip(vehicle.links, sent.efforts, strict=True):
        # 0 is none
        limit = link.joint.effort_limit
        most = maximum(most, where(limit > 0.0, divide(absolute(effort), limit), 0.0))
    for rotor, speed in zip(vehicle.rotors, sent.rotor_speeds, strict=True):
        share = divide(speed, rotor.max_speed)
        most = maximum(most, share * share)
    return most


def with_slow_wind(
    given: Disturbance, pressing: Pressing, beside: Vec3, slow: Vec3
) -> Disturbance:
    """Disturbance whose non-contact force is slowly filtered along the surface normal
    while the tip presses.

    The inertia of geared motors couples the tip to the base: joints that answered each
    error of the observed force would press with it.

    Args:
        given: disturbance with the commanded contact force.
        pressing: output of the contact force controller.
        beside: observed force on the base beside the contact's, N, world axes.
        slow: the same, filtered at ``wind_rate``.
    """
    n = pressing.n
    return replace(
        given, force=given.force - n * (n.dot(beside - slow) * pressing.engaged)
    )


def shift_reference(pressing: Pressing, signals: Sequence[Taylor]) -> list[Taylor]:
    """Reference signals with x, y and z shifted along the surface normal."""
    s = Taylor(
        (pressing.shift[0], pressing.shift[1], mul(0.5, pressing.shift[2]), 0.0, 0.0)
    )
    return [
        *(each + s * c for each, c in zip(signals[:3], pressing.n, strict=True)),
        *signals[3:],
    ]


SLOW = 0.02
"""Speed (m/s) below which the direction of sliding is uncertain; chosen."""

STEEPEST = 0.4
"""Largest component of the estimated tilt of a surface normal: 20 degrees and more for
a nominally level surface."""


def estimated_normal(nominal: Vec3, lean: Vec3) -> Vec3:
    """Unit normal of the surface: the reference's normal corrected by the estimated
    tilt of the surface.
    """
    n = nominal + lean
    # a reference that has not begun has no normal
    return n * divide(1.0, sqrt(n.dot(n) + 1e-12))


def update_lean(
    lean: Vec3,
    n: Vec3,
    velocity: Vec3,
    rate: Scalar,
    asked: Scalar,
    slides: Scalar,
    dt: Scalar,
) -> Vec3:
    """Estimated tilt of the surface normal one period later, from tip velocity (m/s,
    world axes); ``rate`` in 1/s.
    """
    share = where(slides, rate * dt, 0.0) * divide(
        n.dot(velocity), velocity.dot(velocity) + SLOW * SLOW
    )
    moved = lean - velocity * share
    return Vec3(*(where(asked, clip(each, -STEEPEST, STEEPEST), 0.0) for each in moved))
