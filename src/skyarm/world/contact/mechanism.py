"""Mechanisms with one degree of freedom that carry surfaces: doors, valves, drawers,
buttons.

What touches a mechanism moves it along or about its axis, against what
:mod:`skyarm.world.contact.mechanism` says.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import field, replace
from typing import Annotated

from skyarm.algebra import E_X, E_Z, ZERO3, Scalar, Scalars, Vec3, axis_rotation
from skyarm.algebra.scalars import (
    absolute,
    add,
    clip,
    data,
    divide,
    maximum,
    minimum,
    mul,
    neg,
    sqrt,
)
from skyarm.records import coerce
from skyarm.records.coerce import RecordError, absent, concrete
from skyarm.records.field_rules import accept_fields, checked
from skyarm.records.files import shown
from skyarm.records.immutable import immutable
from skyarm.records.units import Unit, nonnegative, positive
from skyarm.world.component import Column, moved_by
from skyarm.world.contact.carrier import CarriedFrame, Carrier
from skyarm.world.contact.material import (
    BRISTLE_STEP,
    DULLEST,
    LONGEST,
    Material,
    euler_step_of,
)
from skyarm.world.contact.surface import Surface, rotation_of


@immutable
class MechanismMotion:
    """State of a mechanism: coordinate (rad or m), rate, and deflection of its friction
    bristle if any.
    """

    coordinate: Scalar
    rate: Scalar
    bristle: Scalars


@immutable
class Mechanism(Carrier[MechanismMotion]):
    """Mechanism with one degree of freedom and contact surfaces, such as a door, valve,
    drawer or button.

    Attributes:
        name: name in messages, logs and paths. kind: one of ``KINDS``.
        axis: axis of a hinge or slide; other kinds have their own. size: lengths of the
            kind's body.
        parts: additional surfaces, such as a handle, in the mechanism's axes. A hinge's
            axis goes through the origin.
        initial: coordinate at the start.
        lower, upper: coordinates at which it meets stops.
    """

    name: Annotated[
        str,
        Unit(
            "", "name of the mechanism, for messages, logs and paths", rule=coerce.name
        ),
    ]
    kind: Annotated[str, Unit("", "kind of the mechanism", rule=coerce.word_of(KINDS))]
    size: Annotated[Scalars, positive("m", "lengths of the kind's body")] = ()
    axis: Annotated[
        Vec3,
        Unit("", "axis of a hinge or slide, mechanism axes, of any length", folds=True),
    ] = ZERO3
    position: Annotated[
        Vec3, Unit("m", "origin of the mechanism's axes, world axes", folds=True)
    ] = ZERO3
    angles: Annotated[
        Vec3,
        Unit(
            "rad", "roll, pitch, yaw: about x, then y, then z of the world", folds=True
        ),
    ] = ZERO3
    parts: tuple[Surface, ...] = ()
    material: Material = field(default_factory=Material)
    mass: Annotated[
        Scalar, nonnegative("kg", "mass of the moving body, at its centre of mass")
    ] = 0
    com: Annotated[
        Vec3,
        Unit(
            "m",
            "centre of mass, mechanism axes; if 0 without inertia, the middle of the"
            " body",
            folds=True,
        ),
    ] = ZERO3
    inertia: Annotated[
        Scalar,
        nonnegative(
            "kg m^2", "inertia about the axis of a hinge; 0 for a uniform body"
        ),
    ] = 0
    initial: Annotated[
        Scalar, Unit("rad or m", "initial coordinate of the motion", begins=True)
    ] = 0.0
    lower: Annotated[
        Scalar, Unit("rad or m", "coordinate of the lower stop", infinite=True)
    ] = -math.inf
    upper: Annotated[
        Scalar, Unit("rad or m", "coordinate of the upper stop", infinite=True)
    ] = math.inf
    stiffness: Annotated[
        Scalar,
        nonnegative(
            "N m/rad or N/m",
            "stiffness of a closer or spring",
            effect="higher values need more force to open",
        ),
    ] = 0.0
    rest: Annotated[
        Scalar, Unit("rad or m", "coordinate at which the spring is slack")
    ] = 0.0
    damping: Annotated[
        Scalar,
        nonnegative(
            "N m s/rad or N s/m",
            "viscous damping of the motion",
            effect="higher values resist fast motions more",
        ),
    ] = 0.0
    friction: Annotated[
        Scalar,
        nonnegative(
            "N m or N",
            "dry friction of the motion",
            effect="higher values need more force to start",
        ),
    ] = 0
    bristle: Annotated[
        Scalar,
        nonnegative(
            "rad or m",
            "displacement at which dry friction reaches its full value; 0: by the"
            " mechanism's size",
        ),
    ] = 0
    detent: Detent | None = None
    stop_stiffness: Annotated[
        Scalar,
        nonnegative("N m/rad or N/m", "stiffness of the stops; 0: by the inertia"),
    ] = 0
    stop_damping: Annotated[
        Scalar,
        nonnegative(
            "s/rad or s/m",
            "the stop's force is multiplied by 1 + `stop_damping` * speed into the"
            " stop",
            high=DULLEST,
            effect="higher values bounce less off a stop",
        ),
    ] = 2.0

    def __post_init__(self) -> None:
        accept_fields(self, "mechanism")
        coerce.fold_zeros(self, "position", "angles", "axis", "com", "mass", "inertia")
        coerce.fold_zeros(self, "friction", "bristle", "stop_stiffness")
        self._require_body()
        self._require_numbers()

    def _require_body(self) -> None:
        """Refuse dimensions, axes and parts that are not allowed for a mechanism of
        this kind, such as a door.
        """
        said = KINDS[self.kind]
        options = KINDS[self.kind].sizes
        if len(self.size) not in [len(each) for each in options] and (
            self.size or options
        ):
            words = " or ".join(
                f"{len(each)} numbers, {', '.join(each)}" for each in options
            )
            allowed = (
                f"must be {words}"
                if options
                else f"must be left out of a {self.kind}, which is made of parts"
            )
            raise RecordError(f"mechanism.size = {shown(list(self.size))}: {allowed}")
        none = all(map(absent, self.axis))
        if said.axis is None and none:
            raise RecordError(
                f"mechanism.axis: is missing; a {self.kind} has none of its own"
            )
        if said.axis is not None and not none:
            raise RecordError(
                f"mechanism.axis: must be left out of a {self.kind}, which has one of"
                " its own"
            )
        for i, part in enumerate(self.parts):
            if part.shape == "plane":
                raise RecordError(
                    f"mechanism.parts[{i}].shape = 'plane': must be a shape with an end"
                )
            if part.moves:
                raise RecordError(
                    f"mechanism.parts[{i}].motion: must be left out; parts move with"
                    " their mechanism"
                )

    def _require_numbers(self) -> None:
        """Refuse a mechanism without inertia, an empty coordinate range, or an initial
        coordinate out of range.
        """
        turns = KINDS[self.kind].turns
        # an int is the 0 of a field that was left out
        if not turns and type(self.inertia) is not int:
            raise RecordError(
                f"mechanism.inertia: must be left out of a {self.kind}, which slides;"
                " mass says it"
            )
        if type(self.generalized_inertia) is int or (
            concrete(self.generalized_inertia) and not self.generalized_inertia > 0.0
        ):
            what = "inertia" if turns and not self.size else "mass"
            instead = ", or an inertia" if turns and self.size else ""
            raise RecordError(
                f"mechanism.{what}: is missing; a {self.kind} must have one above"
                f" 0{instead}"
            )
        if concrete(self.lower, self.upper) and not self.lower < self.upper:
            raise RecordError(
                f"mechanism.lower = {shown(self.lower)}: must be below upper ="
                f" {shown(self.upper)}"
            )
        if (
            concrete(self.initial, self.lower, self.upper)
            and not self.lower <= self.initial <= self.upper
        ):
            raise RecordError(
                f"mechanism.initial = {shown(self.initial)}: must be between lower ="
                f" {shown(self.lower)} and upper = {shown(self.upper)}"
            )

    @property
    def turns(self) -> bool:
        """True if the mechanism rotates about a hinge; false if it slides."""
        return KINDS[self.kind].turns

    @property
    def solid(self) -> MechanismBody | None:
        """Box or cylinder of a door, valve, drawer or button; None for a plain hinge or
        slide.
        """
        return solid_of(self.kind, self.size) if self.size else None

    @property
    def surfaces(self) -> tuple[Surface, ...]:
        """Contact surfaces of the mechanism: door, wheel, drawer or button, then parts
        such as a handle.
        """
        solid = self.solid
        if solid is None:
            return self.parts
        own = Surface(
            name=self.name,
            shape=solid.shape,
            size=solid.size,
            position=solid.middle,
            material=self.material,
        )
        return (own, *self.parts)

    @property
    def generalized_inertia(self) -> Scalar:
        """Inertia of the mechanism along its coordinate: kg m^2 of a hinge, kg of a
        slide.
        """
        if not self.turns:
            return self.mass
        # an int of 0 was not stated: it is that of the uniform body
        if type(self.inertia) is int and self.solid is not None:
            return mul(self.mass, self.solid.gyration)
        return self.inertia

    @property
    def centre(self) -> Vec3:
        """Centre of mass in the mechanism's axes, m."""
        said = type(self.inertia) is not int or any(
            type(c) is not int for c in self.com
        )
        return self.com if said or self.solid is None else self.solid.middle

    @property
    def hinge(self) -> Scalars:
        """Point on the hinge axis (m) and unit vector along it, world axes; () for a
        slide.
        """
        return (
            (*self.position, *rotation_of(self.angles).apply(self.along))
            if self.turns
            else ()
        )

    @property
    def mobility(self) -> Scalar:
        """Largest inverse effective mass over the mechanism's surfaces, 1/kg."""
        return self.mobility_at(0)

    def mobility_at(self, reach: Scalar) -> Scalar:
        """Largest inverse effective mass at a point up to ``reach`` (m) beyond the
        surfaces, 1/kg.
        """
        if not self.turns:
            return 1.0 / self.mass
        # a lever of 0 would mean an infinite effective mass and steps of any length
        lever = maximum(0.0, 1e-3)
        for surface in self.surfaces:
            away = surface.position - self.along * self.along.dot(surface.position)
            lever = maximum(lever, away.smooth_norm() + surface.farthest)
        lever = add(lever, reach)
        return lever * lever / self.generalized_inertia

    @property
    def along(self) -> Vec3:
        """Unit vector of the hinge or slide axis, in the mechanism's axes."""
        axis = KINDS[self.kind].axis
        if axis is not None:
            return axis
        if self.axis.coordinate_axis() is not None:
            return self.axis
        return self.axis * divide(1.0, self.axis.norm())

    @property
    def largest_step(self) -> Scalar:
        """Longest stable integration step (s) of the mechanism's stops, spring,
        friction and detent.
        """
        return longest_step(self)

    @property
    def largest_euler_step(self) -> Scalar:
        """Longest stable semi-implicit Euler step (s) of the mechanism's stops, spring,
        friction and detent.
        """
        return longest_step(self, euler=True)

    def start(self) -> MechanismMotion:
        """Initial state of the mechanism: at rest at the initial coordinate."""
        bristle = () if type(self.friction) is int else (0.0,)
        return MechanismMotion(coordinate=data(self.initial), rate=0.0, bristle=bristle)

    def frame(self, memory: MechanismMotion) -> CarriedFrame:
        """World pose and velocity of the mechanism in a given state."""
        return self.frame_at(memory.coordinate, memory.rate)

    def frame_at(self, coordinate: Scalar, rate: Scalar = 0.0) -> CarriedFrame:
        """World pose and velocity of the mechanism for a given coordinate (rad or m)
        and rate.
        """
        R = rotation_of(self.angles)
        axis = R.apply(self.along)
        if self.turns:
            turned = R @ axis_rotation(self.along, coordinate)
            return CarriedFrame(
                position=self.position,
                rotation=turned,
                velocity=ZERO3,
                turning=axis * rate,
            )
        return CarriedFrame(
            position=self.position + axis * coordinate,
            rotation=R,
            velocity=axis * rate,
            turning=ZERO3,
        )

    def slope(
        self, memory: MechanismMotion, force_W: Vec3, torque_W: Vec3, gravity: Scalar
    ) -> MechanismMotion:
        """Time derivative of the mechanism's state under a contact force and torque, by
        its equation of motion.
        """
        frame = self.frame(memory)
        rate = memory.rate
        axis = rotation_of(self.angles).apply(self.along)
        weight = Vec3(0, 0, neg(mul(self.mass, gravity)))
        if self.turns:
            applied = axis.dot(
                torque_W + frame.rotation.apply(self.centre).cross(weight)
            )
        else:
            applied = axis.dot(force_W + weight)
        own, bristle = inner_effort(self, memory)
        return MechanismMotion(
            coordinate=rate,
            rate=(applied + own) / self.generalized_inertia,
            bristle=bristle,
        )

    def before_euler_step(
        self, memory: MechanismMotion, slope: MechanismMotion, dt: Scalar
    ) -> MechanismMotion:
        """State of the mechanism with its friction bristle advanced by ``dt`` (s)."""
        return replace(memory, bristle=moved_by(memory.bristle, slope.bristle, dt))

    def kick(
        self, memory: MechanismMotion, slope: MechanismMotion, dt: Scalar
    ) -> MechanismMotion:
        """State of the mechanism after an acceleration for ``dt`` (s): only the rate
        changes.
        """
        return replace(memory, rate=memory.rate + slope.rate * dt)

    def drift(self, memory: MechanismMotion, dt: Scalar) -> MechanismMotion:
        """State of the mechanism after ``dt`` (s) at constant rate: only the coordinate
        changes.
        """
        return replace(memory, coordinate=memory.coordinate + memory.rate * dt)

    @property
    def columns(self) -> tuple[Column, ...]:  # type: ignore[override]
        """Log columns of the mechanism's coordinate and rate."""
        unit = "rad" if self.turns else "m"
        return Column("mechanism_position", self.name, unit), Column(
            "mechanism_rate", self.name, f"{unit}/s"
        )

    def logged(self, memory: MechanismMotion) -> Scalars:
        """Coordinate (rad or m) and rate of the mechanism, for the log."""
        return (memory.coordinate, memory.rate)


