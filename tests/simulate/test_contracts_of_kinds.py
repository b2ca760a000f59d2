"""Contracts of the kinds of users' code: their arguments are the base's, and a new kind
is a row of data.
"""

from __future__ import annotations

import inspect
import random
from dataclasses import dataclass, replace
from importlib import import_module
from typing import Any

import pytest

import skyarm
from skyarm.records.registry.contract import (
    CONTRACTS,
    Contract,
    Method,
    Numbers,
    kind_mistake,
)
from skyarm.scenario.scenario_file import load_scenario
from skyarm.simulate.examine import UserPart, examine

BASE = load_scenario("case1", duration=0.02)


@pytest.mark.parametrize(
    "kind", [kind for kind, contract in CONTRACTS.items() if contract.base]
)
def test_the_arguments_of_a_contract_are_those_of_the_base_class(kind):
    contract = CONTRACTS[kind]
    module, _, name = contract.base.rpartition(".")
    base = getattr(import_module(module), name)
    start, _, given = contract.start.rstrip(")").partition("(")
    called = {name: method.arguments for name, method in contract.methods.items()} | (
        {start: given} if start else {}
    )
    assert called == {
        name: ", ".join([*inspect.signature(getattr(base, name)).parameters][1:])
        for name in called
    }


@pytest.mark.parametrize("kind", CONTRACTS)
def test_every_result_that_a_contract_names_is_looked_at(kind):
    named = {
        method.result
        for method in CONTRACTS[kind].methods.values()
        if isinstance(method.result, str)
    } - {""}
    assert all(hasattr(UserPart, f"require_{result}") for result in named)


class Horn:
    """A new kind without a memory: how loud it is."""

    def loudness(self, t: Any, state: Any) -> Any:
        return 0.0


HORN = Contract(
    "skyarm.Horn", {"loudness": Method("t, state", Numbers("a loudness", 0.0))}
)


class Tank:
    """A new kind with a memory: how full it is."""

    def start(self, period: float) -> Any:
        return (1.0,)

    def drain(self, memory: Any, dt: float, rotor_speeds: Any) -> Any:
        return memory


TANK = Contract(
    "skyarm.Tank",
    {"drain": Method("memory, dt, rotor_speeds", "memory")},
    "start(period)",
)


@pytest.fixture(autouse=True)
def _new_kinds(monkeypatch):
    for base, contract in ((Horn, HORN), (Tank, TANK)):
        monkeypatch.setattr(base, "__module__", "skyarm")
        monkeypatch.setattr(skyarm, base.__name__, base, raising=False)
        monkeypatch.setitem(CONTRACTS, base.__name__.lower(), contract)


def made(base: type, **members: Any) -> Any:
    return dataclass(frozen=True, kw_only=True)(
        type("Own", (base,), {"__module__": __name__, **members})
    )()


def test_code_that_keeps_the_contract_of_a_new_kind_has_no_mistake():
    horn = made(Horn, loudness=lambda self, t, state: 2.0 * t + state.velocity.norm())
    tank = made(
        Tank,
        drain=lambda self, memory, dt, rotor_speeds: (
            memory[0] - dt * sum(rotor_speeds),
        ),
    )
    assert (kind_mistake("horn", type(horn)), examine("horn", horn, BASE)) == (None, [])
    assert (kind_mistake("tank", type(tank)), examine("tank", tank, BASE)) == (None, [])


