"""Plugins: files from the command line and installed packages that register additional
names.

A file that is loaded runs as code. Therefore only the command line, :func:`load_plugin`
and installed packages load any: a scenario file may name what it needs, and never runs
it. A plugin has an identity: SHA-256 of the file, or distribution and version. Modules
beside a file that it imports have one each, too. Results carry the identities of the
plugins that were loaded, and processes that fly for others load the same ones.
"""

from __future__ import annotations

import re
import sys
import warnings
from collections.abc import Iterable, Mapping
from importlib import import_module
from importlib.abc import SourceLoader
from importlib.machinery import ModuleSpec
from importlib.util import module_from_spec, spec_from_file_location, spec_from_loader
from pathlib import Path
from traceback import walk_tb
from types import CodeType, ModuleType
from typing import Any

from skyarm.records.files import shown, unreadable
from skyarm.records.files.packages import may_extend
from skyarm.records.files.user_code import (
    INSTALLED,
    MISSING,
    file_of,
    identity_of,
    is_beside,
    number_duplicates,
)
from skyarm.records.immutable import positional
from skyarm.records.registry.contract import kind_mistake, refuse_mistake
from skyarm.records.registry.registrations import (
    API,
    AT_FIRST_USE,
    LOADED_BY,
    SHIPPED,
    RegistryError,
    add,
    own_registrations,
    registering_for,
)

GROUP = "skyarm.plugins"
"""Entry-point group of installed packages; each entry point names a module that
registers."""

FILE_MODULE = "skyarm_plugin_"
"""Prefix of the module name of a plugin file; its stem and eight digits of its SHA-256
follow."""


@positional
class Plugin:
    """Loaded plugin: its name, digest and imported modules.

    Attributes:
        name: path of the file, or the distribution's name. identity: "sha256:..." or
            "version ...".
        beside: path and identity of each module of the file's own folder, and below it,
            that it imported.
    """

    name: str
    identity: str
    beside: tuple[tuple[str, str], ...] = ()

    def identities(self) -> list[tuple[str, str]]:
        """File name and digest of the plugin and of the modules that it imported from
        its folder.
        """
        # a path relative to the plugin's folder is the same on another machine
        folder = Path(self.name).parent
        beside = [
            (Path(file).relative_to(folder).as_posix(), identity)
            for file, identity in self.beside
        ]
        return [(Path(self.name).name, self.identity), *beside]


Sources = dict[str, tuple[str, bytes]]
"""Module name -> path of its file as given, and the file's content."""

_LOADED: dict[str, Plugin] = {}
_MODULES: dict[str, ModuleType] = {}
_SOURCES: dict[str, Sources] = {}
"""Content, at loading time, of each plugin file and of the modules in its folder."""

_SENT: Sources = {}
"""Content of plugin modules that another process sent; their files need not exist
here."""


class _SentModules(SourceLoader):
    """Importer of modules that another process sent, under the names and paths that
    they have in that process.
    """

    def find_spec(self, name: str, *_: object) -> ModuleSpec | None:
        if name in _SENT:
            return spec_from_loader(name, self)
        folder = any(each.startswith(f"{name}.") for each in _SENT)
        return ModuleSpec(name, None, is_package=True) if folder else None

    def get_filename(self, fullname: str) -> str:
        return _SENT[fullname][0]

    def get_data(self, path: str) -> bytes:
        content = _content(path)
        if content is None:
            raise FileNotFoundError(path)
        return content


_FINDER = _SentModules()


def _content(file: str) -> bytes | None:
    """Content of a file, as another process sent it or as it is now; None if it cannot
    be read.
    """
    sent = next((content for path, content in _SENT.values() if path == file), None)
    try:
        return Path(file).read_bytes() if sent is None else sent
    except OSError:
        return None


def _identity(file: str) -> str:
    content = _content(file)
    return MISSING if content is None else identity_of(content)


def loaded_plugins() -> tuple[Plugin, ...]:
    """All plugins loaded in this process, in the order of loading."""
    return tuple(_LOADED.values())


def plugin_of(module: str) -> Plugin | None:
    """Plugin whose file, or a file imported from its folder, defines a module; None for
    other modules.
    """
    file = file_of(sys.modules.get(module))
    for key, plugin in _LOADED.items():
        # by the file, because a module beside the plugin has a name of its own
        if (key in _MODULES and _MODULES[key].__name__ == module) or file in dict(
            plugin.beside
        ):
            return plugin
    return None


