"""Static equilibrium before a flight: penetration and tilt of vehicle and objects under
their weight.

A flight that begins so does not jump. A vehicle is set down from 5 cm above its
position: level until the surfaces carry its weight, then tilted until they carry its
moment, too. Each object that is said to be standing is set down in turn, the lowest
first, as if those that are higher were not there yet: from its position, or from just
above it where that is inside of something.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from skyarm.algebra import ZERO3, Quaternion, Vec3
from skyarm.dynamics.energy import center_of_mass
from skyarm.dynamics.point_motion import PointMotion
from skyarm.dynamics.state import State
from skyarm.records.arrays import Array
from skyarm.records.content import keep_results
from skyarm.records.files import shown
from skyarm.records.leaves import Tree
from skyarm.vehicle import Vehicle
from skyarm.world.contact.carrier import NOBODY
from skyarm.world.contact.contact import Contact
from skyarm.world.contact.free_object import FreeObject, ObjectMotion
from skyarm.world.contact.meetings import Meeting, meetings_of

Residual = Callable[[Array], Array]

Push = tuple[Meeting, Vec3, Vec3]
"""Contact of a body, its arm from the centre of mass (m) and its normal force (N) on
the body."""

STEP, LOWEST, ABOVE = 0.002, 3.0, 0.05
"""Distances (m): step in which a vehicle is lowered until it stands, largest way of a
descent, and initial height above the reference, which lies a little below the standing
position if it presses."""

LIFT, FINEST = 0.002, 1e-4
"""Depth (m) inside another body out of which an object is lifted, and smallest step of
its descent."""

DEEPER = 0.1
"""Fraction of its depth by which an object is pressed deeper per step, once that
exceeds ``FINEST``."""

OTHER = 0.2
"""Distance (m or rad) from the first contact beyond which the object has tipped over
into another equilibrium."""

ROUNDING = 1e-9
"""Fraction of the weight by which a level surface seems to tilt: the equilibrium is
found to so much."""

UP, UPRIGHT = np.array([1.0, 0.0, 0.0]), Vec3(0.0, 0.0, 1.0)
"""Displacement upwards, of a height and two tilts, and vertical axis."""

NEAR, PACE = 1e-4, 1e-3
"""Steps (m and rad) per depth (m) under the weight: of the finite difference for the
stiffness, and the first one of the damped Newton's method."""

SMALL, ROUNDED, ROUNDS = 1e-8, 1e-14, 100
"""Residual of an equilibrium, as a fraction of the weight, length (m) whose share of
the depth rounding adds to it, and largest number of Newton steps."""

DAMPED = np.diag([1e-6, 1.0, 1.0])
"""Shares of the damping in height and tilts: the height follows at once, or a foot that
bears too much lifts others."""

ROLLS = 1e-3
"""Least range of slopes (rad) on which a body can stand: less is an edge, or a line on
which it rolls."""

LEAN = 0.1
"""Additional tilt (rad) down a slope per depth (m) under the weight: the rim of a
cylinder then touches where it will."""

UNSTABLE = 1e-3
"""Growth of the residual (1 per m or rad) from which an equilibrium is unstable: above
that of rounding."""


def _settle(
    residual: Residual, pushes: Callable[[Array], list[Push]], x: Array
) -> Array | None:
    """Stable root of a residual near an initial guess, at which contacts push; None if
    there is none.

    Newton's method, damped as implicit Euler steps of dx/dt = residual: longer after
    one that hardly raises the residual, else shorter, as where a foot would lift off.
    Of what nothing holds, as a ball that may roll, nothing changes. Source: Kelley,
    Keyes 1998, Convergence analysis of pseudo-transient continuation.
    """
    start = x
    left = residual(x)
    depth = _depth(pushes(x))
    near, pace = NEAR * depth, PACE * depth
    # numbers beyond measure overflow: they end as no equilibrium
    with np.errstate(all="ignore"):
        for _ in range(ROUNDS):
            slopes = np.stack(
                [(residual(x + step) - left) / near for step in near * np.eye(len(x))],
                axis=1,
            )
            size = np.abs(left).max()
            # NaN gives no direction, and far away is another equilibrium
            if not np.isfinite(slopes).all() or np.abs(x - start).max() > OTHER:
                break
            there = x + np.linalg.solve(DAMPED / pace - slopes, left)
            after = residual(there)
            share = np.abs(after).max() / size
            # on an edge it may be balanced, and falls
            if not share < 1.0 and size < SMALL + ROUNDED / depth:
                return x if np.linalg.eigvals(slopes).real.max() < UNSTABLE else None
            # the factors are chosen: half and twice of each change the 5 rounds of
            # two_carry_a_bar by one at most (measured)
            pace *= 10.0 if share < 1.0 else 2.0 if share < 1.5 else 0.1
            x, left = (there, after) if share < 1.5 else (x, left)
    return None


