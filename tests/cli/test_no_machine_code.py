"""Where LLVM cannot build: every command says so in one line and what to do, or flies
slowly and says that.
"""

from __future__ import annotations

import importlib.abc
import itertools
import re
import sys
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import pytest

from skyarm.compile.llvm import kernel as native
from skyarm.compile.llvm.kernel import require_machine_code
from skyarm.compile.machine_code import NoMachineCodeError, llvm_needed
from skyarm.control.laws.predictive import law
from support.commands import Outcome, skyarm

ADVICE = "python -m pip install --upgrade llvmlite"
PARSING = (
    "LLVM IR parsing error\n<string>:7:21: error: expected type\n  %0 = load ptr\n   "
    "    ^"
)
LIBRARY = ("llvmlite", "llvmlite.binding")


class Broken(importlib.abc.MetaPathFinder):
    """An installed llvmlite whose shared library does not load."""

    def find_spec(self, name: str, *_: Any) -> None:
        if name.split(".", maxsplit=1)[0] == "llvmlite":
            raise OSError("libllvmlite.so: cannot open shared object file")


def absent(patch: pytest.MonkeyPatch) -> str:
    for name in LIBRARY:
        patch.setitem(sys.modules, name, None)
    return "llvmlite"


def import_raises(patch: pytest.MonkeyPatch) -> str:
    for name in [name for name in sys.modules if name.split(".")[0] == "llvmlite"]:
        patch.delitem(sys.modules, name)
    patch.setattr(sys, "meta_path", [Broken(), *sys.meta_path])
    return "libllvmlite.so: cannot open shared object file"


def raising(name: str, words: str) -> Callable[[pytest.MonkeyPatch], str]:
    """A library of which one function raises."""

    def breakage(patch: pytest.MonkeyPatch) -> str:
        import llvmlite.binding

        def refuse(*_: Any, **__: Any) -> None:
            raise RuntimeError(words)

        patch.setattr(llvmlite.binding, name, refuse)
        return words.split("\n", 1)[0]

    return breakage


def too_old(patch: pytest.MonkeyPatch) -> str:
    import llvmlite

    patch.setattr(llvmlite, "__version__", "0.44.0")
    return "0.44.0 is installed"


BREAKAGES = {
    "absent": absent,
    "import raises": import_raises,
    "too old": too_old,
    "assembly not parsed": raising("parse_assembly", PARSING),
    "code not loaded": raising(
        "create_mcjit_compiler", "Target does not support MC emission!"
    ),
    "processor unknown": raising(
        "get_host_cpu_features", "failed to retrieve host CPU features."
    ),
}


def tried(commands: Iterable[str]) -> list[Any]:
    """(cause, command): no library and a library that fails for each; the others in
    'make thorough'.
    """
    usual = ("absent", "assembly not parsed")
    every = itertools.product(BREAKAGES, commands)
    return [
        pytest.param(*each, marks=() if each[0] in usual else pytest.mark.thorough)
        for each in every
    ]


