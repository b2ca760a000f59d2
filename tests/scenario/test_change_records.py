"""Changes in flight as a scenario file says them: what is read, what is refused, what
is written back.
"""

from __future__ import annotations

import copy
import dataclasses
import datetime
import json
import math
import tomllib
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from skyarm import Scenario, ScenarioError, load_scenario, scenario_from
from skyarm.records.identity import identity
from skyarm.records.plain import digest, plain
from skyarm.records.restore import restore
from skyarm.reference import signal_from
from skyarm.scenario import readers
from skyarm.scenario.controller_table import under_law
from skyarm.scenario.in_flight import overrides_at, require_changes, stretches
from skyarm.scenario.numbers import number_at, require_apart, with_numbers
from skyarm.scenario.scenario_file import LIBRARY
from skyarm.scenario.scenario_record import Change, NamedSensor
from support.cases import sampled, toml_text
from support.components import Fix
from support.flights import FULL, document

BASE = document("case3_wind", duration=1.0)
GAIN = "controller.gains.position.x"
FRONT = {"rotor": "front", "effectiveness": 0.9, "start": 0.2}
BREEZE = {
    "mode": "moving_air",
    "velocity": [1.0, 0.0, 0.0],
    "gust": {"velocity": [1, 0, 0], "start": 0.3, "duration": 1},
}


def changing(*changes: Any, **more: Any) -> Scenario:
    return scenario_from({**BASE, **more, "changes": list(changes)})


def mass_of(scenario: Scenario) -> float:
    vehicle = scenario.plant.vehicle
    return float(vehicle.base.mass + sum(link.body.mass for link in vehicle.links))


