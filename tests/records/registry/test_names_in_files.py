"""Registered names in scenario files and in other processes; a scenario file runs no
code.
"""

from __future__ import annotations

import copy
import dataclasses
import json
import pickle
import shutil
from pathlib import Path
from typing import Any

import pytest

from skyarm.algebra import Vec3
from skyarm.records.registry import names
from skyarm.records.registry.plugins import identities, load_plugin
from skyarm.scenario.scenario_file import scenario_from
from skyarm.scenario.scenario_record import JointDrive, NamedSensor, ScenarioError
from skyarm.simulate import run
from skyarm.simulate.loop import run_in_python
from support import components as own
from support.components import registry_kept, same_logs
from support.flights import document, elsewhere, processes

OWN = Path(__file__).parents[2] / "support" / "own_plugin.py"


@pytest.fixture(autouse=True)
def _kept():
    with registry_kept():
        yield


@pytest.fixture
def plugin(tmp_path: Path) -> Path:
    return Path(shutil.copy(OWN, tmp_path / "own_plugin.py"))


TABLES: dict[str, Any] = {
    "environment__air": [
        {"kind": "own_turbulence", "sigma": 0.5},
        {"kind": "own_shear"},
    ],
    "environment__forces": [
        {"kind": "own_tether", "anchor": [0.3, 0.2, 1.5], "body": 1, "stiffness": 0.25}
    ],
    "sensors": {
        "position": 0.001,
        "fix": {"kind": "own_fix", "rate": 20, "delay": 0.01, "sigma": 0.01},
    },
    "estimator": {"kind": "own_blend", "gain": 0.05, "sensor": "fix"},
    "plant__drives": {"joint2": {"kind": "own_lag", "lag": 0.01}},
    "endings": [{"kind": "own_ceiling", "height": 5.0}],
    "duration": 0.2,
    "seed": 4,
}


def described(**changes: Any) -> Any:
    return scenario_from(
        document("case1", **{**copy.deepcopy(TABLES), **changes}), "test"
    )


def test_tables_of_registered_names_are_the_records_they_describe(plugin):
    load_plugin(plugin)
    scenario = described()
    assert scenario.air == (own.Turbulence(sigma=0.5), own.Shear())
    assert scenario.forces == (
        own.Tether(anchor=Vec3(0.3, 0.2, 1.5), body=1, stiffness=0.25),
    )
    assert scenario.sensors == (
        NamedSensor(name="fix", sensor=own.Fix(rate=20.0, delay=0.01, sigma=0.01)),
    )
    assert scenario.estimator == own.Blend(gain=0.05, sensor="fix")
    assert scenario.drives == (JointDrive(joint="joint2", drive=own.Lag(lag=0.01)),)
    assert scenario.endings == (own.Ceiling(height=5.0),)
    assert scenario.noise.position == 0.001
    log = run(scenario)
    assert log.status == "completed"
    assert same_logs(log, run_in_python(scenario))
    assert log.info["plugins"]["own_plugin.py"].startswith("sha256:")


def test_laws_motions_and_plants_have_their_names_in_files_too(plugin):
    load_plugin(plugin)
    base = {"kind": "own_motion", "height": 1.5}
    scenario = described(
        controller={"law": "own_law"}, reference__base=base, plant__kind="own_plant"
    )
    assert (scenario.controller.name, scenario.kind) == ("own_law", "own_plant")
    assert scenario.reference.at(0.0).position.z == 1.5
    log = run(scenario)
    assert log.status == "completed"
    assert log.position[0, 2] == pytest.approx(1.5)
    shipped = described(
        controller={"law": "hybrid_computed_torque"},
        reference__base={"kind": "hover", "position": [0.0, 0.0, 1.5]},
    )
    # another name of the same plant and the same law: stage by stage in Python, the
    # same bits
    assert same_logs(log, run(shipped))


WRONG = [
    (
        {"environment__air": [{"kind": "own_turbulance"}]},
        r"environment\.air\[0\]\.kind = .*did you mean 'own_turbulence'",
    ),
    (
        {"environment__air": [{"kind": "own_shear", "rat": 1.0}]},
        r"environment\.air\[0\].*rat",
    ),
    (
        {"environment__air": {"kind": "own_shear"}},
        r"environment\.air = .*must be a list of tables",
    ),
    (
        {"environment__forces": [{"kind": "own_shear"}]},
        r"environment\.forces\[0\]\.kind = 'own_shear': (did.*\? )?must be one of",
    ),
    (
        {"environment__air": [{"kind": "own_turbulence", "time": 0.0}]},
        r"environment\.air\[0\].time = 0\.0: must be above",
    ),
    (
        {"environment__air": [{"kind": "own_turbulence", "sigma": "x"}]},
        r"environment\.air\[0\]\.sigma = 'x'",
    ),
    (
        {"environment__forces": [{"kind": "own_tether", "anchor": [1.0]}]},
        r"environment\.forces\[0\]\.anchor",
    ),
    (
        {"environment__forces": [{"kind": "own_tether", "body": 0.5}]},
        r"body = 0\.5: must be a whole number",
    ),
    ({"environment__forces": [{}]}, r"environment\.forces\[0\]\.kind"),
    (
        {"sensors": {"fix": {"kind": "own_fixx"}}},
        r"sensors\.fix\.kind = 'own_fixx'.*did you mean 'own_fix'",
    ),
    (
        {"sensors": {"fix": {"kind": "own_fix", "rate": 30}}},
        r"sensors\.fix\.frequency = 30: must divide",
    ),
    (
        {"sensors": {"state": {"kind": "own_fix"}}},
        r"name = 'state': must be a word, and not 'state'",
    ),
    (
        {"estimator": {"kind": "kalman"}},
        r"estimator\.kind = 'kalman': must be one of pass_through, ekf, own_blend",
    ),
    (
        {"estimator": {"kind": "own_blend", "sensor": 3}},
        r"estimator\.sensor = 3: must be text",
    ),
    (
        {"plant__drives": {"elbow": {"kind": "own_lag"}}},
        r"joint = 'elbow': must be one of joint1, joint2",
    ),
    ({"plant__drives": [1]}, r"plant\.drives = \[1\]: must be a table"),
    (
        {"endings": [{"kind": "cieling"}]},
        r"endings\[0\]\.kind = 'cieling': (did.*\? )?must be one of",
    ),
    (
        {"controller": {"law": "own_lw"}},
        r"controller\.law = 'own_lw': (did.*\? )?must be one of",
    ),
    (
        {"plant__kind": "own_plan"},
        r"plant\.kind = 'own_plan': did you mean 'own_plant'\? must be one of ",
    ),
    (
        {"reference__base": {"kind": "own_motio"}},
        r"kind = 'own_motio': did you mean 'own_motion'\? must be one of ",
    ),
]


