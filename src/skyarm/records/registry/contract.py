"""Contracts of the kinds of users' code: base class, methods with arguments and
results; checks of a class against it.

The base itself says what is right: a method that overrides one of the library's takes
the same arguments in the same order, and what is a number there is none that must be
called. What a method must return is a row of :data:`CONTRACTS`;
:mod:`skyarm.simulate.examine` calls it and looks.
"""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Callable, Iterator, Mapping, Sequence
from importlib import import_module
from operator import attrgetter
from typing import Any

from skyarm.records.files import shown
from skyarm.records.files.user_code import own_code, place_of
from skyarm.records.immutable import positional
from skyarm.records.leaves import Tree, field_names
from skyarm.records.registry.registrations import RegistryError

PACKAGE = __name__.partition(".")[0]
"""Name of the library's package; base classes of its modules define the signatures of
methods."""


@positional
class Numbers:
    """Result of a method that is a number, or a record or tuple of numbers.

    Attributes:
        label: name of the result in messages.
        example: result of the right structure, or function that makes one of the user's
            record; None if any is right.
        also: class that its numbers may have besides float and int.
    """

    label: str
    example: Tree | Callable[[Any], Tree] = None
    also: type = int


@positional
class Method:
    """Method that users' code of a kind must have: its arguments, and what it returns.

    Attributes:
        arguments: names of its arguments, as the base class has them.
        result: what it must return: numbers, or the x of a function ``require_x`` of
            :class:`skyarm.simulate.examine.UserPart`; empty for anything.
        pure: True if it is traced, and must give the same program each time.
        needed: function (record) -> True if the method of that record is called.
    """

    arguments: str
    result: Numbers | str = ""
    pure: bool = True
    needed: Callable[[Any], object] = lambda _: True


@positional
class Contract:
    """Requirements on the code of one kind that users can register.

    Attributes:
        base: base class, "module.Class"; empty for a function or an object with
            functions.
        methods: methods by name, in the order of the calls; messages name the first
            unless another is at fault.
        start: method with its arguments, or field, that gives the first memory; empty
            for none.
        function: arguments of a function that may be registered in place of a class.
        made: how an object with functions is made; empty for a class.
        texts: attributes that must be texts.
        bare: True if its name alone makes one, so that every field needs a default.
    """

    base: str
    methods: Mapping[str, Method] = dataclasses.field(default_factory=dict)
    start: str = ""
    function: str = ""
    made: str = ""
    texts: Sequence[str] = ()
    bare: bool = False


_COMPONENT = {
    "advance": Method("memory, t, dt, state, draws", "memory"),
    "velocity": Method("memory, t, position_W", "velocity"),
    "wrenches": Method("memory, t, motion, rotor_speeds", "wrenches"),
    "slope": Method(
        "memory, t, motion, rotor_speeds", "rates", needed=attrgetter("coupled")
    ),
    "logged": Method(
        "memory, motion",
        Numbers("logged", lambda component: (0.0,) * len(component.columns)),
        needed=attrgetter("columns"),
    ),
    "act": Method("memory, t, dt, motion"),
    "rotor_commands": Method("memory, rotors, commands"),
}

_START = "start(period, draws)"

