"""Everything measured in one run, as a record for JSON and as text."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

from skyarm.bench import contact_speed
from skyarm.bench import engines as ours
from skyarm.bench import peers as others
from skyarm.bench.counts import counts, growth
from skyarm.bench.engines import accuracy
from skyarm.bench.latency import latency
from skyarm.bench.peers import PEERS, crazyflow, environments, guests, installed, peers
from skyarm.bench.timing import Contender, contest, cores, describe, start
from skyarm.compile.jax.jax_cpu import configure_cpu
from skyarm.compile.llvm.kernel import require_machine_code
from skyarm.scenario.scenario_file import load_scenario
from skyarm.vehicle.vehicle_files import load_vehicle

SCENARIO = "case2_gust"
LONG_ARM = "hexarotor_arm6"
CRAZYFLOW_WORLDS = (1024, 4096, 16384)
COMPARED = (*PEERS, "rotorpy", "mujoco.mjx", "gymnasium")
"""What is compared only where it is installed, by the name that it is imported by."""

Progress = Callable[[str], None]


def measure(*, quick: bool = False, progress: Progress = lambda _: None) -> dict[str, Any]:
    """Run all benchmarks.

    Args:
        quick: fewer rounds and shorter flights, and no growth with the number of joints; a minute in place of several.
        progress: is told what runs.

    Raises:
        NoMachineCodeError: it is what is measured.
    """
    require_machine_code()
    configure_cpu()  # before anyone starts JAX
    about = describe()
    threads, rounds = cores(), 3 if quick else 9
    scenario = load_scenario(SCENARIO, duration=10.0 if quick else None)
    progress("compile")
    flown = ours.flights(scenario)
    vehicle = scenario.world.vehicle
    blocks = 16 * threads
    contenders = [
        others.mujoco_rollout(vehicle, threads),
        others.mujoco_rollout(vehicle, threads, 200, "rk4"),
        others.mujoco_step(vehicle),
        *others.pinocchio(vehicle),
        *guests(vehicle),
        *ours.native(flown, threads, blocks),
        *(ours.native({"rk4": flown["rk4"]}, 1, 16) if threads > 1 else []),
        ours.python(flown["rk4"]),
        *ours.jax(scenario, threads),
    ]

    def scores(entered: Sequence[Contender], times: int = 1) -> list[dict[str, Any]]:
        return [dataclasses.asdict(score) for score in contest(entered, times * rounds, progress)]

    found: dict[str, Any] = {
        "schema": 1,
        "machine": about,
        "scenario": {"name": scenario.name, "seconds": scenario.duration, "rounds": rounds, "threads": threads},
        "speed": scores(contenders),
        "long_arm": scores(_long_arm(threads, quick)),
        "bare": scores(_bare(threads, quick)),
        "contact": {name: scores(each) for name, each in _contact(threads, quick).items()},
        "environments": scores(environments(), 4),
        "environment_peers": [scores(each, 4) for each in peers()],
        "not_installed": [name for name in COMPARED if not installed(name)],
    }
    progress("accuracy")
    found["accuracy_m"] = accuracy(scenario, 3.0 if quick else 30.0)
    progress("latency")
    found["latency"] = latency(scenario, 20_000 if quick else 200_000)
    progress("start")
    found["start_s"] = start(1 if quick else 3)
    progress("operations")
    found["operations"] = {name: counts(load_vehicle(name)) for name in (vehicle.name, LONG_ARM)}
    found["growth"] = [] if quick else growth(load_vehicle(LONG_ARM), range(0, 13, 2))
    return found


def _long_arm(threads: int, quick: bool) -> list[Contender]:
    """The six-joint arm: our closed loop against MuJoCo's plant of the same vehicle."""
    scenario = ours.six_joints(1.0 if quick else 5.0)
    flown = {name: flight for name, flight in ours.flights(scenario).items() if name != "noise"}
    return [others.mujoco_rollout(scenario.world.vehicle, threads), *ours.native(flown, threads, 8 * threads)]


def _contact(threads: int, quick: bool) -> dict[str, list[Contender]]:
    """Episodes in contact against MuJoCo with its own contacts, by scene."""
    duration, blocks = 3.0 if quick else 10.0, 8 * threads
    return {
        "standing on four skids": contact_speed.standing_contenders(duration, threads, blocks),
        "a tip presses on a wall": contact_speed.pressing_contenders(duration, threads, blocks),
    }


def _bare(threads: int, quick: bool) -> list[Contender]:
    """A quadrotor without an arm, like for like, against crazyflow with several numbers of worlds."""
    if not installed("crazyflow"):
        return []
    return [
        *(crazyflow(worlds) for worlds in CRAZYFLOW_WORLDS),
        ours.bare_quadrotor(5.0 if quick else 30.0, threads, 64 * threads),
    ]


def text(found: dict[str, Any]) -> str:
    """The measurements for people: ratios first."""
    about = found["machine"]
    lines = [
        f"{about['processor']} ({about['llvm_processor']}), {about['cores']} cores, {about['lanes_f64']} lanes f64, "
        f"load {about.get('load_before', 'unknown')}, Python {about['python']}, MuJoCo {about['mujoco-core']}",
        "",
        f"simulated seconds per second, {found['scenario']['name']}, medians of {found['scenario']['rounds']} rounds:",
        "  rate, against the first in each round (smallest ... largest), the same per second of processor time",
    ]
    lines += [*_speeds(found["speed"]), "", "hexarotor with a six-joint arm", *_speeds(found["long_arm"])]
    if found.get("bare"):
        lines += ["", "a quadrotor without an arm, closed loop", *_speeds(found["bare"])]
    for scene, speeds in found.get("contact", {}).items():
        lines += ["", f"in contact: {scene}", *_speeds(speeds)]
    if found.get("environments"):
        lines += ["", "vector environments, steps of a world per second", *_speeds(found["environments"])]
    for group in found.get("environment_peers", []):
        lines += ["", f"environments beside {group[0]['name']}, steps of a world per second", *_speeds(group)]
    lines += ["", "largest distance from RK4 at 0.125 ms, m"]
    lines += [f"  {name:<44} {value:.2e}" for name, value in found["accuracy_m"].items()]
    lines += ["", "one control step, microseconds: median, 99th percentile"]
    lines += [f"  {name:<12} {v['p50_us']:8.2f} {v['p99_us']:8.2f}" for name, v in found["latency"].items()]
    lines += ["", "first 30 s episode of a new process, s"]
    lines += [f"  {name:<20} {value:.2f}" for name, value in found["start_s"].items()]
    for vehicle, table in found["operations"].items():
        lines += ["", f"operations, {vehicle}", *(f"  {name:<22} {value}" for name, value in table.items())]
    if found["growth"]:
        lines += ["", "RK4 step by joints: operations, code kB, trace s, compile s"]
    for row in found["growth"]:
        numbers = f"{row['operations']:7d} {row['code_kB']:5d} {row['trace_s']:6.2f} {row['compile_s']:6.2f}"
        lines.append(f"  {row['joints']:2d} {numbers}")
    lines += ["", f"not installed, not compared: {', '.join(found['not_installed']) or 'none'}"]
    return "\n".join(lines)


def _speeds(scores: list[dict[str, Any]]) -> list[str]:
    return [
        f"  {s['name']:<26} {s['rate']:10.4g} {s['ratio']:8.4g}x ({s['low']:.3g} ... {s['high']:.3g}) "
        f"{s['work_ratio']:8.4g}x  {s['what']}"
        for s in scores
    ]
