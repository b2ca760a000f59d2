"""Units of numeric fields: unit, meaning and bounds, declared together with the field.

``mass: Annotated[Scalar, nonnegative("kg", "mass of the payload")]`` is read by checks
(:mod:`skyarm.records.field_rules`), exported C, heads of CSV files and tables of the
documents.
"""

from __future__ import annotations

import inspect
import math
import sys
import types
import typing
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from skyarm.algebra import Scalar
from skyarm.records.immutable import memoize, positional
from skyarm.records.leaves import field_names

FARTHEST = 1e7
"""Largest coordinate or distance (m); a float resolves 2 nm there, and UTM's northings
end there."""

LARGEST = 1e12
"""Largest size of a number of any unit; the square of a product of two stays finite."""

LIMITS: Mapping[str, float] = {"m": FARTHEST, "kg": 1e9, "kg m^2": 1e9, "m/s^2": 1e6}
"""Largest size of a number by unit, where it differs from ``LARGEST``; gains that grow
with a mass stay below that, too."""


@positional
class Unit:
    """Unit, meaning and bounds of a field's numbers.

    Attributes:
        unit: SI, as ``N m s/rad``; empty for pure numbers.
        meaning: meaning in words, with axes and frame.
        low, high: least and largest value allowed. strict: neither of them is allowed
            itself.
        infinite: the field may be infinite.
        folds: an exact zero of a plain list is structure and folds away, as one of a
            file.
        rule: coercion in place of that of the field's type.
        fixed: equal in all episodes and throughout a flight: it shapes the program.
        begins: a flight reads the number once, as it begins: a change in flight would
            have no effect.
        usual: size beyond which a number is allowed and probably in another unit; two
            for a unit "rad or m".
        bound: the number limits a quantity, or is the rate of a slow adaptation; it is
            no gain, and no search of gains scales it.
        effect: consequence of a higher or lower value, for those who tune it; empty for
            a field that nobody tunes.
    """

    unit: str = ""
    meaning: str = ""
    low: float = -math.inf
    high: float = math.inf
    strict: bool = False
    infinite: bool = False
    folds: bool = False
    rule: Callable[[str, object], object] | None = None
    fixed: bool = False
    begins: bool = False
    usual: float | tuple[float, float] = math.inf
    effect: str = ""
    bound: bool = False

    @property
    def largest(self) -> float:
        """Largest allowed magnitude of a number whose field states no bound; infinite
        without a unit.
        """
        if self.infinite or not self.unit:
            return math.inf
        return LIMITS.get(self.unit, LARGEST)

    @property
    def words(self) -> str:
        """Unit and meaning as one line of text."""
        return ", ".join(part for part in (self.unit, self.meaning) if part)


positive = partial(Unit, low=0.0, strict=True)
"""Make the unit of a number above zero."""

nonnegative = partial(Unit, low=0.0)
"""Make the unit of a number that is zero or more."""

NUMBER = Unit(infinite=True)
"""Unit of a field that declares none: any number, infinity included."""

OF_SIGNAL = "in the unit of the signal"
"""Last words of the meaning of a signal's parameter, whose unit is that of the field
that holds the signal."""


@memoize
def units(kind: type) -> Mapping[str, Unit]:
    """Unit of each field of a dataclass that states one."""
    return {
        name: unit
        for name, (_, unit) in declared_fields(kind).items()
        if unit is not NUMBER
    }


@memoize
def scalars(kind: type) -> Mapping[str, Unit]:
    """Unit of each field of a dataclass that holds one scalar."""
    return {
        name: unit
        for name, (annotation, unit) in declared_fields(kind).items()
        if annotation is Scalar
    }


def declared_fields(kind: type) -> dict[str, tuple[object, Unit]]:
    """Type and unit of each field of a dataclass."""
    said = declared_units(kind)
    return {name: said[name] for name in field_names(kind) or () if name in said}


def declared_units(of: object) -> dict[str, tuple[object, Unit]]:
    """Type and unit of each annotated field of a class or parameter of a function.

    Empty if an annotation cannot be evaluated: a name that only type checkers import.
    """
    try:
        return _evaluated_units(of)
    except (NameError, TypeError):
        return {}


@memoize
def annotations_of(of: object) -> dict[str, Any]:
    """Evaluated annotations of a class or function, with units and words.

    Raises:
        NameError, TypeError: one cannot be evaluated; it is tried again at the next
            call, since a name may be defined later.
    """
    return typing.get_type_hints(of, include_extras=True)


@memoize
def _evaluated_units(of: object) -> dict[str, tuple[object, Unit]]:
    full = annotations_of(of)
    # evaluated already, which takes the time
    kinds = typing.get_type_hints(types.SimpleNamespace(__annotations__=full))
    return {name: (kind, _unit(full[name])) for name, kind in kinds.items()}


@memoize
def parameters_of(function: Callable[..., object]) -> Mapping[str, inspect.Parameter]:
    """Parameters of a function by name."""
    return inspect.signature(function).parameters


def unresolved_field(kind: type) -> str | None:
    """Name of the first field of a class whose annotation cannot be evaluated; None if
    all can.
    """
    for each in kind.__mro__:
        # a module that is not loaded has no names, and typing's are those that
        # annotations use
        names = vars(sys.modules.get(each.__module__, typing))
        for name, annotation in inspect.get_annotations(each).items():
            try:
                typing.get_type_hints(
                    types.SimpleNamespace(__annotations__={name: annotation}), names
                )
            except (NameError, TypeError):
                return name
    return None


def _unit(annotation: object) -> Unit:
    """Unit declared in a type annotation, also within a union; a dimensionless default
    if there is none.
    """
    options = typing.get_args(annotation)
    if typing.get_origin(annotation) is typing.Annotated:
        return next((each for each in options[1:] if isinstance(each, Unit)), NUMBER)
    if typing.get_origin(annotation) in (typing.Union, types.UnionType):
        return next(
            (unit for unit in map(_unit, options) if unit is not NUMBER), NUMBER
        )
    return NUMBER
