"""Cost of the engine of many flights: beside a bare loop over a batch, in memory, and
in the driver of a cluster.

python tests/studies/bench/measure_flights.py [--flights N] [--chunk N] [--duration S]
[--rounds N] [--ray] [--out FILE]
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from bench_timing import Contender, contest, describe

from skyarm.records.files import output_file, write_atomically
from skyarm.records.travel import pack
from skyarm.scenario.scenario_file import load_scenario
from skyarm.scenario.scenario_record import Scenario
from skyarm.simulate.batch import Batch
from skyarm.studies.flights import Store, Work, WorkRunner
from skyarm.studies.flights.executor import rows_file

SCENARIO, PATH, METRICS = (
    "case3",
    "reference.base.radius",
    ("ee_error_mean", "tilt_max"),
)

SHORT = 0.1
"""s that flights last where memory is measured: they leave as many rows as long
ones."""


def works(scenario: Scenario, flights: int, chunk: int) -> Iterator[Work]:
    """Flights in chunks, as a sweep asks for them: made when there is room for them."""
    for index, first in enumerate(range(0, flights, chunk)):
        episodes = np.arange(first, min(first + chunk, flights))
        column = 0.2 + 0.2 * episodes / flights
        label = f"chunk_{index:07d}"
        yield Work(
            label=label,
            scenario=scenario,
            columns={PATH: column},
            episodes=episodes,
            metrics=METRICS,
        )


def contenders(scenario: Scenario, flights: int, chunk: int) -> list[Contender]:
    """The bare loop, the engine, and the engine that keeps its rows in a folder."""
    batch, seconds = (
        Batch(scenario, (PATH,), metrics=METRICS),
        scenario.duration * flights,
    )

    def bare() -> float:
        for work in works(scenario, flights, chunk):
            found = batch.fly(work.columns, seed=work.seed, episodes=work.episodes)
            assert len(found.status) == work.count
        return seconds

    def engine() -> float:
        with WorkRunner() as crew:
            for _ in crew.fly(works(scenario, flights, chunk)):
                pass
        return seconds

    def folder() -> float:
        with tempfile.TemporaryDirectory() as out, WorkRunner(store=Store(out)) as crew:
            for _ in crew.fly(works(scenario, flights, chunk)):
                pass
        return seconds

    return [
        Contender("bare loop", "Batch.fly, chunk after chunk", bare),
        Contender("engine", "the same works through a Crew", engine),
        Contender("engine, folder", "and their rows in files", folder),
    ]


def own_share(scenario: Scenario, flights: int, chunk: int) -> float:
    """Processor time that the engine with a folder takes itself, as a share of that
    inside ``Batch.fly``.

    Without what else differs between two runs of the same machine code.
    """
    inside, fly = [0.0], Batch.fly

    def timed(*arguments: Any, **more: Any) -> Any:
        begin = time.process_time()
        try:
            return fly(*arguments, **more)
        finally:
            inside[0] += time.process_time() - begin

    run = contenders(scenario, flights, chunk)[2].run
    Batch.fly = timed  # type: ignore[method-assign]
    try:
        begin = time.process_time()
        run()
        whole = time.process_time() - begin
    finally:
        Batch.fly = fly  # type: ignore[method-assign]
    return (whole - inside[0]) / inside[0]


def memory(flights: int, chunk: int) -> float:
    """MB that a new process takes at most to fly so many short flights into a
    folder.
    """
    command = [
        sys.executable,
        __file__,
        "--memory",
        "--flights",
        str(flights),
        "--chunk",
        str(chunk),
    ]
    return float(
        subprocess.run(command, capture_output=True, text=True, check=True).stdout
    )


def fly_for_memory(flights: int, chunk: int) -> float:
    """The same, in this process."""
    contenders(load_scenario(SCENARIO, duration=SHORT), flights, chunk)[2].run()
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return most / (1e6 if sys.platform == "darwin" else 1e3)


def echo(content: bytes) -> bytes:
    """What flies in place of a work where the driver is measured."""
    return content


def driver(calls: int, chunk: int) -> dict[str, float]:
    """Milliseconds that the driver of a cluster spends on a work, apart from its
    flights: made, sent and kept.
    """
    from skyarm.studies.flights.ray_cluster import Ray

    scenario = load_scenario(SCENARIO, duration=SHORT)
    every = list(works(scenario, calls * chunk, chunk))
    content = rows_file(every[0], {}, 1)
    found = {
        "KB of a work": len(pack((rows_file, every[1]))) / 1e3,
        "KB of its rows": len(content) / 1e3,
    }
    with tempfile.TemporaryDirectory() as out:
        store, begin = Store(out), time.perf_counter()
        for work in works(scenario, calls * chunk, chunk):
            pack((rows_file, (work, store.metadata(work), 1)))
        found["made"] = (time.perf_counter() - begin) / calls * 1e3
        begin, worked = time.perf_counter(), time.process_time()
        for work in every:
            store.put(work, content)
        found["kept"] = (time.process_time() - worked) / calls * 1e3
        found["kept, wall clock"] = (time.perf_counter() - begin) / calls * 1e3
    there = Ray("", 2)
    try:
        for _ in range(2):  # the first round starts processes
            begin, worked, done = time.perf_counter(), time.process_time(), 0
            while done < calls:
                while there.flying < there.slots and done + there.flying < calls:
                    there.submit(None, echo, content)
                there.collect()
                done += 1
            found["sent and fetched"] = (time.process_time() - worked) / calls * 1e3
            found["sent and fetched, wall clock"] = (
                (time.perf_counter() - begin) / calls * 1e3
            )
    finally:
        there.close(abandon=True)
    return found


def measure(
    flights: int, chunk: int, duration: float | None, rounds: int, *, ray: bool
) -> dict[str, Any]:
    """All of it."""
    scenario = load_scenario(SCENARIO, duration=duration)
    scores = contest(contenders(scenario, flights, chunk), rounds)
    return {
        "machine": describe(),
        "flights": flights,
        "chunk": chunk,
        "duration": scenario.duration,
        "rounds": rounds,
        "speed": [dataclasses.asdict(score) for score in scores],
        "own_share": own_share(scenario, flights, chunk),
        "memory_MB": {
            str(count): memory(count, chunk) for count in (flights, 10 * flights)
        },
        "driver_ms": driver(1000, chunk) if ray else {},
    }


def text(found: dict[str, Any]) -> str:
    """The measurements as text."""
    lines = [
        f"{found['flights']} flights of {SCENARIO}, {found['duration']:g} s each,"
        f" {found['chunk']} a work: time for the same flights, the bare loop 1"
        f" (processor time); medians of {found['rounds']} rounds"
    ]
    lines += [
        f"  {each['name']:<16} {1 / each['work_ratio']:7.4f}  {each['what']}"
        for each in found["speed"]
    ]
    lines += [
        "  outside Batch.fly, the engine and its folder take"
        f" {100 * found['own_share']:.2f} % of what is inside"
    ]
    lines += [
        f"  {int(count):>9} flights of {SHORT:g} s: {size:6.0f} MB"
        for count, size in found["memory_MB"].items()
    ]
    lines += [
        f"  driver, ms a work: {name:<28} {value:8.3f}"
        for name, value in found["driver_ms"].items()
    ]
    return "\n".join(lines)


def main(words: Sequence[str] | None = None) -> None:
    """Measure, print, and write the numbers where a file is named; exit code 2 where it
    cannot be written.
    """
    parser = argparse.ArgumentParser(
        description="Measure the engine of many flights beside a bare loop."
    )
    parser.add_argument("--flights", type=int, default=4000)
    parser.add_argument("--chunk", type=int, default=1000)
    parser.add_argument(
        "--duration", type=float, help="of a flight, s; the scenario's if left out"
    )
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument(
        "--ray", action="store_true", help="measure the driver of a Ray cluster, too"
    )
    parser.add_argument("--memory", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--out", help="write the numbers there too, as JSON")
    options = parser.parse_args(words)
    if options.memory:
        print(fly_for_memory(options.flights, options.chunk))
        return
    try:
        file = options.out and output_file(options.out, "--out")
    except OSError as error:
        parser.exit(2, f"{error}\n")
    found = measure(
        options.flights,
        options.chunk,
        options.duration,
        options.rounds,
        ray=options.ray,
    )
    print(text(found))
    if file:
        write_atomically(Path(file), (json.dumps(found, indent=1) + "\n").encode())


if __name__ == "__main__":
    main()