CONTRACTS: Mapping[str, Contract] = {
    "air": Contract("skyarm.Air", _COMPONENT, _START),
    "force": Contract("skyarm.Force", _COMPONENT, _START),
    "fault": Contract("skyarm.Fault", {"share": Method("t", Numbers("a share", 0.0))}),
    "payload": Contract("skyarm.TimedPayload", _COMPONENT, _START),
    "world": Contract("skyarm.Contact", _COMPONENT, _START),
    "team": Contract("skyarm.Team", _COMPONENT, _START),
    "signal": Contract(
        "skyarm.reference.Signal",
        {"derivatives": Method("t", Numbers("derivatives", (0.0,) * 5))},
        function="fields",
    ),
    "sensor": Contract(
        "skyarm.Sensor",
        {
            "measure": Method(
                "memory, t, state, specific_force, draws, dt",
                "reading",
                needed=lambda sensor: sensor.feels is None,
            ),
            "feel": Method(
                "memory, t, push, draws, dt",
                "reading",
                needed=lambda sensor: sensor.feels is not None,
            ),
        },
        "start(vehicle)",
    ),
    "estimator": Contract(
        "skyarm.Estimator",
        {"step": Method("memory, readings, command, dt", "measurement")},
        "start(vehicle)",
    ),
    "drive": Contract(
        "skyarm.Drive",
        {
            "effort": Method("memory, setpoint, position, rate", "effort"),
            "advance": Method("memory, setpoint, position, rate, dt", "memory"),
        },
        "begin(position, setpoint, dt)",
    ),
    "law": Contract(
        "", {"law": Method("memory, measurement, reference, dt", "command")}, "memory"
    ),
    "motion": Contract("", {"at": Method("t")}),
    "metric": Contract("skyarm.Metric", bare=True),
    "ending": Contract(
        "skyarm.Ending",
        {"fine": Method("scenario, state, goal, slack", Numbers("fine", 0.0, bool))},
        texts=("status",),
    ),
    "log_format": Contract(
        "",
        {
            "write": Method("log, path", pure=False),
            # a format may only write
            "read": Method(
                "path",
                pure=False,
                needed=lambda form: getattr(form, "read", None) is not None,
            ),
        },
        made="skyarm.LogFormat(write, read)",
    ),
    "flight_format": Contract(
        "",
        {"read": Method("path, columns", pure=False)},
        made="FlightFormat(read, suffixes, begins)",
    ),
}
"""Kind -> its contract; the other kinds are functions, which are looked at where they
are called."""

NAMING = "kind", "mode", "law"
"""Keys of a table that select the class of its record; the class cannot have fields of
these names."""


@positional
class Mistake:
    """Error in users' code as data: whose, where, what is wrong, and what must be
    there.

    Attributes:
        owner: class of the code with its place in a scenario, or its kind and
            registered name.
        place: file and line; a name if they are unknown.
        what: what is wrong. instead: what must be in its place; empty where that is
            said already.
    """

    owner: str
    place: str
    what: str
    instead: str = ""

    @property
    def file(self) -> str:
        """File of the user's code; empty if it is unknown."""
        return self.place.rpartition(":")[0]

    @property
    def line(self) -> int:
        """Line of the file; 0 if it is unknown."""
        return int(self.place.rpartition(":")[2]) if self.file else 0

    def __str__(self) -> str:
        return (
            f"{self.place}: {self.owner}"
            f" {self.what}{self.instead and ': '}{self.instead}"
        )


def class_mistake(kind: type) -> Mistake | None:
    """Error in a user's subclass of a library class; None if there is none.

    Args:
        kind: a subclass of one of the library's; any other class passes.
    """
    bases = [
        each for each in kind.__mro__ if each.__module__.partition(".")[0] == PACKAGE
    ]
    if not bases or kind in bases:
        return None
    for name, given in _members(bases):
        # static, because a property of the user must not run for its check
        member = inspect.getattr_static(kind, name)
        # what the library itself overrides is right
        if any(member is vars(each).get(name) for each in bases):
            continue
        words: Words | None = None
        if inspect.isfunction(given):
            words = _function_mistake(name, member, given)
        elif inspect.isfunction(member) or isinstance(
            member, (staticmethod, classmethod)
        ):
            words = (
                f"has a function {name}",
                "must be a field, a class attribute or a property",
            )
        if words:
            return Mistake(
                kind.__name__,
                place_of(member if own_code(member) is not None else kind),
                *words,
            )
    if not hasattr(kind, "__dataclass_params__"):
        return _mistake(
            kind,
            "is no dataclass",
            "must be decorated by @dataclass(frozen=True, kw_only=True)",
        )
    return None