BRISTLES = {True: 2e-3, False: 2e-4}
"""Displacement (rad of a hinge, m of a slide) over which dry friction builds up by
default."""

STOP_RATE, STOP_LEAST = 200.0, 5000.0
"""Default stop of a mechanism: angular frequency (rad/s), and least stiffness (N/m) of
a slide's stop. A door enters it by 5 mrad at 1 rad/s, a button of 20 g yields by 0.2 mm
under 1 N; neither needs shorter steps than contact."""

STEEPEST = 16.0 / 3.0**1.5
"""Largest slope of a detent's force, in F / w: that of 16 u^2 (1 - u)^2 at u = (1 -
3^-0.5) / 2."""


@immutable
@checked("detent")
class Detent:
    """Detent of a mechanism: an interval of the coordinate with an opposing force, as
    of a latch or click.

    Attributes:
        place: coordinate at which it begins. width: way to its end; it is highest in
            the middle.
    """

    force: Annotated[
        Scalar,
        nonnegative(
            "N m or N", "largest resistance of the detent, against growing coordinates"
        ),
    ]
    width: Annotated[
        Scalar, positive("rad or m", "length of the detent along the coordinate")
    ]
    place: Annotated[
        Scalar, Unit("rad or m", "coordinate at which the detent begins")
    ] = 0.0

    def at(self, coordinate: Scalar) -> Scalar:
        """Force or torque of the detent at a coordinate, N or N m."""
        u = clip((coordinate - self.place) * (1.0 / self.width), 0.0, 1.0)
        hump = u * (1.0 - u)
        return (16.0 * self.force) * (hump * hump)


