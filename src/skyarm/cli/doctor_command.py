"""Command ``skyarm doctor``: checks of the installation and the machine code cache.

Code of others (machine code, MuJoCo, OpenGL, JAX) is tried in a process of its own: a
library that crashes there is a line here.
"""

from __future__ import annotations

import os
import platform
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from importlib import metadata

import typer

from skyarm.cli.lines import DIFFERENT
from skyarm.cli.output import bar, give, tell
from skyarm.compile.llvm import object_cache
from skyarm.compile.llvm.object_cache import MB, cache_folder, size_limit, unused_reason
from skyarm.records.files import how_to_install
from skyarm.records.files.packages import (
    FLOORS,
    REINSTALL,
    RIVAL,
    below_floor,
    installed_versions,
    rival_of_mujoco,
)
from skyarm.records.immutable import positional
from skyarm.view.pages import table_of

WORKS, MISSING, BROKEN = "works", "missing", "broken"

PATIENCE = 90.0
"""Longest duration (s) of a trial, against one that never answers: the slowest, the
first import of JAX, takes 2.4 s on two cores."""

FOR_DEVELOPERS = ("test", "docs")
"""Extras for developers only."""

MACHINE_CODE = (
    "from skyarm.compile.llvm.kernel import require_machine_code;"
    " require_machine_code(); print('LLVM')"
)

MUJOCO = """
import mujoco, sys
version = mujoco.__version__
print(version) if int(version.split(".")[0]) >= 4 else sys.exit(f"{version}, needs 4.0")
"""

OPENGL = """
from skyarm.view.picture.offscreen import offscreen
with offscreen():
    print('a context without a screen')
"""

JAX = (
    "import jax; print(', '.join(f'{d.platform} {d.device_kind}' for d in"
    " jax.devices()))"
)

TRIALS: dict[str, tuple[str, str, bool]] = {
    "machine code": (MACHINE_CODE, "python -m pip install --upgrade llvmlite", True),
    "MuJoCo": (MUJOCO, REINSTALL, True),
    "OpenGL for films": (
        OPENGL,
        "on Debian and Ubuntu: apt-get install libegl1 libgl1-mesa-dri",
        False,
    ),
    "JAX and its devices": (JAX, "", False),
}
"""Trial -> program, remedy, and whether flights need it."""


@positional
class CheckResult:
    """Result of one installation check: name, state, finding and remedy."""

    name: str
    state: str
    found: str
    remedy: str = ""
    needed: bool = False


def doctor(
    clear: bool = False,
) -> None:
    """Check the installation and the cache of machine code.

    Versions, engines, machine code, OpenGL for films, GPU, extras and the command that
    adds each; where machine code is cached and how much of it. Exit code: 0 if all that
    flights need works, 1 if not.

    Options:
        clear: remove all entries of the cache of machine code first
    """
    limit = size_limit()
    if clear:
        removed = object_cache.clear()
        give(removed={"entries": removed.entries, "bytes": removed.size})
        tell(f"removed: {removed.entries} entries, {removed.size / MB:.1f} MB")
    # who clears the cache asks about the cache, not for trials of seconds
    with bar("looking"):
        parts = [_cache()] if clear else examine()
    cached = object_cache.contents()
    cache = {
        "folder": cache_folder(),
        "entries": cached.entries,
        "bytes": cached.size,
        "most_bytes": limit,
    }
    give(works=works(parts), parts=[asdict(part) for part in parts], cache=cache)
    remedied = [part for part in parts if part.state != WORKS and part.remedy]
    tell(
        table_of(
            ("", "", ""),
            [
                (part.state, part.name, part.found)
                for part in parts
                if part not in remedied
            ],
            left=3,
        )
    )
    # each command on a line of its own, to be copied; a cure of two joins them by a
    # comma
    tell(
        *(
            f"{p.state}: {p.name}, {p.found}\n  "
            + p.remedy.replace(", python", "\n  python")
            for p in remedied
        )
    )
    if not clear:
        tell(
            "all that flights need works"
            if works(parts)
            else "something that flights need does not work"
        )
    if not works(parts):
        raise typer.Exit(DIFFERENT)


