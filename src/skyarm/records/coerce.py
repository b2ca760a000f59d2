"""Conversion of dataclass fields to their stored types (floats, vectors, tuples); other
values raise an error.

NumPy's scalars and arrays without axes become floats, so that checks see them; arrays
with axes are lanes of a batch and stay, as do JAX arrays and nodes of a trace. Each
rule takes a field's name and what was given, and returns what is held, or raises
RecordError: one line with field, value and what is allowed.
"""

from __future__ import annotations

import math
import numbers
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NoReturn, TypeGuard, TypeVar

from skyarm.algebra import Mat3, Quaternion, Scalar, Sym3, Vec3
from skyarm.algebra.scalars import structural
from skyarm.records.files.messages import must_be_one_of, shown

if TYPE_CHECKING:
    from skyarm.records.arrays import Array

Thing = TypeVar("Thing")

Rule = Callable[[str, object], Any]
"""Check and conversion of a field: (name of the field, given value) -> stored value;
raises RecordError."""

TOLERANCE = 1e-6
"""Relative slack for unit lengths, orthogonality and symmetry (rounding of published
numbers)."""


class RecordError(ValueError):
    """Error: a field of a dataclass cannot store the given value."""


def refuse(field: str, value: object, allowed: str) -> NoReturn:
    """Raise an error that states field, value and the allowed values on one line."""
    raise RecordError(f"{field} = {shown(value)}: {allowed}")


def concrete(*values: object) -> bool:
    """True if all values are plain Python numbers, not arrays of a batch or symbols of
    a traced program.
    """
    # the kinds first, in one step: this runs for almost every number of a record
    return {*map(type, values)} <= _NUMBERS or all(
        isinstance(value, (int, float)) for value in values
    )


_NUMBERS = {float, int}


def absent(value: object) -> bool:
    """True for the int 0, which marks a number as absent from compiled code, unlike the
    float 0.0.
    """
    # type, not ==: False and 0.0 equal 0, but only the int says that an effect is
    # absent
    return type(value) is int and value == 0


_STRUCTURE = (-1, 0, 1)


def number(field: str, value: object) -> Scalar:
    """Convert a scalar: plain numbers become floats; arrays of a batch and traced
    scalars stay as they are.
    """
    # the most frequent case first: records are made by the thousand
    if type(value) is float:
        return value
    plain = plain_number(value)
    # True is an int to Python, but no number of a record
    if isinstance(plain, bool):
        refuse(field, value, "must be a number")
    if isinstance(plain, numbers.Real):
        try:
            # an int of more than 308 digits
            return float(plain)
        except OverflowError:
            refuse(field, value, "must be a finite number")
    # integer lanes become doubles, because a later division must not round
    if _is_array(plain) and plain.dtype.kind in "fiu":
        return plain if plain.dtype.kind == "f" else plain.astype(float)
    # what is left of scalars: JAX, CasADi, nodes of a trace
    if not _is_scalar(plain) or _is_array(plain) or isinstance(plain, numbers.Number):
        refuse(field, value, "must be a number")
    return plain


def _is_scalar(value: object) -> TypeGuard[Scalar]:
    """True if a value is a single number that can be multiplied, such as a float or a
    traced scalar.
    """
    return hasattr(value, "__mul__") and hasattr(value, "__float__")


def coefficient(field: str, value: object) -> Scalar:
    """Convert a scalar coefficient; an integer 0 is left as it is and removes the
    effect from compiled code.
    """
    return 0 if absent(value) else number(field, value)


def vector(field: str, value: object) -> Vec3:
    """Convert to a vector; plain numbers that are exactly 0, 1 or -1 become constants
    of compiled code.
    """
    if isinstance(value, Vec3):
        entries = [
            _entry(f"{field}.{axis}", each)
            # entries of a vector keep their names in messages
            for axis, each in zip("xyz", value, strict=True)
        ]
        return (
            value
            # the same object where nothing changed: identity saves copies and keys
            if all(a is b for a, b in zip(entries, value, strict=True))
            else Vec3(*entries)
        )
    return Vec3(
        *(
            _structural_number(field, each)
            for each in items(field, value, (3,), "must be three numbers")
        )
    )


def matrix(field: str, value: object) -> Mat3:
    """Convert three rows of three numbers to a 3 x 3 matrix."""
    rows = (
        value.rows
        if isinstance(value, Mat3)
        else items(field, value, (3,), "must be three rows of three numbers")
    )
    return Mat3(*(vector(field, row) for row in rows))


