"""Results know the code that flew: one's own files, and what a plugin imports from its
folder, by SHA-256.
"""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

import skyarm
from skyarm.records.files.user_code import PACKAGE, is_beside, source_of
from skyarm.records.identity import FOR_PEOPLE, _without, all_files, identity, own_files
from skyarm.records.plain import digest, plain
from skyarm.records.registry import RegistryError
from skyarm.records.registry.plugins import (
    Plugin,
    identities,
    load_again,
    load_plugin,
    loaded_plugins,
)
from skyarm.studies.compare.own_scenario import OwnScenario
from skyarm.studies.sweep.plan import prepare
from support.components import registry_kept
from support.studies import drop_chunk, small_study

FORCE = """
from dataclasses import dataclass
import skyarm
{top}

@skyarm.register.force("push")
@dataclass(frozen=True, kw_only=True)
class Push(skyarm.Force):
    size: float = 0.1

    def wrenches(self, memory, t, motion, rotor_speeds):
        return (skyarm.Wrench(force_W=skyarm.Vec3(GAIN * self.size, 0.0, 0.0)),)
"""

STUDY = """
schema = 1
name = "st"
scenario = "pushed.toml"
episodes = 4
chunk = 2
[vary]
"environment.forces.push.size" = { uniform = [0.0, 0.1] }
"""

PUSHED = """
schema = 1
name = "pushed"
duration = 0.1
[plant]
vehicle = "hummingbird_arm2_rotors"
[model]
vehicle = "hummingbird_arm2"
[controller]
law = "hybrid_computed_torque"
[reference.base]
kind = "hover"
position = [0, 0, 1]
[[environment.forces]]
kind = "push"
"""


@pytest.fixture(autouse=True)
def _kept() -> Iterator[None]:
    before = set(sys.modules)
    with registry_kept():
        yield
    for name in set(sys.modules) - before:
        if name.startswith(("push_", "skyarm_plugin_")):
            del sys.modules[name]


def sha(file: Path) -> str:
    return f"sha256:{hashlib.sha256(file.read_bytes()).hexdigest()}"