def at(time: float, path: str, value: Any) -> dict[str, Any]:
    return {"at": time, "path": path, "value": value}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (3, r"changes\[0\] = 3: must be a table"),
        (
            {"at": 0.1, "path": GAIN},
            r"changes\[0\].value: is missing; there are at, path",
        ),
        ({**at(0.1, GAIN, 1), "unit": "m"}, r"changes\[0\].unit = 'm': unknown field"),
        (at(-0.1, GAIN, 1), r"changes\[0\].at = -0.1: must be at least 0"),
        (at(math.nan, GAIN, 1), r"changes\[0\].at = nan: must be a finite number"),
        (at(1e300, GAIN, 1), r"changes\[0\].at = 1e\+300: must be at most 1e\+07 s"),
        (at("now", GAIN, 1), r"changes\[0\].at = 'now': must be a finite number"),  # type: ignore[arg-type]
        (
            at(1.0, GAIN, 1),
            r"changes\[0\].at = 1.0: must be at most 0.995 s, the last control period",
        ),
        (at(0.9951, GAIN, 1), r"changes\[0\].at = 0.9951: must be at most 0.995 s"),
        (at(0.1, GAIN, math.inf), r"changes\[0\].value = inf: must be a finite number"),
        (
            at(0.1, GAIN, "1"),
            rf"changes\[0\].value = '1': must be a number, as {GAIN} is one",
        ),
        (at(0.1, GAIN, True), r"changes\[0\].value = True: must be a number"),
        (at(0.1, GAIN, [1.0]), r"changes\[0\].value = \[1.0\]: must be a number"),
        (
            at(0.1, GAIN, datetime.date(2026, 1, 1)),
            r"changes\[0\].value = .*: must be a number, text, true, false, a",
        ),
        (at(0.1, "", 1), r"changes\[0\].path = '': must be text that is not empty"),
        (at(0.1, 7, 1), r"changes\[0\].path = 7: must be text"),  # type: ignore[arg-type]
        (
            at(0.1, "controller.gains.positon.x", 1),
            r"changes\[0\].path = .*: no 'positon' here; did you mean 'positi",
        ),
        (
            at(0.1, "controler.law", "indi"),
            r"changes\[0\].path = 'controler.law': did you mean 'controller.law'\? ",
        ),
        (
            at(0.1, "controller.lw", "indi"),
            r"changes\[0\].path = 'controller.lw': no 'lw' here; .*mean 'controller.l",
        ),
        (
            at(0.1, "plant", 1),
            (
                r"changes\[0\].path = 'plant': must lead to a number below it; what may"
                r" is delays"
            ),
        ),
        (
            at(0.1, "plnt.mass", 1),
            (
                r"changes\[0\].path = 'plnt.mass': did you mean 'plant'\? nothing of"
                r" this name"
            ),
        ),
        (
            at(0.1, GAIN, np.array([1.0, 2.0])),
            r"changes\[0\].value = array\(\[1., 2.\]\): must be a number, as",
        ),
        (
            at(1.1e7, GAIN, 1),
            (
                r"changes\[0\].at = 11000000.0: must be at most 1e\+07 s, beyond which"
                r" no flight lasts"
            ),
        ),
        (
            at(0.1, "rates.control", 100),
            (
                r"changes\[0\].path = 'rates.control': rates must be as the flight"
                r" began; wh"
            ),
        ),
        (
            at(0.1, "initial.roll", 1),
            r"changes\[0\].path = 'initial.roll': initial must be as the flight began",
        ),
        (
            at(0.1, "seed", 1),
            r"changes\[0\].path = 'seed': seed must be as the flight began",
        ),
        (
            at(0.1, "delays.command", 0.01),
            r"changes\[0\].path = 'delays.command': delays.longest_command is missing",
        ),
        (
            at(0.1, "changes.0.value", 1),
            (
                r"changes\[0\].path = 'changes.0.value': changes must be as the flight"
                r" began"
            ),
        ),
        (
            at(0.1, "plant.gravity", -1),
            r"changes\[0\]: plant.gravity = -1.0: must be at least 0",
        ),
        (
            at(0.1, "controller.law", "ind"),
            r"changes\[0\]: controller.law = 'ind': did you mean 'indi'\? must be a pr",
        ),
        (
            at(0.1, "controller.law", 3),
            (
                r"changes\[0\]: controller.law = 3.0: must be the name of a preset, a"
                r" law or"
            ),
        ),
        (
            at(0.1, "controller.law", "mine.py:make"),
            r"changes\[0\]: controller.law = 'mine.py:make': must not be a f",
        ),
        (
            at(0.1, "controller", {"law": "indi", "gain": 1}),
            r"changes\[0\]: controller.gain = 1: law 'indi' has no s",
        ),
        (
            at(0.1, "environment.wind", {"mode": "moving_ar"}),
            r"changes\[0\]: environment.wind.mode = 'moving_ar': di",
        ),
        (
            at(0.1, "environment.faults", [{"rotor": "nose", "effectiveness": 0.5}]),
            r"changes\[0\]: environment.fault",
        ),
        (
            at(0.1, "environment.ground", 1),
            r"changes\[0\]: environment.ground = 1.0: must be true or false",
        ),
        (
            at(0.1, "reference.joints", [0.1]),
            r"changes\[0\]: reference.joints = 1 signals: must be a list of 2",
        ),
        (
            at(0.1, "reference.base", {"kind": "circel"}),
            r"changes\[0\]: reference.base.kind = 'circel': did you mean",
        ),
    ],
)
def test_a_wrong_change_is_one_line(change: Any, words: str) -> None:
    with pytest.raises(ScenarioError, match=f"^{words}") as caught:
        changing(change)
    assert "\n" not in str(caught.value)


def test_a_list_of_changes_is_a_list_and_the_wrong_one_is_named() -> None:
    with pytest.raises(ScenarioError, match=r"^changes = 3: must be a list of tables$"):
        scenario_from({**BASE, "changes": 3})
    # wrong only because of an earlier one: by then another law flies, which has no such
    # gain
    fine = at(0.5, GAIN, 3.0)
    changing(fine)
    with pytest.raises(
        ScenarioError,
        match=r"^changes\[0\].path = 'controller.gains.position.x': no 'gains' here",
    ):
        changing(fine, at(0.4, "controller.law", "centroidal_joint"))


def test_sensors_whose_readings_are_on_their_way_keep_their_clocks() -> None:

    fix = NamedSensor(name="fix", sensor=Fix(rate=20.0, delay=0.01, sigma=0.01))
    scenario = dataclasses.replace(scenario_from(BASE), sensors=(fix,))
    louder = dataclasses.replace(
        scenario, changes=(Change(at=0.1, path="sensors.fix.sigma", value=0.1),)
    )
    require_changes(louder)
    for path, value in (("sensors.fix.rate", 50.0), ("sensors.fix.delay", 0.02)):
        with pytest.raises(
            ScenarioError,
            match=r"^changes\[0\]: sensors.fix.(frequency|latency) = .*readings are on",
        ):
            require_changes(
                dataclasses.replace(
                    scenario, changes=(Change(at=0.1, path=path, value=value),)
                )
            )


