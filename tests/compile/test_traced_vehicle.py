"""A vehicle as an argument of a program: evaluated for other masses and inertias it
equals the direct computation.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from skyarm import dynamics
from skyarm.algebra import Force, Vec3
from skyarm.compile import trace
from support.vehicles import random_body, random_state, random_vehicle


def forward(vehicle, *inputs):
    return dynamics.forward_dynamics(vehicle, *inputs)


def inputs_of(rng, n):
    state, f = random_state(rng, n), rng.normal(size=6 + n).tolist()
    v = state.velocity.tolist()
    applied = Force(Vec3(*f[:3]), Vec3(*f[3:6]))
    return (
        tuple(state.joints.tolist()),
        Vec3(*v[3:6]),
        tuple(v[6:]),
        applied,
        tuple(f[6:]),
    )


def other_masses(rng, vehicle):
    links = tuple(
        dataclasses.replace(link, body=random_body(rng)) for link in vehicle.links
    )
    return dataclasses.replace(vehicle, base=random_body(rng), links=links)


def numbers(result):
    motion, joints = result
    return [float(x) for x in (*motion.angular, *motion.linear, *joints)]


@pytest.mark.parametrize("n", [0, 1, 3])
def test_a_program_of_a_vehicle_serves_other_masses_bit_for_bit(n):
    rng = np.random.default_rng([51, n])
    vehicle = random_vehicle(rng, n)
    program = trace(forward, vehicle, *inputs_of(rng, n))
    for _ in range(3):
        other, inputs = other_masses(rng, vehicle), inputs_of(rng, n)
        assert numbers(program(other, *inputs)) == numbers(forward(other, *inputs))


def test_a_payload_may_be_an_input():
    rng = np.random.default_rng(52)
    vehicle, inputs = random_vehicle(rng, 2), inputs_of(rng, 2)
    program = trace(
        lambda mass, *rest: forward(vehicle.with_payload(mass), *rest), 0.1, *inputs
    )
    for mass in (0.0, 0.2, 1.5):
        assert numbers(program(mass, *inputs)) == numbers(
            forward(vehicle.with_payload(mass), *inputs)
        )


def test_a_vehicle_with_another_tree_or_another_structural_axis_is_refused():
    rng = np.random.default_rng(53)
    vehicle, inputs = random_vehicle(rng, 1), inputs_of(rng, 1)
    joint = dataclasses.replace(vehicle.links[0].joint, axis=Vec3(0, 0, 1))
    vehicle = dataclasses.replace(
        vehicle, links=(dataclasses.replace(vehicle.links[0], joint=joint),)
    )
    program = trace(forward, vehicle, *inputs)
    for axis, place in (
        (Vec3(1, 0, 0), r"axis\.x is 1, not 0"),
        (Vec3(0.6, 0, 0.8), r"axis\.x is 0\.6, not 0"),
    ):
        turned = dataclasses.replace(
            vehicle.links[0], joint=dataclasses.replace(joint, axis=axis)
        )
        with pytest.raises(ValueError, match=place):
            program(dataclasses.replace(vehicle, links=(turned,)), *inputs)
    slide = dataclasses.replace(
        vehicle.links[0],
        joint=dataclasses.replace(
            joint, kind="prismatic" if joint.kind == "revolute" else "revolute"
        ),
    )
    with pytest.raises(ValueError, match="kind is"):
        program(dataclasses.replace(vehicle, links=(slide,)), *inputs)


def test_structure_saves_operations():
    """The elementary joints of a planar arm cost a fraction of the same joints given as
    data.
    """
    rng = np.random.default_rng(54)
    vehicle, inputs = random_vehicle(rng, 2, prismatic=False), inputs_of(rng, 2)

    def count(axis):
        links = [
            dataclasses.replace(
                link,
                joint=dataclasses.replace(
                    link.joint, axis=axis, position=Vec3(0, 0, -0.1)
                ),
            )
            for link in vehicle.links
        ]
        arm = dataclasses.replace(vehicle, links=tuple(links))
        return sum(trace(lambda *x: forward(arm, *x), *inputs).operations().values())

    assert count(Vec3(0, 1, 0)) < count(Vec3(0.0, 1.0, 0.0))
