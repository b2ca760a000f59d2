"""The grammar that is printed is that of the declarations: what it says can be read,
varied, and is on its page.
"""

from __future__ import annotations

import re
import tomllib

import pytest

import skyarm
from shown_commands import ROOT
from skyarm.records.registry.shipped import SHIPPED
from skyarm.records.units import units
from skyarm.scenario.grammar import BY_HAND, SIGNAL, GrammarRow, grammar, without_links
from support.components import registry_kept

ROWS = grammar()
PAGE = "".join(
    page.read_text("utf-8")
    for page in (*(ROOT / "docs").glob("scenario_*.md"), ROOT / "docs/contact.md")
)


def row(path: str, of: str = "") -> GrammarRow:
    (found,) = [each for each in ROWS if (each.path, each.of) == (path, of)]
    return found


FILES = [
    *(ROOT / "src/skyarm/scenario/library").glob("*.toml"),
    *(ROOT / "examples").rglob("*.toml"),
]
PATTERNS = [
    (re.compile(re.escape(each.path).replace(r"\*", r"[^.\[]+")), each) for each in ROWS
]


def untold(table: object, path: str = "") -> set[str]:
    """Paths of a file's keys without a row, but within signals and the tables that are
    read by hand.
    """
    if isinstance(table, list):
        return {found for each in table for found in untold(each, f"{path}[]")}
    missing: set[str] = set()
    for name, entry in table.items() if isinstance(table, dict) else ():
        at = f"{path}.{name}" if path else name
        rows = [
            each
            for pattern, each in PATTERNS
            for end in ("", "[]")
            if pattern.fullmatch(f"{at}{end}")
        ]
        if not rows and not any(
            pattern.pattern.startswith(re.escape(f"{at}.")) for pattern, _ in PATTERNS
        ):
            missing.add(at)
        elif at == "agents":
            # each has keys of the top, and those of faults without their table
            for own in entry.values():
                faults = (
                    {"environment": {"faults": own["faults"]}}
                    if "faults" in own
                    else {}
                )
                missing |= untold(
                    {key: each for key, each in own.items() if key != "faults"} | faults
                )
        elif not any("signal" in each.entry for each in rows) and at not in (
            *BY_HAND,
            "numbers",
        ):
            missing |= untold(entry, at)
    return missing


def test_every_key_of_the_shipped_scenarios_and_examples_has_a_row():
    tables = [
        table
        for table in map(tomllib.loads, (file.read_text("utf-8") for file in FILES))
        if "plant" in table
    ]
    assert len(tables) > 25
    assert {found for table in tables for found in untold(table)} == set()


def test_every_key_of_the_example_on_the_page_has_a_row():
    texts = re.findall(r"```toml[^\n]*\n(.*?)```", PAGE, re.DOTALL)
    assert any("[environment.wind]" in text for text in texts)
    assert {found for text in texts for found in untold(tomllib.loads(text))} == set()


def test_a_key_without_a_row_would_be_found():
    assert untold({"plant": {"gravty": 1}, "world": {"surfaces": [{"nme": "x"}]}}) == {
        "plant.gravty",
        "world.surfaces[].nme",
    }


@pytest.mark.parametrize(
    ("path", "of", "entry"),
    [
        ("schema", "", "whole number"),
        ("plugins.need", "", "list of texts"),
        ("plant.kind", "", "'rigid_body' or 'mujoco'"),
        ("plant.integrator", "", "'rk4' or 'euler' or 'rk4_staged'"),
        ("changes[].path", "", "text"),
        ("windows.steady", "", "[start, stop]"),
        ("windows.holds", "", "list of [start, stop]"),
        ("environment.wind.gust.velocity", "moving_air", "three numbers"),
        ("environment.wind.gust.force", "force_wind", "three numbers"),
        ("environment.wind.gust.shape", "moving_air", "'step' or 'one_minus_cosine'"),
        ("environment.wind.turbulence.wind_20ft", "moving_air", "number"),
        (
            "environment.faults[].effectiveness",
            "loss",
            "number, list or table: a signal",
        ),
        ("payloads[].pick", "rigid", "number, or a table: a place"),
        ("payloads[].pick.within", "rigid", "number"),
        ("sensors.*.gyro.density", "imu", "number"),
        ("world.surfaces[].name", "contact", "text"),
        ("controller.gains.position", "hybrid_computed_torque", "three numbers"),
        ("controller.without", "hybrid_computed_torque", "list of names"),
        ("initial.quaternion_wxyz", "", "four numbers"),
        ("SIGNAL.height", "ramp", "number"),
    ],
)
def test_words_inside_tables_and_their_choices_are_told(path, of, entry):
    assert row(path, of).entry == entry


def test_kinds_are_told_where_they_are_chosen():
    with registry_kept():
        skyarm.register.motion("spin")(spin)
        skyarm.register.force("own_push")(skyarm.Force)
        rows = {(each.path, each.of): each.entry for each in grammar()}
    assert "'own_push'" in rows["environment.wind.mode", ""]
    assert "'own_push'" in rows["environment.forces[].kind", ""]
    assert "'loss' (loss if left out)" in rows["environment.faults[].kind", ""]
    assert "'spin'" in rows["reference.base.kind", ""]
    assert rows["reference.base.radius", "spin"] == "number"
    assert "'ramp'" in rows["SIGNAL.kind", ""]
    assert ("environment.faults[].signal", "loss") not in rows


