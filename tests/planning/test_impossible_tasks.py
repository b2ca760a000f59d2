"""Tasks that no motion fulfils: the error names the phase and what is beyond its
limit.
"""

from __future__ import annotations

from typing import Any

import pytest

from skyarm.planning.planner import PlanError, plan
from skyarm.planning.task import task_from
from support.plans import box, reach

AT_ONCE: dict[str, tuple[dict[str, Any], str]] = {
    "too heavy": (
        {"gravity": 50.0},
        (
            "phases[2] 'away': to.rest: hovering takes 128.1 N, limits.thrust_share"
            " leaves 111.8 N"
        ),
    ),
    "too little thrust": (
        {"limits": {"thrust_share": 0.15}},
        (
            "phases[2] 'away': to.rest: hovering takes 25.12 N, limits.thrust_share"
            " leaves 18.63 N"
        ),
    ),
    "joint goal": (
        {"phases__2__to__joints": [0.0, -2.0, 0.0]},
        "phases[2] 'away': to.joints: elbow = -2 is beyond its range, -1.671 to 1.671",
    ),
    "joint at the start": (
        {"start__joints": [2.0, 0.0, 0.0]},
        "start.joints: shoulder = 2 is beyond its range, -1.671 to 1.671",
    ),
    "tilt goal": (
        {"phases__2__to": {"base": [2.0, 0.0, 1.5], "attitude": [1.4, 0.0, 0.0]}},
        "phases[2] 'away': to.attitude: is tilted by 1.4 rad, limits.tilt is 1.047",
    ),
    "tilt at the start": (
        {"start__attitude": [0.0, -0.9, 2.0], "limits": {"tilt": 0.8}},
        "start.attitude: is tilted by 0.9 rad, limits.tilt is 0.8",
    ),
    "tilt goal of its phase": (
        {
            "phases__2__to": {"base": [2.0, 0.0, 1.5], "attitude": [0.5, 0.0, 0.0]},
            "phases__2__tilt": 0.4,
        },
        "phases[2] 'away': to.attitude: is tilted by 0.5 rad, phases[2].tilt is 0.4",
    ),
    "tilt at the start of a phase": (
        {"start__attitude": [0.0, -0.9, 2.0], "phases__0__tilt": 0.7},
        "start.attitude: is tilted by 0.9 rad, phases[0].tilt is 0.7",
    ),
    "a start that nothing holds": (
        {"start__attitude": [0.0, 0.3, 2.0]},
        (
            "start.attitude = [0.0, 0.3, 2.0]: must have roll and pitch 0, for nothing"
            " holds it; a first phase in contact, 'point' or 'bar', would"
        ),
    ),
    "a goal off the plane": (
        {
            "phases__1": {
                "kind": "contact",
                "contact": {"kind": "plane"},
                "duration": 0.2,
            },
            "phases__1__to": {"tip": [1.2, 0.0, 0.98]},
        },
        "phases[1] '': to.tip: is -0.02 m off the plane on which the tip begins",
    ),
    "speed goal": (
        {"phases__2__to": {"velocity": [3.0, 0.0, 4.0]}, "limits": {"speed": 2.0}},
        "phases[2] 'away': to.velocity: is 5 m/s, limits.speed is 2",
    ),
    "tip goal inside an obstacle": (
        {"obstacles": [box([1.0, 0.0, 1.0], [0.4, 0.6, 0.8], name="wall")]},
        "phases[0] 'approach': to.tip: is -0.2 m from wall, at least 0.05 m are needed",
    ),
    "tip goal too near to an obstacle": (
        {"obstacles": [box([1.0, 0.0, 0.7], [0.4, 0.6, 0.54], name="wall")]},
        "phases[0] 'approach': to.tip: is 0.03 m from wall, at least 0.05 m are needed",
    ),
    "base goal inside an obstacle": (
        {"obstacles": [box([2.0, 0.0, 1.5], [0.5, 0.6, 0.8])]},
        "phases[2] 'away': to.base: is -0.25 m from obstacle0, at least 0 m are needed",
    ),
    "start inside an obstacle": (
        {"obstacles": [box([0.0, 0.0, 0.4], [0.1, 0.1, 0.7])]},
        "start: link/link_2/wrist and obstacle0 overlap by ",
    ),
}
"""What start and goals alone say."""


@pytest.mark.parametrize("name", AT_ONCE)
def test_a_goal_beyond_its_limit_is_refused_without_a_search(name: str) -> None:
    changes, message = AT_ONCE[name]
    with pytest.raises(PlanError) as refused:
        plan(task_from(reach(**changes)), seconds=0.0)
    assert str(refused.value).startswith(f"reach: {message}")
    assert "\n" not in str(refused.value)


SEARCHED: dict[str, tuple[dict[str, Any], str, str]] = {
    "too far in the time": (
        {"phases__0__to__tip": [10.0, 0.0, 1.0]},
        "phases[0] 'approach'",
        "tip is off by",
    ),
    "back too soon": (
        {"phases__2__duration": 0.3},
        "phases[2] 'away'",
        "base is off by",
    ),
    "too slow": ({"limits": {"speed": 0.2}}, "phases[", "is off by"),
    "a wall": (
        {"obstacles": [box([1.7, 0.0, 1.0], [0.1, 60.0, 60.0], name="wall")]},
        "phases[2] 'away'",
        "wall",
    ),
    "tip and base apart": (
        {"phases__0__to__base": [3.0, 0.0, 1.0]},
        "phases[0] 'approach'",
        "is off by",
    ),
    "a tip that rests and moves": (
        {"phases__1__to": {"base": [5.0, 0.0, 1.0]}},
        "phases[1] 'grasp'",
        "is off by",
    ),
    "at rest but tilted": (
        {
            "phases__2__to": {
                "base": [2.0, 0.0, 1.5],
                "attitude": [0.5, 0.0, 0.0],
                "rest": True,
            }
        },
        "phases[2] 'away'",
        "is off by",
    ),
}
"""What the search says: the phase, and words of the constraint."""


@pytest.mark.thorough
@pytest.mark.parametrize("name", SEARCHED)
def test_the_constraint_that_is_farthest_off_is_named_with_its_phase(name: str) -> None:
    changes, phase, words = SEARCHED[name]
    with pytest.raises(PlanError) as refused:
        plan(task_from(reach(**changes)))
    text = str(refused.value)
    assert text.startswith(f"reach: {phase}")
    assert words in text
    assert "no motion within the limits was found" in text
    assert "\n" not in text


def test_a_search_beyond_its_emergency_end_gives_no_plan_and_says_so() -> None:
    words = (
        r"^reach: no plan within 0\.001 s, seed 1: iteration 20, violation \S+: take"
        r" more time, or a larger step$"
    )
    with pytest.raises(PlanError, match=words):
        plan(task_from(reach()), seconds=0.001)
