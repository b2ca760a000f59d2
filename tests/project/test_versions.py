"""Versions: declared once, held at or above what is declared, and tested as
declared.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import release
import skyarm
from lowest import (
    BUILDERS,
    CARRIED,
    CLUSTERED,
    DRIVEN,
    FLOWN,
    LEFT_OUT,
    LINTERS,
    direct,
    pins,
    project,
)
from skyarm.records.files.packages import FLOORS

ROOT = Path(__file__).resolve().parents[2]
LOWEST = dict(pin.split(";")[0].split("==") for pin in pins(direct()))


def numbers(version: str) -> tuple[int, ...]:
    return tuple(int(part) for part in re.findall(r"\d+", version))


def test_the_guard_knows_the_floors_of_the_project_file() -> None:
    assert list(FLOORS.items()) == [
        tuple(pin.split("==")) for pin in pins(project()["dependencies"])
    ]


def test_every_extra_is_tested_at_its_floor() -> None:
    extras = dict(project()["optional-dependencies"])
    assert [pin.split("==")[0] for pin in pins(extras.pop("docs"))] == list(BUILDERS)
    assert [pin.split("==")[0] for pin in pins(extras.pop("robots"))] == list(CARRIED)
    assert [pin.split("==")[0] for pin in pins(extras.pop("betaflight"))] == list(FLOWN)
    assert [pin.split("==")[0] for pin in pins(extras.pop("dynamixel"))] == list(DRIVEN)
    assert [pin.split("==")[0] for pin in pins(extras.pop("ray"))] == list(CLUSTERED)
    for name, requirements in extras.items():
        for pin in pins(requirements):
            package, version = pin.split(";")[0].split("==")
            assert LOWEST[package] == version, name


def test_the_constraints_hold_every_direct_dependency_at_or_above_its_floor() -> None:
    held = dict(
        line.lower().split("==")
        for line in (ROOT / "constraints.txt").read_text().split()
    )
    for package, version in LOWEST.items():
        assert numbers(held[package]) >= numbers(version)
    for pin in pins(project()["optional-dependencies"]["docs"]):
        name, floor = pin.split("==")
        assert held[name] == floor, (
            "the site is built by the versions that it was looked at with"
        )
    for name in LINTERS:
        floor = next(r for r in direct() if r.startswith(name)).split(">=")[1]
        assert held[name].startswith(f"{floor}.") or held[name] == floor, (
            "linters: the version that make lint runs"
        )


@pytest.mark.parametrize(
    "requirement", ["numpy", "numpy>1", "numpy>=1,<3", "numpy==1.26", "numpy[x]>=1"]
)
def test_a_requirement_without_a_plain_floor_is_refused(requirement: str) -> None:
    with pytest.raises(ValueError, match=r"must be NAME>=VERSION"):
        pins([requirement])


def test_few_tests_are_left_out_on_the_floors_and_each_has_its_reason() -> None:
    assert len(LEFT_OUT) <= 15
    for test, reason in LEFT_OUT.items():
        path, name = test.split("::")[:2]
        assert f"def {name.split('[')[0]}(" in (ROOT / path).read_text("utf-8"), test
        assert len(reason.split()) > 4, test


def test_source_citation_and_changelog_name_one_version() -> None:
    """What `python tests/release.py tag` asks for, but for the section Unreleased,
    which fills between two versions.
    """
    changelog = (ROOT / "CHANGELOG.md").read_text("utf-8")
    unreleased = re.sub(
        r"^## Unreleased\n.*?(?=^## )", "", changelog, flags=re.M | re.S
    )
    citation = (ROOT / "CITATION.cff").read_text("utf-8")
    assert (
        release.wrong_with_tag(
            f"v{skyarm.__version__}", release.version(), citation, unreleased
        )
        is None
    )
    assert release.version() == skyarm.__version__
    released = re.findall(r"^## (\d+\.\d+\.\d+) - (\d{4}-\d\d-\d\d)$", changelog, re.M)
    assert released == sorted(released, key=lambda each: numbers(each[0]), reverse=True)
    assert f"\ndate-released: {released[0][1]}\n" in citation
