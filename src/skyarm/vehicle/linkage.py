"""Kinematic tree of a vehicle: bodies, joints, links, and followers (links with coupled
joints).

Plain frozen records of scalars, as all of :mod:`skyarm.vehicle.vehicle_records`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Protocol

from skyarm.algebra import ZERO3, Mat3, Motion, Scalar, Sym3, Vec3
from skyarm.algebra.scalars import add, divide, where
from skyarm.records.coerce import (
    absent,
    coefficient,
    inertia,
    number,
    proper_rotation,
    unit_vector,
    vector,
)
from skyarm.records.field_rules import checked
from skyarm.records.immutable import field_if_any, immutable
from skyarm.records.units import Unit, nonnegative, positive
from skyarm.vehicle.check import FARTHEST, RANGE, SHARE, VehicleError, accept_named

BASE = -1
"""Index of the base among the links."""


@immutable
@checked("body", VehicleError)
class Body:
    """Mass distribution of one link, in the link's frame.

    Attributes:
        mass: kg.
        com: centre of mass, m, link frame.
        inertia: kg m^2, about the centre of mass, link axes.
        planar: the inertia is that of a planar model (only the moment about the joint
            axis is given). Such a body exists in a controller's model only; a plant
            refuses it.
    """

    mass: Annotated[Scalar, nonnegative("kg", "mass of the body", rule=coefficient)]
    com: Annotated[
        Vec3,
        Unit("m", "centre of mass of the body, link axes", rule=vector, usual=FARTHEST),
    ] = ZERO3
    inertia: Annotated[
        Sym3,
        Unit("kg m^2", "inertia about the centre of mass, link axes", rule=inertia),
    ] = Sym3(0, 0, 0)
    planar: bool = False

    @classmethod
    def of_parts(cls, parts: Sequence[Body]) -> Body:
        """Merge several bodies of one link: masses add, inertias move to the common
        centre of mass (Steiner).
        """
        mass: Scalar = 0
        moment, inertia = ZERO3, Sym3(0, 0, 0)
        for part in parts:
            mass, moment = add(mass, part.mass), moment + part.com * part.mass
        com = _quotient(moment, mass)
        for part in parts:
            inertia = (
                inertia + part.inertia + Sym3.parallel_axis(part.mass, part.com - com)
            )
        return cls(
            mass=mass,
            com=com,
            inertia=inertia,
            planar=any(part.planar for part in parts),
        )

    def transform(self, R: Mat3, p: Vec3) -> Body:
        """Body expressed in another frame, in which the body's frame has the given pose
        (m).
        """
        return Body(
            mass=self.mass,
            com=p + R.apply(self.com),
            inertia=self.inertia.rotate(R),
            planar=self.planar,
        )

    def merge(self, other: Body) -> Body:
        """Merge two bodies of the same link."""
        return Body.of_parts((self, other))


def _quotient(moment: Vec3, mass: Scalar) -> Vec3:
    """Centre of mass from first moment and mass; zero for a massless body, whose first
    moment is zero.
    """
    divisor = where(mass > 0, mass, 1.0)
    return Vec3(*(0 if absent(c) else divide(c, divisor) for c in moment))


@immutable
class Joint:
    """Joint with one degree of freedom between a link and its parent.

    Attributes:
        name: unique among the joints.
        kind: "revolute" (rad) or "prismatic" (m).
        axis: unit vector, joint frame; positive motion follows the right-hand rule.
        position: origin of the joint frame in the parent link's frame, m. The child
            link's frame coincides with the joint frame at zero.
        rotation: R_PJ, joint axes to parent axes.
        lower, upper: limits, rad or m. A stop holds the joint there; without one,
            passing a limit ends an episode.
        effort_limit: largest |torque| (N m) or |force| (N) of the actuator; 0 for a
            passive joint.
        armature: inertia of the drive's own rotor, reflected to the joint by the square
            of the gear ratio, kg m^2 or kg. It resists the joint's acceleration against
            its parent only, as in MuJoCo, Pinocchio and Drake.
        damping: viscous damping, N m s/rad or N s/m.
        coulomb: smooth Coulomb friction, N m or N: coulomb * tanh(rate / coulomb_rate).
        coulomb_rate: rate at which tanh has bent, rad/s or m/s.
        stop_stiffness: stiffness of the hard stops at both limits, N m/rad or N/m; 0
            for a joint without stops.
        stop_damping: share by which a stop pushes harder per rad/s or m/s of the joint
            moving into it.
    """

    name: str
    kind: str = "revolute"
    axis: Annotated[
        Vec3, Unit("", "unit vector of the joint axis, joint axes", rule=unit_vector)
    ] = Vec3(0, 1, 0)
    position: Annotated[
        Vec3,
        Unit(
            "m",
            "origin of the joint frame, axes of the parent link",
            rule=vector,
            usual=FARTHEST,
        ),
    ] = ZERO3
    rotation: Annotated[
        Mat3,
        Unit(
            "",
            "rotation from joint axes to axes of the parent link",
            rule=proper_rotation,
        ),
    ] = Mat3.identity()
    lower: Annotated[
        Scalar,
        Unit(
            "rad or m",
            "lower position limit of the joint",
            infinite=True,
            rule=number,
            usual=RANGE,
        ),
    ] = -math.inf
    upper: Annotated[
        Scalar,
        Unit(
            "rad or m",
            "upper position limit of the joint",
            infinite=True,
            rule=number,
            usual=RANGE,
        ),
    ] = math.inf
    effort_limit: Annotated[
        Scalar,
        nonnegative(
            "N m or N",
            "largest effort of the joint's actuator; 0 for a passive joint",
            infinite=True,
            rule=number,
            usual=1e4,
        ),
    ] = math.inf
    damping: Annotated[
        Scalar, Unit("N m s/rad or N s/m", "viscous damping of the joint", **SHARE)
    ] = 0
    coulomb: Annotated[
        Scalar,
        Unit(
            "N m or N",
            "Coulomb friction of the joint, smoothed as coulomb tanh(rate /"
            " coulomb_rate)",
            **SHARE,
        ),
    ] = 0
    coulomb_rate: Annotated[
        Scalar,
        positive(
            "rad/s or m/s",
            "joint rate at which Coulomb friction reaches 76 % of its value",
            rule=number,
            effect=(
                "lower values make friction sharper and need smaller integration steps"
            ),
        ),
    ] = 0.01
    armature: Annotated[
        Scalar,
        Unit(
            "kg m^2 or kg",
            "rotor inertia of the drive, reflected to the joint",
            **SHARE,
        ),
    ] = field_if_any(default=0)
    stop_stiffness: Annotated[
        Scalar,
        Unit(
            "N m/rad or N/m",
            "stiffness of the stops at both limits; 0 for none",
            **SHARE,
            effect=(
                "higher values stop the joint in less distance and need smaller"
                " integration steps"
            ),
        ),
    ] = field_if_any(default=0)
    stop_damping: Annotated[
        Scalar,
        Unit(
            "s/rad or s/m",
            "the stop's force is multiplied by 1 + `stop_damping` * speed into the"
            " stop",
            **SHARE,
            effect="higher values let the joint bounce less off its stops",
        ),
    ] = field_if_any(default=0)

    def __post_init__(self) -> None:
        accept_named(self, "joint")

    @property
    def has_stops(self) -> bool:
        """True if a joint has end stops at its limits; also decidable for traced
        (symbolic) parameters.
        """
        return not absent(self.stop_stiffness)

    @property
    def ends(self) -> tuple[float, float]:
        """Lowest and highest position, rad or m."""
        return float(self.lower), float(self.upper)

    @property
    def turns(self) -> bool:
        """True for a revolute joint, false for a prismatic one."""
        return self.kind == "revolute"

    @property
    def units(self) -> tuple[str, str]:
        """Units of the joint's value and effort."""
        return ("rad", "N m") if self.turns else ("m", "N")

    @property
    def motion_subspace(self) -> Motion:
        """Spatial velocity of the child against its parent per unit joint rate, child
        axes, at the child's origin.
        """
        return Motion(self.axis, ZERO3) if self.turns else Motion(ZERO3, self.axis)


