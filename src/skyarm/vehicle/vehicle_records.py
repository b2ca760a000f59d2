"""Vehicle dataclasses: a rigid base with rotors and a tree of links.

Plain frozen records of scalars: a mass may be a float, a lane of a batch, a traced node
or a JAX array. Integers are structure (see :mod:`skyarm.algebra.scalars`). Where a
record holds a vector, matrix or tuple it also takes plain sequences and arrays
(:mod:`skyarm.records.coerce`). Concrete numbers are checked when a :class:`Vehicle` is
made.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import field, replace
from typing import Annotated, Any, Literal

from skyarm.algebra import E_Z, ZERO3, Mat3, Scalar, Scalars, Vec3
from skyarm.algebra.scalars import add, divide, mul, neg, where
from skyarm.records.coerce import (
    RecordError,
    concrete,
    number,
    pairs,
    plain_number,
    proper_rotation,
    unit_vector,
    vector,
    word_of,
)
from skyarm.records.content import keep_content
from skyarm.records.field_rules import accept_fields, checked
from skyarm.records.files import must_be_one_of, shown
from skyarm.records.immutable import UNWRITTEN, derived_field, field_if_any, immutable
from skyarm.records.leaves import Place, field_names
from skyarm.records.notebook import notebook_html
from skyarm.records.path_names import Names, NumberView
from skyarm.records.units import Unit, nonnegative, positive
from skyarm.vehicle.battery import Battery
from skyarm.vehicle.check import (
    FARTHEST,
    NOISE,
    SHARE,
    VehicleError,
    accept_named,
    inertia,
    refuse,
    unique,
)
from skyarm.vehicle.convex_hull import COLLISION_SIZES, Triangles, complete_shape
from skyarm.vehicle.linkage import BASE, Body, Follower, Joint, Link
from skyarm.vehicle.mobility import what_does_not_move
from skyarm.vehicle.thrust_table import ThrustTable
from skyarm.vehicle.tilt import Tilt

LOAD = nonnegative("kg", "mass of the payload, in addition to the vehicle's", high=1e4)
"""Declaration of a carried mass; a larger one would leave nothing of the vehicle in the
sum of both."""

Rolling = Literal["rotors_sim", "signed"]
"""Forms of the rolling moment: that of RotorS, and by the direction of rotation."""

WITHOUT_MESH = "it is drawn from its joints"
"""End of a note on a mesh that no picture shows."""


def rotation_sense(field: str, value: object) -> int:
    """Convert a rotor's sense of rotation; anything but 1 and -1 raises an error."""
    sign = plain_number(value)
    # True would pass as 1
    if isinstance(sign, bool) or not isinstance(sign, (int, float)) or abs(sign) != 1:
        refuse(
            field, value, "must be 1 (ccw, seen from the tip of its axis) or -1 (cw)"
        )
    return int(sign)


BASE_NAME = "base"
"""Name of the base among the bodies."""


