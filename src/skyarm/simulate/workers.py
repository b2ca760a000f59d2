"""Worker processes for simulations; they ignore Ctrl-C and end with their parent."""

from __future__ import annotations

import contextlib
import io
import marshal
import multiprocessing
import os
import pickle
import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from importlib import import_module
from types import CellType, CodeType, FunctionType
from typing import Any

from skyarm.records.files.user_code import OwnCodeError, own_failure
from skyarm.records.registry import RegistryError
from skyarm.records.registry.plugins import Plugin, laws_of_files, load_again, loaded_plugins, register_law_of_file

Progress = Callable[[int, int, str], object]
"""Called with (pieces of work done, in all, the stage or the last of them)."""


def pack(value: Any) -> bytes:
    """Serialise a value for a worker process; functions defined inside functions are supported.

    Raises:
        ValueError: something in it cannot travel; names it.
    """
    stream = io.BytesIO()
    try:
        _Pickler(stream, pickle.HIGHEST_PROTOCOL).dump(value)
    except (pickle.PicklingError, TypeError, AttributeError) as error:
        raise ValueError(f"workers: {error}; what flies in other processes must be able to travel there") from error
    return stream.getvalue()


class _Pickler(pickle.Pickler):
    """Pickler that also serialises functions defined inside functions."""

    def reducer_override(self, value: Any) -> Any:
        """Reduce an inner function to its code and closure; anything else as usual."""
        if not isinstance(value, FunctionType) or "<locals>" not in value.__qualname__:
            return NotImplemented
        cells = value.__closure__ or ()
        code = marshal.dumps(value.__code__)
        held = (tuple(map(_cell_content, cells)), value.__defaults__, value.__kwdefaults__)
        return _empty_function, (code, value.__module__, value.__qualname__, len(cells)), held, None, None, _fill_cells


def _cell_content(cell: CellType) -> tuple[Any, ...]:
    """Value captured by a closure cell, as a tuple; () for an empty cell."""
    try:
        return (cell.cell_contents,)
    except ValueError:
        return ()


def _empty_function(code: bytes, module: str, qualname: str, cells: int) -> FunctionType:
    """Rebuild a serialised inner function with empty closure cells, which are filled later."""
    inner: CodeType = marshal.loads(code)
    closure = tuple(CellType() for _ in range(cells))
    made = FunctionType(inner, import_module(module).__dict__, inner.co_name, None, closure)
    made.__module__, made.__qualname__ = module, qualname
    return made


def _fill_cells(function: FunctionType, held: tuple[Any, ...]) -> None:
    contents, function.__defaults__, function.__kwdefaults__ = held
    for cell, content in zip(function.__closure__ or (), contents, strict=True):
        if content:
            (cell.cell_contents,) = content


Submit = Callable[..., Future[Any]]
"""submit(function, *arguments): both travel to the process (:mod:`skyarm.simulate.workers`)."""


@contextmanager
def workers(count: int) -> Iterator[Submit]:
    """Start worker processes on demand; yields the function that submits tasks to them.

    Whatever is raised inside ends what still flies.

    Raises:
        OSError: a process ended unexpectedly.
    """
    before = set(multiprocessing.active_children())
    # spawn, not fork: the parent may hold threads (a progress bar), and the same code runs on every system
    spawn = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(
        count, mp_context=spawn, initializer=_serve_parent, initargs=(loaded_plugins(), laws_of_files(), TRIED)
    )

    def submit(function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        with _ignore_interrupts():
            return pool.submit(_call, pack((function, arguments)))

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
    """Terminate the running simulations of a process pool at once, without waiting for their results.

    A process may be cut off while it sends a result. The pool's thread would wait for the rest for ever, since this
    process holds the sending end as well: it is closed first.
    """
    results = getattr(pool, "_result_queue", None)
    pool.shutdown(wait=False, cancel_futures=True)
    with contextlib.suppress(AttributeError, OSError):
        results._writer.close()  # type: ignore[union-attr]
    for child in children:
        child.terminate()


TRIED: set[str] = set()
"""Plugins' models that this process or its parent tried in another process (:mod:`skyarm.simulate.other_process`)."""

_REFUSED: list[RegistryError] = []
"""Why this process cannot have its parent's plugins, if it cannot."""


def _call(work: bytes) -> Any:
    """Execute one serialised function call in a worker process."""
    if _REFUSED:
        raise _REFUSED[0]
    function, arguments = pickle.loads(work)
    try:
        return function(*arguments)
    except (Exception, SystemExit) as error:
        line = own_failure(error)
        if not line:
            raise
        # the traceback stays here: what it says of someone's own code goes along as a line
        raise OwnCodeError(line) from error


def _serve_parent(plugins: tuple[Plugin, ...], laws: tuple[str, ...], tried: Iterable[str] = ()) -> None:
    """Initialise a worker process: ignore Ctrl-C, load the parent's plugins, end with the parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    TRIED.update(tried)
    try:
        load_again(plugins)
        for law in laws:
            register_law_of_file(law)
    except RegistryError as error:
        _REFUSED.append(error)
    threading.Thread(target=_end_with_parent, daemon=True, name="end with parent").start()


def _end_with_parent() -> None:
    """Wait for the parent process to end, then exit the worker."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


@contextmanager
def _ignore_interrupts() -> Iterator[None]:
    """Context in which new processes ignore Ctrl-C from their start."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    usual = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, usual)