def inner_effort(of: Mechanism, memory: MechanismMotion) -> tuple[Scalar, Scalars]:
    """Force or torque (N or N m) of a mechanism's spring, damper, detent, stops and
    friction, and its bristle rate.
    """
    q, rate = memory.coordinate, memory.rate
    effort = -of.stiffness * (q - of.rest) - of.damping * rate
    if of.detent is not None:
        effort = effort - of.detent.at(q)

    def push(depth: Scalar, speed: Scalar) -> Scalar:
        """Force or torque (N or N m) of an end stop from its penetration and
        penetration rate.
        """
        stop = stop_of(of)
        return stop.normal_force(depth, speed, stop.step_of(of.generalized_inertia))

    if _at_stop(of.lower):
        effort = effort + push(of.lower - q, -rate)
    if _at_stop(of.upper):
        effort = effort - push(q - of.upper, rate)
    if not memory.bristle:
        return effort, ()
    length = bristle_of(of)
    (z,) = memory.bristle
    # one axis of a contact's bristle
    fastest = length / longest_step(of)
    # a bristle that bends by more than its length in a step would overshoot
    followed = clip(rate, -fastest, fastest)
    bending = followed - z * absolute(followed) / length
    stiffness = of.friction / length
    # half of critical damping: vibration of the bristle dies away
    friction = stiffness * z + sqrt(stiffness * of.generalized_inertia) * bending
    return effort - clip(friction, -of.friction, of.friction), (bending,)


