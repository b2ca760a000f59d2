"""Episodes in contact against MuJoCo with its own contacts, and against the same
episodes without a world.

Two scenes. In the first a vehicle stands on four skids all the time: MuJoCo's plant
alone moves the same bodies with the same points and the same steps, which is in its
favour. In the second a tip presses on a wall under the centroidal law.
"""

from __future__ import annotations

import dataclasses
from typing import Any

from bench_engines import Flight, rollout_of, stepped_model
from bench_timing import Contender

from skyarm.compile.llvm.kernel import Kernel, host_width
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.plant.compiled import RigidBodyPlant
from skyarm.plant.surroundings import Surroundings
from skyarm.scenario.scenario_file import load_scenario, scenario_from
from skyarm.scenario.scenario_record import Scenario
from skyarm.simulate.first_state import first_loop_state, first_surroundings

PATHS = ("plant.vehicle.base.mass",)
"""Numbers that differ from lane to lane."""

SKIDS = ((0.1, 0.1), (0.1, -0.1), (-0.1, 0.1), (-0.1, -0.1))
"""m, of the skids in the base's axes, ahead and to the left."""


TOUCHED = 2.5
"""s, after which the tip of the task presses."""


def standing(duration: float, **replaced: Any) -> Scenario:
    """The paper's vehicle stands on four skids, its rotors turning as the law wants
    them for 11 cm less.
    """
    lower = {
        "kind": "ramp",
        "start": 0.0,
        "duration": 0.1,
        "height": -0.1,
        "shape": "linear",
    }
    skids = [
        {"name": f"skid_{i}", "body": "base", "position": [x, y, -0.22]}
        for i, (x, y) in enumerate(SKIDS)
    ]
    return scenario_from(
        {
            "schema": 1,
            "name": "standing",
            "duration": duration,
            "plant": {"vehicle": "hummingbird_arm2_rotors"},
            "model": {"vehicle": "hummingbird_arm2"},
            "controller": {"preset": "paper_ct"},
            "initial": {"standing": True},
            "reference": {
                "base": {"kind": "signals", "z": [0.21, lower]},
                "joints": [-1.2, 0.3],
            },
            "world": {
                "surfaces": [
                    {"name": "ground", "shape": "plane", "material": {"friction": 0.6}}
                ],
                "points": skids,
            },
        },
        "standing",
        replaced=replaced,
    )


def pressing(duration: float, **replaced: Any) -> Scenario:
    """The shipped task ``press_and_hold``; the tip is at the wall after some two
    seconds.
    """
    return load_scenario("press_and_hold", duration=duration, **replaced)


def standing_contenders(duration: float, threads: int, blocks: int) -> list[Contender]:
    """Bare MuJoCo with its contacts on all threads, which is the baseline, and on one;
    then the closed loop.
    """
    scenario = standing(duration)
    count, seconds = (
        plant_of(scenario).substeps(0.005).near,
        1.0 / scenario.rates.control,
    )
    return [
        *bare_mujoco(scenario, seconds / count, threads),
        *ours(scenario, threads, blocks),
    ]


def plant_of(scenario: Scenario) -> RigidBodyPlant:
    around = first_surroundings(scenario, first_loop_state(scenario))
    return RigidBodyPlant(
        scenario.plant, around, scenario.integrator, 1.0 / scenario.rates.physics
    )


def bare_mujoco(
    scenario: Scenario, step: float, threads: int, steps: int = 400
) -> list[Contender]:
    """MuJoCo's vehicle and world without a controller, from the scenario's start.

    Args:
        scenario: with a world.
        step: s, of MuJoCo's semi-implicit Euler method.
        threads: of the batch.
        steps: of an episode.
    """
    from support.mujoco_plants import MujocoContactPlant, plant_contact

    first, contact = first_loop_state(scenario), plant_contact(scenario.world)
    around = Surroundings(components=(contact,), memories=(contact.start(0.005, ()),))
    model = MujocoContactPlant(scenario.plant, around).model
    model.opt.timestep = step
    at, words = first.agent.state, f"plant only, its contacts, Euler {1e3 * step:g} ms"
    start = [*at.position, *at.quaternion, *at.joints]
    return [
        rollout_of(model, start, threads, steps, words, "mujoco.rollout"),
        stepped_model(model, start, steps, words),
    ]


def ours(scenario: Scenario, threads: int, blocks: int) -> list[Contender]:
    """The closed loop as machine code, in contact and without the world, in double and
    single precision.
    """
    found = []
    free = dataclasses.replace(scenario, world=None)
    for name, each in (("contact", scenario), ("free", free)):
        plant = plant_of(each)
        flight, steps = (
            Flight.of(each, plant.substeps, paths=PATHS),
            plant.substeps(1.0 / each.rates.control).near,
        )
        for single in (False, True):
            lanes = Lanes(host_width(single=single), single=single, contract=True)
            fly = flight.runner(
                Kernel(flight.loop, lanes), blocks * lanes.width, threads
            )
            what = (
                f"{steps} steps of Verlet's method a period"
                if name == "contact"
                else "the same without the world"
            )
            label = f"{name} f{32 if single else 64}, {threads} threads"
            found.append(Contender(label, f"closed loop, {what}", fly))
    return found
