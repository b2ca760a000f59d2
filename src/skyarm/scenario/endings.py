"""Termination conditions of an episode, each with its message."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, ClassVar

from skyarm.algebra import Scalar, Scalars, Vec3
from skyarm.algebra.scalars import absolute, add, logical_and, maximum, minimum, sub
from skyarm.dynamics import State, link_poses
from skyarm.dynamics.actuators.tilting import turn_rotors
from skyarm.dynamics.point_motion import PointMotion
from skyarm.records.immutable import immutable
from skyarm.records.leaves import leaves
from skyarm.records.units import Unit, nonnegative
from skyarm.vehicle import BASE, Link, Vehicle

if TYPE_CHECKING:
    from skyarm.scenario.scenario_record import Scenario
    from skyarm.world.contact import Contact
    from skyarm.world.scene.clearance import Clearances

FAR = 1e4
"""Size of a speed (m/s), rate (rad/s) or joint position (rad or m) that counts as
divergence; rotors are among the rates, of which the fastest shipped one turns at 2270
rad/s."""

LOST = 1e3
"""Distance (m) from the reference that counts as divergence; chosen, before numbers
overflow: a free fall is there after 14 s."""

LONG = 2.0
"""Size of a quaternion component that counts as divergence: one of unit length has at
most 1."""


Distance = tuple[Scalar, *tuple[str, ...]]
"""Distance (m), and names for the message."""


class Ending:
    """Base class of termination conditions of an episode, whose subclasses are frozen
    dataclasses of numbers.
    """

    __slots__ = ()

    registered_as = "ending"

    status: ClassVar[str]
    """Word for the log's status after this ending."""

    sees: tuple[str, ...] = ()
    """Names of the sensors whose pictures ``fine`` receives as ``images``."""

    def fine(
        self, scenario: Scenario, state: State, goal: Vec3, slack: Scalar
    ) -> Scalar:
        """True while a state does not meet the termination condition; false if the
        state contains NaN.

        Args:
            scenario: scenario of the episode.
            state: plant state.
            goal: position of the held reference, m.
            slack: how far inside its limit a state must be; 0 in flight.

        An ending that sees pictures has a further argument ``images=()``, a tuple of
        :class:`skyarm.sensing.measurement.Image` in the order of :attr:`sees`.
        """
        raise NotImplementedError(f"{type(self).__name__} must define fine()")

    def cause(self, scenario: Scenario, state: State, goal: Vec3) -> str:
        """Message with the reason why a state ends the episode."""
        return self.status


@immutable
class Divergence(Ending):
    """Termination when a number of the state is not finite or is implausibly large."""

    status: ClassVar[str] = "diverged"

    def fine(
        self, scenario: Scenario, state: State, goal: Vec3, slack: Scalar
    ) -> Scalar:
        """True if every number of the state is finite and within the divergence
        bounds.
        """
        # any comparison with NaN is false, so that a state that is not finite is not
        # fine; a quaternion's length is 1, and twice that is no rounding but an
        # integrator that diverges
        fine: Scalar = absolute(state.quaternion.w) < LONG
        for value in list(state.quaternion)[1:]:
            fine = logical_and(fine, absolute(value) < LONG)
        for value in (
            *state.velocity,
            *state.rate,
            *state.joints,
            *state.joint_rates,
            *state.rotor_speeds,
        ):
            fine = logical_and(fine, absolute(value) < FAR)
        for value, target in zip(state.position, goal, strict=True):
            fine = logical_and(fine, absolute(value - target) < LOST)
        return fine

    def cause(self, scenario: Scenario, state: State, goal: Vec3) -> str:
        """Message naming the first number that is not finite, else the first that is
        too large.
        """
        names, x = state_words(scenario.agent.vehicle), leaves(state)
        for name, value in zip(names, x, strict=True):
            if not math.isfinite(value):
                return f"{name} is not finite"
        # a position has no limit of its own, only one about the reference
        limits = [math.inf] * 3 + [LONG] * 4 + [FAR] * (len(x) - 7)
        for name, value, limit in zip(names, x, limits, strict=True):
            if not -limit < value < limit:
                return f"{name} passed {limit:g}"
        # the goal is of the position alone, the first three numbers
        away = (
            name
            for name, value, target in zip(names, x, goal, strict=False)
            if not -LOST < value - target < LOST
        )
        return f"{next(away)} is over {LOST:g} m from the reference"