def longest_step(of: Mechanism, *, euler: bool = False) -> Scalar:
    """Longest stable integration step (s) of a mechanism's spring, friction, detent and
    stops.

    With ``euler`` it is stable for the semi-implicit Euler method, too: for an
    oscillator of frequency w and decay d = c / m that requires (w h)^2 + 2 d h < 4.
    """
    stiffness, damping = of.stiffness, of.damping
    if type(of.friction) is not int:
        of_bristle = of.friction / bristle_of(of)
        stiffness = stiffness + of_bristle
        damping = damping + sqrt(of_bristle * of.generalized_inertia)
    if of.detent is not None:
        stiffness = stiffness + STEEPEST * of.detent.force / of.detent.width
    fastest = maximum(
        sqrt(stiffness / of.generalized_inertia), of.damping / of.generalized_inertia
    )
    # the shares of the limit of stability are those of a contact
    step = minimum(divide(BRISTLE_STEP, fastest), LONGEST)
    if euler:
        step = minimum(
            step,
            euler_step_of(
                stiffness / of.generalized_inertia, damping / of.generalized_inertia
            ),
        )
    return (
        minimum(step, stop_of(of).step_of(of.generalized_inertia))
        if _at_stop(of.lower) or _at_stop(of.upper)
        else step
    )


