"""Checks of a registered class against its base: a dataclass whose methods accept the library's arguments.

The base itself says what is right: a method that overrides one of the library's takes the same arguments in the same
order, and what is a number there is none that must be called.
"""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Callable, Iterator, Mapping
from importlib import import_module

from skyarm.records.files import shown
from skyarm.records.files.user_code import own_code, place_of
from skyarm.records.leaves import field_names
from skyarm.records.registry.registrations import RegistryError

PACKAGE = __name__.partition(".")[0]
"""Name of the library's package; base classes of its modules define the signatures of methods."""

BASES: Mapping[str, str] = {
    "air": "skyarm.Air",
    "force": "skyarm.Force",
    "fault": "skyarm.Fault",
    "payload": "skyarm.TimedPayload",
    "world": "skyarm.Contact",
    "team": "skyarm.Team",
    "signal": "skyarm.reference.Signal",
    "sensor": "skyarm.Sensor",
    "estimator": "skyarm.Estimator",
    "drive": "skyarm.Drive",
    "metric": "skyarm.Metric",
    "ending": "skyarm.Ending",
}
"""Kinds of what is registered as a subclass that is a dataclass, each with its base class."""

NAMING = "kind", "mode", "law"
"""Keys of a table that select the class of its record; the class cannot have fields of these names."""


def class_mistake(kind: type) -> tuple[str, str] | None:
    """Error in a user's subclass of a library class, as (file and line, message); None if there is none.

    Args:
        kind: a subclass of one of the library's; any other class passes.
    """
    bases = [each for each in kind.__mro__ if each.__module__.partition(".")[0] == PACKAGE]
    if not bases or kind in bases:
        return None
    for name, given in _members(bases):
        member = inspect.getattr_static(kind, name)
        if any(member is vars(each).get(name) for each in bases):
            continue
        words = _function_mistake(name, member, given) if inspect.isfunction(given) else _number_mistake(name, member)
        if words:
            return place_of(member if own_code(member) is not None else kind), words
    if not hasattr(kind, "__dataclass_params__"):
        return place_of(kind), "is no dataclass: must be decorated by @dataclass(frozen=True, kw_only=True)"
    return None


def format_mistake(thing: object) -> tuple[str, str] | None:
    """Error in a registered log format, as (file and line, message); None if there is none."""
    return _functions_mistake(thing, "skyarm.LogFormat(write, read)", "write(log, path)", OPTIONAL)


def flight_format_mistake(thing: object) -> tuple[str, str] | None:
    """Error in a registered format of measured flights, as (file and line, message); None if there is none."""
    return _functions_mistake(thing, "FlightFormat(read, suffixes, begins)", "read(path, columns)")


OPTIONAL = "read(path)"
"""Function that a log format may lack."""


def _functions_mistake(thing: object, made: str, *calls: str) -> tuple[str, str] | None:
    """Error in an object that must have certain functions, as (file and line, message); None if there is none.

    Args:
        thing: the object.
        made: how one is made.
        calls: how its functions are called.
    """
    for call in calls:
        name, _, given = call.rstrip(")").partition("(")
        function = getattr(thing, name, None)
        if isinstance(thing, type) or not callable(function):
            if function is None and call == OPTIONAL:
                continue
            return place_of(thing), f"is {_text_of(thing)}: must be {made}, called as {call}"
        words = _call_mistake(name, function, given.split(", "), 0)
        if words:
            return place_of(function), words
    return None


def _text_of(thing: object) -> str:
    """Name of a class or function, or text of another object, for a message."""
    return thing.__name__ if inspect.isfunction(thing) or isinstance(thing, type) else shown(thing)


def refuse_mistake(mistake: tuple[str, str] | None, kind: str, name: str) -> None:
    """Refuse a registered object that has an error.

    Raises:
        RegistryError: one line with file, line, kind and name.
    """
    if mistake is not None:
        raise RegistryError(f"{mistake[0]}: {kind} {name!r}: {mistake[1]}")