def python(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    environment = {"PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
    return subprocess.run(
        [sys.executable, *words],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        env=environment,
    )


def study(folder: Path) -> None:
    (folder / "st.toml").write_text(STUDY)
    (folder / "pushed.toml").write_text(PUSHED)


def refused_after(folder: Path, command: list[str], changed: Path, told: str) -> None:
    """A study flies, goes on with the same code, and refuses to with another GAIN."""
    for text in ("GAIN = 1.0", "GAIN = 1.0", "GAIN = 9.0"):
        changed.write_text(changed.read_text().replace("GAIN = 1.0", text))
        done = python(folder, *command)
        if text == "GAIN = 1.0":
            assert done.returncode == 0, done.stderr
            drop_chunk(folder / "out", 1)
    assert done.returncode != 0
    line = done.stderr.strip().splitlines()[-1]
    assert told in line
    assert "must be 'sha256:" in line
    assert "choose another --out" in line
    assert {
        file.name.split(".")[0] for file in (folder / "out" / "rows").iterdir()
    } == {"chunk_0000000"}


@pytest.mark.thorough
def test_a_study_refuses_a_module_that_its_plugin_imports_when_that_has_changed(
    tmp_path: Path,
) -> None:
    study(tmp_path)
    (tmp_path / "push_plugin.py").write_text(
        FORCE.format(top="from push_helper import GAIN")
    )
    helper = tmp_path / "push_helper.py"
    helper.write_text("GAIN = 1.0\n")
    command = [
        "-m",
        "skyarm",
        "--plugin",
        "push_plugin.py",
        "sweep",
        "st.toml",
        "--out",
        "out",
    ]
    refused_after(tmp_path, command, helper, "plugin 'push_helper.py' = 'sha256:")


@pytest.mark.thorough
def test_a_study_of_a_script_refuses_the_script_when_it_has_changed(
    tmp_path: Path,
) -> None:
    study(tmp_path)
    script = tmp_path / "push_script.py"
    script.write_text(
        FORCE.format(top="GAIN = 1.0")
        + '\nif __name__ == "__main__":\n    skyarm.fly_sweep("st.toml", "out")\n'
    )
    refused_after(tmp_path, [script.name], script, "plugin 'push_script.py' = 'sha256:")


def imported(file: Path) -> ModuleType:
    """A module of a script, anew."""
    module = ModuleType(file.stem)
    module.__file__ = str(file)
    sys.modules[file.stem] = module
    exec(compile(file.read_text(), str(file), "exec"), module.__dict__)
    return module


def of_script(folder: Path, gain: float) -> tuple[skyarm.Scenario, Path]:
    file = folder / "push_own.py"
    file.write_text(FORCE.format(top=f"GAIN = {gain}"))
    with registry_kept():
        force = imported(file).Push()
    return (
        dataclasses.replace(
            skyarm.load_scenario("case1", duration=0.05), forces=(force,)
        ),
        file,
    )


def test_a_scenario_and_its_log_have_another_digest_when_own_code_has_changed(
    tmp_path: Path,
) -> None:
    scenario, file = of_script(tmp_path, 1.0)
    first, before = identity(scenario), skyarm.run(scenario)
    assert before.info["code"] == own_files(scenario) == {"push_own.py": sha(file)}
    assert before.info["plugins"] == {}
    again, _ = of_script(tmp_path, 1.0)
    assert (identity(again), skyarm.run(again).info["digest"]) == (
        first,
        before.info["digest"],
    )
    other, _ = of_script(tmp_path, 2.0)
    after = skyarm.run(other)
    assert after.info["scenario_record"] == before.info["scenario_record"]
    assert identity(other) != first
    assert after.info["digest"] != before.info["digest"]


def test_a_log_of_own_code_is_read_back_and_refused_when_that_has_changed(
    tmp_path: Path,
) -> None:
    scenario, _ = of_script(tmp_path, 1.0)
    skyarm.register.force("push_read_back")(type(scenario.forces[0]))
    log = skyarm.run(scenario)
    assert identity(log.scenario) == identity(scenario)
    of_script(tmp_path, 2.0)
    with pytest.raises(
        ValueError,
        match=r"^code 'push_own.py' = 'sha256:.*must be 'sha256:.* as it was flown$",
    ):
        _ = log.scenario
    log.info["code"] = {}
    with pytest.raises(
        ValueError, match="must be of the log's digest; it was changed after"
    ):
        _ = log.scenario


def test_what_ships_has_no_files_and_keeps_its_digests() -> None:
    scenario = skyarm.load_scenario("case3_wind")
    assert own_files(scenario, skyarm.load_scenario("case1", controller="nmpc")) == {}
    assert skyarm.run(dataclasses.replace(scenario, duration=0.02)).info["code"] == {}
    for name in ("case1", "case2", "case3"):
        shipped = skyarm.load_scenario(name, duration=0.02)
        # of the record alone: no file of anyone's own takes part
        assert identity(shipped) == digest(_without(plain(shipped), FOR_PEOPLE)), name


def mine(x: float) -> float:
    return x


class Mine:
    """No dataclass, no method."""


class Child(Mine, skyarm.Vec3):
    """Own by its place, not by any method."""

    __slots__ = ()


def closed(inner: Any) -> Any:
    def outer(x: float) -> Any:
        return inner(x)

    return outer


def shipped_around(inner: Any) -> Any:
    """A function of ours that was closed over one of theirs."""
    names: dict[str, Any] = {"__name__": "skyarm.none"}
    text = "def around(inner):\n    return lambda x: inner(x)\n"
    exec(compile(text, f"{PACKAGE}none.py", "exec"), names)
    return names["around"](inner)


@pytest.mark.parametrize(
    ("file", "beside"),
    [
        ("/home/me/helper.py", True),
        ("/home/me/package/inner.py", True),
        ("/home/mean/helper.py", False),
        ("/home/helper.py", False),
        ("/home/me/.venv/lib/python3.11/site-packages/scipy/__init__.py", False),
    ],
)
def test_beside_a_plugin_is_what_is_neither_elsewhere_nor_installed(
    file: str, beside: bool
) -> None:
    assert is_beside(file, "/home/me") is beside


def test_beside_a_plugin_is_neither_the_library_nor_python() -> None:
    for file in (skyarm.__file__, functools.__file__):
        assert not is_beside(file, "/")
        assert not is_beside(file, str(Path(file).parents[1]))
    assert is_beside("/helper.py", "/")


HERE = {Path(__file__).name: sha(Path(__file__))}


@pytest.mark.parametrize(
    "thing",
    [
        mine,
        Mine,
        Mine(),
        Child(1.0, 2.0, 3.0),
        [{"a": (mine,)}],
        functools.partial(load_plugin, mine),
        functools.partial(print, key=mine),
        functools.lru_cache(mine),
        closed(mine),
        lambda: 0,
        shipped_around(mine),
        {1: frozenset([mine])},
    ],
)
def test_own_code_is_found_wherever_it_stands(thing: object) -> None:
    assert own_files(thing) == HERE


def test_a_plant_of_ones_own_is_found_by_its_name() -> None:
    scenario = dataclasses.replace(skyarm.load_scenario("case1"))
    skyarm.register.plant("push_plant")(Mine)
    assert own_files(dataclasses.replace(scenario, kind="push_plant")) == HERE
    assert own_files(dataclasses.replace(scenario, kind="mujoco")) == {}


def test_a_plugin_brings_the_modules_of_its_folder_that_it_imported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(tmp_path))
    folder = tmp_path / "push_package"
    folder.mkdir()
    (folder / "__init__.py").write_text("from push_package.inner import GAIN\n")
    (folder / "inner.py").write_text("GAIN = 1.0\n")
    (tmp_path / "push_unused.py").write_text("")
    file = tmp_path / "push_mine.py"
    file.write_text(FORCE.format(top="import json.tool\nfrom push_package import GAIN"))
    push = load_plugin(file).Push
    wanted = {
        "push_mine.py": sha(file),
        "push_package/__init__.py": sha(folder / "__init__.py"),
        "push_package/inner.py": sha(folder / "inner.py"),
    }
    assert identities() == all_files() == wanted
    assert own_files(push) == own_files(push()) == wanted
    load_again(loaded_plugins())
    (folder / "inner.py").write_text("GAIN = 2.0\n")
    for again in (lambda: load_plugin(file), lambda: load_again(loaded_plugins())):
        with pytest.raises(
            RegistryError,
            match=r"push_mine.py': '.*inner.py', which it imports, has changed since",
        ):
            again()


def test_a_worker_refuses_another_module_of_a_plugins_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "push_told.py").write_text("GAIN = 2.0\n")
    file = tmp_path / "push_worker.py"
    file.write_text("import push_told\n")
    theirs = Plugin(
        str(file), sha(file), ((str(tmp_path / "push_told.py"), "sha256:of another"),)
    )
    with pytest.raises(
        RegistryError,
        match=r"push_told.py', which it imports, has changed since it was loaded first",
    ):
        load_again([theirs])


