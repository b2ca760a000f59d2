"""A load at the tip, learned from the observed disturbance while something is held, and a part of the law's model.

A mass dm that the model lacks hangs in the observed disturbance as its weight -dm g e_z at the tip; one that lies
elsewhere than the model has it, as a horizontal torque t about the tip. Both are the weighted least squares (lengths as
in :mod:`skyarm.control.laws.centroidal.tip_force`) of

    joints J_v^T f + J_w^T t,  turning r x f + t,  vertical force f_z,      f = -dm g e_z

in what is observed beside its bias b, which is learned while nothing is held: wind, wrong masses, wrong thrust. Then

    m' = rate dm,      c' = place_rate (-e_z x t / g) m / (m^2 + light^2),

m from 0 to a limit, and c the place of its centre of mass in axes that turn with the tip: while the hand rests it is
known in two directions, and in the third as soon as the hand turns. A vehicle that holds m at c, with a radius of
gyration that is told (or moments, :mod:`skyarm.control.laws.centroidal.load_inertia`), is the model: of inverse
dynamics, thrust, prediction and observer alike, so that what is learned is not observed again, and the law's gains are
accelerations of the loaded arm. The period that is told that nothing is held any more forgets the load, and the next
one flies without it.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

from skyarm.algebra import Mat3, Sym3, Vec3
from skyarm.control.blocks.disturbance import Disturbance
from skyarm.control.blocks.filters import low_pass_share
from skyarm.control.blocks.normal_equations import NormalEquations
from skyarm.control.blocks.select import data, vector_data
from skyarm.control.laws.centroidal.load_inertia import learn_inertia
from skyarm.control.laws.centroidal.load_records import InertiaMemory, LoadGains, LoadMemory
from skyarm.control.laws.centroidal.tip_force import without
from skyarm.control.model import Model
from skyarm.dynamics.kinematics import frame_pose, jacobian_columns
from skyarm.scalars import add, clip, divide, maximum, mul, where
from skyarm.vehicle.linkage import Body
from skyarm.vehicle.vehicle_records import Vehicle

UP = Vec3(0, 0, 1)

VAGUE = 1e6
"""kg, of a mass about which nothing is known beforehand: without gravity nothing tells of it, and none is found."""


def with_learned(model: Model, gains: LoadGains, memory: LoadMemory) -> Model:
    """The model with the load that its tip holds."""
    tip = model.vehicle.frame()
    about = memory.mass * (gains.size * gains.size)
    inertia = Sym3(about, about, about)
    if isinstance(memory.inertia, InertiaMemory):
        inertia = Sym3(*memory.inertia.moments).rotated(tip.rotation)
    load = Body(mass=memory.mass, com=tip.position + tip.rotation.apply(memory.place), inertia=inertia)
    return dataclasses.replace(model, vehicle=model.vehicle.with_body(tip.link, load))


@dataclasses.dataclass(frozen=True, slots=True)
class Hang:
    """How a weight at the tip, and a horizontal torque about it, reach base and joints.

    Attributes:
        lift: N on the base, world z, of 1 kg more. turning: N m on the base, base axes, of 1 kg more and of 1 N m about
            world x and y. efforts: of the joints, likewise, a row each. tip: R_WT, axes of the tip.
    """

    lift: Any
    turning: tuple[Vec3, Vec3, Vec3]
    efforts: tuple[tuple[Any, Any, Any], ...]
    tip: Mat3


def hang(vehicle: Vehicle, R: Mat3, joints: Sequence[Any], gravity: Any) -> Hang:
    """Rows of the regression at an attitude and joint positions."""
    frame = vehicle.frame()
    pose = frame_pose(vehicle, frame, joints)
    weight, about_x, about_y = (R.apply_T(each) for each in (Vec3(0, 0, -gravity), Vec3(1, 0, 0), Vec3(0, 1, 0)))
    return Hang(
        lift=-gravity,
        turning=(pose.p.cross(weight), about_x, about_y),
        efforts=tuple(
            (column.linear.dot(weight), column.angular.dot(about_x), column.angular.dot(about_y))
            for column in jacobian_columns(vehicle, frame, joints)
        ),
        tip=R @ pose.R,
    )


def missing(vehicle: Vehicle, gains: LoadGains, at: Hang, rest: Disturbance) -> list[Any]:
    """Mass (kg) and horizontal torque about the tip (N m, world x and y) in ``rest``: weighted least squares."""
    A: list[list[Any]] = [[0.0 for _ in range(3)] for _ in range(3)]
    squares = NormalEquations(A, [0.0, 0.0, 0.0])
    squares.require((at.lift, 0, 0), rest.force.z, 1.0)
    for turned, torque in zip(zip(*at.turning, strict=True), rest.torque, strict=True):
        squares.require(turned, torque, gains.errors.base)
    for link, row, effort in zip(vehicle.links, at.efforts, rest.efforts, strict=True):
        squares.require(row, effort, gains.errors.turning if link.joint.kind == "revolute" else gains.errors.sliding)
    A[0][0] = add(A[0][0], 1.0 / VAGUE**2)
    for k in (1, 2):
        A[k][k] = add(A[k][k], divide(1.0, gains.twist * gains.twist))
    return squares.solve()


def learn_load(
    gains: LoadGains,
    memory: LoadMemory,
    model: Model,
    R: Mat3,
    joints: Sequence[Any],
    observed: Disturbance,
    holds: Any,
    learns: Any,
    bandwidth: Any,
    dt: Any,
    turned: tuple[Sequence[Vec3], Any] | None = None,
) -> tuple[LoadMemory, Disturbance]:
    """The load one period later, and what the law shall not push against.

    A load that is held and lies on something pushes the tip up as soon as the reference is a little low, and a law that
    answered this would push down ever harder and leave its support late. So an upward force beyond the load's weight
    is taken out of the disturbance that the law answers.

    Args:
        gains: constants.
        memory: one period earlier.
        model: belief, whose vehicle's tip holds the load.
        R: R_WB at the measurement's time.
        joints: then, rad or m.
        observed: what the observer holds.
        holds: whether something is held.
        learns: 1 where the observed disturbance tells of the load, 0 on a surface and at limits of actuators.
        bandwidth: of the observer, rad/s.
        dt: s.
        turned: torques of 1 kg m^2 about each axis of the tip, as the reference turns it (world axes), and the lag of
            each of two stages of the observer, s; None of a law that learns no inertia.
    """
    at = hang(model.vehicle, R, joints, model.gravity)
    mass, about_x, about_y = missing(model.vehicle, gains, at, without(observed, memory.bias))
    least = gains.light * gains.limit
    small = gains.noise_share * (memory.mass + least)
    large = divide(mass * mass, mass * mass + small * small)  # 0 where the mass is settled
    step = _step(gains.pace, bandwidth, holds, learns, dt) * (gains.settled_rate + (1.0 - gains.settled_rate) * large)
    m = clip(memory.mass + step * mass, 0.0, gains.limit)
    slow = _step(gains.place_pace, bandwidth, holds, learns, dt) * (1.0 - large)
    known = divide(m, (m * m + least * least) * maximum(model.gravity, 1e-3))
    off = at.tip.apply_T(UP.cross(Vec3(about_x, about_y, 0))) * (-slow * known)
    far = gains.furthest
    place = Vec3(*(clip(each, -far, far) for each in memory.place + off))
    share = where(holds, 0.0, low_pass_share(gains.bias_rate, dt)) * learns
    inertia = memory.inertia
    if gains.inertia is not None and isinstance(inertia, InertiaMemory) and turned is not None:
        unit, late = turned
        left, calm = without(observed, memory.bias).efforts, learns * (1.0 - large)
        inertia = learn_inertia(
            gains.inertia, inertia, m, gains.size, model.vehicle, R, joints, unit, left, holds, calm, late, dt
        )
    after = LoadMemory(
        mass=where(holds, m, 0.0),
        place=Vec3(*(where(holds, data(each), 0.0) for each in place)),
        bias=Disturbance(
            force=vector_data(memory.bias.force + (observed.force - memory.bias.force) * share),
            torque=vector_data(memory.bias.torque + (observed.torque - memory.bias.torque) * share),
            efforts=tuple(
                data(b + (e - b) * share) for b, e in zip(memory.bias.efforts, observed.efforts, strict=True)
            ),
        ),
        inertia=inertia,
    )
    rests = maximum(-(memory.mass + mass), 0.0) * where(holds, learns, 0.0)
    return after, Disturbance(
        force=Vec3(0, 0, rests * at.lift),
        torque=at.turning[0] * rests,
        efforts=tuple(row[0] * rests for row in at.efforts),
    )


def _step(pace: Any, bandwidth: Any, holds: Any, learns: Any, dt: Any) -> Any:
    """The share of an error that is learned in one period."""
    return where(holds, low_pass_share(mul(pace, bandwidth), dt), 0.0) * learns