def inertia(field: str, value: object) -> Sym3:
    """Convert an inertia (xx yy zz, xx yy zz xy xz yz, or three symmetric rows) to a
    symmetric matrix.
    """
    if isinstance(value, Sym3):
        return Sym3(
            *(
                _entry(f"{field}.{name}", each)
                for name, each in zip(Sym3.__slots__, value.entries, strict=True)
            )
        )
    allowed = (
        "must be three (xx yy zz) or six (xx yy zz xy xz yz) numbers, or a symmetric"
        " 3x3 matrix"
    )
    entries: Sequence[object] = items(field, value, (3, 6), allowed)
    if any(map(_many, entries)):
        rows = [
            items(field, row, (3,), allowed)
            for row in items(field, entries, (3,), allowed)
        ]
        entries = _symmetric(
            field, [[number(field, each) for each in row] for row in rows], value
        )
    components = (number(field, each) for each in entries)
    return Sym3(
        *(0 if type(each) is float and each == 0.0 else each for each in components)
        # zero products of inertia fold away, as in a file
    )


def _symmetric(field: str, rows: list[list[Scalar]], value: object) -> list[Scalar]:
    """Entries xx yy zz xy xz yz of a 3 x 3 matrix, after a check of its symmetry."""
    pairs = [(rows[i][j], rows[j][i]) for i, j in ((0, 1), (0, 2), (1, 2))]
    entries = [each for row in rows for each in row]
    concrete = [each for each in entries if type(each) is float]
    slack = TOLERANCE * max(map(abs, concrete), default=0.0)
    # only concrete matrices can be compared; the slack is relative to the largest entry
    if len(concrete) == 9 and any(abs(float(a) - float(b)) > slack for a, b in pairs):
        refuse(field, value, "must be symmetric")
    return [rows[0][0], rows[1][1], rows[2][2], *(a for a, _ in pairs)]


def text(field: str, value: object) -> str:
    """Check that a value is text."""
    if not isinstance(value, str):
        refuse(field, value, "must be text")
    return str(value)


def name(field: str, value: object) -> str:
    """Check that a value is text that is not empty."""
    return text(field, value) or refuse(field, value, "must not be empty")


def word_of(words: Iterable[str]) -> Rule:
    """Make a conversion rule that accepts one of the given texts."""

    def rule(field: str, value: object) -> str:
        if not isinstance(value, str) or value not in words:
            refuse(field, value, must_be_one_of(words, value))
        return value

    return rule


def fold_zeros(record: object, *names: str) -> None:
    """Turn exact zeros in fields of a frozen dataclass under construction into
    constants of compiled code.
    """
    for name in names:
        value = getattr(record, name)
        if isinstance(value, Vec3):
            object.__setattr__(
                record,
                name,
                Vec3(*(0 if concrete(c) and c == 0.0 else c for c in value)),
            )
        elif concrete(value) and value == 0.0:
            object.__setattr__(record, name, 0)


def flag(field: str, value: object) -> bool:
    """Check that a value is true or false."""
    plain = plain_number(value)
    if not isinstance(plain, bool):
        refuse(field, value, "must be True or False")
    return plain


def whole(field: str, value: object) -> int:
    """Convert a value to a whole number; fractions and other types raise an error."""
    plain = plain_number(value)
    if (
        # plain != plain // 1 is true of fractions, and of NaN
        isinstance(plain, bool)
        or not isinstance(plain, (int, float))
        or plain != plain // 1
    ):
        refuse(field, value, "must be a whole number")
    return int(plain)


def one(kind: type[Thing]) -> Callable[[str, object], Thing]:
    """Make a check that accepts only instances of a given class."""

    def rule(field: str, value: object) -> Thing:
        if not isinstance(value, kind):
            refuse(field, value, f"must be a {kind.__name__}")
        return value

    return rule


def pairs(field: str, value: object) -> tuple[tuple[str, str], ...]:
    """Convert a mapping or a sequence of pairs of texts to a tuple of pairs."""
    items = tuple(value.items()) if isinstance(value, Mapping) else value
    if not is_sequence(items):
        refuse(field, value, "must be pairs of texts")
    texts = tuple(
        tuple(pair) if isinstance(pair, (list, tuple)) else (pair,) for pair in items
    )
    if any(
        len(pair) != 2 or not all(isinstance(each, str) for each in pair)
        for pair in texts
    ):
        refuse(field, value, "must be pairs of texts")
    return tuple((key, source) for key, source in texts)


def is_sequence(value: object) -> TypeGuard[Iterable[object]]:
    """True for a sequence, but not for text, a table or a zero-dimensional array."""
    if type(value) in (tuple, list):
        return True
    several = hasattr(value, "__iter__") and not isinstance(
        value, (str, bytes, Mapping, type)
    )
    return several and bool(getattr(value, "ndim", 1))


def plain_number(value: object) -> object:
    """Convert NumPy scalars and zero-dimensional arrays to Python numbers; other values
    are returned unchanged.
    """
    # looked up, not imported: a record of plain numbers must not load NumPy
    numpy = sys.modules.get("numpy")
    if (
        numpy is not None
        and isinstance(value, (numpy.generic, numpy.ndarray))
        and value.ndim == 0
    ):
        return value.item()
    return value


