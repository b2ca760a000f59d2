"""A reference that comes to rest smoothly: what its last samples said of jerk and snap
does not go on.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import skyarm
from skyarm.control.blocks.extrapolation import extrapolate
from skyarm.control.catalogue import preset
from skyarm.control.laws.centroidal.law import Channel
from skyarm.reference import Constant, Ramp, Trajectory

DT = 0.005


@pytest.mark.parametrize("period", [0.005, 0.02, 1.0 / 30.0])
def test_after_the_last_sample_of_a_smooth_move_nothing_is_left_but_its_place(period):
    move = Ramp(start=0.1, duration=0.5, height=2.0, shape="quintic")
    channels, age, started, left = (Channel(),), 0.0, 0.0, []
    for tick in range(200):
        published = np.floor(tick * DT / period + 1e-9) * period
        sample = tuple(float(each) for each in move.derivatives(published)[:3])
        series, channels, age = extrapolate(
            channels, age, [sample], started, DT, period
        )
        started = 1.0
        left.append([float(series[0].derivative(k)) for k in range(5)])
    found = np.array(left)
    assert np.abs(found[:110, 3]).max() > 100.0, "on the way there is jerk"
    np.testing.assert_allclose(
        found[140:], [[2.0, 0.0, 0.0, 0.0, 0.0]] * 60, rtol=0.0, atol=1e-12
    )


@pytest.mark.parametrize("law", ["centroidal_joint", "centroidal_tip"])
def test_a_vehicle_that_has_moved_stands_where_it_was_sent(law):
    start = skyarm.load_scenario("case3")
    still = (Constant(0.0), Constant(0.0))
    moved = Ramp(start=0.5, duration=2.0, height=2.0, shape="quintic")
    there = Trajectory(
        x=moved, y=Constant(0.0), z=Constant(1.5), yaw=Constant(0.0), joints=still
    )
    law_of = preset(law, start.controller.par.model)
    log = skyarm.run(
        dataclasses.replace(start, reference=there, controller=law_of, duration=8.0)
    )
    assert np.abs(log.position[-1] - [2.0, 0.0, 1.5]).max() < 1e-4
