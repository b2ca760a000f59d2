"""The hooks before a commit are those of the tests: the same versions, the same
commands, nothing from elsewhere.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[2]
CONFIG = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text("utf-8"))
HOOKS: dict[str, dict[str, Any]] = {
    hook["id"]: hook for repo in CONFIG["repos"] for hook in repo["hooks"]
}


def test_every_hook_is_local_and_of_the_version_that_make_lint_runs() -> None:
    assert [repo["repo"] for repo in CONFIG["repos"]] == ["local"]
    held = (ROOT / "constraints.txt").read_text("utf-8").split()
    pins = [
        pin
        for hook in HOOKS.values()
        for pin in hook.get("additional_dependencies", ())
    ]
    assert pins
    assert set(pins) <= set(held)
    assert all(
        hook["language"] == "pygrep"
        or hook["entry"].startswith(".venv/bin/")
        or hook["additional_dependencies"]
        for hook in HOOKS.values()
    )


def test_the_hooks_run_what_make_lint_runs() -> None:
    recipe = "".join(
        re.findall(
            r"^(?:lint|types):.*\n((?:\t.*\n)+)",
            (ROOT / "Makefile").read_text("utf-8"),
            re.M,
        )
    )
    lint = {
        line.split("/")[1]
        .replace(" --check src tests research", "")
        .replace(" src tests research", "")
        for line in recipe.replace("$(BIN)", "B").split("\n")
        if line
    }
    hooks = {
        hook["entry"].removeprefix(".venv/bin/").removesuffix(" --force-exclude")
        for hook in HOOKS.values()
        if hook["language"] != "pygrep"
    }
    assert hooks == lint == {"ruff check", "ruff format", "mypy", "lint-imports"}
    assert {HOOKS[name]["files"] for name in ("ruff", "ruff-format")} == {
        "^(src|tests|research)/"
    }


@pytest.mark.parametrize(
    ("hook", "bad", "good"),
    [
        ("trailing-whitespace", "a \n", "a\n b\n"),
        ("trailing-whitespace", "a\t\n", "\ta\n"),
        ("conflict", "<<<<<<< ours\n", "a <<<<<<<\n"),
        ("conflict", "=======\n", "========\n"),
        ("end-of-file", "a", "a\n"),
        ("end-of-file", "a\n\n", "a\n\nb\n"),
    ],
)
def test_a_hook_finds_what_it_is_for_and_no_more(
    hook: str, bad: str, good: str
) -> None:
    """As pre-commit searches: line by line, or the whole file with --multiline; on
    bytes.
    """

    def found(text: str) -> bool:
        pattern = re.compile(
            HOOKS[hook]["entry"].encode(), re.MULTILINE if "args" in HOOKS[hook] else 0
        )
        if "args" in HOOKS[hook]:
            return pattern.search(text.encode()) is not None
        return any(
            pattern.search(line.rstrip(b"\r\n"))
            for line in text.encode().splitlines(keepends=True)
        )

    assert found(bad)
    assert not found(good)


def test_the_files_here_pass() -> None:
    for path in (
        ROOT / name
        for name in (
            "Makefile",
            "pyproject.toml",
            "CHANGELOG.md",
            "README.md",
            "CITATION.cff",
        )
    ):
        text = path.read_bytes()
        assert not re.search(
            HOOKS["end-of-file"]["entry"].encode(), text, re.MULTILINE
        ), path.name
        assert not re.search(
            HOOKS["trailing-whitespace"]["entry"].encode(), text, re.MULTILINE
        ), path.name
