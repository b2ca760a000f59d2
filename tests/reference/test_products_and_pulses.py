"""Products of signals and pulses: an identity of sines, a loop over pulses, and both
from a file.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from skyarm.reference import (
    Constant,
    Product,
    Pulses,
    Ramp,
    Sine,
    Sum,
    Windowed,
    signal_from,
)

TIMES = np.linspace(-1.0, 7.0, 801)


def test_a_product_of_sines_is_half_the_difference_of_two_cosines():
    product = Product(
        Sine(amplitude=2.0, frequency_hz=0.7, phase=0.3),
        Sine(amplitude=3.0, frequency_hz=0.2),
    )
    cosines = [
        Sine(amplitude=a, frequency_hz=f, phase=0.3 + 0.5 * math.pi)
        for a, f in ((3.0, 0.5), (-3.0, 0.9))
    ]
    for ours, identity in zip(
        product.derivatives(TIMES), Sum(tuple(cosines)).derivatives(TIMES), strict=True
    ):
        # rounding of four products, of numbers up to 6 (2 pi 0.9)^4
        assert np.allclose(ours, identity, rtol=0.0, atol=1e-10)


def test_a_product_folds_structure_and_knows_the_times_of_both():
    ramp = Ramp(start=2.0, duration=3.0, height=1.0)
    assert Product(Constant(2.0), Constant(3.0)).derivatives(0.5) == (6.0, 0, 0, 0, 0)
    assert all(
        type(value) is int for value in Product(ramp, Constant(0)).derivatives(1.0)
    )
    assert Product(Windowed(ramp, 1.0, 4.0), ramp).switch_times() == (
        1.0,
        2.0,
        4.0,
        5.0,
    )


def test_pulses_are_on_in_their_windows_only():
    pulses = Pulses(start=0.5, period=2.0, width=0.75, height=-3.0, count=3)
    wanted = np.zeros_like(TIMES)
    for k in range(3):
        wanted[(0.5 + 2.0 * k <= TIMES) & (1.25 + 2.0 * k > TIMES)] = -3.0
    # instants at an end may round either way
    inner = (
        np.min(np.abs(TIMES[:, None] - np.array(pulses.switch_times())), axis=1) > 1e-9
    )
    value, *rest = pulses.derivatives(TIMES)
    assert np.array_equal(value[inner], wanted[inner])
    assert rest == [0, 0, 0, 0]
    assert pulses.switch_times() == (0.5, 1.25, 2.5, 3.25, 4.5, 5.25)
    assert [pulses.derivatives(t)[0] for t in (0.5, 1.25)] == [
        -3.0,
        0.0,
    ], "right-hand limits"


def test_both_come_from_a_file():
    sine, ramp = (
        {"kind": "sine", "amplitude": 1.0, "frequency_hz": 0.5},
        {
            "kind": "constant",
            "value": 2.0,
        },
    )
    found = signal_from({"kind": "product", "signal": sine, "factor": ramp}, "x")
    assert found == Product(Sine(amplitude=1.0, frequency_hz=0.5), Constant(2.0))
    pulses = {"kind": "pulses", "period": 1.0, "width": 0.5, "count": 4}
    assert signal_from(pulses, "x") == Pulses(
        start=0.0, period=1.0, width=0.5, height=1.0, count=4
    )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"count": 0}, "count = 0: must be at least 1"),
        ({"count": 1.5}, "x.count = 1.5: must be a whole number"),
        ({"period": 0.0}, "x.period = 0"),
        ({"width": -1.0}, "x.width = -1"),
        ({"until": 3.0}, "x.until"),
    ],
)
def test_wrong_pulses_are_refused(change, message):
    with pytest.raises(ValueError, match=message.replace("(", r"\(")):
        signal_from(
            {"kind": "pulses", "period": 1.0, "width": 0.5, "count": 4} | change, "x"
        )


def test_pulses_made_in_python_are_checked_too():
    with pytest.raises(ValueError, match=r"pulses.count = 0: must be at least 1"):
        Pulses(period=1.0, width=0.5, count=0)
    with pytest.raises(ValueError, match=r"pulses.period = 0.0: must be above 0"):
        Pulses(period=0.0, width=0.5, count=1)
