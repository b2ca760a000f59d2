"""Signals and their derivatives, by differences and by closed forms that share no
code.
"""

import cmath
import math

import numpy as np
import pytest

from skyarm.compile import trace
from skyarm.reference import Constant, Ramp, Shifted, Sine, Sum, Windowed, sequence
from support.engines import jax_doubles

# 0.3 sin(2 pi 0.5 (t - 6)) and 0.2 sin(2 pi 0.5 (t - 6) + pi/2) on [6, 21): the paper's
# Case 2
CASE2_TH1 = Windowed(Shifted(Sine(amplitude=0.3, frequency_hz=0.5), 6.0), 6.0, 21.0)
CASE2_TH2 = Windowed(
    Shifted(Sine(amplitude=0.2, frequency_hz=0.5, phase=math.pi / 2), 6.0), 6.0, 21.0
)
STEPS = [(1.0, 0.3), (5.0, 0.3), (1.0, 0.0), (1.0, -0.3), (5.0, -0.3), (1.0, 0.0)]
CASE1 = sequence(6.0, STEPS)
CASE1_SMOOTH = sequence(6.0, STEPS, shape="quintic")

SIGNALS = {
    "constant": Constant(0.7),
    "ramp": Ramp(start=1.0, duration=2.5, height=-0.4),
    "quintic": Ramp(start=1.0, duration=2.5, height=-0.4, shape="quintic"),
    "sine": Sine(amplitude=0.3, frequency_hz=0.5, phase=0.4),
    "case2_th1": CASE2_TH1,
    "case2_th2": CASE2_TH2,
    "case1": CASE1,
    "case1_smooth": CASE1_SMOOTH,
    "shifted_window": Shifted(
        Windowed(Ramp(start=0.0, duration=4.0, height=1.0, shape="quintic"), 1.0, 3.0),
        2.0,
    ),
    "sum": (
        Sine(amplitude=0.3, frequency_hz=0.2)
        + Ramp(start=2.0, duration=1.5, height=0.5, shape="quintic")
    ),
}
H = 1e-3
# the largest fifth derivative of the signals is 0.3 pi^5 = 92 (sines), 720 * 0.3 = 217
# (quintics): the fourth-order stencils err by H^4/5 times that = 4e-11; rounding adds
# 1e-16/H times the size of the lower derivative (217) = 2e-11
TOLERANCE = 2e-10


def differences(signal, t, points, weights):
    values = [signal.derivatives(t + k * H) for k in points]
    return [
        sum(w * v[order] for w, v in zip(weights, values, strict=True)) / H
        for order in range(4)
    ]


def central(signal, t):
    return differences(signal, t, (-2, -1, 1, 2), (1 / 12, -2 / 3, 2 / 3, -1 / 12))


def forward(signal, t):
    return differences(signal, t, (0, 1, 2, 3, 4), (-25 / 12, 4, -3, 4 / 3, -1 / 4))


@pytest.mark.parametrize("name", SIGNALS)
def test_each_derivative_is_the_difference_of_the_one_below(name):
    signal = SIGNALS[name]
    times = [
        t
        for t in np.linspace(0.013, 23.0, 231)
        if all(abs(t - s) > 3 * H for s in signal.switch_times())
    ]
    assert len(times) > 200
    for t in times:
        np.testing.assert_allclose(
            signal.derivatives(t)[1:], central(signal, t), atol=TOLERANCE
        )


@pytest.mark.parametrize(
    "name", [name for name in SIGNALS if SIGNALS[name].switch_times()]
)
def test_at_switch_times_derivatives_are_those_of_the_right(name):
    signal = SIGNALS[name]
    for s in signal.switch_times():
        np.testing.assert_allclose(
            signal.derivatives(s)[1:], forward(signal, s), atol=TOLERANCE
        )
        after = signal.derivatives(s + 1e-9)
        # 1e-9 s later: at most that times the largest fifth derivative
        np.testing.assert_allclose(signal.derivatives(s), after, atol=1e-6)