@immutable
class Rotor:
    """Rotor fixed to the base, with thrust and drag torque.

    Attributes:
        position: hub in the base frame, m.
        axis: unit vector of positive thrust, base frame; of a rotor that tilts, at
            angle 0.
        direction: +1 turns counter-clockwise seen against the axis (ccw), -1 clockwise.
        thrust_coefficient: k_f, N s^2/rad^2: thrust = k_f W^2.
        moment_coefficient: k_m, m: drag torque = k_m thrust, against the direction of
            rotation.
        drag_coefficient: hub drag, N s^2/(rad m): force = -coefficient |W| v_perp.
        rolling_moment_coefficient: N s^2/rad: torque = -coefficient |W| v_perp.
        rolling: "signed": that torque times the direction, so that rotors which turn
            against each other cancel, as the moment of the advancing blade does
            (Leishman 2006, section 4.1); "rotors_sim": as RotorS, the same for both.
        time_constant_up, time_constant_down: first-order lag of the speed, s.
        max_speed: largest speed, rad/s. reversible: it also turns backwards, at
            -max_speed or more, where its thrust and drag torque change their sign; else
            its speed is never negative.
        inertia: inertia of what turns, about the axis, kg m^2: its change of speed and
            the turning of its spin push the base. It is part of the base's inertia too.
            An int of 0 is structure: no such effect.
        table: thrust and drag torque by speed in place of k_f W^2 and k_m thrust; k_f
            and k_m scale them and are what laws know.
        tilt: servo that turns the axis; None for a rotor whose axis is fixed.
        shield: radius and height of a guard around the disc, m; empty without. It
            touches as a cylinder of the base, and the disc ends no flight.
    """

    name: str
    position: Annotated[
        Vec3, Unit("m", "position of the hub, base axes", rule=vector, usual=FARTHEST)
    ]
    axis: Annotated[
        Vec3, Unit("", "unit vector of positive thrust, base axes", rule=unit_vector)
    ] = E_Z
    direction: Annotated[
        int,
        Unit(
            "",
            "direction of rotation seen against the axis: +1 (ccw) counter-clockwise,"
            " -1 (cw) clockwise",
            rule=rotation_sense,
        ),
    ]
    thrust_coefficient: Annotated[
        Scalar, positive("N s^2/rad^2", "k_f: thrust per squared speed", rule=number)
    ]
    # half a metre of drag torque per thrust is the drag of no propeller
    moment_coefficient: Annotated[
        Scalar, Unit("m", "k_m: drag torque per thrust", usual=0.5, **SHARE)
    ]
    drag_coefficient: Annotated[
        Scalar,
        Unit(
            "N s^2/(rad m)",
            "hub drag per speed of the rotor and air velocity across the axis",
            **SHARE,
        ),
    ] = 0
    rolling_moment_coefficient: Annotated[
        Scalar,
        Unit(
            "N s^2/rad",
            "rolling moment per speed of the rotor and air velocity across the axis",
            **SHARE,
        ),
    ] = 0
    # lags that are not stated are those of RotorS (urdf/hummingbird.xacro)
    time_constant_up: Annotated[
        Scalar,
        positive(
            "s",
            "time constant of a rising speed",
            rule=number,
            usual=0.5,
            effect="longer lags take phase margin from the attitude loop",
        ),
    ] = 0.0125
    time_constant_down: Annotated[
        Scalar,
        positive(
            "s",
            "time constant of a falling speed",
            rule=number,
            usual=0.5,
            effect="longer lags take phase margin from the attitude loop",
        ),
    ] = 0.025
    max_speed: Annotated[
        Scalar,
        positive("rad/s", "largest speed of the rotor", infinite=True, rule=number),
    ] = math.inf
    rolling: Annotated[
        Rolling,
        Unit(
            "",
            "sign of the rolling moment: of every rotor against the velocity, or by its"
            " direction of rotation",
        ),
    ] = field(default="rotors_sim", metadata={UNWRITTEN: "rotors_sim"})
    reversible: Annotated[
        bool, Unit("", "true: the rotor also turns backwards, up to `max_speed`")
    ] = field(default=False, metadata={UNWRITTEN: False})
    inertia: Annotated[
        Scalar,
        Unit(
            "kg m^2",
            "inertia of the rotating parts about the axis; an int 0: no reaction on the"
            " base",
            usual=1.0,
            **SHARE,
        ),
    ] = field_if_any(default=0)
    table: ThrustTable | None = field_if_any(default=None)
    tilt: Tilt | None = field_if_any(default=None)
    shield: Annotated[
        Scalars, positive("m", "radius and height of a guard around the disc")
    ] = field_if_any(default=())

    def __post_init__(self) -> None:
        accept_named(self, "rotor")

    @property
    def min_speed(self) -> Scalar:
        """Least speed, rad/s: 0, or that of a reversible rotor which turns
        backwards.
        """
        # an int 0 folds away: a rotor that cannot reverse has no term for its least
        # speed
        return neg(self.max_speed) if self.reversible else 0

    @property
    def rolling_moment(self) -> Scalar:
        """Rolling moment against the velocity in the rotor's plane, per speed of both,
        N s^2/rad.
        """
        of_sense = self.direction if self.rolling == "signed" else 1
        return mul(of_sense, self.rolling_moment_coefficient)


