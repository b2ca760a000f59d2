"""What must hold before a version is published: each check says what is wrong in one
line, and passes what is right.
"""

from __future__ import annotations

import subprocess
import sys
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

import release

CITATION = "title: x\nversion: 1.2.0\ndate-released: 2026-01-01\n"
CHANGELOG = (
    "# Changelog\n\n## Unreleased\n\n## 1.2.0 - 2026-01-01\n\n### Added\n- x\n\n##"
    " 1.1.0 - 2025-01-01\n"
)


def test_a_tag_that_is_the_version_of_everything_passes() -> None:
    assert release.wrong_with_tag("v1.2.0", "1.2.0", CITATION, CHANGELOG) is None
    assert (
        release.wrong_with_tag(
            "v1.2.0", "1.2.0", CITATION, CHANGELOG.replace("## Unreleased\n\n", "")
        )
        is None
    )


@pytest.mark.parametrize(
    ("tag", "source", "citation", "changelog", "line"),
    [
        ("v1.2.1", "1.2.0", CITATION, CHANGELOG, "tag v1.2.1: must be v1.2.0"),
        ("1.2.0", "1.2.0", CITATION, CHANGELOG, "tag 1.2.0: must be v1.2.0"),
        (
            "v1.2.0",
            "1.2.0",
            CITATION.replace("1.2.0", "1.2.0rc1"),
            CHANGELOG,
            "CITATION.cff: version must be 1.2.0",
        ),
        (
            "v1.2.0",
            "1.2.0",
            CITATION,
            CHANGELOG.replace("## 1.2.0 - 2026-01-01", "## 1.2.0"),
            "must have a section",
        ),
        (
            "v1.2.0",
            "1.2.0",
            CITATION,
            CHANGELOG.replace("## 1.2.0", "## 1x2.0"),
            "must have a section",
        ),
        (
            "v1.2.0",
            "1.2.0",
            CITATION,
            CHANGELOG.replace("## Unreleased\n", "## Unreleased\n- y\n"),
            "must move under",
        ),
    ],
)
def test_a_tag_that_does_not_fit_is_refused(
    tag: str, source: str, citation: str, changelog: str, line: str
) -> None:
    assert line in (release.wrong_with_tag(tag, source, citation, changelog) or "")


def test_a_wheel_that_lacks_a_file_or_holds_another_is_named() -> None:
    wanted = {"skyarm/__init__.py", "skyarm/view/figures/plot.css"}
    held = [*wanted, "skyarm/", "skyarm-1.0.dist-info/METADATA"]
    assert release.wrong_with_contents(held, wanted) is None
    assert (
        release.wrong_with_contents(held[1:], {held[0]} | wanted)
        == f"the wheel lacks {held[0]}"
    )
    found = release.wrong_with_contents([*held, "tests/lowest.py"], wanted)
    assert found == "the wheel holds tests/lowest.py, which is not of the package"


def test_the_package_s_own_files_are_those_that_a_wheel_must_hold() -> None:
    found = release.sources()
    assert {
        "skyarm/__init__.py",
        "skyarm/__init__.pyi",
        "skyarm/py.typed",
        "skyarm/view/pages/page.html",
    } <= found
    assert {"skyarm/paper/report.css", "skyarm/scenario/library/case1.toml"} <= found
    assert not any("__pycache__" in name for name in found)


def test_a_folder_is_weighed_as_a_disk_holds_it(tmp_path: Path) -> None:
    (tmp_path / "inner").mkdir()
    (tmp_path / "inner" / "file").write_bytes(b"x" * (3 << 20))
    assert release.megabytes(tmp_path) == pytest.approx(3.0, abs=0.05)


def command(*words: str) -> subprocess.CompletedProcess[str]:
    program = str(Path(release.__file__))
    return subprocess.run(
        [sys.executable, program, *words], capture_output=True, text=True, check=False
    )


def test_the_steps_are_commands_and_another_is_refused() -> None:
    wrong = command("tag", "v0.0.0")
    assert (wrong.returncode, wrong.stdout) == (1, "")
    assert wrong.stderr.startswith("tag v0.0.0: must be v")
    for words in ((), ("tag",), ("publish",), ("build", "now")):
        refused = command(*words)
        assert refused.returncode == 1
        assert "python tests/release.py install" in refused.stderr


PAGE = (
    "Name: skyarm\nProject-URL: Repository, https://x.org/we/arms\n\n#"
    " skyarm\n\n![a](https://x.org/a.png) [b](#b)\n"
)


def test_the_page_of_an_index_leads_to_the_repository_that_built_it() -> None:
    assert release.wrong_with_page(PAGE, "we/arms") is None
    assert (
        release.wrong_with_page(PAGE.replace("https://x.org/a", "docs/a"), "") is None
    )
    assert "docs/a.png" in (
        release.wrong_with_page(PAGE.replace("https://x.org/a", "docs/a"), "we/arms")
        or ""
    )
    assert "lacks the address of they/arms" in (
        release.wrong_with_page(PAGE, "they/arms") or ""
    )
    assert "lacks README" in (
        release.wrong_with_page(PAGE.replace("# skyarm", "# other"), "we/arms") or ""
    )


@pytest.fixture
def hook(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The file that makes the index page, without the builder that calls it."""
    interface = ModuleType("hatchling.metadata.plugin.interface")
    interface.MetadataHookInterface = type(
        "MetadataHookInterface", (), {"root": str(release.ROOT)}
    )  # type: ignore[attr-defined]
    for name in ("hatchling", "hatchling.metadata", "hatchling.metadata.plugin"):
        monkeypatch.setitem(sys.modules, name, ModuleType(name))
    monkeypatch.setitem(sys.modules, interface.__name__, interface)
    for name in ("GITHUB_SERVER_URL", "GITHUB_REPOSITORY", "GITHUB_REF_NAME"):
        monkeypatch.delenv(name, raising=False)
    loader = SourceFileLoader("hatch_build", str(release.ROOT / "hatch_build.py"))
    module = module_from_spec(spec_from_loader("hatch_build", loader))  # type: ignore[arg-type]
    loader.exec_module(module)
    return module


def test_readme_stays_as_it_is_where_no_repository_builds(hook: ModuleType) -> None:
    made: dict[str, Any] = {}
    hook.IndexPage().update(made)
    assert made == {
        "readme": {
            "content-type": "text/markdown",
            "text": (release.ROOT / "README.md").read_text("utf-8"),
        }
    }


def test_pictures_and_pages_of_readme_are_those_of_the_tag_that_is_built(
    hook: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("GITHUB_SERVER_URL", "https://x.org")
    monkeypatch.setenv("GITHUB_REPOSITORY", "we/arms")
    monkeypatch.setenv("GITHUB_REF_NAME", "v9.0.0")
    made: dict[str, Any] = {}
    hook.IndexPage().update(made)
    text = made["readme"]["text"]
    assert "](https://x.org/we/arms/raw/v9.0.0/docs/images/laws_in_wind.webp)" in text
    assert "](https://x.org/we/arms/blob/v9.0.0/docs/first_flight.md)" in text
    assert made["urls"]["Changelog"] == "https://x.org/we/arms/blob/v9.0.0/CHANGELOG.md"
    lines = [
        f"Project-URL: {name}, {address}" for name, address in made["urls"].items()
    ]
    assert release.wrong_with_page("\n".join([*lines, "", text]), "we/arms") is None
