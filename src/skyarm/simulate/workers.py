"""Processes that fly: they leave Ctrl-C to their parent and end with it."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import Any

Submit = Callable[..., Future[Any]]
"""submit(function, *arguments): both travel to the process by pickle."""


@contextmanager
def workers(count: int) -> Iterator[Submit]:
    """Processes, started when there is work; yields the function that hands it to them.

    Whatever is raised inside ends what still flies.

    Raises:
        OSError: a process ended unexpectedly.
    """
    before = set(multiprocessing.active_children())
    # spawn, not fork: the parent may hold threads (a progress bar), and the same code runs on every system
    spawn = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(count, mp_context=spawn, initializer=_serve_parent)

    def submit(function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        with _deaf_to_interrupts():
            return pool.submit(function, *arguments)

    try:
        yield submit
    except BrokenProcessPool as error:
        raise OSError(f"workers = {count}: a process ended unexpectedly (out of memory?); try 1") from error
    except BaseException:
        _abandon(pool, set(multiprocessing.active_children()) - before)
        raise
    finally:
        pool.shutdown()


def _abandon(pool: ProcessPoolExecutor, children: set[Any]) -> None:
    """End what still flies; nobody waits for it.

    A process may be cut off while it sends a result. The pool's thread would wait for the rest for ever, since this
    process holds the sending end as well: it is closed first.
    """
    results = getattr(pool, "_result_queue", None)
    pool.shutdown(wait=False, cancel_futures=True)
    with contextlib.suppress(AttributeError, OSError):
        results._writer.close()  # type: ignore[union-attr]
    for child in children:
        child.terminate()


def _serve_parent() -> None:
    """What a worker does first: leave Ctrl-C, which reaches every process of a terminal, to the parent; end with it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True, name="end with parent").start()


def _end_with_parent() -> None:
    """Wait for the parent's end, however it comes: a killed parent cannot tell its workers, who would wait for ever."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


@contextmanager
def _deaf_to_interrupts() -> Iterator[None]:
    """Processes started here inherit the deafness, before they can ask for it themselves."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    usual = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, usual)
