"""Execution on a Ray cluster, started here or joined; its nodes need no access to this
machine's disk.

Calls and results travel as bytes, plugins by content. A call whose process or node dies
begins again elsewhere. A node whose versions would fly other rows is refused before its
first flight.
"""

from __future__ import annotations

import logging
import os
import signal
import socket
import subprocess
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING

from skyarm.records.files import needs_extra, shown, versions
from skyarm.records.registry import RegistryError
from skyarm.records.travel import luggage, pack, unpack
from skyarm.simulate.examine import TRIED
from skyarm.studies.flights.processes import MOST_TRIES, equip, perform
from skyarm.studies.flights.work import Flown, Work, kinship

if TYPE_CHECKING:
    from ray import ObjectRef

QUIET = {"log_to_driver": False, "logging_level": logging.ERROR}
"""Ray settings that suppress its output."""

SETTINGS = {"RAY_task_oom_retries": str(MOST_TRIES), "RAY_DEDUP_LOGS_SKIP_REGEX": "."}
"""Environment variables that Ray reads when it is imported. The first ends the
endless retries of a task that needs more memory than there is; the second keeps
Ray's messages about dead processes out of standard output, where a report for
machines may be written."""

ANSWER_SECONDS, JOIN_SECONDS, LOOK_SECONDS = 5.0, 30.0, 5.0
"""Times (s) until an address counts as silent, until a cluster counts as closed, and
between two counts of its processors."""

ENDINGS = [
    signal.Signals[name]
    for name in ("SIGINT", "SIGTERM", "SIGHUP")
    if name in signal.Signals.__members__
]
"""Signals that end a command."""

KNOCK = """import sys
import ray
try:
    ray.init(address=sys.argv[1], log_to_driver=False, logging_level="ERROR")
except Exception as error:
    sys.exit(" ".join(str(error).split()))
ray.shutdown()"""
"""Program that joins a cluster in a separate process, since Ray ends the process or
waits for minutes on failure."""


class Ray:
    """Executor that runs function calls on the processors of a Ray cluster.

    The cluster that this process has joined already, if any, is used and stays joined.

    Args:
        address: HOST:PORT of a cluster that this machine is a node of; empty starts one
            on this machine alone.
        workers: processors of the one that is started.

    Raises:
        ValueError: no cluster answers there, or it cannot be joined or started; another
            one is joined already.
    """

    def __init__(self, address: str, workers: int) -> None:
        self._ray = require_ray("on = 'ray'")
        self._flying: dict[ObjectRef, Work] = {}
        self._landed: list[ObjectRef] = []
        self._slots = 1
        self._counted = -LOOK_SECONDS
        outfit = pack((luggage(), TRIED))
        self._ours = not self._ray.is_initialized()
        if self._ours:
            _begin(self._ray, address, workers)
        elif address not in ("", joined := self._ray.get_runtime_context().gcs_address):
            raise ValueError(
                f"on = 'ray:{address}': this process has joined {joined}; must be ray,"
                " or that address"
            )
        try:
            self._kin = kin()
            self._outfit = self._ray.put(outfit)
            self._perform = self._ray.remote(max_retries=MOST_TRIES)(_travelling())
        # a cluster started here must not outlive a failed start
        except BaseException:
            self.close(abandon=True)
            raise

    @property
    def slots(self) -> int:
        """Largest number of calls to submit at a time: two per processor of the cluster
        at present.
        """
        if time.monotonic() > self._counted + LOOK_SECONDS:
            # a second call waits for each processor, which so is never idle
            self._slots = max(1, int(2 * self._ray.cluster_resources().get("CPU", 0)))
            self._counted = time.monotonic()
        return self._slots

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
        self._flying[
            self._perform.remote(self._kin, self._outfit, pack((function, arguments)))
        ] = token

    def collect(self) -> Flown:
        """Wait for a call to finish; returns its work item and result.

        Raises:
            OSError: its process or node died in each of some tries.
        """
        if not self._landed:
            self._ray.wait([*self._flying], num_returns=1)
            # all that are there: to look through thousands that fly for each that lands
            # would take the driver's time
            self._landed, _ = self._ray.wait(
                [*self._flying], num_returns=len(self._flying), timeout=0
            )
        done = self._landed.pop()
        try:
            return self._flying.pop(done), self._ray.get(done)
        except self._ray.exceptions.RayTaskError as error:
            raise error.cause from None
        except self._ray.exceptions.RayError as error:
            # one line, cut off behind 300 letters, chosen
            why = " ".join(str(error).split())[:300]
            raise OSError(
                f"on = 'ray': a process or node ended unexpectedly, {MOST_TRIES + 1}"
                f" times: {why}"
            ) from error

    def close(self, *, abandon: bool) -> list[Flown]:
        """Leave the cluster, or stop the one started here, after waiting for running
        calls or cancelling them.

        Returns what has landed, as :meth:`collect` gives it.
        """
        flying = self._flying
        sound = list[Flown]()
        self._flying = {}
        # whoever abandons has an error already, which matters more
        with suppress(*([Exception] if abandon else [])):
            wait = {"num_returns": len(flying), "timeout": 0 if abandon else None}
            landed, left = self._ray.wait([*flying], **wait) if flying else ([], [])
            # whoever leaves takes along what flies; Ray aborts now and then where a
            # call lands while it is cancelled
            for each in [] if self._ours else left:
                self._ray.cancel(each, force=True)
            for each in landed:
                # one that ended with an error, or is lost, flies again
                with suppress(Exception):
                    sound.append((flying[each], self._ray.get(each, timeout=0)))
        if self._ours:
            with _without_warnings():
                self._ray.shutdown()
        return sound


