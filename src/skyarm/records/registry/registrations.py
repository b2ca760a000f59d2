"""Registry: names of wind fields, forces, sensors, control laws and other extensions,
with their locations.

Names of the library are listed in :mod:`skyarm.records.registry.shipped`; users add
names in the same way: by a decorator of this module, an entry point of an installed
package, or ``--plugin FILE.py`` (:mod:`skyarm.records.registry.plugins`). The registry
imports nothing until a name is used.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from importlib import import_module
from typing import Any, TypeVar

from skyarm.records.files import must_be_one_of, shown
from skyarm.records.files.packages import RIVAL, installed_versions, rival_of_mujoco
from skyarm.records.files.user_code import place_of
from skyarm.records.immutable import positional
from skyarm.records.registry.shipped import KINDS, OPTIONS, reserved_for
from skyarm.records.registry.shipped import SHIPPED as SHIPPED_NAMES

Thing = TypeVar("Thing")

API = 1
"""Version of the extension interface; a plugin may state the version that it was
written for as ``SKYARM_API``."""


LOADED_BY = "--plugin {0} or skyarm.load_plugin('{0}')"
"""Text for messages: how to load a plugin file, on the command line and in Python."""


class RegistryError(ValueError):
    """Error: a registered name is unknown, already taken, or cannot be loaded."""


@positional
class Registration:
    """Registry entry of a user's or the library's object: kind, name, object or its
    location, title and source.

    Attributes:
        kind: a key of ``KINDS``. name: name in files and on the command line.
        target: the object, or its location "module:attribute", which is imported at the
            first use.
        title: one-line description. source: library or plugin that registered it.
    """

    kind: str
    name: str
    target: object
    title: str
    source: str

    def load(self) -> Any:
        """Import and return the registered object.

        Raises:
            RegistryError: its module cannot be imported or lacks it.
        """
        if not isinstance(self.target, str):
            return self.target
        module, _, attribute = self.target.partition(":")
        try:
            # the older mujoco overwrites files of mujoco-core, and its import error
            # would not say so
            if "mujoco" in module and (
                rival := rival_of_mujoco(installed_versions([RIVAL]))
            ):
                raise ImportError(rival)
            return getattr(import_module(module), attribute)
        except (ImportError, AttributeError) as error:
            raise RegistryError(
                f"{self.kind} {self.name!r} of {self.source}: cannot be loaded"
                f" ({error})"
            ) from error


_FOUND: dict[str, dict[str, Registration]] = {kind: {} for kind in KINDS}
_SOURCE = ["this process"]
_READY: list[bool] = []

AT_FIRST_USE: list[Callable[[], None]] = []
"""Functions called once the shipped names are registered: plugins of installed packages
are loaded by one of them."""


LETTERS = "_-.+"
"""Characters allowed in registered names besides letters and digits."""


def add(
    kind: str,
    name: str,
    target: object,
    title: str = "",
    source: str = "",
    letters: str = LETTERS,
) -> None:
    """Register a name; ``letters`` are the characters allowed besides letters and
    digits.

    Raises:
        RegistryError: an unknown kind, no name, or a name that another source has
            taken.
    """
    if kind not in KINDS:
        raise RegistryError(f"kind = {shown(kind)}: must be one of {', '.join(KINDS)}")
    if (
        not isinstance(name, str)
        or not name
        or not all(c.isalnum() or c in letters for c in name)
    ):
        raise RegistryError(
            f"{kind}: name = {shown(name)}: must be letters, digits, '_', '-' or '.'"
        )
    new = Registration(kind, name, target, title, source or _SOURCE[-1])
    # names of the library are reserved, so that a file means the same everywhere
    if new.source != SHIPPED and (taken := reserved_for(kind, name)):
        raise RegistryError(
            f"{kind} {name!r}: is {taken} of {SHIPPED} and is registered by"
            f" {new.source}; rename it"
        )
    # shipped names are added while the table is being made ready
    old = _ready()[kind].get(name) if source != SHIPPED else _FOUND[kind].get(name)
    if old is not None and old != new:
        raise RegistryError(
            f"{kind} {name!r}: is registered by {old.source} and by {new.source};"
            " rename one of them"
        )
    _FOUND[kind][name] = new


SHIPPED = "skyarm"
"""Source of the registrations that ship with the library."""


def take_over(row: Registration) -> None:
    """Register an entry of another process, unless its name is already registered
    here.
    """
    # setdefault: a name that is registered here already wins over the sent one
    _ready()[row.kind].setdefault(row.name, row)


def _ready() -> dict[str, dict[str, Registration]]:
    """Registry entries of all kinds, after the library and installed packages have
    registered theirs.
    """
    if not _READY:
        _READY.append(True)
        for kind, rows in SHIPPED_NAMES.items():
            for name, (target, title) in rows.items():
                add(kind, name, target, title, SHIPPED)
        for load in AT_FIRST_USE:
            load()
    return _FOUND


def registrations(kind: str) -> Mapping[str, Registration]:
    """Registry entries of a kind by name, in the order of registration."""
    return _ready()[kind]


def own_registrations() -> Iterator[Registration]:
    """Registry entries of all kinds that do not ship with the library."""
    for rows in _ready().values():
        yield from (row for row in rows.values() if row.source != SHIPPED)


def names(kind: str, *, shipped: bool = True) -> tuple[str, ...]:
    """Registered names of a kind; without those that the library ships unless
    ``shipped``.
    """
    return tuple(
        name
        for name, each in registrations(kind).items()
        if shipped or each.source != SHIPPED
    )


def find(kind: str, name: object, field: str = "") -> Any:
    """Registered object with a given kind and name; an unknown name raises an error.

    Args:
        kind: a key of ``KINDS``, or several with a space between them.
        name: entry of a file.
        field: field of the name, for the message; the kind if left out.

    Raises:
        RegistryError: no such name, with what there is and what was perhaps meant.
    """
    # several kinds share one space of names in a table, such as air and force
    rows = {
        name: row for each in kind.split() for name, row in registrations(each).items()
    }
    if not isinstance(name, str) or name not in rows:
        more = (
            f"; names of one's own come by {LOADED_BY.format('FILE.py')}"
            if field
            else ""
        )
        raise RegistryError(
            f"{field or kind} = {shown(name)}: {must_be_one_of(rows, name)}{more}"
        )
    return rows[name].load()


def function_of_option(option: str) -> Any:
    """Function or class by which a leaf performs an option, such as ``run --ros``, or a
    task of the engine.
    """
    module, _, name = OPTIONS[option].partition(":")
    return getattr(import_module(module), name)


def name_of(kind: str, thing: object) -> str | None:
    """Name under which a class is registered, without importing modules; None if there
    is none.
    """
    if not hasattr(thing, "__qualname__"):
        return None
    # by text, so that the shipped class need not be imported to be compared
    ours = f"{thing.__module__}:{thing.__qualname__}"
    return next(
        (
            name
            for name, row in registrations(kind).items()
            if row.target is thing or row.target == ours
        ),
        None,
    )


@contextmanager
def registering_for(source: str) -> Iterator[None]:
    """Context manager that credits registrations to a source, such as a plugin, and
    drops them after an error.
    """
    # whole tables are kept, because a plugin that fails may have registered several
    # names
    before = {kind: dict(rows) for kind, rows in _ready().items()}
    _SOURCE.append(source)
    try:
        yield
    except BaseException:
        _FOUND.update(before)
        raise
    finally:
        _SOURCE.pop()


class Register:
    """Decorators that register a class or function: ``@register.force("ground_effect",
    title="...")``.
    """

    def __getattr__(self, kind: str) -> Callable[..., Callable[[Thing], Thing]]:
        """Decorator that registers objects of one kind, as ``register.force`` does."""
        if kind not in KINDS:
            raise AttributeError(f"register.{kind}: there are {', '.join(KINDS)}")

        def decorator(name: str, title: str = "") -> Callable[[Thing], Thing]:
            # the object itself: a decorator without brackets registers nothing
            if callable(name):
                words = f'must be a text, as @skyarm.register.{kind}("name")'
                raise RegistryError(
                    f"{place_of(name)}: register.{kind}: name = {shown(name)}: {words}"
                )

            def decorate(thing: Thing) -> Thing:
                summary = " ".join(
                    (thing.__doc__ or "").strip().partition("\n\n")[0].split()
                )
                add(kind, name, thing, title or summary.rstrip("."))
                return thing

            return decorate

        return decorator


register = Register()
