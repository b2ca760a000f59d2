"""Perturbed surroundings and plants of a contact task, drawn from a seed; infeasible ones are discarded.

A world is discarded where friction across the push would use half of the yaw torque or more, where a joint would need
80 % of its torque, or where the wind is more than half of the push.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping

import numpy as np

from skyarm.algebra.scalars.philox import uniforms
from skyarm.records.arrays import Array, Mask
from skyarm.scenario.numbers import number_at
from skyarm.scenario.scenario_record import Scenario
from skyarm.studies.assess.joints import effort_limits
from skyarm.studies.assess.push_limits import HALF, WARNS, pushing_efforts, yaw_room, yaw_torques
from skyarm.studies.compare.contact_tasks import DELAY, DRAG, MASS, NORMAL, RADIUS, STIFFNESS, THRUST, Task
from skyarm.studies.compare.perturbed_plants import on_sphere

CHANNEL = 30
"""Channel of the random generator for worlds, separate from those of flights and perturbed plants."""

NUMBERS = 10
"""Number of uniform random numbers of a world."""

MOST_DISCARDED = 0.3
"""Largest fraction of the drawn worlds that may be discarded."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Worlds:
    """Perturbed parameters of surroundings and plant with which a contact task is feasible.

    Attributes:
        values: path -> (count,). drawn: number of worlds drawn for them.
    """

    values: Mapping[str, Array]
    drawn: int

    def plain(self) -> dict[str, int]:
        """Counts of drawn, used and discarded perturbed scenarios."""
        count = len(next(iter(self.values.values())))
        return {"worlds": count, "drawn": self.drawn, "discarded": self.drawn - count}


def draw_worlds(task: Task, scenario: Scenario, count: int, *, seed: int) -> Worlds:
    """Draw ``count`` feasible perturbed scenarios of a contact task from a seed.

    Args:
        task: task with its bounds.
        scenario: scenario of the task, with the force wind; its plant is perturbed.
        count: worlds.
        seed: key.

    Raises:
        ValueError: more than 30 % of the worlds are discarded: the task asks for more than the vehicle can do.
    """
    drawn = count + 16 + 2 * math.ceil(count * MOST_DISCARDED)
    share = uniforms(seed, np.arange(drawn), CHANNEL, 0, NUMBERS)
    every = {"stiffness": _log(STIFFNESS, share[:, 0]), "friction": _uniform(task.friction, share[:, 1]),
             "wind": task.wind * share[:, 2], "mass": _log(MASS, share[:, 3])}  # fmt: skip
    feasible = np.flatnonzero(feasible_worlds(task, scenario, every))[:count]
    last = int(feasible[-1]) + 1 if feasible.size else drawn
    # of a handful of worlds chance alone may discard a third
    if feasible.size < count or last - count > max(MOST_DISCARDED * last, 8.0):
        most = f"{100.0 * MOST_DISCARDED:g} %"
        gone = f"{last - feasible.size} of {last} worlds are discarded"
        raise ValueError(f"task {task.name}: {gone}: must be at most {most}")
    rows = {name: column[feasible] for name, column in every.items()}
    return Worlds(values=_numbers(task, scenario, rows, share[feasible]), drawn=last)


def feasible_worlds(task: Task, scenario: Scenario, drawn: Mapping[str, Array]) -> Mask:
    """Feasibility of a contact task: True for each perturbed scenario that the vehicle can perform.

    Args:
        task: task to do.
        scenario: scenario of the task.
        drawn: ``friction``, ``wind`` (N), and ``mass`` as a share, (count,) each.
    """
    joints = tuple(map(float, scenario.agent.reference.at(0.0).joints))
    feasible = np.ones(len(drawn["wind"]), dtype=bool)
    push = task.push * np.array(task.normal)  # of the surface on the tip, of a level base that looks along x
    limits = effort_limits(scenario.agent.vehicle)
    if task.push:
        feasible &= drawn["wind"] <= HALF * task.push
        feasible &= bool(np.all(np.abs(pushing_efforts(scenario, joints, push)) <= WARNS * limits))
    if task.sideways:
        pushing, sliding = yaw_torques(scenario, joints, push)
        room = yaw_room(scenario, joints)
        feasible &= pushing + drawn["friction"] * sliding <= HALF * room
    if task.object:
        mass = number_at(scenario, f"world.objects.{task.object}.mass")
        weight = np.array([0.0, 0.0, -float(scenario.agent.plant.gravity) * mass])
        still = pushing_efforts(scenario, joints, 0.0 * weight)
        more = pushing_efforts(scenario, joints, weight) - still
        efforts = still[:, None] + more[:, None] * drawn["mass"]
        feasible &= np.all(np.abs(efforts) <= WARNS * limits[:, None], axis=0)
    return feasible


