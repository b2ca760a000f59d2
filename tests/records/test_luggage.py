"""What a process sends others along with its work: its plugins as it loaded them, and
names of its own.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

import skyarm
from skyarm.records.files.user_code import identity_of
from skyarm.records.registry import RegistryError, names
from skyarm.records.registry.plugins import (
    Plugin,
    identities,
    load_again,
    load_plugin,
    loaded_plugins,
)
from skyarm.records.registry.registrations import registrations
from skyarm.records.travel import luggage
from support.components import registry_kept

PLUGIN = """
import skyarm
import lug_package.inner
from lug_beside import GAIN
from lug_spaces.deep import DEPTH

@skyarm.register.law("lug_law")
def make(model):
    raise ValueError(GAIN + lug_package.inner.MORE + DEPTH)
"""

BESIDE = {
    "lug_beside.py": "GAIN = 1.0\n",
    "lug_package/__init__.py": "",
    "lug_package/inner.py": "MORE = 20.0\n",
    "lug_spaces/deep.py": "DEPTH = 300.0\n",  # in a folder without __init__.py
}

THERE = """
import json, sys, traceback
from skyarm.records.travel import unload
from skyarm.records.registry import find, names
from skyarm.records.registry.plugins import identities, loaded_plugins
unload(sys.stdin.buffer.read())
try:
    find("law", "lug_law")(None)
except ValueError as error:
    frame = traceback.extract_tb(error.__traceback__)[-1]
    told = [str(error), frame.filename, frame.lineno]
print(json.dumps([identities(), [each.name for each in loaded_plugins()], told]))
"""


def there(program: str, content: bytes, folder: Path) -> Any:
    """What a new process in an empty folder prints."""
    folder.mkdir()
    command = [sys.executable, "-W", "error", "-c", program]
    done = subprocess.run(
        command, input=content, cwd=folder, capture_output=True, check=False
    )
    assert done.returncode == 0, done.stderr.decode()
    return json.loads(done.stdout)


@pytest.fixture
def plugin(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A plugin's file among modules, in a folder from which they can be imported."""
    folder = tmp_path / "own"
    for name, text in {"lug_mine.py": PLUGIN, **BESIDE}.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, "utf-8")
    monkeypatch.syspath_prepend(str(folder))
    yield folder / "lug_mine.py"
    for name in [each for each in sys.modules if each.startswith("lug_")]:
        del sys.modules[name]


@pytest.mark.parametrize("relative", [False, True])
def test_another_process_loads_the_same_plugins_by_the_same_names_without_files(
    tmp_path: Path, plugin: Path, monkeypatch: pytest.MonkeyPatch, relative: bool
) -> None:
    monkeypatch.chdir(plugin.parent)
    given = Path(plugin.name) if relative else plugin
    with registry_kept():
        load_plugin(given)
        monkeypatch.chdir(tmp_path)
        shutil.rmtree(plugin.parent)
        found, loaded, told = there(THERE, luggage(), tmp_path / "elsewhere")
        assert found == identities()
        assert {*found} == {"lug_mine.py", *BESIDE}
        assert loaded == [each.name for each in loaded_plugins()]
        assert told == ["321.0", str(given), 9]


def test_a_file_that_changed_since_flies_as_it_was_loaded(
    tmp_path: Path, plugin: Path
) -> None:
    with registry_kept():
        load_plugin(plugin)
        plugin.write_text("1 / 0\n")
        (plugin.parent / "lug_beside.py").write_text("GAIN = 7.0\n")
        found, _, told = there(THERE, luggage(), tmp_path / "elsewhere")
        assert told[0] == "321.0"
        assert found == identities()


def test_a_module_that_a_script_imported_before_the_plugin_comes_along_and_no_other(
    tmp_path: Path, plugin: Path
) -> None:
    import_module("lug_beside")
    (plugin.parent / "lug_other.py").write_text("x = 1\n")
    with registry_kept():
        load_plugin(plugin)
        assert "lug_beside.py" not in identities()
        _, _, told = there(THERE, luggage(), tmp_path / "elsewhere")
        assert told[0] == "321.0"
        assert b"x = 1" not in luggage()


def test_a_name_of_a_script_travels_and_one_that_is_there_stays(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(
        "import sys\nimport skyarm\nfrom dataclasses import dataclass\nfrom"
        " skyarm.records.travel import"
        " luggage\n@skyarm.register.metric('lug_count')\n@dataclass(frozen=True)\nclass"
        " Count(skyarm.Metric):\n    def result(self, memory, instants, period):\n     "
        "   return 2 * instants\nlock ="
        " __import__('threading').Lock()\nskyarm.register.command('lug_locked')(lambda:"
        " lock)\nsys.stdout.buffer.write(luggage())\n"
    )
    done = subprocess.run(
        [sys.executable, str(script)], capture_output=True, check=True
    )
    program = (
        "import json, sys, skyarm\nfrom skyarm.records.travel import unload\n"
        "from skyarm.records.registry import find, names\n"
        "content = sys.stdin.buffer.read()\n"
        "if sys.argv[1:]:\n    skyarm.register.metric('lug_count')(dict)\n"
        "unload(content)\n"
        "made = find('metric', 'lug_count')\n"
        "print(json.dumps('ours' if made is dict else made().result(None, 4, 0.1)))\n"
    )
    assert there(program, done.stdout, tmp_path / "elsewhere") == 8
    assert (
        there(
            "import sys\nsys.argv = ['', 'taken']\n" + program,
            done.stdout,
            tmp_path / "taken",
        )
        == "ours"
    )


def test_installed_plugins_must_be_there(tmp_path: Path) -> None:
    with pytest.raises(
        RegistryError, match=r"^plugin absent: must be installed here as version 1$"
    ):
        load_again([Plugin("absent", "version 1")], {})


def test_what_was_sent_is_compared_with_its_digest(tmp_path: Path) -> None:
    identity = identity_of(b"x = 1\n")
    name = f"skyarm_plugin_lug_forged_{identity[7:15]}"
    with pytest.raises(RegistryError, match="has changed since it was loaded first"):
        load_again(
            [Plugin("/nowhere/lug_forged.py", identity)],
            {name: ("lug_forged.py", b"x = 2\n")},
        )
    assert name not in sys.modules


def test_what_ships_stays_at_home() -> None:
    shipped = {
        name for name, row in registrations("law").items() if row.source == "skyarm"
    }
    assert shipped
    assert names("law")
    assert len(luggage()) < 100_000
    assert skyarm.load_scenario("case1") is not None