TIPS = ("tool0", "ee_link", "gripper_link", "tcp", "flange")
"""Ends of the names that files of robots give to the end effector's link, the likeliest
first."""


@immutable
class Frame:
    """Named pose fixed to a link, such as tip or sensor (position in m and R_LF in the
    link's frame).
    """

    name: str
    link: int
    position: Annotated[
        Vec3,
        Unit(
            "m",
            "origin of a named frame, axes of its link",
            rule=vector,
            usual=FARTHEST,
        ),
    ]
    rotation: Annotated[
        Mat3,
        Unit(
            "",
            "rotation from the axes of a named frame to those of its link",
            rule=proper_rotation,
        ),
    ] = Mat3.identity()

    def __post_init__(self) -> None:
        # a look or shape reads its fields by the same rules; its errors name its kind
        accept_named(self, type(self).__name__.lower())


@immutable
class Look(Frame):
    """Visual mesh of a link with its pose; without mass or contact.

    Attributes:
        name: name of the link in the file that describes it.
        file: path of an STL file. scale: factors of its numbers along its axes, to m.
    """

    file: str
    scale: Annotated[
        Vec3,
        Unit("m", "length of one unit of the mesh file, along each axis", rule=vector),
    ] = Vec3(1.0, 1.0, 1.0)


FEWEST_CORNERS = 4
"""Least number of corners of a convex body."""


@immutable
class Collision(Frame):
    """Shape of a body of the vehicle that touches what is in its way, with its pose;
    without mass.

    Attributes:
        name: name in messages and logs.
        shape: one of ``COLLISION_SIZES``. size: its lengths, m; none of a hull.
        vertices: corners of a hull, m, axes of the shape; its faces are those of the
            smallest convex body around them. faces: its triangles as numbers of
            vertices, found if left out.
    """

    shape: Annotated[
        str, Unit("", "shape of a collision", rule=word_of(COLLISION_SIZES))
    ]
    size: Annotated[
        Scalars, positive("m", "lengths of the shape, edges of a box in full")
    ] = ()
    vertices: tuple[Vec3, ...] = field_if_any(default=())
    faces: Triangles = derived_field()

    def __post_init__(self) -> None:
        accept_named(self, "collision")
        complete_shape(f"collisions[{self.name}]", self, VehicleError)


@immutable
@checked("drag", VehicleError)
class BodyDrag:
    """Quadratic drag of the airframe in base axes: force_i = -1/2 rho area_i |v| v_i at
    the base origin.

    Attributes:
        area: drag coefficient times reference area per axis, m^2.
        air_density: kg/m^3 (ISA sea level 1.225).
    """

    area: Annotated[
        Vec3,
        nonnegative(
            "m^2", "drag coefficient times reference area along x, y, z", rule=vector
        ),
    ] = ZERO3
    air_density: Annotated[Scalar, Unit("kg/m^3", "density of the air", **SHARE)] = (
        1.225
    )


@immutable
class MountedDrive:
    """Actuator of one joint as part of a vehicle: name of the joint, and drive model.

    Attributes:
        name: name of the joint. drive: a :class:`skyarm.Drive`.
    """

    name: str
    drive: Any

    def __post_init__(self) -> None:
        accept_fields(self, "drives", VehicleError)
        # any class with an effort is a drive, so users' own drives need no base class
        if not callable(getattr(self.drive, "effort", None)):
            refuse(f"drives.{self.name}", self.drive, "must be a Drive")