def _numbers(task: Task, scenario: Scenario, drawn: Mapping[str, Array], share: Array) -> dict[str, Array]:
    """Perturbed parameters of a contact task: parameter path -> values (scenarios,)."""
    numbers: dict[str, Array] = {}
    for name in task.materials:
        numbers[f"world.{name}.material.stiffness"] = drawn["stiffness"]
        numbers[f"world.{name}.material.friction"] = drawn["friction"]
    if task.object:
        path = f"world.objects.{task.object}.mass"
        numbers[path] = number_at(scenario, path) * drawn["mass"]
    thrust = _uniform(THRUST, share[:, 4])
    for i in range(len(scenario.agent.vehicle.rotors)):
        path = f"plant.vehicle.rotors.{i}.thrust_coefficient"
        numbers[path] = number_at(scenario, path) * thrust
    numbers["delays.command"] = DELAY * share[:, 5]
    for axis, part in zip("xyz", on_sphere(2.0 * share[:, 6] - 1.0, 2.0 * math.pi * share[:, 7]), strict=True):
        numbers[f"environment.wind.force_W.{axis}"] = drawn["wind"] * part
    if task.wrong_normal:
        for i, part in enumerate(_tilt(task.normal, NORMAL * share[:, 8], 2.0 * math.pi * share[:, 9])):
            numbers[f"reference.push.normal.{i}"] = part
    return numbers | _handle_numbers(task, scenario, drawn, share)


def _handle_numbers(task: Task, scenario: Scenario, drawn: Mapping[str, Array], share: Array) -> dict[str, Array]:
    """Perturbed hinge position, mechanism friction and grip stiffness of a task with a handle, by parameter path."""
    numbers: dict[str, Array] = {}
    if task.hinge:
        name, *way = task.hinge
        for i, length in enumerate(way):
            if length:
                path = f"world.{name}.position.{i}"
                numbers[path] = number_at(scenario, path) + RADIUS * (2.0 * share[:, 8] - 1.0) * length
    if task.grip:
        numbers[f"world.grippers.{task.grip}.stiffness"] = drawn["stiffness"]
    for each, column in (("friction", 1), ("damping", 3), ("stiffness", 9)) if task.drags else ():
        path = f"world.mechanisms.{task.drags}.{each}"
        if number_at(scenario, path):
            numbers[path] = number_at(scenario, path) * _log(DRAG, share[:, column])
    return numbers


def _tilt(normal: tuple[float, float, float], angle: Array, azimuth: Array) -> list[Array]:
    """Unit vectors obtained by tilting a normal by an angle, towards an azimuth about the normal."""
    n = np.array(normal)
    first = np.cross(n, np.eye(3)[int(np.argmin(np.abs(n)))])
    first /= np.linalg.norm(first)
    second = np.cross(n, first)
    side = np.outer(first, np.cos(azimuth)) + np.outer(second, np.sin(azimuth))
    return list(np.cos(angle) * n[:, None] + np.sin(angle) * side)


def _uniform(bounds: tuple[float, float], share: Array) -> Array:
    low, high = bounds
    return low + (high - low) * share


def _log(bounds: tuple[float, float], share: Array) -> Array:
    low, high = map(math.log, bounds)
    return np.exp(low + (high - low) * share)
