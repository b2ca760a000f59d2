"""Libraries below their floors: named in one line where they are installed, with what
is needed and what to do.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from skyarm.records.files.packages import FLOORS, below_floor, installed_versions


def distribution(folder: Path, *names: str) -> str:
    for name in names:
        (folder / f"{name}.dist-info").mkdir(parents=True)
    return str(folder)


@pytest.mark.parametrize(
    ("there", "line"),
    [
        (
            "typer-0.12.5",
            "typer 0.12.5 is installed: must be at least 0.20; python -m pip install",
        ),
        (
            "llvmlite-0.44.0",
            (
                "llvmlite 0.44.0 is installed: must be at least 0.45; python -m pip"
                " install"
            ),
        ),
        ("numpy-1.9.3", "numpy 1.9.3 is installed"),  # 9 is below 26
        ("rich-12.6.0", "rich 12.6.0 is installed"),
        ("jinja2-2.11.0rc1", "jinja2 2.11.0rc1 is installed"),
        (
            "mujoco_core-3.9.0",
            (
                "mujoco-core 3.9.0 is installed: must be at least 4.0; python -m pip"
                " install"
            ),
        ),
        ("matplotlib-unknown", "matplotlib unknown is installed"),
    ],
)
def test_a_version_below_its_floor_is_named_with_what_is_needed(
    tmp_path: Path, there: str, line: str
) -> None:
    found = installed_versions(FLOORS, [distribution(tmp_path, there, "click-8.5.1")])
    assert line in (below_floor(found) or "")


@pytest.mark.parametrize(
    "there",
    ["typer-0.20", "typer-0.20.0", "typer-1.0a1", "rich-13.0.0", "numpy-2.0.0+local"],
)
def test_a_version_at_its_floor_or_above_is_fine(tmp_path: Path, there: str) -> None:
    found = installed_versions(FLOORS, [distribution(tmp_path, there)])
    assert len(found) == 1
    assert below_floor(found) is None


def test_the_first_folder_counts_and_in_it_the_newer_of_two(tmp_path: Path) -> None:
    first = distribution(tmp_path / "a", "typer-0.12.0", "typer-0.29.1")
    second = distribution(tmp_path / "b", "typer-0.1.0", "Rich-14.0.0")
    assert installed_versions(FLOORS, ["nowhere", first, second]) == {
        "typer": "0.29.1",
        "rich": "14.0.0",
    }


def test_what_is_installed_here_is_what_importlib_finds() -> None:
    from importlib.metadata import version

    assert installed_versions(FLOORS) == {name: version(name) for name in FLOORS}


def command(*words: str, path: Path) -> subprocess.CompletedProcess[str]:
    program = (
        f"import sys; sys.path.insert(0, {str(path)!r}); from skyarm.cli.main import"
        " main; main()"
    )
    return subprocess.run(
        [sys.executable, "-c", program, *words],
        capture_output=True,
        text=True,
        check=False,
    )


def test_a_command_with_an_old_library_is_one_line_not_silence(tmp_path: Path) -> None:
    distribution(tmp_path, "typer-0.12.5")
    done = command("show", path=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(
        "skyarm: typer 0.12.5 is installed: must be at least 0.20; "
    )
    assert done.stderr.count("\n") == 1


CURE = (
    "python -m pip uninstall -y mujoco, then python -m pip install --force-reinstall"
    " --no-deps mujoco-core"
)


def test_a_mujoco_that_overwrites_mujoco_core_is_named_with_the_cure(
    tmp_path: Path,
) -> None:
    """In either order of installation; a later mujoco is another package's business."""
    distribution(tmp_path / "3", "mujoco-3.17.0")
    done = command("show", path=tmp_path / "3")
    named = (
        "mujoco 3.17.0 is installed: must not stand beside mujoco-core, whose files it"
        " has too"
    )
    assert (done.returncode, done.stdout, done.stderr) == (
        2,
        "",
        f"skyarm: {named}; {CURE}\n",
    )
    told = command("doctor", path=tmp_path / "3")
    assert told.returncode == 1
    assert f"broken: {named.replace(' ', ', ', 1)} {CURE}" in " ".join(
        told.stdout.split()
    )
    load = (
        f"import sys; sys.path.insert(0, {str(tmp_path / '3')!r}); import skyarm;"
        " skyarm.run(skyarm.load_scenario('case1', duration=0.1, plant='mujoco'))"
    )
    flown = subprocess.run(
        [sys.executable, "-c", load], capture_output=True, text=True, check=False
    )
    assert named in flown.stderr
    distribution(tmp_path / "4", "mujoco-4.0.0")
    assert command("--version", path=tmp_path / "4").returncode == 0


def test_an_old_llvmlite_stops_nothing_that_does_without_it(tmp_path: Path) -> None:
    distribution(tmp_path, "llvmlite-0.44.0")
    done = command("--version", path=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
