"""A log keeps its scenario: flown again it gives the same bits, and a log that cannot
says so in one line.
"""

from __future__ import annotations

import dataclasses
import io
import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import skyarm
from skyarm.control.safety import with_safety_layer
from skyarm.records.plain import digest
from skyarm.records.registry.plugins import load_plugin
from skyarm.scenario.scenario_record import ScenarioError
from skyarm.studies.compare.suite import PAPER_CASES
from support.cases import sampled
from support.components import registry_kept, same_logs

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture(autouse=True)
def _kept() -> Iterator[None]:
    with registry_kept():
        yield


OTHERS = ("learned_compensator", "bulut2019")


def logged(scenario: skyarm.Scenario, folder: Path) -> tuple[skyarm.Log, Path]:
    log = skyarm.run(scenario)
    return log, log.save_npz(folder / f"{scenario.name}.npz")


@pytest.mark.parametrize(
    "name", sampled(skyarm.list_scenarios(), 100, keep=PAPER_CASES[2:])
)
def test_every_shipped_scenario_is_flown_again_from_its_log(
    name: str, tmp_path: Path
) -> None:
    log, path = logged(skyarm.load_scenario(name, duration=0.06), tmp_path)
    scenario = skyarm.load_log(path).scenario
    assert isinstance(scenario, skyarm.Scenario)
    again = skyarm.run(scenario)
    assert same_logs(again, log)
    assert again.info == log.info


@pytest.mark.parametrize(
    ("law", "plant"),
    [
        *(("centroidal_tip", "rigid_body"), ("nmpc", "mujoco")),
        *sampled(
            [(law, plant) for law in OTHERS for plant in ("rigid_body", "mujoco")], 4
        ),
    ],
)
def test_so_are_other_laws_on_both_plants(law: str, plant: str, tmp_path: Path) -> None:
    log, path = logged(
        skyarm.load_scenario("case2_gust", duration=0.05, controller=law, plant=plant),
        tmp_path,
    )
    assert same_logs(skyarm.run(skyarm.load_scenario(path)), log)


@pytest.mark.parametrize("law", ["paper_ct", "nmpc"])
def test_so_is_a_guarded_law_traced_or_called(law: str, tmp_path: Path) -> None:
    scenario = skyarm.load_scenario("case3", duration=0.05, controller=law)
    log, path = logged(
        dataclasses.replace(
            scenario, controller=with_safety_layer(scenario.controller)
        ),
        tmp_path,
    )
    assert same_logs(skyarm.run(skyarm.load_scenario(path)), log)


def test_keywords_replace_what_the_log_says(tmp_path: Path) -> None:
    _, path = logged(skyarm.load_scenario("case1", duration=0.05), tmp_path)
    changed = skyarm.load_scenario(
        path, plant="mujoco", controller="indi", seed=7, duration=0.1
    )
    assert (changed.kind, changed.controller.name, changed.seed, changed.duration) == (
        "mujoco",
        "indi",
        7,
        0.1,
    )
    for keywords, field in (
        ({"plant": "tank"}, "plant.kind = 'tank'"),
        ({"controller": "lqr"}, "controller = 'lqr'"),
    ):
        with pytest.raises(ScenarioError, match=rf"^{path}: .*{field}"):
            skyarm.load_scenario(path, **keywords)


def test_a_scenario_that_ships_is_restored_once_and_a_changed_one_is_refused() -> None:
    log = skyarm.run(skyarm.load_scenario("case3", duration=0.1))
    assert log.scenario is log.scenario
    record = {**log.info["scenario_record"], "duration": 0.2}
    log = dataclasses.replace(log, info={**log.info, "scenario_record": record})
    with pytest.raises(ValueError, match="must be of the log's digest"):
        _ = log.scenario


