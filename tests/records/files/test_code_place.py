"""Whose code a function or a class is, and where it stands."""

from __future__ import annotations

import functools
import json
import subprocess
import sys
from dataclasses import dataclass

import pytest

from skyarm.algebra import Vec3
from skyarm.control.laws.paper import decoupled_pd
from skyarm.records.files.user_code import (
    failure,
    own_code,
    own_failure,
    place_of,
    place_of_error,
)
from skyarm.records.registry.plugins import load_plugin
from skyarm.scenario.endings import Divergence
from skyarm.sensing.measurement import SensorNoise
from skyarm.world import ForceWind, MovingAir


@dataclass(frozen=True)
class Mine:
    number: float = 0.0

    def method(self) -> float:
        return self.number


@dataclass(frozen=True, slots=True)
class Bare:
    number: float = 0.0


class Inherits(Vec3):
    __slots__ = ()


def mine(x: float) -> float:
    return x


def closing(inner: object) -> object:
    return lambda: inner


@pytest.mark.parametrize(
    "thing",
    [
        load_plugin,
        Vec3,
        ForceWind,
        MovingAir,
        SensorNoise,
        Divergence,
        functools.partial(load_plugin, 1),
        json.dumps,
        len,
        3.0,
        functools.lru_cache(load_plugin),
        Bare,
        Inherits,
    ],
)
def test_what_is_ours_pythons_or_has_no_code_is_nobodys_own(thing):
    assert own_code(thing) is None


@pytest.mark.parametrize(
    "thing",
    [
        mine,
        Mine,
        Mine(),
        Mine().method,
        functools.partial(mine, 1.0),
        functools.partial(load_plugin, mine),
        functools.lru_cache(mine),
        lambda: 0,
    ],
)
def test_what_stands_elsewhere_is_someones_own(thing):
    found = own_code(thing)
    assert found is not None
    assert found.co_filename == __file__


AT_ONCE = """
from dataclasses import dataclass
import functools
from skyarm.records.files.user_code import own_code, place_of

def law(x):
    return x

@dataclass(frozen=True)
class Bare:
    number: float = 0.0

@dataclass(frozen=True, slots=True, order=True)
class Slots:
    number: float = 0.0

@dataclass(frozen=True)
class Mine:
    number: float = 0.0
    def method(self):
        return self.number

things = (law, functools.partial(law, 1), Mine, Bare, Slots, Bare(1.0))
print([own_code(each) is not None for each in things])
print(place_of(law))
"""


def test_what_python_runs_at_once_is_someones_own():
    done = subprocess.run(
        [sys.executable, "-c", AT_ONCE], capture_output=True, text=True, check=True
    )
    assert done.stdout.splitlines() == [
        "[True, True, True, False, False, False]",
        "<string>:6",
    ]


COUNTS = """
import skyarm
from dataclasses import replace

def law(memory, measurement, reference, dt, *, par):
    return (1,), skyarm.Command(rotor_speeds=(0.0,) * 4, efforts=(0.0,) * 2)

scenario = skyarm.load_scenario("case1", duration=0.1)
par = scenario.controller.par
controller = skyarm.Controller(name="counts", law=law, par=par, memory=(0,))
skyarm.run(replace(scenario, controller=controller))
"""


def test_a_law_that_python_runs_at_once_is_looked_at():
    done = subprocess.run(
        [sys.executable, "-c", COUNTS], capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert (
        "<string>:5: law 'counts' has memory[0] = 0: an int never changes"
        in done.stderr
    )


def test_a_place_is_file_and_line():
    assert place_of(mine) == f"{__file__}:{mine.__code__.co_firstlineno}"
    assert place_of(Mine) == f"{__file__}:{Mine.method.__code__.co_firstlineno}"
    assert place_of(decoupled_pd).endswith(
        f"paper.py:{decoupled_pd.__code__.co_firstlineno}"
    )
    assert place_of(len) == "len"


def test_an_error_is_told_at_the_innermost_own_line(tmp_path):
    def fails() -> None:
        json.loads("{")  # the library's line is not told

    with pytest.raises(ValueError, match="Expecting") as caught:
        fails()
    line = fails.__code__.co_firstlineno + 1
    assert place_of_error(caught.value) == f"{__file__}:{line}"
    assert failure(caught.value).startswith(
        f"{__file__}:{line}: JSONDecodeError: Expecting"
    )
    ours = ValueError("never raised")
    assert (place_of_error(ours), failure(ours)) == ("", "")


def refusing() -> None:
    raise ValueError("not today")


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (
            refusing,
            f"{__file__}:{refusing.__code__.co_firstlineno + 1}: ValueError: not today",
        ),
        (lambda: load_plugin("gone.py"), ""),
    ],
)
def test_an_error_is_ones_own_where_ones_own_code_raised_it(call, words):
    with pytest.raises(ValueError) as error:  # noqa: PT011
        call()
    assert own_failure(error.value) == words
