"""Online estimate of mass and centre of mass of a load that the tip holds.

A mass dm beyond the model's is the weight -dm g e_z at the tip, one that lies elsewhere
a horizontal torque t about the tip: the weighted least squares (lengths as in
:mod:`skyarm.control.blocks.tip_force`) of both in the disturbance beyond its bias,
which is estimated while nothing is held. The mass m follows dm from 0 to a limit, and
the place c of its centre of mass -e_z x t / g, known in two directions while the hand
rests. The vehicle that holds m at c is the model of inverse dynamics, thrust,
prediction and observer alike; the load is forgotten when the reference holds nothing
more.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Any

from skyarm.algebra import (
    E_X,
    E_Y,
    E_Z,
    ZERO3,
    ZERO3_DATA,
    Mat3,
    Scalar,
    Scalars,
    Sym3,
    Vec3,
    inner_product,
)
from skyarm.algebra.scalars import (
    clip,
    data,
    divide,
    logical_or,
    maximum,
    minimum,
    mul,
    neg,
    where,
)
from skyarm.control.blocks.actuators import all_follow
from skyarm.control.blocks.filters import low_pass_share
from skyarm.control.blocks.force_control import contact_cleared
from skyarm.control.blocks.prediction import Disturbance, no_disturbance
from skyarm.control.blocks.tip_force import ForceErrors, LeastSquares
from skyarm.control.controller import ControllerError
from skyarm.control.laws.centroidal.parameters import (
    CentroidalParameters,
    OptionalPart,
    Step,
    at_shares,
)
from skyarm.control.laws.centroidal.step_records import Effect
from skyarm.control.model import Model
from skyarm.dynamics.kinematics import frame_pose, jacobian_columns
from skyarm.records.files import shown
from skyarm.records.immutable import immutable, positional
from skyarm.records.units import Unit
from skyarm.vehicle import BASE, Body, Vehicle

HOLDING = 0.85
"""Factor of all bandwidths while a heavy load is held. Its inertia about the grasp is
unknown."""

VAGUE = 1e6
"""Prior standard deviation (kg) of an unknown mass: without gravity no measurement
depends on it, and it stays zero."""


@positional
class Hang:
    """Regressor of a tip load: wrench on base and joints per kg and per N m of
    horizontal torque.

    Attributes:
        lift: N on the base, world z, per kg.
        turning: N m on the base, base axes, per kg and per N m about world x and y.
        efforts: effort of each joint, likewise.
        tip: R_WT, axes of the tip.
    """

    lift: Scalar
    turning: tuple[Vec3, Vec3, Vec3]
    efforts: tuple[tuple[Scalar, Scalar, Scalar], ...]
    tip: Mat3

    def weight(self, mass: Scalar, place: Vec3 = ZERO3) -> Disturbance:
        """Disturbance by the weight of a mass (kg) at a position ``place`` (m from the
        tip, axes of the tip).
        """
        lever = self.tip.apply(place) * mul(mass, self.lift)
        parts = mass, lever.y, neg(lever.x)
        torque = ZERO3
        for each, part in zip(self.turning, parts, strict=True):
            torque = torque + each * part
        efforts = tuple(inner_product(row, parts) for row in self.efforts)
        return Disturbance(
            force=Vec3(0, 0, mul(mass, self.lift)), torque=torque, efforts=efforts
        )


def hang(vehicle: Vehicle, R: Mat3, joints: Sequence[Scalar], gravity: Scalar) -> Hang:
    """Regressor of a tip load at an attitude and joint positions."""
    frame = vehicle.frame()
    pose = frame_pose(vehicle, frame, joints)
    weight, about_x, about_y = (
        R.apply_T(each) for each in (Vec3(0, 0, -gravity), E_X, E_Y)
    )
    return Hang(
        lift=-gravity,
        turning=(pose.p.cross(weight), about_x, about_y),
        efforts=tuple(
            (
                column.linear.dot(weight),
                column.angular.dot(about_x),
                column.angular.dot(about_y),
            )
            for column in jacobian_columns(vehicle, frame, joints)
        ),
        tip=R @ pose.R,
    )


def missing(vehicle: Vehicle, gains: LoadGains, at: Hang, rest: Disturbance) -> Scalars:
    """Unmodelled tip load that best explains a disturbance: mass (kg) and horizontal
    torque (N m).
    """
    squares = LeastSquares(3)
    errors = gains.errors
    squares.require((at.lift, 0, 0), rest.force.z, 1)
    for turned, torque in zip(zip(*at.turning, strict=True), rest.torque, strict=True):
        squares.require(turned, torque, divide(1.0, errors.base * errors.base))
    for link, row, effort in zip(vehicle.links, at.efforts, rest.efforts, strict=True):
        squares.require(row, effort, errors.weight_of(link))
    twist = divide(1.0, gains.twist * gains.twist)
    for k, weight in enumerate((1.0 / VAGUE**2, twist, twist)):
        squares.prefer([0], weight, k)
    return squares.solve()


def learn_load(
    gains: LoadGains,
    memory: LoadMemory,
    model: Model,
    at: Hang,
    observed: Disturbance,
    holds: Scalar,
    learns: Scalar,
    bandwidth: Scalar,
    dt: Scalar,
) -> tuple[LoadMemory, Disturbance]:
    """Load estimate one period later, and the force of a support under the load, which
    is not to be compensated.

    A held load that lies on something pushes the tip up as soon as the reference is
    low; a law that compensated this would push down ever harder. So an upward force
    beyond the load's weight is taken out of the disturbance.

    ``at``: regressor at the measurement's time; ``holds``: whether something is held;
    ``learns``: 0 on a surface and at limits of actuators; ``bandwidth`` of the
    observer, rad/s.
    """
    beyond = (
        observed
        - memory.bias
        - at.weight(mul(1.0 - gains.inertia_share, memory.mass), memory.place)
    )
    mass, about_x, about_y = missing(model.vehicle, gains, at, beyond)
    least = gains.light * gains.limit
    small = gains.noise_share * (memory.mass + least)
    # 0 where the mass is settled
    large = divide(mass * mass, mass * mass + small * small)
    step = _step(gains.pace, bandwidth, holds, learns, dt) * (
        gains.settled_rate + (1.0 - gains.settled_rate) * large
    )
    m = clip(memory.mass + step * mass, 0.0, gains.limit)
    slow = _step(gains.place_pace, bandwidth, holds, learns, dt) * (1.0 - large)
    # torque over weight is the place; a light load's torque is mostly noise, so its
    # place moves slowly, and without gravity nothing tells it
    per_weight = divide(m, (m * m + least * least) * maximum(model.gravity, 1e-3))
    off = at.tip.apply_T(E_Z.cross(Vec3(about_x, about_y, 0))) * (-slow * per_weight)
    far = gains.furthest
    place = Vec3(*(clip(each, -far, far) for each in memory.place + off))
    # a load that is held would be learned as the bias, and be gone from the estimate
    share = where(holds, 0.0, low_pass_share(gains.bias_rate, dt)) * learns
    after = LoadMemory(
        mass=where(holds, m, 0.0),
        place=Vec3(*(where(holds, data(each), 0.0) for each in place)),
        bias=memory.bias.blend_towards(observed, share, share),
    )
    rests = maximum(-(memory.mass + mass), 0.0) * where(holds, learns, 0.0)
    return after, at.weight(rests)


def _step(
    pace: Scalar, bandwidth: Scalar, holds: Scalar, learns: Scalar, dt: Scalar
) -> Scalar:
    """Filter gain of the load estimate for one period."""
    return where(holds, low_pass_share(mul(pace, bandwidth), dt), 0.0) * learns


@immutable
class LoadGains(OptionalPart):
    """Constants of the load estimate.

    Mass and observer find the same weight at once: from a ``pace`` of 2 on they would
    swing. ``size`` is small: a load with less inertia than modelled makes its joints
    too stiff, and one with ten times as much does not. So does a load that turns in its
    grasp, which follows fast motions with m k^2 / (k^2 + l^2) of its mass m (radius of
    gyration k about its centre of mass, l away: 0.4 m of a cube held by a face), whence
    ``inertia_share``: 36 boxes on a ball stand at most 8.4, 3.8 and 9.2 mm off with
    0.6, 0.8 and 1 (``tests/control/measure_boxes.py``, another seed).
    """

    limit: Annotated[Scalar, Unit("kg", "largest mass that is estimated")]
    errors: ForceErrors = ForceErrors()
    twist: Annotated[
        Scalar, Unit("N m", "torque error at the tip that weighs as 1 N of base force")
    ] = 0.03
    pace: Annotated[
        Scalar,
        Unit(
            "",
            "rate of the mass estimate over the observer's bandwidth",
            effect=(
                "higher values find the mass sooner; from 2 on the estimate oscillates"
            ),
        ),
    ] = 1.5
    noise_share: Annotated[
        Scalar, Unit("", "relative error of the mass below which it counts as noise")
    ] = 0.05
    settled_rate: Annotated[
        Scalar,
        Unit(
            "",
            "fraction of the rate that remains for such an error, 0 to 1",
            effect=(
                "lower values hold a found mass more steadily and follow a changing one"
                " later"
            ),
        ),
    ] = 0.1
    place_pace: Annotated[
        Scalar,
        Unit(
            "",
            "rate of the estimate of the centre of mass over the observer's bandwidth",
            effect="higher values find the centre of mass sooner and follow noise more",
        ),
    ] = 0.05
    light: Annotated[
        Scalar,
        Unit(
            "", "fraction of the limit below which a mass says little about its centre"
        ),
    ] = 0.2
    furthest: Annotated[
        Scalar,
        Unit(
            "m",
            "largest distance of the load's centre of mass from the tip, along each"
            " axis of the tip",
        ),
    ] = 0.05
    size: Annotated[
        Scalar,
        Unit(
            "m",
            "assumed radius of gyration of the load about its centre of mass, any axis",
            effect=(
                "too high a value makes the joints too stiff for loads with less"
                " inertia"
            ),
        ),
    ] = 0.01
    bulk: Annotated[
        Scalar,
        Unit(
            "m",
            "lever of the tip about a joint below which the load's inertia dominates",
        ),
    ] = 0.03
    links: Annotated[
        Scalar,
        Unit(
            "",
            "fraction of the bandwidth of links about axes near the tip that remains"
            " with a load",
        ),
    ] = 0.4
    inertia_share: Annotated[
        Scalar,
        Unit(
            "",
            "fraction of the load's mass in the model; the observer compensates the"
            " rest",
            effect=(
                "lower values tolerate loads that turn in their grasp and track fast"
                " motions less exactly"
            ),
        ),
    ] = 0.8
    bias_rate: Annotated[
        Scalar,
        Unit("rad/s", "bandwidth of the filter of the observed force without a load"),
    ] = 0.5

    def start(self, joints: int) -> LoadMemory:
        """Initial state of the load estimate: no load."""
        return LoadMemory(mass=0.0, place=ZERO3_DATA, bias=no_disturbance(joints))

    def adjust_gains(
        self, memory: LoadMemory, par: CentroidalParameters, dt: Scalar
    ) -> CentroidalParameters:
        """Add the estimated load to the tip of the law's model, and reduce all
        bandwidths while it is held.
        """
        vehicle, about = par.model.vehicle, memory.mass * (self.size * self.size)
        tip = vehicle.frame()
        com = tip.position + tip.rotation.apply(memory.place)
        load = Body(
            mass=mul(self.inertia_share, memory.mass),
            com=com,
            inertia=Sym3(about, about, about),
        )
        par = replace(
            par,
            model=replace(par.model, vehicle=vehicle.with_body(tip.link, load)),
        )
        share = 1.0 - (1.0 - HOLDING) * self.load_share(memory.mass)
        return at_shares(par, share, share)

    def affect(
        self, memory: LoadMemory, step: Step, effect: Effect
    ) -> tuple[LoadMemory, Effect]:
        """Update the load estimate; leave the force of a support under the load
        uncompensated.
        """
        if not step.holds:
            return memory, effect
        par, before, dt, observed = step.par, step.memory, step.dt, step.seen.observed
        holds = step.holds[0] > 0.5
        learns: Scalar = where(all_follow(before.applied), 1.0, 0.0)
        for each in before.free:
            learns = mul(learns, each)
        pressing = effect.pressing
        if pressing is not None:
            contact: Any = par.parts.interaction
            learns = where(
                logical_or(pressing.engaged > 0.5, pressing.asked), 0.0, learns
            )
            # what is left of a contact in the observer is no bias; of a mass, learned
            # much faster, it is gone as fast
            learns = mul(
                learns,
                where(holds, 1.0, contact_cleared(contact, before.parts.interaction)),
            )
        R = observed.quaternion.rotation()
        # the mass is found from both, so no faster than the slower of them
        bandwidth = minimum(par.observer.force, par.observer.joints)
        at = hang(par.model.vehicle, R, observed.joints, par.model.gravity)
        load, resting = learn_load(
            self, memory, par.model, at, step.seen.alone, holds, learns, bandwidth, dt
        )
        unknown = effect.unknown + resting
        shares = self.unknown_shares(par.model.vehicle, observed.joints, load.mass)
        efforts = tuple(
            mul(1.0 - share, each)
            for share, each in zip(shares, unknown.efforts, strict=True)
        )
        # there the load is nearly all of the inertia, and the grasp is elastic: turn
        # these links gently
        calm = tuple(1.0 - mul(1.0 - self.links, share) for share in shares)
        unknown = replace(unknown, efforts=efforts)
        force = effect.force + resting.force
        return load, replace(effect, unknown=unknown, force=force, links=calm)

    def load_share(self, mass: Scalar) -> Scalar:
        """0 without a load, nearly 1 with a heavy one: m^2 / (m^2 + m_0^2), m_0 a part
        of the limit.
        """
        least = self.light * self.limit
        return divide(mass * mass, mass * mass + least * least)

    def unknown_shares(
        self, vehicle: Vehicle, joints: Sequence[Scalar], mass: Scalar
    ) -> list[Scalar]:
        """Fraction (0 to 1) of a held load's inertia about each joint that the model
        lacks.

        With a load of mass m and radius of gyration r at a lever l from the joint, the
        inertia is m (l^2 + r^2), of which the model has m l^2: an observer that
        compensates all of it is unstable where the rest is ten times that.
        """
        # fourth powers: near 1 for levers within bulk, near 0 beyond
        bulk = self.bulk * self.bulk * self.bulk * self.bulk
        loaded, shares = self.load_share(mass), list[Scalar]()
        for column, link in zip(
            jacobian_columns(vehicle, vehicle.frame(), joints),
            vehicle.links,
            strict=True,
        ):
            square = column.linear.dot(column.linear)
            shares.append(
                loaded * divide(bulk, square * square + bulk) if link.joint.turns else 0
            )
        return shares


@immutable
class LoadMemory:
    """State of the load estimate: mass, centre of mass, and disturbance without the
    load.
    """

    mass: Annotated[Scalar, Unit("kg", "estimated mass of the load")]
    place: Annotated[
        Vec3, Unit("m", "estimated centre of mass of the load, axes of the tip")
    ]
    bias: Disturbance


def load_gains(limit: float, vehicle: Vehicle) -> LoadGains:
    """Constants of the load estimate for a largest mass, kg.

    Raises:
        ControllerError: a vehicle without a tip that joints move.
    """
    if not vehicle.end_effector or not vehicle.n:
        raise ControllerError(
            f"controller.load = {shown(limit)}: must be 0: {vehicle.name!r} has no"
            " joints that move an end_effector"
        )
    gains, lever = LoadGains(limit=limit), _last_lever(vehicle)
    wrist = lever.dot(lever) < gains.bulk * gains.bulk
    return replace(gains, inertia_share=where(wrist, gains.inertia_share, 1.0))


def _last_lever(vehicle: Vehicle) -> Vec3:
    """Lever (m) from the last revolute joint of an arm to the tip; 1 m along z without
    a revolute joint.
    """
    free = vehicle.with_free_followers
    index = free.frame().link
    while index != BASE and not free.links[index].joint.turns:
        index = free.links[index].parent
    return (
        E_Z
        if index == BASE
        else jacobian_columns(free, free.frame(), (0.0,) * free.n)[index].linear
    )