def _turn(about_x: float, about_y: float) -> Quaternion:
    return Quaternion.of_rotation_vector(Vec3(about_x, about_y, 0.0))


def stand_vehicle(
    vehicle: Vehicle, gravity: float, contact: Contact, state: State
) -> State:
    """Vehicle state in static equilibrium on the surfaces below its given position.

    Args:
        vehicle: the true one.
        gravity: m/s^2.
        contact: surfaces, points and shapes of this vehicle.
        state: state at rest, level but for its yaw, above the place.

    Raises:
        ValueError: one line: nothing carries it there, or it tips over.
    """
    # neither period nor draws enter the first state of a contact
    memory = contact.start(1.0, ())
    weight = float(vehicle.mass) * gravity

    def at(x: Array) -> State:
        """State raised by a height (m) and rotated about the level x and y axes
        (rad).
        """
        up, about_x, about_y = (float(each) for each in x)
        position = state.position + Vec3(0.0, 0.0, up)
        return replace(
            state,
            position=position,
            quaternion=_turn(about_x, about_y) * state.quaternion,
        )

    def pushes(x: Array) -> list[Push]:
        """Contacts of the vehicle, each with its arm and its force."""
        moved = at(x)
        motion, middle = PointMotion(vehicle, moved), center_of_mass(vehicle, moved)
        ours = [each for each in contact.meetings(memory, motion) if each.by == NOBODY]
        ours += contact.places_at_rest(memory, motion)
        return [
            (each, each.place - middle, each.touch.axis * each.touch.normal)
            for each in ours
        ]

    def residual(x: Array) -> Array:
        """Residual of vertical force and level moments about the centre of mass (1 m
        arm), divided by the weight.
        """
        return balance(pushes(x), weight)

    # written so that NaN is refused, too
    if not weight > 0.0:
        raise ValueError(
            "initial.standing = true: must be false where plant.gravity leaves no"
            " weight to stand with"
        )
    # -1 is the whole weight missing: nothing touches yet
    if residual(np.array([ABOVE, 0.0, 0.0]))[0] > -1.0:
        raise ValueError(
            "initial.standing = true: must begin above what it is set down on; it"
            " touches at 5 cm above"
        )

    def set_down(x: Array) -> Array:
        """Lower the vehicle from a pose until the surfaces carry its weight."""
        above = x
        while residual(x)[0] < 0.0:
            above = x
            x = x - STEP * UP
            if x[0] < -LOWEST:
                raise ValueError(
                    "initial.standing = true: must be above a surface;"
                    f" {_nothing('it', state.position)}"
                )
        return _raise(residual, x, above)

    x = set_down(np.array([ABOVE, 0.0, 0.0]))
    equilibrium = _settle(residual, pushes, x)
    if equilibrium is None:
        # on a slope a level vehicle stands on its upper feet alone
        x = set_down(np.array([ABOVE, *_slope(pushes(x), [UPRIGHT])]))
        equilibrium = _settle(residual, pushes, x)
    if equilibrium is None:
        words = "must stand on three places around its centre of mass, of world.points"
        words += f" or the vehicle's collisions; it tips over{_tipping(pushes(x))}"
        raise ValueError(f"initial.standing = true: {words}")
    _require_friction("initial.standing = true", pushes(equilibrium), contact, weight)
    return at(equilibrium)


def _raise(residual: Residual, x: Array, above: Array) -> Array:
    """Pose by which the surfaces carry one to two weights, between one of more and one
    of less above it.
    """
    while residual(x)[0] > 1.0 and above[0] - x[0] > ROUNDED:
        middle = 0.5 * (x + above)
        x, above = (x, middle) if residual(middle)[0] < 0.0 else (middle, above)
    return x


def _depth(pushes: Sequence[Push]) -> float:
    """Largest penetration (m) of a body, negative above what it may touch."""
    return max((float(each.touch.depth) for each, *_ in pushes), default=-LOWEST)


