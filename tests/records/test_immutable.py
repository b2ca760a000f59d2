"""Records of one class are equal if their fields are, as dataclasses of Python are."""

import dataclasses
from dataclasses import dataclass, field

import numpy as np
import pytest

import skyarm.records.immutable as module
from skyarm.records.immutable import immutable


def pair(*options, **fields):
    """The same class as a record of ours and as a dataclass of Python."""
    body = {"__annotations__": dict.fromkeys(fields, "object"), "__module__": __name__}
    body |= {name: each for name, each in fields.items() if each is not ...}
    ours = immutable(kw_only=False)(type("Ours", (), dict(body)))
    return ours, dataclass(frozen=True, slots=True)(type("Python", (), dict(body)))


@pytest.mark.parametrize(
    ("fields", "values"),
    [
        ({}, [()]),
        ({"a": ...}, [(1.0,), (1,), (2.0,), (np.nan,), ((1.0,),), (-0.0,), (0.0,)]),
        ({"a": ..., "b": 3.0}, [(1.0,), (1.0, 3.0), (1.0, 2.0), (2.0, 3.0)]),
        (
            {"a": ..., "b": field(default=3.0, compare=False)},
            [(1.0,), (1.0, 2.0), (2.0, 3.0)],
        ),
    ],
)
def test_equality_and_hash_are_those_of_a_dataclass(fields, values):
    ours, python = pair(**fields)
    for one in values:
        for other in values:
            same = ours(*one) == ours(*other)
            assert same is (python(*one) == python(*other))
            assert not same or hash(ours(*one)) == hash(ours(*other))
        assert ours(*one) != python(*one)


def test_records_of_two_classes_differ_and_a_comparison_of_its_own_stays():
    @immutable
    class Length:
        value: float

    class Longer(Length):
        pass

    @immutable(eq=False)
    class Alone:
        value: float

    @immutable
    class Any:  # noqa: PLW1641
        value: float

        def __eq__(self, other):
            return True

    assert Length(value=1.0) != Longer(value=1.0)
    assert Alone(value=1.0) != Alone(value=1.0)
    assert Any(value=1.0) == Any(value=2.0)
    assert hash(Any(value=1.0)) == hash(Any(value=1.0)) != hash(Any(value=2.0))

    @dataclass(frozen=True)
    class OfTheUsers(Length):
        more: float = 0.0

    assert (
        OfTheUsers(value=1.0)
        == OfTheUsers(value=1.0)
        != OfTheUsers(value=1.0, more=2.0)
    )


@pytest.fixture(params=["as this Python has them", "as an unknown Python may"])
def any_python(request, monkeypatch):
    """Frozen methods shared by all classes, and those of a Python without the function
    that they replace.
    """
    if "unknown" in request.param:
        monkeypatch.setattr(
            module, "_dataclass", module._quick_dataclass("_of_another_python")
        )
        assert module._dataclass is dataclass


@pytest.mark.usefixtures("any_python")
@pytest.mark.parametrize("slots", [True, False])
def test_frozen_records_refuse_as_those_of_python_do(slots):
    body = {"__annotations__": {"a": float}, "a": 1.0}
    ours = immutable(slots=slots)(type("Same", (), dict(body)))
    theirs = dataclass(frozen=True, slots=slots)(type("Same", (), dict(body)))
    for change in (
        lambda record: setattr(record, "a", 2.0),
        lambda record: delattr(record, "a"),
        lambda record: setattr(record, "b", 2.0),
    ):
        found = []
        for kind in (ours, theirs):
            with pytest.raises((dataclasses.FrozenInstanceError, TypeError)) as refused:
                change(kind())
            found.append((refused.type, str(refused.value)))
        assert found[0] == found[1]
        assert ours().a == 1.0
    assert dataclasses.replace(ours(), a=3.0).a == 3.0


@pytest.mark.usefixtures("any_python")
def test_what_inherits_from_a_frozen_record_may_have_more():
    ours = immutable(slots=False)(
        type("Same", (), {"__annotations__": {"a": float}, "a": 1.0})
    )
    more = type("More", (ours,), {})()
    more.own = 5
    assert more.own == 5
    del more.own
    with pytest.raises(
        dataclasses.FrozenInstanceError, match="cannot assign to field 'a'"
    ):
        more.a = 2.0
