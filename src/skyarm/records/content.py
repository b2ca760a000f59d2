"""Content of records as a key, by which results of pure functions are kept."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping
from dataclasses import field
from enum import Enum
from functools import lru_cache, wraps
from types import FunctionType
from typing import Any, TypeVar, cast

from skyarm.records.immutable import positional
from skyarm.records.leaves import field_names

F = TypeVar("F", bound=Callable[..., Any])


def content(value: object) -> Hashable:
    """Key of a record: its classes and innermost values, at any depth.

    Other than by ``==``, 0, 0.0, -0.0 and False differ: they shape different programs.

    Raises:
        TypeError: a value that is no plain number, text, function, record or list of
            such, as one that is traced.
    """
    kind = type(value)
    if kind is float:
        # repr tells -0.0 from 0.0, which == does not
        return repr(value)
    if kind in (int, str, bool, type(None)):
        # the kind stands in the key, because True == 1 and both hash alike
        return kind, value
    inside: Iterable[object]
    if (names := field_names(kind)) is not None:
        inside = [getattr(value, name) for name in names]
    elif isinstance(value, Mapping):
        inside = [*value, *value.values()]
    elif isinstance(value, (tuple, list)):
        inside = value
    elif isinstance(value, (Enum, type, FunctionType)):
        # compared by identity: code has no other content
        return value
    else:
        raise TypeError(f"{kind.__name__}: has no content that could be a key")
    # floats, which are most of a record, are not worth a call each
    return kind, *[
        repr(each) if type(each) is float else content(each) for each in inside
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
            # what has no content is computed each time
            except TypeError:
                return function(*arguments)
            return results(_Call(key, arguments))

        return cast("F", result_of)

    return keep