@immutable
class JointLimits(Ending):
    """Termination when a joint exceeds a limit.

    Attributes:
        stops: also of joints that hard stops hold at their limits: a touch then ends
            the episode.
    """

    stops: bool = True

    status: ClassVar[str] = "joint_limit"

    def fine(
        self, scenario: Scenario, state: State, goal: Vec3, slack: Scalar
    ) -> Scalar:
        """True if every joint is within its limits."""
        fine: Scalar = True
        for value, link in self._checked_joints(scenario, state):
            inside = logical_and(
                add(link.joint.lower, slack) <= value,
                value <= sub(link.joint.upper, slack),
            )
            fine = logical_and(fine, inside)
        return fine

    def _checked_joints(
        self, scenario: Scenario, state: State
    ) -> list[tuple[Scalar, Link]]:
        """Value and link of each joint whose limits are checked; joints with end stops
        may be exempt.
        """
        every = zip(state.joints, scenario.agent.vehicle.links, strict=True)
        return [
            (value, link)
            for value, link in every
            if self.stops or not link.joint.has_stops
        ]

    def cause(self, scenario: Scenario, state: State, goal: Vec3) -> str:
        """Message naming the first joint beyond its limit."""
        for value, link in self._checked_joints(scenario, state):
            joint = link.joint
            if not joint.lower <= value <= joint.upper:
                limit = float(joint.upper if value > joint.upper else joint.lower)
                return (
                    f"joint '{joint.name}' at"
                    f" {' passed '.join(apart(float(value), limit))}"
                )
        return self.status


@immutable
class LawUndefined(Ending):
    """Termination at an attitude where the control law is singular."""

    status: ClassVar[str] = "controller_undefined"

    def fine(
        self, scenario: Scenario, state: State, goal: Vec3, slack: Scalar
    ) -> Scalar:
        """True if the attitude is within the law's domain of definition; always true
        for a law without a limit.
        """
        margin = scenario.agent.controller.margin
        return True if margin is None else margin(state.quaternion) >= slack

    def cause(self, scenario: Scenario, state: State, goal: Vec3) -> str:
        """Message of the control law about the attitude at which its equations are
        singular.
        """
        return scenario.agent.controller.limit


class DistanceEnding(Ending):
    """Base class of the terminations where a distance becomes too small."""

    __slots__ = ()

    words: ClassVar[str]
    """Message, with places for the smallest distance and its names."""

    margin: Scalar = 0

    def distances(self, scenario: Scenario, state: State) -> list[Distance]:
        """Distances (m), each with names for the message, that end the episode where
        one is below the margin.
        """
        raise NotImplementedError(f"{type(self).__name__} must define distances()")

    def fine(
        self, scenario: Scenario, state: State, goal: Vec3, slack: Scalar
    ) -> Scalar:
        """True if every distance is at least the margin."""
        fine: Scalar = True
        for distance, *_ in self.distances(scenario, state):
            fine = logical_and(fine, distance >= add(self.margin, slack))
        return fine

    def cause(self, scenario: Scenario, state: State, goal: Vec3) -> str:
        """Message with the smallest distance and its names."""
        least, *names = min(
            self.distances(scenario, state), key=lambda each: float(each[0])
        )
        return self.words.format(float(least), *names)


@immutable
class Ground(DistanceEnding):
    """Termination when the lowest point of the vehicle reaches the ground at z = 0."""

    status: ClassVar[str] = "ground"
    words: ClassVar[str] = "lowest point at z = {:.4g} m"

    def distances(self, scenario: Scenario, state: State) -> list[Distance]:
        """Height of the vehicle's lowest point above the ground, if there is one."""
        return (
            [(lowest_point(scenario.agent.vehicle, state),)] if scenario.ground else []
        )


