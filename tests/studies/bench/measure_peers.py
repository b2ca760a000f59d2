"""Engines and environments beside those of other libraries, where these are installed.

python tests/studies/bench/measure_peers.py [--quick]

Ratios within each round, as ``make bench``: MuJoCo, MJX, Pinocchio, crazyflow, RotorPy and JAX beside the paper's
vehicle; a six-joint arm; a quadrotor without an arm; contact; environments; growth of a step with the arm's joints.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import bench_engines as engines
import contact_speed
import growth
import peers
from bench_timing import Contender, contest, cores
from measure_engines import SCENARIO, speed_lines

from skyarm.scenario.scenario_file import load_scenario
from skyarm.vehicle.vehicle_files import load_vehicle

WORLDS = (1024, 4096, 16384)


def groups(quick: bool) -> Iterator[tuple[str, list[Contender], int]]:
    """Title, contenders and how many times the usual rounds; the first of a group is its baseline."""
    threads, seconds = cores(), 3.0 if quick else 10.0
    scenario = load_scenario(SCENARIO, duration=10.0 if quick else None)
    vehicle = scenario.plant.vehicle
    flown = {"rk4": engines.Flight.of(scenario, engines.steps_of(scenario))}
    ours = engines.native(flown, threads, 16 * threads)
    theirs = [engines.mujoco_rollout(vehicle, threads), *peers.pinocchio(vehicle), *peers.guests(vehicle)]
    yield scenario.name, [*theirs, *peers.jax(scenario, threads), *ours], 1
    long = peers.six_joints(1.0 if quick else 5.0)
    flown = {name: flight for name, flight in engines.flights(long).items() if name != "noise"}
    rollout = engines.mujoco_rollout(long.world.vehicle, threads)
    yield "hexarotor with a six-joint arm", [rollout, *engines.native(flown, threads, 8 * threads)], 1
    if peers.installed("crazyflow"):
        bare = peers.bare_quadrotor(5.0 if quick else 30.0, threads, 64 * threads)
        yield "a quadrotor without an arm", [*(peers.crazyflow(worlds) for worlds in WORLDS), bare], 1
    yield "standing on four skids", contact_speed.standing_contenders(seconds, threads, 8 * threads), 1
    for group in (peers.environments(), *peers.peers()):
        if group:
            yield f"steps of a world per second, beside {group[0].name}", group, 4


def main(words: Sequence[str] | None = None) -> None:
    """Print what is measured."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="fewer rounds, shorter flights")
    quick = parser.parse_args(words).quick
    sys.path.insert(0, str(Path(__file__).parents[2]))
    from jax_kernel import configure_cpu

    configure_cpu()  # before anyone starts JAX
    for title, contenders, times in groups(quick):
        scores = contest(contenders, times * (3 if quick else 9))
        print("", title, *speed_lines([vars_of(score) for score in scores]), sep="\n")
    print("", "RK4 step by joints", *growth.growth(load_vehicle("hexarotor_arm6"), range(0, 13, 2)), sep="\n")


def vars_of(score: object) -> dict[str, object]:
    """Fields of a score."""
    return {name: getattr(score, name) for name in score.__slots__}  # type: ignore[attr-defined]


if __name__ == "__main__":
    main()
