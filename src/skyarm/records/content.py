"""Content of records as a key, by which results of pure functions are kept."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import field
from enum import Enum
from functools import lru_cache, wraps
from types import FunctionType
from typing import Any, TypeVar, cast

from skyarm.records.immutable import positional
from skyarm.records.leaves import values_of

F = TypeVar("F", bound=Callable[..., Any])
T = TypeVar("T")

_PLAIN = frozenset((float, int, str, bool, type(None)))
"""Types whose text is their content."""


def content(value: object) -> Hashable:
    """Key of a record: its classes and innermost values, at any depth.

    Other than by ``==``, 0, 0.0, -0.0 and False differ: they shape different programs.

    Raises:
        TypeError: a value that is no plain number, text, function, record or list of
            such, as one that is traced.
    """
    kind = type(value)
    if kind in _PLAIN:
        # repr tells 0, 0.0, -0.0 and False apart, which == does not
        return repr(value)
    return _content_once(_Same(value)) if kind in _LARGE else _content_of(value)


def keep_content(kind: type[T]) -> type[T]:
    """Decorator of an immutable record with many values, whose content is computed once
    for each of its instances.
    """
    _LARGE.add(kind)
    return kind


_LARGE: set[type] = set()


class _Same:
    """Object equal to no other."""

    __slots__ = ("value",)

    def __init__(self, value: object) -> None:
        self.value = value

    def __hash__(self) -> int:
        return id(self.value)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Same) and self.value is other.value


# 64 is chosen: each keeps its record alive
@lru_cache(maxsize=64)
def _content_once(same: _Same) -> Hashable:
    return _content_of(same.value)


def _content_of(value: object) -> Hashable:
    """Content of a value that is no plain number or text."""
    kind = type(value)
    inside: Sequence[object]
    if (values := values_of(kind)) is not None:
        inside = values(value)
    elif isinstance(value, (tuple, list)):
        # of a class of tuples, too, the text is that of its items
        inside = [*value]
    elif isinstance(value, Mapping):
        inside = [*value, *value.values()]
    elif isinstance(value, (Enum, type, FunctionType)):
        # compared by identity: code has no other content
        return value
    else:
        raise TypeError(f"{kind.__name__}: has no content that could be a key")
    # plain values, which are most of a record, are not worth a call each
    if {*map(type, inside)} <= _PLAIN:
        return kind, repr(inside)
    return kind, *[
        repr(each) if type(each) in _PLAIN else content(each) for each in inside
    ]


@positional
class _Call:
    """Arguments of a call, equal to those of another one with the same key."""

    key: Hashable
    arguments: tuple[object, ...] = field(compare=False)


def keep_results(
    most: int, reads: Callable[..., object] | None = None
) -> Callable[[F], F]:
    """Decorator of a pure function of records by position, which keeps its last results
    by their content.

    A file that is read, checked and flown, and read again for the next flight, is
    solved once. Errors are not kept, nor results for arguments without content.

    Args:
        most: number of results.
        reads: part of the arguments that decides the result; None for all of them.
    """

    def keep(function: F) -> F:
        results = lru_cache(maxsize=most)(lambda call: function(*call.arguments))

        @wraps(function)
        def result_of(*arguments: object) -> object:
            try:
                key = content(arguments if reads is None else reads(*arguments))
            # what has no content, as a number of more digits than Python writes, is
            # computed each time
            except (TypeError, ValueError):
                return function(*arguments)
            return results(_Call(key, arguments))

        return cast("F", result_of)

    return keep
