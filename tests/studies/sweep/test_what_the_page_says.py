"""The page of a study says whether it is complete, and ties of two controllers are
shared between them.
"""

from __future__ import annotations

import dataclasses
import html
import re

import numpy as np
import pytest

from skyarm.studies.sweep.manifest import Manifest
from skyarm.studies.sweep.stats import (
    SHARES,
    Pictures,
    _difference_statistics,
    _success_difference,
    page,
)

STUDY = {
    "name": "small",
    "design": "random",
    "seed": 5,
    "precision": "double",
    "vary": None,
    "episodes": 12,
    "chunk": 12,
}
MANIFEST = Manifest(
    title="",
    success={},
    versions={"skyarm": "1.2.3"},
    study=STUDY,
    scenarios={"law": "a", "other": "b"},
)


def found(*, complete, paired=None, deterministic=False):
    one = {
        "status": {"completed": 11, "fell": 1},
        "success_rate": 0.75,
        "success_interval": (0.4, 0.9),
    }
    return {
        "complete": complete,
        "deterministic": deterministic,
        "rows": 24 if complete else 20,
        "rows_planned": 24,
        "files_not_counted": [],
        "episodes": 12 if complete else 10,
        "limits": {},
        "confidence": 0.95,
        "controllers": {"law": {**one, "metrics": {}}},
        "paired": paired or {},
    }


def text(complete):
    return html.unescape(
        re.sub(r"<[^>]*>", " ", page(found(complete=complete), MANIFEST, Pictures()))
    )


def test_a_page_says_that_a_study_is_not_complete_and_only_then():
    whole, part = text(True), text(False)
    assert "24 rows of 12 episodes;" in whole
    assert "incomplete" not in whole
    assert "incomplete: 20 of 24 rows, 10 episodes so far;" in part


def test_a_page_without_pairs_and_maps_has_no_empty_sections():
    bare = page(found(complete=True), MANIFEST, Pictures())
    for title in ("Paired differences", "Robustness maps"):
        assert title not in bare
    assert "Robustness maps" in page(
        found(complete=True), MANIFEST, Pictures(maps={"law": b"png"})
    )


def test_a_study_without_a_title_is_called_by_its_name():
    assert "<title>small</title>" in page(found(complete=True), MANIFEST, Pictures())
    assert "<title>A title</title>" in page(
        found(complete=True), dataclasses.replace(MANIFEST, title="A title"), Pictures()
    )


def test_a_map_that_is_the_same_everywhere_is_a_sentence():
    pictures = Pictures(
        maps={"one": b"png"}, constant={"law": 1.0, "other": 0.0, "third": 0.25}
    )
    text = page(found(complete=True), MANIFEST, pictures)
    assert text.count("<img") == 1
    for words in (
        "law: every episode succeeds",
        "other: no episode succeeds",
        "third: 25.0% succeed",
    ):
        assert f"<p>{words}, in every cell of the map.</p>" in text


def test_a_grid_without_chance_has_no_intervals_and_says_why():
    given = found(complete=True, deterministic=True)
    given["controllers"]["law"]["success_interval"] = None
    spread = {
        "count": 11,
        "mean": 0.5,
        "quantiles": {str(share): 0.25 for share in SHARES},
        "intervals": None,
    }
    given["controllers"]["law"]["metrics"] = {
        "ee_error_mean": spread,
        "pitch_rms": None,
    }
    text = html.unescape(page(given, MANIFEST, Pictures()))
    assert "nothing is drawn at random, and the numbers have no intervals" in text
    assert not re.search(r"[Bb]ootstrap|Wilson|\[0|interval<", text)
    assert '<th scope="row">mean tip error [m]</th><td>ee_error_mean</td>' in text


def test_ties_are_shared_between_both_controllers():
    """Of ten differences three are below zero and four are zero: two of these count for
    each side.
    """
    difference = np.array([-1.0, -2.0, -3.0, 0.0, 0.0, -0.0, 0.0, 1.0, 2.0, 3.0])
    assert _difference_statistics(difference)["first_smaller"] == pytest.approx(0.5)
    assert _difference_statistics(-difference)["first_smaller"] == pytest.approx(0.5)
    assert _difference_statistics(np.zeros(4))["first_smaller"] == pytest.approx(0.5)
    assert _difference_statistics(np.array([-1.0, 0.0, 0.0, 2.0, 3.0]))[
        "first_smaller"
    ] == pytest.approx(0.4)
    assert _difference_statistics(np.zeros(1))["first_smaller"] == pytest.approx(0.5), (
        "one tie is half of each"
    )


def test_a_page_marks_what_too_few_episodes_leave_without_an_interval():
    given = found(complete=True, paired={"law - other": pair_of_one()})
    spread = {
        "count": 1,
        "mean": 0.5,
        "quantiles": dict.fromkeys(map(str, SHARES), 0.25),
    }
    given["controllers"]["law"]["metrics"] = {
        "pitch_rms": {**spread, "intervals": dict.fromkeys(map(str, SHARES))},
    }
    text = page(given, MANIFEST, Pictures())
    assert text.count("0.25 [-]") == len(SHARES)
    assert "-0.02 [-]</td>" in text
    assert "+100.00% [-12.21%, +100.00%]" in text


def pair_of_one():
    """The first of two laws succeeds in the only episode; Wilson: 0.2065 to 1, and 0 to
    0.7935.
    """
    success = _success_difference(np.array([True]), np.array([False]))
    return {
        **success,
        "metrics": {"pitch_rms": _difference_statistics(np.array([-0.02]))},
    }