@given(st.sampled_from([1, 7, 50, 100, 200, 333, 1000, 8000]), st.integers(0, 40_000))
def test_a_change_takes_hold_in_the_first_period_that_does_not_begin_before_it(
    rate: int, k: int
) -> None:
    assert Change(at=k / rate, path="x", value=1).tick(rate) == k
    later = math.nextafter(k / rate, math.inf)
    assert Change(at=later, path="x", value=1).tick(rate) == k + 1
    if k:
        assert (
            Change(at=math.nextafter(k / rate, 0.0), path="x", value=1).tick(rate) == k
        )


def test_without_changes_a_scenario_is_written_as_before() -> None:
    scenario = scenario_from(BASE)
    written = plain(scenario)
    assert "changes" not in written
    assert digest(plain(dataclasses.replace(scenario, changes=()))) == digest(written)
    changed = changing(at(0.1, GAIN, 3))
    assert identity(changed) != identity(scenario)
    assert {
        name: value for name, value in plain(changed).items() if name != "changes"
    } == written


def test_changes_are_written_into_plain_data_and_read_back() -> None:
    changes = (
        at(0.1, GAIN, 3),
        at(
            0.2,
            "controller",
            {"law": "ct_ladder", "delay_periods": 2, "safety": {"calm": math.inf}},
        ),
        at(0.3, "environment.faults", [{"rotor": "front", "effectiveness": 0.5}]),
        at(0.4, "environment.ground", False),
        at(0.5, "reference.yaw", 0.1),
    )
    scenario = dataclasses.replace(
        scenario_from(BASE), changes=tuple(Change(**each) for each in changes)
    )
    again = restore(json.loads(json.dumps(plain(scenario))))
    assert again == scenario
    assert [type(each.value) for each in again.changes] == [
        float,
        dict,
        tuple,
        bool,
        float,
    ]


def test_numbers_replace_each_other_and_do_not_add_up() -> None:
    scenario = changing(
        at(0.1, "plant.payload.mass", 0.1),
        at(0.2, "plant.payload.mass", 0.3),
        at(0.3, "plant.payload.mass", 0.0),
    )
    masses = [
        mass_of(stretch.overrides.of(scenario)) for stretch in stretches(scenario)
    ]
    own = mass_of(scenario_from(BASE))
    assert masses == pytest.approx([own, own + 0.1, own + 0.3, own], abs=1e-12)


def test_a_part_that_is_replaced_takes_its_numbers_along() -> None:
    scenario = changing(
        at(0.1, "environment.wind.force.0", 5.0),
        at(0.2, GAIN, 7.0),
        at(0.2, "model.gravity", 9.0),
        at(0.3, "environment.wind", BREEZE),
        at(0.3, "environment.wind.velocity.0", 2.0),
        at(0.4, "controller.law", "paper_ct"),
    )
    began, *_, last = (
        stretch.overrides.of(scenario) for stretch in stretches(scenario)
    )
    assert overrides_at(scenario, 59).of(scenario).wind.force_W.x == 5.0  # type: ignore[attr-defined]
    assert last.wind.velocity_W.x == 2.0  # type: ignore[attr-defined]
    assert (
        last.controller.par.gains.position.x
        == began.controller.par.gains.position.x
        != 7.0
    )
    assert last.controller.par.model.gravity == 9.0


def test_at_one_instant_the_order_is_the_files() -> None:
    """A change of 0.096 s and one of 0.1 s take hold in the same period of 5 ms."""
    for first, second, wanted in ((3.0, 4.0, 4.0), (4.0, 3.0, 3.0)):
        scenario = changing(
            at(0.1, GAIN, first), at(0.096, GAIN, second), at(0.02, GAIN, 9.0)
        )
        assert [stretch.start for stretch in stretches(scenario)] == [0, 4, 20]
        assert (
            overrides_at(scenario, 20).of(scenario).controller.par.gains.position.x
            == wanted
        )


