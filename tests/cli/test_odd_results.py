"""A part whose rarely called method returns an odd thing is one line with file, method,
value and what is allowed.
"""

from __future__ import annotations

import dataclasses
import math
import re
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import skyarm
from skyarm.cli.run_command import save_logs
from skyarm.control.law_checks import memory_mistake
from skyarm.log.formats import load_log, save_log
from skyarm.records.leaves import leaves
from skyarm.scenario.endings import Divergence
from skyarm.scenario.scenario_record import first_state
from skyarm.scenario.unlikely_numbers import part_warnings
from skyarm.simulate.check_endings import Ending, find_ending
from skyarm.simulate.examine import require_shapes
from skyarm.world import Air, Force
from skyarm.world.scene.component_scenes import scene_in_log
from skyarm.world.scene.scene import Instants, Line, Scene
from skyarm.world.scene.shapes import Shape
from support.commands import refused
from support.commands import skyarm as command
from support.components import registry_kept

BASE = skyarm.load_scenario("case1", duration=0.02)

GIVEN: Any = None
"""What the methods below give."""


@dataclass(frozen=True, kw_only=True)
class Fence(Ending):
    status = "outside"

    def fine(self, scenario: Any, state: Any, goal: Any, slack: float) -> Any:
        return state.position.z < -100.0

    def cause(self, scenario: Any, state: Any, goal: Any) -> Any:
        if isinstance(GIVEN, Exception):
            raise GIVEN
        return GIVEN


@dataclass(frozen=True, kw_only=True)
class Still(Air):
    def start(self, period: float, draws: Any) -> Any:
        return GIVEN

    def advance(self, memory: Any, t: Any, dt: float, state: Any, draws: Any) -> Any:
        return memory


@dataclass(frozen=True, kw_only=True)
class Push(Force):
    def shapes(self, seen: Any) -> Any:
        return GIVEN

    def warnings(self, vehicle: Any, step: float) -> Any:
        return GIVEN


def place(method: Any) -> str:
    return f"{__file__}:{method.__code__.co_firstlineno}: {method.__qualname__}"


@pytest.fixture
def gives(monkeypatch):
    return lambda value: monkeypatch.setitem(globals(), "GIVEN", value)


@pytest.mark.parametrize("value", [None, 3.5])
def test_a_flight_whose_ending_names_no_cause_is_kept(gives, value) -> None:
    gives(value)
    log = skyarm.run(dataclasses.replace(BASE, endings=(Fence(),)))
    assert log.status == "outside"
    assert log.info["cause"] == f"{place(Fence.cause)} gives {value}: must be a text"


@pytest.mark.parametrize(
    ("error", "words"),
    [(KeyError("gate"), "'gate'"), (RuntimeError("one\ntwo"), "one two")],
)
def test_a_cause_that_fails_is_the_cause_of_the_end(gives, error, words) -> None:
    gives(error)
    start = first_state(BASE)
    ended = find_ending(
        dataclasses.replace(BASE, endings=(Fence(),)),
        0.0,
        leaves(start),
        [*start.position],
    )
    assert ended is not None
    assert re.fullmatch(
        rf"{re.escape(__file__)}:\d+: {type(error).__name__}: {words}", ended.cause
    )


