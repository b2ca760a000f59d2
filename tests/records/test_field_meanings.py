"""Every number that a file can name has a meaning, and those that people tune say what
more or less of them does.
"""

from __future__ import annotations

import importlib
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Annotated

import pytest

import skyarm
from skyarm.algebra.scalars import Scalar
from skyarm.control.blocks.disturbance_observer import ObserverGains
from skyarm.control.laws.centroidal.parameters import BaseGains, TipGains
from skyarm.control.laws.predictive.cost import Weights
from skyarm.control.laws.predictive.observer import Bandwidths
from skyarm.control.model import GeometricGains, JointGains
from skyarm.control.safety.limits import Limits
from skyarm.records.units import NUMBER, Unit, declared_units
from skyarm.scenario.grammar import grammar
from skyarm.sensing.measurement import SensorNoise
from skyarm.world.contact.material import Material

SOURCE = Path(skyarm.__file__).parent

DIALECT = re.compile(
    r"\b(told|tells|heard|hears|felt|feels|believed|believes|wanted|asked|asks|foretold|learnt)\b"
)
"""Words of people in place of the field's own, as in
``tests/project/test_words.py``."""

TUNED = (
    *(
        BaseGains,
        GeometricGains,
        JointGains,
        ObserverGains,
        TipGains,
        Weights,
        Bandwidths,
        Limits,
    ),
    *(SensorNoise, Material),
)
"""Records whose numbers people tune."""

NOT_TUNED = {
    "TipGains.shift_rate",
    "TipGains.preview",
    "Limits.joint_step",
    "ObserverGains.jump",
}


def module_of(name: str) -> ModuleType | None:
    """Module by its name; None if a package that an extra installs is missing here."""
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        assert not str(error.name).startswith("skyarm"), (name, error.name)
        return None


@cache
def records() -> tuple[type, ...]:
    """Classes of the library in modules that declare units."""
    paths = [
        path
        for path in sorted(SOURCE.rglob("*.py"))
        if "Unit" in path.read_text("utf-8")
    ]
    names = [
        ".".join(("skyarm", *path.relative_to(SOURCE).with_suffix("").parts))
        for path in paths
    ]
    modules = list(
        filter(None, (module_of(name.removesuffix(".__init__")) for name in names))
    )
    return tuple(
        kind
        for module in modules
        for kind in vars(module).values()
        if isinstance(kind, type) and kind.__module__ == module.__name__
    )


def declared(kinds: tuple[type, ...]) -> Iterator[tuple[str, Unit]]:
    """Name and unit of every field that declares one."""
    for kind in kinds:
        for name, (_, unit) in declared_units(kind).items():
            if unit is not NUMBER and unit != Unit():
                yield f"{kind.__name__}.{name}", unit


def without_meaning(kinds: tuple[type, ...]) -> list[str]:
    """Fields whose unit has no meaning."""
    return [name for name, unit in declared(kinds) if not unit.meaning]


def test_every_unit_of_a_field_has_a_meaning() -> None:
    assert len(list(declared(records()))) > 800
    assert without_meaning(records()) == []


def test_every_number_that_a_scenario_file_can_name_has_a_meaning() -> None:
    rows = [row for row in grammar() if row.unit]
    assert len(rows) > 400
    assert [row.path for row in rows if not row.meaning] == []


def test_an_option_of_a_law_has_the_unit_and_the_meaning_of_its_constant() -> None:
    (row,) = [
        row for row in grammar() if (row.path, row.of) == ("controller.cutoff", "indi")
    ]
    assert (row.unit, row.bounds) == ("Hz", "above 0")
    assert row.meaning == "cut-off frequency of every filter of the law"
    assert row.effect.startswith("lower values pass less noise")


def test_meanings_are_noun_phrases_in_the_words_of_the_field() -> None:
    for name, unit in declared(records()):
        for text in (unit.meaning, unit.effect):
            assert not text.endswith("."), name
            assert not DIALECT.search(text), f"{name}: {text}"
        assert not re.match(r"(of|that|by|with) ", unit.meaning), (
            f"{name}: {unit.meaning}"
        )


@pytest.mark.parametrize("kind", TUNED, ids=lambda kind: kind.__name__)
def test_what_people_tune_says_what_more_or_less_of_it_does(kind: type) -> None:
    silent = {name for name, unit in declared((kind,)) if not unit.effect}
    assert silent <= NOT_TUNED
    assert all(
        re.match(r"(higher|lower|longer|shorter) ", unit.effect)
        for _, unit in declared((kind,))
        if unit.effect
    )


@dataclass(frozen=True)
class Tether:
    length: Annotated[Scalar, Unit("m", low=0.0)] = 1.0
    stiffness: Annotated[Scalar, Unit("N/m", "stiffness of the tether", low=0.0)] = 1.0


def test_a_field_without_a_meaning_is_found() -> None:
    assert without_meaning((Tether,)) == ["Tether.length"]
