"""Plugins: files of the command line and installed packages. What is broken costs one
line and registers nothing.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import sys
import types
from importlib import metadata
from pathlib import Path

import pytest

from skyarm import Force
from skyarm.records.files import packages
from skyarm.records.registry import (
    KINDS,
    RegistryError,
    find,
    names,
    plugins,
    register,
    registrations,
)
from skyarm.records.registry.plugins import (
    Plugin,
    identities,
    load_again,
    load_installed,
    load_plugin,
    loaded_plugins,
    register_law_of_file,
)
from support.components import registry_kept

OWN = Path(__file__).parents[2] / "support" / "own_plugin.py"


@pytest.fixture(autouse=True)
def _kept():
    with registry_kept():
        yield


def everything():
    return {kind: dict(registrations(kind)) for kind in KINDS}


def written(folder, text, name="mine.py"):
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def test_a_file_registers_its_names_under_its_path(tmp_path):
    path = Path(shutil.copy(OWN, tmp_path / "own_plugin.py"))
    module = load_plugin(path)
    assert find("force", "own_tether") is module.own.Tether
    assert find("plant", "own_plant") is module.OwnPlant
    assert (
        registrations("law")["own_law"].title
        == "The paper's law under a name of our own"
    )
    assert {
        registrations(kind)[name].source
        for kind, name in (("air", "own_shear"), ("law", "own_law"))
    } == {str(path)}
    digest = f"sha256:{hashlib.sha256(OWN.read_bytes()).hexdigest()}"
    assert loaded_plugins()[-1] == Plugin(str(path), digest)
    assert identities()["own_plugin.py"] == digest


def test_a_file_is_run_once(tmp_path):
    path = written(
        tmp_path, "from skyarm import Force, register\nregister.force('once')(Force)\n"
    )
    first = load_plugin(path)
    assert load_plugin(str(path)) is first
    assert load_plugin(tmp_path / ".." / tmp_path.name / "mine.py") is first
    assert [plugin.name for plugin in loaded_plugins()].count(str(path)) == 1


def test_a_file_that_has_changed_is_refused(tmp_path):
    path = written(tmp_path, "x = 1\n")
    load_plugin(path)
    path.write_text("x = 2\n")
    words = "mine.py': has changed since it was loaded first; start again$"
    with pytest.raises(RegistryError, match=words):
        load_plugin(path)
    other = written(tmp_path, "x = 3\n", "other.py")
    with pytest.raises(RegistryError, match="has changed since it was loaded first"):
        load_plugin(other, expected="sha256:" + 64 * "0")
    assert "other.py" not in identities()


BROKEN = {
    "syntax": ("import skyarm\nx = = 1\n", r"line 2: SyntaxError: invalid syntax"),
    "raises": (
        "a = 1\n\n\nb = 1 / 0\n",
        r"line 4: ZeroDivisionError: division by zero$",
    ),
    "raises_below": (
        "f = lambda: 1 / 0\n\n\nf()\n",
        r"line 1: ZeroDivisionError: division by zero$",
    ),
    "two_lines": (
        "a = 1\nraise ValueError('two\\nlines')\n",
        r"line 2: ValueError: two lines$",
    ),
    "raises_elsewhere": (
        "import json\n\njson.loads('{')\n",
        r"line 3: JSONDecodeError: Expecting",
    ),
    "no_module": (
        "import no_such_module_anywhere\n",
        r"line 1: ModuleNotFoundError: No module named",
    ),
    "exits": ("import sys\nsys.exit(0)\n", r"line 2: SystemExit: 0$"),
    "another_version": (
        "SKYARM_API = 7\n",
        r"was made for version 7 of the extension points; this is 1$",
    ),
    "version_text": (
        "SKYARM_API = '1'\n",
        r"was made for version '1' of the extension points; this is 1$",
    ),
    "not_text": (b"x = '\xff\xfe'\n", r"SyntaxError: "),
    "nul": (
        b"x = 1\0\n",
        r"(SyntaxError|ValueError): source code string cannot contain null bytes",
    ),
}


@pytest.mark.parametrize("what", sorted(BROKEN))
def test_a_broken_file_registers_nothing_and_is_one_line(tmp_path, what):
    text, words = BROKEN[what]
    head = b"from skyarm import Force, register; register.force('broken_one')(Force)\n"
    before, known = everything(), loaded_plugins()
    for body in (
        text,
        head.replace(b"\n", b"; ") + text.encode() if isinstance(text, str) else text,
    ):
        path = written(tmp_path, body)
        with pytest.raises(RegistryError, match=words) as caught:
            load_plugin(path)
        assert str(caught.value).startswith(f"plugin = {str(path)!r}: ")
        assert "\n" not in str(caught.value)
        assert "line None" not in str(caught.value)
        assert (everything(), loaded_plugins()) == (before, known)
    # once it is mended it loads
    written(tmp_path, head)
    load_plugin(path)
    assert "broken_one" in names("force")


def test_a_file_that_takes_a_taken_name_registers_nothing(tmp_path):
    register.force("mine_first")(type("T", (), {}))
    body = "from skyarm import register\n"
    body += "".join(
        f"register.force({name!r})(type('T', (), {{}}))\n"
        for name in ("before", "mine_first", "after")
    )
    path = written(tmp_path, body)
    with pytest.raises(RegistryError) as caught:
        load_plugin(path)
    words = (
        f"force 'mine_first': is registered by this process and by {path}; rename one"
        " of them"
    )
    assert str(caught.value) == words
    assert {"before", "after"}.isdisjoint(names("force"))
    assert "mine.py" not in identities()


@pytest.mark.parametrize("name", ["plugin.txt", "plugin", "plugin.pyc"])
def test_only_python_files_are_plugins(tmp_path, name):
    with pytest.raises(RegistryError, match=r"^plugin = .*: must be a \.py file$"):
        load_plugin(written(tmp_path, "x = 1\n", name))


def test_a_file_that_is_not_there_is_said(tmp_path):
    with pytest.raises(RegistryError, match=r"^plugin = .*nowhere\.py': "):
        load_plugin(tmp_path / "nowhere.py")
    (tmp_path / "folder.py").mkdir()
    with pytest.raises(RegistryError, match=r"^plugin = .*folder\.py': "):
        load_plugin(tmp_path / "folder.py")


def test_the_law_of_a_file_has_the_name_of_the_command_line(tmp_path):
    path = Path(shutil.copy(OWN, tmp_path / "laws.py"))
    text = f"{path}:make"
    assert register_law_of_file(text)
    assert find("law", text).__name__ == "make"
    assert registrations("law")[text].source == str(path)
    assert register_law_of_file(text), "and again"
    for other in (
        "indi",
        "case1.toml",
        "laws.py",
        f"{path}:",
        ":make",
        f"{path}:1x",
        "",
    ):
        assert not register_law_of_file(other)
    with pytest.raises(
        RegistryError, match=r"^law = .*laws\.py:none': .*must have a function 'none'$"
    ):
        register_law_of_file(f"{path}:none")
    with pytest.raises(RegistryError, match=r"must have a function 'SKYARM_API'$"):
        register_law_of_file(f"{path}:SKYARM_API")


class Entry:
    """An installed package's entry point."""

    group = "skyarm.plugins"

    def __init__(self, name, load, version="1.2"):
        self.name, self.value, self._load = name, f"{name}.plugin", load
        self.dist = types.SimpleNamespace(name=f"dist-{name}", version=version)

    def load(self):
        return self._load()


