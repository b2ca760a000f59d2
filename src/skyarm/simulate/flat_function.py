"""Functions of records as programs over flat tuples of floats."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import accumulate, chain, pairwise
from typing import Any

from skyarm.compile import leaves, trace
from skyarm.simulate.loop_state import structure_of

Flat = tuple[float, ...]

ONE = (0.0,)
"""A number that stands alone, as an example."""


class FlatFunction:
    """A function of records as a program: flat tuples in, a flat tuple for each record it returns."""

    def __init__(self, function: Callable[..., tuple[Any, ...]], *examples: Any) -> None:
        result: list[Any] = []

        def kept(*records: Any) -> tuple[Any, ...]:
            result[:] = function(*records)
            return tuple(result)

        self._program, self._result = trace(kept, *examples), result
        ends = accumulate((len(leaves(part)) for part in result), initial=0)
        self._parts = [slice(a, b) for a, b in pairwise(ends)]

    def example(self, part: int) -> Any:
        """One of the records that it returns: structure, and zeros for numbers."""
        return structure_of(self._result[part])

    def __call__(self, *records: Sequence[float]) -> list[Flat]:
        """Evaluate."""
        out = self._program.flat(tuple(chain.from_iterable(records)))
        return [out[part] for part in self._parts]


def replaced_at(places: Sequence[int], numbers: Flat, others: Flat) -> Flat:
    """Numbers with others at some places."""
    if not places:
        return numbers
    held = list(numbers)
    for place, value in zip(places, others, strict=True):
        held[place] = value
    return tuple(held)
