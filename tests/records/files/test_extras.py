"""The line on a missing extra: a command that works in a checkout, and one that works
from an index.
"""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

from skyarm.records.files import how_to_install, needs_extra, packages

ROOT = Path(__file__).resolve().parents[3]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
EXTRAS = PROJECT["optional-dependencies"]
NOT_ASKED_FOR = {"casadi", "docs", "test", "types"}
"""For developers; and CasADi, whose expressions only who has it hands over."""

SOURCE = {
    path.name: path.read_text("utf-8")
    for path in (ROOT / "src" / "skyarm").rglob("*.py")
}


@pytest.mark.parametrize("extra", EXTRAS)
def test_both_commands_are_named_with_the_extra_s_own_name(
    extra: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(ROOT)
    checkout, index = re.findall(
        r'python -m pip install (-e )?"([^"]+)"', needs_extra(extra)
    )
    assert checkout == ("-e ", f".[{extra}]")
    assert index == ("", f"{PROJECT['name']}[{extra}]")
    assert needs_extra(extra).startswith(f"needs the extra {extra!r}: ")
    assert how_to_install(extra).endswith(" from an index")


def test_the_folder_of_the_checkout_is_named_from_elsewhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def installed() -> str:
        (text,) = re.findall(
            r'^python -m pip install -e (".*), python -m pip install "skyarm\[gym\]"'
            r" from an index$",
            how_to_install("gym"),
        )
        return str(text)

    monkeypatch.chdir(ROOT)
    assert installed() == '".[gym]" in a checkout'
    monkeypatch.chdir(tmp_path)
    assert installed() == f'"{ROOT}[gym]" of this checkout'
    monkeypatch.setattr(packages, "SOURCE", tmp_path)  # of an installed package
    assert installed() == '".[gym]" in the folder of a checkout'
    (tmp_path / "pyproject.toml").write_text('[project]\nname = "another"\n', "utf-8")
    assert installed() == '".[gym]" in the folder of a checkout'


def test_every_extra_is_asked_for_by_that_line_and_no_other() -> None:
    asked = re.findall(
        r"(?:needs_extra|missing_extra|how_to_install)\([\"'](\w+)",
        "".join(SOURCE.values()),
    )
    assert set(asked) == set(EXTRAS) - NOT_ASKED_FOR
    assert [
        name
        for name, text in SOURCE.items()
        if "pip install" in text and "skyarm[" in text
    ] == []
