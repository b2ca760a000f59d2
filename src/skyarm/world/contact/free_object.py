"""Free objects: rigid bodies that rest on surfaces, slide, roll, tip over and fall.

An object's motion is that of Newton and Euler about its centre of mass. Its skin is a
surface for the vehicle's points, for other objects and for corners of the world; with
its own corners, rims or as a ball it touches the surfaces of the world.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import field, replace
from functools import reduce
from typing import Annotated

from skyarm.algebra import (
    E_X,
    E_Y,
    E_Z,
    ZERO3,
    ZERO3_DATA,
    Quaternion,
    Scalar,
    Scalars,
    Vec3,
)
from skyarm.algebra.scalars import (
    absolute,
    add,
    data,
    divide,
    maximum,
    minimum,
    mul,
    sqrt,
)
from skyarm.records import coerce
from skyarm.records.coerce import RecordError, absent, concrete
from skyarm.records.field_rules import accept_fields
from skyarm.records.files import shown
from skyarm.records.immutable import derived_field, field_if_any, immutable
from skyarm.records.leaves import as_data
from skyarm.records.units import Unit, nonnegative, positive
from skyarm.vehicle.convex_hull import Triangles, complete_shape
from skyarm.world.component import Column
from skyarm.world.contact.carrier import CarriedFrame, Carrier
from skyarm.world.contact.material import Material
from skyarm.world.contact.shape_pairs import PlacedShape, down_of, spot_count, spots_of
from skyarm.world.contact.surface import Corners, Spot, Surface

SOLIDS = ("box", "cylinder", "sphere", "capsule", "hull")
"""Shapes of free objects."""

CARRYING = 4.0
"""Number of contacts at which a capsule or hull is taken to rest, at the corners
farthest from its centre of mass."""

STEP_SHARE = 0.7
"""Step as a fraction of the material's longest one. A rotating body leaves a surface at
another speed than it came, and the work at its skin grows with (speed * step)^2. Thrown
boxes, cylinders and balls of 3 g to 3 kg gain less than 0.1 % of energy (measured; 0.15
% at a fraction of 1)."""

LOGGED = (
    ("position", "xyz", "m", "middle, world axes,"),
    ("quaternion", "wxyz", "", "attitude"),
    ("velocity", "xyz", "m/s", "velocity of the middle, world axes,"),
    ("rate", "xyz", "rad/s", "angular velocity, its own axes,"),
)
"""Logged arrays of an object: name, axes, unit, meaning."""


@immutable
class ObjectMotion:
    """State of a free object: position, attitude, velocity and angular velocity.

    Attributes:
        position: centre of mass, m, world axes. attitude: its axes to world axes.
        velocity: velocity of the centre of mass, m/s, world axes. rate: angular
            velocity, rad/s, its own axes.
    """

    position: Vec3
    attitude: Quaternion
    velocity: Vec3
    rate: Vec3


@immutable
class FreeObject(Carrier[ObjectMotion]):
    """Free object: a rigid box, cylinder or ball that lies on surfaces and can be
    pushed or grasped.

    Attributes:
        name: name in messages, logs and paths. shape: one of ``SOLIDS``. size: lengths
            as of a surface.
        inertia: moments of inertia; left out for those of a body of uniform density.
        standing: whether it is set down on what is below it, at rest, when a file is
            read.
        mesh: path of a mesh, as of a surface. vertices, faces: of a hull, as of a
            surface; its inertia has to be stated.
    """

    name: Annotated[
        str,
        Unit("", "name of the object, for messages, logs and paths", rule=coerce.name),
    ]
    mass: Annotated[Scalar, positive("kg", "mass of the object")]
    shape: Annotated[
        str, Unit("", "shape of the object", rule=coerce.word_of(SOLIDS))
    ] = "box"
    size: Annotated[
        Scalars, positive("m", "lengths of the shape, as of a surface")
    ] = ()
    inertia: Annotated[
        Vec3,
        nonnegative(
            "kg m^2",
            "principal moments of inertia about the centre of mass, object axes; 0:"
            " uniform density",
        ),
    ] = ZERO3
    com: Annotated[
        Vec3,
        Unit(
            "m", "centre of mass from the middle of the shape, object axes", folds=True
        ),
    ] = ZERO3
    position: Annotated[
        Vec3,
        Unit(
            "m", "initial position of the middle of the shape, world axes", begins=True
        ),
    ] = ZERO3_DATA
    angles: Annotated[
        Vec3,
        Unit(
            "rad",
            "initial roll, pitch, yaw: about x, then y, then z of the world",
            begins=True,
        ),
    ] = ZERO3_DATA
    velocity: Annotated[
        Vec3,
        Unit("m/s", "initial velocity of the centre of mass, world axes", begins=True),
    ] = ZERO3_DATA
    angular_velocity: Annotated[
        Vec3, Unit("rad/s", "initial angular velocity, world axes", begins=True)
    ] = ZERO3_DATA
    standing: bool = False
    material: Material = field(default_factory=Material)
    mesh: str = field_if_any(default="")
    vertices: Corners = field_if_any(default=())
    faces: Triangles = derived_field()

    def __post_init__(self) -> None:
        accept_fields(self, "object")
        coerce.fold_zeros(self, "com")
        complete_shape("object", self, RecordError)
        self._require_moments()
        if self.standing and any(
            concrete(c) and c != 0.0 for c in (*self.velocity, *self.angular_velocity)
        ):
            raise RecordError(
                "object.standing = true: must be false of an object that moves at the"
                " start"
            )

    def _require_moments(self) -> None:
        """Refuse moments of inertia that are physically impossible."""
        moments = tuple(self.inertia)
        if not concrete(*moments):
            return
        if self.shape == "hull" and not any(moments):
            raise RecordError("object.inertia: is missing; a hull has no default")
        largest = max(moments)
        said = shown([float(each) for each in moments])
        if all(each == 0.0 for each in moments):
            # ints: left out, and those of a uniform density follow from the shape
            object.__setattr__(self, "inertia", ZERO3)
        elif min(moments) == 0.0:
            raise RecordError(
                f"object.inertia = {said}: must be above 0, or left out for a uniform"
                " density"
            )
        elif 2.0 * largest > sum(moments) * (1.0 + 1e-9):
            # a flat body has equality, up to rounding
            raise RecordError(
                f"object.inertia = {said}: no moment may be larger than the sum of the"
                " other two"
            )

    @property
    def moments(self) -> Vec3:
        """Moments of inertia about the centre of mass and the object's axes, kg m^2."""
        given = all(map(absent, self.inertia))
        return (
            uniform_moments(self.shape, self.size, self.mass) if given else self.inertia
        )

    @property
    def surfaces(self) -> tuple[Surface, ...]:
        """Contact surface of the free object."""
        return (
            Surface(
                name=self.name,
                shape=self.shape,
                size=self.size,
                material=self.material,
                mesh=self.mesh,
                vertices=self.vertices,
                faces=self.faces,
            ),
        )

    def require_near(self, place: Vec3) -> None:
        """Refuse a place (m, its axes) farther from the surface of the body than the
        body is large.
        """
        far = place.norm()
        # the surface lies within one of it, and the body is at most two wide
        most = 3.0 * self.surfaces[0].farthest
        if concrete(far, most) and far > most:
            words = (
                f"lies {far:.3g} m from the middle of {shown(self.name)}, must be"
                f" within {most:.3g} m"
            )
            raise RecordError(f"place = {shown([float(c) for c in place])}: {words}")

    @property
    def mobility(self) -> Scalar:
        """Largest inverse effective mass over all contacts of the object, 1/kg."""
        if self.shape in ("capsule", "hull"):
            reach = _reach(self.surfaces[0].farthest, self.com)
            return CARRYING * (1.0 + divide(reach, self.gyration)) / self.mass
        return largest_mobility(
            self.shape, self.size, self.com, self.mass, self.moments
        )

    def mobility_at(self, reach: Scalar) -> Scalar:
        """Largest inverse effective mass (1/kg) of the free object in a grasp that also
        fixes the attitude.
        """
        # the smallest radius of gyration bounds any direction of the lever
        lever = self.surfaces[0].farthest + self.com.smooth_norm() + reach
        # 2: the place has 1 / m, and the attitude as much: its stiffness is that of the
        # place by the gyration
        return (2.0 + lever * lever / self.gyration) / self.mass

    def mobility_of(self, place: Vec3) -> Scalar:
        """Largest inverse effective mass (1/kg) at a place: row sums bound the
        eigenvalues of 1 / m + S(r)^T J^-1 S(r).

        Source: Gershgorin 1931.
        """
        r = place - self.com
        J = self.moments
        diagonal = (
            divide(r.z * r.z, J.y) + divide(r.y * r.y, J.z),
            divide(r.z * r.z, J.x) + divide(r.x * r.x, J.z),
            divide(r.y * r.y, J.x) + divide(r.x * r.x, J.y),
        )
        beside = (
            divide(r.x * r.y, J.z),
            divide(r.x * r.z, J.y),
            divide(r.y * r.z, J.x),
        )
        xy, xz, yz = map(absolute, beside)
        rows = (diagonal[0] + xy + xz, diagonal[1] + xy + yz, diagonal[2] + xz + yz)
        return 1.0 / self.mass + reduce(maximum, rows)

    @property
    def step_share(self) -> float:
        """Empirical factor by which contact with this free object shortens the longest
        stable integration step.
        """
        return STEP_SHARE

    @property
    def half_width(self) -> float:
        """Half the largest dimension (m) of the free object: largest offset of a grasp
        from the object's centre.
        """
        if self.shape == "cylinder":
            return max(float(self.size[0]), 0.5 * float(self.size[1]))
        if self.shape in ("capsule", "hull"):
            return float(self.surfaces[0].farthest)
        return max(map(float, self.size)) * (0.5 if self.shape == "box" else 1.0)

    @property
    def gyration(self) -> Scalar:
        """Smallest squared radius of gyration of the free object, m^2."""
        least: Scalar = reduce(minimum, self.moments)
        return least / self.mass

    def start(self) -> ObjectMotion:
        """Initial state of the free object, from its initial pose and velocities."""
        attitude = Quaternion(1.0, 0.0, 0.0, 0.0)
        for axis, angle in zip((E_X, E_Y, E_Z), self.angles, strict=True):
            # fixed axes: later rotations stand on the left
            attitude = Quaternion.of_rotation_vector(axis * data(angle)) * attitude
        R = attitude.rotation()
        return as_data(
            ObjectMotion(
                position=self.position + R.apply(self.com),
                attitude=attitude,
                velocity=self.velocity,
                rate=R.apply_T(self.angular_velocity),
            )
        )

    def advance(self, memory: ObjectMotion) -> ObjectMotion:
        """State of the object with the quaternion normalised."""
        return replace(memory, attitude=memory.attitude.normalized())

    def frame(self, memory: ObjectMotion) -> CarriedFrame:
        """Pose and velocity of the object's axes, whose origin is the centre of its
        shape.
        """
        R = memory.attitude.rotation()
        arm, turning = R.apply(self.com), R.apply(memory.rate)
        return CarriedFrame(
            position=memory.position - arm,
            rotation=R,
            velocity=memory.velocity - turning.cross(arm),
            turning=turning,
        )

    def slope(
        self, memory: ObjectMotion, force_W: Vec3, torque_W: Vec3, gravity: Scalar
    ) -> ObjectMotion:
        """Time derivative of the state by Newton's and Euler's equations."""
        R = memory.attitude.rotation()
        w = memory.rate
        moments = self.moments
        # the torque is given about the middle, Euler's equations are about the centre
        # of mass
        torque = R.apply_T(torque_W - R.apply(self.com).cross(force_W)) - w.cross(
            w.hadamard(moments)
        )
        return ObjectMotion(
            position=memory.velocity,
            attitude=memory.attitude.derivative(w),
            velocity=as_data(force_W * (1.0 / self.mass) - E_Z * gravity),
            rate=as_data(
                Vec3(*(divide(t, i) for t, i in zip(torque, moments, strict=True)))
            ),
        )

    def kick(
        self, memory: ObjectMotion, slope: ObjectMotion, dt: Scalar
    ) -> ObjectMotion:
        """State of the free object after an acceleration for ``dt`` (s): only
        velocities change.
        """
        velocity = memory.velocity + slope.velocity * dt
        rate = memory.rate + slope.rate * dt
        return replace(memory, velocity=velocity, rate=rate)

    def drift(self, memory: ObjectMotion, dt: Scalar) -> ObjectMotion:
        """State of the free object after ``dt`` (s) with constant velocities: only
        position and attitude change.
        """
        attitude = memory.attitude * Quaternion.of_small_rotation(memory.rate, dt)
        return replace(
            memory, position=memory.position + memory.velocity * dt, attitude=attitude
        )

    @property
    def spot_count(self) -> int:
        """Number of the object's contact points: corners of a box, rim points of a
        cylinder, one for a ball.
        """
        return spot_count(self.surfaces[0])

    def spots(
        self, frame: CarriedFrame, toward: Callable[[Vec3], Vec3]
    ) -> tuple[Spot, ...]:
        """Contact points of the free object with world surfaces: centre (m, world axes)
        and radius (m).
        """
        own = PlacedShape(self.surfaces[0], frame.rotation, frame.position)
        if self.shape != "cylinder":
            return spots_of(own)
        down = down_of(own, toward(frame.position))
        return spots_of(own, (down, down))

    @property
    def columns(self) -> tuple[Column, ...]:  # type: ignore[override]
        """Log columns of the free object's pose and velocities."""
        return tuple(
            Column(
                f"object_{array}",
                f"{self.name}/{axis}",
                unit,
                f"{meaning} of an object",
            )
            for array, axes, unit, meaning in LOGGED
            for axis in axes
        )

    def logged(self, memory: ObjectMotion) -> Scalars:
        """Position, attitude, velocity and angular velocity of the free object, for the
        log.
        """
        frame = self.frame(memory)
        return (*frame.position, *memory.attitude, *frame.velocity, *memory.rate)


