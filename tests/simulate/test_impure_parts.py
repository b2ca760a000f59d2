"""Parts of a user's own that are not pure: found before they fly, in one line with
file, class and method.
"""

from __future__ import annotations

import dataclasses
import os
import re
import subprocess
import sys
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import skyarm
from skyarm.records.registry.plugins import load_plugin
from skyarm.scenario.scenario_file import LIBRARY, load_scenario
from skyarm.scenario.scenario_record import JointDrive, NamedSensor, Scenario
from skyarm.scenario.without_effect import without_effect
from skyarm.simulate import examine
from skyarm.simulate.examine import TRIED, check_law, require_shapes
from support.commands import refused
from support.commands import skyarm as typed
from support.components import registry_kept
from support.flights import elsewhere

BASE = load_scenario("case1", duration=0.02)

HEAD = """
import os
import random
import time
from dataclasses import dataclass

import numpy as np

import skyarm

CALLS = []
NAMES = {"alpha", "beta", "gamma", "delta", "epsilon", "zeta", "eta"}

"""

CLASS = (
    HEAD
    + """
@skyarm.register.KIND("mine")
@dataclass(frozen=True, kw_only=True)
class Mine(skyarm.BASE):
    file: str = ""

"""
)

LAW = (
    HEAD
    + """
@skyarm.register.law("mine")
def make(model):
    base = skyarm.preset("paper_pd", model)

    def law(memory, measurement, reference, dt, *, par):
        memory, command = base.law(memory, measurement, reference, dt, par=par)
        speeds = tuple(speed + (VALUE) for speed in command.rotor_speeds)
        return memory, skyarm.Command(rotor_speeds=speeds, efforts=command.efforts)

    return skyarm.Controller(name="mine", law=law, par=base.par, memory=base.memory)
"""
)

METHODS = {
    "force": (
        "wrenches(self, memory, t, motion, rotor_speeds)",
        "(skyarm.Wrench(force_W=skyarm.Vec3(VALUE, 0.0, 0.0)),)",
        "object.__setattr__(motion.state, 'position', motion.state.velocity) or 0.0",
    ),
    "air": (
        "velocity(self, memory, t, position_W)",
        "skyarm.Vec3(VALUE, 0.0, 0.0)",
        "object.__setattr__(position_W, 'x', 0.0) or 0.0",
    ),
    "sensor": (
        "measure(self, memory, t, state, specific_force, draws, dt)",
        "memory, (VALUE + state.position.x,)",
        "object.__setattr__(state, 'velocity', state.position) or 0.0",
    ),
    "drive": (
        "effort(self, memory, setpoint, position, rate)",
        "(VALUE) + setpoint",
        "object.__setattr__(self, 'file', 'other') or 0.0",
    ),
    "ending": (
        "fine(self, scenario, state, goal, slack)",
        "state.position.z < (VALUE) + 9.0",
        "object.__setattr__(state, 'velocity', state.position) or 0.0",
    ),
    "law": (
        "law",
        "",
        "object.__setattr__(measurement, 'velocity', measurement.rate) or 0.0",
    ),
}
"""Of each kind its method, what that returns, and how it writes into what it is
given."""

IMPURE = {
    "draw": "random.random()",
    "drawn_by_numpy": "np.random.default_rng().normal()",
    "clock": "time.perf_counter()",
    "counter": "CALLS.append(0) or float(len(CALLS))",
}

ELSEWHERE = {
    "environment": "float(os.environ.get('GAIN_OF_MINE', '1.0'))",
    "needs_environment": "float(os.environ['GAIN_OF_MINE'])",
    "file": "float(np.loadtxt('gain.txt'))",
    # of the whole order
    "set": "float(sum(9**k * ord(name[0]) for k, name in enumerate(NAMES)))",
}


@pytest.fixture(autouse=True)
def _kept():
    with registry_kept():
        yield