def registering(*wanted, **attributes):
    def load():
        for name in wanted:
            register.force(name)(Force)
        if attributes.pop("broken", False):
            raise ImportError("no module named 'gone'")
        return types.SimpleNamespace(**attributes)

    return load


def installed(monkeypatch, *entries):
    def entry_points(*, group):
        return [entry for entry in entries if entry.group == group]

    monkeypatch.setattr(plugins, "may_extend", lambda group: True)
    monkeypatch.setattr(metadata, "entry_points", entry_points)
    load_installed()


def test_installed_packages_register_under_their_distribution(monkeypatch):
    installed(monkeypatch, Entry("pack", registering("from_pack"), "3.4"))
    assert registrations("force")["from_pack"].source == "dist-pack 3.4"
    assert identities()["dist-pack"] == "version 3.4"


@pytest.mark.parametrize(
    "folder",
    ["from_disk-2.0.dist-info", "from_disk.egg-info", "from_disk.egg/EGG-INFO"],
)
def test_a_package_on_disk_is_found_by_its_entry_points(tmp_path, monkeypatch, folder):
    monkeypatch.setattr(
        sys, "path", [each for each in sys.path if not os.path.isfile(each)]
    )
    assert not packages.may_extend(plugins.GROUP), "none is installed here"
    about, name = tmp_path / folder, f"from_disk_{len(folder)}"
    about.mkdir(parents=True)
    (about.parent / f"{name}.py").write_text(
        f"import skyarm\n\nskyarm.register.force({name!r})(skyarm.Force)\n"
    )
    (about / "entry_points.txt").write_text(f"[{plugins.GROUP}]\nown = {name}\n")
    for each in ("METADATA", "PKG-INFO"):
        (about / each).write_text(
            "Metadata-Version: 2.1\nName: from-disk\nVersion: 2.0\n"
        )
    monkeypatch.syspath_prepend(about.parent)
    load_installed()
    assert registrations("force")[name].source == "from-disk 2.0"