@immutable
class RotorContact(DistanceEnding):
    """Termination when the disc of a rotor without shield touches a fixed surface."""

    status: ClassVar[str] = "rotor_contact"
    words: ClassVar[str] = "rotor '{1}' touched surface '{2}'"

    def distances(self, scenario: Scenario, state: State) -> list[Distance]:
        """Clearance of each rotor disc from each fixed surface, with the names of
        both.
        """
        R = state.rotation
        clearances: list[Distance] = []
        for contact in scenario.worlds:
            for rotor in turn_rotors(scenario.agent.vehicle, state.tilts).rotors:
                if rotor.shield:
                    continue
                at, axis = state.position + R.apply(rotor.position), R.apply(rotor.axis)
                for surface in contact.still:
                    gap = surface.clearance(at, axis, contact.rotor_radius, 0.0)
                    clearances.append((gap, rotor.name, surface.name))
        return clearances


@immutable
class BodyContact(DistanceEnding):
    """Termination when the base's origin or a joint is inside a fixed surface."""

    status: ClassVar[str] = "body_contact"
    words: ClassVar[str] = "{1} is inside surface '{2}'"

    def distances(self, scenario: Scenario, state: State) -> list[Distance]:
        """Distance of the base's origin and of each joint from each fixed surface, with
        the names of both.
        """
        vehicle = scenario.agent.vehicle
        distances: list[Distance] = []
        for contact in scenario.worlds:
            R, poses = state.rotation, link_poses(vehicle, state.joints)
            points = [("the base", state.position)]
            joints = zip(vehicle.links, poses, strict=False)
            points += [
                (f"joint '{link.joint.name}'", state.position + R.apply(pose.p))
                for link, pose in joints
            ]
            for name, at in points:
                distances += [
                    (-surface.depth(at, 0, 0.0)[0], name, surface.name)
                    for surface in contact.still
                ]
        return distances


@immutable
class Clearance(DistanceEnding):
    """Termination when a body of the vehicle comes too near to a fixed surface or to
    another body of the vehicle.

    Rods of links that bear contact points, grippers or grasps may touch surfaces.
    """

    margin: Annotated[
        Scalar,
        nonnegative("m", "smallest distance of a body that does not end the flight"),
    ] = 0.0

    status: ClassVar[str] = "clearance"
    words: ClassVar[str] = "{1} are {0:.4g} m apart"

    def distances(self, scenario: Scenario, state: State) -> list[Distance]:
        """Distance and names of each pair of bodies."""
        pairs = clearances_of(scenario, moving=False)
        distances = pairs.distances(
            state.position, state.rotation, state.joints, state.tilts
        )
        return list(zip(distances, pairs.names, strict=True))


@immutable
class BodyCollision(DistanceEnding):
    """Termination when shapes of the vehicle press on a surface at rest or, with
    ``world.self_collision``, on each other.

    It looks at control instants, and at normal forces alone, which follow from the
    vehicle's state. Objects, mechanisms, surfaces that move and other vehicles end no
    flight: where these are is not a part of that state.
    """

    pair: Annotated[
        str,
        Unit("", "pair as in the log, such as base/wall, or one of both; empty: any"),
    ] = ""
    force: Annotated[
        Scalar,
        nonnegative("N", "largest normal force of two bodies that ends no flight"),
    ] = 0.0

    status: ClassVar[str] = "collision"
    words: ClassVar[str] = "{1} press with more than {2} N"

    def ends(self, name: str) -> bool:
        """True if the ending is about a pair, by its name in the log."""
        # a surface's name may have slashes itself
        return not self.pair or f"/{self.pair}/" in f"/{name}/"

    def contacts(self, scenario: Scenario) -> list[Contact]:
        """Contact model of the only vehicle, with surfaces at rest alone."""
        (name,) = scenario.agents
        return [
            replace(each.of_agent(name), surfaces=each.still, objects=(), mechanisms=())
            for each in scenario.worlds
        ]

    def distances(self, scenario: Scenario, state: State) -> list[Distance]:
        """Force (N) that each pair lacks, or distance (m) if that is more, with the
        pair's name and the force.
        """
        motion = PointMotion(scenario.agent.vehicle, state)
        found: list[Distance] = []
        for contact in self.contacts(scenario):
            names = [pair.name for pair in contact.body_pairs]
            # any positive number: a pair that does not meet is inside the limit
            far: Scalars = (1.0,) * len(names)
            gaps = contact.with_touches(
                contact.start(0.0, ()),
                motion,
                lambda every: tuple(
                    maximum(self.force - each.normal, -each.depth) for each in every
                ),
                far,
            )
            found += [
                (gap, name, str(self.force))
                for gap, name in zip(gaps, names, strict=True)
                if self.ends(name)
            ]
        return found


