"""The linearised loop against the flight itself: finite differences of episodes, growth
of real flights, SciPy.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from scipy import optimize
from scipy.spatial.transform import Rotation

import skyarm
from skyarm.algebra import Quaternion, Vec3
from skyarm.control.catalogue import make_controller
from skyarm.control.model import Model
from skyarm.plant.interface import Truth
from skyarm.records.leaves import leaves, rebuild
from skyarm.reference import hover
from skyarm.simulate import Delays, run
from skyarm.simulate.first_state import first_loop_state
from skyarm.simulate.inputs import episode_inputs
from skyarm.simulate.loop_state import InputRow
from skyarm.simulate.program import PeriodRow, TracedPeriod
from skyarm.simulate.stages import Stages
from skyarm.studies.stability import margins
from skyarm.studies.stability.closed_loop import closed_loop, radius
from skyarm.studies.stability.flight_margins import evidence, hovering
from skyarm.studies.stability.frozen_scenario import with_lag
from skyarm.studies.stability.open_loop import Differentiator, open_point
from support.engines import slopes
from support.flights import fly


def even(scenario):
    """One time constant of the rotors up and down, so that the loop is smooth in
    hover.
    """
    return with_lag(scenario, 0.0)


@pytest.fixture(scope="module")
def rotors_hover():
    """RotorS's own vehicle and controller in hover."""
    vehicle = skyarm.load_vehicle("hummingbird")
    base = skyarm.load_scenario("case1", duration=0.01)
    scenario = dataclasses.replace(
        base,
        plant=Truth(vehicle=vehicle, gravity=9.81),
        controller=make_controller("rotors_sim_position", Model(vehicle=vehicle)),
        reference=hover(Vec3(0.0, 0.0, 2.0)),
        ground=False,
    )
    return even(scenario)


def turned(q, v):
    """q times a rotation by v, by SciPy."""
    w, x, y, z = (float(c) for c in q)
    x, y, z, w = (Rotation.from_quat([x, y, z, w]) * Rotation.from_rotvec(v)).as_quat()
    return Quaternion(w, x, y, z)


def moved(state, direction, step):
    """A state moved along one of its coordinates; the attitude by a rotation vector."""
    d = np.zeros(12 + 2 * len(state.joints) + len(state.rotor_speeds))
    d[direction] = step
    n = len(state.joints)
    return dataclasses.replace(
        state,
        position=Vec3(
            *(float(a) + b for a, b in zip(state.position, d[0:3], strict=True))
        ),
        quaternion=turned(state.quaternion, d[3:6]),
        velocity=Vec3(
            *(float(a) + b for a, b in zip(state.velocity, d[6:9], strict=True))
        ),
        rate=Vec3(*(float(a) + b for a, b in zip(state.rate, d[9:12], strict=True))),
        joints=tuple(a + b for a, b in zip(state.joints, d[12 : 12 + n], strict=True)),
        joint_rates=tuple(
            a + b
            for a, b in zip(state.joint_rates, d[12 + n : 12 + 2 * n], strict=True)
        ),
        rotor_speeds=tuple(
            a + b for a, b in zip(state.rotor_speeds, d[12 + 2 * n :], strict=True)
        ),
    )


def rotation(q):
    """SciPy's rotation of a quaternion w, x, y, z."""
    w, x, y, z = q
    return Rotation.from_quat([x, y, z, w])


def coordinates(log, k, still):
    """State at an instant, the attitude as SciPy's rotation vector from that of a
    flight beside it.
    """
    turn = (
        rotation(still.quaternion[k]).inv() * rotation(log.quaternion[k])
    ).as_rotvec()
    parts = (
        log.position[k],
        turn,
        log.velocity[k],
        log.rate[k],
        log.joints[k],
        log.joint_rates[k],
        log.rotor_speeds[k],
    )
    return np.concatenate(parts)


@pytest.mark.parametrize(
    "turn", [(0.0, 0.0, 0.0), (0.3, -0.2, 0.9)], ids=["level", "tilted"]
)
def test_eigenvalues_are_those_of_finite_differences_of_episodes(rotors_hover, turn):
    start = first_loop_state(rotors_hover).agent.state
    start = dataclasses.replace(
        start,
        quaternion=turned(start.quaternion, turn),
        rate=Vec3(0.2, -0.1, 0.3 * turn[0]),
    )
    flight = dataclasses.replace(rotors_hover, initial=start)
    carry, still = first_loop_state(flight), run(flight)
    step, columns = 1e-5, []
    for i in range(12 + len(start.rotor_speeds)):
        logs = [
            run(dataclasses.replace(rotors_hover, initial=moved(start, i, side * step)))
            for side in (1.0, -1.0)
        ]
        columns.append(
            (coordinates(logs[0], 1, still) - coordinates(logs[1], 1, still))
            / (2.0 * step)
        )
    J = np.array(columns).T
    row = [0.0, *episode_inputs(rotors_hover).held_leaves[0]]
    ours = closed_loop(Differentiator(rotors_hover).at(carry, row, "up"))
    # differences of episodes are of second order: 1e-10 relative, on numbers up to 1e3
    np.testing.assert_allclose(ours, J, atol=1e-5)
    np.testing.assert_allclose(
        np.sort(np.abs(np.linalg.eigvals(ours))),
        np.sort(np.abs(np.linalg.eigvals(J))),
        atol=1e-6,
    )


@pytest.fixture(scope="module")
def arm_hover():
    return even(
        dataclasses.replace(hovering(skyarm.load_scenario("case1")), ground=False)
    )