def kind_mistake(kind: str, thing: object) -> Mistake | None:
    """Error in an object that is registered under a kind; None if there is none."""
    contract = CONTRACTS.get(kind)
    if contract is None:
        return None
    if contract.made:
        return _object_mistake(thing, contract)
    if contract.function and inspect.isfunction(thing):
        words = _call_mistake(thing.__name__, thing, [contract.function], 0)
        return words and _mistake(thing, *words)
    if not contract.base:
        return None
    module, _, name = contract.base.rpartition(".")
    if not isinstance(thing, type) or not issubclass(
        thing, getattr(import_module(module), name)
    ):
        return _mistake(
            thing, f"is {_text_of(thing)}", f"must be a subclass of {contract.base}"
        )
    taken = [each for each in NAMING if each in (field_names(thing) or ())]
    if taken:
        return _mistake(
            thing,
            f"has a field {taken[0]!r}",
            "must have another name; a table names its class by it",
        )
    fields = (
        inspect.signature(thing).parameters
        if contract.bare and dataclasses.is_dataclass(thing)
        else {}
    )
    for name, field in fields.items():
        # an __init__ of the user's own may take anything
        if field.default is field.empty and field.kind not in (
            field.VAR_POSITIONAL,
            field.VAR_KEYWORD,
        ):
            return _mistake(
                thing,
                f"has a field {name!r} without a default",
                "is made by its name alone",
            )
    return class_mistake(thing)


def refuse_mistake(mistake: Mistake | None, kind: str, name: str) -> None:
    """Refuse a registered object that has an error.

    Raises:
        RegistryError: one line with file, line, kind and name.
    """
    if mistake is not None:
        raise RegistryError(
            str(dataclasses.replace(mistake, owner=f"{kind} {name!r}:"))
        )


Words = tuple[str, str]
"""What is wrong, and what must be instead."""


def _mistake(thing: object, what: str, instead: str) -> Mistake:
    return Mistake(_text_of(thing), place_of(thing), what, instead)


def _object_mistake(thing: object, contract: Contract) -> Mistake | None:
    """Error in an object that must have the functions of a contract; None if there is
    none.
    """
    for name, method in contract.methods.items():
        function = getattr(thing, name, None)
        # a class in place of an object has the functions, too, but they lack their
        # object
        if isinstance(thing, type) or not callable(function):
            if not method.needed(thing):
                continue
            call = f"{name}({method.arguments})"
            return _mistake(
                thing,
                f"is {_text_of(thing)}",
                f"must be {contract.made}, called as {call}",
            )
        words = _call_mistake(name, function, method.arguments.split(", "), 0)
        if words:
            return _mistake(function, *words)
    return None


def _text_of(thing: object) -> str:
    """Name of a class or function, or text of another object, for a message."""
    return (
        thing.__name__
        if inspect.isfunction(thing) or isinstance(thing, type)
        else shown(thing)
    )


def _members(bases: list[type]) -> Iterator[tuple[str, object]]:
    """Public methods and attributes of the library's base classes, the highest base
    first, each name once.
    """
    seen: set[str] = set()
    for each in reversed(bases):
        for name, given in vars(each).items():
            if not name.startswith("_") and name not in seen:
                seen.add(name)
                yield name, given


def _function_mistake(
    name: str, member: object, given: Callable[..., object]
) -> Words | None:
    """Reason why an attribute cannot override a method of its base class; None if it
    can.
    """
    # without self, which a caller does not give
    parameters = list(inspect.signature(given).parameters)[1:]
    function = (
        member.__func__ if isinstance(member, (staticmethod, classmethod)) else member
    )
    if isinstance(member, property) or not callable(function):
        text = "a property" if isinstance(member, property) else shown(member)
        return (
            f"has {name} = {text}",
            f"must be a function, called as {name}({', '.join(parameters)})",
        )
    # a function and a class method are given one more than they are called with, a
    # static one and an object are not
    return _call_mistake(
        name,
        function,
        parameters,
        int(inspect.isfunction(member) or isinstance(member, classmethod)),
    )


def _call_mistake(
    name: str, function: Callable[..., object], parameters: list[str], hidden: int
) -> Words | None:
    """Reason why a function does not accept the given arguments; None if it does."""
    call = f"{name}({', '.join(parameters)})"
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):
        return None  # built in: it has no signature to look at
    try:
        signature.bind(*[None] * (len(parameters) + hidden))
    except TypeError as error:
        return f"cannot be called as {call}", f"is {name}{signature}, {error}"
    for place, own in enumerate(
        list(signature.parameters)[hidden : hidden + len(parameters)]
    ):
        # the same names in another order would be bound silently to the wrong values
        if own in parameters and own != parameters[place]:
            return (
                f"takes {own!r} in {name} where {parameters[place]!r} is given",
                f"is called as {call}",
            )
    return None