@keep_content
@immutable
class Vehicle:
    """Vehicle: airframe, rotors, and a tree of joints and links (the arm).

    Attributes:
        name: short name.
        title: description in one line.
        base: the airframe's body, base frame.
        links: tree in an order in which every parent precedes its children.
        rotors: any number, any pose.
        followers: links that move with others; a frame, a wrench or a shape means the
            k-th by the index ``n`` + k.
        frames: named frames; ``end_effector`` names the one that metrics and tasks
            mean.
        drag: drag of the airframe in moving air.
        drives: drives of the joints whose setpoint is not the torque.
        battery: battery of the rotors; None for a supply that never sags.
        looks: meshes for pictures, of links whose file names some.
        collisions: shapes of its bodies that touch surfaces, objects and vehicles.
        sources: (field, source) pairs: where each number comes from.
        notes: elements that the reader of its file left out or read in another way, a
            line each.
        gaps: what the rotors of its file lack to fly, a line each group of rotors.
    """

    name: str
    base: Body
    links: tuple[Link, ...] = ()
    rotors: tuple[Rotor, ...] = ()
    frames: tuple[Frame, ...] = ()
    end_effector: str = ""
    drag: BodyDrag = BodyDrag()
    drives: tuple[MountedDrive, ...] = field_if_any(default=())
    battery: Battery | None = field_if_any(default=None)
    followers: tuple[Follower, ...] = field_if_any(default=())
    looks: tuple[Look, ...] = field_if_any(default=(), repr=False)
    collisions: tuple[Collision, ...] = field_if_any(default=())
    title: str = field(default="", repr=False)
    sources: Annotated[
        tuple[tuple[str, str], ...],
        Unit("", "source of each number, as pairs of field and source", rule=pairs),
    ] = field(default=(), repr=False)
    notes: tuple[str, ...] = field_if_any(default=(), repr=False)
    gaps: tuple[str, ...] = field_if_any(default=(), repr=False)

    def __post_init__(self) -> None:
        accept_fields(self, "vehicle", VehicleError)
        _require_whole(self)

    def _repr_html_(self) -> str:
        return notebook_html(self)

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.links)

    @property
    def zeros(self) -> tuple[float, ...]:
        """Zero for each joint: positions, rates or efforts."""
        return (0.0,) * self.n

    @property
    def joints(self) -> tuple[Joint, ...]:
        """Joints of the links, in their order."""
        return tuple(link.joint for link in self.links)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, in the order of the links."""
        return tuple(joint.name for joint in self.joints)

    @property
    def sizes(self) -> tuple[int, int, int]:
        """Numbers of joints, of rotors and of tilting rotors."""
        return self.n, len(self.rotors), len(self.tilts)

    @property
    def tilts(self) -> tuple[Tilt, ...]:
        """Servos of the tilting rotors, in the order of their rotors."""
        return tuple(each.tilt for each in self.rotors if each.tilt is not None)

    @property
    def bodies(self) -> tuple[Body, ...]:
        """All bodies: base first, then the links, then the followers."""
        return (self.base, *(link.body for link in self.moving))

    @property
    def shields(self) -> tuple[Collision, ...]:
        """Cylinders around the discs of rotors that have shields."""
        shields = [
            Collision(
                name=f"{each.name}.shield",
                link=BASE,
                position=each.position,
                rotation=_axes_along(each.axis),
                shape="cylinder",
                size=each.shield,
            )
            for each in self.rotors
            if each.shield
        ]
        return tuple(shields)

    @property
    def shapes(self) -> tuple[Collision, ...]:
        """All shapes that touch: the stated ones, then the rotors' shields."""
        return (*self.collisions, *self.shields)

    @property
    def moving(self) -> tuple[Link, ...]:
        """All links that joints move: the independent links, then the followers."""
        return (*self.links, *(each.link for each in self.followers))

    @property
    def with_free_followers(self) -> Vehicle:
        """Vehicle whose followers are links with independent joints."""
        return self.with_checked(links=self.moving, followers=())

    def with_checked(self, **parts: Any) -> Vehicle:
        """Vehicle with some fields replaced by values that are already checked; skips
        the checks for speed.
        """
        # frozen, and its checks would repeat what the caller's vehicle has passed
        made = object.__new__(Vehicle)
        for name in field_names(Vehicle) or ():
            object.__setattr__(made, name, parts.get(name, getattr(self, name)))
        return made

    @property
    def mass(self) -> Scalar:
        """Total mass, kg."""
        total: Scalar = 0
        for body in self.bodies:
            total = add(total, body.mass)
        return total

    @property
    def planar(self) -> bool:
        """True if a body has planar mass properties only: allowed in a controller's
        model, not in a plant.
        """
        return any(body.planar for body in self.bodies)

    def frame(self, name: str | None = None) -> Frame:
        """Frame by name, by default the end effector; raises VehicleError with the list
        of frames.
        """
        chosen = name or self.end_effector
        for candidate in self.frames:
            if candidate.name == chosen:
                return candidate
        problem = f"no frame '{chosen}'" if chosen else "no end_effector; name a frame"
        raise VehicleError(
            f"vehicle '{self.name}': {problem}; there are"
            f" {[f.name for f in self.frames] or 'none'}"
        )

    @property
    def missing_meshes(self) -> tuple[str, ...]:
        """Notes on meshes that no picture shows: files that are not there, or cannot be
        drawn.
        """
        return tuple(line for line in self.notes if line.endswith(WITHOUT_MESH))

    @property
    def tip_cure(self) -> str:
        """Words that propose an end effector: what files call it, else the only link at
        an end; "" without either.
        """
        frames = [each.name for each in self.frames]
        links = [each.name for each in self.links]
        # a chain: each link on the one before it, so its last link is the only end
        is_chain = [each.parent for each in self.links] == list(
            range(-1, len(links) - 1)
        )
        called = list[str]()
        for ending in TIPS:
            called += [name for name in (*frames, *links) if name.endswith(ending)]
        for name in called or links[-1:] * is_chain:
            frame = (
                ""
                if name in frames
                else f'[[frames]] name = "tip", link = "{name}" and '
            )
            return (
                f'; {frame}end_effector = "{"tip" if frame else name}" in its vehicle'
                " file would be one"
            )
        return ""

    def with_payload(self, mass: Scalar, frame: str | None = None) -> Vehicle:
        """Vehicle with a point mass (kg) attached at a frame (by default the end
        effector).
        """
        return self.with_body(*self.point_mass(mass, frame))

    def point_mass(self, mass: Scalar, frame: str | None = None) -> tuple[int, Body]:
        """Link and body, in that link's axes, of a point mass (kg) at a frame (by
        default the end effector).
        """
        at = self.frame(frame)
        return at.link, Body(mass=mass, com=at.position)

    def load_names(self, inside: Place = ("vehicle",)) -> Names:
        """Parameter paths of point masses added to the vehicle: at the end effector,
        and at each named frame.
        """
        masses = {
            frame.name: {"mass": NumberView(frame.name, LOAD, inside, adds=True)}
            for frame in self.frames
        }
        return (
            # the end effector's own mass comes first and has the short path
            {**masses[self.end_effector], **masses}
            if self.end_effector
            else dict(masses)
        )

    def number_of_view(self, name: str) -> float:
        """Current value (kg) of the point mass that a parameter path adds at a frame:
        always zero.
        """
        return 0.0

    def with_views(self, values: Mapping[str, Scalar]) -> Vehicle:
        """Vehicle with point masses (kg) added at the frames of given names."""
        loaded = self
        for frame, mass in values.items():
            loaded = loaded.with_payload(mass, frame)
        return loaded

    def with_body(self, link: int, load: Body) -> Vehicle:
        """Vehicle with a load merged into the body of a link, follower or ``BASE``, in
        that body's axes.
        """
        if link == BASE:
            return replace(self, base=self.base.merge(load))
        # followers are counted after the links, as in frames and wrenches
        if link >= self.n:
            followers = list(self.followers)
            k = link - self.n
            moved = replace(followers[k].link, body=followers[k].link.body.merge(load))
            followers[k] = replace(followers[k], link=moved)
            return replace(self, followers=tuple(followers))
        links = list(self.links)
        links[link] = replace(links[link], body=links[link].body.merge(load))
        return replace(self, links=tuple(links))

    def with_joints(self, **values: Any) -> Vehicle:
        """Vehicle with fields of every joint replaced, for example
        ``with_joints(damping=0.005)``.
        """
        links = tuple(replace(k, joint=replace(k.joint, **values)) for k in self.links)
        return replace(self, links=links)


