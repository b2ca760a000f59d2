"""Plan many tasks: the tables of docs/data/results_planning.md on solutions.

    python tests/planning/measure_plans.py tasks|scenes [--small]

``tasks``: the shipped tasks, each planned three times in this process. ``scenes``:
drawn tasks. ``goals`` are tip goals within 3 m of ``hexarotor_arm6`` in 1.6 s,
``boxes``, ``windows`` and ``shelves`` have obstacles. Beside each, how many of them
minimum snap flies without a fault. The draws follow from the seed 5.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

# the tests' own modules, when this is run as a program
sys.path.append(str(Path(__file__).parents[1]))

from skyarm.algebra import Vec3
from skyarm.planning.planner import Plan, PlanError, plan, tip_below
from skyarm.planning.seeds import ways_around
from skyarm.planning.task import Goal, PlanPhase, Start, Task, list_tasks, load_task
from skyarm.scenario.scenario_file import scenario_from
from skyarm.scenario.scenario_record import ScenarioError
from skyarm.studies.assess.along_reference import along_reference
from skyarm.vehicle.vehicle_files import load_vehicle
from skyarm.world.contact.surface import Surface
from skyarm.world.scene.vehicle_shapes import boom_and_disc
from support.measured_tables import print_table, progress

FOLDED = (0.0, 0.6, -1.2, 0.0, 0.6, 0.0)
"""Joints (rad) of ``hexarotor_arm6`` at the beginning."""


def goal(rng: np.random.Generator) -> Task:
    """Tip goal within 3 m, in 1.6 s."""
    task = Task(
        vehicle=load_vehicle("hexarotor_arm6"),
        start=Start(joints=FOLDED),
        phases=(PlanPhase(),),
    )
    place = tip_below(task, np.array(FOLDED)) + rng.uniform(
        [-3.0, -3.0, -1.0], [3.0, 3.0, 1.0]
    )
    to = Goal(tip=Vec3(*place.tolist()), heading=0.0, rest=True)
    return dataclasses.replace(
        task, phases=(PlanPhase(name="goal", to=to, duration=1.6),)
    )


def box(rng: np.random.Generator) -> Task:
    """Flight of 4 m past a box somewhere on the straight way."""
    angle = rng.uniform(-np.pi, np.pi)
    end = np.array([4.0 * np.cos(angle), 4.0 * np.sin(angle), rng.uniform(-0.5, 0.5)])
    size, place = (
        2.0 * rng.uniform([0.2, 0.2, 0.3], [0.5, 0.5, 1.0]),
        end * rng.uniform(0.45, 0.55),
    )
    place = place + 0.2 * rng.normal(size=3)
    obstacle = Surface(
        name="box",
        shape="box",
        size=tuple(size.tolist()),
        position=Vec3(*place.tolist()),
    )
    return _flight(end, (obstacle,), 2.4)


def window(rng: np.random.Generator) -> Task:
    """Flight through a window of 0.6 m in a wall, somewhere beside the straight way."""
    y, z = rng.uniform(-0.6, 0.6), rng.uniform(-0.4, 0.6)
    wall, half, edge = 2.0, 0.3, 4.0
    pieces = {
        "left": ((0.1, edge, 2 * edge), (wall, y + half + 0.5 * edge, z)),
        "right": ((0.1, edge, 2 * edge), (wall, y - half - 0.5 * edge, z)),
        "above": ((0.1, 2 * half, edge), (wall, y, z + half + 0.5 * edge)),
        "below": ((0.1, 2 * half, edge), (wall, y, z - half - 0.5 * edge)),
    }
    walls = [
        Surface(name=k, shape="box", size=size, position=Vec3(*place))
        for k, (size, place) in pieces.items()
    ]
    task = _flight(np.array([4.0, 0.0, 0.0]), tuple(walls), 3.0)
    return dataclasses.replace(
        task, vehicle=load_vehicle("hummingbird_arm2_rotors"), start=Start()
    )


def shelf(rng: np.random.Generator) -> Task:
    """Tip goal between two boards of a shelf."""
    place = np.array(
        [rng.uniform(1.2, 2.2), rng.uniform(-0.8, 0.8), rng.uniform(-0.5, 0.5)]
    )
    boards = [
        Surface(
            name=name,
            shape="box",
            size=(0.4, 1.2, 0.03),
            position=Vec3(place[0] + 0.1, place[1], place[2] + up),
        )
        for name, up in (("upper", 0.25), ("lower", -0.2))
    ]
    task = goal(rng)
    to = Goal(tip=Vec3(*place.tolist()), heading=0.0, rest=True)
    return dataclasses.replace(
        task,
        obstacles=tuple(boards),
        phases=(PlanPhase(name="reach", to=to, duration=2.5),),
    )


def _flight(end: np.ndarray, obstacles: tuple[Surface, ...], duration: float) -> Task:
    """Flight of the base to a place past obstacles."""
    phase = PlanPhase(
        name="flight",
        to=Goal(base=Vec3(*end.tolist()), heading=0.0, rest=True),
        duration=duration,
    )
    start = Start(joints=FOLDED)
    return Task(
        vehicle=load_vehicle("hexarotor_arm6"),
        start=start,
        phases=(phase,),
        obstacles=obstacles,
    )


def by_waypoints(task: Task) -> str:
    """Fault of the same task by minimum snap, its arm still or by inverse kinematics;
    empty if there is none.

    The base takes the planner's own way around the obstacles, in the task's time;
    ``skyarm check`` judges the motion.
    """
    phase, vehicle = task.phases[0], task.vehicle
    arm = task.start.joints or (0.0,) * vehicle.n
    tables: dict[str, Any] = {
        "schema": 1,
        "name": "by_waypoints",
        "duration": phase.duration,
        "plant": {"vehicle": vehicle.name},
        "controller": {"preset": "centroidal_joint"},
        "environment": {"ground": False},
        "reference": {"joints": [{"kind": "constant", "value": q} for q in arm]},
    }
    if task.obstacles:
        rows = [
            {
                "name": o.name,
                "shape": o.shape,
                "size": [*o.size],
                "position": [*o.position],
            }
            for o in task.obstacles
        ]
        tables["world"] = {"surfaces": rows}
    start = np.zeros(3)
    if phase.to.tip is not None:
        points = [[*tip_below(task, np.array(arm))], [*phase.to.tip]]
        moving = {"kind": "waypoints", "points": points, "times": [0.0, phase.duration]}
        tables["reference"] = {"tip": {"path": moving, "posture": [*arm]}}
    else:
        way = ways_around(
            task.obstacles,
            start,
            np.array([*phase.to.base]),
            float(sum(boom_and_disc(vehicle))),
        )[:2][-1]
        lengths = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1))]
        times = phase.duration * lengths / lengths[-1]
        tables["reference"]["base"] = {
            "kind": "waypoints",
            "points": way.tolist(),
            "times": times.tolist(),
        }
    try:
        findings = along_reference(scenario_from(tables), clearance=True)
    except ScenarioError as error:
        return str(error)
    wrong = [each for each in findings if each.level != "ok"]
    return "; ".join(each.question for each in wrong)


KINDS = {
    "goals": (goal, 100),
    "boxes": (box, 200),
    "windows": (window, 200),
    "shelves": (shelf, 200),
}
"""Scenes and their numbers."""

SEED = 5


def scenes(small: bool) -> Iterator[tuple[object, ...]]:
    """Rows: kind of scene, number, solved ones, processor time, smallest distance,
    those that minimum snap solves.
    """
    for kind, (draw, count) in KINDS.items():
        rng, found, spent, faults = (
            np.random.default_rng(SEED),
            list[Plan](),
            list[float](),
            Counter[str](),
        )
        for _ in range(2 if small else count):
            task, begun = draw(rng), time.process_time()
            try:
                found.append(plan(task))
            except PlanError as error:
                progress(str(error))
            spent.append(time.process_time() - begun)
            faults[by_waypoints(task)] += 1
        gaps = [1e3 * each.nearest.gap for each in found if each.nearest is not None]
        for fault, number in faults.items():
            progress(f"{kind}, minimum snap: {number} with {fault or 'no fault'}")
        seconds = f"{np.median(spent):.2f}", f"{max(spent):.2f}"
        yield (
            kind,
            len(spent),
            len(found),
            *seconds,
            f"{min(gaps, default=np.nan):.0f}",
            faults[""],
        )


def tasks(small: bool) -> Iterator[tuple[object, ...]]:
    """Rows: shipped task, its nodes, least processor time of three solutions, seeds,
    iterations, what is violated.
    """
    for name in list_tasks()[: 1 if small else None]:
        task, spent = load_task(name), list[float]()
        for _ in range(2 if small else 4):  # the first traces the task's functions, too
            begun = time.process_time()
            found = plan(task)
            spent.append(time.process_time() - begun)
        numbers = (
            f"{min(spent[1:]):.2f}",
            found.seeds,
            found.solution.iterations,
            f"{found.solution.violation:.1e}",
        )
        yield name, len(found.t), *numbers


TABLES = {
    "tasks": (
        tasks,
        (
            "task",
            ">nodes",
            ">processor time, s",
            ">seeds",
            ">iterations of the best",
            ">violation",
        ),
    ),
    "scenes": (
        scenes,
        (
            "scenes",
            ">number",
            ">planned",
            ">median time, s",
            ">longest time, s",
            ">smallest distance, mm",
            ">by minimum snap",
        ),
    ),
}


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("table", choices=TABLES)
    parser.add_argument(
        "--small",
        action="store_true",
        help="two scenes of each kind, or one task: seconds",
    )
    words = parser.parse_args()
    rows, heads = TABLES[words.table]
    print_table(heads, rows(words.small))
