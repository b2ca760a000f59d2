"""The grammar that is printed is that of the declarations: what it says can be read, varied, and is on its page."""

from __future__ import annotations

import re

import pytest

import skyarm
from shown_commands import ROOT
from skyarm.records.words import slots
from skyarm.scenario.grammar import Row, grammar

ROWS = grammar()
PAGE = (ROOT / "docs/scenario_files.md").read_text("utf-8")


def row(path: str, of: str = "") -> Row:
    (found,) = [each for each in ROWS if (each.path, each.of) == (path, of)]
    return found


def test_every_word_of_the_records_is_a_row():
    told = {each.path.removesuffix("[]") for each in ROWS}
    assert {slot.path for slot in slots(skyarm.Scenario)} <= told


@pytest.mark.parametrize(
    ("path", "of", "entry", "unit", "bounds", "varies"),
    [
        ("duration", "", "number", "s", "above 0", "never"),
        ("rates.control", "", "whole number", "Hz", "at least 1, at most 1e+06", "never"),
        ("plant.gravity", "", "number", "m/s^2", "at least 0", "in flight, between episodes"),
        (
            "plant.joints.damping",
            "",
            "number, or one for each joint",
            "N m s/rad or N s/m",
            "at least 0",
            "in flight, ",
        ),
        ("delays.command", "", "number", "s", "at least 0", "where longest_command is stated"),
        ("delays.measurement", "", "number", "s", "at least 0", "never"),
        ("environment.wind.velocity", "moving_air", "three numbers", "m/s", "", "in flight, between episodes"),
        ("environment.wind.force", "force_wind", "three numbers", "N", "", "in flight, between episodes"),
        ("environment.faults[].effectiveness", "loss", "number", "", "at least 0, at most 1", "in flight, "),
        ("environment.faults[].rotor", "loss", "text", "", "", "never"),
        ("payloads[].cord", "hanging", "number", "m", "above 0", "in flight, between episodes"),
        ("sensors.*.frequency", "imu", "number", "Hz", "at least 0", "never"),
        ("sensors.position", "", "number", "m", "at least 0", "in flight, between episodes"),
        ("initial", "", "table", "", "", "between episodes"),
    ],
)
def test_a_word_is_told_with_its_unit_bounds_and_when_it_varies(path, of, entry, unit, bounds, varies):
    found = row(path, of)
    assert (found.entry, found.unit, found.bounds) == (entry, unit, bounds)
    assert found.varies.startswith(varies)


def test_parts_that_a_change_may_replace_are_marked():
    whole = {each.path for each in ROWS if each.whole}
    assert {"controller", "reference", "environment.wind", "environment.air[]", "estimator", "endings[]"} <= whole
    assert not whole & {"plant", "duration", "initial", "payloads[]"}


def test_every_word_that_is_of_no_kind_is_on_the_page_of_scenario_files():
    words = {part for each in ROWS if not each.of for part in each.path.removesuffix("[]").split(".") if part != "*"}
    written = set(re.findall(r"\w+", PAGE))
    assert words - written == set()