def undriven_joints(vehicle: Vehicle, driven: Collection[str] = ()) -> tuple[str, ...]:
    """Names of passive joints: ``effort_limit = 0``, and no drive of the vehicle or in
    ``driven`` moves them.
    """
    driven = {*driven, *(each.name for each in vehicle.drives)}
    return tuple(
        joint.name
        for joint in vehicle.joints
        if joint.name not in driven and float(joint.effort_limit) == 0.0
    )


def _require_whole(value: Vehicle) -> None:
    """Check a vehicle as a whole: unique names, order of links, existing references,
    physical consistency.
    """
    # a batch or a trace is checked where its numbers are known; a planar base has one
    # moment only
    solid = concrete(value.base.mass) and not value.base.planar
    inertia(
        "base.inertia",
        value.base.inertia,
        planar=value.base.planar,
        least=NOISE if solid else 0.0,
    )
    if concrete(value.base.mass) and not value.base.mass > 0.0:
        refuse("base.mass", value.base.mass, "must be greater than 0")
    unique("links.name", [link.name for link in value.moving])
    unique("joints.name", [link.joint.name for link in value.moving])
    unique("rotors.name", [each.name for each in value.rotors])
    frames = [each.name for each in value.frames]
    unique("frames.name", frames)
    for index, link in enumerate(value.links):
        # index order is the order of all recursions from the base to the tips
        if not -1 <= link.parent < index:
            refuse(
                f"links[{link.name}].parent",
                link.parent,
                "must be the base (-1) or a link that stands before it",
            )
        inertia(
            f"links[{link.name}].inertia", link.body.inertia, planar=link.body.planar
        )
        _require_joint(f"joints[{link.joint.name}]", link.joint)
    for index, follower in enumerate(value.followers):
        _require_follower(value, follower, index)
    for each in value.rotors:
        if each.tilt is not None:
            each.tilt.require(f"rotors[{each.name}].tilt", each.axis)
        if each.shield and (len(each.shield) != 2 or each.tilt is not None):
            allowed = (
                "must be two numbers, radius and height, m"
                if each.tilt is None
                else "must be left out of a rotor that tilts"
            )
            refuse(f"rotors[{each.name}].shield", list(each.shield), allowed)
    unique("collisions.name", [each.name for each in value.shapes])
    for frame in (*value.frames, *value.collisions):
        if not -1 <= frame.link < len(value.moving):
            kind = "frames" if type(frame) is Frame else "collisions"
            refuse(
                f"{kind}[{frame.name}].link",
                frame.link,
                f"must be -1 (base) ... {len(value.moving) - 1}",
            )
    if value.end_effector and value.end_effector not in frames:
        allowed = must_be_one_of(frames, value.end_effector)
        refuse(
            "end_effector",
            value.end_effector,
            f"{allowed}{'' if frames else '; [[frames]] makes one'}",
        )
    _require_drives(value)
    # last, because its mass matrix needs a tree that is otherwise sound
    if found := what_does_not_move(value):
        refuse(*found)


