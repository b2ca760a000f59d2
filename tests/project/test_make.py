"""make: help says every target and every variable, and what it says is so."""

from __future__ import annotations

import re
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
MAKEFILE = (ROOT / "Makefile").read_text("utf-8")
(PHONY,) = (line.split() for line in re.findall(r"^\.PHONY: (.*)$", MAKEFILE, re.M))
needs_make = pytest.mark.skipif(
    shutil.which("make") is None, reason="no 'make' on this machine"
)


def make(*words: str) -> str:
    done = subprocess.run(
        ["make", "-C", str(ROOT), *words], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@needs_make
def test_help_says_every_target() -> None:
    said = re.findall(r"^make ([\w-]+) ", make("help"), re.M)
    assert sorted(said) == sorted(set(PHONY) - {"help"})


def test_every_target_that_is_no_file_is_declared_so() -> None:
    assert sorted(re.findall(r"^([\w-]+):", MAKEFILE, re.M)) == sorted(PHONY)


@needs_make
def test_help_says_every_variable_with_its_value() -> None:
    variables = re.findall(r"^(\w+) \?=", MAKEFILE, re.M)
    assert variables == ["PYTHON", "OUT", "BENCH", "WORKERS", "TESTS", "NUMBERS"]
    free = {"TESTS", "NUMBERS"}  # words of a command, empty unless given
    said = make(
        "help", *(f"{name}=chosen_{name}" for name in variables if name not in free)
    )
    for name in variables:
        assert f"{name}=" in said, name
        assert name in free or f"{name}=chosen_{name}" in said


@needs_make
@pytest.mark.parametrize(
    ("words", "part"),
    [
        (("reproduce", "OUT=here"), "-m skyarm reproduce --out here"),
        (("bench", "BENCH=there.json"), "measure_engines.py --out there.json"),
        (("numbers", "NUMBERS=--list"), "tests/website/measured_numbers.py --list"),
        (
            ("peers",),
            ".venv-peers/bin/python tests/studies/bench/measure_peers.py --small",
        ),
        (
            ("ray",),
            (
                ".venv-ray/bin/pytest -n 0 tests/studies/flights/test_ray_*.py"
                " tests/test_docs_clusters.py"
            ),
        ),
        (("warp",), ".venv-warp/bin/python tests/plant/step_exported.py"),
        (("mutants", "WORKERS=7"), "mutants.py run --workers 7"),
        (("test", "TESTS=tests/plant -k wind"), "pytest tests/plant -k wind"),
        (("types", "VENV=new"), '-c constraints.txt -e ".[types]"'),
        (("thorough", "VENV=new"), '-c constraints.txt -e ".[casadi,film]"'),
        (("fresh", "PYTHON=python9"), "python9 tests/release.py install"),
        (("test-lowest", "PYTHON=python9"), "tests/lowest.py run"),
    ],
)
def test_variables_reach_the_commands(words: tuple[str, ...], part: str) -> None:
    assert part in make("--dry-run", *words)


@needs_make
def test_all_gates_run_after_a_red_one_and_each_has_a_closing_line() -> None:
    words = ["make", "-C", str(ROOT), "all", "GATES=nothing_of_this_name help"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode != 0
    first, second = re.findall(r"^(\w+: \w+) after \d+ s$", done.stdout, re.M)
    assert (first, second) == ("nothing_of_this_name: RED", "help: green")
    assert (
        subprocess.run(
            [*words[:-1], "GATES=help"], capture_output=True, check=False
        ).returncode
        == 0
    )


def test_every_gate_of_tests_is_among_all() -> None:
    """The marks of pytest that are left out of make test, each with its target."""
    (gates,) = re.findall(r"^GATES := (.*)$", MAKEFILE, re.M)
    marks = {"site": "docs"} | {
        mark: mark for mark in ("thorough", "attack", "digests")
    }
    options = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"][
        "pytest"
    ]["ini_options"]
    assert {each.partition(":")[0] for each in options["markers"]} == set(marks)
    assert set(gates.split()) == {
        "types",
        "test",
        "fresh",
        "browser",
        "peers",
        "ray",
        "warp",
        *marks.values(),
    }


@needs_make
@pytest.mark.parametrize("target", PHONY)
def test_every_file_that_a_target_names_is_there(target: str) -> None:
    found = re.findall(r"\btests/[\w./*-]+", make("--dry-run", target))
    for name in found:
        assert list(ROOT.glob(name.rstrip(".,;"))), name
