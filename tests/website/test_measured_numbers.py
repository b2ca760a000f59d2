"""No measured table without its command: blocks of the pages, entries, scripts, small
forms.
"""

from __future__ import annotations

import json
import re
import subprocess
import tomllib
from collections import Counter
from pathlib import Path

import measured_numbers
import pytest
from measured_numbers import (
    BLOCK,
    DOCS,
    LAST,
    ROOT,
    SCRIPT,
    Entry,
    blocks,
    digest,
    entries,
    filled,
    heads,
    last_line,
    main,
    modules,
    record,
    run,
    tables,
    unwrapped,
    with_tables,
)

PAGES = {
    path.relative_to(DOCS).as_posix(): path.read_text("utf-8")
    for path in sorted(DOCS.rglob("*.md"))
}
RESULTS = [
    name
    for name in PAGES
    if (
        name.startswith(("results", "data/"))
        or name in {"performance.md", "the_paper.md"}
    )
    and name != "data/shipped_suites.md"
]
"""Pages of results and of their data; the rules of suites are no results."""
HERE = [each for each in entries().values() if not each.elsewhere]
MARKS = {"site": pytest.mark.site, "thorough": pytest.mark.thorough}

NO_COMMAND = {"parts-singly", "loads-without", "links", "joint-friction"}
"""Tables of earlier versions whose command was not kept: their pages say so, and no
table is added."""

UNMEASURED = {
    "condition": "what was flown, and how",
    "letter": "letters of an equation",
    "team": "vehicles and bodies of the rows, described",
    "axis": "trials of the suite, described",
    "scenario": "the paper's experiments, described",
    "assumption": "assumptions of the reproduction",
    "what": "further assumptions of the reproduction",
    "equation of the paper": "where each equation stands in the source",
    "loop of PX4": "gains by a rule, computed",
    "vehicle": "sources and licences of logs",
}
"""First head of a table of a results page that is not measured -> what it is about."""


def outside(text: str) -> list[str]:
    """First heads of the tables of a page outside of its measured blocks."""
    return [
        each[0].strip("| ").split(" | ")[0] for each in tables(BLOCK.sub("\n", text))
    ]


def test_every_block_has_an_entry_and_every_entry_its_block() -> None:
    found = [(name, page) for page, text in PAGES.items() for name in blocks(text)]
    assert Counter(found) == Counter(
        (each.name, each.page) for each in entries().values()
    )
    for page, text in PAGES.items():
        names = re.findall(r"^<!-- measured: ([^\n]*) -->$", text, re.M)
        assert names == list(dict.fromkeys(names)) == list(blocks(text)), (
            f"{page}: a block is open or twice there"
        )
        assert text.count("<!-- /measured -->") == len(names), page


def section_of(page: str, name: str) -> str:
    """Nearest heading above a block."""
    above = PAGES[page].partition(f"<!-- measured: {name} -->")[0]
    headings: list[str] = re.findall(
        r"^#+ (.+)$", re.sub(r"^```.*?^```$", "", above, flags=re.M | re.S), re.M
    )
    return headings[-1]


@pytest.mark.parametrize("entry", entries().values(), ids=entries())
def test_a_block_has_a_table_and_says_version_machine_and_command(entry: Entry) -> None:
    body = unwrapped(blocks(PAGES[entry.page])[entry.name])
    assert tables(body), "no table"
    last = LAST.search(body)
    assert last is not None, (
        f"must end with 'skyarm VERSION, PROCESSOR, `{entry.command}`.'"
    )
    assert (last["command"] or "") == entry.command
    assert section_of(entry.page, entry.name) == entry.section


@pytest.mark.parametrize("entry", entries().values(), ids=entries())
def test_the_scripts_of_an_entry_are_there(entry: Entry) -> None:
    assert entry.way in {"prints", "writes", "compares"}
    if entry.elsewhere:
        assert len(entry.elsewhere) > 20, "a reason in words"
        assert not f"{entry.small}{entry.gate}"
    named = re.findall(
        r"\b(?:tests|examples|research)/[\w/.*-]+",
        f"{entry.command} {entry.small} {entry.gate}",
    )
    for name in named:
        assert (ROOT / name).exists(), f"{name} is not there"
    assert (
        named
        or entry.command.startswith(("skyarm ", "make "))
        or entry.name in NO_COMMAND
    ), "names no script"
    if entry.command.startswith("make "):
        target = entry.command.split()[1]
        assert re.search(
            rf"^{target}:", (ROOT / "Makefile").read_text("utf-8"), re.M
        ), target