def test_a_zip_file_on_the_path_may_have_entry_points(tmp_path, monkeypatch):
    (tmp_path / "packages.zip").write_bytes(b"")
    monkeypatch.setattr(sys, "path", [str(tmp_path / "packages.zip")])
    assert packages.may_extend(plugins.GROUP)


def test_a_broken_package_costs_only_its_own_names(monkeypatch):
    entries = [
        Entry("first", registering("a_first")),
        Entry("broken", registering("a_half", broken=True)),
        Entry("old", registering("an_old", SKYARM_API=0)),
        Entry("clash", registering("a_clash", "a_first")),
        Entry("last", registering("a_last")),
    ]
    with pytest.warns(RuntimeWarning) as told:
        installed(monkeypatch, *entries)
    assert {"a_first", "a_last"} <= set(names("force"))
    assert {"a_half", "an_old", "a_clash"}.isdisjoint(names("force"))
    words = [str(each.message) for each in told]
    assert (
        words[0]
        == "plugin dist-broken 1.2 is left out: ImportError: no module named 'gone'"
    )
    assert words[1].startswith("plugin dist-old 1.2 is left out: ")
    assert "was made for version 0 of the extension points; this is 1" in words[1]
    assert (
        "force 'a_first': is registered by dist-first 1.2 and by dist-clash 1.2"
        in words[2]
    )
    assert len(words) == 3
    assert {"dist-broken", "dist-old", "dist-clash"}.isdisjoint(identities())


def test_another_process_must_have_the_same(tmp_path, monkeypatch):
    installed(monkeypatch, Entry("pack", registering("from_pack")))
    path = written(tmp_path, "x = 1\n")
    load_plugin(path)
    load_again(loaded_plugins())  # the same: nothing is said
    with pytest.raises(
        RegistryError,
        match=r"^plugin dist-pack: must be installed here as version 9\.9$",
    ):
        load_again([Plugin("dist-pack", "version 9.9")])
    with pytest.raises(
        RegistryError, match=r"^plugin absent: must be installed here as version 1$"
    ):
        load_again([Plugin("absent", "version 1")])
    with pytest.raises(RegistryError, match="has changed since it was loaded first"):
        load_again([Plugin(str(path), "sha256:" + 64 * "1")])
