"""A user's kinds of payload, fault, wind, world and signal are used in a file as those
that ship, and written back.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import pytest

import skyarm
from skyarm.records.identity import identity
from skyarm.records.immutable import immutable
from skyarm.records.plain import plain
from skyarm.records.units import Unit
from skyarm.reference.signals import Derivatives, Signal
from skyarm.scenario.grammar import grammar
from skyarm.scenario.in_flight import with_part
from skyarm.scenario.numbers import number_at
from skyarm.scenario.scenario_differences import scenario_differences
from skyarm.scenario.scenario_record import ScenarioError
from skyarm.world.contact import Contact
from skyarm.world.wind import ForceWind
from support.components import registry_kept


@immutable
class Leaking(skyarm.TimedPayload):
    """Load that loses a share of its mass a second."""

    leak: Annotated[float, Unit("1/s", "share of the mass", low=0.0, high=1.0)] = 0.0


@immutable
class Flicker(skyarm.Fault):
    """Actuator that is gone now and then."""

    period: Annotated[float, Unit("s", low=0.0, strict=True)] = 1.0


@immutable
class Thermal(ForceWind):
    """Wind with a share that rises."""

    rise: Annotated[float, Unit("N", "upwards")] = 0.0


@immutable
class Room(Contact):
    """World within walls."""

    side: Annotated[float, Unit("m", low=0.0, strict=True)] = 4.0


@immutable
class Tremble(Signal):
    """Signal of a constant value, for a test."""

    size: Annotated[float, Unit("", "in the unit of the signal")] = 0.0

    def derivatives(self, t: object) -> Derivatives:
        return self.size, 0, 0, 0, 0


TABLES = {
    "name": "own",
    "duration": 0.1,
    "plant": {"vehicle": "hummingbird_arm2_rotors"},
    "model": {"vehicle": "hummingbird_arm2"},
    "controller": {"preset": "paper_ct"},
    "reference": {
        "base": {"kind": "hover", "position": [0.0, 0.0, 1.0]},
        "yaw": {"kind": "tremble", "size": 0.01},
    },
    "environment": {
        "wind": {"mode": "thermal", "force": [0.5, 0.0, 0.0], "rise": 0.2},
        "faults": [
            {"kind": "flicker", "rotor": "front", "effectiveness": 0.9, "period": 0.5}
        ],
    },
    "payloads": [
        {"kind": "leaking", "name": "bag", "mass": 0.1, "pick": 0.05, "leak": 0.2}
    ],
    "world": {
        "kind": "room",
        "side": 6.0,
        "surfaces": [{"name": "floor", "position": [0.0, 0.0, -3.0]}],
    },
}

NUMBERS = {
    "environment.wind.rise": 0.2,
    "environment.faults.front.period": 0.5,
    "payloads.bag.leak": 0.2,
    "world.side": 6.0,
    "reference.yaw.size": 0.01,
}


@pytest.fixture(scope="module", autouse=True)
def own_kinds() -> Iterator[None]:
    with registry_kept():
        skyarm.register.payload("leaking")(Leaking)
        skyarm.register.fault("flicker")(Flicker)
        skyarm.register.force("thermal")(Thermal)
        skyarm.register.world("room")(Room)
        skyarm.register.signal("tremble")(Tremble)
        yield


def test_tables_of_own_kinds_are_read_and_fly() -> None:
    scenario = skyarm.scenario_from(TABLES)
    found = (
        scenario.payloads[0],
        scenario.faults[0],
        scenario.wind,
        scenario.world,
        scenario.reference.yaw,
    )
    assert [type(each) for each in found] == [Leaking, Flicker, Thermal, Room, Tremble]
    assert skyarm.run(scenario).status == "completed"


@pytest.mark.parametrize("path", NUMBERS)
def test_a_field_of_an_own_kind_is_readable_variable_and_bounded(path: str) -> None:
    scenario = skyarm.scenario_from(TABLES)
    assert number_at(scenario, path) == NUMBERS[path]
    changed = skyarm.with_numbers(scenario, {path: 0.3})
    assert number_at(changed, path) == 0.3
    assert identity(changed) != identity(scenario)
    if path in ("environment.faults.front.period", "world.side"):
        with pytest.raises(ValueError, match="must be above 0"):
            skyarm.with_numbers(scenario, {path: -1.0})


def test_a_field_of_an_own_kind_is_listed_and_compared_and_written(
    tmp_path: Path,
) -> None:
    scenario = skyarm.scenario_from(TABLES)
    rows = {(row.path, row.of) for row in grammar()}
    assert ("payloads[].leak", "leaking") in rows
    assert ("environment.wind.rise", "thermal") in rows
    changed = skyarm.with_numbers(scenario, NUMBERS | {"payloads.bag.leak": 0.5})
    wind = with_part(
        changed,
        "environment.wind",
        {"mode": "thermal", "force": [0.2, 0.0, 0.0], "rise": 0.4},
    )
    file = skyarm.save_scenario(tmp_path / "own.toml", wind, TABLES)
    assert identity(skyarm.load_scenario(file)) == identity(wind)
    assert 'mode = "thermal"' in file.read_text("utf-8")
    assert scenario_differences(plain(scenario), plain(changed)) == {
        "payloads.0.leak": (0.2, 0.5)
    }


LOAD = {"mass": 0.1, "pick": 1.0}


@pytest.mark.parametrize(
    ("table", "entry", "words"),
    [
        (
            "payloads",
            [{"kind": "leaky", "mass": 0.1, "pick": 1.0}],
            r"^payloads\[0\]\.kind = 'leaky': did you mean 'leaking'",
        ),
        (
            "world",
            {"kind": "rom"},
            r"^world\.kind = 'rom': did you mean 'room'\? must be one of contact, room",
        ),
        (
            "payloads",
            [{"kind": "leaking", "mass": 0.1, "pick": 1.0, "leak": 2}],
            r"^payloads\[0\]\.leak = 2\.0: must be at most 1",
        ),
    ],
)
def test_a_wrong_own_kind_is_one_line(table: str, entry: object, words: str) -> None:
    with pytest.raises(ScenarioError, match=words):
        skyarm.scenario_from(TABLES | {table: entry})


HUGE = [1e300, 0.0, 0.0]


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (
            {"environment": {"wind": {"mode": "moving_air", "velocity": HUGE}}},
            "environment.wind.velocity = 1e+300: ",
        ),
        (
            {"environment": {"wind": {"mode": "thermal", "force": HUGE}}},
            "environment.wind.force = 1e+300: ",
        ),
        (
            {"environment": {"air": [{"kind": "moving_air", "velocity": HUGE}]}},
            "environment.air[0].velocity.x = 1e+300: ",
        ),
        (
            {
                "environment": {
                    "wind": {
                        "mode": "moving_air",
                        "gust": {"velocity": HUGE, "start": 1, "duration": 1},
                    }
                }
            },
            "environment.wind.gust.velocity = 1e+300: ",
        ),
        (
            {"plant": TABLES["plant"] | {"joints": {"damping": 1e300}}},
            "plant.joints.damping = 1e+300: ",
        ),
        (
            {"plant": TABLES["plant"] | {"joints": {"damping": [0.1, 1e300]}}},
            "plant.joints.damping[1] = 1e+300: ",
        ),
        (
            {"environment": {"faults": [{"rotor": "front", "stuck": True}]}},
            "environment.faults[0].stuck = true: ",
        ),
        (
            {"environment": {"faults": [{"rotor": "front", "stuck": False}]}},
            "environment.faults[0].effectiveness: is missing; there are rotor, stuck",
        ),
        (
            {
                "environment": {
                    "faults": [
                        {"joint": "joint1", "stuck": True, "effectiveness": [1.0]}
                    ]
                }
            },
            (
                "environment.faults[0].effectiveness = {'kind': 'sum', 'signals':"
                " [1.0]}: must be left out beside stuck"
            ),
        ),
    ],
)
def test_a_message_says_the_words_of_the_file(
    more: dict[str, object], words: str
) -> None:
    with pytest.raises(ScenarioError) as caught:
        skyarm.scenario_from(TABLES | more)
    assert str(caught.value).startswith(words), str(caught.value)