JOINT_NUMBERS = (
    "damping",
    "coulomb",
    "coulomb_rate",
    "effort_limit",
    "armature",
    "stop_stiffness",
    "stop_damping",
)
"""Parameters of a joint that a scenario may state in place of the vehicle's."""


@immutable
class Link:
    """Link: a body moved by one joint relative to its parent (index into
    ``Vehicle.links``; BASE for the base).
    """

    name: str
    parent: int
    joint: Joint
    body: Body

    def __post_init__(self) -> None:
        accept_named(self, "link")


@immutable
class Follower:
    """Link whose joint is coupled to a leader joint: q = ratio q_leader + offset,
    exactly and at any load.

    URDF calls such a joint a mimic: the second finger of a hand, the bars of a
    parallelogram. It has no coordinate, no drive, no friction and no limits of its own;
    its inertia acts at its leader.

    Attributes:
        link: body and joint; its parent is the base, a link, or (from ``Vehicle.n`` on)
            an earlier follower.
        leader: index of the link whose joint it follows.
        ratio: rad or m per rad or m of the leader.
        offset: rad or m, where the leader is at zero.
    """

    link: Link
    leader: int
    ratio: Annotated[
        Scalar,
        Unit(
            "rad or m per rad or m",
            "displacement per displacement of the leading joint",
            rule=number,
        ),
    ] = 1.0
    offset: Annotated[
        Scalar,
        Unit(
            "rad or m",
            "position at which the leading joint is at zero",
            rule=coefficient,
        ),
    ] = 0

    def __post_init__(self) -> None:
        accept_named(self, "follower")

    @property
    def name(self) -> str:
        """Name of the follower's link."""
        return self.link.name


class Linkage(Protocol):
    """Interface of a vehicle's bodies and joints: the part of a :class:`skyarm.Vehicle`
    that its mass matrix needs.
    """

    @property
    def base(self) -> Body:
        """Body of the airframe."""

    @property
    def links(self) -> tuple[Link, ...]:
        """Links with independent joints, each after its parent."""

    @property
    def followers(self) -> tuple[Follower, ...]:
        """Links whose joints are coupled to leader joints."""

    @property
    def n(self) -> int:
        """Number of independent joints."""

    @property
    def bodies(self) -> tuple[Body, ...]:
        """All bodies: base, links, followers."""

    @property
    def moving(self) -> tuple[Link, ...]:
        """All links that joints move: the independent links, then the followers."""
