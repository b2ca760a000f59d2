"""Every snippet and command of the pages under docs runs: here, or in a test that is
named here. None is left.
"""

from __future__ import annotations

import ast
import importlib.util
import re
import sys
from pathlib import Path

import pytest
from page_snippets import (
    DOCS,
    ROOT,
    Block,
    Ran,
    blocks,
    commands,
    indented,
    rewritten,
    run_page,
    wrong_answers,
)
from percent_scripts import cells, run_script
from shown_pages import FRONT, PAGES, WITH_CODE, flown, missing_programs, own_blocks

from shown_commands import ELSEWHERE as ELSEWHERE_COMMANDS
from skyarm.records.registry.shipped import SHIPPED

ELSEWHERE: dict[str, tuple[str, ...]] = {
    "in_python.md": (
        "tests/test_docs_six_tasks.py::test_there_are_seven_of_twelve_lines_at_most",
    ),
    "python_api.md": (
        "tests/test_docs.py::test_the_python_shown_runs",
        "tests/test_docs_extending.py::test_the_sessions_shown_run",
        "tests/test_docs_extending.py::test_the_law_shown_by_itself_is_compiled_and_a_thousand_times_faster",
    ),
}
"""Page with indented commands, other languages or numbers of its own -> their tests;
its fences run here, too."""

OWN_FILES = {
    name: (f"tests/test_docs_{Path(name).stem}.py",)
    for name in PAGES
    if (ROOT / f"tests/test_docs_{Path(name).stem}.py").is_file()
}
"""Page -> its own file of tests, which has its name."""
ELSEWHERE |= OWN_FILES
OTHERS = {
    "command_line.md": ("tests/cli/test_machine_output.py",),
    "studio.md": ("tests/view/studio/test_studio_page.py",),
}
ELSEWHERE |= {name: tests for name, tests in OTHERS.items() if name in PAGES}
TABLES = {
    ("several_vehicles.md", "toml"): "tests/world/test_teams.py",
    ("pressing.md", "toml"): "tests/control/test_gripping.py",
    ("identification.md", "toml"): "tests/flight_data/test_table_file.py",
    ("phases.md", "toml"): "tests/simulate/test_sensed_guards.py",
    (
        "disturbances_and_payloads.md",
        "toml",
    ): "tests/simulate/test_pick_at_an_instant.py",
    ("sensors.md", "toml"): "tests/sensing/test_force_sensors.py",
    ("tip_and_tasks.md", "toml"): "tests/test_docs_of_tasks.py",
    ("scenario_files.md", "toml"): "tests/test_docs.py",
    ("scenario_plant.md", "toml"): "tests/test_docs.py",
    ("scenario_reference.md", "toml"): "tests/test_docs.py",
    ("scenario_sensors.md", "toml"): "tests/test_docs.py",
    ("scenario_world.md", "toml"): "tests/test_docs.py",
    ("tuning.md", "toml"): "tests/studies/tune/test_files_of_gains_shown.py",
    ("study_files.md", "toml"): "tests/test_docs_pictures.py",
    ("your_vehicle.md", "toml"): "tests/cli/test_mounted_arm.py",
    ("mount_an_arm.md", "toml"): "tests/cli/test_mounted_arm.py",
}
"""Page and language of tables without a name -> the file of tests that reads them."""


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder in which a page runs, from which it can import."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    return tmp_path


SLOW = {
    FRONT,
    "actuators.md",
    "add_a_law.md",
    "autopilots.md",
    "choose_a_law.md",
    "coming_from.md",
    "command_line.md",
    "comparing_laws.md",
    "disturbances_and_payloads.md",
    "environments.md",
    "export_c.md",
    "first_flight.md",
    "in_python.md",
    "how_a_flight_works.md",
    *(f"laws/{law}.md" for law in SHIPPED["law"]),
    "margins.md",
    "phases.md",
    "plan_a_flight.md",
    "planning_tasks.md",
    "pictures.md",
    "predictive_and_learned.md",
    "python_api.md",
    "results_envelope.md",
    "results_laws.md",
    "scenario_files.md",
    "sensors.md",
    "several_vehicles.md",
    "studio.md",
    "suites.md",
    "sweeps.md",
    "the_paper.md",
    "troubleshooting.md",
    "tuning.md",
    "your_vehicle.md",
}
"""Seconds each: `make docs` runs them."""


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[pytest.mark.site] if name in SLOW else [])
        for name in WITH_CODE
    ],
)
def test_a_page_runs_from_its_first_block_to_its_last_and_prints_what_it_shows(
    name: str, here: Path
) -> None:
    for module in ("gymnasium", "jax", "pinocchio", "pyarrow", "scipy", "viser"):
        if re.search(rf"\b{module}\b", PAGES[name]):
            pytest.importorskip(module)
    if missing := missing_programs(name):
        pytest.skip(
            f"needs {' and '.join(missing)}, the paths of programs that the page flies"
        )
    ran = flown(name, here)
    assert ran.answers == [], f"python tests/website/printed_answers.py --write {name}"
    if name == "python_api.md":
        # the lane of an episode in the batch keeps its instants
        assert ran.names["x"].shape[0] == 100
    assert ran.blocks > 0