def examine() -> list[CheckResult]:
    """Check Python, libraries, extras, machine code cache and engines; returns the
    results in order of display.
    """
    from skyarm import __version__

    trials = {
        name: trial
        for name, trial in TRIALS.items()
        # JAX is an extra that is asked for only where it is installed
        if trial[0] != JAX or installed_versions(["jax"])
    }
    python = (
        f"{platform.python_version()} on {platform.system()} {platform.machine()},"
        f" {os.cpu_count() or 1} cores"
    )
    # each trial waits for a process of its own, so all run at once
    with ThreadPoolExecutor() as pool:
        tried = pool.map(lambda name: _try_program(name, *trials[name]), trials)
        return [
            CheckResult("Python", WORKS, python, needed=True),
            CheckResult("skyarm", WORKS, __version__, needed=True),
            *(*_libraries(), *_extras(), _cache(), *tried),
        ]


def _libraries() -> list[CheckResult]:
    there = installed_versions((*FLOORS, RIVAL))
    parts = []
    if rival := rival_of_mujoco(there):
        finding, _, remedy = rival.partition("; ")
        finding = finding.removeprefix(f"{RIVAL} ")
        parts.append(CheckResult(RIVAL, BROKEN, finding, remedy, needed=True))
    for name, floor in FLOORS.items():
        version = there.get(name)
        if version is not None and not below_floor({name: version}):
            parts.append(CheckResult(name, WORKS, version, needed=True))
            continue
        finding = f"needs {floor}" if version is None else f"{version}, needs {floor}"
        remedy = f"python -m pip install --upgrade '{name}>={floor}'"
        state = MISSING if version is None else BROKEN
        parts.append(CheckResult(name, state, finding, remedy, needed=True))
    return parts


def works(parts: list[CheckResult]) -> bool:
    """True if all parts of the installation that flights need are working."""
    return all(part.state == WORKS for part in parts if part.needed)


REQUIREMENT = re.compile(r"^([A-Za-z0-9._-]+).*extra == ['\"]([A-Za-z0-9._-]+)['\"]")


def extras() -> dict[str, list[str]]:
    """Packages of each optional extra of this installation, by the extra's name."""
    try:
        lines = metadata.requires("skyarm") or []
    except metadata.PackageNotFoundError:
        return {}
    packages: dict[str, list[str]] = {}
    for match in filter(None, map(REQUIREMENT.match, lines)):
        if match[2] not in FOR_DEVELOPERS:
            packages.setdefault(match[2], []).append(match[1].lower().replace("_", "-"))
    return dict(sorted(packages.items()))


def _extras() -> list[CheckResult]:
    parts = []
    for name, packages in extras().items():
        there = installed_versions(packages)
        missing = not set(packages) <= set(there)
        finding = ", ".join(
            f"{package} {there.get(package, 'is missing')}" for package in packages
        )
        state, remedy = (MISSING, how_to_install(name)) if missing else (WORKS, "")
        parts.append(CheckResult(f"extra {name}", state, finding, remedy))
    return parts


def _cache() -> CheckResult:
    """Check that compiled machine code can be cached between runs."""
    reason, folder = unused_reason(), cache_folder()
    if reason:
        remedy = "set SKYARM_CACHE to a folder of your own"
        return CheckResult("cache of code", BROKEN, reason, remedy)
    cached = object_cache.contents()
    size = (
        f"{cached.entries} entries, {cached.size / MB:.1f} MB of at most"
        f" {size_limit() / MB:g} MB (SKYARM_CACHE_SIZE)"
    )
    return CheckResult(
        "cache of code", WORKS, f"{folder}: {size}; --clear removes them"
    )


def _try_program(name: str, program: str, remedy: str, needed: bool) -> CheckResult:
    """Run a short Python program in a separate process and report whether it works."""
    state = BROKEN
    try:
        done = subprocess.run(
            [sys.executable, "-c", program],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=PATIENCE,
            check=False,
            # this installation is looked at, not what lies in the present folder, which
            # may be gone
            cwd=sys.prefix,
            env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        )
    except subprocess.TimeoutExpired:
        finding = f"no answer in {PATIENCE:g} s"
    except OSError as error:
        finding = str(error)
    else:
        finding = (
            (done.stderr if done.returncode else done.stdout).strip().splitlines()
            # the last line of an error says what is wrong
            or ["no words"]
        )[-1]
        if done.returncode == 0:
            state, remedy = WORKS, ""
        # a negative code is the signal that killed it
        elif done.returncode < 0:
            finding = f"ended by signal {-done.returncode}"
    return CheckResult(name, state, finding, remedy, needed)
