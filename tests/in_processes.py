"""Calls in other processes, as works fly there."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from skyarm.studies.flights.processes import Processes


@contextmanager
def processes(count: int) -> Iterator[Processes]:
    """Pool that ends with the block; what still flies is abandoned if the block fails."""
    pool, abandon = Processes(count), True
    try:
        yield pool
        abandon = False
    finally:
        pool.close(abandon=abandon)


def elsewhere(function: Callable[..., Any], *arguments: Any) -> Any:
    """Result of a call in another process."""
    with processes(1) as pool:
        pool.submit("only", function, *arguments)
        return pool.collect()[1]