def thing_mistake(kind: str, thing: object) -> tuple[str, str] | None:
    """Error in an object that a plugin registers, as (file and line, message); None if there is none."""
    if isinstance(thing, str):
        return None  # where it is found, which nobody has read yet
    if kind == "log_format":
        return format_mistake(thing)
    if kind == "flight_format":
        return flight_format_mistake(thing)
    return _record_mistake(kind, thing) if kind in BASES else None


def _record_mistake(kind: str, thing: object) -> tuple[str, str] | None:
    """Error in an object that must be a subclass of its kind's base, as (file and line, message), or None.

    A signal may be a function of its table, too.
    """
    if kind == "signal" and inspect.isfunction(thing):
        words = _call_mistake(thing.__name__, thing, ["fields"], 0)
        return None if words is None else (place_of(thing), words)
    module, _, name = BASES[kind].rpartition(".")
    if not isinstance(thing, type) or not issubclass(thing, getattr(import_module(module), name)):
        return place_of(thing), f"is {_text_of(thing)}: must be a subclass of {BASES[kind]}"
    taken = [each for each in NAMING if each in (field_names(thing) or ())]
    if taken:
        return place_of(thing), f"has a field {taken[0]!r}: must have another name; a table names its class by it"
    if kind == "metric" and (bare := _fields_without_default(thing)):
        return place_of(thing), f"has a field {bare[0]!r} without a default: is made by its name alone"
    return class_mistake(thing)


def _fields_without_default(thing: type) -> list[str]:
    """Names of a dataclass's fields that a caller must give; none of any other class."""
    found = dataclasses.fields(thing) if dataclasses.is_dataclass(thing) else ()
    missing = dataclasses.MISSING
    return [each.name for each in found if each.init and each.default is missing and each.default_factory is missing]


def _members(bases: list[type]) -> Iterator[tuple[str, object]]:
    """Public methods and attributes of the library's base classes, the highest base first, each name once."""
    seen: set[str] = set()
    for each in reversed(bases):
        for name, given in vars(each).items():
            if not name.startswith("_") and name not in seen:
                seen.add(name)
                yield name, given


def _number_mistake(name: str, member: object) -> str | None:
    """Reason why an attribute cannot override a number or text of its base class; None if it can."""
    if not isinstance(member, (staticmethod, classmethod)) and not inspect.isfunction(member):
        return None
    return f"has a function {name}: must be a field, a class attribute or a property"


def _function_mistake(name: str, member: object, given: Callable[..., object]) -> str | None:
    """Reason why an attribute cannot override a method of its base class; None if it can."""
    parameters = list(inspect.signature(given).parameters)[1:]
    call = f"{name}({', '.join(parameters)})"
    function = member.__func__ if isinstance(member, (staticmethod, classmethod)) else member
    if isinstance(member, property) or not callable(function):
        text = "a property" if isinstance(member, property) else shown(member)
        return f"has {name} = {text}: must be a function, called as {call}"
    # a function and a class method are given one more than they are called with, a static one and an object are not
    return _call_mistake(name, function, parameters, int(inspect.isfunction(member) or isinstance(member, classmethod)))


def _call_mistake(name: str, function: Callable[..., object], parameters: list[str], hidden: int) -> str | None:
    """Reason why a function does not accept the given arguments; None if it does."""
    call = f"{name}({', '.join(parameters)})"
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):
        return None  # built in: it has no signature to look at
    try:
        signature.bind(*[None] * (len(parameters) + hidden))
    except TypeError as error:
        return f"cannot be called as {call}: is {name}{signature}, {error}"
    for place, own in enumerate(list(signature.parameters)[hidden : hidden + len(parameters)]):
        if own in parameters and own != parameters[place]:
            return f"takes {own!r} in {name} where {parameters[place]!r} is given: is called as {call}"
    return None