@pytest.mark.parametrize(
    ("kind", "at"), [("signal", "SIGNAL"), ("motion", "reference.base")]
)
def test_keys_that_are_read_by_hand_are_those_that_are_told(kind, at):
    """A table with all of a shipped kind's keys is read; one with a key more is
    refused, and told those there are.
    """
    tasks = ("waypoints", "phases", "samples")
    told = {named: {} for named in SHIPPED[kind] if named not in tasks}
    for each in ROWS:
        if each.path.startswith(f"{at}.") and each.of in told:
            told[each.of][each.path.removeprefix(f"{at}.")] = each
    assert all(told.values())
    for named, keys in told.items():
        table = {"kind": named, "odd": 1.0} | {
            key: EXAMPLES.get(key, 1.0) for key in keys
        }
        reference = {"base": table} if kind == "motion" else {"base": AT, "yaw": table}
        with pytest.raises(ValueError, match="odd") as error:
            skyarm.scenario_from({**SCENARIO, "reference": reference})
        allowed = str(error.value).partition("allowed: ")[2].split(", ")
        assert set(allowed) - {"kind"} == set(keys), named


AT = {"kind": "hover", "position": [0.0, 0.0, 1.0]}
SCENARIO = {
    "name": "x",
    "duration": 1.0,
    "plant": {"vehicle": "hummingbird"},
    "controller": {"preset": "rotors_sim_hummingbird"},
}
EXAMPLES = {
    "stop": 2.0,
    "shape": "linear",
    "segments": [[1.0, 1.0]],
    "signals": [1.0],
    "times": [0.0, 1.0],
    "values": [0.0, 1.0],
    "position": [0.0, 0.0, 1.0],
    "center": [0.0, 0.0, 1.0],
    "count": 2,
    "width": 0.5,
}


def test_every_key_that_is_not_a_task_s_has_a_meaning_and_a_default():
    assert [
        each.path
        for each in ROWS
        if not each.meaning and "." in each.path and each.of != "schema"
    ] == []
    assert [
        each.path
        for each in ROWS
        if not each.default and not each.path.endswith(".kind") and states_a_value(each)
    ] == []


def test_rows_of_signals_have_the_units_of_the_trajectory():
    for name in ("yaw", "load"):
        assert row(f"reference.{name}").unit == units(skyarm.Trajectory)[name].unit


def states_a_value(each):
    """Keys of numbers, texts and flags, which have a default or are required."""
    return not any(
        word in each.entry for word in ("table", "signal")
    ) and not each.path.startswith("controller.")


def test_links_of_the_page_are_words_in_a_terminal():
    linked = row("plant.integrator")
    assert linked.meaning == "[integrator](scenario_plant.md#integrators) of the plant"
    assert without_links(linked).meaning == "integrator of the plant"
    assert all(
        "](" not in f"{each.meaning}{each.default}" for each in map(without_links, ROWS)
    )


def spin(radius: float = 1.0) -> skyarm.Trajectory:
    """Motion of a test."""
    return skyarm.Trajectory()


def test_a_table_that_no_change_replaces_says_so():
    for path in ("plant", "world", "payloads[]", "sensors"):
        assert row(path).varies == "its numbers in flight, between episodes"
    assert (
        row("controller").varies
        == "as a whole in flight; its numbers in flight, between episodes"
    )
    assert row("environment.ground").varies == "as a whole in flight"


@pytest.mark.parametrize(
    ("path", "of", "entry", "unit", "bounds", "varies"),
    [
        ("duration", "", "number", "s", "above 0", "never"),
        (
            "rates.control",
            "",
            "whole number",
            "Hz",
            "at least 1, at most 1e+06",
            "never",
        ),
        (
            "plant.gravity",
            "",
            "number",
            "m/s^2",
            "at least 0",
            "in flight, between episodes",
        ),
        (
            "plant.joints.damping",
            "",
            "number, or one for each joint",
            "N m s/rad or N s/m",
            "at least 0",
            "in flight, ",
        ),
        (
            "delays.command",
            "",
            "number",
            "s",
            "at least 0",
            "where longest_command is stated",
        ),
        ("delays.measurement", "", "number", "s", "at least 0", "never"),
        (
            "environment.wind.velocity",
            "moving_air",
            "three numbers",
            "m/s",
            "",
            "in flight, between episodes",
        ),
        (
            "environment.wind.force",
            "force_wind",
            "three numbers",
            "N",
            "",
            "in flight, between episodes",
        ),
        (
            "environment.faults[].effectiveness",
            "loss",
            SIGNAL,
            "",
            "at least 0, at most 1",
            "in flight, ",
        ),
        ("environment.faults[].rotor", "loss", "text", "", "", "never"),
        (
            "payloads[].cord",
            "hanging",
            "number",
            "m",
            "above 0",
            "in flight, between episodes",
        ),
        ("sensors.*.frequency", "imu", "number", "Hz", "at least 0", "never"),
        (
            "sensors.position",
            "",
            "number",
            "m",
            "at least 0",
            "in flight, between episodes",
        ),
        ("initial", "", "table", "", "", "between episodes"),
    ],
)
def test_a_word_is_told_with_its_unit_bounds_and_when_it_varies(
    path, of, entry, unit, bounds, varies
):
    found = row(path, of)
    assert (found.entry, found.unit, found.bounds) == (entry, unit, bounds)
    assert found.varies.startswith(varies)


def test_parts_that_a_change_may_replace_are_marked():
    whole = {each.path for each in ROWS if each.whole}
    assert {
        "controller",
        "reference",
        "environment.wind",
        "environment.air[]",
        "estimator",
        "endings[]",
    } <= whole
    assert not whole & {"plant", "duration", "initial", "payloads[]"}


def test_every_word_that_is_of_no_kind_is_on_a_page_of_scenario_files():
    paths = (each.path.replace("[]", "") for each in ROWS if not each.of)
    words = {
        part
        for path in paths
        for part in path.split(".")
        if part not in ("*", "SIGNAL")
    }
    written = set(re.findall(r"\w+", PAGE))
    assert words - written == set()