def test_words_of_a_logs_scenario_are_replaced_by_their_paths_in_a_file(
    tmp_path: Path,
) -> None:
    given = skyarm.load_scenario("case1", duration=0.05)
    log, _ = logged(given, tmp_path)
    gusts = skyarm.load_scenario("case2_gust").wind
    changed = log.scenario_with(
        {"plant.kind": "mujoco", "environment.wind": gusts, "seed": 7}
    )
    assert changed == dataclasses.replace(given, kind="mujoco", wind=gusts, seed=7)
    with pytest.raises(
        ValueError,
        match=r"^path = 'plant.knd': did you mean 'plant.kind'\? must be one of ",
    ):
        log.scenario_with({"plant.knd": "mujoco"})


PLUGIN = """
from dataclasses import dataclass
import skyarm
from skyarm.plant.compiled import RigidBodyPlant

@skyarm.register.force("breath")
@dataclass(frozen=True, kw_only=True)
class Breath(skyarm.Force):
    size: float = 0.3
    names: tuple[str, ...] = ("inf",)

    def wrenches(self, memory, t, motion, rotor_speeds):
        return (skyarm.Wrench(force_W=skyarm.Vec3(self.size, 0.0, 0.0)),)

@skyarm.register.plant("tank")
class Tank(RigidBodyPlant):
    '''A plant by its name only.'''
"""


def of_plugin(folder: Path) -> tuple[skyarm.Log, Path, Path]:
    file = folder / "breath.py"
    file.write_text(PLUGIN)
    force = load_plugin(file).Breath(size=0.7)
    return (
        *logged(
            dataclasses.replace(
                skyarm.load_scenario("case1", duration=0.1), forces=(force,)
            ),
            folder,
        ),
        file,
    )


def refused(path: Path, reason: str) -> None:
    with pytest.raises(ScenarioError) as error:
        skyarm.load_scenario(path)
    assert "\n" not in str(error.value)
    assert str(error.value).startswith(f"{path}: ")
    assert reason in str(error.value)


def test_a_scenario_with_a_plugin_is_flown_again_where_the_plugin_is_loaded(
    tmp_path: Path,
) -> None:
    log, path, _ = of_plugin(tmp_path)
    assert same_logs(skyarm.run(skyarm.load_scenario(path)), log)


def test_elsewhere_it_names_the_plugin(tmp_path: Path) -> None:
    with registry_kept():
        _, path, file = of_plugin(tmp_path)
    refused(path, "plugin breath.py (sha256:")
    refused(path, "is not loaded: load it by --plugin breath.py")
    file.write_text(PLUGIN.replace("0.3", "0.4"))
    load_plugin(file)
    refused(path, "has changed, it is sha256:")
    refused(path, "now: load the file of then by --plugin breath.py")


def test_a_plant_that_only_a_plugin_has_names_the_plugin(tmp_path: Path) -> None:
    (tmp_path / "breath.py").write_text(PLUGIN)
    with registry_kept():
        load_plugin(tmp_path / "breath.py")
        _, path = logged(
            dataclasses.replace(
                skyarm.load_scenario("case1", duration=0.05), kind="tank"
            ),
            tmp_path,
        )
    refused(path, "plant.kind = 'tank'")
    refused(path, "it was flown with the plugins breath.py")


@pytest.mark.parametrize(
    "change",
    [{"controller": 3}, {"controller": {"type": "x"}}, {"rates": {}}, {"delays": []}],
)
def test_a_forged_log_whose_law_is_replaced_is_refused_in_one_line(
    change: dict[str, Any], tmp_path: Path
) -> None:
    _, path = logged(skyarm.load_scenario("case1", duration=0.05), tmp_path)

    def forged(info: dict[str, Any]) -> None:
        (
            info["scenario_record"]
            if "rates" in change
            else info["scenario_record"]["agent"]
        ).update(change)
        info["digest"] = digest(info["scenario_record"])

    changed(path, forged)
    # a kind of no module here is named as one whose plugin is not loaded
    where = (
        "log of 'case1'"
        if change.get("controller") == {"type": "x"}
        else "scenario_record"
    )
    with pytest.raises(ScenarioError, match=rf"^{path}: {where}: .*") as error:
        skyarm.load_scenario(path, controller="paper_pd")
    assert "\n" not in str(error.value)


