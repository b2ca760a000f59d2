"""The commands that README and docs show, each run to its end: as it stands, or in
miniature where it takes minutes.

The list of commands is the indented block of docs/command_line.md under *Commands*; the
gallery of the README has more.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import shlex
import signal
import subprocess
import sys
import time
import urllib.request
from collections.abc import Mapping
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
COMMAND_LINE = (ROOT / "docs" / "command_line.md").read_text(encoding="utf-8")


def indented_lines(text: str) -> list[str]:
    """Indented lines of a text, comments taken off."""
    return [
        line.split("#")[0].strip()
        for line in text.splitlines()
        if line.startswith("    ")
    ]


LINES = indented_lines(README)
GALLERY = re.findall(r"`(skyarm [^`]+ [^`]+)`", README)
LISTED = indented_lines(
    COMMAND_LINE.partition("## Commands\n")[2].partition("\n## ")[0]
)
SHOWN = list(dict.fromkeys([*LISTED, *GALLERY]))
"""Commands of the page on the command line, then those of the README that it does not
list."""

FEW = ("--plants", "2", "--seeds", "1")

SMALLER: Mapping[str, tuple[str, ...]] = {
    "compare envelope-suite": ("--quick", "--only", "circle"),
    "compare contact-suite": ("--quick", "--only", "press_and_hold"),
    "compare team-suite": ("--seeds", "1", "--only", "perfect"),
    "compare team-suite --scenario": (),
    "compare paper-suite": (*FEW, "--only", "perfect,plants"),
    "compare --laws": (*FEW, "--only", "perfect,plants"),
    "film": ("--window", "0", "0.2", "--size", "64x64", "--fps", "10"),
}
"""Beginning of a command -> options behind its own, of which the last counts; the
longest beginning that fits."""

ELSEWHERE: Mapping[str, str] = {
    "reproduce": "tests/paper/test_reproduce_options.py::test_the_paper_is_reproduced",
    "identify design hummingbird_arm2_rotors --box": (
        "tests/identify/test_identify_design.py::test_the_design_of_the_page_prints_what_it_shows"
    ),
}
"""Beginning of a command that is minutes of compilers or searches -> the test of ``make
thorough`` that runs it."""

QUICK = ("check", "new", "show", "run", "doctor")
"""Commands shown that take seconds in any environment, without extras and without each
other's files."""


def needs_program(line: str) -> bool:
    """True for the command of an autopilot whose program, which is somebody's own, is
    not here.
    """
    return "--autopilot px4" in line and not os.environ.get("SKYARM_PX4")


def words_to_run(line: str) -> list[str]:
    """Words after ``skyarm`` that try a line of `SHOWN` by itself: the line if it is
    `QUICK`, else its help.
    """
    words = [
        word.replace("examples/", f"{ROOT}/examples/") for word in shlex.split(line)[1:]
    ]
    if words[0] not in QUICK:
        return [*words, "--help"]
    return [*words, "--duration", "1"] if words[0] == "run" else words


def run_shown(line: str) -> tuple[int, str]:
    """Exit code and output of a line ``skyarm WORDS`` in this folder; (0, "") of one
    that another test runs.
    """
    words = line.removeprefix("skyarm ").replace("examples/", f"{ROOT}/examples/")
    if words.startswith(tuple(ELSEWHERE)):
        return 0, ""
    if "studio" in words.split():
        return run_studio(shlex.split(words))
    begins = max(
        (each for each in SMALLER if words.startswith(each)), key=len, default=""
    )
    options = SMALLER.get(begins, ())
    if begins == "film" and words.split("-o ")[-1].split()[0].endswith(
        (".html", ".viser")
    ):
        # a recording is drawn where it is watched: it has no size
        options = options[:3]
    if begins.startswith("compare") and "--laws" not in words:
        # of any vehicle in the envelope; a suite of all laws takes minutes
        options = (
            *options,
            "--laws",
            "centroidal_tip" if "envelope" in begins else "paper_ct",
        )
    return run_command([*shlex.split(words), *options])


def run_command(words: list[str]) -> tuple[int, str]:
    """Exit code and output of ``skyarm WORDS``, in this process."""
    from skyarm.cli.commands import perform
    from support.components import registry_kept

    told, before = io.StringIO(), sys.argv
    sys.argv = ["skyarm", *words]
    try:
        with (
            registry_kept(),
            contextlib.redirect_stdout(told),
            contextlib.redirect_stderr(told),
        ):
            code = perform()
    except SystemExit as ended:
        code = int(ended.code or 0)
    finally:
        sys.argv = before
    return code, told.getvalue()


def run_studio(words: list[str]) -> tuple[int, str]:
    """The same of the studio, which is ended by Ctrl-C once it has opened its page."""
    command = [sys.executable, "-m", "skyarm", *words, "--no-browser", "--port", "0"]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    ) as child:
        assert child.stdout is not None
        told = child.stdout.readline()
        with urllib.request.urlopen(
            told.removeprefix("studio: ").strip(), timeout=30
        ) as answer:
            answer.read()
        time.sleep(0.5)  # a Ctrl-C before it waits for one ends it with 130
        child.send_signal(signal.SIGINT)
        return child.wait(60), told + child.stdout.read()


def code_shown() -> str:
    """The README's one block of Python."""
    (code,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    return str(code)
