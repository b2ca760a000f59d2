"""Held samples and slow regressors of the centroidal law: how far they are carried, and
how late they are heard.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Vec3
from skyarm.control.blocks.extrapolation import extrapolate
from skyarm.control.blocks.filters import low_pass_share
from skyarm.control.catalogue import make_controller
from skyarm.control.laws.centroidal import make_centroidal
from skyarm.control.laws.centroidal.adaptation import Efforts
from skyarm.control.laws.centroidal.law import Channel
from skyarm.control.laws.ladder import _present
from skyarm.control.model import Model
from skyarm.reference import Reference

ARM = skyarm.load_vehicle("hummingbird_arm2_rotors")
MODEL = Model(vehicle=ARM, gravity=9.8)
DT, PERIOD = 0.005, 0.02


def held(sample, ticks):
    """Derivatives of one signal at each tick of a sample that is never followed by
    another; its channel and age.
    """
    channels, age, started, found = (Channel(),), 0.0, 0.0, []
    for _ in range(ticks):
        series, channels, age = extrapolate(
            channels, age, [sample], started, DT, PERIOD
        )
        started = 1.0
        found.append([float(series[0].derivative(k)) for k in range(5)])
    return np.array(found), channels[0], age


def parabola(sample, t):
    p, v, a = sample
    return [p + v * t + 0.5 * a * t * t, v + a * t, a, 0.0, 0.0]


@pytest.mark.parametrize(
    "sample",
    [(1.5, 0, 2.0), (1.5, 0.7, 0), (1.5, 0, -3.0), (0, -0.7, 0), (1.5, 0.4, -2.0)],
    ids=str,
)
def test_a_structural_zero_in_a_sample_stops_no_other_derivative(sample):
    found, _, _ = held(sample, 4)
    for k in range(4):
        np.testing.assert_allclose(
            found[k], parabola(sample, k * DT), rtol=1e-12, atol=1e-15
        )


@pytest.mark.parametrize("t", [0.0, 0.005, 0.015, 0.02])
def test_with_a_preview_a_quintic_is_followed_exactly(t):
    """Rate of fourth order through two samples and the slope of a third: five
    conditions, five numbers.
    """
    p = np.polynomial.Polynomial([0.2, -0.3, 0.5, 0.4, -2.0, 3.0])
    rows = [
        [tuple(float(p.deriv(k)(at)) for k in range(3))]
        for at in (0.0, PERIOD, 2.0 * PERIOD)
    ]
    value, rate, acceleration = rows[0][0]
    seen = (Channel(value=value, rate=rate, acceleration=acceleration),)
    series, channels, age = extrapolate(
        seen, t - DT, rows[0], 1.0, DT, PERIOD, rows[1:]
    )
    found = [float(series[0].derivative(k)) for k in range(5)]
    np.testing.assert_allclose(found, [p.deriv(k)(t) for k in range(5)], rtol=1e-8)
    assert (channels[0].value, age) == (rows[0][0][0], pytest.approx(t, abs=1e-12))


def test_with_a_preview_no_derivative_steps_at_a_sample():
    """Along a sine of 1 Hz, whose snap without a preview steps by an eighth of its
    size.
    """
    w = 2.0 * np.pi

    def at(t):
        return tuple(float(w**k * np.sin(w * t + 0.5 * np.pi * k)) for k in range(3))

    ends = []
    for begin, age in ((0.3, PERIOD), (0.3 + PERIOD, 0.0)):
        rows = [[at(begin + k * PERIOD)] for k in range(3)]
        seen = Channel(
            value=rows[0][0][0], rate=rows[0][0][1], acceleration=rows[0][0][2]
        )
        series, _, _ = extrapolate(
            (seen,), age - DT, rows[0], 1.0, DT, PERIOD, rows[1:]
        )
        ends.append([float(series[0].derivative(k)) for k in range(5)])
    np.testing.assert_allclose(ends[0], ends[1], atol=0.01 * w**4)
    np.testing.assert_allclose(ends[0][:4], ends[1][:4], atol=1e-4 * w**3)


@pytest.mark.parametrize("jump", [0.5, -3.0])
def test_a_jump_to_come_is_not_smoothed(jump):
    """Neither of the rate at the next sample, which has no jerk before it, nor of the
    acceleration at the one after.
    """
    sample, t = (0.2, 0.3, 0.5), 0.015
    after = (0.2 + 0.3 * PERIOD, 0.3 + 0.5 * PERIOD + jump, 0.5)
    seen = (Channel(value=0.2, rate=0.3, acceleration=0.5),)
    series, _, _ = extrapolate(
        seen, t - DT, [sample], 1.0, DT, PERIOD, [[after], [after]]
    )
    np.testing.assert_allclose(
        [float(series[0].derivative(k)) for k in range(5)],
        parabola(sample, t),
        rtol=1e-12,
    )
    smooth = (0.2, 0.3 + 0.5 * PERIOD, 0.5)
    series, _, _ = extrapolate(
        seen, t - DT, [sample], 1.0, DT, PERIOD, [[smooth], [(0.2, jump, 5.0)]]
    )
    np.testing.assert_allclose(
        [float(series[0].derivative(k)) for k in (3, 4)], [0.0, 0.0], atol=1e-9
    )


def test_a_signal_of_structure_alone_keeps_it():
    series, _, _ = extrapolate((Channel(),), 0.01, [(1.5, 0, 0)], 1.0, DT, PERIOD)
    assert [type(series[0].derivative(k)) for k in range(1, 5)] == [int] * 4


@pytest.mark.parametrize("ticks", [5, 6, 9, 40])
def test_a_sample_that_no_other_follows_is_carried_for_one_period_and_no_further(ticks):
    """A reference that falls silent stands still where its next sample was due."""
    sample = (1.5, 0.7, -2.0)
    found, _, age = held(sample, ticks)
    assert age == pytest.approx(PERIOD, rel=1e-12)
    np.testing.assert_allclose(
        found[-1], parabola(sample, PERIOD), rtol=1e-12, atol=1e-15
    )


def test_the_stepped_law_stops_there_too():
    controller = make_controller("ct_ladder", MODEL)
    still = dict.fromkeys(
        ("joint_rates", "joint_accelerations", "joint_jerks", "joint_snaps"), (0.0, 0.0)
    )
    sample = Reference(
        position=Vec3(0.3, 0.0, 1.0),
        velocity=Vec3(1.0, 0.0, 0.0),
        acceleration=Vec3(-2.0, 0.0, 0.0),
        joints=(0.1, 0.2),
        **still,
    ).dense()
    memory, par = (
        controller.memory,
        dataclasses.replace(controller.par, reference_period=PERIOD),
    )
    for _ in range(12):
        now, channels, age = _present(memory, sample, DT, par)
        memory = dataclasses.replace(memory, channels=channels, age=age, started=1.0)
    assert now.position.x == pytest.approx(0.3 + PERIOD - PERIOD**2, rel=1e-12)


def test_what_is_counted_of_one_motion_is_bounded():
    """Three samples fix jerk and snap; a memory whose numbers grow without end would
    not be one of a fixed state.
    """
    p = np.polynomial.Polynomial([0.2, -0.3, 0.5, 0.4])
    channels, age, started = (Channel(),), 0.0, 0.0
    for k in range(9):
        sample = tuple(float(q(k * PERIOD)) for q in (p, p.deriv(1), p.deriv(2)))
        _, channels, age = extrapolate(channels, age, [sample], started, DT, PERIOD)
        started = 1.0
        assert channels[0].count == min(k, 2)


def observers_lag(bandwidth):
    """How late an observer with both poles at exp(-bandwidth dt) finds a force that
    grows evenly, s: step by step.
    """
    b = np.exp(-bandwidth * DT)
    v = seen = found = force = 0.0
    for k in range(240):
        force = 0.2 * k * DT
        v += force * DT
        ahead = seen + found * DT
        seen = ahead + (1.0 - b * b) * (v - ahead)
        found += (1.0 - b) ** 2 * (v - ahead) / DT
    return (force - found) / 0.2


@pytest.mark.parametrize("bandwidth", [34.0, 60.0])
def test_a_motion_is_heard_exactly_as_late_as_the_observer_finds_what_it_needs(
    bandwidth,
):
    """Two stages at the observer's poles: rates and loads that grow evenly, beside the
    efforts found under them.
    """
    joint = make_centroidal(MODEL).par.parts.adaptation.start(2).joints[0]
    share = low_pass_share(bandwidth, DT)
    for k in range(240):
        grown = Efforts(load=-0.3 * k * DT, rate=0.2 * k * DT, given=0.1 * k * DT)
        joint = joint.filtered(grown, 0.0, share, DT)
    for name, slope in (("load", -0.3), ("rate", 0.2), ("given", 0.1)):
        lag = 239 * DT - getattr(joint.twice, name) / slope
        assert lag == pytest.approx(observers_lag(bandwidth), rel=1e-9)
        # the first of the two stages is half as late
        assert 239 * DT - getattr(joint.once, name) / slope == pytest.approx(
            0.5 * lag, rel=1e-9
        )
