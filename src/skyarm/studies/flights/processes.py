"""Worker processes for simulations: they ignore Ctrl-C and end with their parent;
killed ones are replaced.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import socket
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress

from skyarm.records.files.user_code import OwnCodeError, own_failure
from skyarm.records.registry import RegistryError
from skyarm.records.travel import luggage, pack, unload, unpack
from skyarm.simulate.examine import TRIED
from skyarm.studies.flights.work import Flown, Work

Call = tuple[Callable[..., bytes], tuple[object, ...]]
"""Function of a call and its arguments."""

MOST_TRIES = 3
"""Largest number of starts of a call whose process ends."""


class Processes:
    """Pool of worker processes that executes function calls; a broken pool is replaced.

    Args:
        count: number of processes, started as they are needed.
    """

    def __init__(self, count: int) -> None:
        # a second call waits for each process, which so is never idle
        self.slots = 2 * count
        self._count = count
        self._flying: dict[Future[bytes], tuple[Work, bytes, int]] = {}
        # children of others, which are not ended here
        self._before = set(multiprocessing.active_children())
        self._pool: ProcessPoolExecutor | None = None

    @property
    def flying(self) -> int:
        """Number of submitted function calls whose results are not collected yet."""
        return len(self._flying)

    def submit(
        self, token: Work, function: Callable[..., bytes], *arguments: object
    ) -> None:
        """Submit a function call, whose work item and result :meth:`collect`
        returns.
        """
        self._begin(token, pack((function, arguments)), 1)

    def _begin(self, token: Work, call: bytes, tries: int) -> None:
        if self._pool is None:
            # spawn, not fork: the parent may hold threads (a progress bar), and the
            # same code runs on every system
            spawn = multiprocessing.get_context("spawn")
            self._pool = ProcessPoolExecutor(
                self._count,
                mp_context=spawn,
                initializer=serve,
                initargs=(luggage(), TRIED),
            )
        with _ignore_interrupts(), suppress(BrokenProcessPool):
            self._flying[self._pool.submit(perform, call)] = token, call, tries
            return
        # collect() meets its error, and begins the call again
        broken: Future[bytes] = Future()
        broken.set_exception(BrokenProcessPool())
        self._flying[broken] = token, call, tries

    def collect(self) -> Flown:
        """Wait for a call to finish, restarting those of killed processes; returns its
        work item and result.

        Raises:
            OSError: a process ended unexpectedly in each of some tries.
        """
        while True:
            done = next(iter(wait(self._flying, return_when=FIRST_COMPLETED).done))
            try:
                result = done.result()
            except BrokenProcessPool as error:
                self._mend(error)
            else:
                return self._flying.pop(done)[0], result

    def _mend(self, error: BrokenProcessPool) -> None:
        """Restart all unfinished calls of a broken process pool in a new pool."""
        assert self._pool is not None
        self._pool.shutdown(wait=False)
        self._pool = None
        lost = [
            each
            for each in self._flying
            if not each.done() or isinstance(each.exception(), BrokenProcessPool)
        ]
        for k, (token, call, tries) in enumerate(
            [self._flying.pop(each) for each in lost]
        ):
            begun = k < self._count  # a pool takes calls in their order, one a process
            if begun and tries >= MOST_TRIES:
                raise OSError(
                    f"workers = {self._count}: a process ended unexpectedly,"
                    f" {MOST_TRIES} times (out of memory?); try 1"
                ) from error
            self._begin(token, call, tries + begun)

    def close(self, *, abandon: bool) -> list[Flown]:
        """End all processes, after waiting for running calls or abandoning them;
        returns the results not collected yet.

        A process may be cut off while it sends a result. The pool's thread would wait
        for the rest for ever, since this process holds the sending end as well: it is
        closed first.
        """
        if abandon and self._pool is not None:
            # of the pool's own, which another Python may name in another way
            results = getattr(self._pool, "_result_queue", None)
            self._pool.shutdown(wait=False, cancel_futures=True)
            with suppress(AttributeError, OSError):
                results._writer.close()  # type: ignore[union-attr]
            for child in set(multiprocessing.active_children()) - self._before:
                child.terminate()
        if self._pool is not None:
            self._pool.shutdown()
        sound = [
            each
            for each in self._flying
            if each.done() and not each.cancelled() and each.exception() is None
        ]
        return [(self._flying[each][0], each.result()) for each in sound]


_REFUSED: list[RegistryError] = []
"""Reason why this process cannot load its parent's plugins; empty if it can."""


def perform(work: bytes) -> bytes:
    """Execute one serialised function call in a worker process."""
    if _REFUSED:
        raise _REFUSED[0]
    call: Call
    try:
        call = unpack(work)
    except ModuleNotFoundError as error:
        raise ValueError(
            f"{error} on {socket.gethostname()}: install it there, or give its file as"
            " a plugin, which travels"
        ) from None
    function, arguments = call
    try:
        return function(*arguments)
    except (Exception, SystemExit) as error:
        line = own_failure(error)
        if not line:
            raise
        # the traceback stays here: what it says of someone's own code goes along as a
        # line
        raise OwnCodeError(line) from error


def serve(parents: bytes, tried: Iterable[str] = ()) -> None:
    """Initialise a worker process: ignore Ctrl-C, load the parent's plugins, end with
    the parent.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _REFUSED.extend(equip(parents, tried))
    threading.Thread(
        target=_end_with_parent, daemon=True, name="end with parent"
    ).start()


def equip(parents: bytes, tried: Iterable[str]) -> list[RegistryError]:
    """Load the parent's plugins in a worker; returns the errors, which every call in
    this worker then raises.
    """
    TRIED.update(tried)
    try:
        unload(parents)
    except RegistryError as error:
        return [error]
    return []


def _end_with_parent() -> None:
    """Wait for the parent process to end, then exit the worker."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        # not sys.exit, which ends a thread alone
        os._exit(1)


@contextmanager
def _ignore_interrupts() -> Iterator[None]:
    """Context in which new processes ignore Ctrl-C from their start."""
    # Python lets the main thread alone set handlers
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    usual = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, usual)