@pytest.fixture(params=list(BREAKAGES))
def cause(
    request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[str]:
    """An LLVM that cannot build, with nothing in the cache; the words of its cause."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SKYARM_CACHE", str(tmp_path / "cache"))
    # test modules may hold the library: what they hold must not be what is asked for
    with monkeypatch.context() as patch:
        native._features.cache_clear()
        law.make_engine.cache_clear()
        yield BREAKAGES[request.param](patch)
    native._features.cache_clear()


def lines_of(outcome: Outcome) -> list[str]:
    """Lines on standard error, but for progress, which a slow machine prints."""
    return [
        line
        for line in outcome.err.splitlines()
        if not re.fullmatch(r"skyarm: \w+: \d+ of \d+.*", line)
    ]


def told(outcome: Outcome, code: int, *words: str) -> None:
    assert outcome.code == code, outcome
    assert "Traceback" not in outcome.err
    lines = lines_of(outcome)
    assert len(lines) == 1, outcome.err
    assert lines[0].startswith("skyarm: no machine code here (")
    for word in words:
        assert word in lines[0], (word, lines[0])


NEED_IT = {
    "sweep": ("sweep", "robustness", "--out", "rows"),
    "margins": ("margins", "case1", "--laws", "centroidal_tip", "--instants", "0"),
    "margins along": ("margins", "case1", "--instants", "2"),
    "compare": ("compare", "--laws", "paper_ct", "--only", "perfect", "--workers", "1"),
    "compare in mujoco": (
        "compare",
        "--laws",
        "paper_ct",
        "--only",
        "perfect",
        "--plant",
        "mujoco",
    ),
    "nmpc": ("run", "case1", "--laws", "nmpc", "--duration", "0.1"),
    "nmpc in mujoco": (
        "run",
        "case1",
        "--laws",
        "nmpc",
        "--duration",
        "0.1",
        "--plant",
        "mujoco",
    ),
    "reproduce": ("reproduce", "--workers", "1"),
    "reproduce in mujoco": ("reproduce", "--workers", "1", "--plant", "mujoco"),
}


@pytest.mark.parametrize(("cause", "what"), tried(NEED_IT), indirect=["cause"])
def test_a_command_that_needs_it_says_why_and_what_to_do(cause: str, what: str) -> None:
    told(skyarm(*NEED_IT[what]), 2, cause, "needs llvmlite 0.4", ADVICE)


def test_a_flight_goes_on_in_python_and_says_how_slow(cause: str) -> None:
    outcome = skyarm("run", "case1", "--duration", "0.1", "--out", "here")
    told(
        outcome,
        0,
        cause,
        ADVICE,
        "flying as Python floats: about 150 times slower per step",
    )
    assert Path("here/case1.npz").exists()


WITHOUT_IT = {
    "run in mujoco": ("run", "case1", "--duration", "0.1", "--plant", "mujoco"),
    "list": ("show",),
    "show": ("show", "hummingbird_arm2"),
    "export-c": (
        "export",
        "--to",
        "c",
        "centroidal",
        "--vehicle",
        "hummingbird_arm2",
        "--out",
        "law.c",
    ),
}


@pytest.mark.parametrize(("cause", "what"), tried(WITHOUT_IT), indirect=["cause"])
def test_a_command_that_does_without_it_says_nothing(cause: str, what: str) -> None:
    assert cause
    outcome = skyarm(*WITHOUT_IT[what])
    assert (outcome.code, lines_of(outcome)) == (0, [])


def test_from_python_it_is_one_error_with_its_cause(cause: str) -> None:
    with pytest.raises(NoMachineCodeError) as raised:
        require_machine_code()
    assert cause in str(raised.value)
    assert "\n" not in str(raised.value)
    assert raised.value.__cause__ is not None


def test_an_installed_version_is_named() -> None:
    from importlib.metadata import version

    with (
        pytest.raises(
            NoMachineCodeError,
            match=rf"\(ValueError\).*, {version('llvmlite')} is installed;",
        ),
        llvm_needed(),
    ):
        raise ValueError


def test_too_little_memory_is_not_taken_for_a_missing_library() -> None:
    with pytest.raises(MemoryError), llvm_needed():
        raise MemoryError


@pytest.mark.parametrize(
    "what", ["a file", "below a file", "without permission", "a name too long"]
)
def test_a_cache_that_cannot_be_written_is_done_without(
    what: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "taken").write_text("")
    (tmp_path / "closed").mkdir(mode=0o500)
    folders = {
        "a file": "taken",
        "below a file": "taken/cache",
        "without permission": "closed/cache",
    }
    monkeypatch.setenv("SKYARM_CACHE", folders.get(what, "x" * 5000))
    outcome = skyarm("run", "case1", "--duration", "0.1")
    assert (outcome.code, lines_of(outcome)) == (0, [])