def test_a_cause_of_the_library_that_fails_is_a_fault_of_the_library(
    monkeypatch,
) -> None:
    monkeypatch.setattr(Divergence, "cause", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        find_ending(
            BASE, 0.0, [math.nan] * len(leaves(first_state(BASE))), [0.0, 0.0, 1.0]
        )


@pytest.mark.parametrize("value", [3, None])
def test_a_status_that_is_no_text(monkeypatch, value) -> None:
    monkeypatch.setattr(Fence, "status", value)
    with pytest.raises(
        ValueError,
        match=rf"endings\[0\] \(Fence\) has status = {value}: must be a text",
    ):
        require_shapes(dataclasses.replace(BASE, endings=(Fence(),)))


@pytest.mark.parametrize("value", [3, None, "words"])
def test_warnings_that_are_no_list(gives, value) -> None:
    gives(value)
    with pytest.raises(ValueError) as error:  # noqa: PT011
        part_warnings(dataclasses.replace(BASE, forces=(Push(),)))
    assert (
        str(error.value)
        == f"{place(Push.warnings)} gives {value!r}: must be a list of texts"
    )


@pytest.mark.parametrize("value", [["low"], ("low",), iter(["low"])])
def test_warnings_in_any_list(gives, value) -> None:
    gives(value)
    assert "environment.forces[0]: low" in part_warnings(
        dataclasses.replace(BASE, forces=(Push(),))
    )


SHAPES = {
    "none": (None, "gives None: must be a skyarm.world.scene.Scene"),
    "text": ("x", "gives 'x': must be a skyarm.world.scene.Scene"),
    "kind": (Scene(attached=(Shape("b", "object", "cone", 0, (0.1,)),)), "kind='cone'"),
    "line": (
        Scene(lines=(Line("r", np.zeros(3)),)),
        "must be with places of shape (N, K, 3) at N = 2 instants",
    ),
    "flat": (
        Scene(lines=(Line("r", np.zeros((2, 3))),)),
        "must be with places of shape (N, K, 3)",
    ),
    "deep": (
        Scene(lines=(Line("r", np.zeros((2, 5, 3, 7))),)),
        "must be with places of shape (N, K, 3)",
    ),
}


@pytest.mark.parametrize("kind", SHAPES)
def test_shapes_that_cannot_be_drawn(gives, kind) -> None:
    value, words = SHAPES[kind]
    gives(value)
    seen: Any = Instants(
        vehicle=BASE.plant.vehicle,
        times=np.zeros(2),
        position=np.zeros((2, 3)),
        quaternion=np.zeros((2, 4)),
        joints=np.zeros((2, 2)),
    )
    with pytest.raises(ValueError) as error:  # noqa: PT011
        scene_in_log([Push()], seen, lambda name: np.zeros((2, 0)))
    assert str(error.value).startswith(f"{place(Push.shapes)} gives ")
    assert words in str(error.value)


def test_a_text_is_no_memory_and_nothing_is_one(gives) -> None:
    gives("x")
    words = (
        r"\(Still\) has memory = 'x': must be a tuple or a frozen dataclass of numbers"
    )
    with pytest.raises(ValueError, match=words):
        require_shapes(dataclasses.replace(BASE, air=(Still(),)))
    assert (
        memory_mistake(None, "memory") is memory_mistake(("x", 0.0), "memory") is None
    )


@pytest.fixture
def form(monkeypatch, tmp_path):
    """Log format of ``write`` and ``read`` that do as they are set."""
    monkeypatch.chdir(tmp_path)
    own = SimpleNamespace(write=None, read=None)

    def write(log, path):
        return own.write(path)

    def read(path):
        return own.read

    with registry_kept():
        skyarm.register.log_format("odd", title="odd")(skyarm.LogFormat(write, read))
        own.at = {
            each: f"{__file__}:{each.__code__.co_firstlineno}: {each.__qualname__}"
            for each in (write, read)
        }
        own.places = [*own.at.values()]
        yield own


LOG = skyarm.run(BASE)


@pytest.mark.parametrize("value", [None, 3, "elsewhere.odd"])
def test_a_format_that_writes_nothing(form, value) -> None:
    form.write = lambda path: value
    with pytest.raises(ValueError) as error:  # noqa: PT011
        save_log(LOG, "a.odd")
    assert (
        str(error.value)
        == f"{form.places[0]} gives {value!r}: must be the path of the written file"
    )


@pytest.mark.parametrize("value", [None, 4, "a.odd", ""])
def test_a_format_that_names_no_path_but_writes_its_file(form, value) -> None:
    form.write = lambda path: path.write_text("text") and value
    assert save_log(LOG, "a.odd") == Path("a.odd")


def test_a_path_in_words_is_a_path_and_an_old_file_is_none_that_was_written(
    form,
) -> None:
    Path("a.odd").write_text("old")
    form.write = lambda path: Path("b.odd").write_text("text") and "b.odd"
    assert save_log(LOG, "a.odd") == Path("b.odd")
    form.write = lambda path: 3
    with pytest.raises(
        ValueError, match="gives 3: must be the path of the written file"
    ):
        save_log(LOG, "a.odd")


def test_a_log_that_cannot_be_written_keeps_no_other_from_its_file(form) -> None:
    Path("a.odd").write_text("earlier")
    files = [Path("a.odd"), Path("b.npz"), Path("c.odd")]
    form.write = lambda path: f"of {path}"
    with pytest.raises(ValueError, match=r"gives 'of a\.odd': must be the path"):
        save_logs(LOG, files)
    assert load_log("b.npz").time.size == LOG.time.size
    assert sorted(each.name for each in Path().iterdir()) == ["a.odd", "b.npz"]
    assert Path("a.odd").read_text() == "earlier"


def test_a_format_that_fails_midway_leaves_nothing(form) -> None:
    def fail(path: Path) -> None:
        path.write_text("half")
        raise RuntimeError("boom")

    form.write = fail
    with pytest.raises(RuntimeError, match="boom"):
        save_log(LOG, "a.odd")
    assert not Path("a.odd").exists()


def test_a_format_that_reads_no_log(form) -> None:
    Path("a.odd").write_text("a")
    form.read = "x"
    with pytest.raises(ValueError) as error:  # noqa: PT011
        load_log("a.odd")
    assert str(error.value) == f"{form.places[1]} gives 'x': must be a skyarm.Log"


@pytest.mark.parametrize(
    ("value", "code"),
    [
        (None, 0),
        (3, 3),
        (3.0, 3),
        (np.int64(3), 3),
        ({"a": 1.0}, None),
        ("3", None),
        (np.nan, None),
        (np.inf, None),
        (0.5, None),
    ],
)
def test_what_a_command_returns_is_its_exit_code(value, code) -> None:
    with registry_kept():

        @skyarm.register.command("zap", title="zap")
        def zap() -> Any:
            """Zap."""
            return value

        done = command("zap")
    if code is None:
        at = f"{__file__}:{zap.__code__.co_firstlineno}: {zap.__qualname__}"
        refused(done, f"{at} gives {value!r}: must be an exit code, or None")
    else:
        assert (done.code, done.err) == (code, "")