def growth(scenario, delay, **parts):
    """How much a small tilt grows in a real flight with a further command delay: late
    over early motion.
    """
    state = first_loop_state(scenario).agent.state
    begun = dataclasses.replace(
        scenario,
        initial=moved(state, 4, 1e-4),
        duration=8.0,
        delays=Delays(command=delay, **parts),
    )
    still = dataclasses.replace(begun, initial=state)
    rows = [fly(each).rows[:, 1:] for each in (begun, still)]
    size = np.linalg.norm((rows[0] - rows[1])[:, 10:13], axis=1)
    return size[-300:].max() / size[600:900].max()


def test_flights_grow_beyond_the_delay_margin_and_settle_below(arm_hover):
    carry = first_loop_state(arm_hover)
    loop = Differentiator(arm_hover).at(
        carry, [0.0, *episode_inputs(arm_hover).held_leaves[0]], "up"
    )
    edge = 1e3 * margins(loop).delay
    assert 20.0 < edge < 50.0
    assert growth(arm_hover, (math.floor(edge) - 2) * 1e-3) < 0.9
    assert growth(arm_hover, (math.ceil(edge) + 2) * 1e-3) > 1.1


def test_a_flight_grows_at_the_rate_of_the_largest_eigenvalue(arm_hover):
    carry = first_loop_state(arm_hover)
    loop = Differentiator(arm_hover).at(
        carry, [0.0, *episode_inputs(arm_hover).held_leaves[0]], "up"
    )
    delay = (math.ceil(1e3 * margins(loop).delay) + 4) * 1e-3
    rate = math.log(radius(loop, extra_delay=delay)) * 200.0
    # between the middles of the two windows; the envelope of an oscillation, not its
    # phase
    assert math.log(growth(arm_hover, delay)) / (700.0 / 200.0) == pytest.approx(
        rate, rel=0.25
    )


def test_the_jacobians_are_those_that_scipy_finds(arm_hover):
    found = Differentiator(arm_hover)
    carry, held = first_loop_state(arm_hover), episode_inputs(arm_hover)
    point = dataclasses.replace(open_point(carry))
    row = InputRow(time=0.0, reference=held.reference_example)
    # a tilted, moving point: at exact hover a norm's root has no derivative
    state = point.state
    for direction in (0, 3, 4, 6, 9, 12, 15):
        state = moved(state, direction, 0.02)
    seen = dataclasses.replace(
        point.seen,
        position=state.position,
        quaternion=state.quaternion,
        velocity=state.velocity,
        rate=state.rate,
    )
    point = dataclasses.replace(point, state=state, seen=seen)
    values_row = [0.0, *held.held_leaves[0]]
    moving = carry.with_agent(dataclasses.replace(carry.agent, state=state))
    begun = open_point(moving)
    sizes = [
        len(leaves(part))
        for part in (begun.state, begun.old, begun.new, begun.memory, begun.seen)
    ]
    # where ours is taken: at the measurement and the command that the period itself
    # makes
    base = found._complete(moving, begun, sizes, values_row, (0.0,))
    fed = rebuild(row, iter(values_row))
    given = ((0.002, 0.0), ())
    period = TracedPeriod(
        Stages(found._scenario_of(given)),
        found._program.plant,
        given,
        PeriodRow(given=(fed,)),
        (),
    )
    J = slopes(
        lambda *at: found._open_period(period, rebuild(point, iter(at)))[1], base
    )
    loop = Differentiator.at(found, moving, [0.0, *held.held_leaves[0]], "up")
    nx, nu = 13 + 4 + 4, 6
    # all but the quaternion, which moves by rotation vectors in ours
    numbers = [0, 1, 2, *range(7, nx)]
    late = list(loop.lates).index(0.002)
    ours = np.delete(np.delete(loop.x_x[late], [3, 4, 5], axis=0), [3, 4, 5], axis=1)
    np.testing.assert_allclose(ours, J[np.ix_(numbers, numbers)], atol=1e-7)
    np.testing.assert_allclose(
        np.delete(loop.x_new[late], [3, 4, 5], axis=0),
        J[np.ix_(numbers, range(nx + nu, nx + 2 * nu))],
        atol=1e-7,
    )
    np.testing.assert_allclose(
        np.delete(loop.x_old[late], [3, 4, 5], axis=0),
        J[np.ix_(numbers, range(nx, nx + nu))],
        atol=1e-7,
    )


def test_evidence_along_a_flight_is_stable_and_says_where():
    found = evidence(skyarm.load_scenario("case3", duration=8.0), 2)
    assert found.completed
    assert [(each.hover, each.time) for each in found.instants] == [
        (True, 4.995),
        (False, 4.0),
        (False, 7.995),
    ]
    for each in found.instants:
        assert set(each.by_lag) == {"up", "down"}
        assert each.radius < 1.0
        assert 0.02 < each.delay < 0.06
        low, high = each.gain("rotor_gain")
        assert low < 1.0 < high
    # the outer loop of RotorS: s^2 + 2.2/m s + 4/m, m = 0.806 kg: -1.36 +- 1.76 i
    slow = optimize.linear_sum_assignment(
        np.abs(np.array([[-1.365 + 1.76j]]) - found.instants[0].by_lag["up"].s[None])
    )
    assert abs(found.instants[0].by_lag["up"].s[slow[1][0]] - (-1.365 + 1.76j)) < 0.1


def test_a_flight_that_ends_early_is_said_to():
    scenario = skyarm.load_scenario("case1", duration=6.0)
    state = dataclasses.replace(
        first_loop_state(scenario).agent.state,
        position=Vec3(0.0, 0.0, 0.2),
        velocity=Vec3(0.0, 0.0, -9.0),
    )
    found = evidence(dataclasses.replace(scenario, initial=state), 2)
    assert not found.completed
    assert [each.hover for each in found.instants] == [True]