def _normal(pushes: Sequence[Push]) -> Array:
    """Direction of the sum of some forces, level axes."""
    force = np.array([*map(float, sum((push for *_, push in pushes), ZERO3))])
    return np.asarray(force / np.linalg.norm(force))


def _slope(pushes: Sequence[Push], axes: Sequence[Vec3]) -> Array:
    """Tilts about the level x and y axes (rad) by which a body lies on a slope, from
    the forces on it.

    They turn that one of its axes to the slope's normal which is nearest to this or to
    the vertical.
    """
    normal = _normal(pushes)
    rows = [np.array([*map(float, axis)]) for axis in axes]
    near, axis = max(
        ((max(abs(row[2]), abs(row @ normal)), row) for row in rows),
        key=lambda pair: pair[0],
    )
    axis = axis * math.copysign(1.0, axis @ normal)
    across = np.cross(axis, normal)
    size = np.linalg.norm(across)
    # one that leans otherwise is not laid flat
    turn = across * (
        math.atan2(size, axis @ normal) / size
        if size > 0.0 and near > math.cos(OTHER)
        else 0.0
    )
    return np.asarray(
        turn[:2] + LEAN * _depth(pushes) * np.array([-normal[1], normal[0]])
    )


def _tipping(pushes: Sequence[Push]) -> str:
    """Words about the slope at which a body that lies on some contacts tips over; none
    where it lies level.

    Down the slope the weight leaves the convex hull of the contacts, on a line between
    two of them.
    """
    normal = _normal(pushes)
    down = normal * normal[2] - np.array([0.0, 0.0, 1.0])
    if not np.linalg.norm(down) > ROUNDING:
        return ""
    arms = np.array(
        [
            [*map(float, arm)]
            for meeting, arm, _ in pushes
            if float(meeting.touch.depth) > 0.0
        ]
    )
    along = arms @ (down / np.linalg.norm(down))
    aside = arms @ np.cross(normal, down)
    spots = [*zip(along, aside, strict=True)]
    right = [(a, b) for a, b in spots if b <= 0.0]
    left = [(c, d) for c, d in spots if d > 0.0]
    ways = [(a * d - c * b) / (d - b) for a, b in right for c, d in left]
    height = -np.mean(arms @ normal)
    slope = math.acos(normal[2])
    least, most = (math.atan2(end(ways, default=0.0), height) for end in (min, max))
    has = f"the slope has {math.degrees(slope):.4g}"
    # on an edge or a line, or up the slope
    if most - least < ROLLS or least > slope:
        return f" as it lies; {has} degrees (level ground, or another attitude)"
    cure = "less slope, or more stiffness" if most > slope else "less slope"
    return (
        f": a rigid one beyond {math.degrees(most):.4g} degrees, a soft one earlier;"
        f" {has} ({cure})"
    )


def _require_friction(
    where: str, pushes: Sequence[Push], contact: Contact, weight: float
) -> None:
    """Refuse a vehicle or object that would slide: its weight across the surfaces is
    beyond their friction.

    Raises:
        ValueError: one line with the force and the largest friction.
    """
    frictions = {each.name: each.material.friction for _, each in contact.every_surface}
    most = sum(
        float(frictions[each.surface] * each.touch.normal) for each, *_ in pushes
    )
    needed = weight * math.hypot(*_normal(pushes)[:2])
    if needed > most + ROUNDING * weight:
        words = (
            f"by {needed:.3g} N; it is {most:.3g} N at most, {needed - most:.2g} N too"
            " little, and it slides"
        )
        raise ValueError(f"{where}: must stand where friction holds it, {words}")


def balance(pushes: Sequence[Push], weight: float, length: float = 1.0) -> Array:
    """Residual normal force and level moments on a resting body, relative to its
    weight.

    Friction balances the weight across the normal.

    Args:
        pushes: contacts of the body.
        weight: N.
        length: lever that makes a force of a moment, m.
    """
    force, moment, middle, sizes = ZERO3, ZERO3, ZERO3, 0.0
    for _, arm, push in pushes:
        size = float(push.dot(push)) ** 0.5
        force = force + push
        moment = moment + arm.cross(push)
        middle = middle + arm * size
        sizes = sizes + size
    # below 0: out of the lower side of a plate
    total = math.copysign(float(force.dot(force)) ** 0.5, float(force.z))
    if total == 0.0:
        return np.array([-1.0, 0.0, 0.0])
    across = Vec3(0.0, 0.0, weight) - force
    moment = moment + (middle * (1.0 / sizes)).cross(across)
    left = total - weight * float(force.z) / total
    return np.array([left, float(moment.x) / length, float(moment.y) / length]) / weight