def is_of_plugin(code: CodeType) -> bool:
    """True if code belongs to an installed package, or to a file that is named like one
    of a loaded plugin.
    """
    file = code.co_filename
    return INSTALLED in file or Path(file).name in {
        Path(each).name for each in identities()
    }


def identities() -> dict[str, str]:
    """Digests of the loaded plugins by file or distribution name, for the metadata of
    results.

    The order in which they were loaded does not count.
    """
    return number_duplicates(
        sorted({pair for plugin in loaded_plugins() for pair in plugin.identities()})
    )


def known_names() -> set[str]:
    """Names of all loaded plugins, which a scenario file may require."""
    return {*identities()}


def load_plugin(path: str | Path, expected: str | None = None) -> ModuleType:
    """Run a plugin file, register the objects that it defines, and return its module.

    Args:
        path: path of the .py file.
        expected: its identity, where another process loaded it before.

    Raises:
        RegistryError: one line: it cannot be read, is not the expected one, was made
            for another version of the extension points, fails, or takes a name that is
            taken. Nothing of it stays registered then.
    """
    # eight digits of the digest, so that two versions of a file are two modules
    name = f"{FILE_MODULE}{Path(path).stem}_{expected[7:15]}" if expected else ""
    if name in _SENT:
        (given, content), key = _SENT[name], str(path)
        file = Path(given)
    else:
        file = Path(path)
        reason = unreadable(file) if file.suffix == ".py" else "must be a .py file"
        if reason:
            raise RegistryError(f"plugin = {shown(path)}: {reason}")
        content, key = file.read_bytes(), str(file.resolve())
    identity = identity_of(content)
    # a worker must fly the same code as the process that sent the work
    if expected is not None and identity != expected:
        raise _change_error(str(path))
    if key in _LOADED:
        if _LOADED[key].identity != identity:
            raise _change_error(str(path))
        for beside, first in _LOADED[key].beside:
            if _identity(beside) != first:
                raise _change_error(str(path), beside)
        return _MODULES[key]
    # modules that were there before are not of the plugin
    name, before = f"{FILE_MODULE}{file.stem}_{identity[7:15]}", set(sys.modules)
    try:
        module = _run(name, file, content)
    except RegistryError:
        for other in _beside(key, before):
            sys.modules.pop(other)  # mended, it is to be run again
        raise
    files = {other: file_of(sys.modules[other]) for other in _beside(key, before)}
    sources = {
        other: (each, source)
        for other, each in files.items()
        if (source := _content(each)) is not None
    }
    _SOURCES[key] = {name: (str(file), content), **sources}
    _LOADED[key] = Plugin(
        key,
        identity,
        tuple((each, _identity(each)) for each in sorted({*files.values()})),
    )
    _MODULES[key] = module
    return module


def _beside(key: str, before: set[str]) -> list[str]:
    """Names of modules, newly imported by a plugin, whose files are in the plugin's
    folder.
    """
    folder = str(Path(key).parent)
    # a copy, since the table of modules may change meanwhile
    since = {
        name: file_of(module)
        for name, module in [*sys.modules.items()]
        if name not in before
    }
    return [
        name for name, file in since.items() if file != key and is_beside(file, folder)
    ]


def _change_error(path: str, beside: str = "") -> RegistryError:
    which = f"{shown(beside)}, which it imports, " if beside else ""
    return RegistryError(
        f"plugin = {shown(path)}: {which}has changed since it was loaded first; start"
        " again"
    )


def _run(name: str, file: Path, content: bytes) -> ModuleType:
    spec = spec_from_file_location(name, file)
    if spec is None:
        raise RegistryError(f"plugin = {shown(file)}: must be a .py file")
    module = module_from_spec(spec)
    # registered before it runs, as an import does: dataclasses look their module up
    sys.modules[name] = module
    try:
        with registering_for(str(file)):
            # the bytes whose digest is kept, not what the file holds by now
            exec(compile(content, str(file), "exec"), module.__dict__)
            _require_version(module, str(file))
            _require_right(str(file))
    except RegistryError:
        sys.modules.pop(name, None)
        raise
    # a plugin may call sys.exit, which must not end the command in silence
    except (Exception, SystemExit) as error:
        sys.modules.pop(name, None)
        raise RegistryError(
            f"plugin = {shown(file)}: {_where(error, file)}{_words(error)}"
        ) from error
    return module


