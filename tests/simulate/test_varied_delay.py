"""A batch whose episodes have delays of their own flies what single flights with those
delays fly.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from skyarm.scenario.numbers import number_at
from skyarm.scenario.paths import LATE
from skyarm.scenario.scenario_file import scenario_from
from skyarm.simulate import Delays, ScenarioError, run
from skyarm.simulate.batch import Batch
from skyarm.simulate.first_state import commands_waiting
from support.flights import circling

DELAYS = (0.0, 0.001, 0.004, 0.005, 0.007, 0.010, 0.012, 0.015)


def moving(**delays):
    """0.3 s of hover and the step on to the circle, for a second."""
    return dataclasses.replace(
        scenario_from(circling(duration=1.3)), delays=Delays(**delays)
    )


@pytest.fixture(scope="module")
def varied():
    return Batch(moving(longest_command=0.015), (LATE,), metrics=("effort",))


@pytest.fixture(scope="module")
def flown(varied):
    return varied.fly({LATE: np.array(DELAYS)})


@pytest.mark.parametrize("delay", DELAYS)
def test_each_lane_is_the_single_flight_with_its_delay(flown, delay):
    # the same steps, but for a rounding of their lengths and one of no length: 1e-9
    # after 260 periods
    log = run(moving(command=delay))
    lane = DELAYS.index(delay)
    position = np.array([component[lane] for component in flown.state.position])
    end = log.position[-1] + log.velocity[-1] * 0.005
    assert log.status == "completed"
    assert flown.status[lane] == "completed"
    # the log's last row is one period earlier
    assert np.allclose(position, end, atol=2e-4)
    before = Batch(dataclasses.replace(moving(command=delay)), ()).fly({})
    after = np.array([component[0] for component in before.state.position])
    assert np.allclose(position, after, rtol=0.0, atol=1e-9)


def test_delays_differ(flown):
    heights = flown.state.position.z
    assert len(set(np.round(heights, 12).tolist())) == len(DELAYS)


def test_a_delay_between_two_steps_lies_between_their_flights(varied):
    x = varied.fly({LATE: np.array([0.006, 0.0065, 0.007])}).state.position.x
    assert min(x[0], x[2]) < x[1] < max(x[0], x[2])


def test_a_delay_does_not_vary_unless_the_scenario_says_how_long_it_gets():
    assert number_at(moving(longest_command=0.01), LATE) == 0.0
    with pytest.raises(
        ScenarioError, match=r"path = 'delays\.command': delays is structure"
    ):
        Batch(moving(), (LATE,))


def test_a_longest_delay_is_above_zero():
    with pytest.raises(
        ScenarioError, match=r"delays\.longest_command = 0\.0: must be above 0"
    ):
        moving(longest_command=0.0)


@pytest.mark.parametrize(
    ("longest", "count"),
    [(0.004, 2), (0.005, 2), (0.0051, 3), (0.010, 3), (0.015, 4), (0.035, 8)],
)
def test_the_loop_remembers_as_many_commands_as_the_longest_delay_needs(longest, count):
    assert commands_waiting(moving(longest_command=longest)) == count


def test_a_varied_delay_of_whole_periods_has_the_bits_of_a_fixed_one():
    whole = np.array([0.0, 0.005, 0.010, 0.015])
    both = (
        Batch(moving(longest_command=0.015), (LATE,), bit_exact=True)
        .fly({LATE: whole})
        .state
    )
    for lane, delay in enumerate(whole.tolist()):
        alone = Batch(moving(command=delay), (), bit_exact=True).fly({}).state
        assert [c[lane] for c in (*both.position, *both.velocity)] == [
            c[0] for c in (*alone.position, *alone.velocity)
        ]


def test_whole_periods_that_round_below_a_whole_number_are_whole_all_the_same():
    delay = 0.145
    assert delay * 200.0 < 29.0
    assert 0.035 * 200.0 > 7.0, "and above, in the count of remembered commands"
    short = dataclasses.replace(moving(longest_command=0.15), duration=1.0)
    varied = Batch(short, (LATE,), bit_exact=True).fly({LATE: np.array([delay])}).state
    fixed = (
        Batch(
            dataclasses.replace(short, delays=Delays(command=delay)), (), bit_exact=True
        )
        .fly({})
        .state
    )
    assert [c[0] for c in (*varied.position, *varied.velocity)] == [
        c[0] for c in (*fixed.position, *fixed.velocity)
    ]


def test_a_delay_outside_its_range_is_refused_lane_by_lane():
    batch = Batch(moving(longest_command=0.01), (LATE,))
    for wrong in (-0.001, 0.011):
        with pytest.raises(
            ScenarioError,
            match=r"delays\.command.*must be from 0 to delays\.longest_command",
        ):
            batch.fly({LATE: np.array([0.005, wrong])})
    with pytest.raises(ScenarioError, match="must be there exactly if it is a path"):
        batch.fly({})


def test_a_delay_that_would_fill_the_memory_is_refused():
    with pytest.raises(ScenarioError, match="at most 100 control periods"):
        run(moving(longest_command=1.0))