def test_a_plugin_that_fails_leaves_no_module_behind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "push_half.py").write_text("")
    file = tmp_path / "push_fails.py"
    file.write_text("import push_half\n1 / 0\n")
    with pytest.raises(RegistryError, match="ZeroDivisionError"):
        load_plugin(file)
    assert "push_half" not in sys.modules


def test_the_second_file_of_a_name_gets_a_number(tmp_path: Path) -> None:
    for k in range(3):
        (tmp_path / str(k)).mkdir()
        (tmp_path / str(k) / "push_same.py").write_text(f"x = {k % 2}\n")
        load_plugin(tmp_path / str(k) / "push_same.py")
    # not in the order of loading
    ours = sorted(sha(tmp_path / str(k) / "push_same.py") for k in range(2))
    assert identities() == {"push_same.py": ours[0], "push_same.py (2)": ours[1]}


def test_an_identity_has_the_plugins_that_are_loaded_in_it(tmp_path: Path) -> None:
    scenario = skyarm.load_scenario("case1")
    before = identity(scenario)
    (tmp_path / "push_any.py").write_text("x = 1\n")
    load_plugin(tmp_path / "push_any.py")
    assert identity(scenario) != before


def test_code_without_a_file_is_told_by_itself() -> None:
    codes = [
        compile(text, "<stdin>", "exec")
        for text in ("a = 1", "a = 1", "a = 2", "f = lambda x: x in {1, 2}")
    ]
    told = [source_of(code) for code in codes]
    assert told[0] == told[1]
    assert len({identity for _, identity in told}) == 3
    assert {name for name, _ in told} == {"(typed in)"}


METRIC = """
from dataclasses import dataclass
import skyarm

@skyarm.register.metric("push_count")
@dataclass(frozen=True, kw_only=True)
class Count(skyarm.Metric):
    pass
"""


def test_a_cell_of_a_comparison_is_of_the_code_that_flew(tmp_path: Path) -> None:
    study(tmp_path)
    file = tmp_path / "push_cell.py"
    file.write_text(FORCE.format(top="GAIN = 1.0"))
    imported(file)
    flights = OwnScenario(
        scenario=str(tmp_path / "pushed.toml"), laws=["paper_pd"]
    ).plan_cells()[0][0]
    first = flights.work().key
    assert flights.work().key == first
    file.write_text(FORCE.format(top="GAIN = 2.0"))
    second = flights.work().key
    assert second != first
    metric = tmp_path / "push_metric.py"
    metric.write_text(METRIC)
    imported(metric)
    third = flights.work().key
    metric.write_text(f"{METRIC}# other\n")
    assert len({first, second, third, flights.work().key}) == 4


def test_a_study_knows_the_files_of_the_metrics_that_it_counts(tmp_path: Path) -> None:
    metric = tmp_path / "push_metric.py"
    metric.write_text(METRIC)
    imported(metric)
    assert "plugins" not in prepare(small_study()).manifest.study
    counted = prepare(small_study(metrics=["push_count"])).manifest.study
    assert counted["plugins"] == {"push_metric.py": sha(metric)}


@pytest.mark.parametrize(
    "names", [("first.py", "second.py"), ("a/same.py", "b/same.py")]
)
def test_the_order_in_which_plugins_are_loaded_changes_no_digest(
    names: tuple[str, str], tmp_path: Path
) -> None:
    """Neither of a study, nor of a comparison's cells; two files of one name are told
    apart by what they hold.
    """
    found = []
    for order in (names, names[::-1]):
        with registry_kept():
            for name in order:
                file = tmp_path / name
                file.parent.mkdir(exist_ok=True)
                file.write_text(
                    METRIC.replace("push_count", f"push_{names.index(name)}")
                )
                load_plugin(file)
            manifest = prepare(small_study()).manifest
            cell = OwnScenario(scenario="case1", laws=["paper_pd"]).plan_cells()[0][0]
            found.append(
                (
                    manifest.digest,
                    cell.work().key,
                    list(identities().items()),
                    list(manifest.study["plugins"]),
                )
            )
    assert found[0] == found[1]
    assert len(found[0][2]) == len(found[0][3]) == 2