@pytest.mark.parametrize(
    "name", [name for name in SIGNALS if SIGNALS[name].switch_times()]
)
def test_every_listed_switch_is_a_jump_and_every_jump_is_listed(name):
    signal = SIGNALS[name]
    for s in signal.switch_times():
        if (name, s) == ("case1", 13.0):
            continue  # two ramps of one slope meet
        before, at = (
            np.array(signal.derivatives(s - 1e-7)),
            np.array(signal.derivatives(s)),
        )
        assert np.abs(at - before).max() > 1e-4
    listed = signal.switch_times()
    assert list(listed) == sorted(set(listed))
    grid = np.arange(0.0, 24.0, 0.01) + 0.00013
    for a, b in zip(grid[:-1].tolist(), grid[1:].tolist(), strict=True):
        if not any(a < s <= b for s in listed):
            jump = np.abs(
                np.subtract(signal.derivatives(b), signal.derivatives(a))
            ).max()
            assert jump < 2.3  # 0.01 s times the largest fifth derivative, 217 + margin


def test_sine_is_the_imaginary_part_of_a_turning_pointer():
    signal, w = Sine(amplitude=0.3, frequency_hz=0.7, phase=-0.4), 2.0 * math.pi * 0.7
    for t in (-1.0, 0.0, 0.37, 12.3):
        pointer = 0.3 * cmath.exp(1j * (w * t - 0.4))
        expected = [((1j * w) ** k * pointer).imag for k in range(5)]
        # 1e-13: the angle has 50 rad, the fourth derivative a factor of 370
        assert signal.derivatives(t) == pytest.approx(expected, abs=1e-13 * w**4)


def test_quintic_blend_is_the_polynomial_at_rest_at_both_ends():
    interpolate = pytest.importorskip("scipy.interpolate")
    oracle = interpolate.BPoly.from_derivatives(
        [1.0, 3.5], [[0.0, 0.0, 0.0], [-0.4, 0.0, 0.0]]
    )
    signal = SIGNALS["quintic"]
    for t in np.linspace(1.0, 3.499, 50):
        expected = [oracle(t)] + [oracle.derivative(k)(t) for k in range(1, 5)]
        # rounding of the Bernstein form
        np.testing.assert_allclose(signal.derivatives(float(t)), expected, atol=1e-12)


def test_linear_ramp_by_hand():
    ramp = Ramp(start=6.0, duration=2.0, height=0.5)
    values = {t: ramp.derivatives(t)[:2] for t in (5.0, 6.0, 7.0, 8.0, 9.0)}
    assert values == {
        5.0: (0.0, 0.0),
        6.0: (0.0, 0.25),
        7.0: (0.25, 0.25),
        8.0: (0.5, 0.0),
        9.0: (0.5, 0.0),
    }


def test_case_1_ramps_holds_and_returns():
    for t, value in {
        0.0: 0.0,
        6.0: 0.0,
        6.5: 0.15,
        7.0: 0.3,
        10.0: 0.3,
        12.0: 0.3,
        12.5: 0.15,
        13.0: 0.0,
        13.5: -0.15,
        14.0: -0.3,
        18.99: -0.3,
        19.0: -0.3,
        19.5: -0.15,
        20.0: 0.0,
        30.0: 0.0,
    }.items():
        assert CASE1.derivatives(t)[0] == pytest.approx(value, abs=1e-15)
        smooth = CASE1_SMOOTH.derivatives(t)[0]
        # the blend is symmetric: it meets the ramp half way
        assert smooth == pytest.approx(value, abs=1e-15)
    assert CASE1.derivatives(6.0)[1] == pytest.approx(0.3)
    assert CASE1.derivatives(12.0)[1] == pytest.approx(-0.3)
    assert CASE1.switch_times() == (6.0, 7.0, 12.0, 13.0, 14.0, 19.0, 20.0)


def test_case_2_follows_the_paper():
    for t in (6.0, 6.3, 10.7, 20.99):
        assert CASE2_TH1.derivatives(t)[0] == pytest.approx(
            0.3 * math.sin(math.pi * (t - 6.0)), abs=1e-14
        )
        assert CASE2_TH2.derivatives(t)[0] == pytest.approx(
            0.2 * math.cos(math.pi * (t - 6.0)), abs=1e-14
        )
    for t in (0.0, 5.999, 21.0, 25.0):
        assert CASE2_TH1.derivatives(t) == CASE2_TH2.derivatives(t) == (0.0,) * 5
    assert CASE2_TH2.derivatives(6.0)[0] == pytest.approx(0.2)  # it starts with a step
    assert CASE2_TH1.switch_times() == CASE2_TH2.switch_times() == (6.0, 21.0)


