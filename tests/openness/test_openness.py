"""Everything can be added from outside: named in a file, flown on both plants, in
batches, sweeps and comparisons.

No file of the library knows what is flown here: it comes from the examples and from
``additions.py``.
"""

from __future__ import annotations

import copy
import dataclasses
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from added_flight import DOCUMENT, EXAMPLES, HERE, PLUGINS, VARIED

import skyarm
from skyarm.records.registry.plugins import load_plugin
from skyarm.simulate.examine import TRIED
from skyarm.simulate.loop import run_in_python
from support.commands import skyarm as typed
from support.components import registry_kept


@pytest.fixture(autouse=True, scope="module")
def _loaded() -> Iterator[None]:
    with registry_kept():
        for plugin in PLUGINS:
            load_plugin(plugin)
        yield


def _scenario(**changes: Any) -> skyarm.Scenario:
    document = copy.deepcopy(DOCUMENT)
    return dataclasses.replace(skyarm.scenario_from(document), **changes)


def _same(a: skyarm.Log, b: skyarm.Log) -> bool:
    return all(
        np.array_equal(x, y)
        for x, y in zip(a.arrays().values(), b.arrays().values(), strict=True)
    )


def test_machine_code_flies_it_as_floats_do_to_the_last_bit() -> None:
    scenario = _scenario()
    assert _same(skyarm.run(scenario), run_in_python(scenario))


@pytest.mark.thorough
def test_every_part_is_the_same_in_another_process(tried_elsewhere: None) -> None:
    """Another environment, folder and hash seed; ``TRIED`` has what was tried and found
    equal.
    """
    before = set(TRIED)
    skyarm.run(_scenario(duration=0.1))
    make = load_plugin(EXAMPLES / "own_law.py").make_lqr
    flown = skyarm.load_scenario("case3", duration=0.1)
    skyarm.check_law(
        dataclasses.replace(flown, controller=make(flown.controller.par.model))
    )
    assert len(TRIED - before) == 2


def test_what_was_added_changes_the_flight() -> None:
    whole = skyarm.run(_scenario())
    assert whole.status == "completed"
    for without in (
        {"air": ()},
        {"forces": ()},
        {"estimator": skyarm.sensing.estimate.estimator.PASS_THROUGH},
    ):
        assert (
            np.abs(skyarm.run(_scenario(**without)).position - whole.position).max()
            > 1e-5
        )


def test_both_plants_fly_it_alike() -> None:
    """Euler steps are the same on both; over two seconds of feedback they stay together
    to rounding.
    """
    euler = {"integrator": "euler", "duration": 1.0}
    ours, theirs = (
        skyarm.run(_scenario(**euler, kind=plant)) for plant in ("rigid_body", "mujoco")
    )
    np.testing.assert_allclose(theirs.position, ours.position, atol=1e-8)
    np.testing.assert_allclose(theirs.joints, ours.joints, atol=1e-8)


@pytest.mark.thorough
def test_a_thousand_lanes_fly_it_and_each_is_a_flight_of_its_own() -> None:
    scenario = _scenario()
    generator = np.random.default_rng(0)
    values = {path: generator.uniform(*ends, 1000) for path, ends in VARIED.items()}
    outcome = skyarm.Batch(scenario, list(VARIED), bit_exact=True, log_every=1).fly(
        values, seed=3
    )
    assert set(outcome.status) == {"completed"}
    assert outcome.log is not None
    for lane in (0, 999):
        one = skyarm.with_numbers(
            scenario, {path: float(column[lane]) for path, column in values.items()}
        )
        log = skyarm.run(dataclasses.replace(one, episode=lane))
        assert np.array_equal(
            np.asarray(outcome.log.state.position.x)[lane], log.position[:, 0]
        )
        assert np.array_equal(
            np.asarray(outcome.log.state.joints[0])[lane], log.joints[:, 0]
        )


@pytest.mark.thorough
def test_an_ending_of_ones_own_ends_and_says_why() -> None:
    low = copy.deepcopy(DOCUMENT)
    low["endings"] = [{"kind": "ceiling", "height": 0.9}]
    log = skyarm.run(skyarm.scenario_from(low))
    assert (log.status, log.info["cause"]) == ("ceiling", "base above 0.9 m")
    lanes = skyarm.Batch(skyarm.scenario_from(low), ["endings.0.height"]).fly(
        {"endings.0.height": np.array([0.9, 3.0])}
    )
    assert list(lanes.status) == ["ceiling", "completed"]