def _axes_along(z: Vec3) -> Mat3:
    """Rotation matrix whose third column is a given unit vector.

    Source: Duff et al. 2017, Building an orthonormal basis, revisited.
    """
    side = where(z.z >= 0.0, 1.0, -1.0)
    a = divide(-1.0, side + z.z)
    b = z.x * z.y * a
    return Mat3(
        Vec3(1.0 + side * z.x * z.x * a, b, z.x),
        Vec3(side * b, side + z.y * z.y * a, z.y),
        Vec3(-side * z.x, -z.y, z.z),
    )


def _require_joint(field: str, value: Joint) -> None:
    """Check the kind and limits of one joint."""
    if value.kind not in ("revolute", "prismatic"):
        refuse(f"{field}.kind", value.kind, "must be 'revolute' or 'prismatic'")
    # traced limits cannot be compared
    if concrete(value.lower, value.upper) and not value.lower < value.upper:
        held = (
            f"; [[joints]] hold = {value.upper!r} fixes a joint of another file"
            if value.lower == value.upper
            else ""
        )
        refuse(
            f"{field}.lower",
            value.lower,
            f"must be below upper = {value.upper!r}{held}",
        )


def _require_drives(value: Vehicle) -> None:
    """Check that each drive acts on an existing joint with an effort limit above zero,
    at most one drive per joint.
    """
    joints = value.joint_names
    names = [each.name for each in value.drives]
    for name in names:
        if name not in joints or names.count(name) > 1:
            refuse(
                "drives",
                name,
                f"{must_be_one_of(joints, name)}{', once' * bool(joints)}",
            )
        limit = value.links[joints.index(name)].joint.effort_limit
        # a drive on a joint without effort would never move it, which no one states on
        # purpose
        if concrete(limit) and limit == 0:
            allowed = f"must be above 0: it leaves drives.{name} no torque"
            refuse(f"joints[{name}].effort_limit", limit, allowed)