def _nothing(what: str, position: Vec3) -> str:
    return (
        f"nothing carries {what} within {LOWEST:g} m below"
        f" {shown([float(c) for c in position])} m"
    )


# 16 is chosen: a file, its check and its flights ask for one world, or a few in turn
@keep_results(16)
def with_standing_objects(contact: Contact, gravity: float) -> Contact:
    """Contact model whose objects marked as standing are placed in static equilibrium.

    Args:
        contact: contact model as read.
        gravity: m/s^2.

    Raises:
        ValueError: one line: nothing carries the object there, it starts inside of
            something, or it tips over.
    """
    waiting = sorted(
        (i for i, each in enumerate(contact.objects) if each.standing),
        # the lowest first: what carries others must stand before them
        key=lambda i: float(contact.objects[i].position.z),
    )
    if waiting and not gravity > 0.0:
        where = f"world.objects[{min(waiting)}].standing = true"
        raise ValueError(
            f"{where}: must be false where plant.gravity leaves no weight to stand with"
        )
    while waiting:
        i = waiting.pop(0)
        contact = _set_down(contact, i, gravity, waiting)
    return contact


def _set_down(
    contact: Contact, index: int, gravity: float, away: Sequence[int]
) -> Contact:
    """Contact model with one object moved to static equilibrium on the surfaces below
    that object.
    """
    body = contact.objects[index]
    supports = _Supports(contact, index, gravity, away)
    x = np.zeros(3)
    where = f"world.objects[{index}].standing = true"
    # what stands already, as in a file that was saved, does not move by rounding
    if (
        np.abs(supports.residual(x)).max() < 1e-9
        and _settle(supports.residual, supports.pushes, x) is not None
    ):
        _require_friction(
            f"{where}: object {body.name!r}",
            supports.pushes(x),
            contact,
            supports.weight,
        )
        return contact
    if supports.gap(x) < 0.0:
        x[0] = LIFT
    if supports.gap(x) < 0.0:
        raise ValueError(
            f"{where}: object {body.name!r} must begin outside of what carries it"
        )
    x = _descend(body, supports, x, index)
    equilibrium = _settle(supports.residual, supports.pushes, x)
    if equilibrium is None:
        # on a slope a level body stands on its upper edge alone
        rotation = body.frame(body.start()).rotation
        x = np.array(
            [x[0], *_slope(supports.pushes(x), [rotation.column(i) for i in range(3)])]
        )
        while supports.gap(x) < 0.0:
            # tilted by the slope a corner may dip below where it stood
            x = x + max(LIFT, -supports.gap(x)) * UP
        x = _descend(body, supports, x, index)
        equilibrium = _settle(supports.residual, supports.pushes, x)
    if equilibrium is None:
        tips = f"it tips over{_tipping(supports.pushes(x))}"
        raise ValueError(
            f"{where}: object {body.name!r} must lie with its centre of mass above what"
            f" carries it; {tips}"
        )
    _require_friction(
        f"{where}: object {body.name!r}",
        supports.pushes(equilibrium),
        contact,
        supports.weight,
    )
    return supports.contact_at(equilibrium)


def _descend(body: FreeObject, supports: _Supports, x: Array, index: int) -> Array:
    """Height and tilts of an object that is lowered until it is carried."""
    carried, above = 0.0, x
    while supports.residual(x)[0] < 0.0:
        gap = supports.gap(x)
        force = supports.force(x) if gap < 0.0 else 0.0
        if force < carried or (force > 0.0 and -gap > _half_of(body)):
            # what is below carries so much at most, until the object is half inside or
            # through
            most = max(force, carried) / supports.gravity
            raise ValueError(
                f"world.objects[{index}].mass = {shown(float(body.mass))}: must be"
                f" about {most:.2g} kg or less, or the stiffness larger; its weight"
                f" presses object {body.name!r} through what it stands on"
            )
        carried = force
        above = x
        x = x - max(gap, FINEST, DEEPER * -gap) * UP
        if x[0] < -LOWEST:
            below = _nothing(f"object {body.name!r}", body.position)
            raise ValueError(
                f"world.objects[{index}].standing = true: must be above a surface;"
                f" {below}"
            )
    return _raise(supports.residual, x, above)


