"""Execution of simulations on local threads, worker processes or a Ray cluster, with
results stored in a folder.
"""

from __future__ import annotations

import contextlib
import re
import warnings
from collections.abc import Callable, Iterable, Iterator
from types import TracebackType
from typing import TYPE_CHECKING, TypeAlias

from skyarm.records.files import shown
from skyarm.records.files.messages import comma_list
from skyarm.simulate.lane_numbers import require_count
from skyarm.studies.flights.fly import fly, fly_together
from skyarm.studies.flights.store import Store, pack_rows, unpack_rows
from skyarm.studies.flights.work import Flown, Rows, Work, identified

if TYPE_CHECKING:
    from skyarm.studies.flights.processes import Processes
    from skyarm.studies.flights.ray_cluster import Ray

LOCAL, PROCESSES, RAY = "local", "processes", "ray"

PLACES = re.compile(rf"{LOCAL}|{PROCESSES}|{RAY}(:[\w.\-\[\]:]+:\d{{1,5}})?")

Progress = Callable[[int, int, str], object]
"""Callback (pieces of work done, total, present stage or last piece)."""


def require_place(on: str, field: str = "on") -> str:
    """Check the name of an execution backend: local, processes, ray or ray:HOST:PORT;
    errors name the field.

    Raises:
        ValueError: one line: no such place, or its extra is missing.
    """
    if not isinstance(on, str) or not PLACES.fullmatch(on):
        raise ValueError(
            f"{field} = {shown(on)}: must be {LOCAL}, {PROCESSES}, {RAY} or"
            f" {RAY}:HOST:PORT"
        )
    if on.startswith(RAY):
        from skyarm.studies.flights.ray_cluster import require_ray

        require_ray(f"{field} = {shown(on)}")
    return on


class InProcess:
    """Executor that runs one function call at a time, in this process.

    Attributes:
        slots: largest number of calls under way.
    """

    slots = 1

    def __init__(self) -> None:
        self._next: list[tuple[Work, Callable[[], bytes]]] = []

    @property
    def flying(self) -> int:
        """Number of submitted function calls that are not executed yet: 0 or 1."""
        return len(self._next)

    def submit(
        self, token: Work, function: Callable[..., bytes], *arguments: object
    ) -> None:
        """Store a function call, which is executed when its result is collected."""
        self._next.append((token, lambda: function(*arguments)))

    def collect(self) -> Flown:
        """Execute the stored function call; returns its work item and result."""
        token, call = self._next.pop()
        return token, call()

    def close(self, *, abandon: bool) -> list[Flown]:
        """Return an empty list, since no function call runs in the background."""
        return []


Executor: TypeAlias = "InProcess | Processes | Ray"
"""Backend of function calls: in this process, in worker processes or on a cluster. All
have ``slots``, ``flying``, ``submit``, ``collect`` and ``close``."""


def _executor(on: str, workers: int) -> Executor:
    """Create the execution backend of a given name."""
    if on == LOCAL:
        return InProcess()
    if on == PROCESSES:
        from skyarm.studies.flights.processes import Processes

        return Processes(workers)
    from skyarm.studies.flights.ray_cluster import Ray

    return Ray(on.partition(":")[2], workers)


