"""Every public record made of hostile values flies, or is refused in one plain line:
never an error from inside.

The records are found by walking: what ``skyarm`` exports, and everything that scenarios
of every kind hold. A new one is tried without a line here.
"""

from __future__ import annotations

import dataclasses
import functools
import math
import typing
import warnings
from collections.abc import Callable, Iterator, Mapping
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import skyarm
from skyarm.algebra.scalars import Scalar
from skyarm.control.catalogue import LAWS
from skyarm.control.safety import with_safety_layer
from skyarm.dynamics.actuators.drive import TORQUE_DRIVE
from skyarm.records.leaves import field_names
from skyarm.simulate.loop import run_in_python
from skyarm.studies.compare.suite import PAPER_CASES
from support.cases import sampled
from support.components import same_logs
from support.flights import document

SECONDS = 0.015
"""Of a flight: three control periods."""

Place = tuple[str, ...]

HOSTILE: tuple[Any, ...] = (
    *(None, True, "", "abc", "nan", b"1", 1j, [], (), {}, {"x": 1}, object, math.sin),
    *(
        math.nan,
        math.inf,
        -math.inf,
        -1.0,
        0.0,
        -0.0,
        1e308,
        5e-324,
        0,
        -1,
        3,
        10**400,
        Fraction(1, 3),
    ),
    *(
        [3, 0, 0],
        (0.0, 0.0, 1.0),
        ["a", "b", "c"],
        [math.nan] * 3,
        [1.0, 2.0],
        [[1.0]],
        [None],
        (1.0,) * 4,
    ),
    *(
        np.float32(0.5),
        np.array(0.5),
        np.array([1.0, 2.0, 3.0]),
        np.array([math.nan] * 3),
        np.array("x"),
        np.int64(-3),
    ),
    *(
        skyarm.Vec3("a", 0.0, 0.0),
        skyarm.Vec3(math.nan, 0.0, 0.0),
        skyarm.Vec3(0.6, 0.0, 0.8),
    ),  # type: ignore[arg-type]
    *(
        skyarm.Quaternion(2.0, 0.0, 0.0, 0.0),
        skyarm.Constant(1.0),
        skyarm.Delays(),
        skyarm.Payload(mass=1.0),
    ),
)


def scenarios() -> dict[str, Callable[[], skyarm.Scenario]]:
    """Scenarios that hold between them every kind of record that ships, made when they
    are asked for.
    """
    base = functools.cache(lambda: skyarm.load_scenario("case2_gust", duration=SECONDS))
    found = {
        name: functools.partial(skyarm.load_scenario, name, duration=SECONDS)
        for name in PAPER_CASES
    }
    found["everything"] = lambda: dataclasses.replace(
        skyarm.scenario_from(document("everything")), duration=SECONDS
    )
    found["force"] = lambda: dataclasses.replace(
        base(),
        faults=(skyarm.Fault(rotor="front", effectiveness=0.9, start=0.0),),
        wind=skyarm.ForceWind(
            force_W=(1.0, 0.0, 0.0),
            gust=skyarm.Gust(peak=(1.0, 0, 0), start=0.0, duration=1.0),
        ),
    )
    found["guarded"] = lambda: dataclasses.replace(
        base(), controller=with_safety_layer(base().controller)
    )
    wall = skyarm.Surface(
        name="wall", shape="box", size=(0.1, 1.0, 1.0), position=(2.0, 0.0, 0.0)
    )
    points = (
        skyarm.ContactPoint(
            name="skid", body="base", position=(0.0, 0.0, -0.1), radius=0.01
        ),
    )
    found["contact"] = lambda: dataclasses.replace(
        base(),
        world=skyarm.Contact(
            surfaces=(wall, skyarm.Surface(name="ground")),
            points=points,
            rotor_radius=0.1,
        ),
    )
    for law in LAWS:
        found[law] = functools.partial(
            skyarm.load_scenario, "case1", duration=SECONDS, controller=law
        )
    return {name: functools.cache(make) for name, make in found.items()}


MADE = scenarios()
PAR = ("agents", "main", "controller", "par")
"""Place of the constants of the only vehicle's law."""


def places(record: Any, at: Place = ()) -> Iterator[Place]:
    """Where every field of a record and of the records in it stands."""
    if isinstance(record, tuple):
        for i, item in enumerate(record):
            yield from places(item, (*at, str(i)))
    if isinstance(record, Mapping):
        for name in record:
            yield (*at, name)
            yield from places(record[name], (*at, name))
        return
    for name in field_names(type(record)) or ():
        yield (*at, name)
        yield from places(getattr(record, name), (*at, name))


