"""Engines and environments beside those of other libraries, where these are installed.

make peers  # installs them into .venv-peers; every contender once
.venv-peers/bin/python tests/studies/bench/measure_peers.py [--quick | --small]

Ratios within each round, as ``make bench``: MuJoCo, MJX, Pinocchio, crazyflow, RotorPy
and JAX beside the paper's vehicle; a six-joint arm; a quadrotor without an arm;
contact; environments; growth of a step with the arm's joints.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

# the tests' own vehicles, when this is run as a program
sys.path.append(str(Path(__file__).parents[2]))

import bench_engines as engines
import contact_speed
import growth
import peers
from bench_timing import Contender, contest, cores
from measure_engines import SCENARIO, speed_lines

from skyarm.scenario.scenario_file import load_scenario
from skyarm.vehicle.vehicle_files import load_vehicle


@dataclass(frozen=True)
class Size:
    """Extent of a measurement.

    Attributes:
        rounds: of each group but the environments, which have ``more`` times as many.
        seconds: simulated, of the paper's vehicle (None: as its file has it), of skids,
            of a long arm, without an arm.
        blocks: flights of a thread. worlds: of crazyflow, a contender each. joints: of
            the growing arm.
        extent: of the environments.
    """

    rounds: int
    more: int
    seconds: tuple[float | None, float, float, float]
    blocks: int
    worlds: tuple[int, ...]
    joints: range
    extent: peers.Extent = peers.USUAL


WHOLE = Size(9, 4, (None, 10.0, 5.0, 30.0), 8, (1024, 4096, 16384), range(0, 13, 2))
QUICK = replace(WHOLE, rounds=3, seconds=(10.0, 3.0, 1.0, 5.0))
SMALL = Size(
    1, 1, (0.5, 0.1, 0.1, 0.1), 1, (16,), range(0, 3, 2), peers.Extent(16, 2, 5)
)
"""Every contender flies; its rate means nothing."""


def groups(size: Size) -> Iterator[tuple[str, list[Contender], int]]:
    """Title, contenders and how many times the usual rounds; the first of a group is
    its baseline.
    """
    threads, blocks = cores(), size.blocks * cores()
    whole, skids, long_arm, no_arm = size.seconds
    scenario = load_scenario(SCENARIO, duration=whole)
    vehicle = scenario.plant.vehicle
    flown = {"rk4": engines.Flight.of(scenario, engines.steps_of(scenario))}
    ours = engines.native(flown, threads, 2 * blocks)
    theirs = [
        engines.mujoco_rollout(vehicle, threads),
        *peers.pinocchio(vehicle),
        *peers.guests(vehicle),
    ]
    yield scenario.name, [*theirs, *peers.jax(scenario, threads), *ours], 1
    long = peers.six_joints(long_arm)
    flown = {
        name: flight
        for name, flight in engines.flights(long).items()
        if name != "noise"
    }
    rollout = engines.mujoco_rollout(long.plant.vehicle, threads)
    yield (
        "hexarotor with a six-joint arm",
        [rollout, *engines.native(flown, threads, blocks)],
        1,
    )
    if peers.installed("crazyflow"):
        bare = peers.bare_quadrotor(no_arm, threads, 8 * blocks)
        yield (
            "a quadrotor without an arm",
            [*(peers.crazyflow(worlds) for worlds in size.worlds), bare],
            1,
        )
    yield (
        "standing on four skids",
        contact_speed.standing_contenders(skids, threads, blocks),
        1,
    )
    for group in (peers.environments(size.extent), *peers.peers(size.extent)):
        if group:
            yield (
                f"steps of a world per second, beside {group[0].name}",
                group,
                size.more,
            )


def main(words: Sequence[str] | None = None) -> None:
    """Print what is measured."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    extent = parser.add_mutually_exclusive_group()
    for name, size, text in (
        ("--quick", QUICK, "fewer rounds, shorter flights"),
        (
            "--small",
            SMALL,
            "each contender once, as short as it can be: shows that all fly",
        ),
    ):
        extent.add_argument(
            name,
            dest="size",
            action="store_const",
            const=size,
            default=WHOLE,
            help=text,
        )
    size = parser.parse_args(words).size
    from jax_kernel import configure_cpu

    configure_cpu()  # before anyone starts JAX
    for title, contenders, times in groups(size):
        scores = contest(contenders, times * size.rounds)
        print(
            "",
            title,
            *speed_lines([vars_of(score) for score in scores]),
            sep="\n",
            flush=True,
        )
    print(
        "",
        "RK4 step by joints",
        *growth.growth(load_vehicle("hexarotor_arm6"), size.joints),
        sep="\n",
    )
    if missing := peers.absent():
        print("", f"not installed, not measured: {', '.join(missing)}", sep="\n")


def vars_of(score: object) -> dict[str, object]:
    """Fields of a score."""
    return {name: getattr(score, name) for name in score.__slots__}  # type: ignore[attr-defined]


if __name__ == "__main__":
    main()
