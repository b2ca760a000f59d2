"""Delays and lags planted in noisy flights, found in their logs: the table of
docs/data/results_identification.md.
"""

from __future__ import annotations

import numpy as np
import pytest
from planted_lags import numbers_of, planted, truths_of

import skyarm
from skyarm.identify.loop_lags import loop_lags

pytest.importorskip("scipy", reason="needs the extra 'identify'")


@pytest.mark.thorough
@pytest.mark.parametrize(
    "vehicle", ["hummingbird_arm2_rotors", "crazyflie_arm1", "hexarotor_arm6"]
)
@pytest.mark.parametrize(
    ("late", "slower", "drive"),
    [(0.005, 0.5, 0.01), (0.01, 2.0, 0.02), (0.02, 1.0, 0.0)],
)
def test_twelve_noisy_seconds_tell(vehicle, late, slower, drive):
    """A quick motor's time constant down, in a flight that rarely slows down, is found
    up to 11 % short.
    """
    believed = skyarm.load_vehicle(vehicle)
    found = loop_lags(planted(believed, 12.0, late, slower, drive, 23), believed).rotors
    assert found.is_known
    assert found.delay.low <= late <= found.delay.high
    assert found.apart
    assert abs(found.delay.value - late) < 0.0015
    assert found.factor == pytest.approx((slower, slower), rel=0.12)


@pytest.mark.thorough
def test_rotors_of_any_kind_and_joints_of_any_drive():
    """Coaxial and tilting rotors, thrust tables, sliding joints, servos; of twenty
    intervals one may miss the truth.
    """
    outside = []
    for vehicle in ("octo_coaxial_two_arms", "voliro_like", "quadrotor_roll_arm2"):
        believed = skyarm.load_vehicle(vehicle)
        of_rotors, of_joints = truths_of(believed, 0.013, 1.3, 0.015)
        for seed in (5, 6, 7):
            found = loop_lags(planted(believed, 6.0, 0.013, 1.3, 0.015, seed), believed)
            assert found.rotors.is_known
            assert len(found.joints) == (0 if believed.drives else believed.n)
            for lag, truths in (
                (found.rotors, of_rotors),
                *((each, of_joints) for each in found.joints),
            ):
                outside += [
                    not a.low <= b <= a.high
                    for a, b in zip(numbers_of(lag), truths, strict=True)
                ]
    assert np.mean(outside) <= 0.05


@pytest.mark.thorough
def test_intervals_cover_without_the_least_half_that_all_have(monkeypatch):
    """Of some flights at most 6 % of the truths lie outside of 95 % intervals by the
    noise alone, and most well inside.

    A delay of 13 ms is no multiple of the period. Of a hundred intervals that are right
    5 miss; these are a little wide, as they are the larger of two.
    """
    monkeypatch.setattr("skyarm.identify.loop_lags.INSTANT", 1e-3)
    monkeypatch.setattr("skyarm.identify.loop_lags.SHARE", 1e-4)
    outside, halves = [], []
    for name in ("hummingbird_arm2_rotors", "crazyflie_arm1"):
        believed = skyarm.load_vehicle(name)
        for seed, planting in (
            (1, (0.005, 0.5, 0.01)),
            (2, (0.01, 2.0, 0.02)),
            (3, (0.013, 1.5, 0.03)),
        ):
            found = loop_lags(planted(believed, 12.0, *planting, seed), believed)
            of_rotors, of_joints = truths_of(believed, *planting)
            for lag, truths in (
                (found.rotors, of_rotors),
                *((each, of_joints) for each in found.joints),
            ):
                outside += [
                    not a.low <= b <= a.high
                    for a, b in zip(numbers_of(lag), truths, strict=True)
                ]
                halves.append(lag.together.high - lag.together.value)
    assert np.mean(outside) <= 0.06
    assert np.median(halves) < 0.0015
