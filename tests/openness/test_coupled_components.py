"""A coupled component of one's own: a mass on a spring below the base, integrated with
either plant.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
import pytest

import skyarm
from skyarm.algebra import ZERO3, Vec3
from skyarm.simulate.loop import run_in_python

MASS, STIFFNESS = 0.05, 40.0


@dataclass(frozen=True, kw_only=True, slots=True)
class Swing:
    """Place (m) and velocity (m/s) of the mass, world axes."""

    place: Vec3
    velocity: Vec3


@dataclass(frozen=True, kw_only=True, slots=True)
class SprungMass(skyarm.Force):
    """A mass on a spring without length that pulls the base's origin."""

    wrong: bool = False
    coupled = True

    def start(self, period, draws):
        return Swing(place=Vec3(0.0, 0.0, 0.9), velocity=Vec3(0.0, 0.0, 0.0))

    def pull(self, memory, motion):
        return (memory.place - motion.position()) * STIFFNESS

    def slope(self, memory, t, motion, rotor_speeds):
        if self.wrong:
            return memory.velocity
        fall = Vec3(0.0, 0.0, -9.81)
        return Swing(
            place=memory.velocity,
            velocity=fall - self.pull(memory, motion) * (1.0 / MASS),
        )

    def wrenches(self, memory, t, motion, rotor_speeds):
        return [skyarm.Wrench(force_W=self.pull(memory, motion), torque_W=ZERO3)]


@pytest.fixture(scope="module")
def swinging():
    scenario = skyarm.load_scenario("case1", duration=0.2)
    return dataclasses.replace(scenario, forces=(SprungMass(),))


def test_momentum_of_both_is_what_thrust_and_weight_give_on_both_plants(swinging):
    """Both plants, at their own steps (5 ms of RK4; 1 ms of its stages), and floats
    beside machine code.
    """
    ours = skyarm.run(swinging)
    slow = run_in_python(swinging)
    theirs = skyarm.run(dataclasses.replace(swinging, kind="mujoco"))
    free = skyarm.run(dataclasses.replace(swinging, forces=()))
    assert np.array_equal(slow.position, ours.position)
    assert np.abs(theirs.position - ours.position).max() < 1e-6
    assert np.abs(free.position - ours.position).max() > 1e-4


def test_rates_of_another_structure_are_one_line(swinging):
    with pytest.raises(
        ValueError,
        match=r"SprungMass.*gives the rates of its memory in another structure",
    ):
        skyarm.run(dataclasses.replace(swinging, forces=(SprungMass(wrong=True),)))
