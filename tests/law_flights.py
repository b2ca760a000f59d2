"""Which laws beyond the paper's own are tested one by one, and what their tests share."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

import skyarm
from skyarm.algebra import Vec3
from skyarm.control.catalogue import LAWS, Controller, make_controller
from skyarm.control.model import Model
from skyarm.plant.interface import Truth
from skyarm.reference import Trajectory
from skyarm.reference.signals import Constant
from skyarm.scenario.scenario_record import trimmed_state
from skyarm.simulate import Scenario
from skyarm.simulate.batch import Batch

RIVALS = (
    "bulut2019",
    "guo2023",
    "li2024",
    "kim2013",
    "l1_adaptive lateral",
    "indi",
)

STEPS = tuple(f"ct_ladder {steps}" for steps in range(1, 7))

TOP = "ct_ladder"
"""The law with every step: what covers it covers those with fewer."""

PAPER = ("rotors_sim_position", "decoupled_pd", "hybrid_computed_torque")


def covering(names: Any = LAWS) -> list[str]:
    """Laws, without any whose every line another one runs."""
    return sorted(names)


def make_law(name: str, model: Model, **options: Any) -> Controller:
    """A law by its name; "ct_ladder 3" has three steps, "l1_adaptive lateral" its lateral part."""
    law, _, word = name.partition(" ")
    more: dict[str, Any] = {"lateral": True} if word == "lateral" else {"steps": int(word)} if word else {}
    return make_controller(law, model, **more, **options)


def hover(joints: tuple[float, ...], height: float = 2.0) -> Trajectory:
    """Standing still with the arm at some angles."""
    return Trajectory(z=Constant(height), joints=tuple(Constant(q) for q in joints))


def hovering_scenario(law: str, vehicle: str, *, seconds: float, offset: float = 0.0, **options: Any) -> Scenario:
    """Belief equal to truth, arm out to one side, begun ``offset`` metres beside the reference."""
    flown = skyarm.load_vehicle(vehicle)
    joints = tuple(0.3 / (i + 1) for i in range(flown.n))
    world = Truth(vehicle=flown, gravity=9.81)
    start = trimmed_state(world, Vec3(offset, 0.0, 2.0), 0.0, joints)
    return Scenario(
        name="hover",
        duration=seconds,
        plant=world,
        controller=make_law(law, Model(vehicle=flown, gravity=9.81), **options),
        reference=hover(joints),
        initial=start if offset else None,
    )


def flown_to_the_end(scenario: Scenario) -> Any:
    """State after a flight in machine code."""
    outcome = Batch(scenario).fly({})
    assert outcome.status[0] == "completed"
    return outcome.state


def replaced(controller: Controller, **fields: Any) -> Controller:
    """The controller with other constants."""
    return dataclasses.replace(controller, par=dataclasses.replace(controller.par, **fields))


def scalars(values: Any) -> Any:
    """A tuple or Vec3 of scalars as an array."""
    return np.array([float(value) for value in values])
