"""Disk margins: published loops, and brute force by eigenvalues of the loop with
complex factors in it.
"""

from __future__ import annotations

import dataclasses
import itertools
import math

import numpy as np
import pytest
from hand_made import coupled, double_integrator, numbered_channels
from scipy import linalg, optimize

from skyarm.studies.stability import margins
from skyarm.studies.stability.closed_loop import OpenLoop, close_loop, gains
from skyarm.studies.stability.disk_margins import frequency_grid, upper_bound

T = 1e-3
"""s, of loops that are continuous in the books: the hold costs half a period."""


def sampled(A, B, C, K, period=T):
    """A loop of the books, u = -K C x, sampled with a hold."""
    n, m = B.shape
    whole = linalg.expm(np.block([[A, B], [np.zeros((m, n + m))]]) * period)
    none = np.zeros((0, 0))
    return OpenLoop(
        period=period,
        rotors=m,
        lates=np.zeros(1),
        x_x=whole[None, :n, :n],
        x_old=np.zeros((1, n, m)),
        x_new=whole[None, :n, n:],
        y_x=C,
        y_old=np.zeros((len(C), m)),
        m_m=none,
        m_y=np.zeros((0, len(C))),
        u_m=np.zeros((m, 0)),
        u_y=-K,
        channels=numbered_channels(m, 0, len(C)),
    )


def named(found, name):
    return next(each for each in (*found.loops, *found.together) if each.name == name)


