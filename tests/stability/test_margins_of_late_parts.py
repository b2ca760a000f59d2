"""Margins of loops whose rotors and joints hear of a command at different times."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hand_made import T, double_integrator
from test_linearised_flights import even, growth
from test_margins import sampled, two_axes

import skyarm
from skyarm.simulate import Delays
from skyarm.simulate.first_state import first_loop_state
from skyarm.simulate.inputs import episode_inputs
from skyarm.stability import margins
from skyarm.stability.along import hovering
from skyarm.stability.margins import closed_loop
from skyarm.stability.open_loop import Differentiator


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
    assert found.one_rotor[1] == pytest.approx(alone.rotor_gain[1], rel=3e-4)
    assert found.one_joint[1] == pytest.approx(margins(double_integrator()).rotor_gain[1], rel=3e-4)
    assert T == 0.005


@pytest.fixture(scope="module")
def hover():
    return even(dataclasses.replace(hovering(skyarm.load_scenario("case1")), ground=False))


def loop_of(scenario, **delays):
    late = dataclasses.replace(scenario, delays=Delays(**delays))
    return Differentiator(late).at(first_loop_state(late), [0.0, *episode_inputs(late).held[0]], "up")


def test_parts_that_are_as_late_as_each_other_are_one_delay(hover):
    one, both = loop_of(hover, command=0.007), loop_of(hover, rotors=0.007, joints=0.007)
    np.testing.assert_allclose(spectrum(margins(both).z), spectrum(margins(one).z), rtol=1e-7)
    assert margins(both).delay == pytest.approx(margins(one).delay, abs=1e-7)


def test_flights_with_late_joints_grow_beyond_the_delay_margin_and_settle_below(hover):
    """In the time simulation, whose rotors hear at once; the base's loop bears less with the joints' delay in it."""
    joints = 0.008
    edge = 1e3 * margins(loop_of(hover, joints=joints)).delay
    assert 5.0 < edge < 50.0
    assert growth(hover, (math.floor(edge) - 2) * 1e-3, joints=joints) < 0.9
    assert growth(hover, (math.ceil(edge) + 2) * 1e-3, joints=joints) > 1.1
