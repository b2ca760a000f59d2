"""Arms on an airframe: attach the bodies, joints and frames of one description to a
link or frame of another.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from typing import Any, TypeVar

from skyarm.algebra import ZERO3, Mat3, Scalar, Vec3, axis_rotation
from skyarm.algebra.scalars import add, mul
from skyarm.records.coerce import absent, concrete
from skyarm.records.files import printable
from skyarm.records.immutable import positional
from skyarm.vehicle import description
from skyarm.vehicle.check import NOISE, VehicleError, principal_moments, refuse
from skyarm.vehicle.linkage import BASE, Body, Follower, Joint, Link
from skyarm.vehicle.stated_rotors import StatedRotor
from skyarm.vehicle.vehicle_records import Frame, Vehicle

MIMIC = ("lock", "couple")
"""Treatments of joints that follow others: fixed at rest, or moved with their
leaders."""


@positional
class Mount:
    """Place where an arm is mounted: link or frame of the airframe, pose, and prefix of
    the arm's names.

    Attributes:
        to: "base", the name of the airframe's root, of a link or of a frame.
        rotation, position: pose of the root link in the axes of that one, m.
        prefix: put before every name of the arm.
        field: field of the vehicle file, for messages.
    """

    to: str
    rotation: Mat3
    position: Vec3
    prefix: str = ""
    field: str = "attach"


OF_JOINTS = ("mimics", "drives", "faults", "speeds")
"""Fields of bodies that hold what their joints have."""

FrameOrLook = TypeVar("FrameOrLook", bound=Frame)


def at_origin(link: int = BASE, name: str = "") -> Frame:
    """Frame of a link or the base itself."""
    return Frame(name=name, link=link, position=ZERO3)


def place_in(bodies: RigidBodies, name: str, field: str) -> Frame:
    """Find a named link or frame: index of the body that carries it, and its pose in
    that body.
    """
    names = [link.name for link in bodies.links]
    if name in ("base", bodies.root):
        return at_origin(name=name)
    if name in names:
        return at_origin(names.index(name), name)
    for frame in bodies.frames:
        if frame.name == name:
            return frame
    # "base" twice would confuse, so the airframe's own root name is not listed
    allowed = ["base", *names, *(frame.name for frame in bodies.frames)]
    refuse(field, name, f"must be one of {', '.join(allowed)}")


def posed_in(frame: Frame, R: Mat3, p: Vec3, name: str = "") -> Frame:
    """Frame with a given pose (m) relative to another frame of the same moving body."""
    # rounded again, because products of exact rotations leave entries of 1e-17 that
    # would not fold away
    position = description.vector(frame.position + frame.rotation.apply(p))
    return Frame(
        name=name,
        link=frame.link,
        position=position,
        rotation=description.rotation(frame.rotation @ R),
    )


def moved_into(frame: Frame, posed: FrameOrLook) -> FrameOrLook:
    """A frame or look on the body of a given frame, in whose axes it stood."""
    at = posed_in(frame, posed.rotation, posed.position)
    return replace(posed, link=at.link, position=at.position, rotation=at.rotation)


def attach(airframe: RigidBodies, arm: RigidBodies, mount: Mount) -> RigidBodies:
    """Attach an arm to an airframe; the arm's root link merges with the carrying body
    and remains as a frame.

    Args:
        airframe: airframe with the arms that came before.
        arm: its root has neither a joint nor, in the result, a body of its own.
        mount: place and pose of the arm.

    Raises:
        VehicleError: no such link, or a name that stands in both.
    """
    seat = posed_in(
        place_in(airframe, mount.to, f"{mount.field}.to"),
        mount.rotation,
        mount.position,
    )
    # a pose of the root in its own file counts only where an airframe carries it
    if arm.pose != (Mat3.identity(), ZERO3):
        seat = posed_in(seat, *arm.pose)
    named = _with_prefix(arm, mount.prefix)
    # a root called "base" keeps no frame: that name is the airframe's in the result
    root = [] if named.root == "base" else [replace(seat, name=named.root)]
    _require_new_names(airframe, named, [frame.name for frame in root], mount)
    first = len(airframe.links)

    def move(frame: FrameOrLook) -> FrameOrLook:
        return (
            moved_into(seat, frame)
            if frame.link == BASE
            else replace(frame, link=first + frame.link)
        )

    def mount_link(link: Link) -> Link:
        if link.parent != BASE:
            return replace(link, parent=first + link.parent)
        at = posed_in(seat, link.joint.rotation, link.joint.position)
        return replace(
            link,
            parent=at.link,
            joint=replace(link.joint, position=at.position, rotation=at.rotation),
        )

    load = named.base.transform(seat.rotation, seat.position)
    # only the mass of the root merges; bodies of moving links keep their own axes
    base = airframe.base
    links = list(airframe.links)
    of_joints: dict[str, Any] = {
        word: {**getattr(airframe, word), **getattr(named, word)} for word in OF_JOINTS
    }
    if seat.link == BASE:
        base = description.body([base, load])
    else:
        links[seat.link] = replace(
            links[seat.link], body=description.body([links[seat.link].body, load])
        )
    return replace(
        airframe,
        base=base,
        links=(*links, *map(mount_link, named.links)),
        frames=(*airframe.frames, *root, *map(move, named.frames)),
        notes=(*airframe.notes, *(f"{arm.name}: {note}" for note in arm.notes)),
        looks=(*airframe.looks, *map(move, named.looks)),
        **of_joints,
    )


def bodies_of(vehicle: Vehicle) -> RigidBodies:
    """Bodies, joints and frames of a vehicle without its rotors; followers are listed
    as mimic joints.
    """
    leaders = vehicle.joint_names
    mimics = {
        each.link.joint.name: Mimic(
            leaders[each.leader], float(each.ratio), float(each.offset)
        )
        for each in vehicle.followers
    }
    return RigidBodies(
        vehicle.name,
        "base",
        vehicle.base,
        vehicle.moving,
        vehicle.frames,
        mimics,
        vehicle.notes,
        (*vehicle.looks, *vehicle.collisions),
    )


def _with_prefix(arm: RigidBodies, prefix: str) -> RigidBodies:
    """Arm whose links, joints and frames have a prefix before their names."""
    if not prefix:
        return arm

    def rename(part: Any) -> Any:
        return replace(part, name=prefix + part.name)

    own: dict[str, Any] = {
        word: {prefix + name: each for name, each in getattr(arm, word).items()}
        for word in OF_JOINTS
    }
    own["mimics"] = {
        name: replace(each, joint=prefix + each.joint)
        for name, each in own["mimics"].items()
    }
    own["faults"] = {
        f"{prefix}: {k}": frozenset(prefix + name for name in v)
        for k, v in arm.faults.items()
    }
    links = tuple(replace(rename(link), joint=rename(link.joint)) for link in arm.links)
    frames, looks = tuple(map(rename, arm.frames)), tuple(map(rename, arm.looks))
    return replace(
        arm, root=prefix + arm.root, links=links, frames=frames, looks=looks, **own
    )


def _require_new_names(
    airframe: RigidBodies, arm: RigidBodies, root: list[str], mount: Mount
) -> None:
    """Raise an error if links, frames or joints of an arm have names that the airframe
    uses.
    """
    taken = {
        "base",
        airframe.root,
        *(link.name for link in airframe.links),
        *(f.name for f in airframe.frames),
    }
    joints = {link.joint.name for link in airframe.links}
    doubles = [("link", link.name) for link in arm.links if link.name in taken]
    doubles += [
        ("frame", name)
        for name in (*root, *(f.name for f in arm.frames))
        # every description calls its base "base", so that name is no clash
        if name in taken - {"base"}
    ]
    doubles += [
        ("joint", link.joint.name) for link in arm.links if link.joint.name in joints
    ]
    if doubles:
        kind, name = doubles[0]
        refuse(
            f"{mount.field}.prefix",
            mount.prefix,
            f"must tell the arm's {kind} '{name}' from the airframe's of that name",
        )


PLAIN = ("damping", "coulomb", "armature", "stop_stiffness", "stop_damping")


@positional
class Mimic:
    """Joint that follows another joint, as in URDF files: q = ratio q_leader + offset.

    Attributes:
        joint: name of the joint that it follows, which may follow another one.
        ratio, offset: rad or m.
    """

    joint: str
    ratio: float = 1.0
    offset: float = 0.0

    def at_rest(self, lower: float = 0.0, upper: float = 0.0) -> float:
        """Value of a following joint while its leader is at zero, or at the limit
        nearest to zero.
        """
        # a leader rests at zero, or as near to it as its limits allow
        return self.ratio * min(max(0.0, lower), upper) + self.offset


def held_pose(kind: str, axis: Vec3, value: float) -> tuple[Mat3, Vec3]:
    """Pose of a child link in the frame of its joint at a constant joint value (rad or
    m).
    """
    return (
        (axis_rotation(axis, value), ZERO3)
        if kind == "revolute"
        else (Mat3.identity(), axis * value)
    )


def couple(
    links: Sequence[Link], frames: Sequence[Frame], mimics: Mapping[str, Mimic]
) -> tuple[tuple[Link, ...], tuple[Follower, ...], tuple[Frame, ...]]:
    """Separate followers (links with coupled joints) from independent links; frames get
    the new link indices.

    Damping and armature of a follower's joint act at its leader, by the square of the
    ratio; its dry friction by the ratio, at the leader's own rate. Its limits narrow
    those of its leader; where they would leave it no range, as in files whose limits
    forget a sign, the leader keeps its own (:func:`limits_that_contradict`).

    Args:
        links: links, parents before children.
        frames: fixed to them.
        mimics: name of a joint -> relation to its leader.

    Raises:
        VehicleError: a joint that is not there, a ring, or a link with a joint of its
            own on a follower.
    """
    if not mimics:
        return tuple(links), (), tuple(frames)
    # chains are resolved first, so that each follower has an independent joint as its
    # leader
    whole = {
        link.joint.name: resolve(link.joint.name, mimics, links)
        for link in links
        if link.joint.name in mimics
    }
    free = [i for i, link in enumerate(links) if link.joint.name not in whole]
    tied = [i for i, link in enumerate(links) if link.joint.name in whole]
    # followers come after all links, as their indices in a vehicle do
    place = {old: new for new, old in enumerate([*free, *tied])} | {-1: -1}
    joints = {links[i].joint.name: links[i].joint for i in free}
    followers = []
    for i in tied:
        mimic = whole[links[i].joint.name]
        joint = links[i].joint
        joints[mimic.joint] = _narrow_range(
            # friction first: the range is narrowed on the joint that already carries it
            _with_friction(joints[mimic.joint], joint, mimic.ratio),
            joint,
            mimic,
        )
        # an int of 0 is structure: the follower's joint adds no term to compiled code
        nothing: dict[str, Any] = dict.fromkeys(PLAIN, 0)
        plain = replace(joint, **nothing)
        link = replace(links[i], parent=place[links[i].parent], joint=plain)
        followers.append(
            Follower(
                link=link,
                leader=[*joints].index(mimic.joint),
                ratio=mimic.ratio,
                offset=description.zero_is_structure(mimic.offset),
            )
        )
    independent = []
    for i in free:
        # a link's parent must be independent, because followers are placed after the
        # links
        if place[links[i].parent] >= len(free):
            name = links[links[i].parent].name
            refuse(
                f"joint[{links[i].joint.name}].parent",
                name,
                "must not follow another joint; lock it instead",
            )
        independent.append(
            replace(
                links[i],
                parent=place[links[i].parent],
                joint=joints[links[i].joint.name],
            )
        )
    moved = tuple(replace(frame, link=place[frame.link]) for frame in frames)
    return tuple(independent), tuple(followers), moved


def follow(name: str, mimics: Mapping[str, Mimic]) -> Mimic:
    """Last leader in a chain of mimic joints, with the total ratio and offset.

    Raises:
        VehicleError: the chain is a ring.
    """
    passed = [name]
    ratio = 1.0
    offset = 0.0
    while (mimic := mimics.get(passed[-1])) is not None:
        # offset before the new ratio: q = ratio (ratio' q' + offset') + offset
        ratio, offset = ratio * mimic.ratio, offset + ratio * mimic.offset
        if mimic.joint in passed:
            refuse(
                f"joint[{name}].mimic.joint",
                mimic.joint,
                f"must not lead back ({' -> '.join([*passed, mimic.joint])})",
            )
        passed.append(mimic.joint)
    return Mimic(passed[-1], ratio, offset)


def resolve(name: str, mimics: Mapping[str, Mimic], links: Sequence[Link]) -> Mimic:
    """Leader at the end of a mimic joint's chain of mimics; raises an error if the
    leader is not a moving joint.
    """
    joints = [link.joint.name for link in links]
    leader = follow(name, mimics)
    if leader.joint not in joints:
        last = next(each for each in mimics if mimics[each].joint == leader.joint)
        refuse(
            f"joint[{last}].mimic.joint",
            leader.joint,
            f"must be one of {', '.join(joints)}",
        )
    if leader.ratio == 0.0:
        refuse(
            f"joint[{name}].mimic.ratio",
            leader.ratio,
            "must not be 0; a joint that never moves is fixed",
        )
    return leader


def _with_friction(leader: Joint, follower: Joint, ratio: float) -> Joint:
    """Leader joint to which a follower's friction and armature are added."""
    values: dict[str, Any] = {}
    for name, by in (
        # power at equal rates: torque times ratio at the leader, rate times ratio,
        # hence the square
        ("damping", ratio * ratio),
        ("armature", ratio * ratio),
        ("coulomb", abs(ratio)),
    ):
        more = getattr(follower, name)
        if not absent(more):
            values[name] = add(getattr(leader, name), mul(by, more))
    return replace(leader, **values) if values else leader


