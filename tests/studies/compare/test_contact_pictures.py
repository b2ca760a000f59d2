"""One flight of each task as log and picture, and the page that shows them."""

from __future__ import annotations

import json

import numpy as np
import pytest

import skyarm
from skyarm.studies.compare.cells import episode_scenario
from skyarm.studies.compare.contact_suite import ContactSuite, shown_flights
from skyarm.studies.compare.contact_tasks import FLAGSHIP, MOTION
from skyarm.studies.compare.run_suite import fly_suite


def test_a_task_is_shown_by_its_first_law_under_noise():
    todo = ContactSuite(laws=(MOTION, FLAGSHIP), tasks=("press_and_hold", "perch_on_shelf"), worlds=3).flights()
    shown = {name: (each.entrant.name, each.condition.name) for name, each in shown_flights(todo).items()}
    assert shown == {"press_and_hold": (MOTION, "noisy"), "perch_on_shelf": (FLAGSHIP, "noisy")}
    perfect = [each for each in todo if each.condition.name == "perfect"]
    assert {each.condition.name for each in shown_flights(perfect).values()} == {"perfect"}


@pytest.mark.parametrize("name", ["flights", "pictures"])
def test_folders_that_cannot_be_written_are_told_before_anything_flies(tmp_path, name):
    (tmp_path / name).write_text("a file in the way")
    with pytest.raises(OSError, match=rf"output folder = '.*{name}': must be writable"):
        fly_suite(ContactSuite(laws=(FLAGSHIP,), tasks=("push_button",), worlds=1), tmp_path)
    assert not (tmp_path / "cells").exists()


@pytest.mark.thorough
def test_a_suite_leaves_flights_and_pictures(tmp_path):
    found = fly_suite(ContactSuite(laws=(FLAGSHIP,), tasks=("push_button",), worlds=1), tmp_path)
    told = found["shown"]["push_button"]
    assert (tmp_path / told["picture"]).read_bytes()[:4] == b"\x89PNG"
    assert "push a button: centroidal, first world, noisy</figcaption>" in (tmp_path / "report.html").read_text("utf-8")
    assert json.loads((tmp_path / "contact.json").read_text("utf-8"))["shown"] == found["shown"]
    flights = shown_flights(ContactSuite(laws=(FLAGSHIP,), tasks=("push_button",), worlds=1).flights())["push_button"]
    log, scenario = skyarm.load_log(tmp_path / told["flight"]), episode_scenario(flights, 0)
    assert log.scenario == scenario
    np.testing.assert_array_equal(log.tip, skyarm.run(scenario).tip)