def require_ray(where: str) -> ModuleType:
    """Import the package ray; raise a one-line error that begins with ``where`` if it
    is missing.

    Raises:
        ValueError: one line: it is not installed, or not as a whole.
    """
    for name, value in SETTINGS.items():
        # what the user has set stays
        os.environ.setdefault(name, value)
    try:
        ray = import_module("ray")
        ray.init  # noqa: B018  (a folder of that name is a package, too)
    except (ImportError, AttributeError):
        raise ValueError(f"{where}: {needs_extra('ray')}") from None
    return ray


def _begin(ray: ModuleType, address: str, workers: int) -> None:
    """Join the Ray cluster at an address, or start one on this machine."""
    on = f"on = {shown(f'ray:{address}' if address else 'ray')}"
    if address:
        _knock(address, on)
    try:
        with _without_warnings(), _own_address(alone=not address):
            if address:
                ray.init(address=address, **QUIET)
            else:
                ray.init("local", num_cpus=workers, include_dashboard=False, **QUIET)
    # also of Ctrl-C: processes that have begun must not stay behind
    except BaseException as error:
        ray.shutdown()
        if not isinstance(error, Exception):
            raise
        raise ValueError(f"{on}: {' '.join(str(error).split())}") from error


@contextmanager
def _without_warnings() -> Iterator[None]:
    """Context that silences warnings and delays signals until Ray has completely
    started or stopped.

    Cut off, Ray leaves processes behind. The handler of SIGTERM, which it replaces, is
    the former one afterwards.
    """
    main = threading.current_thread() is threading.main_thread()
    came = list[int]()
    usual = {each: signal.getsignal(each) for each in ENDINGS} if main else {}
    for each in usual:
        signal.signal(each, lambda number, _: came.append(number))
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        for each, handler in usual.items():
            signal.signal(each, handler)
        for number in came:
            signal.raise_signal(number)


@contextmanager
def _own_address(*, alone: bool) -> Iterator[None]:
    """Context in which a Ray cluster for this machine alone listens on the loopback
    address only.
    """
    from ray._private import ray_constants

    usual = ray_constants.ENABLE_RAY_CLUSTER
    ray_constants.ENABLE_RAY_CLUSTER = usual and not alone
    try:
        yield
    finally:
        ray_constants.ENABLE_RAY_CLUSTER = usual


def _knock(address: str, on: str) -> None:
    """Raise an error unless a Ray cluster answers at an address and has this machine as
    a node.
    """
    host, _, port = address.rpartition(":")
    try:
        socket.create_connection((host.strip("[]"), int(port)), ANSWER_SECONDS).close()
    except (OSError, OverflowError) as error:
        raise ValueError(
            f"{on}: nobody answers there ({getattr(error, 'strerror', None) or error})"
        ) from None
    try:
        command = [sys.executable, "-c", KNOCK, address]
        tried = subprocess.run(
            command, capture_output=True, text=True, timeout=JOIN_SECONDS, check=False
        )
    except subprocess.TimeoutExpired:
        raise ValueError(
            f"{on}: what answers there is no head of a Ray cluster"
        ) from None
    if tried.returncode != 0:
        # 1 is an error that KNOCK tells; by any other code Ray itself ended the process
        why = (
            tried.stderr.strip().rpartition("\n")[2]
            if tried.returncode == 1
            else "no node of it runs here"
        )
        raise ValueError(
            f"{on}: cannot be joined ({why}); make this machine a node: ray start"
            f" --address={address}"
        )


def kin() -> dict[str, str]:
    """Package versions that a node must share with the driver to read its work items
    and produce identical results.
    """
    installed = versions("pyarrow", "mujoco-core")
    python = ".".join(installed["python"].split(".")[:2])
    return {**kinship(), **installed, "python": python}


def _travelling() -> Callable[[dict[str, str], bytes, bytes], bytes]:
    """Make the function that the processes of a cluster node execute."""

    def perform_there(must_be: dict[str, str], outfit: bytes, call: bytes) -> bytes:
        # pickled by value, since it is local: this module may be missing on a node, or
        # of another version
        import socket

        try:
            from skyarm.studies.flights.ray_cluster import perform_on_node
        except ImportError as error:
            raise ValueError(
                f"node {socket.gethostname()} cannot fly works ({error}): must have"
                f" skyarm {must_be['skyarm']}"
            ) from None
        return perform_on_node(must_be, outfit, call)

    return perform_there


_arrived: dict[bytes, list[RegistryError]] = {}
"""Errors from loading each plugin that another process sent, by the plugin's bytes."""


def perform_on_node(must_be: dict[str, str], outfit: bytes, call: bytes) -> bytes:
    """Execute a serialised call in a process of a cluster node, after a check of its
    package versions.

    Raises:
        ValueError: the node has other versions than the driver.
    """
    # versions and plugins are checked once in each process
    if outfit not in _arrived:
        has = kin()
        wrong = [name for name, version in must_be.items() if has.get(name) != version]
        if wrong:
            # twelve digits of a digest tell two apart
            here, there = (
                ", ".join(f"{name} {each.get(name, 'none')[:12]}" for name in wrong)
                for each in (has, must_be)
            )
            raise ValueError(
                f"node {socket.gethostname()} has {here}: must have {there}, as the"
                " driver"
            )
        _arrived[outfit] = equip(*unpack(outfit))
    for error in _arrived[outfit]:
        raise error
    return perform(call)
