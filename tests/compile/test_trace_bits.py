"""A traced program gives the bits of the function it was traced from: random programs,
special values, dynamics.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from operation_programs import (
    BINARY,
    COMPARE,
    INPUTS,
    SPECIAL,
    UNARY,
    bits,
    run,
    step,
    value,
)

from skyarm import dynamics
from skyarm.algebra import Force, Motion, Vec3, scalars
from skyarm.compile import trace
from support.vehicles import random_state, random_vehicle

UNARY |= {name: getattr(scalars, name) for name in ("absolute", "floor", "sign")}
UNARY |= {"-": lambda a: -a, "neg": scalars.neg, "- -": lambda a: scalars.neg(-a)}


@settings(max_examples=400, deadline=None)
@given(
    st.lists(step, min_size=1, max_size=25),
    st.lists(value, min_size=2, max_size=2),
    st.lists(st.lists(value, min_size=INPUTS, max_size=INPUTS), min_size=1, max_size=4),
)
def test_a_random_program_has_the_bits_of_its_function(steps, constants, lanes):
    program = trace(lambda *x: run(steps, constants, x), *(0.5 for _ in range(INPUTS)))
    for lane in lanes:
        direct, traced = run(steps, constants, lane), program(*lane)
        assert [bits(float(y)) for y in traced] == [bits(float(y)) for y in direct]


def test_a_random_program_of_special_values_meets_every_operation():
    """The strategy above is only as good as its vocabulary: one long fixed program over
    all pairs of special values.
    """
    steps = [("binary", name, 0, 1) for name in sorted(BINARY)] + [
        ("unary", name, 0) for name in sorted(UNARY)
    ]
    steps += [
        ("binary", name, i, j)
        for name in sorted(BINARY)
        for i, j in ((5, 0), (6, 0), (7, 0), (0, 5), (0, 6), (0, 7))
    ]
    steps += [("compare", name, 0, 1) for name in sorted(COMPARE)]
    program = trace(lambda *x: run(steps, [1.5, -0.0], x), 0.5, 0.5, 0.5)
    for a in SPECIAL:
        for b in SPECIAL:
            direct = run(steps, [1.5, -0.0], (a, b, 1.0))
            assert [bits(float(y)) for y in program(a, b, 1.0)] == [
                bits(float(y)) for y in direct
            ], (a, b)


def samples(n, salt):
    rng = np.random.default_rng([41, salt, n])
    vehicle = random_vehicle(rng, n)
    points = []
    for _ in range(3):
        state = random_state(rng, n)
        joints, velocity, extra = (
            tuple(state.joints.tolist()),
            state.velocity.tolist(),
            rng.normal(size=6 + n).tolist(),
        )
        points.append((joints, Vec3(*velocity[3:6]), tuple(velocity[6:]), extra))
    return vehicle, points


def flat_result(result):
    first, joints = result
    pair = (
        (first.angular, first.linear)
        if isinstance(first, Motion)
        else (first.torque, first.force)
    )
    return [float(c) for v in pair for c in v] + [float(c) for c in joints]


@pytest.mark.parametrize("n", range(6))
def test_forward_dynamics_traced_has_the_bits_of_forward_dynamics(n):
    vehicle, points = samples(n, 1)

    def forward(joints, rate, joint_rates, applied, torques):
        return dynamics.forward_dynamics(
            vehicle, joints, rate, joint_rates, applied, torques
        )

    program = None
    for joints, rate, joint_rates, f in points:
        arguments = (
            joints,
            rate,
            joint_rates,
            Force(Vec3(*f[:3]), Vec3(*f[3:6])),
            tuple(f[6:]),
        )
        program = program or trace(forward, *arguments)
        assert list(map(bits, flat_result(program(*arguments)))) == list(
            map(bits, flat_result(forward(*arguments)))
        )


@pytest.mark.parametrize("n", range(6))
def test_inverse_dynamics_traced_has_the_bits_of_inverse_dynamics(n):
    vehicle, points = samples(n, 2)

    def inverse(joints, rate, joint_rates, base, accelerations):
        return dynamics.inverse_dynamics(
            vehicle, joints, rate, joint_rates, base, accelerations
        )

    program = None
    for joints, rate, joint_rates, a in points:
        arguments = (
            joints,
            rate,
            joint_rates,
            Motion(Vec3(*a[:3]), Vec3(*a[3:6])),
            tuple(a[6:]),
        )
        program = program or trace(inverse, *arguments)
        assert list(map(bits, flat_result(program(*arguments)))) == list(
            map(bits, flat_result(inverse(*arguments)))
        )