@pytest.mark.parametrize("entry", HERE, ids=[each.name for each in HERE])
def test_a_gate_runs_every_command_at_small_size(entry: Entry) -> None:
    assert entry.minutes > 0
    if entry.gate in MARKS:
        assert entry.small, "no small form"
        assert SCRIPT.findall(entry.small) == SCRIPT.findall(entry.command), (
            "the small form runs another script"
        )
    else:
        file, _, name = entry.gate.partition("::")
        assert f"def {name}(" in (ROOT / file).read_text("utf-8"), (
            f"gate {entry.gate}: must be a mark or FILE::TEST"
        )
        assert name.startswith("test_")
    if entry.way == "compares":
        assert entry.command.startswith("pytest "), "a test compares"


def test_commands_are_shared_only_by_what_needs_no_columns() -> None:
    """Each table that is printed has a command of its own, so that its columns can be
    compared.
    """
    twice = Counter(each.command for each in HERE if each.way == "prints")
    assert [command for command, count in twice.items() if count > 1] == []


@pytest.mark.parametrize("page", RESULTS)
def test_tables_of_a_results_page_are_measured_or_about_conditions(page: str) -> None:
    assert [head for head in outside(PAGES[page]) if head not in UNMEASURED] == []


def test_every_exception_is_in_use() -> None:
    assert {each.name for each in entries().values() if not each.command} == NO_COMMAND
    assert set(UNMEASURED) <= {
        head for page in RESULTS for head in outside(PAGES[page])
    }


@pytest.mark.parametrize(
    "entry",
    [
        pytest.param(each, marks=MARKS[each.gate], id=each.name)
        for each in HERE
        if each.gate in MARKS
    ],
)
def test_the_small_form_prints_the_columns_of_the_page(entry: Entry) -> None:
    done = run(entry.small, timeout=1200)
    assert done.returncode == 0, done.stdout[-2000:]
    if entry.way == "prints":
        assert heads(done.stdout) == heads(blocks(PAGES[entry.page])[entry.name])
        assert all(len(each) > 2 for each in tables(done.stdout)), (
            "a table without rows"
        )


TOY = Entry(
    name="toy", page="toy.md", section="Toy", command="python tests/toy.py", minutes=1.0
)
TABLE = "| a | b |\n|-|-:|\n| 1 | 2 |"
PAGE = (
    f"# Toy\n\n<!-- measured: toy -->\n{TABLE}\n\nskyarm 0.1, a machine, `python"
    " old.py`.\n<!-- /measured -->\n\nEnd.\n"
)