class WorkRunner:
    """Runner that simulates work items on a chosen backend and stores their results;
    stored ones are not repeated.

    Args:
        on: "local", "processes", "ray" (started here) or "ray:HOST:PORT" (joined); None
            the usual one of what is left.
        workers: threads of "local", processes of "processes", processors of "ray". No
            row depends on it.
        store: folder of the rows; None keeps none.

    Attributes:
        flights: number of those flown.

    Raises:
        ValueError: no such place, its extra is missing, no cluster answers there, or
            ``workers`` is no number of them.
    """

    def __init__(
        self, on: str | None = LOCAL, workers: int = 1, store: Store | None = None
    ) -> None:
        self.on = None if on is None else require_place(on)
        self.workers = require_count("workers", workers)
        self.store = store
        self._executor: Executor | None = None
        self.flights = 0

    def __enter__(self) -> WorkRunner:
        # a component of the user may have changed since an earlier runner
        identified.clear()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        at: TracebackType | None,
    ) -> None:
        if self._executor is not None:
            for work, content in self._executor.close(abandon=kind is not None):
                if self.store is not None:
                    # what is not kept flies again; the error that ends all matters more
                    with contextlib.suppress(OSError):
                        self.store.put(work, content)
        if self.store is not None:
            self.store.close()
            if self.store.damaged:
                names = comma_list(self.store.damaged)
                warnings.warn(
                    f"{self.store.folder}: damaged, and flown again: {names}",
                    stacklevel=2,
                )

    def fly(self, works: Iterable[Work]) -> Iterator[Flown]:
        """Yield each work item with the content of its result file, stored ones without
        simulating them again.

        A work is taken from ``works`` when there is room for it: of millions only some
        are in memory. Those that are to fly at the usual place wait until it is known
        how many.

        Raises:
            OSError: a process ended unexpectedly, or a file cannot be written.
        """
        waiting: list[Work] = []
        for work in works:
            there = self.store.get(work) if self.store else None
            if there is not None:
                yield work, there
            elif self.on is None:
                waiting.append(work)
            else:
                yield from self._begin(work, self.on)
        # many works fly each on a processor of its own, few on threads
        usual = PROCESSES if 1 < self.workers < len(waiting) else LOCAL
        for work in waiting:
            yield from self._begin(work, usual)
        while self._executor is not None and self._executor.flying:
            yield self._collect(self._executor)

    def _begin(self, work: Work, on: str) -> Iterator[Flown]:
        """Submit a work item as soon as the executor has room, and yield the work items
        that finish meanwhile.
        """
        if self._executor is None:
            self._executor = _executor(on, self.workers)
        while self._executor.flying >= self._executor.slots:
            yield self._collect(self._executor)
        # elsewhere a worker is one processor, and so a work has one thread
        metadata = self.store.metadata(work) if self.store else {}
        self._executor.submit(
            work, rows_file, work, metadata, self.workers if on == LOCAL else 1
        )

    def _collect(self, executor: Executor) -> Flown:
        work, content = executor.collect()
        self.flights += work.count
        if self.store is not None:
            self.store.put(work, content)
        return work, content

    def rows(self, works: Iterable[Work]) -> list[Rows]:
        """Result rows of several work items, in order; threads run items of equal
        program and seed as one batch.
        """
        every = list(works)
        here = self.on == LOCAL
        flying = (
            self._together(every)
            if here
            else ((work, unpack_rows(content)) for work, content in self.fly(every))
        )
        # a work equals itself alone
        by_work = dict(flying)
        return [by_work[work] for work in every]

    def _together(self, works: Iterable[Work]) -> Iterator[tuple[Work, Rows]]:
        """Yield work items with their result rows, stored or simulated in this
        process.
        """
        groups: dict[int | tuple[str, int], list[Work]] = {}
        for work in works:
            there = self.store.get(work) if self.store else None
            if there is None:
                # flights one by one share no program
                groups.setdefault(
                    id(work) if work.alone else (work.program, work.seed), []
                ).append(work)
            else:
                yield work, unpack_rows(there)
        for group in groups.values():
            for work, rows in zip(
                group, fly_together(group, self.workers), strict=True
            ):
                self.flights += work.count
                if self.store is not None:
                    self.store.put(work, pack_rows(rows, self.store.metadata(work)))
                yield work, rows


def rows_file(work: Work, metadata: dict[bytes, bytes], threads: int) -> bytes:
    """Simulate a work item; returns its result file, whose bytes depend on work item
    and metadata alone.
    """
    return pack_rows(fly(work, threads), metadata)
