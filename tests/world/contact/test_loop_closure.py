"""Stiff grasps against an exact loop closure: constraint forces of rigid joints from
the KKT system, in NumPy.

The accelerations a of all bodies and the forces h of the joints solve

    [ M  -J^T ] [ a ]   [ forces and gyroscopic torques ]
    [ J    0  ] [ h ] = [ -dJ/dt v                      ]

at a state of the flight, where J v = 0 is that frames and bodies move together at the
grasps.
Source: Featherstone 2008, chapter 8.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Quaternion, Vec3
from skyarm.dynamics import State
from skyarm.dynamics.actuators import Command
from skyarm.records.arrays import Array
from skyarm.scenario.scenario_record import Scenario
from support.teams import GRAVITY, Constants, rotations, team, with_grasps

STIFF = 1e6

THRUST, MOMENT = 3.5936999e-7, 0.016
"""Of a rotor: N s^2, and m of drag torque per thrust."""

ROTORS = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]]) * 0.07601
TURNS = np.array([1.0, -1.0, 1.0, -1.0])
"""Sense of the drag torque about z of the rotors."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Speeds(Constants):
    """Constants of the law of constant rotor speeds."""

    speeds: tuple[float, ...]


def steady(
    memory: Any, _measurement: Any, _reference: Any, _dt: Any, *, par: Any
) -> tuple[Any, Command]:
    """Law of constant rotor speeds."""
    return memory, Command(rotor_speeds=par.speeds, efforts=())


def under_constant_speeds(scenario: Scenario, seed: int) -> Scenario:
    """Team at rest whose rotors turn at unequal constant speeds."""
    rng = np.random.default_rng(seed)

    def flown(agent: Any) -> Any:
        speeds = tuple(map(float, rng.uniform(1350.0, 1500.0, 4)))
        start = agent.reference.at(0.0)
        state = State(
            position=Vec3(*(float(c) for c in start.position)),
            quaternion=Quaternion(1.0, 0.0, 0.0, 0.0),
            velocity=Vec3(0.0, 0.0, 0.0),
            rate=Vec3(0.0, 0.0, 0.0),
            joints=(),
            joint_rates=(),
            rotor_speeds=speeds,
        )
        law = skyarm.Controller(
            name="steady",
            law=steady,
            par=Speeds(model=agent.controller.par.model, speeds=speeds),
        )
        return dataclasses.replace(agent, controller=law, initial=state)

    return dataclasses.replace(
        scenario, agents={name: flown(each) for name, each in scenario.agents.items()}
    )


def cross(r: Array) -> Array:
    """Matrix of a cross product: ``cross(r) @ v`` is r x v."""
    x, y, z = r
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def joint_forces(scenario: Scenario, log: Any, k: int) -> Array:
    """Force (N, world axes) of each rigid joint on the body at an instant of a flight,
    (grasps, 3).
    """
    assert scenario.world is not None
    (thing,), grasps = scenario.world.objects, scenario.world.grasps
    members = [*log.agents.values()]
    R = [rotations(each.quaternion[k : k + 1])[0] for each in members] + [
        rotations(log.object_quaternion[k : k + 1])[0]
    ]
    rates = [*(each.rate[k] for each in members), log.object_rate[k]]
    inertias = [np.diag([6.01e-4, 5.89e-4, 1.076e-3])] * len(members) + [
        np.diag([float(c) for c in thing.moments])
    ]
    masses = [0.25] * len(members) + [float(thing.mass)]
    size = 6 * len(masses)
    M, load = np.zeros((size, size)), np.zeros(size)
    for i, (mass, inertia, rate) in enumerate(
        zip(masses, inertias, rates, strict=True)
    ):
        force, torque = np.zeros(3), np.zeros(3)
        if i < len(members):
            thrusts = THRUST * members[i].rotor_speeds[k] ** 2
            force = R[i] @ [0.0, 0.0, thrusts.sum()]
            torque = np.array(
                [
                    ROTORS[:, 1] @ thrusts,
                    -ROTORS[:, 0] @ thrusts,
                    MOMENT * TURNS @ thrusts,
                ]
            )
        at = slice(6 * i, 6 * i + 3), slice(6 * i + 3, 6 * i + 6)
        M[at[0], at[0]], M[at[1], at[1]] = mass * np.eye(3), inertia
        load[at[0]] = force - [0.0, 0.0, mass * GRAVITY]
        load[at[1]] = torque - np.cross(rate, inertia @ rate)
    names, rows, bias = [*log.agents], list[Array](), list[Array]()
    last = len(members)
    for grasp in grasps:
        i, place = names.index(grasp.agent), np.array([float(c) for c in grasp.place])
        # on the body, less on the vehicle, whose frame is its centre of mass; rates in
        # the axes of each
        row = np.zeros((3, size))
        row[:, 6 * last : 6 * last + 3], row[:, 6 * i : 6 * i + 3] = (
            np.eye(3),
            -np.eye(3),
        )
        row[:, 6 * last + 3 :] = -R[last] @ cross(place)
        rows.append(row)
        bias.append(R[last] @ np.cross(rates[last], np.cross(rates[last], place)))
        if grasp.kind == "fixed":
            row = np.zeros((3, size))
            row[:, 6 * last + 3 :], row[:, 6 * i + 3 : 6 * i + 6] = R[last], -R[i]
            rows.append(row)
            bias.append(np.zeros(3))
    J, drift = np.vstack(rows), np.concatenate(bias)
    whole = np.block([[M, -J.T], [J, np.zeros((len(J), len(J)))]])
    joints = np.linalg.solve(whole, np.concatenate([load, -drift]))[size:].reshape(
        -1, 3
    )
    return joints[:: len(joints) // len(grasps)]


@pytest.mark.parametrize(
    ("name", "kind"),
    [("bar", "ball"), ("bar", "fixed"), ("triangle", "ball"), ("triangle", "fixed")],
)
def test_a_stiff_grasp_pulls_as_an_exact_loop_closure(name: str, kind: str) -> None:
    # near critical damping, so that the start from no load is over when pulls are
    # compared
    held = with_grasps(
        team(name, duration=0.15),
        kind=kind,
        stiffness=STIFF,
        damping=400.0,
        radius=0.05,
    )
    flown = under_constant_speeds(held, 4)
    log = skyarm.run(flown)
    errors, largest = list[float](), 0.0
    for k in range(10, len(log.time)):
        exact = joint_forces(flown, log, k)
        errors.append(float(np.abs(log.grasp_pull[k].reshape(-1, 3) - exact).max()))
        largest = max(largest, float(np.abs(exact).max()))
    assert np.abs(log.object_rate).max() > 0.3  # the bodies turn
    assert max(errors) < 1e-3 * largest
