"""Members of a group by name: an immutable mapping in order, which records contain."""

from __future__ import annotations

from collections.abc import Callable, ItemsView, Iterator, Mapping, ValuesView
from dataclasses import Field
from typing import Any, TypeVar

from skyarm.records import coerce
from skyarm.records.immutable import positional

T = TypeVar("T")

SOLE = "main"
"""Name of the only member of a group whose file gives no names."""


@positional
class Members(Mapping[str, T]):
    """Immutable mapping from names to records, in order; at least one.

    Attributes:
        names: names of the members. records: the members, one for each name, or none
            yet.
        others: names of members that are left out of a view of some.
    """

    names: tuple[str, ...]
    records: tuple[T, ...] = ()
    others: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for field, value in (("names", self.names), ("others", self.others)):
            if type(value) is not tuple or not {*map(type, value)} <= {str}:
                coerce.refuse(f"members.{field}", value, "must be a tuple of names")
        if type(self.records) is not tuple or len(self.records) not in (
            0,
            len(self.names),
        ):
            coerce.refuse(
                "members.records",
                self.records,
                f"must be a tuple of {len(self.names)}, one for each name",
            )

    def __getitem__(self, name: str) -> T:
        if name not in self.names:
            raise KeyError(f"{name}: must be one of {', '.join(self.names)}")
        return self.records[self.names.index(name)]

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def __len__(self) -> int:
        return len(self.names)

    def items(self) -> ItemsView[str, T]:
        """Names with their records: the view of a dict, since that of a mapping looks
        each name up anew.
        """
        return dict(zip(self.names, self.records, strict=True)).items()

    def values(self) -> ValuesView[T]:
        """Records in order."""
        return dict(zip(self.names, self.records, strict=True)).values()

    def only(self, name: str) -> Members[T]:
        """View of one member, with the names of the others."""
        return Members(
            (name,), (self[name],), tuple(each for each in self.names if each != name)
        )


def members_of(kind: str) -> Callable[[str, object], Members[Any]]:
    """Make a check that accepts a mapping from names to instances of a class, given by
    the name of that class.
    """

    def check(field: str, value: object) -> Members[Any]:
        if not isinstance(value, Mapping) or not value:
            coerce.refuse(
                field, value, f"must be a mapping from names to {kind}, at least one"
            )
        # names become file names, on file systems that ignore case, too
        plain = [str(name).lower() for name in value]
        for name, each in value.items():
            if not isinstance(name, str) or not (
                name.isidentifier() and name.isascii()
            ):
                coerce.refuse(
                    field,
                    name,
                    "must be names of letters (a to z), digits and underscores, no"
                    " digit first",
                )
            if plain.count(name.lower()) > 1:
                coerce.refuse(
                    field,
                    name,
                    "must differ from other names by more than upper and lower case",
                )
            # by the name of the class, whose module would import this one
            if type(each).__name__ != kind:
                coerce.refuse(f"{field}.{name}", each, f"must be a {kind}")
        return (
            value
            if isinstance(value, Members)
            else Members(tuple(value), tuple(value.values()))
        )

    return check


def alone(field: Field[Any]) -> str:
    """Name of the property for the only member of a group, which the field's metadata
    states; empty for other fields.

    Plain data contains a sole member called ``main`` under that name, as before groups
    had names.
    """
    return str(field.metadata.get("alone", ""))
