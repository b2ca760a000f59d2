"""Words of a scenario that stand for a field of one of its groups."""

from __future__ import annotations

import copy
import dataclasses
import inspect
import pickle
import tomllib
from pathlib import Path

import pytest

import skyarm
from skyarm.records.leaves import field_names, replace_at
from skyarm.records.plain import plain
from skyarm.records.restore import restore
from skyarm.records.words import groups
from skyarm.scenario.scenario_record import (
    Agent,
    Environment,
    Scenario,
    ScenarioError,
    Solver,
    first_state,
)
from skyarm.world import ForceWind

ROOT = Path(__file__).parents[2]

GIVEN = skyarm.load_scenario("case2_gust")
WIND = ForceWind(force_W=(1.0, 0.0, 0.0))
WORDS = {
    name: group
    for group, kind in groups(Scenario).items()
    for name in field_names(kind) or ()
}
"""Every word of a group, with the name of the group."""


def test_a_word_is_the_field_of_its_group() -> None:
    assert set(WORDS.values()) == {"environment", "agent", "solver"}
    for word, group in WORDS.items():
        assert getattr(GIVEN, word) is getattr(getattr(GIVEN, group), word)


def test_the_class_has_its_words_too() -> None:
    for name in WORDS:
        assert isinstance(getattr(Scenario, name), property)


def test_a_word_of_a_group_cannot_be_set() -> None:
    # TypeError of a frozen class with slots on Python 3.11
    with pytest.raises((AttributeError, TypeError)):
        GIVEN.wind = WIND
    assert GIVEN.wind is GIVEN.environment.wind != WIND


def test_a_scenario_is_made_of_words_or_of_groups() -> None:
    agent = Agent(
        plant=GIVEN.plant, controller=GIVEN.controller, reference=GIVEN.reference
    )
    grouped = Scenario(
        name="x",
        duration=1.0,
        agent=agent,
        environment=Environment(wind=WIND),
        solver=Solver(kind="mujoco"),
    )
    words = Scenario(
        name="x",
        duration=1.0,
        plant=GIVEN.plant,
        controller=GIVEN.controller,
        reference=GIVEN.reference,
        wind=WIND,
        kind="mujoco",
    )
    assert words == grouped
    assert (
        Scenario(name="x", duration=1.0, agent=agent, wind=WIND, kind="mujoco")
        == grouped
    )


def test_words_replaced_leave_the_rest_of_their_group() -> None:
    changed = dataclasses.replace(GIVEN, wind=WIND, kind="mujoco", initial=None, seed=4)
    environment = dataclasses.replace(GIVEN.environment, wind=WIND)
    agent, solver = (
        dataclasses.replace(GIVEN.agent, initial=None),
        dataclasses.replace(GIVEN.solver, kind="mujoco"),
    )
    assert changed == dataclasses.replace(
        GIVEN, environment=environment, agent=agent, solver=solver, seed=4
    )
    assert changed.reference is GIVEN.reference
    # a word beside its group is a field of the group that is given
    assert dataclasses.replace(
        GIVEN, environment=Environment(ground=False), wind=WIND
    ).environment == Environment(ground=False, wind=WIND)


@pytest.mark.skipif(
    not hasattr(copy, "replace"), reason="copy.replace came with Python 3.13"
)
def test_words_are_replaced_by_copy_too() -> None:
    assert copy.replace(GIVEN, wind=WIND) == dataclasses.replace(GIVEN, wind=WIND)


def test_methods_replace_one_word_and_keep_the_rest() -> None:
    for word, value in {
        "controller": dataclasses.replace(GIVEN.controller, margin=None),
        "plant": dataclasses.replace(GIVEN.plant, gravity=9.0),
        "reference": dataclasses.replace(
            GIVEN.reference, yaw=skyarm.Sine(amplitude=0.1, frequency_hz=0.5)
        ),
        "delays": skyarm.Delays(command=0.01),
        "initial": first_state(GIVEN),
        "kind": "mujoco",
    }.items():
        assert getattr(GIVEN, f"with_{word}")(value) == dataclasses.replace(
            GIVEN, **{word: value}
        )


def test_unknown_and_missing_words_are_type_errors() -> None:
    with pytest.raises(
        TypeError, match=r"^Scenario: did you mean 'reference'\? has no field refernce$"
    ):
        dataclasses.replace(GIVEN, refernce=GIVEN.reference)
    with pytest.raises(TypeError, match=r"^Scenario: has no field zzz, yyy$"):
        dataclasses.replace(GIVEN, zzz=1, yyy=2)
    with pytest.raises(TypeError, match=r"^Scenario: duration is missing$"):
        Scenario(name="x", agent=GIVEN.agent)
    with pytest.raises(TypeError, match=r"^Scenario: agents is missing$"):
        Scenario(name="x", duration=1.0, wind=WIND)
    with pytest.raises(TypeError, match=r"^Agent.__init__\(\) missing 2 required"):
        Scenario(name="x", duration=1.0, plant=GIVEN.plant)


def test_a_wrong_word_is_refused_by_its_name() -> None:
    with pytest.raises(ScenarioError, match=r"^wind = 3: must be a Component"):
        dataclasses.replace(GIVEN, wind=3)
    with pytest.raises(ScenarioError, match=r"^seed = -1: must be a whole number"):
        dataclasses.replace(GIVEN, wind=WIND, seed=-1)
    with pytest.raises(ScenarioError, match=r"^environment = 3: must be a"):
        dataclasses.replace(GIVEN, environment=3)
    with pytest.raises(ScenarioError, match=r"environment = 3: must be a Environment"):
        dataclasses.replace(GIVEN, environment=3, wind=GIVEN.wind)


def test_a_scenario_comes_back_from_bytes_and_from_plain_data() -> None:
    assert pickle.loads(pickle.dumps(GIVEN)) == GIVEN
    assert restore(plain(GIVEN)) == GIVEN
    assert replace_at(GIVEN, {("environment", "wind"): WIND}) == dataclasses.replace(
        GIVEN, wind=WIND
    )


def test_the_signature_of_the_class_is_that_of_its_fields() -> None:
    assert list(inspect.signature(Scenario).parameters) == list(
        field_names(Scenario) or ()
    )


def test_mypy_reads_what_it_must_refuse() -> None:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"][
        "mypy"
    ]
    assert settings["strict"]  # with a warning of comments that ignore nothing
    assert "warn_unused_ignores" not in settings
    (beside,) = [each for each in settings["files"] if each.startswith("tests/")]
    text = (ROOT / beside).read_text("utf-8")
    for line in (
        "Scenario(name=1,",
        "replace(scenario, name=3)",
        "replace(scenario.agent, plnt=1)",
    ):
        assert line in text
