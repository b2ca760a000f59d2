"""One flight of each task as log, picture and film, and the page that shows them."""

from __future__ import annotations

import json

import numpy as np
import pytest

import skyarm
from film_flights import needs_display
from skyarm.studies.compare.cells import episode_scenario
from skyarm.studies.compare.contact_report import contact_report
from skyarm.studies.compare.contact_suite import ContactSuite, fly_contact, shown_flights
from skyarm.studies.compare.contact_tasks import FLAGSHIP, MOTION


def test_a_task_is_shown_by_its_first_law_under_noise():
    todo = ContactSuite(laws=(MOTION, FLAGSHIP), tasks=("press_and_hold", "perch_on_shelf"), worlds=3).flights()
    shown = {name: (each.entrant.name, each.condition.name) for name, each in shown_flights(todo).items()}
    assert shown == {"press_and_hold": (MOTION, "noisy"), "perch_on_shelf": (FLAGSHIP, "noisy")}
    perfect = [each for each in todo if each.condition.name == "perfect"]
    assert {each.condition.name for each in shown_flights(perfect).values()} == {"perfect"}


def test_a_page_shows_pictures_with_links_to_their_films():
    told = {"law": "centroidal", "condition": "noisy", "status": "completed", "picture": "pictures/x.png"}
    found = {
        "worlds": 2, "seed": 0, "plant": "rigid_body", "laws": [], "not_flown": {},
        "shown": {"turn_valve": told | {"film": "films/turn_valve.webp"}, "pull_door": told | {"status": "lost"}},
        "tasks": {
            name: {"title": name, "drawn": 2, "discarded": 0, "conditions": {"perfect": {}, "noisy": {}}}
            for name in ("turn_valve", "pull_door")
        },
    }  # fmt: skip
    page = contact_report(found, {"pictures/x.png": b"a"}).html()
    assert page.count("<figure") == 2
    assert '<a href="films/turn_valve.webp">turn_valve: centroidal, first world, noisy</a>' in page
    assert ">pull_door: centroidal, first world, noisy, lost</figcaption>" in page
    assert "One flight of each" not in contact_report(found).html()


@pytest.mark.parametrize("name", ["flights", "pictures"])
def test_folders_that_cannot_be_written_are_told_before_anything_flies(tmp_path, name):
    (tmp_path / name).write_text("a file in the way")
    with pytest.raises(OSError, match=rf"output folder = '.*{name}': must be writable"):
        fly_contact(ContactSuite(laws=(FLAGSHIP,), tasks=("push_button",), worlds=1), tmp_path)
    assert not (tmp_path / "cells").exists()


@pytest.mark.thorough
@needs_display
def test_a_suite_leaves_flights_pictures_and_films(tmp_path):
    found = fly_contact(ContactSuite(laws=(FLAGSHIP,), tasks=("push_button",), worlds=1, films=True), tmp_path)
    told = found["shown"]["push_button"]
    assert (tmp_path / told["picture"]).read_bytes()[:4] == b"\x89PNG"
    assert (tmp_path / told["film"]).read_bytes()[8:12] == b"WEBP"
    assert f'href="{told["film"]}"' in (tmp_path / "report.html").read_text("utf-8")
    assert json.loads((tmp_path / "contact.json").read_text("utf-8"))["shown"] == found["shown"]
    flights = shown_flights(ContactSuite(laws=(FLAGSHIP,), tasks=("push_button",), worlds=1).flights())["push_button"]
    log, scenario = skyarm.load_log(tmp_path / told["flight"]), episode_scenario(flights, 0)
    assert log.scenario == scenario
    np.testing.assert_array_equal(log.tip, skyarm.run(scenario).tip)
