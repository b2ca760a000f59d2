"""Measure vehicles that hold one body: the tables of docs/data/results_teams.md.

    python tests/world/contact/measure_teams.py shares|loads|plants|sizes [--small]

``shares``: force of every grasp by statics and at the end of a hover of 20 s.
``loads``: errors and forces of the shipped scenarios. ``plants``: the same flights on
MuJoCo, with our springs and with its own constraints of equal stiffness. ``sizes``:
time and code of a control period of 1 to 8 equal vehicles.
"""

from __future__ import annotations

import argparse
import dataclasses
import os
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

# the tests' own modules, when this is run as a program
sys.path.append(str(Path(__file__).parents[2]))

import skyarm
from skyarm.simulate.engine import Engine, EpisodeCode
from support.measured_tables import print_table, progress
from support.teams import team

LOADS = ("two_hold_a_bar", "three_on_a_triangle", "two_on_cables")
PULLS = {
    "bar": {"left_bar": 0.5, "right_bar": 0.5},
    "triangle": {
        "right_plate": 0.18415 / 0.4623,
        "front_plate": 0.094 / 0.4623,
        "left_plate": 0.18415 / 0.4623,
    },
    "cables": {"left_bar": 0.5, "right_bar": 0.5},
}
"""Share of the body's weight that each grasp bears, by the balance of moments about the
other grasps."""


def shares(small: bool):
    """Rows: team, grasp, force by statics and flown."""
    for name, parts in PULLS.items():
        scenario = team(name, duration=2.0 if small else 20.0)
        (body,) = scenario.world.objects
        log = skyarm.run(scenario)
        for k, (grasp, share) in enumerate(parts.items()):
            wanted, flown = share * float(body.mass) * 9.81, log.grasp_force[-1, k]
            yield (
                scenario.name,
                grasp,
                f"{100 * share:.1f}",
                f"{wanted:.5f}",
                f"{flown:.5f}",
            )


def loads(small: bool):
    """Rows: scenario, agent, errors, largest force of its grasp, largest tilt of the
    body.
    """
    for name in LOADS:
        scenario = skyarm.load_scenario(name, **({"duration": 2.0} if small else {}))
        log = skyarm.run(scenario)
        tilt = 2.0 * np.degrees(
            np.arcsin(
                np.minimum(1.0, np.linalg.norm(log.object_quaternion[:, 1:3], axis=1))
            )
        )
        for k, (agent, each) in enumerate(log.agents.items()):
            error = 1e3 * np.linalg.norm(
                each.position - each.position_reference, axis=1
            )
            late = error[log.time > 1.0]
            force = log.grasp_force[1:, k]
            numbers = (late.mean(), late.max(), force.min(), force.max(), tilt.max())
            yield name, agent, *(f"{number:.3g}" for number in numbers)


def plants(small: bool):
    """Rows: scenario, closure, largest difference of the body's pose and of the forces
    from the own plant.
    """
    for name in LOADS:
        scenario = skyarm.load_scenario(name, duration=1.0 if small else 10.0)
        own = skyarm.run(scenario)
        for closure in ("spring", "weld"):
            if closure == "weld" and name == "two_on_cables":
                continue
            other = skyarm.run(
                dataclasses.replace(scenario.with_kind("mujoco"), closure=closure)
            )
            place = (
                1e3
                * np.linalg.norm(
                    own.object_position - other.object_position, axis=1
                ).max()
            )
            turn = (
                2e3
                * np.linalg.norm(
                    own.object_quaternion - other.object_quaternion, axis=1
                ).max()
            )
            after = own.time > 0.5
            force = np.abs(own.grasp_force - other.grasp_force)[after].max()
            yield name, closure, f"{place:.2g}", f"{turn:.2g}", f"{force:.2g}"


def sizes(small: bool):
    """Rows: law, number of vehicles, time of a period and of its compilation, in
    multiples of one vehicle's.
    """
    one = skyarm.load_scenario("case3", duration=2.0 if small else 10.0)
    for law in ("paper_ct", "centroidal_tip"):
        alone = (
            one.agent
            if law == "paper_ct"
            else skyarm.load_scenario("case3", controller=law).agent
        )
        teams = {
            n: dataclasses.replace(one, agents={f"a{i}": alone for i in range(n)})
            for n in (1, 2, 4, 8)
        }
        best = {n: np.full(2, np.inf) for n in teams}
        # in turn, so that all meet the same machine
        for _ in range(2 if small else 12):
            for n, scenario in teams.items():
                with tempfile.TemporaryDirectory() as folder:
                    os.environ["SKYARM_CACHE"] = folder
                    begun = time.process_time()
                    engine = Engine(EpisodeCode(scenario))
                    compiled, begun = time.process_time() - begun, time.process_time()
                    while engine.fly(scenario.steps):
                        pass
                    period = 1e6 * (time.process_time() - begun) / engine.tick
                best[n] = np.minimum(best[n], (period, compiled))
        for n, numbers in best.items():
            more = numbers / best[1]
            yield (
                law,
                n,
                f"{numbers[0]:.2f}",
                f"{more[0]:.1f}",
                f"{numbers[1]:.2f}",
                f"{more[1]:.1f}",
            )


TABLES = {
    "shares": (
        shares,
        ("scenario", "grasp", ">share, %", ">by statics, N", ">flown, N"),
    ),
    "loads": (
        loads,
        (
            "scenario",
            "agent",
            ">mean error, mm",
            ">largest error, mm",
            ">smallest force, N",
            ">largest force, N",
            ">largest tilt of the body, deg",
        ),
    ),
    "plants": (
        plants,
        ("scenario", "`closure`", ">place, mm", ">attitude, mrad", ">force, N"),
    ),
    "sizes": (
        sizes,
        (
            "law",
            ">vehicles",
            ">time of a period, us",
            ">period, relative to one",
            ">time of compiling, s",
            ">compiling, relative to one",
        ),
    ),
}


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("table", choices=TABLES)
    parser.add_argument("--small", action="store_true", help="short flights: seconds")
    given = parser.parse_args()
    rows, heads = TABLES[given.table]
    progress(f"{given.table}:")
    print_table(heads, rows(given.small))


if __name__ == "__main__":
    main()
