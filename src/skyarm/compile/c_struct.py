"""C structs of records: one member a field, vectors and tuples of scalars as arrays, units as comments.

The leaves of a record come in the order of :func:`skyarm.compile.records.leaves`.
"""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

from skyarm.algebra import Mat3, Quaternion, Sym3, Vec3
from skyarm.compile.c_source import Floats

VECTORS = (Vec3, Quaternion, Sym3, Mat3)
STRUCTURE = (int, str, bool, type(None), Enum)

Place = tuple[str | int, ...]


@dataclass(frozen=True, slots=True)
class Field:
    """A field of a record that holds scalars.

    Attributes:
        path: where it stands, for example ("links", 0, "body", "mass").
        owner: "Class.field", the key of its unit.
        shape: () for a scalar, (3,) for a vector, (4, 4) for rows. entries: (place, value) of all, structural ones too.
    """

    path: Place
    owner: str
    shape: tuple[int, ...]
    entries: tuple[tuple[Place, Any], ...]


@dataclass(frozen=True, slots=True)
class Member:
    """A member of a struct: name, array sizes, comment, values."""

    name: str
    shape: tuple[int, ...]
    note: str
    values: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Struct:
    """Members, and for each leaf of the record its member's C name (None: the struct does not have it)."""

    members: tuple[Member, ...]
    places: tuple[str | None, ...]


def is_leaf(value: Any) -> bool:
    """True for a scalar that may vary; False for structure."""
    return not isinstance(value, STRUCTURE)


def fields(record: Any, path: Place = (), owner: str = "value") -> Iterator[Field]:
    """Fields of a record that hold scalars, in the order of its leaves."""
    if isinstance(record, VECTORS) or _grid(record):
        entries = tuple(_entries(record, ()))
        yield Field(path, owner, _shape(record), entries)
    elif dataclasses.is_dataclass(record):
        for field in dataclasses.fields(record):
            yield from fields(getattr(record, field.name), (*path, field.name), f"{type(record).__name__}.{field.name}")
    elif isinstance(record, tuple):
        for index, item in enumerate(record):
            yield from fields(item, (*path, index), owner)
    elif is_leaf(record):
        yield Field(path, owner, (), (((), record),))


def _grid(value: Any) -> bool:
    """A tuple of scalars, or of equally long tuples of scalars."""
    if not isinstance(value, tuple) or not value:
        return False
    rows = [item if isinstance(item, tuple) else (item,) for item in value]
    plain = all(isinstance(x, (float, int)) and not isinstance(x, bool) for row in rows for x in row)
    return plain and len({len(row) for row in rows}) == 1 and len({isinstance(item, tuple) for item in value}) == 1


def _shape(value: Any) -> tuple[int, ...]:
    if isinstance(value, tuple):
        return (len(value), len(value[0])) if isinstance(value[0], tuple) else (len(value),)
    return (3, 3) if isinstance(value, Mat3) else (len(dataclasses.fields(value)),)


def _entries(value: Any, place: Place) -> Iterator[tuple[Place, Any]]:
    if isinstance(value, tuple):
        for index, item in enumerate(value):
            yield from _entries(item, (*place, index))
    elif isinstance(value, VECTORS):
        for field in dataclasses.fields(value):
            yield from _entries(getattr(value, field.name), (*place, field.name))
    else:
        yield place, value


def make_struct(record: Any, notes: Mapping[str, str], name: Callable[[Place], str], keep: Sequence[bool]) -> Struct:
    """Struct of a record.

    Args:
        record: its leaves give the values.
        notes: comment by "Class.field".
        name: a member's name from a path.
        keep: whether each leaf is wanted; a vector that is not wanted as a whole, or holds structure,
            falls into members of its own.

    Raises:
        ValueError: two fields get one name.
    """
    members: list[Member] = []
    places: list[str | None] = []
    for field in fields(record):
        leaves = [(place, value) for place, value in field.entries if is_leaf(value)]
        wanted = [keep[len(places) + i] for i in range(len(leaves))]
        note = notes.get(field.owner, "")
        if len(leaves) == len(field.entries) and all(wanted):
            own = name(field.path)
            members.append(Member(own, field.shape, note, tuple(float(value) for _, value in leaves)))
            places += [own + index for index in _indices(field.shape)]
            continue
        for (place, value), kept in zip(leaves, wanted, strict=True):
            own = name((*field.path, *place))
            places.append(own if kept else None)
            if kept:
                members.append(Member(own, (), note, (float(value),)))
    repeated = {member.name for member in members if sum(other.name == member.name for other in members) > 1}
    if repeated:
        raise ValueError(f"struct: fields share the names {sorted(repeated)}")
    return Struct(tuple(members), tuple(places))


def _indices(shape: tuple[int, ...]) -> list[str]:
    texts = [""]
    for size in shape:
        texts = [f"{text}[{i}]" for text in texts for i in range(size)]
    return texts


def declaration(name: str, struct: Struct, floats: Floats) -> str:
    """``struct name { ... };``; C99 knows no empty struct, so one without members gets a reserved one."""
    members = struct.members or (Member("reserved", (), "not used: C99 knows no empty struct", (0.0,)),)
    lines = [f"struct {name} {{"]
    for member in members:
        sizes = "".join(f"[{size}]" for size in member.shape)
        note = f" /* {comment(member.note)} */" if member.note else ""
        lines.append(f"    {floats.kind} {member.name}{sizes};{note}")
    return "\n".join([*lines, "};"])


def initialiser(struct: Struct, floats: Floats) -> str:
    """``{ ... }`` with the record's values, one member a line."""
    if not struct.members:
        return f"{{{floats.literal(0.0)}}}"
    lines = [
        f"    {_braced(list(member.values), member.shape, floats)}, /* {member.name} */" for member in struct.members
    ]
    return "\n".join(["{", *lines, "}"])


def _braced(values: list[float], shape: tuple[int, ...], floats: Floats) -> str:
    if not shape:
        return floats.literal(values[0])
    step = math.prod(shape[1:])
    parts = [_braced(values[i * step : (i + 1) * step], shape[1:], floats) for i in range(shape[0])]
    return f"{{{', '.join(parts)}}}"


def comment(text: str) -> str:
    """Text that can stand in a C comment: one line of plain characters, none that ends or opens one."""
    plain = re.sub(r"[^ -~]|[?\\]", "_", " ".join(text.split()))
    return re.sub(r"\*(?=/)|/(?=\*)", "_", plain)
