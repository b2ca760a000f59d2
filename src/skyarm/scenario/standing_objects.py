"""Objects of a world that lie at rest on what is below them: how deep, and how tilted, their weight presses them.

Each object that is said to be standing is set down in turn, the lowest first, as if those that are higher were not
there yet: from its position, or from just above it where that is inside of something. Those that then stand on each
other settle as a whole. A flight that begins so does not jump.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from skyarm.algebra import ZERO3, Quaternion, Vec3
from skyarm.contact.carrier import Meeting
from skyarm.contact.contact import Contact
from skyarm.contact.free_object import FreeObject, ObjectMotion
from skyarm.files import shown
from skyarm.scenario.standing_stacks import Stack, meetings_of, stacks_of

Array = npt.NDArray[np.float64]

LOWEST, LIFT, FINEST = 3.0, 0.002, 1e-4
"""m: how far an object is lowered at most, out of how deep inside of something it is taken, smallest way down."""

DEEPER = 0.1
"""Share of its depth by which an object is pressed deeper at a time, once that is more than ``FINEST``."""

ROUNDS, SMALL = 20, 1e-9
"""Newton steps at most, and the residual force by the weight at which they end."""

NEAR = 1e-7
"""Difference by which the stiffness is found, m and rad."""


def with_standing_objects(contact: Contact, gravity: float) -> Contact:
    """The contact with every object that is standing where it lies at rest.

    Args:
        contact: as read.
        gravity: m/s^2.

    Raises:
        ValueError: one line: nothing carries the object there, it starts inside of something, or it tips over.
    """
    standing = [i for i, each in enumerate(contact.objects) if each.standing]
    if standing and not gravity > 0.0:
        raise ValueError(
            f"{_where(standing[0])} = true: must be false where plant.gravity leaves no weight to stand with"
        )
    waiting = sorted(standing, key=lambda i: float(contact.objects[i].position.z))
    while waiting:
        i = waiting.pop(0)
        contact = _Rest(contact, i, gravity, waiting).set_down()
    return _with_stacks(contact, gravity)


def _with_stacks(contact: Contact, gravity: float) -> Contact:
    """The contact whose objects that stand on each other are at rest as a whole."""
    for stack in stacks_of(contact):
        motions = Stack(contact, stack, gravity).balanced()
        if motions is not None:
            settled = [_placed(each, motions[i]) if i in stack else each for i, each in enumerate(contact.objects)]
            contact = replace(contact, objects=tuple(settled))
    return contact


def _where(index: int) -> str:
    return f"world.objects[{index}].standing"


class _Rest:
    """What the supports of one object leave uncarried, by its height and two small angles."""

    def __init__(self, contact: Contact, index: int, gravity: float, away: Sequence[int]) -> None:
        self._contact, self._index, self._object = contact, index, contact.objects[index]
        self._away = frozenset(away)
        self._memory, self._all = contact.start(1.0, ()), meetings_of(contact)
        self._first: ObjectMotion = self._memory.carried[index]
        self._weight = float(self._object.mass) * gravity
        size, shape = self._object.size, self._object.shape
        self._half = min(float(each) * (1.0 if shape == "sphere" or (shape, i) == ("cylinder", 0) else 0.5)
                         for i, each in enumerate(size))  # fmt: skip

    def set_down(self) -> Contact:
        """The contact with the object at rest.

        Raises:
            ValueError: one line.
        """
        object_, lowered = self._object, np.zeros(3)
        if np.abs(self._residual(lowered)).max() < SMALL:
            return self._contact
        if self._gap(lowered) < 0.0:
            lowered[0] = LIFT
        if self._gap(lowered) < 0.0:
            raise ValueError(
                f"{_where(self._index)} = true: object {object_.name!r} must begin outside of what carries it"
            )
        carried = 0.0
        while self._residual(lowered)[0] < 0.0:
            gap = self._gap(lowered)
            borne = self._borne(lowered) if gap < 0.0 else 0.0
            if borne < carried or (borne > 0.0 and -gap > self._half):
                self._refuse_mass(max(borne, carried))
            carried = borne
            lowered[0] -= max(gap, FINEST, DEEPER * -gap)
            if lowered[0] < -LOWEST:
                place = shown([float(c) for c in object_.position])
                below = f"nothing carries object {object_.name!r} within {LOWEST:g} m below {place} m"
                raise ValueError(f"{_where(self._index)} = true: must be above a surface; {below}")
        settled = self._balanced(lowered)
        if settled is None:
            raise ValueError(
                f"{_where(self._index)} = true: object {object_.name!r} must lie with its centre of mass above what "
                "carries it; it tips over"
            )
        objects = list(self._contact.objects)
        objects[self._index] = settled
        return replace(self._contact, objects=tuple(objects))

    def _refuse_mass(self, force: float) -> None:
        """Refuse a mass of which what is below carries that force (N) at most, until it is half inside or through."""
        mass = float(self._object.mass)
        borne = f"about {force * (mass / self._weight):.2g} kg or less"
        raise ValueError(
            f"world.objects[{self._index}].mass = {shown(mass)}: must be {borne}, or the stiffness larger; its weight "
            f"presses object {self._object.name!r} through what it stands on"
        )

    def _balanced(self, x: Array) -> FreeObject | None:
        """The object where forces and moments vanish, by Newton's method; None where it does not end nearby."""
        first = x
        with np.errstate(all="ignore"):  # of numbers beyond measure
            for _ in range(ROUNDS):
                found = self._residual(x)
                if np.abs(found).max() < SMALL:
                    return _placed(self._object, self._motion(x)) if np.abs(x - first).max() < 0.1 else None
                columns = [(self._residual(x + step) - found) / NEAR for step in NEAR * np.eye(3)]
                # a ball may roll: of what nothing holds, nothing changes
                x = x - np.linalg.lstsq(np.stack(columns, axis=1), found, rcond=1e-6)[0]
        return None

    def _motion(self, x: Array) -> ObjectMotion:
        """The object moved by a height (m) and turned about the level axes (rad), about its centre of mass."""
        up, about_x, about_y = (float(each) for each in x)
        turn = Quaternion.of_rotation_vector(Vec3(about_x, about_y, 0.0))
        first = self._first
        return replace(first, position=first.position + Vec3(0.0, 0.0, up), attitude=turn * first.attitude)

    def _meetings(self, x: Array) -> tuple[Meeting, ...]:
        """What touches the object, but for the vehicle and what is set down later."""
        carried = list(self._memory.carried)
        carried[self._index] = self._motion(x)
        pairs = ((each, {each.of, each.by}) for each in self._all(carried))
        return tuple(each for each, pair in pairs if self._index in pair and not pair & self._away)

    def _gap(self, x: Array) -> float:
        """m to the nearest thing."""
        return -max((float(each.touch.depth) for each in self._meetings(x)), default=-LOWEST)

    def _residual(self, x: Array) -> Array:
        """Vertical force less the weight, and both level moments about the centre of mass by its size."""
        middle, force, moment = self._motion(x).position, 0.0, ZERO3
        for each in self._meetings(x):
            push = each.touch.axis * (each.touch.normal if each.by == self._index else -each.touch.normal)
            force, moment = force + float(push.z), moment + (each.place - middle).cross(push)
        length = float(max(self._object.size))
        values = (force - self._weight, float(moment.x) / length, float(moment.y) / length)
        return np.array(values) / self._weight

    def _borne(self, x: Array) -> float:
        """Vertical force of what touches the object, N."""
        pushes = (each.touch.axis.z * (each.touch.normal if each.by == self._index else -each.touch.normal)
                  for each in self._meetings(x))  # fmt: skip
        return float(sum(pushes))


def _placed(of: FreeObject, memory: ObjectMotion) -> FreeObject:
    """The object with position and angles of a motion."""
    frame = of.frame(memory)
    (_, _, _), (r10, _, _), (r20, r21, r22) = ((float(c) for c in row) for row in frame.rotation.rows)
    r00 = float(frame.rotation.rows[0].x)
    angles = (np.arctan2(r21, r22), -np.arcsin(np.clip(r20, -1.0, 1.0)), np.arctan2(r10, r00))
    return replace(
        of,
        position=Vec3(*(float(c) for c in frame.position)),
        angles=Vec3(*(float(c) for c in angles)),
    )
