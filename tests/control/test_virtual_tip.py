"""The virtual tip against the exact response of its differential equation, and the
energy that it takes.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from skyarm.algebra import Vec3
from skyarm.control.laws.centroidal.contact.admittance import (
    Compliance,
    VirtualBody,
    move,
)

DT = 0.005


def pushed(gains, forces):
    """Offsets, velocities and accelerations of a sequence of forces, (n, 3, 3)."""
    memory, rows = VirtualBody(), []
    for force in forces:
        memory, offset = move(gains, memory, Vec3(*force), DT)
        rows.append([[*each] for each in offset])
    return np.array(rows, dtype=float)


def exact(M, D, K, f, t):
    """Place and velocity at rest from 0 under a constant force: the matrix
    exponential.
    """
    A = np.array([[0.0, 1.0, 0.0], [-K / M, -D / M, 1.0 / M], [0.0, 0.0, 0.0]])
    return (expm(A * t) @ [0.0, 0.0, f])[:2]


@pytest.mark.parametrize(
    ("M", "D", "K"),
    [(1.0, 6.0, 9.0), (0.5, 2.0, 40.0), (2.0, 4.0, 0.0), (0.02, 1.0, 50.0)],
)
def test_a_force_moves_it_as_mass_damper_and_spring(M, D, K):
    gains = Compliance(inertia=(M,) * 3, damping=(D,) * 3, stiffness=(K,) * 3, lead=0.0)
    found = pushed(gains, [(1.5, 0.0, -0.5)] * 300)
    scale = abs(exact(M, D, K, 1.5, 1.5)[0])
    # from a time constant of the fastest mode on: a rule of second order at 50 1/s
    for i in (40, 99, 299):  # a rule of second order, whose fastest mode is 50 1/s here
        place, velocity = exact(M, D, K, 1.5, (i + 1) * DT)
        assert found[i, 0, 0] == pytest.approx(place, abs=2e-3 * scale)
        assert found[i, 1, 0] == pytest.approx(velocity, abs=1e-2 * scale)
        assert found[i, 2, 0] == pytest.approx(
            (1.5 - D * velocity - K * place) / M, rel=0.06, abs=0.02 * scale / DT**0.5
        )
        assert found[i, :, 2] == pytest.approx(-found[i, :, 0] / 3.0)
        assert not found[i, :, 1].any()


@pytest.mark.parametrize("K", [0.0, 9.0])
def test_the_lead_makes_up_for_a_force_that_is_heard_late(K):
    late = 0.06
    ahead = Compliance(
        inertia=(1.0,) * 3, damping=(6.0,) * 3, stiffness=(K,) * 3, lead=late
    )
    heard = [
        (2.0 * (1.0 - np.exp(-(i + 0.5) * DT / late)), 0.0, 0.0) for i in range(200)
    ]
    rows = pushed(ahead, heard)
    found = rows[:, 0, 0]
    force = np.array(heard)[:, 0]
    assert rows[:, 2, 0] == pytest.approx(
        force - 6.0 * rows[:, 1, 0] - K * found, rel=1e-9
    ), "the equation itself"
    wanted = [exact(1.0, 6.0, K, 2.0, (i + 1) * DT)[0] for i in range(200)]
    assert found == pytest.approx(wanted, abs=1e-3 * wanted[-1] + 1e-4)


def test_an_axis_without_mass_is_held_and_axes_turn_with_the_normal():
    n, a, b = Vec3(-0.6, 0.8, 0.0), Vec3(0.8, 0.6, 0.0), Vec3(0.0, 0.0, 1.0)
    gains = Compliance(
        inertia=(1.0, 0, 2.0),
        damping=(6.0, 0, 1.0),
        stiffness=(9.0, 0, 3.0),
        lead=0.02,
        axes=(n, a, b),
    )
    plain = Compliance(
        inertia=(1.0, 0, 2.0), damping=(6.0, 0, 1.0), stiffness=(9.0, 0, 3.0), lead=0.02
    )
    forces = np.random.default_rng(0).normal(size=(50, 3))
    axes = np.array([[*each] for each in (n, a, b)])
    found, along = pushed(gains, forces), pushed(plain, forces @ axes.T)
    assert not along[:, :, 1].any()
    assert np.allclose(found, along @ axes)
    assert np.abs(along[:, 0, 0]).max() > 1e-3


def test_it_gives_back_no_more_energy_than_it_was_given():
    """The rule is that of a passive body: work by the mean velocity is kinetic, elastic
    and lost energy.
    """
    M, D, K = 0.5, 1.0, 30.0
    gains = Compliance(inertia=(M,) * 3, damping=(D,) * 3, stiffness=(K,) * 3, lead=0.0)
    forces = np.zeros((400, 3))
    forces[:200] = np.random.default_rng(1).normal(size=(200, 3)).cumsum(axis=0) * 0.1
    found = pushed(gains, forces)
    v = np.concatenate([np.zeros((1, 3)), found[:, 1]])
    mean = 0.5 * (v[1:] + v[:-1])
    work = (forces * mean).sum(axis=1).cumsum() * DT
    lost = (D * mean**2).sum(axis=1).cumsum() * DT
    held = 0.5 * M * (found[:, 1] ** 2).sum(axis=1) + 0.5 * K * (found[:, 0] ** 2).sum(
        axis=1
    )
    assert work == pytest.approx(lost + held, rel=1e-9, abs=1e-12)
    assert work[-1] > 1e-3


@pytest.mark.parametrize(
    ("M", "D", "K"),
    [(0.01, 0.5, 0.0), (0.02, 0.0, 50.0), (0.1, 5.0, 250.0), (1.0, 6.0, 9.0)],
)
def test_a_light_body_starts_no_faster_than_it_can_go_at_any_delay_of_the_force(
    M, D, K
):
    """A body that damper or spring stop within the lag has not gathered all of the
    impulse, one of 1 kg has.
    """
    late, force = 0.06, -1.5
    gains = Compliance(
        inertia=(M,) * 3, damping=(D,) * 3, stiffness=(K,) * 3, lead=late
    )
    first = pushed(gains, [(force, 0.0, 0.0)])[0, 1, 0]
    terminal = [abs(force) / D] if D else []
    swing = [abs(force) / (K * M) ** 0.5] if K else []
    own = min([late * abs(force) / M, *terminal, *swing])
    # what one period takes and adds
    assert 0.75 * own < -first < own + DT * abs(force) / M
