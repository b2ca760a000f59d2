"""The drawing of a control period has the stages of the loop in their order, and its
page names them.
"""

from __future__ import annotations

import inspect
import re

import flight_drawing

import skyarm
from skyarm.simulate import period
from skyarm.simulate.stages import AgentStages, Stages

PAGE = flight_drawing.DRAWING.parents[1] / "how_a_flight_works.md"
NAMES = [stage.name for stage in flight_drawing.STAGES]


def test_the_drawing_is_that_of_its_script() -> None:
    assert flight_drawing.DRAWING.read_text("utf-8") == flight_drawing.drawing(), (
        "run python tests/website/flight_drawing.py"
    )


def test_the_hooks_are_functions_of_the_classes_beside_them() -> None:
    drawn, drawing = flight_drawing.HOOKS_DRAWING, flight_drawing.hooks_drawing()
    assert drawn.read_text("utf-8") == drawing, "run tests/website/flight_drawing.py"
    assert list(flight_drawing.HOOKS) == NAMES
    for function, owners in (
        *flight_drawing.TEST[2],
        *(each for hooks in flight_drawing.HOOKS.values() for each in hooks),
    ):
        for owner in owners.split(", "):
            place = skyarm if hasattr(skyarm, owner) else skyarm.reference
            assert function in dir(getattr(place, owner)), f"{owner}.{function}"


def test_the_stages_are_those_of_a_period_in_their_order() -> None:
    source = "".join(
        inspect.getsource(each) for each in (period.measure, period.decide, period.act)
    )
    called = re.findall(r"(?:stages|each|plant)\.(\w+)\(", source)
    assert [name for name in called if name in NAMES] == NAMES
    assert callable(getattr(Stages, NAMES[0]))
    assert all(callable(getattr(AgentStages, name)) for name in NAMES[1:-1])


def test_the_page_explains_every_stage_in_its_order() -> None:
    assert re.findall(r"^\| `(\w+)` \|", PAGE.read_text("utf-8"), re.M) == NAMES


def test_the_drawing_fits_a_phone_and_nothing_leaves_it() -> None:
    text = flight_drawing.drawing() + flight_drawing.hooks_drawing()
    assert flight_drawing.WIDTH <= 390
    for x, width in re.findall(r'<rect x="([\d.]+)" y="[\d.]+" width="([\d.]+)"', text):
        assert float(x) + float(width) <= flight_drawing.WIDTH
