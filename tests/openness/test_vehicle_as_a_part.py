"""A second vehicle as a part of a user: its state and law are a force's memory, which a
bar joins to the first.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Vec3
from skyarm.algebra.scalars import exp, sqrt, where
from skyarm.dynamics.point_motion import PointMotion
from skyarm.plant.rigid_body import derivative
from skyarm.plant.surroundings import Surroundings, Together
from skyarm.records.leaves import rebuild, walk
from skyarm.scenario.scenario_record import Agent, Solver, first_state

TIP, LENGTH, STIFFNESS = Vec3(0.0, 0.0, -0.1), 1.0, 30.0


def pull(one: PointMotion, other: PointMotion) -> skyarm.Wrench:
    """Pull of the elastic bar between the tips of two vehicles on that of the first."""
    apart = other.position(TIP) - one.position(TIP)
    return skyarm.Wrench(
        force_W=apart * (STIFFNESS * (1.0 - LENGTH / sqrt(apart.dot(apart)))), point=TIP
    )


@dataclass(frozen=True, kw_only=True)
class Given(skyarm.Force):
    """Wrench that is known."""

    wrench: Any

    def wrenches(self, memory, t, motion, rotor_speeds):
        return [self.wrench]


@dataclass(frozen=True, kw_only=True, slots=True)
class Flown:
    """State of the second vehicle, with the rotor speeds at the period's beginning,
    time since then, law, command.
    """

    state: skyarm.State
    clock: Any
    law: Any
    command: skyarm.Command


@dataclass(frozen=True, kw_only=True)
class Partner(skyarm.Force):
    """A vehicle under its own law at the other end of a bar; a law is no number, thus
    no field.
    """

    agent: ClassVar[Agent]
    coupled = True

    def start(self, period, draws):
        speeds = self.agent.initial.rotor_speeds
        command = skyarm.Command(rotor_speeds=speeds, efforts=())
        return Flown(
            state=self.agent.initial,
            clock=0.0,
            law=self.agent.controller.memory,
            command=command,
        )

    def now(self, memory):
        rows = zip(
            memory.state.rotor_speeds,
            memory.command.rotor_speeds,
            self.agent.plant.vehicle.rotors,
            strict=True,
        )
        lags = (
            (w, u, where(u > w, rotor.time_constant_up, rotor.time_constant_down))
            for w, u, rotor in rows
        )
        speeds = tuple(u + (w - u) * exp(-memory.clock / lag) for w, u, lag in lags)
        return dataclasses.replace(memory.state, rotor_speeds=speeds)

    def advance(self, memory, t, dt, state, draws):
        own, controller = self.now(memory), self.agent.controller
        names = (
            "position",
            "quaternion",
            "velocity",
            "rate",
            "joints",
            "joint_rates",
            "rotor_speeds",
        )
        seen = skyarm.Measurement(
            time=t,
            specific_force=Vec3(0.0, 0.0, 0.0),
            **{k: getattr(own, k) for k in names},
        )
        law, command = controller.law(
            memory.law, seen, self.agent.reference.at(t), dt, par=controller.par
        )
        return Flown(state=own, clock=0.0, law=law, command=command)

    def slope(self, memory, t, motion, rotor_speeds):
        own, truth = self.now(memory), self.agent.plant
        held = Surroundings(
            components=(Given(wrench=pull(PointMotion(truth.vehicle, own), motion)),),
            memories=((),),
        )
        (rate,), _ = derivative([truth], [own], [memory.command], Together((held,)))
        still = rebuild(
            memory, iter([0.0] * sum(type(each) is not str for _, each in walk(memory)))
        )
        moving = {
            name: getattr(rate, name)
            for name in ("position", "quaternion", "velocity", "rate")
        }
        return dataclasses.replace(
            still, clock=1.0, state=dataclasses.replace(still.state, **moving)
        )

    def wrenches(self, memory, t, motion, rotor_speeds):
        return [pull(motion, PointMotion(self.agent.plant.vehicle, self.now(memory)))]

    columns = tuple(
        skyarm.world.component.Column("partner", axis, "m") for axis in "xyz"
    )

    def logged(self, memory, motion):
        return tuple(memory.state.position)


@dataclass(frozen=True, kw_only=True)
class Bar(skyarm.Force):
    """The bar between two agents."""

    shared = True

    def wrenches(self, memory, t, motion, rotor_speeds):
        left, right = (motion.agents[name] for name in ("left", "right"))
        ends = {"left": pull(left, right), "right": pull(right, left)}
        return [dataclasses.replace(end, agent=name) for name, end in ends.items()]


def hovering(x: float) -> skyarm.Scenario:
    """A Hummingbird that starts in hover at a place."""
    tables = {
        "name": "one",
        "duration": 1.0,
        "environment": {"ground": False},
        "plant": {"vehicle": "hummingbird"},
        "controller": {"law": "hybrid_computed_torque", "tuned": True},
        "reference": {"base": {"kind": "hover", "position": [x, 0.0, 1.0]}},
    }
    one = skyarm.scenario_from(tables)
    return one.with_initial(first_state(one))


@pytest.fixture(scope="module")
def flown() -> dict[str, tuple[Any, Any]]:
    """Log with the second vehicle as a part, and log of both as agents, by plant;
    forces at every stage of a step.
    """
    left, right = hovering(-0.4), hovering(0.4)
    Partner.agent = right.agent
    joined = dataclasses.replace(left, forces=(Partner(),))
    both = dataclasses.replace(
        left, agents={"left": left.agent, "right": right.agent}, forces=(Bar(),)
    )
    solvers = (
        Solver(kind=kind, integrator="rk4_staged") for kind in ("rigid_body", "mujoco")
    )
    return {
        each.kind: tuple(
            skyarm.run(dataclasses.replace(scenario, solver=each))
            for scenario in (joined, both)
        )
        for each in solvers
    }


@pytest.mark.parametrize("plant", ["rigid_body", "mujoco"])
def test_a_vehicle_as_a_part_flies_as_an_agent(flown: Any, plant: str) -> None:
    own, pair = flown[plant]
    left, right = pair.agents.values()
    # the bar pushes both apart, and turns them
    assert np.ptp(own.position[:, 0]) > 0.05
    assert np.ptp(own.euler[:, 1]) > 0.5
    assert np.abs(own.position - left.position).max() < 1e-6
    assert np.abs(own.quaternion - left.quaternion).max() < 1e-6
    assert np.abs(own.partner - right.position).max() < 1e-6
    # of equal vehicles, as a mirror says
    assert np.abs(own.position[:, 0] + own.partner[:, 0]).max() < 1e-6


def test_a_vehicle_as_a_part_flies_alike_on_both_plants(flown: Any) -> None:
    ours, theirs = (own for own, _ in flown.values())
    assert np.abs(ours.position - theirs.position).max() < 1e-6
    assert np.abs(ours.partner - theirs.partner).max() < 1e-6
