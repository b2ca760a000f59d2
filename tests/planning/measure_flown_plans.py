"""Fly plans under several laws: the tables of docs/data/results_planning.md.

    python tests/planning/measure_flown_plans.py flown|tilted|caught [--small]

``flown``: tip at the catch, and over the flight, with a perfect state, on both plants.
``tilted``: a plan through a tilt of 90 degrees. ``caught``: how often the claw takes
the ball and carries it to the end, with noise, a known delay and masses that the law
does not know. An interrupted ``caught`` continues in out/flown_plans.
"""

from __future__ import annotations

import argparse
import contextlib
import copy
import sys
import tempfile
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

# the tests' own modules, when this is run as a program
sys.path.append(str(Path(__file__).parents[1]))

import skyarm
from skyarm.planning.plan_file import plan_bytes
from skyarm.planning.plan_report import SETTLE, flight_document
from skyarm.planning.planner import Plan
from skyarm.records.files import write_atomically
from skyarm.scenario.save import scenario_text
from skyarm.studies.sweep.design import values
from skyarm.studies.sweep.intervals import wilson
from skyarm.studies.sweep.plan import at_episode
from skyarm.studies.sweep.runner import fly_sweep
from skyarm.studies.sweep.study_file import study_from
from support.measured_tables import print_table, progress

FOLDER = Path("out/flown_plans")

LAWS: dict[str, dict[str, Any] | None] = {
    "centroidal": None,  # as the scenario that 'skyarm plan' writes has it
    "nmpc": {"law": "nmpc", "mode": "plan"},
    "hybrid_computed_torque": {"law": "hybrid_computed_torque"},
    "decoupled_pd": {"law": "decoupled_pd"},
}

NOISE = {
    "position": 1e-3,
    "velocity": 0.01,
    "attitude": 2e-3,
    "rate": 0.01,
    "joints": 1e-3,
    "joint_rates": 0.01,
}
DELAY = 0.005
SPREAD = 0.2


@cache
def planned(task: str) -> Plan:
    """Plan of a shipped task."""
    return skyarm.plan(skyarm.load_task(task))


def flight(task: str, law: str, **tables: Any) -> dict[str, Any]:
    """Tables of a flight of a task's plan under a law; its plan lies in the folder."""
    found, file = planned(task), FOLDER / f"{task}.npz"
    FOLDER.mkdir(parents=True, exist_ok=True)
    write_atomically(file, plan_bytes(found))
    document = copy.deepcopy(flight_document(found, file, found.task.vehicle.name))
    for name, entries in tables.items():
        document[name] = {**document.get(name, {}), **entries}
    own = LAWS[law]
    return document if own is None else {**document, "controller": own}


def three_digits(number: float) -> str:
    """A number with three digits that count, without an exponent."""
    return f"{float(f'{number:.3g}'):g}"


def flown(small: bool) -> Iterator[tuple[object, ...]]:
    """Rows: task, law, tip when the claw closes and in the hold, largest tip error,
    largest distance of both plants.
    """
    for task in (
        ("catch_a_ball",)
        if small
        else ("eagle_catch", "eagle_catch_free", "catch_a_ball")
    ):
        begin, end = (
            SETTLE + planned(task).t[edge] for edge in planned(task).edges[1:3]
        )
        for law in ("centroidal", "nmpc") if small else LAWS:
            log, twin = (
                skyarm.run(
                    skyarm.scenario_from(flight(task, law, plant={"kind": plant}))
                )
                for plant in ("rigid_body", "mujoco")
            )
            off = 1e3 * np.linalg.norm(log.tip - log.tip_reference, axis=1)
            speed = np.linalg.norm(np.gradient(log.tip, log.time, axis=0), axis=1)
            k = int(np.searchsorted(log.time, begin - 1e-6))
            during = slice(k, int(np.searchsorted(log.time, end + 1e-6)))
            both = min(log.time.size, twin.time.size)
            apart = 1e3 * np.linalg.norm(log.tip[:both] - twin.tip[:both], axis=1).max()
            numbers = (off[k], speed[k], off[during].max(), off.max(), apart)
            yield f"`{task}`", f"`{law}`", *map(three_digits, numbers)


def tilted(small: bool) -> Iterator[tuple[object, ...]]:
    """Rows: law, plant, largest tilt, largest error of base and tip, error where the
    base is tilted most.
    """
    for law in ("nmpc",) if small else ("centroidal", "nmpc"):
        for plant in ("rigid_body",) if small else ("rigid_body", "mujoco"):
            document = flight("passthrough", law, plant={"kind": plant})
            if law == "centroidal":
                document["controller"] = {
                    "law": law,
                    "mode": "joint",
                    "bandwidth": 1.0,
                    "tilt": 8.7,
                }
            log = skyarm.run(skyarm.scenario_from(document))
            base, tip = (
                1e3
                * np.linalg.norm(
                    getattr(log, name) - getattr(log, f"{name}_reference"), axis=1
                )
                for name in ("position", "tip")
            )
            x, y = log.quaternion[:, 1:3].T
            tilt = np.degrees(
                np.arccos(np.clip(1.0 - 2.0 * (x * x + y * y), -1.0, 1.0))
            )
            at = int(
                np.searchsorted(
                    log.time,
                    SETTLE + planned("passthrough").t[planned("passthrough").edges[2]],
                )
            )
            numbers = (tilt[at], base[at], base.max(), tip.max())
            yield f"`{law}`", f"`{plant}`", *map(three_digits, numbers)


