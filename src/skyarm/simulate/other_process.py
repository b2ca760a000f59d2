"""Trial of plugins in another process with an empty environment, another folder and another hash seed.

A part of a plugin that reads its environment or a file, or goes through a set, gives the same program in every trace
of one process, and another one elsewhere. Files that its fields name are no such thing: they are there, too.
"""

from __future__ import annotations

import json
import os
import pickle
import shutil
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path

from skyarm.records.files.messages import comma_list
from skyarm.records.files.user_code import own_code
from skyarm.records.leaves import is_leaf, walk
from skyarm.records.registry import RegistryError
from skyarm.records.registry.plugins import is_of_plugin, loaded_plugins
from skyarm.records.travel import luggage, pack, unload
from skyarm.scenario.scenario_record import Scenario

WHERE = "in a process with an empty environment, another folder and another hash seed"

CAUSES = "it reads the environment or a file that no field names, is made of random numbers, or goes through a set"

FAILED = "failed"
"""Key for the reason why the models of a process failed."""

KEPT = ("SYSTEMROOT", "LD_LIBRARY_PATH", "DYLD_LIBRARY_PATH", "PYTHONHOME")
"""Environment variables without which Python or NumPy may not start."""

PROGRAM = """import json, os, sys
sys.path[:] = json.loads(sys.argv[1])
out = os.dup(1)
os.dup2(2, 1)
from skyarm.simulate.other_process import answer
from skyarm.simulate.user_code import fingerprints
text = json.dumps(answer(fingerprints))
with open(out, "w") as file:
    file.write(text)"""
"""Program of the other process; plugins print to standard error, since standard output carries the answer."""

SECONDS = 120.0
"""Time (s) after which the other process is abandoned."""

DEEP = "a/b/c/d"
"""Subfolder of the other, empty folder; a field may name a file some folders above the present one."""

Found = list[dict[str, str]]
"""Fingerprints of models."""

TRIED: set[str] = set()
"""Models of plugins that this process or its parent has tried."""

ANSWERING: list[bool] = []
"""Not empty in the other process, which starts no further one."""


def try_elsewhere(
    scenario: Scenario, models: Sequence[tuple[object, object]], compare: Callable[[Found], None]
) -> None:
    """Compare the traces of user-defined models with those of another process if a plugin defines any of the models.

    Models that differ in the values of their numbers alone are tried once in a process and those that it starts. A
    warning is where no other process can be had, it gives no answer, or the scenario cannot travel there.

    Args:
        scenario: scenario with the models.
        models: the user's class or function of each model and its record.
        compare: check that raises an error of a difference.

    Raises:
        RegistryError: a plugin cannot be loaded there.
    """
    codes = [code for own, _ in models if (code := own_code(own)) is not None]
    if ANSWERING or not any(map(is_of_plugin, codes)):
        return
    values = [pair for _, record in models for pair in walk(record) if not is_leaf(pair[1])]
    places = [f"{code.co_filename}:{code.co_firstlineno}" for code in codes]
    key = repr((loaded_plugins(), places, values))
    if key in TRIED:
        return
    answered, why = None, ""
    try:
        with tempfile.TemporaryDirectory() as folder:
            here = Path(folder).resolve() / DEEP
            here.mkdir(parents=True)
            for _, value in values:
                _lend_file(value, here)
            seed = "1" if os.environ.get("PYTHONHASHSEED") == "0" else "0"
            done = subprocess.run(
                [sys.executable or "", "-B", "-c", PROGRAM, json.dumps([os.path.abspath(path) for path in sys.path])],
                input=pickle.dumps((luggage(), pack(scenario))),
                capture_output=True,
                cwd=here,
                env={"PYTHONHASHSEED": seed} | {name: os.environ[name] for name in KEPT if name in os.environ},
                timeout=SECONDS,
                check=False,
            )
        last = done.stderr.decode(errors="replace").strip().rpartition("\n")[2]
        why = f"it ended with code {done.returncode}: {last}".removesuffix(": ")
        answered = json.loads(done.stdout)
    except subprocess.TimeoutExpired:
        why = f"no answer within {SECONDS:g} s"
    except (ValueError, OSError) as error:
        why = why or str(error)
    if isinstance(answered, str):
        raise RegistryError(f"{answered} {WHERE}")
    if answered is None:
        warnings.warn(f"{comma_list(dict.fromkeys(places))}: could not be tried {WHERE}: {why}", stacklevel=2)
    else:
        compare(answered)
    TRIED.add(key)


def _lend_file(name: object, folder: Path) -> None:
    """Make a file under a relative path available under the same relative path in another folder."""
    if not isinstance(name, str) or not name or os.path.isabs(name) or not os.path.exists(name):
        return
    there = Path(os.path.normpath(folder / name))
    if there.exists() or not there.is_relative_to(folder.parents[DEEP.count("/")]):
        return
    there.parent.mkdir(parents=True, exist_ok=True)
    try:
        there.symlink_to(os.path.abspath(name))
    except OSError:
        shutil.copy(name, there)


def answer(fingerprints: Callable[..., Found]) -> Found | str:
    """Read a scenario from standard input and trace its models; return their fingerprints, or a plugin's load error."""
    ANSWERING.append(True)
    luggage_there, scenario = pickle.loads(sys.stdin.buffer.read())
    try:
        unload(luggage_there)
    except RegistryError as error:
        return str(error)
    return fingerprints(pickle.loads(scenario), anew=True)
