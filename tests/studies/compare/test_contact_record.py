"""What counts as a success of a task in contact, and what a flight lacked, from metrics
made by hand.
"""

from __future__ import annotations

import json

import numpy as np
import pytest

from skyarm.studies.compare.cell_flights import Cell
from skyarm.studies.compare.contact_suite import (
    NUMBERS,
    ContactSuite,
    cell_record,
    lacks,
)
from skyarm.studies.compare.contact_tasks import TASKS
from skyarm.studies.compare.run_suite import write_suite

GOOD = {
    "tilt_max": 0.2,
    "phases_done": 3.0,
    "contact_held": 0.95,
    "mechanism_furthest": 1.0,
    "tip_lowest": 0.7725,
    "object_last_x": 0.604,
    "object_last_y": -0.004,
    "contact_last": 2.0,
    "ee_error_last_mean_continuous": 0.02,
    **{
        each.metric: np.nan if each.metric.startswith("grip") else 0.5
        for each in NUMBERS.values()
    },
}
WEIGHT = 10.0


def cell(*status, **changed):
    """A cell of one flight for each ending, in all of which some metrics are
    changed.
    """
    names = status or ("completed",)
    return Cell(
        {
            name: np.full(len(names), changed.get(name, value))
            for name, value in GOOD.items()
        },
        np.array(names),
    )


def lacked(task, found):
    return [
        word for word, flags in lacks(TASKS[task], found, WEIGHT, 3).items() if flags[0]
    ]


@pytest.mark.parametrize(
    "task",
    [
        "press_and_hold",
        "push_button",
        "peg_in_hole",
        "pick_and_carry",
        "perch_on_shelf",
    ],
)
def test_a_flight_that_does_all_of_it_succeeds(task):
    assert lacked(task, cell()) == []


@pytest.mark.parametrize(
    ("task", "word", "changed"),
    [
        ("press_and_hold", "force", {"contact_held": 0.89}),
        ("press_and_hold", "force", {"contact_held": np.nan}),
        ("press_and_hold", "phases", {"phases_done": 2.0}),
        ("press_and_hold", "lost", {"tilt_max": 1.4}),
        ("pick_and_carry", "lost", {"ee_error_last_mean_continuous": 0.501}),
        ("pick_and_carry", "lost", {"ee_error_last_mean_continuous": np.nan}),
        ("open_door", "opening", {"mechanism_furthest": 0.95}),
        ("pull_door", "opening", {"mechanism_furthest": 0.95}),
        ("turn_valve", "opening", {"mechanism_furthest": 1.39}),
        ("push_button", "opening", {"mechanism_furthest": 0.0029}),
        ("peg_in_hole", "depth", {"tip_lowest": 0.7731}),
        ("pick_and_carry", "place", {"object_last_x": 0.61}),
        ("pick_and_carry", "place", {"object_last_y": 0.0101}),
        ("perch_on_shelf", "standing", {"contact_last": 0.99}),
        ("perch_on_shelf", "place", {"ee_error_last_mean_continuous": 0.051}),
    ],
)
def test_what_is_missing_is_named(task, word, changed):
    assert lacked(task, cell(**changed)) == [word]


def test_a_flight_that_lacks_several_counts_once_under_the_first():
    found = cell("completed", "phase_failed", "rotor_contact", "completed")
    found.metrics["contact_held"][2:] = 0.1
    told = cell_record(TASKS["press_and_hold"], found, WEIGHT, 3)
    assert told["causes"] == {"phases": 1, "rotor_contact": 1, "force": 1}
    assert (told["flights"], told["successes"], told["success_rate"]) == (4, 1, 0.25)
    low, high = told["success_interval"]
    assert 0.0 < low < 0.25 < high < 1.0


def test_numbers_are_medians_over_whole_flights_and_none_where_there_are_none():
    found = cell("completed", "completed", "completed", "lost")
    found.metrics["contact_error_mean"][:] = [-0.1, 0.2, np.nan, 9.0]
    told = cell_record(TASKS["press_and_hold"], found, WEIGHT, 3)
    assert told["force_error"] == pytest.approx(0.15), "by its size"
    assert cell_record(TASKS["press_and_hold"], cell("lost"), WEIGHT, 3)["peak"] is None


def test_the_time_of_a_task_is_that_of_finished_ones():
    """A flight that came to its end in phase 3 of 3 ended its second phase early."""
    found = cell("completed", "completed", "completed")
    found.metrics["phases_time"][:], found.metrics["phases_done"][:] = (
        [
            9.0,
            11.0,
            2.0,
        ],
        [3.0, 3.0, 2.0],
    )
    assert cell_record(TASKS["press_and_hold"], found, WEIGHT, 3)[
        "time"
    ] == pytest.approx(10.0)
    assert (
        cell_record(TASKS["press_and_hold"], cell(phases_done=2.0), WEIGHT, 3)["time"]
        is None
    )


def test_handles_have_a_median_and_what_nearly_all_stay_below():
    count = 21
    found = cell(*["completed"] * count, "lost")
    for name in ("radial", "radial_most", "lag_most"):
        found.metrics[NUMBERS[name].metric][:] = [*np.arange(count), 1e3]
    told = cell_record(TASKS["pull_door"], found, WEIGHT, 3)
    assert (told["radial"], told["radial_most"], told["lag_most"]) == (10.0, 19.0, 19.0)


def test_tables_page_and_files_tell_the_same(tmp_path):
    task = TASKS["press_and_hold"]
    flown = cell_record(task, cell("completed", "rotor_contact"), WEIGHT, 3)
    conditions = {"perfect": {"centroidal": flown}, "noisy": {}}
    found = {
        "suite": "contact-suite",
        "seed": 0,
        "plant": "rigid_body",
        "worlds": 2,
        "laws": ["centroidal", "paper_ct"],
        "not_flown": {"<b> in press_and_hold": "has no <gains>"},
        "tasks": {
            task.name: {
                "title": task.title,
                "worlds": 2,
                "drawn": 3,
                "discarded": 1,
                "conditions": conditions,
            }
        },
    }
    suite = ContactSuite(worlds=2)
    text, page = suite.report(found).markdown(), suite.report(found).html()
    assert "| press 1 N and hold | 1 of 2 |" in text
    assert "press_and_hold 1 of 3" in text
    assert "rotor_contact 1" in text
    assert "noisy measurements" not in text, "a condition that nobody flew has no table"
    assert "1 of 2" in page
    assert "<gains>" not in page
    write_suite(suite, found, {}, tmp_path)
    assert json.loads((tmp_path / "contact.json").read_text()) == found
