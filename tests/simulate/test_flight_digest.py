"""What a log says was flown: everything, as plain data, and a digest that two different
scenarios never share.
"""

from __future__ import annotations

import csv
import dataclasses
import functools
import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from skyarm.records.leaves import leaves
from skyarm.records.plain import digest, plain
from skyarm.reference import Constant, Sine
from skyarm.scenario.scenario_file import load_scenario, scenario_from
from skyarm.simulate import Log, Scenario, run
from skyarm.studies.compare.suite import PAPER_CASES
from support.flights import document


@pytest.fixture(scope="module")
def log() -> Log:
    return run(scenario_from(document("everything")))


def numbers(data: Any) -> Iterator[float]:
    """Every float of plain data, those written as text too."""
    if isinstance(data, dict):
        for value in data.values():
            yield from numbers(value)
    elif isinstance(data, list):
        for value in data:
            yield from numbers(value)
    elif data in ("inf", "-inf", "nan") or type(data) is float:
        yield float(data)


CHANGES: list[dict[str, Any]] = [
    {"title": "other"},
    {"duration": 0.2},
    {"seed": 4},
    {"episode": 2},
    {"rates__physics": 2000},
    {"rates__reference": 100},
    {"plant__vehicle": "hummingbird_arm2_rotors", "plant__gravity": 9.81},
    {"plant__kind": "mujoco"},
    {"plant__integrator": "euler"},
    {"plant__payload__mass": 0.021},
    {"plant__payload": None},
    {"plant__joints__damping": 0.0021},
    {"plant__joints__coulomb": 0.0011},
    {"plant__joints__coulomb_rate": 0.021},
    {"plant__joints__effort_limit": 0.41},
    {"model__gravity": 9.8},
    {"model__payload__mass": 0.011},
    {
        "controller__law": "hybrid_computed_torque",
        "controller__without": ["coriolis"],
        "model__payload": None,
    },
    {"controller__gains__position": [4.0, 4.0, 4.1]},
    {"controller__gains__rate": [0.1, 0.11, 0.025]},
    {"controller__joint_gains__stiffness": [350.0, 151.0]},
    {"controller__joint_gains__damping": [12.1, 10.0]},
    {"controller__mixer": "clip"},
    {"controller__rate_error": "rotors_sim"},
    {"controller__without": []},
    {"controller__without": ["feedforward"]},
    {"reference__base__position": [0.0, 0.0, 1.1]},
    {"reference__yaw__shape": "linear"},
    {"reference__yaw__height": 0.2},
    {"reference__joints": [0.1, 0.05]},
    {"environment__ground": False},
    {"environment__wind": None},
    {"environment__wind__velocity": [1.1, 0.0, 0.0]},
    {"environment__wind__gust__start": 0.03},
    {"environment__wind__turbulence__altitude": 7.0},
    {"sensors__position": 0.003},
    {"sensors__rotor_speeds": 0.1},
    {"delays__measurement": 0.01},
    {"delays__command": 0.004},
    {"initial": None},
    {"initial__velocity": [0.2, 0.0, 0.0]},
    {"initial__joints": [0.1, 0.1]},
]


def test_any_difference_between_scenarios_is_a_difference_of_their_digests() -> None:
    scenarios = [
        scenario_from(document("everything", **changes)) for changes in [{}, *CHANGES]
    ]
    scenarios += [load_scenario(name) for name in PAPER_CASES]
    scenarios.append(dataclasses.replace(scenarios[0], name="other"))
    found = [digest(plain(scenario)) for scenario in scenarios]
    assert len(set(found)) == len(found)


def test_equal_scenarios_have_one_digest_whoever_reads_them() -> None:
    one, other = (scenario_from(document("everything")) for _ in range(2))
    assert digest(plain(one)) == digest(plain(other))
    shuffled = json.loads(
        json.dumps(plain(one)), object_pairs_hook=lambda pairs: dict(reversed(pairs))
    )
    assert digest(shuffled) == digest(plain(one))


