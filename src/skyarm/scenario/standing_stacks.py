"""Objects that stand on each other at the start, at rest as a whole: each is pressed by what stands on it, too."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.algebra import ZERO3, Quaternion, Vec3
from skyarm.contact.carrier import Meeting
from skyarm.contact.contact import Contact
from skyarm.contact.free_object import ObjectMotion

Array = npt.NDArray[np.float64]

ROUNDS, SMALL, NEAR = 30, 1e-9, 1e-7
"""Newton steps at most, the residual force by the weight at which they end, and differences (m, rad) for them."""

FARTHEST = 0.02
"""m and rad that a stack gives way at most: beyond, it falls, and stays as its objects were set down one by one."""


def stacks_of(contact: Contact) -> list[list[int]]:
    """Groups of two and more standing objects that touch each other, by their numbers."""
    standing = [i for i, each in enumerate(contact.objects) if each.standing]
    group = {i: {i} for i in standing}
    if len(standing) > 1:
        for each in meetings_of(contact)(contact.start(1.0, ()).carried):
            if each.of in group and each.by in group and float(each.touch.depth) > 0.0:
                joined = group[each.of] | group[each.by]
                for i in joined:
                    group[i] = joined
    found = {min(each): sorted(each) for each in group.values() if len(each) > 1}
    return list(found.values())


class Stack:
    """What the supports of some objects leave uncarried, by a height and two small angles of each.

    Args:
        contact: with every object set down.
        indices: of the stack's objects.
        gravity: m/s^2.
    """

    def __init__(self, contact: Contact, indices: Sequence[int], gravity: float) -> None:
        self._contact, self._indices, self._meetings = contact, list(indices), meetings_of(contact)
        self._first: list[ObjectMotion] = list(contact.start(1.0, ()).carried)
        self._weights = [float(contact.objects[i].mass) * gravity for i in indices]

    def balanced(self) -> list[ObjectMotion] | None:
        """Motions of all carriers where forces and moments vanish, by Newton's method; None without one nearby."""
        x = np.zeros(3 * len(self._indices))
        with np.errstate(all="ignore"):
            for _ in range(ROUNDS):
                found = self._residual(x)
                if not np.isfinite(found).all() or np.abs(x).max() > FARTHEST:
                    return None
                if np.abs(found).max() < SMALL:
                    return self._moved(x)
                columns = [(self._residual(x + step) - found) / NEAR for step in NEAR * np.eye(len(x))]
                # a ball may roll: of what nothing holds, nothing changes
                x = x - np.linalg.lstsq(np.stack(columns, axis=1), found, rcond=1e-6)[0]
        return None

    def _moved(self, x: Array) -> list[ObjectMotion]:
        """Every carrier; those of the stack moved by heights and turned about level axes through their centres."""
        found = list(self._first)
        for i, (up, about_x, about_y) in zip(self._indices, x.reshape(-1, 3).tolist(), strict=True):
            turn = Quaternion.of_rotation_vector(Vec3(about_x, about_y, 0.0))
            place = found[i].position + Vec3(0.0, 0.0, up)
            found[i] = replace(found[i], position=place, attitude=turn * found[i].attitude)
        return found

    def _residual(self, x: Array) -> Array:
        """Of each object the vertical force less its weight, and both level moments by its size; shares of all."""
        moved = self._moved(x)
        meetings, rows = self._meetings(moved), list[float]()
        for i, weight in zip(self._indices, self._weights, strict=True):
            force, moment = 0.0, ZERO3
            for each in meetings:
                if i in (each.of, each.by):
                    push = each.touch.axis * (each.touch.normal if each.by == i else -each.touch.normal)
                    force = force + float(push.z)
                    moment = moment + (each.place - moved[i].position).cross(push)
            length = float(max(self._contact.objects[i].size))
            rows += [force - weight, float(moment.x) / length, float(moment.y) / length]
        return np.array(rows) / sum(self._weights)


def meetings_of(contact: Contact) -> Callable[[Sequence[Any]], list[Meeting]]:
    """A function of the carriers' motions: what touches among objects and surfaces, the vehicle being away."""
    memory, carried, step = contact.start(1.0, ()), replace(contact, points=()).carried, contact.largest_step
    clock = (*memory.clock, 0.0)[0]
    upright = (Vec3(0.0, 0.0, 0.0),) * carried.count
    return lambda motions: carried.meetings(motions, (), clock, upright, step)
