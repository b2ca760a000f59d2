"""Identity leaves out what is for people and nothing else; units are said once, at the
field.
"""

from __future__ import annotations

import dataclasses
import re
import typing
from dataclasses import dataclass
from typing import Annotated, Any

import pytest

import skyarm
from skyarm.algebra.scalars import Scalar
from skyarm.compile.tracing.tracer import Graph
from skyarm.records.coerce import RecordError
from skyarm.records.field_rules import accept_fields, require_fields
from skyarm.records.files import Fields
from skyarm.records.identity import identity
from skyarm.records.immutable import immutable
from skyarm.records.plain import plain
from skyarm.records.read_table import record_from
from skyarm.records.units import Unit, units

if typing.TYPE_CHECKING:
    from decimal import Decimal


def test_identity_is_of_all_numbers_and_of_no_title() -> None:
    scenario = skyarm.load_scenario("case1")
    assert identity(dataclasses.replace(scenario, title="other")) == identity(scenario)
    others = [
        dataclasses.replace(scenario, seed=1),
        skyarm.with_numbers(scenario, {"plant.vehicle.base.mass": 0.7160000000000001}),
        skyarm.load_scenario("case1", controller="indi"),
    ]
    assert len({identity(each) for each in (scenario, *others)}) == 4


def test_programs_that_a_function_captures_are_written_by_their_type() -> None:
    """They have more paths than can be written. A variable may have no value yet."""
    captured = Graph()

    def policy() -> object:
        return captured.nodes, later

    kind = {"type": "skyarm.compile.tracing.tracer:Graph"}
    assert plain(policy)["bound"] == [kind]
    later = Spring(stiffness=1.0)
    assert len(plain(policy)["bound"]) == 2


def test_other_objects_that_a_function_captures_are_written_whole() -> None:
    def policy_of(mass: float) -> Any:
        captured = Fields({"mass": mass}, "plant")
        return lambda: captured.table

    assert plain(policy_of(1.0)) == plain(policy_of(1.0)) != plain(policy_of(2.0))


def test_every_field_of_what_crosses_the_boundary_says_its_unit() -> None:
    assert (
        units(skyarm.Measurement)["specific_force"].words
        == "m/s^2, accelerometer, base axes, +g along z in hover"
    )
    for kind in (skyarm.Measurement, skyarm.Reference, skyarm.Command):
        assert set(units(kind)) == {field.name for field in dataclasses.fields(kind)}


@dataclass(frozen=True)
class Spring:
    stiffness: Annotated[Scalar, Unit("N/m", "of the tether", low=0.0, high=1e4)]
    count: Annotated[int, Unit(low=1, high=9)] = 1
    share: Annotated[float, Unit(low=0.0, high=1.0, strict=True)] = 0.5
    ends: tuple[float, float] = (0.0, 1.0)
    patience: float = float("inf")

    def __post_init__(self) -> None:
        accept_fields(self, "spring")


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"stiffness": -1.0}, "spring.stiffness = -1.0: must be at least 0"),
        ({"stiffness": 2e4}, "spring.stiffness = 20000.0: must be at most 10000"),
        (
            {"stiffness": float("inf")},
            "spring.stiffness = inf: must be a finite number",
        ),
        ({"count": 0}, "spring.count = 0: must be at least 1"),
        ({"count": 10}, "spring.count = 10: must be at most 9"),
        ({"count": 1.5}, "spring.count = 1.5: must be a whole number"),
        ({"share": 0.0}, "spring.share = 0.0: must be above 0"),
        ({"share": 1.0}, "spring.share = 1.0: must be below 1"),
        ({"ends": (1.0,)}, "spring.ends = (1.0,): must have 2 items"),
        ({"ends": (1.0, "a")}, "spring.ends[1] = 'a': must be a number"),
        ({"patience": float("nan")}, "spring.patience = nan: must be a number"),
    ],
)
def test_a_field_refuses_what_its_unit_does_not_allow(
    fields: dict[str, object], words: str
) -> None:
    with pytest.raises(RecordError) as error:
        Spring(**{"stiffness": 1.0, **fields})  # type: ignore[arg-type]
    assert str(error.value) == words


@dataclass(frozen=True)
class Plain:
    """A record of a plugin without any metadata."""

    gain: float = 1.0
    label: str = "x"
    odd: float = None  # type: ignore[assignment]
    late: typing.Any = None
    many: int = 1


def test_a_plugins_record_without_metadata_is_looked_at_by_its_types() -> None:
    for fine in (
        Plain(),
        Plain(gain=2),
        Plain(gain=float("inf")),
        Plain(late=object()),
    ):
        require_fields(fine, "forces[0]")
    for wrong, words in (
        (Plain(gain="a"), "forces[0].gain = 'a': must be a number"),  # type: ignore[arg-type]
        (Plain(gain=float("nan")), "forces[0].gain = nan: must be a number"),
        (
            Plain(many=-(2**53)),
            "forces[0].many = -9007199254740992: must be below 2**53 in size",
        ),
        (Plain(label=3), "forces[0].label = 3: must be text"),  # type: ignore[arg-type]
    ):
        with pytest.raises(RecordError) as error:
            require_fields((wrong,), "forces")
        assert str(error.value) == words


@immutable
class Timed(skyarm.Command):
    sent: Decimal | None = None


def test_a_command_of_ones_own_may_have_a_field_that_only_type_checkers_know() -> None:
    assert Timed(rotor_speeds=(1.0,)).rotor_speeds == (1.0,)


@dataclass(frozen=True)
class Tower:
    height: Annotated[Scalar, Unit("m")] = 1.0
    weight: Annotated[Scalar, Unit("N", low=0.0)] = 1.0
    pull: Annotated[Scalar, Unit("m/s^2")] = 1e6
    lasts: Annotated[Scalar, Unit("s", infinite=True)] = 1.0
    rank: Annotated[Scalar, Unit("")] = 1.0

    def __post_init__(self) -> None:
        accept_fields(self, "tower")


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"height": 2e7}, "height = 20000000.0: must be at most 1e+07 in size"),
        ({"height": -1e308}, "height = -1e+308: must be at most 1e+07 in size"),
        ({"weight": 1e13}, "weight = 10000000000000.0: must be at most 1e+12"),
        ({"pull": 1.001e6}, "pull = 1001000.0: must be at most 1e+06 in size"),
    ],
)
def test_a_number_with_a_unit_is_bounded_though_its_field_names_no_bound(
    fields: Any, words: str
) -> None:
    with pytest.raises(RecordError, match=f"^{re.escape(f'tower.{words}')}$"):
        Tower(**fields)
    with pytest.raises(ValueError, match=f"^{re.escape(f'world.towers[1].{words}')}$"):
        record_from(Tower, Fields(fields, "world.towers[1]"))


def test_what_may_be_infinite_or_has_no_unit_is_not_bounded_by_its_unit() -> None:
    assert Tower(lasts=float("inf"), rank=1e300) == Tower(
        height=1.0, lasts=float("inf"), rank=1e300
    )
    assert Tower(height=1e7, weight=1e12).height == 1e7