def _is_array(value: object) -> TypeGuard[Array]:
    """True for a NumPy array: values of a batch, or a row of a matrix."""
    numpy = sys.modules.get("numpy")
    return numpy is not None and isinstance(value, numpy.ndarray)


def _many(value: object) -> bool:
    """True for a value that holds several numbers, such as a row of a matrix."""
    return isinstance(value, (list, tuple, Vec3)) or _is_array(value)


def items(
    field: str, value: Any, counts: tuple[int, ...] | None, allowed: str
) -> list[object]:
    """Items of a sequence or array as a list, after a check of their count (None allows
    any).
    """
    # their iteration yields letters or keys, which are no items
    if isinstance(value, (str, bytes, Mapping, set, frozenset)):
        refuse(field, value, allowed)
    try:
        entries = list(value)
    except TypeError:  # not iterable, or an array without axes
        refuse(field, value, allowed)
    if counts is not None and len(entries) not in counts:
        refuse(field, value, allowed)
    return entries


def _entry(field: str, value: object) -> Scalar:
    """Convert one entry of a vector or matrix; integers 0, 1 and -1 stay constants of
    compiled code.
    """
    return value if type(value) is int and value in _STRUCTURE else number(field, value)


def _structural_number(field: str, value: object) -> Scalar:
    """Convert a plain number; exact 0, 1 and -1 become constants of compiled code."""
    converted = number(field, value)
    return structural(converted) if type(converted) is float else converted


ROUNDING = 1e-12
"""Largest rounding error of the length of a vector that was normalised."""


def unit_vector(field: str, value: object) -> Vec3:
    """Read a vector, refuse it unless its length is 1 within TOLERANCE, and normalise
    it.
    """
    direction = vector(field, value)
    # traced components are taken as of unit length
    length = math.sqrt(sum(c * c for c in direction)) if concrete(*direction) else 1.0
    if not abs(length - 1.0) <= TOLERANCE:
        refuse(
            field, tuple(direction), f"must be a unit vector, its length is {length:g}"
        )
    return (
        direction
        # a vector that was normalised stays as it is, bit by bit
        if abs(length - 1.0) <= ROUNDING
        else Vec3(*(c if type(c) is int else c / length for c in direction))
    )


def proper_rotation(field: str, value: object) -> Mat3:
    """Convert to a rotation matrix; if it is nearly one (ten times TOLERANCE), replace
    it by the nearest rotation.

    Source: Higham 1986, Newton-Schulz iteration for the polar factor, R (3 I - R^T R) /
    2.
    """
    rotation = matrix(field, value)
    rows = [list(row) for row in rotation.rows]
    entries = [c for row in rows for c in row]
    if not concrete(*entries):
        return rotation
    skew = _skew(rows)
    # entries that are off by TOLERANCE move R^T R by up to 2 sqrt(3) times as much; not
    # <=, so that NaN is refused as well
    if (
        not skew <= 10.0 * TOLERANCE
        # a reflection is orthogonal, too
        or rotation.r0.cross(rotation.r1).dot(rotation.r2) < 0.0
    ):
        refuse(field, entries, "must be a rotation (orthogonal, determinant +1)")
    # a matrix to rounding stays as it is, bit by bit
    if skew <= ROUNDING:
        return rotation
    # Newton-Schulz iteration X (3 - X^T X) / 2 towards the nearest rotation
    for _ in range(3):  # the error is squared each time: 1e-5, 1e-10, rounding
        left = [[3.0 * (i == j) - _dot(rows, i, j) for j in range(3)] for i in range(3)]
        rows = [
            [0.5 * sum(row[k] * left[k][j] for k in range(3)) for j in range(3)]
            for row in rows
        ]
    return Mat3(*(Vec3(*row) for row in rows))


def _dot(rows: list[list[Scalar]], i: int, j: int) -> Scalar:
    """Dot product of two columns of a matrix."""
    return sum(row[i] * row[j] for row in rows)


def _skew(rows: list[list[Scalar]]) -> float:
    """Deviation of a matrix R from orthonormal columns: largest entry of R^T R - I."""
    return float(
        max(abs(float(_dot(rows, i, j) - (i == j))) for i in range(3) for j in range(3))
    )


def near_unit_quaternion(value: Quaternion) -> Quaternion:
    """Convert to a quaternion and normalise it if its length is 1 within TOLERANCE."""
    # a traced one has no length to see; one that is off by rounding alone stays as it
    # is
    length = math.sqrt(sum(c * c for c in value)) if concrete(*value) else 1.0
    return (
        Quaternion(*(c / length for c in value))
        if ROUNDING < abs(length - 1.0) <= TOLERANCE
        else value
    )