def text(kind: str, value: str) -> str:
    if kind == "law":
        return LAW.replace("VALUE", value)
    method, result, _ = METHODS[kind]
    head = CLASS.replace("KIND", kind).replace("BASE", kind.capitalize())
    status = "    status = 'gone'\n\n" if kind == "ending" else ""
    return f"{head}{status}    def {method}:\n        return {result}\n".replace(
        "VALUE", value
    )


def planned(kind: str, module: Any, **fields: Any) -> Scenario:
    if kind == "law":
        return dataclasses.replace(
            BASE, controller=module.make(BASE.controller.par.model)
        )
    part = module.Mine(**fields)
    changes: dict[str, Callable[[], Any]] = {
        "force": lambda: {"forces": (part,)},
        "air": lambda: {"air": (part,)},
        "sensor": lambda: {"sensors": (NamedSensor(name="mine", sensor=part),)},
        "drive": lambda: {"drives": (JointDrive(joint="joint2", drive=part),)},
        "ending": lambda: {"endings": (part,)},
    }
    return dataclasses.replace(BASE, **changes[kind]())


def by_python(folder: Path, kind: str, value: str) -> Scenario:
    """As a script has it: no plugin is loaded."""
    file, module = folder / "mine.py", types.ModuleType("mine")
    file.write_text(text(kind, value).replace("@skyarm.register", "# "))
    sys.modules["mine"] = module
    exec(compile(file.read_text(), str(file), "exec"), module.__dict__)
    return planned(kind, module)


def by_plugin(folder: Path, kind: str, value: str, **fields: Any) -> Scenario:
    file = folder / "mine.py"
    file.write_text(text(kind, value))
    return planned(kind, load_plugin(file), **fields)


def line_of(check: Callable[[Any], Any], scenario: Scenario) -> str:
    with pytest.raises(ValueError, match=r"mine\.py:\d+: ") as caught:
        check(scenario)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def names_method(line: str, kind: str) -> bool:
    return (
        "law 'mine' " in line
        if kind == "law"
        else f" (Mine.{METHODS[kind][0].partition('(')[0]}) " in line
    )


@pytest.mark.parametrize("door", [by_python, by_plugin])
@pytest.mark.parametrize("kind", METHODS)
def test_what_is_frozen_at_tracing_is_found_before_it_flies(tmp_path, kind, door):
    names = (
        IMPURE
        if kind == "force"
        else ("draw", "counter")
        if door is by_python
        else ("clock",)
    )
    for name, value in ((name, IMPURE[name]) for name in names):
        (tmp_path / name).mkdir()
        with registry_kept():
            line = line_of(require_shapes, door(tmp_path / name, kind, value))
        assert f"{tmp_path / name / 'mine.py'}:" in line
        assert names_method(line, kind), line
        assert (
            "gives another program whenever it is traced: it keeps state outside its"
            " memory" in line
        )


@pytest.mark.parametrize("kind", METHODS)
def test_what_writes_into_its_arguments_is_found(tmp_path, kind):
    line = line_of(require_shapes, by_python(tmp_path, kind, METHODS[kind][2]))
    assert names_method(line, kind), line
    assert "writes to its argument '" in line


KEEPS = (
    'object.__setattr__(self, "count", getattr(self, "count", 0.0) + 1.0) or self.count'
)


@pytest.mark.parametrize(
    "value",
    [KEEPS, "setattr(motion, 'rotation', skyarm.Mat3.identity()) or 0.0"],
    ids=["attribute", "what_motion_keeps"],
)
def test_state_in_the_part_or_in_what_motion_computed_once_is_found(tmp_path, value):
    assert names_method(
        line_of(require_shapes, by_python(tmp_path, "force", value)), "force"
    )


CONVERTS = """    angle: float = 30.0

    def __post_init__(self):
        object.__setattr__(self, "angle", VALUE)
        object.__setattr__(self, "kept", self.angle + 2.0)
        object.__setattr__(self, "listed", [self.angle])

"""


