"""The workflows: every command that they run is there and runs, and they may do no more
than they must.
"""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml

from lowest import project
from skyarm.view.picture.offscreen import NEEDS
from support.cases import sampled

ROOT = Path(__file__).resolve().parents[2]
FLOWS: dict[str, dict[str, Any]] = {
    path.stem: yaml.safe_load(path.read_text("utf-8"))
    for path in (ROOT / ".github" / "workflows").glob("*.yml")
}
JOBS = {
    (flow, name): job
    for flow, found in FLOWS.items()
    for name, job in found["jobs"].items()
}
RUN = sorted(
    {step["run"] for job in JOBS.values() for step in job["steps"] if "run" in step}
)
SKYARM = [line for line in RUN if line.startswith("python -m skyarm ")]
OTHERS = {"actions": r"v\d+", "pypa/gh-action-pypi-publish": r"release/v\d+"}


def test_the_tests_run_on_the_pythons_that_are_declared() -> None:
    declared = re.findall(
        r"Programming Language :: Python :: (3\.\d+)",
        "\n".join(project()["classifiers"]),
    )
    jobs = FLOWS["tests"]["jobs"]
    assert jobs["test"]["strategy"]["matrix"]["python"] == declared
    assert jobs["smoke"]["strategy"]["matrix"] == {
        "system": ["macos-latest", "windows-latest"],
        "python": [declared[0], declared[-1]],
    }
    assert project()["requires-python"] == f">={declared[0]}"
    assert {job["runs-on"] for _, job in JOBS.items()} == {
        "ubuntu-latest",
        "${{ matrix.system }}",
    }
    assert {"test", "thorough", "lowest", "docs", "fresh", "browser", "smoke"} == set(
        jobs
    )


def test_every_gate_runs_each_night_with_what_films_need() -> None:
    flow = FLOWS["nightly"]
    assert list(flow[True]) == ["schedule", "workflow_dispatch"]
    (job,) = flow["jobs"].values()
    steps = [step["run"] for step in job["steps"] if "run" in step]
    assert steps[-1] == "make all PYTHON=python"
    assert any(
        NEEDS.endswith(step.removeprefix("sudo ").replace("--yes ", ""))
        for step in steps
    )


def test_workflows_may_read_and_the_publisher_alone_may_say_who_it_is() -> None:
    assert all(found["permissions"] == {"contents": "read"} for found in FLOWS.values())
    more = {
        name: job["permissions"]
        for (_, name), job in JOBS.items()
        if "permissions" in job
    }
    assert more == {"publish": {"id-token": "write"}}
    assert "secrets." not in "".join(
        path.read_text("utf-8") for path in (ROOT / ".github").rglob("*.yml")
    )


def test_steps_use_actions_of_a_version_only() -> None:
    for step in (
        step for job in JOBS.values() for step in job["steps"] if "uses" in step
    ):
        action, _, version = step["uses"].partition("@")
        assert re.fullmatch(OTHERS.get(action, OTHERS["actions"]), version), step[
            "uses"
        ]
        assert action in OTHERS or action.startswith("actions/"), step["uses"]
        cached = step.get("with", {}).get("cache-dependency-path", "constraints.txt")
        assert cached == "constraints.txt"


def test_a_version_is_published_from_a_tag_after_it_was_built_and_tried() -> None:
    flow = FLOWS["release"]
    assert flow[True] == {"push": {"tags": ["v*"]}}, (
        "YAML reads the key 'on' as a truth"
    )
    build, publish = flow["jobs"]["build"], flow["jobs"]["publish"]
    assert [step["run"] for step in build["steps"] if "run" in step] == [
        'python tests/release.py tag "$GITHUB_REF_NAME"',
        "make fresh PYTHON=python",
    ]
    assert (publish["needs"], publish["environment"]) == ("build", "release")
    assert not any("run" in step for step in publish["steps"]), (
        "no code of ours runs where the identity is known"
    )
    kept = [
        step["with"]
        for step in (*build["steps"], *publish["steps"])
        if "artifact" in step.get("uses", "")
    ]
    assert [(each["name"], each["path"]) for each in kept] == [("dist", "dist/")] * 2


def test_films_are_drawn_where_the_tests_run() -> None:
    steps = [step.get("run", "") for step in FLOWS["tests"]["jobs"]["test"]["steps"]]
    (packages,) = (shlex.split(step)[4:] for step in steps if "apt-get install" in step)
    assert NEEDS.endswith(f"apt-get install {' '.join(packages)}"), (
        "the packages that users are told of"
    )


def test_every_command_is_known() -> None:
    targets = set(
        re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text("utf-8"), re.M)
    )
    for line in RUN:
        words = shlex.split(line)
        if words[0] == "make":
            assert words[1] in targets, line
        elif words[0] == "sudo":
            assert words[1:] == ["apt-get", "update"] or words[1:4] == [
                "apt-get",
                "install",
                "--yes",
            ], line
        elif words[1].endswith(".py"):
            assert (ROOT / words[1]).is_file(), line
        else:
            assert words[:3] in (
                ["python", "-m", "skyarm"],
                ["python", "-m", "pip"],
            ), line
    assert len(SKYARM) >= 5


@pytest.mark.parametrize("line", sampled(SKYARM, 2))
def test_every_command_of_skyarm_runs(line: str, tmp_path: Path) -> None:
    command = [sys.executable, *shlex.split(line)[1:]]
    done = subprocess.run(
        command, capture_output=True, text=True, check=False, cwd=tmp_path
    )
    assert done.returncode == 0, done.stderr