def test_no_block_of_code_is_left_out() -> None:
    """Counted: a language that no rule knows, a page whose tests do not name it, code
    that is indented.
    """
    ways = {"python", "sh", "bash", "text", "mermaid", "bibtex"}
    unrun = [
        f"{name}: {block.language}"
        for name in PAGES
        if name not in ELSEWHERE
        for block in own_blocks(name)
        if block.language not in ways
        and not block.title
        and (name, block.language) not in TABLES
    ]
    assert unrun == []
    assert {
        name for name, text in PAGES.items() if name not in ELSEWHERE and indented(text)
    } == {FRONT}
    shown = sum(len(blocks(text)) for text in PAGES.values())
    assert shown > 110


@pytest.mark.parametrize(("page", "language"), TABLES)
def test_tables_without_a_name_have_tests_that_read_them(
    page: str, language: str
) -> None:
    text = (ROOT / TABLES[page, language]).read_text("utf-8")
    assert page in text
    assert f"```{language}" in text or f'"{language}"' in text


@pytest.mark.parametrize(("name", "tests"), ELSEWHERE.items(), ids=list(ELSEWHERE))
def test_blocks_that_run_elsewhere_have_tests_that_read_their_page(
    name: str, tests: tuple[str, ...]
) -> None:
    for test in tests:
        file, _, function = test.partition("::")
        text = (ROOT / file).read_text("utf-8")
        assert name in text or name in OWN_FILES, f"{file} does not read {name}"
        if function:
            assert function in {
                node.name
                for node in ast.walk(ast.parse(text))
                if isinstance(node, ast.FunctionDef)
            }


def test_a_page_that_cannot_run_fails(here: Path) -> None:
    with pytest.raises(AssertionError, match="nobody runs this"):
        run_page([Block("sh", "", "rm -r old\n")], Ran(), seconds=None)
    with pytest.raises(AssertionError, match="nothing uses this file"):
        run_page([Block("toml", "lonely.toml", "a = 1\n")], Ran(), seconds=None)
    with pytest.raises(AssertionError, match="skyarm show nothing_of_this_name"):
        run_page(
            [Block("sh", "", "skyarm show nothing_of_this_name\n")], Ran(), seconds=None
        )


PAGE = """```python
x = 0.039
print(f"{x:.3f} m")  # 0.038 m
print(f"tip {x:.3f} m\\nbase {2 * x} m, 1 s")
```

```text
tip 0.039 m
base 0.079 m, 1 s
```

<!-- varies: a time -->
```text
base 0.079 m, 17 s
```
"""


def test_answers_are_compared_to_the_digit_and_written_anew() -> None:
    ran = Ran()
    run_page(blocks(PAGE), ran, seconds=None)
    assert ran.answers == [
        ("0.038 m", "0.039 m"),
        ("base 0.079 m, 1 s", "base 0.078 m, 1 s"),
    ]
    again, fresh = Ran(), rewritten(PAGE, ran.answers)
    assert fresh == PAGE.replace("# 0.038", "# 0.039").replace(
        "0.079 m, 1 s", "0.078 m, 1 s"
    )
    run_page(blocks(fresh), again, seconds=None)
    assert again.answers == []


def test_no_part_of_a_number_and_no_line_in_another_order_counts() -> None:
    printed = "a 1.25 m\nb 2\nc 3\n"
    assert wrong_answers("a 1.25  m\n...\nc 3", printed) == []
    assert wrong_answers("a 1.2 m", printed) == [("a 1.2 m", "a 1.25 m")]
    assert wrong_answers("c 3\nb 2", printed) == [("b 2", "")]
    assert wrong_answers("d 4", printed) == [("d 4", "")]
    assert wrong_answers("d 4", printed, "not printed") == []
    assert wrong_answers("a 1.3 n", printed, "varies") == [("a 1.3 n", "")]


def test_comments_are_no_part_of_a_command() -> None:
    assert commands(
        Block("sh", "", "skyarm show   # all\n# nothing\nskyarm show a#b\n")
    ) == [
        "skyarm show",
        "skyarm show a#b",
    ]


def test_a_command_that_another_test_runs_names_a_test_that_is_there() -> None:
    for test in ELSEWHERE_COMMANDS.values():
        file, _, function = test.partition("::")
        assert f"def {function}(" in (ROOT / file).read_text("utf-8"), test


NOTEBOOKS = sorted((DOCS / "notebooks").glob("*.py"))


@pytest.mark.parametrize(
    "path",
    [
        pytest.param(
            path, marks=[] if path.stem == "sweep_notebook" else [pytest.mark.site]
        )
        for path in NOTEBOOKS
    ],
    ids=lambda path: path.stem,
)
def test_a_notebook_runs_cell_by_cell(path: Path, here: Path) -> None:
    pytest.importorskip("pyarrow")
    ran = run_script(path)
    assert ran[0][0].words, "the first cell says what it is about"
    assert re.match(r"# \S", ran[0][0].text)
    printed = "".join(shown.text for _, shown in ran)
    assert printed
    if path.stem != "own_law_notebook":
        assert sum(len(shown.figures) for _, shown in ran) == 1


def test_a_cell_keeps_the_lines_of_its_file(here: Path) -> None:
    """An error in a cell names the line that an editor shows."""
    found = cells("# %% [markdown]\n# # Title\n\n# %%\nx = 1\n\n# %%\n1 / 0\n")
    assert [(cell.words, cell.line) for cell in found] == [
        (True, 0),
        (False, 5),
        (False, 8),
    ]
    assert found[0].text == "# Title"
    with pytest.raises(ValueError, match="must begin with a cell"):
        cells("x = 1\n# %%\n")


def test_there_are_three_notebooks() -> None:
    assert len(NOTEBOOKS) >= 3
    assert importlib.util.find_spec("matplotlib") is not None
