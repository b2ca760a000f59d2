"""The page of a study says whether it is complete, and ties of two controllers are shared between them."""

from __future__ import annotations

import dataclasses
import html
import re

import numpy as np
import pytest

from skyarm.sweep.manifest import Manifest
from skyarm.sweep.origin import Origin
from skyarm.sweep.stats import _paired
from skyarm.sweep.study_page import page

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
    origin=Origin(study=STUDY, scenarios={"law": "a", "other": "b"}, version="1.2.3"),
)


def found(*, complete, paired=None):
    one = {"status": {"completed": 11, "fell": 1}, "success_rate": 0.75, "success_interval": (0.4, 0.9)}
    return {
        "complete": complete,
        "rows": 24 if complete else 20,
        "rows_planned": 24,
        "files_not_counted": [],
        "manifest_rebuilt": False,
        "episodes": 12 if complete else 10,
        "limits": {},
        "confidence": 0.95,
        "controllers": {"law": {**one, "metrics": {}}},
        "paired": paired or {},
    }


def text(complete):
    return html.unescape(re.sub(r"<[^>]*>", " ", page(found(complete=complete), MANIFEST, {})))


def test_a_page_says_that_a_study_is_not_complete_and_only_then():
    whole, part = text(True), text(False)
    assert "24 rows of 12 episodes;" in whole
    assert "incomplete" not in whole
    assert "incomplete: 20 of 24 rows, 10 episodes so far;" in part


def test_a_page_without_pairs_and_maps_has_no_empty_sections():
    bare = page(found(complete=True), MANIFEST, {})
    assert "Paired differences" not in bare
    assert "Robustness maps" not in bare
    assert "Robustness maps" in page(found(complete=True), MANIFEST, {"a map": b"png"})


def test_a_study_without_a_title_is_called_by_its_name():
    assert "<title>small</title>" in page(found(complete=True), MANIFEST, {})
    assert "<title>A title</title>" in page(found(complete=True), dataclasses.replace(MANIFEST, title="A title"), {})


def test_ties_are_shared_between_both_controllers():
    """Of ten differences three are below zero and four are zero: two of these count for each side."""
    difference = np.array([-1.0, -2.0, -3.0, 0.0, 0.0, -0.0, 0.0, 1.0, 2.0, 3.0])
    assert _paired(difference, 0, 0.95)["first_smaller"] == pytest.approx(0.5)
    assert _paired(-difference, 0, 0.95)["first_smaller"] == pytest.approx(0.5)
    assert _paired(np.zeros(4), 0, 0.95)["first_smaller"] == pytest.approx(0.5)
    assert _paired(np.array([-1.0, 0.0, 0.0, 2.0, 3.0]), 0, 0.95)["first_smaller"] == pytest.approx(0.4)
