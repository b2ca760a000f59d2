"""Margins of a double integrator, by textbook formulas and SciPy."""

from __future__ import annotations

import dataclasses
import math
import sys

import numpy as np
import pytest
from hand_made import KD, KP, T, double_integrator, numbered_channels
from scipy import linalg, optimize

from skyarm.records.leaves import parts
from skyarm.studies.stability import margins
from skyarm.studies.stability.closed_loop import (
    OpenLoop,
    close_loop,
    closed_loop,
    radius,
)


def sampled(delay):
    """Eigenvalues of the delayed loop by SciPy: matrix exponential over each part of a
    period, then a queue.
    """
    whole, part = divmod(round(delay * 1e6), round(T * 1e6))
    late = part * 1e-6
    A = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]])
    first, second = linalg.expm(A * late), linalg.expm(A * (T - late))
    x_x = second[:2, :2] @ first[:2, :2]
    old, new = second[:2, :2] @ first[:2, 2:], second[:2, 2:]
    n = 2 + whole + 1
    M = np.zeros((n, n))
    M[:2, :2] = x_x
    M[:2, 2:3] += old
    K = np.zeros((1, n))
    K[0, :2] = -KP, -KD
    for i in range(whole):
        M[2 + i, 3 + i] = 1.0
    M[-1] = K
    following = M[2:3].copy()
    M[:2] += new @ following
    return linalg.eigvals(M)


@pytest.mark.parametrize("delay", [0.0, 0.002, 0.005, 0.017, 0.1])
def test_eigenvalues_of_a_delayed_loop_are_scipys(delay):
    ours = np.linalg.eigvals(closed_loop(double_integrator(delay=delay)))
    theirs = sampled(delay)
    # a queue that nothing reads is no part of our loop; its eigenvalues are zero
    size = max(len(ours), len(theirs))
    pad = [
        np.sort_complex(np.pad(np.asarray(e, dtype=complex), (0, size - len(e))))
        for e in (ours, theirs)
    ]
    np.testing.assert_allclose(np.poly(pad[0]), np.poly(pad[1]), atol=1e-10)


def test_the_gain_margin_is_that_of_jury():
    # z^2 - 2 z + 1 + k ((kp T^2 / 2 + kd T) z + kp T^2 / 2 - kd T) has its roots inside
    # the circle for k kd T < 2
    found = margins(double_integrator())
    assert found.rotor_gain[1] == pytest.approx(2.0 / (KD * T), rel=1e-6)
    # a double integrator under PD bears any lower gain
    assert found.rotor_gain[0] == 0.0
    assert found.joint_gain == (0.0, math.inf)  # it has no joints


def test_the_delay_margin_is_phase_margin_over_crossover():
    def size(w):
        return math.hypot(KP, KD * w) / w**2 - 1.0

    crossover = optimize.brentq(size, 0.1, 100.0)
    continuous = math.atan2(KD * crossover, KP) / crossover
    found = margins(double_integrator()).delay
    # the hold costs half a period
    assert found == pytest.approx(continuous - 0.5 * T, abs=2e-4)


def test_the_delay_margin_is_where_scipys_loop_leaves_the_circle():
    found = margins(double_integrator()).delay
    edge = optimize.brentq(
        lambda d: np.abs(sampled(d)).max() - 1.0, found - 0.002, found + 0.002
    )
    # a straight line over 1 ms
    assert found == pytest.approx(edge, abs=2e-5)


def test_delay_that_is_there_already_is_no_margin_left():
    bare, delayed = (
        margins(double_integrator()).delay,
        margins(double_integrator(delay=0.012)).delay,
    )
    assert delayed == pytest.approx(bare - 0.012, abs=1e-5)
    measured = margins(double_integrator(measured_late=3)).delay
    assert measured == pytest.approx(bare - 3 * T, abs=1e-5)


def test_an_unstable_loop_has_no_margins():
    loop = double_integrator(delay=0.1)
    assert radius(loop) > 1.0
    assert radius(dataclasses.replace(loop, command_delay=0.5)) > 1.0
    found = margins(dataclasses.replace(loop, command_delay=0.5))
    assert (found.delay, found.rotor_gain) == (0.0, (1.0, 1.0))