def test_the_third_order_loop_of_the_books_has_its_published_disk_margin():
    # L = 25 / (s^3 + 10 s^2 + 10 s + 10), of the manual of MATLAB's diskmargin: 0.4581
    # at 1.9412 rad/s, gain 0.6273 to 1.5942, phase 25.80 degrees
    A = np.array([[-10.0, -10.0, -10.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    loop = sampled(
        A, np.array([[1.0], [0.0], [0.0]]), np.array([[0.0, 0.0, 25.0]]), np.eye(1)
    )
    for name in ("rotor 1", "measurement 1"):
        found = named(margins(loop), name)
        # half a millisecond of hold at 1.94 rad/s is 0.001 of phase
        assert found.disk == pytest.approx(0.4581, abs=1.5e-3)
        assert found.frequency == pytest.approx(1.9412, rel=2e-2)
        assert found.gain == pytest.approx((0.6273, 1.5942), abs=2e-3)
        assert math.degrees(found.phase) == pytest.approx(25.80, abs=0.1)


def test_the_spinning_body_bears_everything_in_one_loop_and_little_in_both():
    # Zhou, Doyle, Glover 1996, section 9.6: each loop alone is 1 / s; T = [1 a; -a 1] /
    # (s + 1) is normal, so that the structured singular value of I / 2 - T is the
    # magnitude of its eigenvalues
    a = 10.0
    w = np.linspace(0.0, 1.0, 10001)
    both = (
        1.0 / np.abs(0.5 - (1.0 + 1j * a) / (1.0 + 1j * np.concatenate([-w, w]))).max()
    )
    A, C = np.array([[0.0, a], [-a, 0.0]]), np.array([[1.0, a], [-a, 1.0]])
    found = margins(sampled(A, np.eye(2), C, np.eye(2), 2e-3))
    for name in ("rotor 1", "rotor 2", "measurement 1"):
        # half a period of hold at all frequencies up to Nyquist's
        assert named(found, name).disk == pytest.approx(2.0, abs=0.05)
        assert named(found, name).gain[0] < 0.01
    for name in ("rotors", "measured"):
        assert named(found, name).disk == pytest.approx(both, rel=4e-3)


def radius_under(loop, channels, factors):
    """Spectral radius with a complex factor on each of some channels, all of one
    port.
    """
    found = close_loop(loop)
    A = found.matrix(gains(loop)).astype(complex)
    commands = channels[0].port == "commands"
    B = found.enters if commands else found.shown + found.enters @ found.answered
    C = found.sent if commands else found.seen
    for channel, factor in zip(channels, factors, strict=True):
        A += (factor - 1.0) * np.outer(B @ channel.enters, channel.reads @ C)
    return np.abs(np.linalg.eigvals(A)).max()


def factor(d):
    """The complex factor of a disk's number d."""
    return (1.0 + 0.5 * d) / (1.0 - 0.5 * d)


CHANNELS = {each.name: each for each in numbered_channels(2, 1, 6)}


@pytest.mark.parametrize(
    "name", ["rotor 1", "joint 1", "measurement 1", "measurement 4"]
)
def test_a_loop_bears_every_factor_of_its_disk_and_not_all_of_a_larger_one(name):
    loop = coupled()
    disk = named(margins(loop), name).disk
    assert 0.05 < disk < 1.9
    angles = np.linspace(0.0, 2.0 * np.pi, 91)
    worst = [
        max(
            radius_under(loop, [CHANNELS[name]], [factor(size * disk * np.exp(1j * a))])
            for a in angles
        )
        for size in (0.99, 1.01)
    ]
    assert worst[0] < 1.0 < worst[1]


@pytest.mark.parametrize(("group", "count"), [("all commands", 3), ("rotors", 2)])
def test_several_loops_bear_every_factor_of_their_disk_and_not_all_of_a_larger_one(
    group, count
):
    loop = coupled()
    disk = named(margins(loop), group).disk
    chosen = list(CHANNELS.values())[:count]

    def least(size, angles):
        return -radius_under(
            loop, chosen, [factor(size * disk * np.exp(1j * a)) for a in angles]
        )

    starts = [
        np.array(a) for a in itertools.product(np.arange(0.0, 6.0, 1.5), repeat=count)
    ]
    inside = max(-least(0.99, angles) for angles in starts)
    assert inside < 1.0
    best = sorted(starts, key=lambda angles: least(1.02, angles))[:3]
    found = [
        optimize.minimize(lambda a: least(1.02, a), angles, method="Nelder-Mead").fun
        for angles in best
    ]
    # up to three channels the bound is the structured singular value itself
    assert -min(found) > 1.0


def test_the_bound_is_the_structured_singular_value_of_up_to_three_numbers():
    rng = np.random.default_rng(8)
    for n in (1, 2, 3):
        M = rng.normal(size=(4, n, n)) + 1j * rng.normal(size=(4, n, n))
        angles = np.array(
            list(
                itertools.product(
                    np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False), repeat=n - 1
                )
            )
        )
        turned = np.exp(
            1j
            * np.column_stack(
                [np.zeros(len(angles)), angles.reshape(len(angles), n - 1)]
            )
        )
        for one in M:
            wanted = np.abs(np.linalg.eigvals(turned[:, :, None] * one)).max()
            # the grid of angles, 6 degrees wide, misses the largest by less than 2 in a
            # thousand
            assert wanted * 0.9999 <= upper_bound(one[None])[0] <= wanted * 1.002
            # scaled as badly as radians per newton metre are
            d = np.array([1.0, 1e6, 1e-5])[:n]
            assert upper_bound((d[:, None] * one / d)[None])[0] == pytest.approx(
                upper_bound(one[None])[0], rel=1e-3
            )


def test_loops_that_do_not_act_on_one_another_bear_together_what_the_weakest_bears():
    loop = coupled()
    alone = dataclasses.replace(
        loop,
        x_old=np.array([np.kron(np.eye(3), b) for b in double_integrator().x_old]),
        x_new=np.array([np.kron(np.eye(3), b) for b in double_integrator().x_new]),
        u_y=loop.u_y * np.array([[1.0], [0.7], [0.5]]),
    )
    found = margins(alone)
    weakest = min(each.disk for each in found.loops if each.port == "commands")
    assert 0.3 < weakest < 1.5
    assert named(found, "all commands").disk == pytest.approx(weakest, rel=2e-3)


def test_an_unstable_loop_has_no_disk():
    found = margins(dataclasses.replace(double_integrator(), command_delay=0.6))
    assert {each.disk for each in (*found.loops, *found.together)} == {0.0}


def test_the_delay_of_one_loop_is_that_of_all_where_there_is_but_one():
    found = margins(double_integrator())
    assert named(found, "rotor 1").delay == pytest.approx(found.delay, rel=2e-3)


def with_delays(loop, delays):
    """The loop with a delay (s) for each command: the commands on their way are part of
    the plant's state.
    """
    ages = [
        divmod(round(delay * len(loop.lates) / loop.period), len(loop.lates))
        for delay in delays
    ]
    states, size = (
        len(loop.x_x[0]),
        len(loop.x_x[0]) + sum(whole + 1 for whole, _ in ages),
    )
    x_x, x_new = np.zeros((1, size, size)), np.zeros((1, size, len(delays)))
    y_x, first = np.zeros((len(loop.y_x), size)), states
    x_x[0, :states, :states], y_x[:, :states] = loop.x_x[0], loop.y_x
    for c, (whole, late) in enumerate(ages):
        last = first + whole
        x_x[0, :states, first], y_x[:, first] = loop.x_old[late][:, c], loop.y_old[:, c]
        follows = x_x[0, :states, first + 1] if whole else x_new[0, :states, c]
        follows += loop.x_new[late][:, c]
        x_x[0, range(first, last), range(first + 1, last + 1)] = x_new[0, last, c] = 1.0
        first = last + 1
    changed = {
        "x_x": x_x,
        "x_old": 0.0 * x_new,
        "x_new": x_new,
        "y_x": y_x,
        "y_old": 0.0 * loop.y_old,
    }
    return dataclasses.replace(
        loop, lates=np.zeros(1), command_delay=0.0, states=0, **changed
    )


def test_the_delay_of_one_rotor_is_where_eigenvalues_leave_the_circle():
    loop = dataclasses.replace(coupled(), rotors=1)
    own, foretold = loop.command_delay, named(margins(loop), "rotor 1").delay
    assert 0.002 < foretold < 0.06
    step = loop.period / len(loop.lates)
    steps = np.arange(0.0, foretold + 10.0 * step, step)
    radii = [
        np.abs(
            np.linalg.eigvals(
                close_loop(with_delays(loop, [own + d, *[own] * 2])).matrix(np.ones(3))
            )
        ).max()
        for d in steps
    ]
    first = int(np.argmax(np.array(radii) > 1.0))
    # a hold within a period is no pure delay, and the crossing lies between two
    # frequencies of the grid
    assert foretold == pytest.approx(steps[first] - 0.5 * step, abs=step)


@pytest.mark.parametrize("size", [1e-12, 1e12])
def test_the_bound_of_a_scaled_matrix_is_the_scaled_bound(size):
    draw = np.random.default_rng(8)
    M = (draw.normal(size=(1, 4, 4)) + 1j * draw.normal(size=(1, 4, 4))) * np.array(
        [1.0, 1e3, 1e-2, 10.0]
    )
    assert upper_bound(size * M) == pytest.approx(size * upper_bound(M), rel=1e-6)


def test_the_grid_is_finer_around_the_frequency_of_a_lightly_damped_pole():
    period, pole = 0.005, -0.05 + 12.0j
    grid = frequency_grid(np.exp(np.array([pole, np.conj(pole)]) * period), period)
    for share in (-4.0, -1.0, 0.0, 1.0, 4.0):
        assert np.abs(grid - (12.0 + share * 0.05)).min() < 1e-9