def converting(
    folder: Path, value: str, used: str = "self.angle + self.kept + self.listed[0]"
) -> Path:
    """File of a part that converts a field as it is constructed."""
    file = folder / "mine.py"
    file.write_text(
        text("force", used).replace(
            '    file: str = ""\n', CONVERTS.replace("VALUE", value)
        )
    )
    return file


def test_a_field_that_the_constructor_converts_is_not_converted_twice(tmp_path):
    require_shapes(
        planned("force", load_plugin(converting(tmp_path, "self.angle * 0.0175")))
    )


def test_a_constructor_that_draws_is_found(tmp_path):
    scenario = planned("force", load_plugin(converting(tmp_path, "random.random()")))
    assert (
        " (Mine.__post_init__) gives another program whenever it is traced"
        in line_of(require_shapes, scenario)
    )


ATTRIBUTE = (
    "1.0 if hasattr(self, 'begun') else object.__setattr__(self, 'begun', True) or 0.0"
)
TABLE = "1.0 if self.kept else self.kept.update(begun=1.0) or 0.0"
FLAG = "1.0 if self.kept else object.__setattr__(self, 'kept', True) or 0.0"
KEEPERS = {
    "attribute": (ATTRIBUTE, "", ""),
    "table": (
        TABLE,
        "    def __post_init__(self):\n        object.__setattr__(self, 'kept', {})\n",
        "",
    ),
    "flag": (
        FLAG,
        (
            "    def __post_init__(self):\n        object.__setattr__(self, 'kept',"
            " False)\n"
        ),
        "",
    ),
    "field": (TABLE, "    kept: dict = field(init=False, default_factory=dict)\n", ""),
    "record in a tuple": (
        "self.subs[0].value()",
        "    subs: tuple = (Sub(),)\n",
        (
            "@dataclass(frozen=True)\nclass Sub:\n    size: float = 1.0\n    def"
            f" value(self): return {ATTRIBUTE}\n"
        ),
    ),
}
"""What a part returns that keeps something, lines of its class, and lines before it."""


@pytest.mark.parametrize("keeper", KEEPERS)
def test_what_was_refused_for_what_it_keeps_is_refused_again(tmp_path, keeper):
    """Once it has changed, it gives one program only, as if it had been constructed
    so.
    """
    value, lines, before = KEEPERS[keeper]
    written = text("force", value).replace(
        '    file: str = ""\n', f'    file: str = ""\n{lines}'
    )
    (tmp_path / "mine.py").write_text(
        written.replace("CALLS = []", f"from dataclasses import field\n{before}")
    )
    scenario = planned("force", load_plugin(tmp_path / "mine.py"))
    assert without_effect(scenario) == ()  # evaluates it, as loading a file does
    for _ in range(2):
        assert names_method(line_of(require_shapes, scenario), "force")


def test_every_flight_and_check_law_look(tmp_path):
    scenario = by_python(tmp_path, "force", IMPURE["draw"])
    for check in (skyarm.run, skyarm.Batch, skyarm.Session, check_law):
        assert names_method(line_of(check, scenario), "force")