WRONG = {
    "signature": (
        "horn",
        lambda self, t: 0.0,
        "cannot be called as loudness(t, state)",
        "is loudness(self, t), too many positional arguments",
    ),
    "trace": (
        "horn",
        lambda self, t, state: float(t),
        "cannot be traced: float() of a traced value",
        "",
    ),
    "shape": (
        "horn",
        lambda self, t, state: (t, t),
        "gives a loudness[0], a loudness[1]",
        "must be a loudness",
    ),
    "kind": (
        "horn",
        lambda self, t, state: None,
        "gives a loudness as None",
        "must be a number",
    ),
    "pure": (
        "horn",
        lambda self, t, state: random.random() * t,
        "gives another program whenever it is traced",
        "it keeps state outside its memory: ",
    ),
    "memory": (
        "tank",
        lambda self, memory, dt, rotor_speeds: 1.0,
        "changes the structure of its memory",
        "memory is a number, must stay a tuple of 1",
    ),
    "argument": (
        "tank",
        lambda self, memory, dt, rotor_speeds: (
            object.__setattr__(self, "seen", 1) or memory
        ),
        "writes to its argument 'self'",
        "must return new records",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_mistake_in_code_of_a_new_kind_is_data(name):
    kind, method, what, instead = WRONG[name]
    members = {
        next(iter(CONTRACTS[kind].methods)): method,
        "__annotations__": {"seen": int},
        "seen": 0,
    }
    (mistake,) = examine(kind, made(Horn if kind == "horn" else Tank, **members), BASE)
    assert (mistake.file, mistake.line) == (__file__, method.__code__.co_firstlineno)
    assert mistake.owner.startswith(f"{kind} (Own")
    assert mistake.what == what
    assert mistake.instead.startswith(instead)
    assert str(mistake).startswith(
        f"{mistake.place}: {mistake.owner} {what}{instead and ': '}{instead}"
    )


def test_an_object_of_another_class_is_no_record_of_a_new_kind():
    mistake = kind_mistake("tank", Horn)
    assert mistake is not None
    assert (mistake.what, mistake.instead) == (
        "is Horn",
        "must be a subclass of skyarm.Tank",
    )


def test_each_method_that_the_loop_calls_is_called_by_its_contract():
    """Right code that needs its own start, all of its draws, the frame that it feels,
    or may answer with a truth.
    """
    drain = {
        "start": lambda self, position: (0.0,),
        "advance": lambda self, memory, setpoint, position, rate, dt: memory,
    }
    effort = lambda self, memory, setpoint, position, rate: memory[0] - position  # noqa: E731
    right = {
        "drive": made(skyarm.Drive, **drain, effort=effort),
        "ending": made(
            skyarm.Ending,
            status="own",
            fine=lambda self, scenario, state, goal, slack: True,
        ),
        "air": made(
            skyarm.Air,
            uniforms=2,
            start=lambda self, period, draws: (draws[3],),
            advance=lambda self, memory, t, dt, state, draws: (memory[0] + draws[1],),
        ),
        "sensor": made(
            skyarm.Sensor,
            feels="ee",
            feel=lambda self, memory, t, push, draws, dt: (memory, push.force.x),
        ),
    }
    for kind, record in right.items():
        place = "plant.drives.joint2" if kind == "drive" else ""
        assert examine(kind, record, BASE, place) == [], kind


def test_an_estimator_begins_with_the_model_of_the_vehicle():
    seen = []

    def start(self, vehicle):
        return seen.append(vehicle) or ()

    def step(self, memory, readings, command, dt):
        return memory, readings["state"]

    estimator = made(skyarm.Estimator, start=start, step=step)
    assert examine("estimator", estimator, BASE) == []
    assert BASE.agent.model.vehicle != BASE.agent.vehicle
    assert all(vehicle == BASE.agent.model.vehicle for vehicle in seen)


RESULTS = {
    "slope": (
        "force",
        {
            "coupled": True,
            "start": lambda self, period, draws: (1.0,),
            "slope": lambda self, memory, t, motion, rotor_speeds: 1.0,
        },
        "gives the rates of its memory in another structure",
    ),
    "logged": (
        "force",
        {
            "columns": (("height", "height", "m"),),
            "logged": lambda self, memory, motion: (None,),
        },
        "gives logged[0] as None",
    ),
    "act": (
        "force",
        {"act": lambda self, memory, t, dt, motion: (random.random(),)},
        "gives another program whenever it is traced",
    ),
    "rotor_commands": (
        "force",
        {"rotor_commands": lambda self, memory, rotors, commands: [random.random()]},
        "gives another program whenever it is traced",
    ),
    "advance": (
        "drive",
        {
            "effort": lambda self, memory, setpoint, position, rate: setpoint,
            "advance": lambda self, memory, setpoint, position, rate, dt: (position,),
        },
        "changes the structure of its memory",
    ),
}


@pytest.mark.parametrize("name", RESULTS)
def test_a_wrong_result_of_each_method_of_a_model_is_a_mistake(name):
    kind, members, what = RESULTS[name]
    base = {"force": skyarm.Force, "drive": skyarm.Drive}[kind]
    (mistake,) = examine(
        kind,
        made(base, **members),
        BASE,
        "plant.drives.joint2" if kind == "drive" else "",
    )
    assert mistake.what == what


def test_a_part_whose_name_is_no_kind_has_the_contract_of_components():
    @dataclass(frozen=True, kw_only=True)
    class Vortex(skyarm.Force):
        registered_as = "vortex"

    blown = replace(BASE, environment=replace(BASE.environment, forces=(Vortex(),)))
    assert skyarm.run(blown).status == "completed"


def test_a_metric_may_be_made_of_anything_by_an_own_constructor():
    @dataclass(frozen=True, init=False)
    class Own(skyarm.Metric):
        share: float = 1.0

        def __init__(self, *_: Any, **__: Any) -> None:
            object.__setattr__(self, "share", 1.0)

    assert kind_mistake("metric", Own) is None