def test_of_one_number_under_two_names_the_latest_change_holds() -> None:
    every, one = "plant.joints.damping", "plant.vehicle.links.0.joint.damping"
    scenario = changing(at(0.1, every, 0.01), at(0.2, one, 0.02), at(0.3, every, 0.03))
    found = [
        overrides_at(scenario, tick).of(scenario).plant.vehicle.links
        for tick in (20, 40, 60)
    ]
    assert [[link.joint.damping for link in links] for links in found] == [
        [0.01, 0.01],
        [0.02, 0.01],
        [0.03, 0.03],
    ]


def test_a_number_is_held_under_every_name_that_it_has() -> None:
    scenario = changing(
        at(0.1, "environment.faults.front.effectiveness", 0.5),
        environment={"faults": [FRONT]},
    )
    found = overrides_at(scenario, 20)
    assert found.holds(scenario, "environment.faults.0.effectiveness")
    assert not found.holds(scenario, "environment.faults.0.start")


def test_another_law_keeps_the_safety_layer_and_its_limits() -> None:
    table = {**BASE["controller"], "safety": {"tilt": 0.5, "stow": [0.1, 0.0]}}
    scenario = changing(at(0.1, "controller.law", "indi"), controller=table)
    par = overrides_at(scenario, 50).of(scenario).controller.par
    assert overrides_at(scenario, 50).of(scenario).controller.name == "guarded_indi"
    assert (par.limits.tilt, par.recovery.stow) == (0.5, (0.1, 0.0))


@pytest.mark.parametrize("law", sampled(["indi", "centroidal_tip"], 2))
def test_another_law_is_the_one_that_a_file_would_make(law: str) -> None:
    """It knows the age of its measurements, and limits that are measured on a law are
    measured on it.
    """
    late = {"delays": {"measurement": 0.01}, "duration": 0.5}
    for safety in ({}, {"safety": {"tilt": 0.4, "stow": [0.1, 0.2]}}):
        before = scenario_from(
            document(
                "case3_wind",
                **late,
                controller={"law": "hybrid_computed_torque", **safety},
            )
        )
        table = {"preset": law} if law.startswith("centroidal") else {"law": law}
        wanted = scenario_from(
            document("case3_wind", **late, controller={**table, **safety})
        )
        found = under_law(before, law).controller
        assert (found.name, found.par, found.memory) == (
            wanted.controller.name,
            wanted.controller.par,
            wanted.controller.memory,
        )


def test_a_controller_in_place_of_the_files_is_not_changed_by_the_file(
    tmp_path: Any,
) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(
        toml_text(
            document("case1", changes=[at(0.1, GAIN, 3), at(0.2, "plant.gravity", 9.7)])
        )
    )
    assert [each.path for each in load_scenario(file).changes] == [
        GAIN,
        "plant.gravity",
    ]
    assert [
        each.path for each in load_scenario(file, controller="centroidal_tip").changes
    ] == ["plant.gravity"]


def test_a_shortened_flight_keeps_changes_that_do_not_come(tmp_path: Any) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(toml_text(document("case1", changes=[at(0.7, GAIN, 3)])))
    short = load_scenario(file, duration=0.5)
    assert [stretch.start for stretch in stretches(short)] == [0]
    assert len(short.changes) == 1


def test_what_a_change_sets_is_a_number_of_the_scenario() -> None:
    scenario = changing(at(0.1, GAIN, 3), at(0.2, "controller.law", "indi"))
    assert number_at(scenario, "changes.0.value") == 3.0
    assert with_numbers(scenario, {"changes.0.value": 5.0}).changes[0].value == 5.0
    with pytest.raises(
        ScenarioError,
        match=r"^path = 'changes.0.at': must be changes.NUMBER.value; when a change",
    ):
        number_at(scenario, "changes.0.at")
    with pytest.raises(
        ScenarioError,
        match=r"^path = 'changes.1.value': must lead to a number, not to str",
    ):
        number_at(scenario, "changes.1.value")
    with pytest.raises(ScenarioError, match=r"no '2' here"):
        number_at(scenario, "changes.2.value")


