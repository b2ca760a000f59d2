"""The bound of every linear law's tip error in gusts: against flights of written-out equations, and its closed form."""

import dataclasses
from collections import deque

import numpy as np
import pytest
from least_tip_error import (
    DT,
    LENGTH,
    G,
    bears,
    closed_loop,
    cost,
    errors,
    foretelling,
    least,
    plane_of,
    regulator,
    system,
)
from least_tip_error import sensors as measured_by
from scipy.integrate import quad

SPEED, DEVIATION = 3.0, 0.44
"""m/s of air, m/s^2 of force."""


@pytest.fixture(scope="module")
def plane():
    return plane_of()


def drawn_flight(plane, mu, known, *, late=0, lanes=32, seconds=40.0, parts=10, gusts=1.0, seed=3):
    """Tip and command of lanes that fly the regulator, (periods, lanes): equations written out, Euler's steps."""
    F, H, W, C, gust = system(plane, SPEED, DEVIATION)
    rows, covariance = measured_by(plane, gust, known == "heard")
    (K, _), (L, _) = regulator(F, H, C, mu), foretelling(F, W, rows, covariance)
    deviations = np.sqrt(np.diag(covariance)) * (1.0 if gusts else 0.0)
    draw = np.random.default_rng(seed)
    c, v, angle, rate, turn, first, second = np.zeros((7, lanes)) + (0.0 if gusts else 1e-6)
    told, h, time = np.zeros((7, lanes)), DT / parts, LENGTH / SPEED
    sent = deque([np.zeros(lanes)] * late)
    tips, commands = [], []
    for _ in range(int(seconds / DT)):
        sent.append(-(K @ told)[0])
        command = sent.popleft()
        tips.append(c - plane.lever * angle)
        commands.append(sent[-1] if late else command)
        force = gust[0] * first + gust[1] * second
        heard = [c, v, angle, rate]
        if known == "heard":
            about = plane.mass * plane.height * force / plane.inertia
            heard.append(force + plane.height * (turn + about))
        error = np.array(heard) + deviations[:, None] * draw.normal(size=(len(heard), lanes)) - rows @ told
        told = F @ told - H @ (K @ told) + L @ error
        for _ in range(parts):
            force = gust[0] * first + gust[1] * second
            white = gusts * draw.normal(size=lanes) * np.sqrt(h)
            c, v, angle = c + h * v, v + h * (G * angle + force), angle + h * rate
            rate = rate + h * (turn + plane.mass * plane.height * force / plane.inertia)
            turn = turn + h * (command - turn) / plane.lag
            first, second = first + h * second, second - h * (first / time**2 + 2.0 * second / time) + white
    return np.array(tips), np.array(commands)


@pytest.mark.parametrize("known", ["heard", "measured"])
def test_a_flown_regulator_errs_by_what_its_covariance_says(plane, known):
    """Within 6 %: three standard deviations of the mean square of 32 x 35 s are 4 %, Euler's steps take the rest."""
    tips, commands = drawn_flight(plane, 1e-6, known)
    tip, effort = errors(plane, SPEED, DEVIATION, 1e-6, known)
    assert tips[1000:].std() == pytest.approx(tip, rel=0.06)
    assert commands[1000:].std() / plane.largest == pytest.approx(effort, rel=0.06)


@pytest.mark.parametrize("known", ["heard", "measured"])
def test_the_cost_is_that_of_the_closed_loop(plane, known):
    """The separation of regulator and filter against one Lyapunov equation of both."""
    for mu in (1e-9, 1e-7, 1e-5):
        tip, effort = errors(plane, SPEED, DEVIATION, mu, known)
        whole = tip**2 + mu * (effort * plane.largest) ** 2
        assert cost(plane, SPEED, DEVIATION, mu, known) == pytest.approx(whole, rel=1e-4)


def test_without_lag_noise_or_limit_the_bound_is_the_closed_form(plane):
    """E tip^2 = 2 D(p)^2 exp(2 p late) / p^3 of the page, half a period late as a held command is; within 3 %."""
    free = dataclasses.replace(plane, lag=1e-4, torque=1e9, height=0.0)
    p, time = np.sqrt(G / plane.lever), LENGTH / SPEED
    answer = lambda s: (1.0 + np.sqrt(3.0) * time * s) / (1.0 + time * s) ** 2  # noqa: E731
    variance = quad(lambda w: abs(answer(1j * w)) ** 2 / np.pi, 0.0, np.inf)[0]
    share = DEVIATION * answer(p) / np.sqrt(variance)
    closed = np.sqrt(2.0 * share**2 * np.exp(2.0 * p * 0.5 * DT) / p**3)
    assert np.sqrt(cost(free, SPEED, DEVIATION, 1e-12, "all")) == pytest.approx(closed, rel=0.03)


def test_no_regulator_within_the_torque_is_below_the_bound(plane):
    """Also one for another wind, and the bound is met by the best to 2 %."""
    for known in ("heard", "measured"):
        bound = least(plane, SPEED, DEVIATION, known)
        found = [errors(plane, SPEED, DEVIATION, mu, known) for mu in np.logspace(-9.0, -5.0, 17)]
        within = [tip for tip, effort in found if effort <= 1.0]
        assert bound <= min(within) * (1.0 + 1e-6)
        assert min(within) <= 1.02 * bound


def test_knowing_less_and_a_weaker_torque_cost(plane):
    known = [least(plane, SPEED, DEVIATION, each) for each in ("all", "heard", "measured")]
    assert known[0] < known[1] < known[2]
    weak = dataclasses.replace(plane, torque=0.3 * plane.torque)
    assert least(weak, SPEED, DEVIATION, "heard") > 1.02 * known[1]
    # of twice the force with twice the torque and without noise all is twice as large
    strong = dataclasses.replace(plane, torque=2.0 * plane.torque)
    assert least(strong, SPEED, 2.0 * DEVIATION, "all") == pytest.approx(2.0 * known[0], rel=2e-2)


@pytest.mark.parametrize(("mu", "late"), [(3e-8, 1), (3e-8, 3), (1e-5, 2), (1e-5, 3), (1e-5, 6)])
def test_late_commands_are_borne_as_a_queue_of_them_is(plane, mu, late):
    """A loop without noise comes to rest within 8 s, or grows, as its eigenvalues say."""
    tips, _ = drawn_flight(plane, mu, "heard", late=late, lanes=1, seconds=8.0, gusts=0.0)
    calm = np.abs(tips[-100:]).max() < 0.1 * np.abs(tips[:200]).max()
    stable = np.abs(np.linalg.eigvals(closed_loop(plane, SPEED, DEVIATION, mu, "heard", late)[0])).max() < 1.0
    assert calm == stable == bears(plane, SPEED, DEVIATION, mu, "heard", late)


def test_the_plane_is_that_of_the_vehicle(plane):
    """Table 1's rotors: 0.17 m, 8.54858e-6 N s^2, 838 rad/s, 12.5 ms; masses summed by hand in the vehicle's file."""
    assert plane.torque == pytest.approx(0.17 * 8.54858e-6 * 838.0**2)
    assert (plane.lag, plane.mass) == (0.0125, pytest.approx(0.82103))
    assert plane.lever + plane.height == pytest.approx(0.3, abs=1e-9)