def _range_of_leader(
    leader: Joint, follower: Joint, ratio: Scalar, offset: Scalar
) -> tuple[Scalar, Scalar] | None:
    """Range of a leader joint that satisfies the limits of leader and follower; None if
    the range is empty.
    """
    # traced numbers cannot be compared, so the leader keeps its limits
    if not concrete(
        leader.lower, leader.upper, follower.lower, follower.upper, ratio, offset
    ):
        return leader.lower, leader.upper
    # a negative ratio swaps the two ends
    first, last = sorted(
        ((follower.lower - offset) / ratio, (follower.upper - offset) / ratio)
    )
    low, high = max(leader.lower, first), min(leader.upper, last)
    # an empty range is a mistake of the file, which must not lock the leader
    return (low, high) if low < high else None


def _narrow_range(leader: Joint, follower: Joint, mimic: Mimic) -> Joint:
    limits = _range_of_leader(leader, follower, mimic.ratio, mimic.offset)
    if limits is None or limits == (leader.lower, leader.upper):
        return leader
    return replace(leader, lower=limits[0], upper=limits[1])


def limits_that_contradict(
    links: Sequence[Link], followers: Sequence[Follower]
) -> tuple[str, ...]:
    """Notes on followers whose joint limits contradict those of their leader joints and
    are therefore ignored.
    """
    notes = Notes()
    for each in followers:
        if (
            _range_of_leader(
                links[each.leader].joint, each.link.joint, each.ratio, each.offset
            )
            is None
        ):
            notes.add(
                "has limits that leave the joint it follows no range; they do not"
                " count",
                each.link.joint.name,
            )
    return notes.lines()