def _where(error: BaseException, file: Path) -> str:
    """Text with the line of a plugin's file at which an error occurred."""
    if isinstance(error, SyntaxError):
        return f"line {error.lineno}: " if error.lineno else ""
    lines = [
        line
        for frame, line in walk_tb(error.__traceback__)
        if frame.f_code.co_filename == str(file)
    ]
    # of several calls within the file the innermost
    return f"line {lines[-1]}: " if lines else ""


def _words(error: BaseException) -> str:
    return " ".join(f"{type(error).__name__}: {error}".split())


def _require_version(module: ModuleType, name: str) -> None:
    made_for: object = getattr(module, "SKYARM_API", API)
    if made_for != API:
        raise RegistryError(
            f"plugin = {shown(name)}: was made for version {shown(made_for)} of the"
            f" extension points; this is {API}"
        )


def _require_right(source: str) -> None:
    """Raise an error if an object that a plugin registered does not have the required
    signature.
    """
    for row in own_registrations():
        # a text is where it is found, which nobody has read yet
        if row.source == source and not isinstance(row.target, str):
            refuse_mistake(kind_mistake(row.kind, row.target), row.kind, row.name)


FROM_FILE = re.compile(r"(?P<file>.+\.py):(?P<maker>[A-Za-z_]\w*)")
"""Pattern of a user's law on the command line: FILE.py:make, the file and its function
that makes the controller."""


def is_law_of_file(text: object) -> bool:
    """True for a text of the form FILE.py:make, which names a control law in a user's
    file.
    """
    return isinstance(text, str) and FROM_FILE.fullmatch(text) is not None


def law_of_file_name(text: str) -> str:
    """Name of a law FILE.py:make for results, without its folder: ``make of FILE.py``;
    other texts unchanged.
    """
    match = FROM_FILE.fullmatch(text)
    return text if match is None else f"{match['maker']} of {Path(match['file']).name}"


def law_of_file_key(text: str) -> str:
    """Text FILE.py:make with the path of its file made absolute; other texts
    unchanged.
    """
    match = FROM_FILE.fullmatch(text)
    return (
        text if match is None else f"{Path(match['file']).resolve()}:{match['maker']}"
    )


def register_law_of_file(text: str) -> bool:
    """Load and register a law given as FILE.py:make; False if the text has another
    form.

    Only the command line does this: a file that is read never runs code.

    Raises:
        RegistryError: the file cannot be loaded, or has no such function.
    """
    match = FROM_FILE.fullmatch(text)
    if match is None:
        return False
    make = getattr(load_plugin(match["file"]), match["maker"], None)
    if not callable(make):
        raise RegistryError(
            f"law = {shown(text)}: {match['file']} must have a function"
            f" {match['maker']!r}"
        )
    add(
        "law",
        text,
        make,
        f"{match['maker']} of {match['file']}",
        match["file"],
        letters=text,
    )
    return True


def register_loaded_law(text: str) -> bool:
    """Register a law given as FILE.py:make if its file is already loaded; False if it
    is not.

    Nothing is run: a file that is read may name such a law, as it may name any other.

    Raises:
        RegistryError: the file has no such function.
    """
    match = FROM_FILE.fullmatch(text)
    if match is None or str(Path(match["file"]).resolve()) not in _LOADED:
        return False
    return register_law_of_file(text)


def load_installed() -> None:
    """Load the plugins of installed packages; a broken one is skipped with a
    warning.
    """
    if not may_extend(GROUP):
        return
    # its import takes a fifth of NumPy's
    from importlib import metadata

    for entry in metadata.entry_points(group=GROUP):
        distribution = entry.dist
        name = distribution.name if distribution is not None else entry.value
        version = distribution.version if distribution is not None else "unknown"
        try:
            with registering_for(f"{name} {version}"):
                _require_version(entry.load(), name)
                _require_right(f"{name} {version}")
        # an installed package that is broken must not keep the library from running
        except (Exception, SystemExit) as error:
            warnings.warn(
                f"plugin {name} {version} is left out: {_words(error)}",
                RuntimeWarning,
                stacklevel=2,
            )
            continue
        _LOADED[f"{name} {entry.name}"] = Plugin(name, f"version {version}")


AT_FIRST_USE.append(load_installed)