@functools.cache
def places_of(name: str) -> tuple[Place, ...]:
    """Those of a scenario, one of each field of each class: alike are alike. Of a
    law's, its constants only.
    """
    scenario, found = MADE[name](), {}
    for place in places(scenario):
        owner = functools.reduce(step, place[:-1], scenario)
        if name not in LAWS or place[: len(PAR)] == PAR:
            found.setdefault((type(owner), place[-1], place[0]), place)
    # a first memory is made by the law, and functions are laws of one's own: neither is
    # a record that users give
    own = tuple((*PAR[:-1], field) for field in ("memory", "law", "margin"))
    return tuple(place for place in found.values() if place[: len(PAR)] not in own)


def step(record: Any, name: str) -> Any:
    if isinstance(record, Mapping):
        return record[name]
    return record[int(name)] if isinstance(record, tuple) else getattr(record, name)


def replaced(record: Any, place: Place, value: Any) -> Any:
    """The record with another value at a place, every record on the way made anew."""
    if not place:
        return value
    inner = replaced(step(record, place[0]), place[1:], value)
    if isinstance(record, Mapping):
        return {
            name: inner if name == place[0] else item for name, item in record.items()
        }
    if isinstance(record, tuple):
        return tuple(
            inner if str(i) == place[0] else item for i, item in enumerate(record)
        )
    return dataclasses.replace(record, **{place[0]: inner})