BUILT_IN: tuple[Ending, ...] = (
    Divergence(),
    JointLimits(stops=False),
    LawUndefined(),
    Ground(),
    RotorContact(),
    BodyContact(),
)
"""Endings of every episode, in order; the first that holds is the cause."""

PHASE_FAILED = "phase_failed"
"""Status of a flight whose task has a phase that failed."""

STATUSES = (
    "completed",
    *(ending.status for ending in BUILT_IN),
    PHASE_FAILED,
    Clearance.status,
    BodyCollision.status,
)


def clearances_of(
    scenario: Scenario, *, moving: bool = True, touching: bool = True
) -> Clearances:
    """Pairs of the bodies of the only vehicle with surfaces, ``moving`` ones too, and
    with each other.

    Bodies with contact points may touch surfaces, unless ``touching`` is False.
    """
    # most flights have no such ending, so its module is loaded by those that do
    from skyarm.world.scene.clearance import clearances

    vehicle, (name,) = scenario.agent.vehicle, scenario.agents
    contacts = [each.of_agent(name) for each in scenario.worlds]
    surfaces = [
        s for each in contacts for s in (each.surfaces if moving else each.still)
    ]
    exempt: set[int] = set()
    for each in contacts if touching else ():
        exempt |= {*each.touching(vehicle)}
    return clearances(vehicle, surfaces, exempt)


def lowest_point(vehicle: Vehicle, state: State) -> Scalar:
    """World height of the vehicle's lowest point: base origin, rotor hubs, joints and
    named frames.
    """
    R = state.rotation
    poses = link_poses(vehicle, state.joints, summed=True)
    points = [rotor.position for rotor in vehicle.rotors]
    points += [pose.p for pose in poses]
    points += [
        f.position if f.link == BASE else poses[f.link].apply(f.position)
        for f in vehicle.frames
    ]
    # 0 is the base's origin, below which a point must lie to count
    lowest: Scalar = 0.0
    for point in points:
        lowest = minimum(lowest, R.r2.dot(point))
    return state.position.z + lowest


def state_words(vehicle: Vehicle) -> list[str]:
    """Names of all numbers of a plant state, in order, for messages: position.x, joint
    'elbow', and so on.
    """
    axes = [
        ("position", "xyz"),
        ("quaternion", "wxyz"),
        ("velocity", "xyz"),
        ("rate", "xyz"),
    ]
    named = [f"{word}.{axis}" for word, letters in axes for axis in letters]
    joints = vehicle.joint_names
    named += [f"joint '{name}'" for name in joints] + [
        f"rate of joint '{name}'" for name in joints
    ]
    named += [f"speed of rotor '{rotor.name}'" for rotor in vehicle.rotors]
    return named + [
        f"angle of rotor '{rotor.name}'"
        for rotor in vehicle.rotors
        if rotor.tilt is not None
    ]


def command_words(vehicle: Vehicle) -> list[str]:
    """Names of all numbers of a command, in order, for messages: rotor speeds, joint
    efforts, rotor angles.
    """
    named = [f"commanded speed of rotor '{rotor.name}'" for rotor in vehicle.rotors]
    named += [f"commanded effort of joint '{joint.name}'" for joint in vehicle.joints]
    return named + [
        f"commanded angle of rotor '{rotor.name}'"
        for rotor in vehicle.rotors
        if rotor.tilt is not None
    ]


def not_finite(vehicle: Vehicle, command: Sequence[float]) -> str | None:
    """Message naming the first number of a command that is not finite; None if all are
    finite.
    """
    pairs = zip(command_words(vehicle), command, strict=True)
    return next(
        (f"{name} is not finite" for name, value in pairs if not math.isfinite(value)),
        None,
    )


def apart(value: float, limit: float) -> tuple[str, str]:
    """Format two different numbers with just enough digits (at least four) that their
    texts differ.
    """
    # 17 digits tell any two floats apart
    for digits in range(4, 18):
        texts = f"{value:.{digits}g}", f"{limit:.{digits}g}"
        if texts[0] != texts[1]:
            return texts
    return repr(value), repr(limit)