@pytest.mark.thorough
def test_a_law_of_a_file_is_flown_again_on_the_command_line(tmp_path: Path) -> None:
    def run(*words: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "skyarm", "run", *words, "--out", "again"]
        return subprocess.run(
            command, cwd=tmp_path, capture_output=True, text=True, check=False
        )

    law = EXAMPLES / "own_law.py"
    assert (
        run("case1", "--laws", f"{law}:make_lqr", "--duration", "0.1").returncode == 0
    )
    (tmp_path / "again" / "case1.npz").rename(tmp_path / "lqr.npz")
    ended = run("lqr.npz")
    assert ended.returncode == 2
    assert "plugin own_law.py" in ended.stderr
    assert "Traceback" not in ended.stderr
    assert (
        run("lqr.npz", "--laws", "paper_pd", "--plugin", str(law), "--force").returncode
        == 0
    )
    assert run("lqr.npz", "--plugin", str(law), "--force").returncode == 0
    assert same_logs(
        *(skyarm.load_log(tmp_path / name) for name in ("lqr.npz", "again/case1.npz"))
    )


def changed(path: Path, change: Callable[[dict[str, Any]], Any]) -> None:
    with np.load(io.BytesIO(path.read_bytes())) as data:
        content = {name: data[name] for name in data.files}
    info = json.loads(str(content["info"]))
    change(info)
    np.savez_compressed(path, **{**content, "info": np.array(json.dumps(info))})


def older(info: dict[str, Any]) -> None:
    info["scenario_record"]["type"] = "Scenario"


DAMAGE: dict[str, Callable[[dict[str, Any]], Any]] = {
    "a log from before": older,
    "a log without it": lambda info: info.pop("scenario_record"),
    "another number": (
        lambda info: info["scenario_record"]["agent"]["plant"].update(gravity=1.62)
    ),
    "another digest": lambda info: info.update(digest="0"),
    "no digest": lambda info: info.pop("digest"),
    "text": lambda info: info.update(scenario_record="case1"),
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_an_older_or_damaged_log_is_refused_in_one_line(
    damage: str, tmp_path: Path
) -> None:
    _, path = logged(skyarm.load_scenario("case1", duration=0.05), tmp_path)
    changed(path, DAMAGE[damage])
    said = f"skyarm {skyarm.__version__} wrote it"
    if damage in ("another number", "another digest", "no digest"):
        refused(
            path,
            "scenario_record: must be of the log's digest; it was changed after"
            f" {said}",
        )
    elif damage == "text":
        refused(path, "info.scenario_record = 'case1': must be a table")
    else:
        refused(
            path,
            "scenario_record: must hold the scenario as this version writes it;"
            f" {said}",
        )


def nested(deep: int) -> Any:
    found: Any = []
    for _ in range(deep):
        found = [found]
    return found


@pytest.mark.parametrize("deep", [50, 300, 600, 900])
def test_a_log_of_lists_in_lists_is_refused_in_one_line(
    deep: int, tmp_path: Path
) -> None:
    _, path = logged(skyarm.load_scenario("case1", duration=0.05), tmp_path)

    def hostile(info: dict[str, Any]) -> None:
        info["scenario_record"]["title"] = nested(deep)
        info["digest"] = digest(info["scenario_record"])

    changed(path, hostile)
    refused(path, "scenario_record: ")


def test_a_log_nested_deeper_than_any_digest_is_refused_in_one_line() -> None:
    log = skyarm.run(skyarm.load_scenario("case1", duration=0.05))
    log.info["scenario_record"]["title"] = nested(100_000)
    with pytest.raises(
        ValueError,
        match=r"^scenario_record: must be of the log's digest; it was changed after",
    ):
        _ = log.scenario


def test_what_is_no_log_is_refused_in_one_line(tmp_path: Path) -> None:
    _, path = logged(skyarm.load_scenario("case1", duration=0.05), tmp_path)
    for content in (b"", b"case1", path.read_bytes()[:-40]):
        path.write_bytes(content)
        refused(path, "must be a log that save_npz wrote")
    refused(tmp_path / "none.npz", "no such file")
    (tmp_path / "flight.csv").write_text("time\n0.0\n")
    refused(tmp_path / "flight.csv", "cannot be read back")
