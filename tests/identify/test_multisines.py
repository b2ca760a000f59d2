"""Multisines: how far a drawn segment swings, and how its offsets, frequencies and
amplitudes fill the ranges.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from skyarm.identify.multisines import (
    Axes,
    Segment,
    draw_segment,
    mutate_segment,
    within,
)

LENGTH = 10.0
TIMES = np.linspace(0.0, LENGTH, 4001)
AXES = Axes(
    rest=np.array([0.0, 0.0, 3.0, 0.0, 0.5]),
    low=np.array([-0.75, -0.75, 2.25, -1.2, 0.3]),
    high=np.array([0.75, 0.75, 3.75, 1.2, 1.7]),
    fastest=np.array([1.2, 1.2, 1.2, 1.2, 2.5]),
)
"""A box of 1.5 m and a joint whose rest is not in the middle of its range."""


def sines(*frequencies, amplitude=1.0, offset=0.0):
    """Segment whose axes all swing alike."""
    count = len(AXES.rest)
    return Segment(
        duration=LENGTH,
        frequencies=np.tile(np.array(frequencies, dtype=float), (count, 1)),
        amplitudes=np.full((count, len(frequencies)), amplitude),
        phases=np.tile(np.linspace(0.0, 1.0, len(frequencies)), (count, 1)),
        offsets=np.full(count, offset),
    )


def swings(segment):
    """Sums of the sines (axes, N) without the envelope."""
    angles = (
        2.0 * np.pi * segment.frequencies[:, :, None] * TIMES
        + segment.phases[:, :, None]
    )
    return (segment.amplitudes[:, :, None] * np.sin(angles)).sum(axis=1)


@pytest.mark.parametrize("amplitude", [0.01, 20.0])
def test_a_swing_has_the_size_that_is_wanted_whatever_its_sines_were(amplitude):
    """By its peak, which is below the sum of the amplitudes: sines of different
    frequencies do not meet at once.
    """
    size = np.array([0.1, 0.2, 0.3, 1.0, 0.15])
    found = within(sines(0.21, 0.34, 0.4, amplitude=amplitude), AXES, size)
    assert np.abs(swings(found)).max(axis=1) == pytest.approx(size, rel=2e-3)


def test_without_a_size_a_swing_in_its_range_stays_and_a_wider_one_fills_the_range():
    soft = sines(0.21, 0.34, amplitude=0.01)
    assert within(soft, AXES, None).amplitudes == pytest.approx(soft.amplitudes)
    loud = within(sines(0.21, 0.34, amplitude=9.0), AXES, None)
    # the joint rests 0.2 from its lower end
    assert np.abs(swings(loud)).max(axis=1) == pytest.approx(
        [0.75, 0.75, 0.75, 1.2, 0.2], rel=2e-3
    )


@pytest.mark.parametrize(
    ("offset", "left"), [(0.7, 0.5), (1.0, 0.2), (-0.1, 0.1), (1.3, 0.0), (-0.3, 0.0)]
)
def test_about_an_offset_a_joint_swings_as_far_as_to_the_nearer_end(offset, left):
    """An offset beyond the range ends at it, and there the joint rests."""
    found = within(sines(0.21, 0.34, amplitude=9.0, offset=offset), AXES, None)
    assert found.offsets[4] == pytest.approx(min(max(offset, -0.2), 1.2))
    assert np.abs(swings(found)[4]).max() == pytest.approx(left, rel=2e-3, abs=1e-12)


def test_the_pull_on_the_base_is_limited_to_4_m_per_s2_and_the_rest_is_not():
    """Of a sine of 2 Hz: 4 m/s^2 at an amplitude of 2.5 cm."""
    found = within(sines(2.0), AXES, np.full(5, 0.15))
    most = 4.0 / (4.0 * math.pi) ** 2
    assert np.abs(swings(found)).max(axis=1) == pytest.approx(
        [most, most, most, 0.15, 0.15], rel=2e-3
    )
    slow = within(sines(0.5), AXES, np.full(5, 0.15))
    assert np.abs(swings(slow)).max(axis=1) == pytest.approx(np.full(5, 0.15), rel=2e-3)


def test_drawn_offsets_of_a_joint_are_about_mid_range_and_the_base_has_none():
    draw = np.random.default_rng(1)
    drawn = [draw_segment(AXES, LENGTH, draw) for _ in range(200)]
    offsets = np.array([each.offsets for each in drawn])
    assert not offsets[:, :4].any()
    about = offsets[:, 4] + AXES.rest[4]
    # of 200 draws: four standard deviations
    assert about.mean() == pytest.approx(1.0, abs=0.06)
    # an offset leaves room for the swing, between a tenth of the range's half and the
    # whole of it
    sizes = np.array([np.abs(swings(each)[4]).max() for each in drawn[:60]])
    assert (np.abs(about[:60] - 1.0) + sizes <= 0.7 * (1.0 + 2e-3)).all()
    assert sizes.min() == pytest.approx(0.07, abs=0.03)
    assert sizes.max() == pytest.approx(0.7, abs=0.05)
    assert about.min() < 0.7
    assert about.max() > 1.3


def test_phases_are_drawn_from_the_whole_circle():
    draw = np.random.default_rng(2)
    phases = np.concatenate(
        [draw_segment(AXES, LENGTH, draw).phases.ravel() for _ in range(50)]
    )
    assert np.abs(phases).max() <= math.pi
    assert np.abs(np.exp(1j * phases).mean()) < 0.1
    assert phases.min() < -3.0
    assert phases.max() > 3.0


def test_near_a_segment_two_axes_are_drawn_anew_and_the_others_get_louder_or_softer():
    draw = np.random.default_rng(3)
    segment = sines(0.21, 0.34, 0.4, 0.5, amplitude=0.01)
    anew, louder = [], []
    for _ in range(200):
        found = mutate_segment(segment, AXES, draw)
        kept = (found.frequencies == segment.frequencies).all(axis=1)
        assert (found.phases[kept] == segment.phases[kept]).all()
        assert (found.phases[~kept] != segment.phases[~kept]).all()
        anew.append((~kept).sum())
        louder += (found.amplitudes[kept] / segment.amplitudes[kept])[:, 0].tolist()
    assert np.mean(anew) == pytest.approx(2.0, abs=0.25)
    assert min(louder) == pytest.approx(0.85, abs=0.01)
    assert max(louder) == pytest.approx(1.3, abs=0.01)


def test_a_segment_rises_and_falls_in_a_second_and_a_half_and_swings_in_full_between():
    segment = sines(0.4, amplitude=0.3, offset=0.1)
    value = segment.motion(TIMES)[0]
    full = 0.1 + swings(segment)
    between = (TIMES > 1.5) & (TIMES < LENGTH - 1.5)
    # phases of 3 digits
    np.testing.assert_allclose(value[:, between], full[:, between], atol=2e-3)
    outside = (TIMES < 1.4) | (TIMES > LENGTH - 1.4)
    assert (np.abs(value[:, outside]) <= np.abs(full[:, outside]) + 2e-3).all()
    ends = np.searchsorted(TIMES, [0.75, LENGTH - 0.75])
    np.testing.assert_allclose(value[:, ends], 0.5 * full[:, ends], atol=2e-3)


def test_a_scenario_file_has_amplitudes_to_10_micrometres_and_phases_to_1_mrad():
    segment = draw_segment(AXES, LENGTH, np.random.default_rng(4))
    for axis in range(5):
        offset, *waves = segment.table(axis)["signal"]
        assert offset == pytest.approx(segment.offsets[axis], abs=5.1e-6)
        for name, given, digits in (
            ("amplitude", segment.amplitudes, 5),
            ("frequency_hz", segment.frequencies, 4),
            ("phase", segment.phases, 3),
        ):
            told = [each[name] for each in waves]
            assert told == pytest.approx(given[axis].tolist(), abs=0.51 * 0.1**digits)
            assert all(
                len(repr(each).partition(".")[2]) <= digits or "e" in repr(each)
                for each in told
            )


def test_derivatives_of_a_segment_are_those_of_its_values():
    value, first, second = sines(0.21, 0.4, amplitude=0.2, offset=0.3).motion(TIMES)
    inside = slice(5, -5)
    np.testing.assert_allclose(
        np.gradient(value, TIMES, axis=1)[:, inside], first[:, inside], atol=1e-4
    )
    np.testing.assert_allclose(
        np.gradient(first, TIMES, axis=1)[:, inside], second[:, inside], atol=5e-3
    )  # jerk jumps at 1.5 s
