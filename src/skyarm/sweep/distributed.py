"""The same chunks flown by a Ray cluster.

A chunk's file is a pure function of study and index: whoever flies it, and however often, the rows are the same.
"""

from __future__ import annotations

import os
import pickle
from collections.abc import Iterator
from typing import Any

from skyarm.files import needs_extra, versions
from skyarm.registry.plugins import Plugin, load_again, loaded
from skyarm.simulate.batch import Batch
from skyarm.simulate.workers import packed
from skyarm.sweep.plan import Plan
from skyarm.sweep.runner import fly_chunk

LOCAL = "local"
"""Address that starts a cluster on this machine."""

AHEAD = 2
"""Chunks in flight per processor: enough to keep it busy, few enough to keep memory flat."""

_COMPILED: dict[str, tuple[Plan, dict[str, Batch]]] = {}
"""What a worker keeps from one chunk to the next: the machine code of the study it last flew, by its digest."""


def require_ray() -> Any:
    """The Ray library.

    Raises:
        ValueError: it is not installed; names the extra that brings it.
    """
    try:
        import ray
    except ImportError:
        raise ValueError(f"--ray: {needs_extra('ray')}") from None
    return ray


def _join(ray: Any, address: str) -> None:
    quiet = {"log_to_driver": False, "logging_level": "error"}
    if address == LOCAL:
        # a cluster of our own has nothing to report to anyone
        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
        ray.init(address=address, include_dashboard=False, **quiet)
    else:
        ray.init(address=address, **quiet)


def _fly(pickled: bytes, digest: str, plugins: tuple[Plugin, ...], version: str, index: int) -> bytes:
    """One chunk on one core of a worker; the plan is unpickled once the plugins that it may need are loaded."""
    here = versions()["skyarm"]
    if version != here:
        raise ValueError(f"skyarm = {here} on a worker: must be {version} as where the sweep was started")
    load_again(plugins)
    if digest not in _COMPILED:
        plan: Plan = pickle.loads(pickled)
        _COMPILED.clear()
        _COMPILED[digest] = plan, plan.batches()
    plan, batches = _COMPILED[digest]
    return fly_chunk(plan, batches, index)


def fly_on_ray(plan: Plan, todo: list[int], address: str) -> Iterator[tuple[int, bytes]]:
    """Each chunk's file as the cluster finishes it; a chunk whose worker dies is flown again by another.

    Raises:
        ValueError: no Ray, no cluster at this address, or a chunk that a worker cannot fly.
    """
    ray = require_ray()
    ours = not ray.is_initialized()
    if ours:
        try:
            _join(ray, address)
        except (ConnectionError, ValueError, RuntimeError, OSError) as error:
            first = (str(error).strip().splitlines() or [type(error).__name__])[0]
            raise ValueError(f"--ray = {address!r}: must be the address of a cluster, or {LOCAL} ({first})") from None
    try:
        task = ray.remote(num_cpus=1, max_retries=-1)(_fly)
        shared, version = ray.put(packed(plan)), versions()["skyarm"]
        width = AHEAD * max(1, int(ray.cluster_resources().get("CPU", 1)))
        waiting = iter(todo)
        flying: dict[Any, int] = {}
        while True:
            while len(flying) < width and (index := next(waiting, None)) is not None:
                flying[task.remote(shared, plan.digest, loaded(), version, index)] = index
            if not flying:
                return
            (ready, *_), _ = ray.wait(list(flying), num_returns=1)
            yield flying.pop(ready), ray.get(ready)
    except ray.exceptions.RayTaskError as error:
        raise ValueError(f"--ray = {address!r}: a worker failed: {error.cause}") from None
    finally:
        if ours:
            ray.shutdown()