def test_rates_are_logarithms_of_eigenvalues():
    found = margins(double_integrator())
    np.testing.assert_allclose(np.exp(found.s * T), found.z, rtol=1e-12)
    wanted = np.sort_complex(np.roots([1.0, KD, KP]))
    # sampling at 200 Hz moves the continuous poles by a few per cent
    np.testing.assert_allclose(np.sort_complex(found.s), wanted, rtol=0.1)


def test_clocks_are_no_part_of_the_loop():
    loop = double_integrator()
    # a memory that counts, and one that keeps what it sees but is never read
    clock = dataclasses.replace(
        loop,
        m_m=np.eye(2),
        m_y=np.array([[0.0, 0.0], [1.0, 0.0]]),
        u_m=np.zeros((1, 2)),
    )
    np.testing.assert_allclose(
        np.sort(np.abs(margins(clock).z)), np.sort(np.abs(margins(loop).z)), rtol=1e-12
    )


def test_a_delay_between_steps_is_refused():
    with pytest.raises(ValueError, match=r"must be a whole number of 0\.001 s"):
        radius(double_integrator(), extra_delay=0.0005)


def two_axes(other_gain):
    """Two double integrators side by side, each with an actuator of its own; the second
    under another gain.
    """
    one = double_integrator()

    def both(a, b):
        return np.block(
            [
                [a, np.zeros((a.shape[0], b.shape[1]))],
                [np.zeros((b.shape[0], a.shape[1])), b],
            ]
        )

    parts = {name: getattr(one, name) for name in ("y_x", "y_old", "m_m", "m_y", "u_m")}
    twice = {name: both(value, value) for name, value in parts.items()}
    acting = {
        name: np.array([both(a, a) for a in getattr(one, name)])
        for name in ("x_x", "x_old", "x_new")
    }
    return dataclasses.replace(
        one,
        rotors=2,
        u_y=both(one.u_y, other_gain * one.u_y),
        channels=numbered_channels(2, 0, 4),
        **twice,
        **acting,
    )


def test_the_margin_of_all_rotors_is_that_of_the_most_delicate():
    # by Jury as above: the second axis bears the smaller factor
    found = margins(two_axes(1.5))
    edge = 2.0 / (KD * T)
    assert found.rotor_gain[1] == pytest.approx(edge / 1.5, rel=1e-6)
    assert (found.rotor_gain[0], found.joint_gain) == (0.0, (0.0, math.inf))


def test_a_joint_is_told_from_a_rotor():
    found = margins(dataclasses.replace(two_axes(1.5), rotors=1))
    edge = 2.0 / (KD * T)
    assert found.rotor_gain[1] == pytest.approx(edge, rel=3e-4)
    assert found.joint_gain[1] == pytest.approx(edge / 1.5, rel=3e-4)


def test_actuators_that_share_a_load_bear_a_common_factor():
    # two rotors push one mass, half each
    one = double_integrator()
    shared = dataclasses.replace(
        one,
        rotors=2,
        u_y=np.vstack([one.u_y, one.u_y]),
        u_m=np.zeros((2, 0)),
        y_old=np.zeros((2, 2)),
        x_old=0.5 * np.repeat(one.x_old, 2, axis=2),
        x_new=0.5 * np.repeat(one.x_new, 2, axis=2),
        channels=numbered_channels(2, 0, 2),
    )
    found, edge = margins(shared), 2.0 / (KD * T)
    assert found.rotor_gain[1] == pytest.approx(edge, rel=1e-6)


def test_a_loop_is_closed_once_for_all_gains(monkeypatch):
    """Loops of six joints have hundreds of gains to try: what a gain does not change is
    put together once.
    """
    module = sys.modules["skyarm.studies.stability.margins"]
    counted = []
    monkeypatch.setattr(
        module,
        "close_loop",
        lambda *arguments: counted.append(arguments) or close_loop(*arguments),
    )
    margins(double_integrator())
    assert len(counted) == 1


def test_no_loop_is_cut_nowhere_in_silence():
    """Without points where it is cut a loop would have no disk margins."""
    others = parts(double_integrator())
    del others["channels"]
    with pytest.raises(TypeError, match="argument: 'channels'"):
        OpenLoop(**others)
