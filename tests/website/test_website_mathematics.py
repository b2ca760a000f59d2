"""The page on mathematics: its functions are where it says, and the test of each
equation calls its function.
"""

from __future__ import annotations

import importlib
import inspect
import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from tests_of_equations import TESTS

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "mathematics.md").read_text("utf-8")
EQUATIONS = PAGE[PAGE.index("## Rotations") :]
ROW = re.compile(
    r"^\| \w[^|$`]+ \| (\$\S.*) \| (\S.*) \| \[`\w+\.([\w.]+)`\]\(\.\./(\S+?)\) \|$",
    re.M,
)
FOUND = ROW.findall(EQUATIONS)
NAMES = [
    f"{file.removeprefix('src/').removesuffix('.py').replace('/', '.')}.{called}"
    for *_, called, file in FOUND
]
ROWS = [
    (equation, source, name, file, TESTS[name])
    for name, (equation, source, _, file) in zip(NAMES, FOUND, strict=True)
]
"""Equation, source, full name of the function and its file, test."""
SECTIONS = (
    "Rotations",
    "Rigid-body dynamics of any tree",
    "Rotors, mixer, joints",
    "Air",
    "The paper's law",
    "The centroidal law and its parts",
    "Published laws",
    "Flying and judging",
)


def function_named(name: str, file: str) -> Any:
    """The function of a file that a full name names, without decorators."""
    place = file.removeprefix("src/").removesuffix(".py").replace("/", ".")
    # where pytest finds its helpers
    found: Any = importlib.import_module(place.removeprefix("tests."))
    for part in name.removeprefix(f"{place}.").split("."):
        found = getattr(found, part)
    return inspect.unwrap(getattr(found, "__func__", found))


def place(name: str, file: str) -> str:
    """File and first line of a function, as the plugin writes them."""
    code = function_named(name, file).__code__
    return f"{code.co_filename}:{code.co_firstlineno}"


def test_every_line_of_the_tables_is_a_row() -> None:
    lines = [line for line in EQUATIONS.splitlines() if line.startswith("| ")]
    assert len(ROWS) == len(
        [line for line in lines if not line.startswith("| quantity |")]
    )
    assert len(ROWS) >= 50
    assert sorted(NAMES) == sorted(TESTS)
    assert re.findall(r"^## (.*)$", EQUATIONS, re.M) == [*SECTIONS]


@pytest.mark.parametrize("row", ROWS, ids=[row[2] for row in ROWS])
def test_a_function_is_where_its_row_says(row: tuple[str, ...]) -> None:
    _, source, name, file, _ = row
    assert re.search(r"\d{4}|textbook|this project|MIL|inverse|backward", source), (
        "a source has a year or says what it is"
    )
    function = function_named(name, file)
    assert inspect.isfunction(function), "a class calls nothing"
    assert Path(inspect.getsourcefile(function) or "") == ROOT / file


@pytest.fixture(scope="module")
def calls(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[str]]:
    """First lines of the functions that each named test calls; all of them must
    pass.
    """
    file = tmp_path_factory.mktemp("calls") / "calls.json"
    tests = sorted({test for *_, test in ROWS})
    words = [
        "-m",
        "pytest",
        "-q",
        "-n",
        "0",
        "-m",
        "",
        "-p",
        "calls_of_tests",
        "--calls",
        str(file),
        *tests,
    ]
    paths = [str(Path(__file__).parent), str(ROOT / "src")]
    environment = {"PYTHONPATH": os.pathsep.join(paths)}
    done = subprocess.run(
        [sys.executable, *words],
        cwd=ROOT,
        env=os.environ | environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout[-3000:]
    found: dict[str, list[str]] = json.loads(file.read_text("utf-8"))
    return found


@pytest.mark.site
def test_every_named_test_calls_its_function(calls: dict[str, list[str]]) -> None:
    missed = [
        f"{test} does not call {name}"
        for _, _, name, file, test in ROWS
        if place(name, file) not in calls[test]
    ]
    assert missed == []


@pytest.mark.site
def test_a_test_that_does_not_call_a_function_is_told_from_one_that_does(
    calls: dict[str, list[str]],
) -> None:
    """The check above can fail: a test of rotations calls no mixer."""
    mixer = place(
        "skyarm.dynamics.actuators.mixer.make_mixer",
        "src/skyarm/dynamics/actuators/mixer.py",
    )
    assert (
        mixer
        not in calls[
            "tests/algebra/test_quaternions.py::test_the_rotation_of_a_quaternion_is_that_of_scipy"
        ]
    )
    assert (
        mixer
        in calls[
            "tests/dynamics/actuators/test_allocation.py::test_the_inverse_is_the_pseudo_inverse"
        ]
    )
