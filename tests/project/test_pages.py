"""Pages beside the code: the index names every page of docs, links lead somewhere,
forms of issues are whole.
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[2]
PAGES = [
    ROOT / name
    for name in ("docs/README.md", "CONTRIBUTING.md", "SECURITY.md", "README.md")
]
FORMS = sorted((ROOT / ".github" / "ISSUE_TEMPLATE").glob("*.yml"))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_to_files(page: Path) -> None:
    for target in re.findall(r"\]\(([^)#:]+)\)", page.read_text("utf-8")):
        assert (page.parent / target).exists(), target


def test_the_index_names_every_page_beside_it() -> None:
    index = ROOT / "docs" / "README.md"
    linked = set(re.findall(r"\]\(([^)#:]+)\)", index.read_text("utf-8")))
    assert {page.name for page in index.parent.glob("*.md")} - {"README.md"} <= linked


def test_files_that_pages_name_in_the_repository_are_there() -> None:
    for page in PAGES:
        for name in re.findall(
            r"`((?:tests|src|docs|\.github|examples)/[\w./-]+)`",
            page.read_text("utf-8"),
        ):
            assert (ROOT / name).exists(), f"{page.name}: {name}"


def test_the_forms_of_issues_are_whole() -> None:
    assert {path.name for path in FORMS} >= {"config.yml", "wrong.yml", "wish.yml"}
    for form in (
        yaml.safe_load(path.read_text("utf-8"))
        for path in FORMS
        if path.name != "config.yml"
    ):
        assert set(form) == {"name", "description", "labels", "body"}
        ids = [field["id"] for field in form["body"]]
        assert len(ids) == len(set(ids))
        assert all(
            field["type"] == "textarea" and field["attributes"]["label"]
            for field in form["body"]
        )


@pytest.mark.parametrize(
    ("option", "command"),
    [("--plugin", ()), ("--laws", ("run",)), ("--clear", ("doctor",))],
)
def test_the_options_that_security_names_are_options(
    option: str, command: tuple[str, ...]
) -> None:
    assert option in (ROOT / "SECURITY.md").read_text("utf-8")
    words = [sys.executable, "-m", "skyarm", *command, "--help"]
    assert (
        option
        in subprocess.run(words, capture_output=True, text=True, check=True).stdout
    )


PORTS = {
    "cli/studio_command.py": "`skyarm studio` opens a port",
    "links/autopilots/ardupilot.py": "opens ports on 127.0.0.1 for it",
    "links/autopilots/betaflight.py": "opens ports on 127.0.0.1 for it",
    "links/autopilots/betaflight_process.py": "opens ports on 127.0.0.1 for it",
    "links/autopilots/px4_ports.py": "opens ports on 127.0.0.1 for it",
    "links/joint_port.py": "opens a port for the joints of that vehicle",
    "links/outside/offboard_link.py": "`skyarm fly` opens the port that you name",
    "links/ros/ros2_node.py": (
        "Live topics (`skyarm run --ros`) open ports on 127.0.0.1"
    ),
}
"""Modules that open a port, by themselves or through ``studio/server.py`` and
``links/sockets.py``, and the words of SECURITY.md
for each."""


def test_security_names_all_that_opens_a_port() -> None:
    source, said = ROOT / "src" / "skyarm", (ROOT / "SECURITY.md").read_text("utf-8")
    opens = re.compile(
        r"(?<![\w.])(?:listening_socket|open_datagrams|socket\.socket|socket\.create_server|HTTPServer)\("
    )
    found = {
        path.relative_to(source).as_posix()
        for path in source.rglob("*.py")
        if opens.search(path.read_text("utf-8"))
    }
    assert found == {*PORTS, "view/studio/server.py", "links/sockets.py"}
    assert all(words in " ".join(said.split()) for words in PORTS.values())
