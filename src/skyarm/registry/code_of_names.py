"""Classes and functions by module and name, for records that are read back; nothing is run to find them.

A file of results may name code, and never brings any. A name is looked up in this package, in plugins that are loaded,
and in modules whose classes or functions have been registered in this process; nowhere else.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Mapping
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

from skyarm.files import shown
from skyarm.registry.plugins import FILE_MODULE, file_modules, identities
from skyarm.registry.registrations import KINDS, LOADED_BY, SHIPPED, RegistryError, registrations


def code_of(name: str, plugins: Mapping[str, str]) -> Any:
    """The class or function of a name ``module:qualified.name``.

    Args:
        name: as :func:`skyarm.records.plain.dotted` gives it.
        plugins: identities of the plugins that were loaded when the name was written.

    Raises:
        RegistryError: one line: the plugin that is not loaded or has changed, or a name that is not there.
    """
    module, _, path = name.partition(":")
    found: Any = _module(module, name, plugins)
    for part in path.split("."):
        found = getattr(found, part, None)
    if found is None:
        raise RegistryError(f"{shown(name)}: is not there any more; it was written by another version")
    return found


def _module(module: str, name: str, plugins: Mapping[str, str]) -> ModuleType:
    if module.split(".", maxsplit=1)[0] == SHIPPED:
        try:
            return import_module(module)
        except ImportError:
            raise RegistryError(f"{shown(name)}: is not there any more; it was written by another version") from None
    if module in file_modules():
        return file_modules()[module]
    require_plugins([name], plugins)
    if module in sys.modules and module.split(".", maxsplit=1)[0] in _registered():
        return sys.modules[module]
    absent = [file for file in plugins if file not in identities()]
    needed = f"; plugins of then that are not loaded: {', '.join(absent)}" if absent else ""
    raise RegistryError(
        f"{shown(name)}: nothing of this module is registered here, load its plugin: "
        f"{LOADED_BY.format('FILE.py')}{needed}"
    )


def require_plugins(names: Iterable[str], plugins: Mapping[str, str]) -> None:
    """Every plugin's file that names stand in is loaded.

    Args:
        names: as :func:`code_of` takes them; those of other modules are passed over.
        plugins: identities of the plugins that were loaded when the names were written.

    Raises:
        RegistryError: one line: all that are not loaded, or have changed.
    """
    modules = {name.partition(":")[0] for name in names} - set(file_modules())
    missing = []
    for file, identity in plugins.items():
        if f"{FILE_MODULE}{Path(file).stem}_{identity.removeprefix('sha256:')[:8]}" not in modules:
            continue
        here = identities().get(file)
        why, which = "is not loaded", "it"
        if here is not None:
            why, which = f"has changed, it is {here[:15]}... now", "the file of then"
        missing.append(f"plugin {file} ({identity[:15]}...) {why}: load {which} by {LOADED_BY.format(file)}")
    if missing:
        raise RegistryError("; ".join(missing))


def _registered() -> set[str]:
    """Packages, or modules that stand alone, of everything that was registered from outside."""
    return {module.split(".")[0] for module in _modules()}


def _modules() -> Iterator[str]:
    for kind in KINDS:
        for row in registrations(kind).values():
            if row.source != SHIPPED:
                text = isinstance(row.target, str)
                yield row.target.partition(":")[0] if text else str(getattr(row.target, "__module__", ""))