def test_a_window_forgets_switches_outside_it():
    assert Windowed(CASE1, 6.5, 13.0).switch_times() == (6.5, 7.0, 12.0, 13.0)
    assert Windowed(CASE1).switch_times() == CASE1.switch_times()
    assert Shifted(Windowed(CASE1, 6.5), 1.0).switch_times()[:2] == (7.5, 8.0)


def test_zero_derivatives_are_structure():
    assert Constant(0.3).derivatives(1.0)[1:] == (0, 0, 0, 0)
    assert all(
        type(d) is int for d in Windowed(Constant(0.3), 1.0, 2.0).derivatives(1.5)[1:]
    )
    assert all(type(d) is int for d in CASE1.derivatives(6.5)[2:])
    assert Sum(()).derivatives(1.0) == (0, 0, 0, 0, 0)


@pytest.mark.parametrize("name", SIGNALS)
def test_arrays_and_programs_give_what_floats_give(name):
    signal = SIGNALS[name]
    times = np.concatenate(
        [np.linspace(0.0, 24.0, 97), np.array(signal.switch_times())]
    )
    table = [
        np.broadcast_to(column, times.shape) for column in signal.derivatives(times)
    ]
    program = trace(lambda t: tuple(1.0 * d for d in signal.derivatives(t)), 0.0)
    for k, t in enumerate(times.tolist()):
        single = signal.derivatives(t)
        np.testing.assert_allclose(
            [column[k] for column in table], single, rtol=1e-13, atol=1e-13
        )
        assert program(t) == pytest.approx(single, abs=0.0)  # bit for bit, ints apart


def test_jax_and_casadi_give_what_floats_give():
    jax = pytest.importorskip("jax")
    import casadi

    signal = SIGNALS["sum"] + CASE2_TH2
    t = casadi.SX.sym("t")
    function = casadi.Function("f", [t], [casadi.vertcat(*signal.derivatives(t))])
    for value in (1.0, 2.5, 6.0, 10.1, 21.0):
        single = signal.derivatives(value)
        np.testing.assert_allclose(
            np.array(function(value)).ravel(), single, atol=1e-12
        )
        with jax_doubles():
            ours = jax.jit(
                lambda s: jax.numpy.stack([1.0 * d for d in signal.derivatives(s)])
            )(value)
        np.testing.assert_allclose(ours, single, atol=1e-12)


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: Constant(math.nan), "constant.value = nan: must be a finite number"),
        (
            lambda: Ramp(start=0.0, duration=0.0, height=1.0),
            "ramp.duration = 0.0: must be above 0",
        ),
        (
            lambda: Ramp(start=math.inf, duration=1.0, height=1.0),
            "ramp.start = inf: must be a finite number",
        ),
        (
            lambda: Ramp(start=0.0, duration=1.0, height=1.0, shape="cubic"),
            "ramp.shape = 'cubic': must be one of linear",
        ),
        (
            lambda: Sine(amplitude=1.0, frequency_hz=math.nan),
            "sine.frequency_hz = nan: must be a finite number",
        ),
        (
            lambda: Windowed(Constant(1.0), 2.0, 2.0),
            "windowed.stop = 2.0: must be after start",
        ),
        (
            lambda: Windowed(Constant(1.0), math.nan, 2.0),
            "windowed.start = nan: must be a number",
        ),
        (
            lambda: Shifted(Constant(1.0), math.inf),
            "shifted.delay = inf: must be a finite number",
        ),
        (lambda: sequence(0.0, [(0.0, 1.0)]), "a segment lasts 0.0 s"),
        (lambda: sequence(0.0, [(-1.0, 0.0)]), "a segment lasts -1.0 s"),
    ],
)
def test_impossible_signals_are_refused(build, message):
    with pytest.raises(ValueError) as caught:  # noqa: PT011
        build()
    assert message in str(caught.value)