def test_a_plant_of_ones_own_flies_by_its_name() -> None:
    lagging, instant = (
        skyarm.run(_scenario(kind=plant)) for plant in ("rigid_body", "instant_rotors")
    )
    assert instant.status == "completed"
    assert 1e-6 < np.abs(instant.position - lagging.position).max() < 0.05


def test_a_log_format_of_ones_own_is_found_by_its_suffix(tmp_path: Path) -> None:
    log = skyarm.run(_scenario(duration=0.1))
    table = np.loadtxt(skyarm.save_log(log, tmp_path / "flight.tsv"))
    np.testing.assert_allclose(table[:, 1:4], log.position)


def test_a_word_that_is_not_there_names_what_was_meant() -> None:
    wrong = copy.deepcopy(DOCUMENT)
    wrong["environment"]["air"][0]["kind"] = "gutsy"
    with pytest.raises(
        ValueError,
        match=r"environment\.air\[0\]\.kind = 'gutsy': .*did you mean 'gusty'",
    ):
        skyarm.scenario_from(wrong)
    wrong = copy.deepcopy(DOCUMENT)
    wrong["sensors"]["gps"]["sigm"] = 1.0
    with pytest.raises(ValueError, match=r"sensors\.gps\.sigm = 1\.0: unknown field"):
        skyarm.scenario_from(wrong)


def test_every_added_thing_names_where_it_came_from() -> None:
    from skyarm.records.registry import registrations

    for kind, name in (
        ("air", "gusty"),
        ("force", "near_ground"),
        ("sensor", "gps"),
        ("law", "angles"),
    ):
        assert registrations(kind)[name].source.startswith(str(EXAMPLES))


def test_a_metric_of_ones_own_is_counted_in_flight_and_over_a_log_alike() -> None:
    load_plugin(EXAMPLES / "own_metric.py")
    scenario = _scenario()
    batch = skyarm.Batch(
        scenario,
        ["plant.payload.mass"],
        metrics=("rotor_energy", "position_error_max"),
        bit_exact=True,
    )
    outcome = batch.fly({"plant.payload.mass": np.array([0.0, 0.03])}, seed=3)
    log = skyarm.run(scenario)
    counted = skyarm.score(log, ("rotor_energy",))["rotor_energy"]
    assert outcome.metrics["rotor_energy"][0] == pytest.approx(counted, rel=1e-12)
    by_hand = 8.54858e-6 * 0.016 * (log.rotor_speeds**3).sum() / 200.0
    assert counted == pytest.approx(by_hand, rel=1e-12)
    loaded = skyarm.run(
        dataclasses.replace(
            skyarm.with_numbers(scenario, {"plant.payload.mass": 0.03}), episode=1
        )
    )
    assert outcome.metrics["rotor_energy"][1] == pytest.approx(
        skyarm.score(loaded, ("rotor_energy",))["rotor_energy"]
    )


EXAMPLE_SCRIPTS = ("step_a_session",)


@pytest.mark.parametrize("name", EXAMPLE_SCRIPTS)
def test_scripts_run(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    source = (EXAMPLES / f"{name}.py").read_text("utf-8")
    exec(compile(source, name, "exec"), {"__name__": "__main__"})
    assert capsys.readouterr().out


def test_a_law_of_ones_own_flies_from_its_file(tmp_path: Path) -> None:
    """On the command line only: a file that is read never runs code."""
    words = [
        "run",
        "case3",
        "--laws",
        f"{EXAMPLES / 'own_law.py'}:make_lqr",
        "--duration",
        "5",
    ]
    with registry_kept():
        done = typed(*words, "--out", str(tmp_path))
    assert done.code == 0, done.err
    log = skyarm.load_log(tmp_path / "case3.npz")
    assert log.info["controller"] == "lqr"
    # 15 g that its model does not know, over a stiffness of 4/s^2 and 0.8 kg, are 4.5
    # cm
    assert np.abs(log.position - log.position_held)[200:].max() < 0.06
    wrong = copy.deepcopy(DOCUMENT)
    wrong["controller"] = {"law": f"{EXAMPLES / 'own_law.py'}:make_lqr"}
    with pytest.raises(ValueError, match=r"controller\.law"):
        skyarm.scenario_from(wrong)


def test_a_command_of_ones_own_joins_the_others() -> None:
    words = ["--plugin", str(HERE / "additions.py"), "greet", "--name", "mars"]
    done = subprocess.run(
        [sys.executable, "-m", "skyarm", *words],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout.strip()) == (0, "hello mars"), done.stderr
