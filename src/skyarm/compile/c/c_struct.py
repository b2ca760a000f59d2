"""C structs of records: one member a field, vectors and tuples of scalars as arrays, units as comments.

The leaves of a record come in the order of :func:`skyarm.records.leaves.leaves`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from skyarm.algebra import Mat3, Quaternion, Sym3, Vec3
from skyarm.compile.c.c_source import Floats
from skyarm.records.leaves import Place, is_leaf, is_record, parts, walk
from skyarm.records.units import Unit, units

VECTORS = (Vec3, Quaternion, Sym3, Mat3)

Units = Mapping[Place, Mapping[str, Unit]]
"""Units of the fields of the records at some places."""


@dataclass(frozen=True, slots=True)
class Field:
    """A field of a record that holds scalars.

    Attributes:
        path: where it stands, for example ("links", "0", "body", "mass").
        note: unit and meaning of its numbers.
        shape: () for a scalar, (3,) for a vector, (4, 4) for rows. entries: (place, value) of all, structural ones too.
    """

    path: Place
    note: str
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


def fields(record: Any, others: Units = MappingProxyType({}), path: Place = (), note: str = "") -> Iterator[Field]:
    """Fields of a record that hold scalars, in the order of its leaves."""
    if isinstance(record, VECTORS) or _grid(record):
        yield Field(path, note, _shape(record), tuple(walk(record)))
    elif isinstance(record, tuple) or is_record(record):
        said = others.get(path) or (units(type(record)) if is_record(record) else {})
        for name, value in parts(record).items():
            own = note if isinstance(record, tuple) else said[name].words if name in said else ""
            yield from fields(value, others, (*path, name), own)
    elif is_leaf(record):
        yield Field(path, note, (), (((), record),))


def _grid(value: Any) -> bool:
    """A tuple of scalars, or of equally long tuples of scalars; structure among them is sorted out by the caller."""
    if not isinstance(value, tuple):
        return False
    rows = [item if isinstance(item, tuple) else (item,) for item in value]
    plain = all(isinstance(x, (float, int)) for row in rows for x in row)
    return plain and len({len(row) for row in rows}) == 1 and len({isinstance(item, tuple) for item in value}) == 1


def _shape(value: Any) -> tuple[int, ...]:
    if isinstance(value, tuple):
        return (len(value), len(value[0])) if isinstance(value[0], tuple) else (len(value),)
    return (3, 3) if isinstance(value, Mat3) else (len(parts(value)),)


def make_struct(
    record: Any, name: Callable[[Place], str], keep: Sequence[bool], others: Units = MappingProxyType({})
) -> Struct:
    """Struct of a record; comments are what its fields say of their units.

    Args:
        record: its leaves give the values.
        name: a member's name from a path.
        keep: whether each leaf is wanted; a vector that is not wanted as a whole, or holds structure,
            falls into members of its own.
        others: units of records, by place, whose fields mean something else there than they say.

    Raises:
        ValueError: two fields get one name.
    """
    members: list[Member] = []
    places: list[str | None] = []
    for field in fields(record, others):
        leaves = [(place, value) for place, value in field.entries if is_leaf(value)]
        wanted = [keep[len(places) + i] for i in range(len(leaves))]
        if len(leaves) == len(field.entries) and all(wanted):
            own = name(field.path)
            members.append(Member(own, field.shape, field.note, tuple(float(value) for _, value in leaves)))
            places += [own + index for index in _indices(field.shape)]
            continue
        for (place, value), kept in zip(leaves, wanted, strict=True):
            own = name((*field.path, *place))
            places.append(own if kept else None)
            if kept:
                members.append(Member(own, (), field.note, (float(value),)))
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
