"""What travels to another process flies there as it does here: functions, classes and
records of all kinds.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import pytest
import travelling_laws

import skyarm
from skyarm.control.catalogue import LAWS, PRESETS
from skyarm.records.travel import pack, unpack
from skyarm.scenario.scenario_file import list_scenarios

UNPACKS = """
import pickle, sys, warnings
warnings.simplefilter("ignore")
from skyarm.records.travel import unpack
from travelling_laws import arrays_of
packed = pickle.load(sys.stdin.buffer)
sys.stdout.buffer.write(pickle.dumps([arrays_of(unpack(each)) for each in packed]))
"""


def _python(*arguments: str, given: bytes = b"") -> bytes:
    """What a fresh process writes."""
    paths = [str(Path(travelling_laws.__file__).parent), *sys.path]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, paths))}
    done = subprocess.run(
        [sys.executable, *arguments],
        input=given,
        capture_output=True,
        check=False,
        env=environment,
    )
    assert done.returncode == 0, done.stderr.decode()
    return done.stdout


def _flown_there(packed: Iterable[bytes]) -> list[dict[str, bytes]]:
    """Arrays of flights of scenarios that a fresh process unpacks."""
    found: list[dict[str, bytes]] = pickle.loads(
        _python("-c", UNPACKS, given=pickle.dumps(list(packed)))
    )
    return found


def _same_there(flights: dict[str, tuple[dict[str, bytes], bytes]]) -> dict[str, bool]:
    there = _flown_there(content for _, content in flights.values())
    return {
        name: here == other
        for (name, (here, _)), other in zip(flights.items(), there, strict=True)
    }


@pytest.mark.parametrize("every", [4, pytest.param(1, marks=pytest.mark.thorough)])
def test_laws_of_a_module_and_of_a_script_fly_as_where_they_were_made(
    every: int,
) -> None:
    here = {make.__name__: make for make in travelling_laws.OF_MODULES[::every]}
    of_script = pickle.loads(_python(travelling_laws.__file__))
    flights = travelling_laws.packed_flights(here) | {
        f"script: {name}": each for name, each in of_script.items()
    }
    assert len(flights) == len(here) + len(travelling_laws.OF_SCRIPTS)
    assert _same_there(flights) == dict.fromkeys(flights, True)
    plain = travelling_laws.arrays_of(
        skyarm.load_scenario("case1", controller="paper_pd", duration=0.1)
    )
    assert plain not in [arrays for arrays, _ in flights.values()]


SHIPPED = (*PRESETS, *LAWS)


def _scenario_of(name: str) -> Any:
    """Short scenario that a shipped law flies."""
    for scenario in list_scenarios():
        try:
            return skyarm.load_scenario(scenario, controller=name, duration=0.1)
        except ValueError:
            continue
    raise AssertionError(f"{name} flies nothing that ships")


@pytest.mark.thorough
@pytest.mark.parametrize(
    "names", [SHIPPED[i : i + 9] for i in range(0, len(SHIPPED), 9)]
)
def test_shipped_laws_go_by_name_and_fly_as_here(names: tuple[str, ...]) -> None:
    scenarios = {name: _scenario_of(name) for name in names}
    for each in scenarios.values():
        assert pickle.loads(pickle.dumps(each)).controller == each.controller
    flights = {
        name: (travelling_laws.arrays_of(each), pack(each))
        for name, each in scenarios.items()
    }
    assert _same_there(flights) == dict.fromkeys(names, True)


def _made(value: Any) -> Callable[[], Any]:
    def give() -> Any:
        return value, travelling_laws.NOTHING

    return give


def test_a_function_works_on_the_variables_of_its_module_and_its_own() -> None:
    again = unpack(pack(_made([1])))
    assert again() == ([1], travelling_laws.NOTHING)
    assert again.__globals__ is _made.__globals__
    assert (again.__module__, again.__qualname__) == (__name__, "_made.<locals>.give")
    assert again.__annotations__ == {"return": "Any"}


def test_what_a_function_carries_travels() -> None:
    give = _made(2)
    give.mark = "blue"  # type: ignore[attr-defined]
    assert unpack(pack(give)).mark == "blue"


def test_a_module_that_nobody_can_import_goes_by_content(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    made = type(sys)("made_of_nothing")
    monkeypatch.setitem(sys.modules, made.__name__, made)
    exec("GAIN = 3.0\ndef make():\n    return lambda x: GAIN * x", vars(made))
    content = pack(made.make())
    monkeypatch.delitem(sys.modules, made.__name__)
    assert unpack(content)(2.0) == 6.0