def test_numpy_numbers_and_tuples_are_held_as_plain_ones() -> None:
    assert Change(at=np.float64(1), path="a", value=np.int64(3)) == Change(
        at=1.0, path="a", value=3.0
    )
    assert Change(at=1, path="a", value=[1, (2.5, "x")]).value == (1, (2.5, "x"))
    for wrong in (None, b"x", {1: 2}, {1}, object(), [None]):
        with pytest.raises(ScenarioError, match=r"^value"):
            Change(at=1.0, path="a", value=wrong)


def test_a_load_that_has_two_names_is_changed_by_one_of_them() -> None:
    """Under the other it would hang there twice."""
    base, pair = (
        load_scenario("case3_wind"),
        (
            "plant.payload.mass",
            "plant.payload.tip.mass",
        ),
    )

    def change(when: float, path: str, value: float) -> Change:
        return Change(at=when, path=path, value=value)

    for first, second in (pair, pair[::-1]):
        twice = (change(0.1, first, 0.1), change(0.2, second, 0.2))
        words = (
            rf"^changes\[1\].path = '{second}': is the same load as '{first}', must be"
            r" changed by that name"
        )
        with pytest.raises(ScenarioError, match=words):
            require_changes(dataclasses.replace(base, changes=twice))
        with pytest.raises(
            ScenarioError,
            match=f"^path = '{second}': is the same number as '{first}'; vary one",
        ):
            require_apart(base, (first, second))
    both = (
        change(0.1, "plant.payload.mass", 0.1),
        change(0.2, "model.payload.mass", 0.1),
        change(0.3, "plant.payload.mass", 0.2),
    )
    require_changes(dataclasses.replace(base, changes=both))


def test_values_without_end_are_one_line() -> None:
    endless: list[Any] = []
    endless.append(endless)
    with pytest.raises(
        ScenarioError, match=r"^value: has too many lists or tables within each other$"
    ):
        Change(at=1.0, path="reference.joints", value=endless)


plain_values = st.recursive(
    st.booleans()
    | st.integers(-(2**70), 2**70)
    | st.floats(allow_nan=False)
    | st.text(st.characters(exclude_categories=["Cs"])),
    lambda inner: (
        st.lists(inner)
        | st.dictionaries(st.text(st.characters(exclude_categories=["Cs"])), inner)
    ),
    max_leaves=6,
)


@pytest.mark.thorough
@given(st.dictionaries(st.text(st.characters(exclude_categories=["Cs"])), plain_values))
def test_any_tables_are_written_as_toml_and_read_back(document: dict[str, Any]) -> None:
    assert tomllib.loads(toml_text(document)) == document


def test_every_table_of_a_scenario_is_written_as_toml_and_read_back() -> None:
    assert tomllib.loads(toml_text(FULL)) == FULL


def test_a_command_that_becomes_late_in_flight_is_read():
    late = {"at": 8.0, "path": "delays.command", "value": 0.03}
    scenario = scenario_from(
        {
            **document(),
            "duration": 9.0,
            "delays": {"longest_command": 0.03},
            "changes": [late],
        }
    )
    assert scenario.delays.longest_command == 0.03
    assert [(each.at, each.path, each.value) for each in scenario.changes] == [
        (8.0, "delays.command", 0.03)
    ]


@pytest.mark.parametrize("word", ["seed", "duration", "plant", "controller"])
def test_a_keyword_takes_the_place_of_what_the_file_states(word):
    stated = document("everything") | {"seed": 3, "duration": 0.1}
    value = {"seed": 4, "duration": 0.05, "plant": "mujoco", "controller": "paper_pd"}[
        word
    ]
    found = scenario_from(stated, "test", {word: value})
    held = {
        "seed": found.seed,
        "duration": found.duration,
        "plant": found.kind,
        "controller": found.controller.name,
    }
    assert held[word] == {"controller": "decoupled_pd"}.get(word, value)


