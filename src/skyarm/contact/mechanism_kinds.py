"""Words for mechanisms: how a door, a valve, a drawer and a button move, and what of them can be touched."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from skyarm.algebra import E_X, E_Z, ZERO3, Vec3


@dataclass(frozen=True, kw_only=True, slots=True)
class Kind:
    """A kind of mechanism.

    Attributes:
        turns: whether it is a hinge; else it slides.
        axis: of the motion, its own axes; None where the file says it.
        sizes: what the lengths of its body may be; () for a kind whose body is made of parts.
    """

    turns: bool
    axis: Vec3 | None = None
    sizes: tuple[tuple[str, ...], ...] = ()


KINDS = {
    "hinge": Kind(turns=True),
    "slide": Kind(turns=False),
    "door": Kind(turns=True, axis=E_Z, sizes=(("width", "height", "thickness"),)),
    "valve": Kind(turns=True, axis=E_Z, sizes=(("radius", "thickness"), ("length", "width", "thickness"))),
    "drawer": Kind(turns=False, axis=E_X, sizes=(("depth", "width", "height"),)),
    "button": Kind(turns=False, axis=-E_Z, sizes=(("radius", "height"),)),
}
"""Word -> how it moves. A valve of two lengths is a wheel, one of three a lever."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Solid:
    """What of a mechanism can be touched, in its own axes, whose origin is on the hinge or in the front's middle.

    Attributes:
        shape, size: as of a surface. middle: of it, m.
        gyration: m^2, moment of inertia about the axis of a hinge by the mass, of a uniform body.
    """

    shape: str
    size: tuple[Any, ...]
    middle: Vec3
    gyration: Any


def solid_of(kind: str, size: Sequence[Any]) -> Solid:
    """The body of a door, valve, drawer or button.

    Args:
        kind: the word.
        size: as many lengths as ``KINDS`` says of it, m.
    """
    if kind == "button":
        radius, height = size
        return Solid(shape="cylinder", size=(radius, height), middle=Vec3(0, 0, -0.5 * height), gyration=0.0)
    if kind == "valve" and len(size) == 2:
        radius, thickness = size
        wheel = (radius, thickness)
        return Solid(shape="cylinder", size=wheel, middle=ZERO3, gyration=0.5 * radius * radius)
    if kind == "drawer":
        depth, width, height = size
        return Solid(shape="box", size=(depth, width, height), middle=Vec3(-0.5 * depth, 0, 0), gyration=0.0)
    length, second, third = size
    across, along = (third, second) if kind == "door" else (second, third)
    return Solid(
        shape="box",
        size=(length, across, along),
        middle=Vec3(0.5 * length, 0, 0),
        gyration=length * length / 3.0 + across * across / 12.0,
    )
