"""Simulation of a work item: one compiled batch if the law can be traced, otherwise one
flight at a time.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from skyarm.log.flight_log import Log
from skyarm.log.formats import npz_content
from skyarm.log.log_columns import names_of
from skyarm.log.metrics.score import score
from skyarm.records.arrays import AnyArray as Array
from skyarm.records.arrays import doubles
from skyarm.records.path_names import agent_of, word_of
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.paths import LATE
from skyarm.scenario.scenario_record import Scenario
from skyarm.simulate.batch import Batch
from skyarm.simulate.loop import run
from skyarm.studies.flights.work import AUTOPILOT, Rows, Work

MOST_PROGRAMS = 16
"""Number of compiled simulations that a process keeps, chosen: it bounds the memory of
suites that fly hundreds."""

_programs: OrderedDict[str, Batch] = OrderedDict()


def fly(work: Work, threads: int = 1) -> Rows:
    """Simulate a work item; returns its result rows, bitwise independent of threads and
    earlier simulations.
    """
    (rows,) = fly_together([work], threads)
    return rows


def fly_together(works: Sequence[Work], threads: int = 1) -> list[Rows]:
    """Simulate work items of equal compiled program and seed as one batch; results are
    as in separate ones.
    """
    first = works[0]
    ends = np.cumsum([work.count for work in works])[:-1]
    if first.alone:
        # such a work is a group by itself (WorkRunner)
        return [{**_leading_columns(first), **_one_by_one(first)}]
    columns = {
        path: np.concatenate([np.asarray(work.columns[path]) for work in works])
        for path in first.columns
    }
    episodes = np.concatenate([np.asarray(work.episodes) for work in works])
    batch = _batch(first).fly(
        columns, seed=first.seed, episodes=episodes, threads=threads
    )
    metrics = {name: doubles(column) for name, column in batch.metrics.items()}
    flown = {**metrics, "status": batch.status.astype(str), "end_time": batch.end_time}
    parts = {name: np.split(column, ends) for name, column in flown.items()}
    return [
        {**_leading_columns(work), **{name: each[k] for name, each in parts.items()}}
        for k, work in enumerate(works)
    ]


def _leading_columns(work: Work) -> Rows:
    """Result columns that identify the flights of a work item."""
    fixed = {
        name: np.broadcast_to(np.asarray(column), work.count)
        for name, column in work.fixed.items()
    }
    drawn = {path: doubles(column) for path, column in work.columns.items()}
    return {"episode": np.asarray(work.episodes, dtype=np.uint32), **fixed, **drawn}


def _batch(work: Work) -> Batch:
    """Compiled simulation of a work item, shared with other work items of the same
    program.
    """
    # taken out and put back last: the program used longest ago is the first to go
    batch = _programs.pop(work.program, None)
    if batch is None:
        batch = Batch(
            work.scenario,
            tuple(work.columns),
            metrics=work.metrics,
            windows=work.windows,
            single=work.precision == "single",
            bit_exact=work.precision == "bit_exact",
            stiffest=work.stiffest,
            effort=work.effort,
        )
    _programs[work.program] = batch
    while len(_programs) > MOST_PROGRAMS:
        _programs.popitem(last=False)
    return batch


def _one_by_one(work: Work) -> Rows:
    """Metrics, status and end time of flights simulated one after the other; NaN for a
    metric that a flight lacks.
    """
    rows: list[dict[str, float | str | bytes]] = []
    for k in range(work.count):
        log = run(one_scenario(work, k))
        metrics = (
            score(log, _metrics_of(work, log), work.windows)
            if work.measure is None
            else work.measure(log)
        )
        status = (
            f"{AUTOPILOT}: {log.info['cause']}"
            if log.status == AUTOPILOT
            else log.status
        )
        numbers = {
            name: np.nan if value is None else float(value)
            for name, value in metrics.items()
        }
        logged = {"log": npz_content(log)} if work.keeps_log else {}
        rows.append(
            {
                **numbers,
                "status": status,
                "end_time": float(log.info["end_time"]),
                **logged,
            }
        )
    names = dict.fromkeys(name for row in rows for name in row)
    return {name: _column([row.get(name, np.nan) for row in rows]) for name in names}


def _metrics_of(work: Work, log: Log) -> list[str]:
    """Names of the metrics of a single flight, without efforts of joints that are
    commanded by setpoints.
    """
    units = (
        unit
        for own in log.agents.values()
        for unit in enumerate(names_of(own).setpoints)
    )
    setpoints = {f"tau{i + 1}_rms" for i, unit in units if unit is not None}
    return [name for name in work.metrics if name not in setpoints]


def _column(values: list[float | str | bytes]) -> Array:
    # numpy's own bytes lose zeros at their end, and a log may end with some
    return np.array(values, dtype=object if isinstance(values[0], bytes) else None)


def one_scenario(work: Work, k: int) -> Scenario:
    """Scenario of a single flight of a work item, with its command delays rounded to
    whole physics steps.
    """
    numbers = {path: float(column[k]) for path, column in work.columns.items()}
    late = {path: numbers.pop(path) for path in [*numbers] if word_of(path) == LATE}
    single = replace(
        with_numbers(work.scenario, numbers),
        seed=work.seed,
        episode=int(work.episodes[k]),
    )
    agents = dict(single.agents)
    rate = single.rates.physics
    for path, seconds in late.items():
        name = agent_of(path) or next(iter(agents))
        delays = replace(
            agents[name].delays,
            command=round(seconds * rate) / rate,
            # a flight by itself needs no room for later commands
            longest_command=None,
        )
        agents[name] = replace(agents[name], delays=delays)
    return replace(single, agents=agents) if late else single