def study_of(law: str, flights: int) -> dict[str, Any]:
    """Tables of the study in which a law flies the shipped catch of a ball."""
    file = FOLDER / f"{law}.toml"
    scenario = flight("catch_a_ball", law, sensors=NOISE, delays={"measurement": DELAY})
    scenario["reference"] = {**scenario["reference"], "file": "catch_a_ball.npz"}
    write_atomically(file, scenario_text(scenario).encode())
    vehicle = planned("catch_a_ball").task.vehicle
    masses = {"base": float(vehicle.base.mass)}
    masses |= {
        f"links.{link.name}.body": float(link.body.mass) for link in vehicle.links
    }
    vary = {
        f"plant.vehicle.{part}.mass": {
            "uniform": [mass * (1.0 - SPREAD), mass * (1.0 + SPREAD)]
        }
        for part, mass in masses.items()
    }
    return {
        "schema": 1,
        "name": f"caught_{law}",
        "scenario": str(file.resolve()),
        "episodes": flights,
        "seed": 1,
        "metrics": ["object_last_x", "object_last_z"],
        "vary": vary,
        "chunk": 50,
    }


def ends(law: str, flights: int) -> np.ndarray:
    """Where the ball is at the end of each flight, (flights, 2): x and z in m; NaN if
    the flight ended early.
    """
    table = study_of(law, flights)
    if law != "nmpc":
        rows = fly_sweep(table, FOLDER / f"{law}_{flights}")
        (label,) = rows.controllers
        over = rows.of(label, "status") == "completed"
        return np.where(
            over, [rows.of(label, f"object_last_{axis}") for axis in "xz"], np.nan
        ).T
    # a law that is not compiled flies alone: the same draws and noise, one line of a
    # file each
    study, file = study_from(table), FOLDER / f"{law}_{flights}.csv"
    lines = file.read_text().splitlines() if file.is_file() else []
    (label,) = study.scenarios
    for k in range(len(lines), flights):
        drawn = {path: column[0] for path, column in values(study, [k]).items()}
        log = skyarm.run(at_episode(study, label, drawn, k))
        place = log.object_position[-1] if log.status == "completed" else [np.nan] * 3
        lines.append(
            f"{place[0]!r},{place[2]!r}".replace("np.float64(", "").replace(")", "")
        )
        write_atomically(file, "\n".join(lines).encode())
        progress(f"{law}: {k + 1} of {flights}")
    return np.array([[float(number) for number in line.split(",")] for line in lines])


def caught(small: bool) -> Iterator[tuple[object, ...]]:
    """Rows: law, flights, flights at whose end the claw holds the ball, their share
    with its interval.
    """
    for law in ("centroidal", "nmpc") if small else LAWS:
        count = (2 if law == "nmpc" else 8) if small else (25 if law == "nmpc" else 200)
        places = ends(law, count)
        # the end of the plan is at x = 3, z = 1.5; the stand at x = 0, z = 0, and what
        # falls goes on falling
        won = int(np.sum((np.abs(places[:, 0] - 3.0) < 0.5) & (places[:, 1] > 0.5)))
        low, high = wilson(won, count)
        yield (
            f"`{law}`",
            count,
            won,
            f"{100.0 * won / count:.1f}",
            f"{100.0 * low:.1f} to {100.0 * high:.1f}",
        )


TABLES = {
    "flown": (
        flown,
        (
            "task",
            "law",
            ">tip at the catch, mm",
            ">its speed there, m/s",
            ">tip in the hold, mm",
            ">tip over the flight, mm",
            ">plants apart, mm",
        ),
    ),
    "tilted": (
        tilted,
        (
            "law",
            "plant",
            ">tilt in the gap, deg",
            ">base there, mm",
            ">base, mm",
            ">tip, mm",
        ),
    ),
    "caught": (
        caught,
        ("law", ">flights", ">ball caught", ">share, %", ">interval of 95 %, %"),
    ),
}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("table", choices=TABLES)
    parser.add_argument(
        "--small", action="store_true", help="few short flights: seconds"
    )
    given = parser.parse_args()
    rows, heads = TABLES[given.table]
    progress(f"{given.table}:")
    # few flights begin anew; the many go on where they were interrupted
    with (
        tempfile.TemporaryDirectory() as folder,
        contextlib.chdir(folder if given.small else "."),
    ):
        print_table(heads, rows(given.small))


if __name__ == "__main__":
    main()