def plainly(call: Callable[[], Any]) -> Any:
    """What a call gives, or None where it refuses in one plain line."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return call()
    except ValueError as error:
        assert "\n" not in str(error)
        assert type(error).__module__.startswith("skyarm") or " = " in str(error), repr(
            error
        )
        assert len(str(error)) <= 1000
    return None


@pytest.mark.parametrize(
    "name",
    sampled(list(MADE), 5, keep=("everything", "force", "guarded", "contact", "indi")),
)
@settings(max_examples=8, deadline=None, derandomize=True)
@given(data=st.data())
def test_a_scenario_flies_or_is_refused_whatever_one_of_its_fields_holds(
    name: str, data: st.DataObject
) -> None:
    place = data.draw(st.sampled_from(places_of(name)))
    value = data.draw(st.sampled_from(HOSTILE))
    scenario = plainly(lambda: replaced(MADE[name](), place, value))
    if scenario is not None and scenario.steps <= 100:
        plainly(lambda: run_in_python(scenario))


LOOKED_AT = ("everything", "indi", "force", "guarded", "centroidal", "contact")


@pytest.mark.parametrize(
    ("name", "share"),
    [
        ("everything", 10),
        *(pytest.param(name, 1, marks=pytest.mark.thorough) for name in LOOKED_AT),
    ],
)
def test_every_field_takes_or_refuses_every_hostile_value(
    name: str, share: int
) -> None:
    """Without a flight: a share of them for each field, or all, some thousand."""
    taken = 0
    for index, place in enumerate(places_of(name)):
        for value in HOSTILE[index % share :: share]:
            taken += plainly(lambda: replaced(MADE[name](), place, value)) is not None  # noqa: B023
    assert taken > 10


def exported() -> dict[str, type]:
    """Records among the names of the library."""
    found = {name: getattr(skyarm, name) for name in skyarm.__all__}
    return {
        name: kind
        for name, kind in found.items()
        if isinstance(kind, type) and field_names(kind) is not None
    }


PLAIN: dict[type, Any] = {
    float: 0.5,
    Scalar: 0.5,
    int: 1,
    str: "front",
    bool: True,
    skyarm.Vec3: skyarm.Vec3(0.0, 0.0, 1.0),
    skyarm.Quaternion: skyarm.Quaternion(1.0, 0.0, 0.0, 0.0),
    skyarm.Drive: TORQUE_DRIVE,
}


@functools.cache
def instances() -> dict[type, Any]:
    """A record of every class that the scenarios hold."""
    found: dict[type, Any] = {}

    def look(record: Any) -> None:
        for item in record if isinstance(record, tuple) else ():
            look(item)
        if field_names(type(record)) is not None:
            found.setdefault(type(record), record)
            for name in field_names(type(record)) or ():
                look(getattr(record, name))

    for name in ("everything", "force"):
        look(MADE[name]())
    return found


def of_class(kind: type) -> dict[str, Any]:
    """Plain values of the fields that a record of this class must be given."""
    if kind in instances():
        return {
            name: getattr(instances()[kind], name) for name in field_names(kind) or ()
        }
    hints = typing.get_type_hints(kind)
    required = [
        f
        for f in dataclasses.fields(kind)
        if f.default is f.default_factory is dataclasses.MISSING
    ]
    return {f.name: _plain_value(hints[f.name]) for f in required}


def _plain_value(wanted: Any) -> Any:
    if wanted in PLAIN:
        return PLAIN[wanted]
    if wanted is Any:  # a class of its own from Python 3.11 on
        return 0.5
    fitting = (
        each
        for each in instances().values()
        if isinstance(wanted, type) and isinstance(each, wanted)
    )
    return next(fitting, 0.5)


ALGEBRA = ("Vec3", "Mat3", "Quaternion")
"""What records are made of; they are made at every line of every formula, and checked
in the records that hold them."""

GIVEN_BY_US = ("Log", "LogFormat", "Mixer", "Plan")
"""A log is what a flight gives, a format is two functions; make_mixer gives a mixer,
plan a plan."""


@pytest.mark.parametrize(
    "name", [name for name in exported() if name not in (*ALGEBRA, *GIVEN_BY_US)]
)
def test_every_exported_record_is_made_or_refused(name: str) -> None:
    kind = exported()[name]
    usual, hints = of_class(kind), typing.get_type_hints(kind)
    for field in (each for each in field_names(kind) or () if hints[each] is not Any):
        refusals = 0
        for value in HOSTILE:
            refusals += plainly(lambda: kind(**usual | {field: value})) is None  # noqa: B023
        assert refusals > 5, f"{name}.{field} takes almost anything"


STATE = {
    "position": [0, 0, 1],
    "quaternion": [1, 0, 0, 0],
    "velocity": [0, 0, 0],
    "rate": np.zeros(3),
}


def test_lists_and_arrays_stand_for_vectors() -> None:
    state = skyarm.State(
        **STATE, joints=[0.1, 0], joint_rates=np.zeros(2), rotor_speeds=[0.0] * 4
    )
    assert state.position == skyarm.Vec3(0.0, 0.0, 1.0)
    assert [type(c) for c in (*state.position, *state.joints, *state.joint_rates)] == [
        float
    ] * 7
    assert skyarm.MovingAir(velocity_W=[3, 0, 0]).velocity_W == skyarm.Vec3(3.0, 0, 0)
    scenario = dataclasses.replace(
        MADE["case1"](), initial=state, wind=skyarm.MovingAir(velocity_W=[3, 0, 0])
    )
    exact = dataclasses.replace(
        scenario,
        initial=dataclasses.replace(state, joints=(0.1, 0.0)),
        wind=skyarm.MovingAir(velocity_W=skyarm.Vec3(3.0, 0, 0)),
    )
    assert same_logs(skyarm.run(scenario), skyarm.run(exact))


def test_a_state_of_whole_numbers_flies() -> None:
    whole = skyarm.State(
        position=skyarm.Vec3(0, 0, 1),
        quaternion=skyarm.Quaternion(1, 0, 0, 0),
        velocity=skyarm.Vec3(0, 0, 0),
        rate=skyarm.Vec3(0, 0, 0),
        joints=(0, 0),
        joint_rates=(0, 0),
        rotor_speeds=(500, 500, 500, 500),
    )
    scenario = dataclasses.replace(MADE["case1"](), initial=whole)
    assert skyarm.run(scenario).status == "completed"
    assert same_logs(skyarm.run(scenario), run_in_python(scenario))


@functools.cache
def begun() -> tuple[skyarm.Session, Any]:
    """A session and its start."""
    session = skyarm.Session(MADE["case1"]())
    return session, session.snapshot()


def at_its_start() -> skyarm.Session:
    session, start = begun()
    session.restore(start)
    return session


CALLS: dict[str, tuple[Callable[..., Any], tuple[Any, ...]]] = {
    "hover": (skyarm.hover, ([0, 0, 1],)),
    "run": (skyarm.run, (MADE["case1"],)),
    "Session": (skyarm.Session, (MADE["case1"],)),
    "session.step": (
        lambda value: skyarm.Session(MADE["case1"]()).step(value),
        (None,),
    ),
    "session.step of a command": (
        lambda speeds, efforts: at_its_start().step(
            skyarm.Command(rotor_speeds=speeds, efforts=efforts)
        ),
        ((500.0,) * 4, (0.0, 0.0)),
    ),
    "make_controller": (skyarm.make_controller, ("paper_ct", None)),
    "preset": (skyarm.preset, ("paper_ct", None)),
    "load_scenario": (skyarm.load_scenario, ("case1",)),
    "load_vehicle": (skyarm.load_vehicle, ("hummingbird",)),
    "with_payload": (
        lambda mass: skyarm.load_vehicle("hummingbird_arm2").with_payload(mass),
        (0.1,),
    ),
    "Payload": (
        lambda mass: skyarm.Payload(mass=mass).held_by(MADE["case1"]().plant.vehicle),
        (0.1,),
    ),
}


@pytest.mark.parametrize("name", sampled(CALLS, 2))
def test_public_functions_take_or_refuse(name: str) -> None:
    function, usual = CALLS[name]
    for i in range(len(usual)):
        for value in HOSTILE:
            given = [
                each() if callable(each) and not isinstance(each, type) else each
                for each in usual
            ]
            given[i] = value
            plainly(lambda: function(*given))  # noqa: B023


FRONT: dict[str, tuple[Callable[..., Any], str]] = {
    "Batch(3)": (
        lambda scenario, _: skyarm.Batch(3),
        "scenario = 3: must be a Scenario",
    ),
    "paths": (
        lambda scenario, _: skyarm.Batch(scenario, 5),
        "paths = 5: must be a list of paths",
    ),
    "paths, one": (
        lambda scenario, _: skyarm.Batch(scenario, "plant.gravity"),
        "paths = 'plant.gravity': must be a",
    ),
    "paths, no words": (
        lambda scenario, _: skyarm.Batch(scenario, [5]),
        r"paths = \[5\]: must be a list of paths",
    ),
    "metrics": (
        lambda scenario, _: skyarm.Batch(scenario, metrics=3),
        "metrics = 3: must be a list of names",
    ),
    "windows": (
        lambda scenario, _: skyarm.Batch(scenario, windows=3),
        "windows = 3: must be Windows or None",
    ),
    "stiffest": (
        lambda scenario, _: skyarm.Batch(scenario, stiffest=3),
        "stiffest = 3: must be Scenario or None",
    ),
    "log_every": (
        lambda scenario, _: skyarm.Batch(scenario, log_every=-1),
        "log_every = -1: must be a whole number",
    ),
    "effort": (
        lambda scenario, _: skyarm.Batch(scenario, effort=None),
        "effort = None: must be a whole number",
    ),
    "score(3)": (lambda _, log: skyarm.score(3), "log = 3: must be a Log"),
    "score, windows": (
        lambda _, log: skyarm.score(log, windows=3),
        "windows = 3: must be Windows or None",
    ),
    "score, metrics": (
        lambda _, log: skyarm.score(log, metrics=3),
        "metrics = 3: must be a list of names",
    ),
    "score, one": (
        lambda _, log: skyarm.score(log, "standard"),
        "metrics = 'standard': must be a list of names",
    ),
}


@pytest.mark.parametrize("name", FRONT)
def test_what_batches_and_scores_are_given_is_looked_at_first(name: str) -> None:
    call, words = FRONT[name]
    scenario = dataclasses.replace(MADE["case1"](), duration=0.01)
    with pytest.raises(ValueError, match=f"^{words}"):
        call(scenario, skyarm.run(scenario) if name.startswith("score") else None)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"values": 3}, "values = 3: must be a mapping"),
        (
            {"values": {}, "threads": 0},
            "threads = 0: must be a whole number, at least 1",
        ),
        (
            {"values": {}, "threads": "x"},
            "threads = 'x': must be a whole number, at least 1",
        ),
    ],
)
def test_what_a_batch_flies_is_looked_at_first(
    given: dict[str, Any], words: str
) -> None:
    batch = skyarm.Batch(dataclasses.replace(MADE["case1"](), duration=0.01), effort=0)
    with pytest.raises(skyarm.ScenarioError, match=f"^{words}"):
        batch.fly(**given)


@pytest.mark.parametrize("values", ["a", ["a"], [None, "b"], [{}]])
def test_a_batch_flies_numbers(values: Any) -> None:
    path = "controller.gains.position.x"
    batch = skyarm.Batch(MADE["case1"](), [path])
    with pytest.raises(
        skyarm.ScenarioError,
        match=(
            r"^values\['controller.gains.position.x'\] = .*must be one number for each"
            r" of [12] lanes"
        ),
    ):
        batch.fly({path: values})