def test_a_file_of_a_change_lies_beside_the_file_of_the_scenario(tmp_path, monkeypatch):
    (tmp_path / "yaw.csv").write_text("time,a\n0,0\n0.5,0.1\n1,0.2\n")
    samples = {"kind": "samples", "file": "yaw.csv", "column": "a"}
    file = tmp_path / "own.toml"
    file.write_text(
        toml_text(
            BASE | {"changes": [{"at": 0.5, "path": "reference.yaw", "value": samples}]}
        )
    )
    (elsewhere := tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(elsewhere)
    scenario = load_scenario("../own.toml")
    (change,) = scenario.changes
    assert change.table == {
        "kind": "spline",
        "times": [0.0, 0.5, 1.0],
        "values": [0.0, 0.1, 0.2],
    }
    yaw = signal_from(change.table, "yaw")
    assert overrides_at(scenario, 150).of(scenario).reference.yaw == yaw
    assert identity(load_scenario(file)) == identity(scenario)


def test_a_file_of_gains_of_a_change_lies_beside_the_file_of_the_scenario(tmp_path):
    file, gains = (
        tmp_path / "own.toml",
        {
            "schema": 1,
            "law": {"preset": "paper_ct"},
            "gains": {"gains.position": 5.0},
        },
    )
    (tmp_path / "mine.toml").write_text(toml_text(gains))
    for path, value in (
        ("controller", {"tuned": "mine.toml"}),
        ("controller.law", "mine.toml"),
    ):
        file.write_text(
            toml_text(BASE | {"changes": [{"at": 0.5, "path": path, "value": value}]})
        )
        scenario = load_scenario(file)
        assert number_at(overrides_at(scenario, 150).of(scenario), GAIN) == 5.0


PICK = {"kind": "pick", "payload": "box", "position": [0.1, 0.0, 1.0], "dwell": 0.5}
HOLD = {"kind": "hold", "duration": 0.5}


def task(*phases: Any) -> dict[str, Any]:
    return {
        "base": {"kind": "phases", "position": [0.0, 0.0, 1.0], "phases": list(phases)}
    }


@pytest.mark.parametrize("path", ["reference", "reference.base"])
def test_a_task_that_comes_in_flight_picks_what_and_when_the_flight_began_with(
    path: str,
) -> None:
    begun = document("case3", duration=6.0, reference=task(PICK), windows={})
    begun |= {"payloads": [{"name": "box", "mass": 0.05}]}

    def coming(*phases: Any, **tables: Any) -> Scenario:
        value = task(*phases)
        later = [at(4.0, path, value["base"] if path == "reference.base" else value)]
        return scenario_from(begun | tables | {"changes": later})

    assert coming(PICK).payloads == scenario_from(begun).payloads
    where = r"^changes\[0\]: reference\.base\.phases\[{}\]\."
    for phases, words in (
        (
            [PICK | {"payload": "bax"}],
            "payload = 'bax': did you mean 'box'\\? must be the name of one of",
        ),
        (
            [HOLD, PICK],
            "payload = 'box': picks it at .* s, must do so at .* s as the flight began",
        ),
        (
            [{"kind": "pick", "gripper": "hand", "position": [0.1, 0.0, 1.0]}],
            "gripper = 'hand': must be the name of",
        ),
    ):
        with pytest.raises(ScenarioError, match=where.format(len(phases) - 1) + words):
            coming(*phases)


def test_grippers_of_a_task_that_comes_in_flight_close_as_the_flight_began() -> None:
    begun = tomllib.loads((LIBRARY / "pull_door.toml").read_text("utf-8"))
    same = at(1.0, "reference", begun["reference"])
    assert (
        scenario_from(begun | {"changes": [same]}).world == scenario_from(begun).world
    )
    later = copy.deepcopy(begun["reference"])
    later["tip"]["path"]["phases"].insert(0, HOLD)
    with pytest.raises(
        ScenarioError, match=r"gripper = '\w+': must close and open as the flight began"
    ):
        scenario_from(begun | {"changes": [at(1.0, "reference", later)]})


def test_files_of_a_change_are_beside_the_scenario(tmp_path: Path) -> None:
    value = {"kind": "plan", "file": "plan.npz", "bodies": [{"mesh": "box.stl"}]}
    reading: Any = SimpleNamespace(folder=tmp_path)
    (read,) = readers.changes([at(0.5, "reference", value)], "changes", reading)
    assert read.table == {
        "kind": "plan",
        "file": str(tmp_path / "plan.npz"),
        "bodies": [{"mesh": str(tmp_path / "box.stl")}],
    }
