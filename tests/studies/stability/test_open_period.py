"""Where an open period is differentiated: the command that acts, the one after it, and
what the law is shown.
"""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from skyarm.algebra import Vec3
from skyarm.studies.stability.open_loop import open_point

READINGS = ("oldest", "newer", "newest")
LATE, AT_ONCE = SimpleNamespace(waiting=READINGS), SimpleNamespace(waiting=())


def loop(**agent):
    return SimpleNamespace(agent=SimpleNamespace(**agent))


@pytest.mark.parametrize(
    ("queue", "old", "new"),
    [
        (("now",), "now", "now"),
        (("now", "next"), "now", "next"),
        (("now", "next", "later", "last"), "now", "next"),
    ],
)
def test_the_first_command_of_the_queue_acts_and_the_second_follows_it(queue, old, new):
    point = open_point(
        loop(queue=queue, sensors=(LATE,), state="state", memory="memory", drives=())
    )
    assert (point.old, point.new, point.state, point.memory) == (
        old,
        new,
        "state",
        "memory",
    )


def test_the_law_is_shown_the_oldest_measurement_on_its_way_or_else_the_state_itself():
    late = loop(
        queue=("now",), sensors=(LATE,), state="state", memory="memory", drives=()
    )
    assert open_point(late).seen == "oldest"


def test_without_a_delay_the_law_is_shown_the_state_at_rest_in_its_accelerometer():
    from skyarm.scenario.scenario_file import load_scenario
    from skyarm.scenario.scenario_record import first_state

    state = first_state(load_scenario("case1"))
    seen = open_point(
        loop(queue=("now",), sensors=(AT_ONCE,), state=state, memory=(), drives=())
    ).seen
    assert (seen.position, seen.quaternion, seen.rate) == (
        state.position,
        state.quaternion,
        state.rate,
    )
    assert [*seen.specific_force] == [*Vec3(0.0, 0.0, 0.0)]