@positional
class RigidBodies:
    """Bodies, joints and frames of a vehicle without rotors.

    Attributes:
        name: name of the vehicle.
        root: name of the root link, the base.
        base, links: bodies and joints, in an order in which every parent precedes its
            children.
        frames: one for each link that a fixed joint merged into another.
        mimics: name of a joint that follows another one -> relation to its leader; no
            joint does if empty.
        notes: elements that its reader left out or read in another way, a line each.
        looks: meshes of its links, and shapes that touch.
        rotors: rotors that its file states.
        drives: servos that its file states: joint -> table as ``[drives.JOINT]`` of a
            vehicle file has it.
        pose: rotation and position (m) of the root in its file, which it keeps where an
            airframe carries it.
        faults: error about what the file holds -> joints that make it harmless if all
            are held.
        speeds: name of a joint -> largest rate that its file states, rad/s or m/s; 0
            for none.
    """

    name: str
    root: str
    base: Body
    links: tuple[Link, ...]
    frames: tuple[Frame, ...]
    mimics: Mapping[str, Mimic] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    looks: tuple[Frame, ...] = ()
    rotors: tuple[StatedRotor, ...] = ()
    speeds: Mapping[str, float] = field(default_factory=dict)
    drives: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    pose: tuple[Mat3, Vec3] = (Mat3.identity(), ZERO3)
    faults: Mapping[str, frozenset[str]] = field(default_factory=dict)

    def require_no_faults(self) -> None:
        """Raise an error for the first fault, with the joints that make all of them
        harmless if they are held.

        Raises:
            VehicleError: one line with field, value, what is allowed and the cure.
        """
        # the first fault is shown, with the joints of all: one edit cures the file
        for fault in self.faults:
            names = sorted(
                {
                    # a follower is held through its leader, so the leader's name is
                    # what the user needs
                    follow(each, self.mimics).joint
                    for joints in self.faults.values()
                    for each in joints
                }
            )
            hold = (
                f'[[joints]] name = "{names[0]}", hold = 0.0'
                + f", and so {', '.join(names[1:])}" * (len(names) > 1)
            )
            raise VehicleError(
                f"{fault}; or hold the joints on which such parts act: {hold}"
            )

    def require_airframe(self) -> None:
        """Raise an error for the root of another program's file that is no airframe: it
        lacks mass or inertia.

        Raises:
            VehicleError: one line with field, value, what is allowed and the cure.
        """
        # negative moments pass here: the check of the inertia itself has the better
        # message
        mass = float(self.base.mass)
        least = principal_moments(self.base.inertia)[0]
        if mass == 0.0 or 0.0 <= least < NOISE:
            field, value, lacks = (
                ("mass", mass, "weighs nothing")
                if mass == 0.0
                else ("inertia", least, "has no inertia")
            )
            cure = (
                f"its root '{self.root}' {lacks}, and an airframe can carry it by"
                " [[attach]]"
            )
            refuse(f"base.{field}", value, f"must be greater than 0; {cure}")


