"""Perturbed surroundings and plants of a contact task, drawn from a seed; infeasible
ones are discarded.

A world is discarded where friction across the push would use half of the yaw torque or
more, where a joint would need 80 % of its torque, or where the wind is more than half
of the push.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping

import numpy as np

from skyarm.algebra.scalars.philox import uniforms
from skyarm.records.arrays import Array, Columns, Mask, norm
from skyarm.scenario.numbers import number_at
from skyarm.scenario.scenario_record import Scenario
from skyarm.studies.assess.joints import effort_limits
from skyarm.studies.assess.push_limits import (
    HALF,
    WARNS,
    pushing_efforts,
    yaw_room,
    yaw_torques,
)
from skyarm.studies.compare.contact_tasks import (
    DELAY,
    DRAG,
    MASS,
    NORMAL,
    RADIUS,
    STIFFNESS,
    THRUST,
    ContactTask,
)
from skyarm.studies.compare.perturbed_plants import on_sphere
from skyarm.studies.sweep.distributions import Uniform
from skyarm.studies.trial.trial import columns_of

CHANNEL = 30
"""Channel of the random generator for worlds, separate from those of flights and
perturbed plants."""

NUMBERS = 10
"""Number of uniform random numbers of a world; each column belongs to one or two of the
quantities that are drawn."""

MOST_DISCARDED = 0.3
"""Largest fraction of the drawn worlds that may be discarded."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Worlds:
    """Perturbed parameters of surroundings and plant with which a contact task is
    feasible.

    Attributes:
        values: path -> (count,). drawn: number of worlds drawn for them.
    """

    values: Mapping[str, Array]
    drawn: int

    def plain(self) -> dict[str, int]:
        """Counts of drawn, used and discarded perturbed scenarios."""
        count = len(next(iter(self.values.values())))
        return {"worlds": count, "drawn": self.drawn, "discarded": self.drawn - count}


def draw_worlds(
    task: ContactTask, scenario: Scenario, count: int, *, seed: int
) -> Worlds:
    """Draw ``count`` feasible perturbed scenarios of a contact task from a seed.

    Args:
        task: task with its bounds.
        scenario: scenario of the task, with the force wind; its plant is perturbed.
        count: worlds.
        seed: key.

    Raises:
        ValueError: more than 30 % of the worlds are discarded: the task asks for more
            than the vehicle can do.
    """
    # twice what may be discarded; numbers go by index, so more change none before
    # 16 is twice the 8 that any number of worlds may lose
    drawn = count + 16 + 2 * math.ceil(count * MOST_DISCARDED)
    share = uniforms(seed, np.arange(drawn), CHANNEL, 0, NUMBERS)
    every = {
        "stiffness": _log(STIFFNESS, share[:, 0]),
        "friction": Uniform(*task.friction).quantile(share[:, 1]),
        "wind": task.wind * share[:, 2],
        "mass": _log(MASS, share[:, 3]),
    }
    feasible = np.flatnonzero(feasible_worlds(task, scenario, every))[:count]
    last = int(feasible[-1]) + 1 if feasible.size else drawn
    # of a handful of worlds chance alone may discard a third
    if feasible.size < count or last - count > max(MOST_DISCARDED * last, 8.0):
        most = f"{100.0 * MOST_DISCARDED:g} %"
        gone = f"{last - feasible.size} of {last} worlds are discarded"
        raise ValueError(f"task {task.name}: {gone}: must be at most {most}")
    rows = {name: column[feasible] for name, column in every.items()}
    return Worlds(values=_numbers(task, scenario, rows, share[feasible]), drawn=last)


def feasible_worlds(
    task: ContactTask, scenario: Scenario, drawn: Mapping[str, Array]
) -> Mask:
    """Feasibility of a contact task: True for each perturbed scenario that the vehicle
    can perform.

    Args:
        task: task to do.
        scenario: scenario of the task.
        drawn: ``friction``, ``wind`` (N), and ``mass`` as a share, (count,) each.
    """
    joints = tuple(map(float, scenario.agent.reference.at(0.0).joints))
    feasible = np.ones(len(drawn["wind"]), dtype=bool)
    # of the surface on the tip, of a level base that looks along x
    push = task.push * np.array(task.normal)
    limits = effort_limits(scenario.agent.vehicle)
    if task.push:
        feasible &= drawn["wind"] <= HALF * task.push
        feasible &= bool(
            np.all(np.abs(pushing_efforts(scenario, joints, push)) <= WARNS * limits)
        )
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


def _numbers(
    task: ContactTask, scenario: Scenario, drawn: Mapping[str, Array], share: Array
) -> Columns:
    """Perturbed parameters of a contact task: parameter path -> values (scenarios,)."""
    wind = on_sphere(2.0 * share[:, 6] - 1.0, 2.0 * math.pi * share[:, 7])
    normal = _tilt(task.normal, NORMAL * share[:, 8], 2.0 * math.pi * share[:, 9])
    # a mechanism takes the columns of what no task with one varies: surface friction,
    # an object's mass, and the normal
    drags = (("friction", 1), ("damping", 3), ("stiffness", 9))
    draws = {
        **drawn,
        "thrust": Uniform(*THRUST).quantile(share[:, 4]),
        "delay": DELAY * share[:, 5],
        "hinge": RADIUS * (2.0 * share[:, 8] - 1.0),
        **{f"drag_{name}": _log(DRAG, share[:, column]) for name, column in drags},
        **{
            f"wind_{axis}": drawn["wind"] * part
            for axis, part in zip("xyz", wind, strict=True)
        },
        **{f"normal_{axis}": part for axis, part in zip("xyz", normal, strict=True)},
    }
    rotors = range(len(scenario.agent.vehicle.rotors))
    every = {
        f"plant.vehicle.rotors.{i}.thrust_coefficient": "now * thrust" for i in rotors
    }
    every |= {"delays.command": "delay"} | {
        f"environment.wind.force_W.{axis}": f"wind_{axis}" for axis in "xyz"
    }
    return columns_of(every | {**task.numbers}, scenario, draws)


def _tilt(
    normal: tuple[float, float, float], angle: Array, azimuth: Array
) -> list[Array]:
    """Unit vectors obtained by tilting a normal by an angle, towards an azimuth about
    the normal.
    """
    n = np.array(normal)
    # the axis that n is least along has a cross product far from zero
    first = np.cross(n, np.eye(3)[int(np.argmin(np.abs(n)))])
    first /= norm(first)
    second = np.cross(n, first)
    side = np.outer(first, np.cos(azimuth)) + np.outer(second, np.sin(azimuth))
    return list(np.cos(angle) * n[:, None] + np.sin(angle) * side)


def _log(bounds: tuple[float, float], share: Array) -> Array:
    # not LogUniform, which rounds otherwise: the worlds of published tables stay
    low, high = map(math.log, bounds)
    return np.exp(low + (high - low) * share)