def _half_of(body: FreeObject) -> float:
    """Half of an object's smallest dimension, m."""
    radii = {("sphere", 0), ("cylinder", 0)}
    return min(
        float(each) * (1.0 if (body.shape, i) in radii else 0.5)
        for i, each in enumerate(body.size)
    )


class _Supports:
    """Force and moment balance of one object that rests on surfaces, as a function of
    height and two tilts.

    Args:
        contact: surfaces and objects.
        index: number of the object.
        gravity: m/s^2.
        away: objects that are not there yet.
    """

    def __init__(
        self, contact: Contact, index: int, gravity: float, away: Collection[int]
    ) -> None:
        self._contact = contact
        self._index = index
        self._away = frozenset(away)
        self._all = _meetings_of(contact)
        self._first = list(contact.start(1.0, ()).carried)
        self.weight = float(contact.objects[index].mass) * gravity
        self.gravity = gravity
        self._pose = b""
        self._pushes = list[Push]()

    def _displace(self, x: Array) -> list[Any]:
        """States of all movable bodies, one of them raised (m) and tilted (rad) about
        its centre of mass.
        """
        up, about_x, about_y = x.tolist()
        motions = list(self._first)
        body = self._first[self._index]
        place = body.position + Vec3(0.0, 0.0, up)
        motions[self._index] = replace(
            body, position=place, attitude=_turn(about_x, about_y) * body.attitude
        )
        return motions

    def pushes(self, x: Array) -> list[Push]:
        """Contacts that involve the displaced object, each with its arm and its force
        on the object.

        Those of the latest pose are kept, of which gap, force and residual are computed
        one after the other.
        """
        # bytes compare as a whole, arrays entry by entry
        if x.tobytes() == self._pose:
            return self._pushes
        i = self._index
        moved = self._displace(x)
        pairs = ((each, {each.of, each.by}) for each in self._all(moved))
        mine = [
            (each, 1 if each.by == i else -1)
            for each, pair in pairs
            if i in pair and not pair & self._away
        ]
        middle = moved[i].position
        self._pose = x.tobytes()
        self._pushes = [
            (each, each.place - middle, each.touch.axis * (each.touch.normal * sign))
            for each, sign in mine
        ]
        return self._pushes

    def gap(self, x: Array) -> float:
        """Distance (m) from the displaced object to the nearest surface; negative if it
        penetrates.
        """
        return -_depth(self.pushes(x))

    def force(self, x: Array) -> float:
        """Vertical contact force on the object, N."""
        return float(sum(push.z for *_, push in self.pushes(x)))

    def residual(self, x: Array) -> Array:
        """Residual of the vertical force and of the horizontal moments on the object,
        relative to its weight.
        """
        length = float(max(self._contact.objects[self._index].size))
        return balance(self.pushes(x), self.weight, length)

    def contact_at(self, x: Array) -> Contact:
        """Contact model with the object moved to a given height and tilt."""
        objects = list(self._contact.objects)
        objects[self._index] = _place_object(
            objects[self._index], self._displace(x)[self._index]
        )
        return replace(self._contact, objects=tuple(objects))


def _place_object(of: FreeObject, memory: ObjectMotion) -> FreeObject:
    """Free object whose initial position and angles are those of a given state."""
    frame = of.frame(memory)
    (r00, _, _), (r10, _, _), (r20, r21, r22) = (
        (float(c) for c in row) for row in frame.rotation.rows
    )
    found = (
        np.arctan2(r21, r22),
        -np.arcsin(np.clip(r20, -1.0, 1.0)),
        np.arctan2(r10, r00),
    )
    # as many turns as are stated: degrees in place of radians are told later
    angles = (
        float(a + math.tau * round((float(s) - a) / math.tau))
        for a, s in zip(found, of.angles, strict=True)
    )
    return replace(of, position=Vec3(*map(float, frame.position)), angles=Vec3(*angles))


def _meetings_of(contact: Contact) -> Callable[[Sequence[Tree]], list[Meeting]]:
    """Make a function that evaluates the contacts between objects and surfaces, without
    the vehicle.
    """
    bodies = replace(contact, points=())
    step = contact.largest_step
    # neither period nor draws enter the first state of a contact
    memory = bodies.start(1.0, ())
    return lambda motions: meetings_of(
        bodies, motions, (), memory.time, memory.bristles, step
    )