SHOWN = 4
"""Number of names in a note."""


class Notes:
    """Notes on a vehicle file that is read; elements with equal notes share one line:
    ``joints a, b: TEXT``.
    """

    def __init__(self) -> None:
        self._names: dict[tuple[str, str], list[str]] = {}

    def add(self, text: str, name: str = "", kind: str = "joint") -> None:
        """Add a note about one named element, such as a joint, or about the whole
        file.
        """
        names = self._names.setdefault((kind, text), [])
        if name and name not in names:
            names.append(name)

    def lines(self) -> tuple[str, ...]:
        """All notes on the vehicle file, each as one line of text."""
        return tuple(
            _line(kind, text, names) for (kind, text), names in self._names.items()
        )


def _line(kind: str, text: str, names: list[str]) -> str:
    """Text of one note, with the first few names of its elements."""
    if not names:
        return printable(text)
    listed = ", ".join(names[:SHOWN]) + (
        f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    )
    many = f"{kind[:-1]}ies" if kind.endswith("y") else f"{kind}s"
    return printable(f"{many if len(names) > 1 else kind} {listed}: {text}")


class BodyTree:
    """Tree of rigid bodies under construction, parents before children.

    Attributes:
        links, frames, looks: read so far. parts: bodies of the base and of each link.
        mimics: joints that follow others. notes: notes of the reader.
    """

    def __init__(self, mimics: Mapping[str, Mimic], notes: Notes) -> None:
        self.links: list[Link] = []
        self.frames: list[Frame] = []
        self.looks: list[Frame] = []
        self.parts: list[list[Body]] = [[]]
        self.mimics = mimics
        self.notes = notes

    def add_link(self, name: str, parent: int, joint: Joint) -> Frame:
        """Add a link with its joint to the body ``parent``; returns the link's
        frame.
        """
        self.links.append(
            Link(name=name, parent=parent, joint=joint, body=Body(mass=0))
        )
        self.parts.append([])
        return at_origin(len(self.links) - 1)

    def add_body(self, seat: Frame, body: Body) -> None:
        """Add a mass, in the axes of a frame, to the link or base that carries it; a
        frame without a name is the link's own.
        """
        self.parts[seat.link + 1].append(
            # a body in its link's own axes is not transformed, which keeps its numbers
            # exact
            body.transform(seat.rotation, seat.position) if seat.name else body
        )

    def bodies(self, name: str, root: str, coupled: bool) -> RigidBodies:
        """Completed tree of bodies; ``coupled`` keeps mimic joints as moving
        followers.
        """
        base, *bodies = (
            description.body(each) if each else Body(mass=0.0) for each in self.parts
        )
        links = tuple(
            replace(link, body=body)
            for link, body in zip(self.links, bodies, strict=True)
        )
        # joints that are locked became frames, and only moving ones may follow
        moving = {link.joint.name for link in links} if coupled else ()
        return RigidBodies(
            name=name,
            root=root,
            base=base,
            links=links,
            frames=tuple(self.frames),
            mimics={
                joint: mimic for joint, mimic in self.mimics.items() if joint in moving
            },
            notes=self.notes.lines(),
            looks=tuple(self.looks),
        )


def with_pose(
    bodies: RigidBodies, pose: tuple[Mat3, Vec3], notes: Notes
) -> RigidBodies:
    """Bodies with the pose of their root in its file, and with their notes, one more
    for a pose beside the origin.

    Args:
        bodies: those of a file.
        pose: rotation and position, m.
        notes: notes of its reader.
    """
    if pose != (Mat3.identity(), ZERO3):
        why = (
            "moved or turned in its file, a pose that it keeps where [[attach]] names"
            " this file, and not elsewhere"
        )
        notes.add(why, bodies.root, "body")
    return replace(bodies, pose=pose, notes=notes.lines())
