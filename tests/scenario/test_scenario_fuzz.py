"""Whatever stands in a scenario document, the answer is a scenario or one line."""

from __future__ import annotations

import copy
import math
import random
from typing import Any

import pytest

from skyarm.scenario.scenario_file import scenario_from
from skyarm.simulate import run
from support.cases import sampled
from support.flights import FULL, SHIPPED

JUNK: tuple[Any, ...] = (
    None,
    True,
    False,
    0,
    1,
    -1,
    3,
    10**400,
    -(10**30),
    0.0,
    -0.0,
    -1.5,
    0.3,
    1e-320,
    1e9,
    1e308,
    -1e308,
    math.nan,
    math.inf,
    -math.inf,
    "",
    "x",
    "rk4",
    "mujoco",
    "hummingbird",
    "tip",
    "line\nbreak",
    "a/b",
    "\0",
    "\u00fc" * 300,
    [],
    [[]],
    [1],
    [1.0, 2.0],
    [0.0, 0.0, 1.0],
    [math.nan] * 3,
    ["a", "b", "c"],
    [1e308] * 4,
    [None],
    [[1.0, 0.3]],
    [{}],
    {},
    {"kind": "sine"},
    {"kind": "hover"},
    {"mode": "moving_air"},
    {"": 1},
    {"mass": 1e308},
    b"x",
)


def _places(node: Any) -> list[tuple[Any, Any]]:
    """Every (container, key) of a document."""
    found = []
    items = (
        list(node.items())
        if isinstance(node, dict)
        else list(enumerate(node))
        if isinstance(node, list)
        else []
    )
    for key, child in items:
        found.append((node, key))
        found += _places(child)
    return found


def _mutate(document: dict[str, Any], rng: random.Random) -> None:
    places = _places(document)
    container, key = rng.choice(places)
    what = rng.random()
    if what < 0.2:
        del container[key]
    elif what < 0.3 and isinstance(container, dict):
        container[f"{key}_"] = container.pop(key)
    elif what < 0.45:
        other, other_key = rng.choice(places)
        container[key] = copy.deepcopy(other[other_key])
    else:
        container[key] = copy.deepcopy(rng.choice(JUNK))


@pytest.mark.parametrize("seed", sampled(range(8), 4))
def test_a_mutated_document_is_a_scenario_or_an_error_of_one_line(seed: int) -> None:
    rng = random.Random(seed)
    documents = [*SHIPPED.values(), FULL, FULL, FULL]
    flown = refused = 0
    for mutations in (0, *(rng.randint(1, 3) for _ in range(50))):
        document = copy.deepcopy(rng.choice(documents))
        for _ in range(mutations):
            _mutate(document, rng)
        try:
            scenario = scenario_from(document)
        except ValueError as error:
            refused += 1
            assert str(error).strip()
            assert "\n" not in str(error)
            assert len(str(error)) < 1000, "a message is a line, not a page"
            continue
        flown += 1
        assert scenario.steps >= 1
    assert flown, "what is not mutated is a scenario"
    assert refused > 25


@pytest.mark.parametrize("seed", sampled(range(3), 3))
def test_a_mutated_scenario_that_loads_also_flies_and_ends_as_a_result(
    seed: int,
) -> None:
    rng = random.Random(100 + seed)
    flown = 0
    while flown < 4:
        document = copy.deepcopy(FULL)
        _mutate(document, rng)
        try:
            scenario = scenario_from(document, replaced={"duration": 0.1})
        except ValueError:
            continue
        flown += 1
        log = run(scenario)
        assert log.status in {
            "completed",
            "diverged",
            "joint_limit",
            "ground",
            "controller_undefined",
        }
        assert bool(log.info["cause"]) == (log.status != "completed")


@pytest.mark.parametrize("share", sampled([97, 2], 2))
def test_every_entry_of_every_table_is_checked_against_junk(share: int) -> None:
    for index, (_, key) in enumerate(_places(FULL)):
        for junk in JUNK[index % share :: share]:  # a share of the junk for each entry
            document = copy.deepcopy(FULL)
            container, place = _places(document)[index]
            assert place == key
            container[place] = copy.deepcopy(junk)
            try:
                scenario_from(document)
            except ValueError as error:
                assert "\n" not in str(error), (key, junk)