def uniform_moments(shape: str, size: Sequence[Scalar], mass: Scalar) -> Vec3:
    """Principal moments of inertia of a uniform box, cylinder, capsule or sphere about
    its centre, kg m^2.
    """
    if shape == "sphere":
        moment = 0.4 * mass * size[0] * size[0]
        return Vec3(moment, moment, moment)
    if shape == "capsule":
        radius, length = size
        volume = length + 4.0 / 3.0 * radius
        ends = uniform_moments("sphere", size, mass * (4.0 / 3.0 * radius) / volume)
        middle = uniform_moments("cylinder", size, mass * length / volume)
        # each end is half a ball, with its centre 3 / 8 of the radius beyond the middle
        away = mass * (4.0 / 3.0 * radius) / volume
        away = away * length * (0.25 * length + 0.375 * radius)
        return ends + middle + Vec3(away, away, 0)
    if shape == "cylinder":
        radius, length = size
        across = mass * (radius * radius / 4.0 + length * length / 12.0)
        return Vec3(across, across, 0.5 * mass * radius * radius)
    x, y, z = (each * each for each in size)
    return Vec3(mass * (y + z) / 12.0, mass * (x + z) / 12.0, mass * (x + y) / 12.0)


def largest_mobility(
    shape: str, size: Sequence[Scalar], com: Vec3, mass: Scalar, moments: Vec3
) -> Scalar:
    """Largest inverse effective mass (1/kg) of a rigid body over all its possible
    contacts.

    Args:
        shape: box, cylinder or sphere.
        size: lengths of the shape, m.
        com: centre of mass, seen from the middle, m.
        mass: kg.
        moments: moments of inertia about the centre of mass, kg m^2.
    """
    halves: Sequence[Scalar]
    least: Scalar = reduce(minimum, moments)
    if shape == "sphere":
        return 1.0 / mass + _reach(size[0], com) / least

    def face(count: int, a: int, b: int, spread_a: Scalar, spread_b: Scalar) -> Scalar:
        """Upper bound of the inverse effective mass (1/kg) of a face between two axes,
        at rest on several contacts.

        The spreads are sums of squares of their places along a and along b about the
        middle, m^2.
        """
        # a place along b turns about a
        sink = count / mass
        off_a, off_b = com[a], com[b]
        about_a = add(spread_b, mul(count * 1.0, mul(off_b, off_b))) / moments[a]
        about_b = add(spread_a, mul(count * 1.0, mul(off_a, off_a))) / moments[b]
        with_a = mul(_size(off_b), count / sqrt(mass * moments[a]))
        with_b = mul(_size(off_a), count / sqrt(mass * moments[b]))
        share = count / sqrt(moments[a] * moments[b])
        both = mul(mul(_size(off_a), _size(off_b)), share)
        # row sums bound the largest eigenvalue (Gershgorin)
        rows = (
            add(add(sink, with_a), with_b),
            add(add(about_a, with_a), both),
            add(add(about_b, with_b), both),
        )
        return reduce(maximum, rows)

    if shape == "cylinder":
        radius = size[0]
        half = 0.5 * size[1]
        halves = (radius, radius, half)
        # three points at 120 degrees: each axis has half of 3 r^2
        stands = 1.5 * radius * radius
        faces = [
            face(3, 0, 1, stands, stands),
            face(2, 2, 0, 2.0 * half * half, 0),
            face(2, 2, 1, 2.0 * half * half, 0),
        ]
    else:
        halves = tuple(0.5 * each for each in size)
        spreads = [4.0 * each * each for each in halves]
        faces = [
            face(4, a, b, spreads[a], spreads[b]) for a, b in ((0, 1), (1, 2), (2, 0))
        ]
    ends = [
        1.0 / mass + _reach(half, Vec3(0, 0, com[i])) / least
        for i, half in enumerate(halves)
    ]
    return reduce(maximum, [*faces, *ends])


def _reach(distance: Scalar, com: Vec3) -> Scalar:
    """Squared largest distance (m^2) between a body's surface and its centre of
    mass.
    """
    away = distance
    for each in com:
        away = add(away, _size(each))
    return away * away


def _size(value: Scalar) -> Scalar:
    """Absolute value of a number; an integer 0 stays an integer for constant
    folding.
    """
    return 0 if absent(value) else absolute(value)