def stop_of(of: Mechanism) -> Material:
    """Contact material that models a mechanism's end stop; in N m and rad for a
    hinge.
    """
    stiffness = of.stop_stiffness
    if type(stiffness) is int:
        stiffness = STOP_RATE * STOP_RATE * of.generalized_inertia
        # of a light slide the inertia alone would make a stop that yields visibly
        stiffness = stiffness if of.turns else maximum(stiffness, STOP_LEAST)
    return Material(stiffness=stiffness, dissipation=of.stop_damping, friction=0.0)


def bristle_of(of: Mechanism) -> Scalar:
    """Displacement (rad or m) over which a mechanism's dry friction builds up to its
    full value.
    """
    return BRISTLES[of.turns] if type(of.bristle) is int else of.bristle


def _at_stop(limit: Scalar) -> bool:
    """True if a coordinate limit of a mechanism is finite, so that there is an end
    stop.
    """
    return not (concrete(limit) and math.isinf(limit))


@immutable
class Kind:
    """Kind of mechanism, such as a door: hinge or slide, axis of motion, and names of
    the body's dimensions.

    Attributes:
        turns: True for a hinge, False for a slide.
        axis: axis of the motion, its own axes; None where the file gives it.
        sizes: names of the lengths that its body may have; () for a kind whose body is
            made of parts.
    """

    turns: bool
    axis: Vec3 | None = None
    sizes: tuple[tuple[str, ...], ...] = ()


KINDS = {
    "hinge": Kind(turns=True),
    "slide": Kind(turns=False),
    "door": Kind(turns=True, axis=E_Z, sizes=(("width", "height", "thickness"),)),
    "valve": Kind(
        turns=True,
        axis=E_Z,
        sizes=(("radius", "thickness"), ("length", "width", "thickness")),
    ),
    "drawer": Kind(turns=False, axis=E_X, sizes=(("depth", "width", "height"),)),
    "button": Kind(turns=False, axis=-E_Z, sizes=(("radius", "height"),)),
}
"""Kind of a mechanism -> its motion. A valve with two lengths is a wheel, one with
three a lever."""


@immutable
class MechanismBody:
    """Box or cylinder of a mechanism, in the mechanism's axes.

    Attributes:
        shape, size: shape and lengths as of a surface. middle: middle of the shape, m.
        gyration: m^2, moment of inertia about the axis of a hinge by the mass, of a
            uniform body; nothing asks for that of one that slides.
    """

    shape: str
    size: Scalars
    middle: Vec3
    gyration: Scalar


def solid_of(kind: str, size: Sequence[Scalar]) -> MechanismBody:
    """Box or cylinder of a door, valve, drawer or button with given lengths (m).

    Args:
        kind: the word.
        size: lengths as listed in ``KINDS``, m.
    """
    if len(size) == 2:
        radius, thickness = size
        # of a button the outer face is in the origin
        middle = Vec3(0, 0, -0.5 * thickness) if kind == "button" else ZERO3
        return MechanismBody(
            shape="cylinder",
            size=(radius, thickness),
            middle=middle,
            gyration=0.5 * radius * radius,
        )
    length, second, third = size
    across, along = (third, second) if kind == "door" else (second, third)
    # of a drawer the front is in the origin, of a door or lever its hinge
    half = -0.5 if kind == "drawer" else 0.5
    return MechanismBody(
        shape="box",
        size=(length, across, along),
        middle=Vec3(half * length, 0, 0),
        gyration=length * length / 3.0 + across * across / 12.0,
    )
