"""The list of checks is that of the findings: no question without an entry, no level
that an entry leaves out.
"""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

import skyarm
from skyarm.studies.assess.finding import LEVELS
from support.check_list import CHECKS, SCENARIO, VEHICLE
from support.commands import skyarm as command

ASSESS = Path(skyarm.__file__).parent / "studies/assess"
ROOT = Path(__file__).resolve().parents[3]
EXAMPLES = ROOT / "examples"


def listed(question: str) -> str:
    """Question as the list has it: without the name of a joint and words about a
    load.
    """
    return re.sub(
        r"joints\[[^]]*\]", "joints[NAME]", re.sub(r" with [\d.e+-]+ kg$", "", question)
    )


def texts(node: ast.expr) -> list[str]:
    """Texts that an expression of a question may be, names in braces as NAME."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return [node.value]
    if isinstance(node, ast.JoinedStr):
        return [
            "".join(
                each.value if isinstance(each, ast.Constant) else "\0"
                for each in node.values
            )
        ]
    return []


def questions_in_source() -> set[str]:
    """Texts in the place of a question in the modules of the checks."""
    found: set[str] = set()
    for path in ASSESS.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if (
                isinstance(node, ast.Call)
                and isinstance(node.func, ast.Name)
                and node.args
            ):
                if node.func.id in ("Finding", "at_least", "at_most", "_saturation"):
                    found |= set(texts(node.args[0]))
            elif isinstance(node, ast.Assign) and isinstance(
                node.targets[0], ast.Name | ast.Tuple
            ):
                names = (
                    [node.targets[0]]
                    if isinstance(node.targets[0], ast.Name)
                    else node.targets[0].elts
                )
                values = (
                    node.value.elts
                    if isinstance(node.value, ast.Tuple)
                    else [node.value]
                )
                for name, value in zip(names, values, strict=False):
                    if isinstance(name, ast.Name) and name.id == "question":
                        found |= set(texts(value))
    return found


def test_every_question_of_the_source_is_listed() -> None:
    known = {check.question for check in CHECKS}
    found = questions_in_source()
    assert len(found) > 15
    for text in found:
        pattern = re.escape(text).replace("\0", ".*")
        assert any(
            re.fullmatch(pattern, each) or re.fullmatch(pattern, f"{each}\0")
            for each in known
        ), text


@pytest.mark.parametrize(
    ("what", "payload"),
    [
        ("hummingbird_arm2_rotors", 0.05),
        ("voliro_like", 0.0),
        (str(EXAMPLES / "servo_quad.toml"), 0.0),
    ],
)
def test_findings_of_a_vehicle_are_listed(what: str, payload: float) -> None:
    levels = {
        check.question: check.levels.split(", ")
        for check in CHECKS
        if check.of == VEHICLE
    }
    for each in skyarm.check(what, payload=payload, poses=16).findings:
        assert each.level in levels[listed(each.question)], each


@pytest.mark.parametrize(
    "what",
    [
        "case3",
        pytest.param(
            str(EXAMPLES / "servo_swing.toml"),
            id="servo_swing",
            marks=pytest.mark.thorough,
        ),
    ],
)
def test_findings_of_a_scenario_are_listed(what: str) -> None:
    levels = {check.question: check.levels.split(", ") for check in CHECKS}
    for each in skyarm.check(what, poses=16).findings:
        assert each.level in levels[listed(each.question)], each


def test_entries_are_whole() -> None:
    assert len({check.question for check in CHECKS}) == len(CHECKS)
    for check in CHECKS:
        assert check.of in (VEHICLE, SCENARIO)
        assert set(check.levels.split(", ")) <= set(LEVELS)
        assert check.quantity
        assert bool(check.warning) == ("warning" in check.levels), check.question
        assert bool(check.fault) == ("fault" in check.levels), check.question
        assert check.remedy


def test_the_alarm_of_the_page_is_printed() -> None:
    page = (ROOT / "docs" / "checks.md").read_text("utf-8")
    (line,) = re.findall(r"^fault in .*\n    .*$", page, re.MULTILINE)
    printed = command("check", "hummingbird_arm2_rotors", "--payload", "0.15")
    assert printed.code == 1
    assert " ".join(line.split()) in " ".join(printed.out.split())