def _require_follower(value: Vehicle, each: Follower, index: int) -> None:
    """Check a follower: existing leader, earlier parent, and a joint without friction,
    armature or stops.
    """
    field = f"followers[{each.name}]"
    link = each.link
    inertia(f"{field}.link.inertia", link.body.inertia, planar=link.body.planar)
    _require_joint(f"{field}.link.joint", link.joint)
    if not 0 <= each.leader < value.n:
        refuse(
            f"{field}.leader",
            each.leader,
            f"must be the index of a link, 0 ... {value.n - 1}",
        )
    if not -1 <= link.parent < value.n + index:
        refuse(
            f"{field}.link.parent",
            link.parent,
            "must be the base (-1), a link or an earlier follower",
        )
    if concrete(each.ratio) and each.ratio == 0:
        refuse(
            f"{field}.ratio",
            each.ratio,
            "must not be 0; a joint that never moves is fixed",
        )
    # a follower has no coordinate, so these would be lost without a word
    for name in ("damping", "coulomb", "armature", "stop_stiffness"):
        if concrete(getattr(link.joint, name)) and getattr(link.joint, name) != 0:
            refuse(
                f"{field}.link.joint.{name}",
                getattr(link.joint, name),
                "must be 0: its leader has it",
            )


def require_plant(value: Vehicle) -> None:
    """Raise an error if a vehicle has planar bodies, which are allowed in a
    controller's model only.

    Raises:
        VehicleError: with the first planar body.
    """
    names = ["base", *(f"links[{link.name}]" for link in value.moving)]
    for name, each in zip(names, value.bodies, strict=True):
        if each.planar:
            raise VehicleError(
                f"vehicle '{value.name}': {name}.planar = True: must be false in a"
                " plant (a planar inertia is impossible for a real body; such a"
                " vehicle is a controller's model only)"
            )


def body_names(vehicle: Vehicle) -> list[str]:
    """Names of a vehicle's bodies: base, then the links."""
    return [BASE_NAME, *(link.name for link in vehicle.moving)]


def body_index(vehicle: Vehicle, field: str, name: str) -> int:
    """Index of the vehicle's body that a field names: BASE, or that of a link.

    Raises:
        RecordError: the vehicle has no such body.
    """
    names = body_names(vehicle)
    if name not in names:
        # of the record that has the field, not of the vehicle's file
        raise RecordError(f"{field} = {shown(name)}: {must_be_one_of(names, name)}")
    return names.index(name) + BASE