@pytest.mark.parametrize("name", [*PAPER_CASES, "everything"])
def test_every_number_of_a_scenario_stands_in_its_record(name: str) -> None:
    scenario = scenario_from(document(name))
    held = sorted(leaf for leaf in leaves(scenario) if isinstance(leaf, float))
    assert len(held) > 100
    assert sorted(numbers(plain(scenario))) == held


def test_a_log_holds_its_scenario_through_its_file_and_its_csv_does_not(
    log: Log, tmp_path: Path
) -> None:
    scenario = scenario_from(document("everything"))
    read = Log.load_npz(log.save_npz(tmp_path / "flight.npz"))
    assert (
        read.info["scenario_record"]
        == plain(scenario)
        == json.loads(json.dumps(plain(scenario), allow_nan=False))
    )
    assert (
        read.info["digest"]
        == digest(read.info["scenario_record"])
        == digest(plain(scenario))
    )
    with log.save_csv(tmp_path / "flight.csv").open(newline="") as stream:
        header, *rows = list(csv.reader(stream))
    assert not any("scenario" in column or "digest" in column for column in header)
    assert all(math.isfinite(float(cell)) for row in rows for cell in row)


def test_the_record_says_what_was_flown_in_words_of_the_scenario(log: Log) -> None:
    record = log.info["scenario_record"]
    kind = "skyarm.scenario.scenario_record:Delays"
    delays = {
        "measurement": 0.005,
        "command": 0.003,
        "rotors": 0,
        "joints": 0,
        "longest_command": None,
    }
    assert record["agent"]["delays"] == {"type": kind, **delays}
    assert record["agent"]["controller"]["law"]["name"].endswith(
        ":hybrid_computed_torque"
    )
    assert record["agent"]["controller"]["par"]["terms"]["coupling"] is False
    assert record["agent"]["plant"]["vehicle"]["links"][0]["joint"]["damping"] == 0.002
    assert record["agent"]["plant"]["vehicle"]["links"][0]["joint"]["lower"] == "-inf"
    assert record["environment"]["wind"]["type"] == "skyarm.world.wind:MovingAir"
    assert record["agent"]["reference"]["yaw"]["shape"] == "quintic"


class Wobble:
    """A signal of a user's own, no dataclass."""

    def __init__(self, height: float) -> None:
        self.height = height

    def shape(self, t: float) -> float:
        return self.height * t


def closed_over(height: float) -> Any:
    def inner(t: float) -> float:
        return inner(t) if t < 0.0 else height * t

    return inner


def test_values_of_any_kind_become_strict_json() -> None:
    value = {
        "array": np.array([1.0, math.inf]),
        "scalar": np.float32(0.5),
        "whole": np.int64(3),
        "nan": math.nan,
        "set": {2.0, 1.0},
        "function": math.sin,
        "partial": functools.partial(round, 2.5, ndigits=0),
        "object": Wobble(0.25),
    }
    assert json.loads(json.dumps(plain(value), allow_nan=False)) == {
        "array": {"type": "array", "kind": "float64", "entries": [1.0, "inf"]},
        "scalar": 0.5,
        "whole": 3,
        "nan": "nan",
        "set": [1.0, 2.0],
        "function": {"type": "function", "name": "math:sin"},
        "partial": {
            "type": "partial",
            "function": {"type": "function", "name": "builtins:round"},
            "arguments": [2.5],
            "keywords": {"ndigits": 0},
        },
        "object": {"type": f"{__name__}:Wobble", "height": 0.25},
    }


@pytest.mark.parametrize(
    "make", [closed_over, lambda height: Wobble(height).shape, Wobble]
)
def test_what_a_users_own_object_or_function_holds_is_part_of_the_digest(
    make: Any,
) -> None:
    assert digest(plain(make(0.5))) == digest(plain(make(0.5)))
    assert digest(plain(make(0.5))) != digest(plain(make(0.25)))


def test_records_of_other_classes_differ_even_with_equal_fields() -> None:
    base = load_scenario("case1")

    def with_x(signal: Any) -> Scenario:
        return dataclasses.replace(
            base, reference=dataclasses.replace(base.reference, x=signal)
        )

    sines = [with_x(Sine(amplitude=0.0, frequency_hz=1.0)), with_x(Constant(0.0))]
    assert len({digest(plain(scenario)) for scenario in sines}) == 2