def sources_of_plugins() -> Sources:
    """Sources of the modules loaded from plugin files and from the folders of those
    files, for another process.
    """
    sources = {
        name: source
        for key in _LOADED
        for name, source in _SOURCES.get(key, {}).items()
    }
    folders = {Path(key).parent for key in _LOADED if key in _SOURCES}
    # a copy of the table of modules, which an import in another thread may change
    for name, file in (
        (name, file_of(module)) for name, module in [*sys.modules.items()] if folders
    ):
        places = [folder.joinpath(*name.split(".")) for folder in folders]
        # a script may have imported it before the plugin did
        if name not in sources and any(
            file in (f"{place}.py", str(place / "__init__.py")) for place in places
        ):
            content = _content(file)
            sources |= {} if content is None else {name: (file, content)}
    return sources


def load_again(
    plugins: Iterable[Plugin], sources: Mapping[str, tuple[str, bytes]] | None = None
) -> None:
    """Load the same plugins as another process, before objects of that process are
    unpickled.

    Args:
        plugins: plugins of that process.
        sources: their modules as it loaded them; without, they are read from the same
            files.

    Raises:
        RegistryError: one is missing here or is not the same.
    """
    _SENT.update(sources or {})
    # first, so that a file of the same name here is not imported in place of what was
    # sent
    if _SENT and _FINDER not in sys.meta_path:
        sys.meta_path.insert(0, _FINDER)
    here = {plugin.name: plugin.identity for plugin in loaded_plugins()}
    for plugin in plugins:
        if plugin.identity.startswith("sha256:"):
            load_plugin(plugin.name, plugin.identity)
            key = (
                plugin.name
                if plugin.name in _LOADED
                else str(Path(plugin.name).resolve())
            )
            here_now = dict(_LOADED[key].beside)
            for beside, identity in plugin.beside:
                if here_now.get(beside, _identity(beside)) != identity:
                    raise _change_error(plugin.name, beside)
        elif here.get(plugin.name) != plugin.identity:
            raise RegistryError(
                f"plugin {plugin.name}: must be installed here as {plugin.identity}"
            )


def code_of(name: str, plugins: Mapping[str, str]) -> Any:
    """Find the class or function that a text ``module:qualified.name`` denotes.

    Args:
        name: text of :func:`skyarm.records.plain.dotted_name`.
        plugins: identities of the plugins that were loaded when the name was written.

    Raises:
        RegistryError: one line: the plugin that is not loaded or has changed, or a name
            that is not there.
    """
    module, _, path = name.partition(":")
    denoted: object = _module(module, name, plugins)
    for part in path.split("."):
        denoted = getattr(denoted, part, None)
    if denoted is None:
        raise RegistryError(
            f"{shown(name)}: is not there any more; it was written by another version"
        )
    return denoted


def _module(module: str, name: str, plugins: Mapping[str, str]) -> ModuleType:
    if module.split(".", maxsplit=1)[0] == SHIPPED:
        try:
            return import_module(module)
        except ImportError:
            raise RegistryError(
                f"{shown(name)}: is not there any more; it was written by another"
                " version"
            ) from None
    loaded = {each.__name__: each for each in _MODULES.values()}
    if module in loaded:
        return loaded[module]
    _require_plugin(module, plugins)
    if (
        # a module of a package that registers was trusted already; any other stays
        # unimported
        module in sys.modules
        and module.split(".", maxsplit=1)[0] in _registered_packages()
    ):
        return sys.modules[module]
    absent = [file for file in plugins if file not in identities()]
    needed = (
        f"; plugins of then that are not loaded: {', '.join(absent)}" if absent else ""
    )
    raise RegistryError(
        f"{shown(name)}: nothing of this module is registered here, load its plugin: "
        f"{LOADED_BY.format('FILE.py')}{needed}"
    )


def _require_plugin(module: str, plugins: Mapping[str, str]) -> None:
    """Raise an error if a plugin's module is not loaded or its file has changed."""
    for file, identity in plugins.items():
        if (
            f"{FILE_MODULE}{Path(file).stem}_{identity.removeprefix('sha256:')[:8]}"
            != module
        ):
            continue
        # the first 15 letters are "sha256:" and the eight digits of the module's name
        here = identities().get(file)
        why, which = "is not loaded", "it"
        if here is not None:
            why, which = f"has changed, it is {here[:15]}... now", "the file of then"
        words = (
            f"plugin {file} ({identity[:15]}...) {why}: load {which} by"
            f" {LOADED_BY.format(file)}"
        )
        raise RegistryError(words)


def _registered_packages() -> set[str]:
    """Names of the packages or top-level modules that registered additional names."""
    targets = (row.target for row in own_registrations())
    modules = (
        each if isinstance(each, str) else str(getattr(each, "__module__", ""))
        for each in targets
    )
    return {module.partition(":")[0].partition(".")[0] for module in modules}
