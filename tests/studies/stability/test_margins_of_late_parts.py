"""Margins of loops whose rotors and joints hear of a command at different times."""

from __future__ import annotations

import dataclasses
import itertools
import math

import numpy as np
import pytest
from hand_made import T, double_integrator
from test_linearised_flights import even, growth
from test_margins import sampled, two_axes

import skyarm
from skyarm.compile import leaves, rebuild
from skyarm.compile.llvm.kernel import Kernel
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.simulate import Delays
from skyarm.simulate.engine import EpisodeCode
from skyarm.simulate.first_state import first_loop_state
from skyarm.simulate.inputs import episode_inputs
from skyarm.studies.stability import margins
from skyarm.studies.stability.along import hovering
from skyarm.studies.stability.closed_loop import closed_loop
from skyarm.studies.stability.open_loop import Differentiator, carry_of
from thorough import sampled as sampled_of


def spectrum(*parts):
    """Eigenvalues beyond those of queues that nothing reads, largest first."""
    found = np.concatenate([np.asarray(part, dtype=complex) for part in parts])
    return np.sort_complex(found[np.abs(found) > 1e-3])


def apart(rotors, joints):
    """A rotor's and a joint's double integrator side by side: as the open loop is cut, the second may be later."""
    loop, late = dataclasses.replace(two_axes(1.0), rotors=1), double_integrator()
    offset = round((joints - rotors) * 1e3)
    turned = {name: getattr(late, name)[(np.arange(5) + offset) % 5] for name in ("x_old", "x_new")}
    columns = {name: getattr(loop, name).copy() for name in turned}
    for name, values in turned.items():
        columns[name][:, 2:, 1:] = values
    return dataclasses.replace(loop, rotors_delay=rotors, joints_delay=joints, **columns)


@pytest.mark.parametrize(
    ("rotors", "joints"), [(0.0, 0.0), (0.012, 0.0), (0.0, 0.007), (0.005, 0.003), (0.002, 0.02), (0.004, 0.001)]
)
def test_two_axes_have_the_eigenvalues_of_each_with_its_own_delay(rotors, joints):
    """By SciPy's matrix exponential and a queue for each axis."""
    ours = np.linalg.eigvals(closed_loop(apart(rotors, joints)))
    np.testing.assert_allclose(spectrum(ours), spectrum(sampled(rotors), sampled(joints)), atol=1e-6)


def test_a_further_delay_is_of_both_and_the_later_axis_has_the_smaller_margin():
    bare = margins(double_integrator()).delay
    for rotors, joints in ((0.012, 0.0), (0.003, 0.012)):
        assert margins(apart(rotors, joints)).delay == pytest.approx(bare - 0.012, abs=1e-5)
    found = margins(apart(0.012, 0.0))
    alone = margins(double_integrator(delay=0.012))
    assert found.rotor_gain[1] == pytest.approx(alone.rotor_gain[1], rel=3e-4)
    assert found.joint_gain[1] == pytest.approx(margins(double_integrator()).rotor_gain[1], rel=3e-4)
    assert T == 0.005


@pytest.fixture(scope="module")
def hover():
    return even(dataclasses.replace(hovering(skyarm.load_scenario("case1")), ground=False))


def loop_of(scenario, **delays):
    late = dataclasses.replace(scenario, delays=Delays(**delays))
    return Differentiator(late).at(first_loop_state(late), [0.0, *episode_inputs(late).held_leaves[0]], "up")


def test_parts_that_are_as_late_as_each_other_are_one_delay(hover):
    one, both = loop_of(hover, command=0.007), loop_of(hover, rotors=0.007, joints=0.007)
    np.testing.assert_allclose(spectrum(margins(both).z), spectrum(margins(one).z), rtol=1e-7)
    assert margins(both).delay == pytest.approx(margins(one).delay, abs=1e-7)


@pytest.mark.thorough
def test_flights_with_late_joints_grow_beyond_the_delay_margin_and_settle_below(hover):
    """In the time simulation, whose rotors hear at once; the base's loop bears less with the joints' delay in it."""
    joints = 0.008
    edge = 1e3 * margins(loop_of(hover, joints=joints)).delay
    assert 5.0 < edge < 50.0
    assert growth(hover, (math.floor(edge) - 2) * 1e-3, joints=joints) < 0.9
    assert growth(hover, (math.ceil(edge) + 2) * 1e-3, joints=joints) > 1.1


def numbered(carry):
    """The carry with the numbers of its leaves in place of them."""
    return rebuild(carry, itertools.count())


@pytest.mark.parametrize(
    ("rotors", "joints"), sampled_of([(0.012, 0.007), (0.003, 0.009), (0.012, 0.004), (0.001, 0.003), (0.004, 0.0)], 2)
)
def test_what_each_command_on_its_way_does_is_that_of_the_flight(hover, rotors, joints):
    """Central differences of one period of the time simulation; every command on its way is another one."""
    late = dataclasses.replace(hover, delays=Delays(rotors=rotors, joints=joints))
    inputs = episode_inputs(late)
    traced = EpisodeCode(late, commands=False, effort=0)
    held = np.array(leaves(first_loop_state(late)), dtype=float)
    places = numbered(first_loop_state(late))
    state, queue = places.state, places.queue
    held[[*state.rate, *state.joint_rates]] += np.linspace(-0.3, 0.4, 5)
    for i, command in enumerate(queue):
        held[[*command.rotor_speeds]] += 7.0 * i + np.array([0.0, 9.0, -4.0, 2.0])
        held[[*command.efforts]] += 0.02 * (i + 1)
    row = [0.0, *inputs.held_leaves[0]]
    loop = Differentiator(late).at(carry_of(first_loop_state(late), held), row, "up")
    rows = [*state.position, *state.velocity, *state.rate, *state.joints, *state.joint_rates, *state.rotor_speeds]
    linear = [0, 1, 2, *range(6, 20)]  # the attitude is a rotation vector in one and a quaternion in the other

    kernel = Kernel(traced.loop, Lanes(1))

    def slopes(columns, step):
        found = []
        for column in columns:
            ends = np.repeat(held[:, None], 2, axis=1)
            ends[column] += [step, -step]
            flown, _ = kernel.run(ends, np.zeros((0, 2)), np.array([row]))
            found.append((flown[rows, 0] - flown[rows, 1]) / (2.0 * step))
        return np.array(found).T

    steps = [round(1e3 * each) for each in (rotors, joints)]
    index = steps[0] % 5
    for part, delay in enumerate(steps):
        columns = slice(0, 4) if part == 0 else slice(4, 6)
        for i, command in enumerate(queue):
            ours = np.zeros((len(linear), 6))[:, columns]
            place = i - (len(queue) - 1 - delay // 5)
            if place in (0, 1):
                ours = (loop.x_old, loop.x_new)[place][index][linear][:, columns]
            numbers, step = (command.rotor_speeds, 1e-2) if part == 0 else (command.efforts, 1e-5)
            np.testing.assert_allclose(slopes(numbers, step), ours, rtol=1e-6, atol=1e-6)
    # and what is sent now, where it arrives within the period, follows the state
    at_once = np.repeat([float(delay < 5) for delay in steps], [4, 2])
    closed = loop.x_x[index] + (loop.x_new[index] * at_once) @ loop.u_y @ loop.y_x
    moving = [*range(6, 9), *range(9, 16)]  # velocity, rate, joints and their rates
    numbers = [*state.velocity, *state.rate, *state.joints, *state.joint_rates]
    np.testing.assert_allclose(slopes(numbers, 1e-5), closed[np.ix_(linear, moving)], rtol=1e-5, atol=1e-5)