@pytest.fixture
def toy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A clone with one page, one script and one entry."""
    for name in ("docs", "tests", "src"):
        (tmp_path / name).mkdir()
    (tmp_path / "docs" / "toy.md").write_text(PAGE, "utf-8")
    (tmp_path / "tests" / "toy.py").write_text(
        "print('| a | b |\\n|-|-:|\\n| 3 | 4 |')\nprint('and words')\n", "utf-8"
    )
    for name, place in (
        ("ROOT", "."),
        ("DOCS", "docs"),
        ("TESTS", "tests"),
        ("KEPT", "out/numbers"),
    ):
        monkeypatch.setattr(measured_numbers, name, (tmp_path / place).resolve())
    monkeypatch.setattr(measured_numbers, "entries", lambda: {"toy": TOY})
    monkeypatch.setattr(measured_numbers, "machine", lambda: "EPYC (2 cores)")
    monkeypatch.setattr(measured_numbers, "source_digest", lambda: "0" * 16)
    return tmp_path


def test_a_stale_table_is_measured_written_and_kept(
    toy: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    assert main(["--list"]) == 0
    assert capfd.readouterr().out.startswith("stale     toy ")
    assert main([]) == 0
    told = capfd.readouterr().out
    assert "1 of 1  toy: python tests/toy.py" in told
    page = (toy / "docs" / "toy.md").read_text("utf-8")
    assert "<!-- measured: toy -->\n| a | b |\n|-|-:|\n| 3 | 4 |\n\nskyarm " in page
    assert (
        ", EPYC (2 cores), `python tests/toy.py`.\n<!-- /measured -->\n\nEnd.\n" in page
    )
    assert main(["--list"]) == 0
    assert capfd.readouterr().out.startswith("fresh     toy ")
    # what is fresh is written again into its page, and not measured
    (toy / "docs" / "toy.md").write_text(PAGE, "utf-8")
    assert main([]) == 0
    assert capfd.readouterr().out.startswith("0 commands")
    assert (toy / "docs" / "toy.md").read_text("utf-8") == page


def test_a_changed_script_makes_a_table_stale_and_a_failed_one_keeps_the_page(
    toy: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    assert main(["--only", "toy"]) == 0
    before, page = digest(TOY), (toy / "docs" / "toy.md").read_text("utf-8")
    (toy / "tests" / "toy.py").write_text("raise SystemExit('broken')\n", "utf-8")
    assert digest(TOY) != before
    assert record(TOY) is None
    assert main([]) == 1
    assert "FAILED: exit code 1" in capfd.readouterr().out
    (toy / "tests" / "toy.py").write_text(
        "print('| a | c |\\n|-|-|\\n| 3 | 4 |')\n", "utf-8"
    )
    assert main([]) == 1
    assert "prints other columns" in capfd.readouterr().out
    assert (toy / "docs" / "toy.md").read_text("utf-8") == page


def test_an_unknown_name_and_a_table_of_another_machine_are_refused(
    toy: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(SystemExit, match="--only of_nothing: must be one of toy"):
        main(["--only", "of_nothing"])
    far = Entry(
        name="toy",
        page="toy.md",
        section="Toy",
        command="x",
        elsewhere="needs another machine",
    )
    monkeypatch.setattr(measured_numbers, "entries", lambda: {"toy": far})
    with pytest.raises(SystemExit, match="needs another machine"):
        main(["--only", "toy"])


def test_a_file_that_a_command_continues_is_removed_for_another_tree(toy: Path) -> None:
    rows = toy / "out" / "rows.jsonl"
    going_on = Entry(
        name="toy",
        page="toy.md",
        section="Toy",
        command=TOY.command,
        continues="out/rows.jsonl",
    )
    measured_numbers.KEPT.mkdir(parents=True)
    rows.write_text("of another tree", "utf-8")
    measured_numbers.prepare(going_on)
    assert not rows.exists()
    rows.write_text("of this tree", "utf-8")
    measured_numbers.prepare(going_on)
    assert rows.exists()


def test_a_long_last_line_is_wrapped_and_read_again() -> None:
    line = last_line(
        "0.4.0",
        "AMD EPYC (2 cores)",
        "python tests/control/measure_boxes.py --bandwidth 0.7 --seeds 2 9",
    )
    assert max(map(len, line.splitlines())) <= 100
    assert line.count("\n") == 2
    found = LAST.search(unwrapped(f"{TABLE}\n\n{line}"))
    assert found is not None
    assert found["machine"] == "AMD EPYC (2 cores)"
    kept = {"version": "9", "machine": "m", "tables": "| a | b |\n|-|-:|\n| 5 | 6 |"}
    page = filled(PAGE, TOY, kept)
    assert "| 5 | 6 |\n\nskyarm 9, m, `python tests/toy.py`.\n" in page
    by_test = Entry(
        name="toy",
        page="toy.md",
        section="Toy",
        command="pytest tests/toy.py",
        way="compares",
    )
    assert f"{TABLE}\n\nskyarm 9, m, `pytest tests/toy.py`.\n<!--" in filled(
        PAGE, by_test, kept
    )


def test_comments_around_tables_stay_and_each_table_is_replaced_in_its_place() -> None:
    body = (
        "<!-- perfect -->\n| a |\n|-|\n| 1 |\n<!-- /perfect -->\n\n| b |\n|-|\n| 2"
        " |\n\n"
    )
    fresh = "| a |\n|-|\n| 2 |\n\n| b |\n|-|\n| 3 |\n"
    assert with_tables(body, fresh) == body.replace("| 2 |", "| 3 |").replace(
        "| 1 |", "| 2 |"
    )
    with pytest.raises(ValueError, match="1 tables for 2"):
        with_tables(body, "| a |\n|-|\n| 2 |\n")


def test_the_digest_follows_imports() -> None:
    script = ROOT / "tests" / "identify" / "measure_lags.py"
    assert {"planted_lags.py", "measured_tables.py"} <= {
        path.name for path in modules(script)
    }


def test_a_kept_record_is_plain_json_and_names_are_plain_words(toy: Path) -> None:
    assert main([]) == 0
    kept = json.loads((toy / "out" / "numbers" / "toy.json").read_text("utf-8"))
    assert set(kept) == {"version", "machine", "command", "seconds", "tables", "digest"}
    raw = tomllib.loads(measured_numbers.TABLES.read_text("utf-8"))
    assert all(re.fullmatch(r"[a-z0-9-]+", name) for name in raw)


def test_make_numbers_runs_them() -> None:
    told = subprocess.run(
        ["make", "-n", "-C", str(ROOT), "numbers"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert "tests/website/measured_numbers.py" in told.stdout