@pytest.mark.parametrize(("changes", "words"), WRONG)
def test_what_is_wrong_in_a_table_is_one_line(plugin, changes, words):
    load_plugin(plugin)
    with pytest.raises(ScenarioError, match=words) as caught:
        described(**changes)
    assert "\n" not in str(caught.value)


def test_a_thing_of_another_base_is_refused_where_its_name_stands(plugin):
    from skyarm.records.registry import register

    load_plugin(plugin)
    register.sensor("odd")(own.Shear)
    with pytest.raises(
        ScenarioError,
        match=r"sensors\.fix\.kind = 'odd': must be registered as a subclass of Sensor",
    ):
        described(sensors={"fix": {"kind": "odd"}})


def test_without_the_plugin_its_names_are_not_there():
    words = (
        r"\.air\[0\]\.kind = 'own_turbulence': must be one of moving_air, air_signals"
    )
    words += (
        r"; names of one's own come by --plugin FILE\.py or"
        r" skyarm\.load_plugin\('FILE\.py'\)$"
    )
    with pytest.raises(ScenarioError, match=words):
        described(
            sensors={}, estimator={"kind": "pass_through"}, plant__drives={}, endings=[]
        )


def test_a_file_names_the_plugins_it_needs(plugin):
    needs = {"plugins": {"need": ["own_plugin.py"]}}
    words = (
        r"plugins\.need = 'own_plugin\.py': is not loaded; --plugin own_plugin\.py or"
        r" skyarm\.load_plugin\("
    )
    with pytest.raises(ScenarioError, match=words):
        described(**needs)
    with pytest.raises(
        ScenarioError,
        match=r"plugins\.need = 'some-pack': is not loaded; pip install some-pack",
    ):
        scenario_from(document("case1", plugins={"need": ["some-pack"]}), "test")
    load_plugin(plugin)
    described(**needs)
    for wrong in ("own_plugin.py", [3]):
        with pytest.raises(
            ScenarioError, match=r"plugins\.need = .*must be a list of names"
        ):
            described(plugins={"need": wrong})
    with pytest.raises(ScenarioError, match=r"plugins.*load"):
        described(plugins={"load": ["own_plugin.py"]})


MARKED = """
from pathlib import Path
Path({marker!r}).touch()
def make(*_, **__):
    raise AssertionError("run")
"""

CODE: dict[str, Any] = {
    "law": {"controller": {"law": "x.py:make"}},
    "preset": {"controller": {"preset": "x.py:make"}},
    "air": {"environment__air": [{"kind": "x.py:make"}]},
    "estimator": {"estimator": {"kind": "x.py:make"}},
    "endings": {"endings": [{"kind": "x.py:make"}]},
    "plant": {"plant__kind": "x.py:make"},
    "motion": {"reference__base": {"kind": "x.py:make"}},
    "need": {"plugins": {"need": ["x.py"]}},
}


@pytest.mark.parametrize("where", sorted(CODE))
def test_a_scenario_file_never_runs_code(tmp_path, monkeypatch, where):
    monkeypatch.chdir(tmp_path)
    marker = tmp_path / "ran"
    (tmp_path / "x.py").write_text(MARKED.format(marker=str(marker)))
    with pytest.raises(ScenarioError, match=r"x\.py"):
        scenario_from(document("case1", **CODE[where]), "test")
    assert not marker.exists()
    assert "x.py" not in identities()


def worker_names(kind: str) -> Any:
    """What a worker process knows."""
    from skyarm.records.registry import names as there

    return there(kind), identities()


def test_worker_processes_load_the_same_plugins_before_they_unpickle(plugin):
    load_plugin(plugin)
    scenario = described(
        controller={"law": "own_law"}, plant__kind="own_plant", duration=0.05
    )
    with processes(1) as pool:
        pool.submit("names", worker_names, "force")
        known, have = pool.collect()[1]
        pool.submit("log", run, scenario)
        theirs = pool.collect()[1]
    # what a test's own file registered at its import is no plugin
    assert set(known) >= {"own_push", "own_tether"}
    assert set(known) <= set(names("force"))
    assert have == identities()
    assert same_logs(theirs, run(scenario))


def test_a_worker_has_a_plugin_as_it_was_loaded_although_its_file_has_changed(plugin):
    load_plugin(plugin)
    plugin.write_text("1 / 0\n")
    _, have = elsewhere(worker_names, "force")
    assert have == identities()


def test_a_record_of_a_plugins_class_travels_by_pickle(plugin):
    module = load_plugin(plugin)
    assert pickle.loads(pickle.dumps(module.OwnPlant)) is module.OwnPlant
    assert json.dumps(identities())
    assert dataclasses.is_dataclass(module.own.Tether)