def test_the_command_line_refuses_it_in_one_line_and_writes_nothing(
    tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    case = (
        (LIBRARY / "case1.toml")
        .read_text("utf-8")
        .replace('name = "case1"', 'name = "own"')
    )
    Path("own.toml").write_text(f'{case}\n[[environment.forces]]\nkind = "mine"\n')
    Path("mine.py").write_text(text("force", IMPURE["clock"]))
    for command in ("run", "check"):
        done = typed(command, "own.toml", "--plugin", "mine.py")
        refused(done, "mine.py:", "environment.forces[0] (Mine.wrenches)")
    assert not Path("out").exists()


@pytest.mark.parametrize(
    ("kind", "cause"),
    [
        pytest.param(
            kind,
            cause,
            marks=(
                ()
                if (kind, cause) == ("force", "environment")
                else pytest.mark.thorough
            ),
        )
        for kind in METHODS
        for cause in ELSEWHERE
    ],
)
def test_what_differs_in_another_process_is_found(
    tmp_path, monkeypatch, tried_elsewhere, kind, cause
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("GAIN_OF_MINE", "2.0")
    Path("gain.txt").write_text("3.0")
    scenario = by_plugin(tmp_path, kind, ELSEWHERE[cause])
    # what was refused once is not let through
    for _ in range(1 if kind == "force" else 2):
        line = line_of(require_shapes, scenario)
        assert (
            "in a process with an empty environment, another folder and another hash"
            " seed" in line
        )
        assert ("fails in " in line) == (cause in ("needs_environment", "file"))
        assert kind == "law" or " (Mine" in line


def test_the_place_of_two_parts_of_one_class_is_said_once(
    tmp_path, monkeypatch, tried_elsewhere
):
    ended = subprocess.CompletedProcess((), 3, stdout=b"", stderr=b"")
    monkeypatch.setattr(examine.subprocess, "run", lambda *_, **_more: ended)
    scenario = by_plugin(tmp_path, "force", "1.0")
    with pytest.warns(
        UserWarning,
        match=r"^[^,]*mine\.py:\d+: could not be tried in .*: it ended with code 3$",
    ):
        require_shapes(dataclasses.replace(scenario, forces=scenario.forces * 2))


@pytest.mark.thorough
def test_a_file_that_a_field_names_is_there_too_and_one_process_is_enough(
    tmp_path, monkeypatch, tried_elsewhere
):
    """The values of numbers are no reason for another one, nor is a worker."""
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    Path("../gain.txt").write_text("3.0")
    scenario = by_plugin(
        tmp_path, "force", "float(np.loadtxt(self.file))", file="../gain.txt"
    )
    begun, before = [], subprocess.run
    monkeypatch.setattr(
        examine.subprocess, "run", lambda *a, **k: begun.append(a) or before(*a, **k)
    )
    for _ in range(2):
        require_shapes(scenario)
    assert len(begun) == 1
    assert TRIED


@pytest.mark.thorough
def test_a_worker_starts_no_process_for_what_its_parent_tried(
    tmp_path, tried_elsewhere
):
    scenario = by_plugin(tmp_path, "force", "1.0")
    require_shapes(scenario)
    assert elsewhere(_tried) == TRIED


def _tried() -> set[str]:
    return TRIED


@pytest.mark.thorough
def test_a_plugin_that_cannot_be_loaded_there_is_refused(
    tmp_path, monkeypatch, tried_elsewhere
):
    monkeypatch.setenv("GAIN_OF_MINE", "2.0")
    file = tmp_path / "mine.py"
    file.write_text(
        text("air", "GAIN").replace(
            "CALLS", "GAIN = float(os.environ['GAIN_OF_MINE'])\nCALLS"
        )
    )
    scenario = planned("air", load_plugin(file))
    with pytest.raises(
        ValueError,
        match=(
            r"mine\.py': line \d+: KeyError: 'GAIN_OF_MINE' in a process with an empty"
        ),
    ):
        require_shapes(scenario)


@pytest.mark.thorough
@pytest.mark.parametrize(
    "value", ["random.random()", "float(os.environ['GAIN_OF_MINE'])"]
)
def test_what_a_plugin_draws_or_reads_as_it_is_loaded_is_found(
    tmp_path, monkeypatch, tried_elsewhere, value
):
    monkeypatch.setenv("GAIN_OF_MINE", "2.0")
    scenario = by_plugin(tmp_path, "air", "GAIN")
    del scenario
    file = tmp_path / "other.py"
    made = f"GAIN = {value} if 'GAIN_OF_MINE' in os.environ else 1.0\nCALLS"
    with registry_kept():
        file.write_text(
            text("air", "GAIN").replace("CALLS", made, 1).replace('"mine"', '"other"')
        )
        with pytest.raises(
            ValueError,
            match=(
                r"other\.py:\d+: environment\.air\[0\] \(Mine\.velocity\) gives another"
            ),
        ):
            require_shapes(planned("air", load_plugin(file)))


@pytest.mark.thorough
def test_the_environment_of_the_other_process_is_empty(tmp_path, tried_elsewhere):
    """Where this one has a hundred variables, a part cannot depend on one of them."""
    assert len(os.environ) > 5
    scenario = by_plugin(tmp_path, "air", "float(len(os.environ) > 5)")
    assert names_method(line_of(require_shapes, scenario), "air")


@pytest.mark.thorough
def test_a_conversion_in_the_constructor_is_none_elsewhere_but_what_it_reads_is(
    tmp_path, monkeypatch, tried_elsewhere
):
    monkeypatch.setenv("GAIN_OF_MINE", "2.0")
    with registry_kept():
        require_shapes(
            planned("force", load_plugin(converting(tmp_path, "self.angle * 0.0175")))
        )
    (tmp_path / "other").mkdir()
    file = converting(
        tmp_path / "other", "float(os.environ.get('GAIN_OF_MINE', '1.0'))", "0.5"
    )
    line = line_of(require_shapes, planned("force", load_plugin(file)))
    assert " (Mine.__post_init__) gives another program in a process" in line


@pytest.mark.thorough
@pytest.mark.parametrize(
    "printed", ["print('a' * 9)", "import atexit; atexit.register(print, 'last')"]
)
def test_what_a_plugin_prints_hides_no_difference(
    tmp_path, monkeypatch, tried_elsewhere, printed
):
    monkeypatch.setenv("GAIN_OF_MINE", "2.0")
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    monkeypatch.delitem(sys.modules, "beside", raising=False)
    shown = f"if 'GAIN_OF_MINE' not in os.environ: {printed}\nCALLS"
    (tmp_path / "beside.py").write_text("ONE = 1.0")
    monkeypatch.syspath_prepend(tmp_path)
    file = tmp_path / "mine.py"
    file.write_text(
        text("force", ELSEWHERE["environment"]).replace(
            "CALLS", f"import beside\n{shown}", 1
        )
    )
    assert "in a process with an empty environment" in line_of(
        require_shapes, planned("force", load_plugin(file))
    )
    assert not (tmp_path / "__pycache__").exists()


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("fails", "why"),
    [
        ("os._exit(3)", "it ended with code 3$"),
        (
            "print('lost', file=__import__('sys').stderr, flush=True) or os._exit(0)",
            "it ended with code 0: lost",
        ),
        ("time.sleep(99.0)", "no answer within 2 s"),
    ],
)
def test_a_warning_is_where_the_other_process_gives_no_answer(
    tmp_path, monkeypatch, tried_elsewhere, fails, why
):
    monkeypatch.setenv("GAIN_OF_MINE", "2.0")
    monkeypatch.setattr(examine, "SECONDS", 2.0 if "sleep" in fails else 60.0)
    file = tmp_path / "mine.py"
    file.write_text(
        text("force", "1.0").replace(
            "CALLS", f"'GAIN_OF_MINE' in os.environ or {fails}\nCALLS", 1
        )
    )
    scenario = planned("force", load_plugin(file))
    with pytest.warns(
        UserWarning,
        match=(
            rf"^{re.escape(str(file))}:\d+: could not be tried in a process .*: {why}"
        ),
    ):
        require_shapes(scenario)
    require_shapes(scenario)  # one line is enough
    monkeypatch.setattr(examine.sys, "executable", str(tmp_path / "none"))
    TRIED.clear()
    with pytest.warns(UserWarning, match=r"could not be tried in .*: \[Errno 2\]"):
        require_shapes(scenario)
