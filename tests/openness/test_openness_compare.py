"""What a stranger adds flies through ``skyarm compare``: their scenario, laws, metric
and plant, on every plant.
"""

from __future__ import annotations

import contextlib
import dataclasses
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from added_flight import EXAMPLES, PLUGINS, toml

import skyarm
from skyarm.records.registry.plugins import load_plugin
from support.cases import sampled
from support.commands import Outcome
from support.commands import skyarm as typed
from support.components import registry_kept

EVERY = (*PLUGINS, EXAMPLES / "own_metric.py")
LAW = f"{EXAMPLES / 'own_law.py'}:make_lqr"


def compare(folder: Path, *words: str, plugins: bool = True) -> Outcome:
    """The command in a folder that holds the scenario and copies of the plugins."""
    (folder / "added.toml").write_text(toml(duration=0.5), "utf-8")
    loaded: list[str] = []
    for plugin in EVERY if plugins else ():
        if not (folder / plugin.name).exists():
            shutil.copy(plugin, folder)
        loaded += ["--plugin", plugin.name]
    with contextlib.chdir(folder), registry_kept():
        return typed(*loaded, "compare", *words)


@pytest.mark.parametrize(
    "plant", sampled(["rigid_body", "mujoco", "instant_rotors"], 3)
)
def test_it_is_compared_on_every_plant_and_each_flight_is_one_of_its_own(
    tmp_path: Path, plant: str
) -> None:
    """Law, air, force, sensor, estimator, drive, ending, motion and metric by name;
    flights one by one in processes.
    """
    laws = [
        "--laws",
        "own,paper_pd",
        "--seeds",
        "2",
        "--workers",
        "2",
        "--plant",
        plant,
    ]
    done = compare(tmp_path, "added.toml", "--out", "out", *laws)
    assert done.code == 0, done.err
    found = json.loads((tmp_path / "out" / "results.json").read_text())
    summary = found["summaries"]["given"]["added"]
    assert list(summary) == ["own", "paper_pd"]
    with registry_kept():
        for plugin in EVERY:
            load_plugin(tmp_path / plugin.name)
        planned = skyarm.load_scenario(tmp_path / "added.toml", plant=plant)
        wanted = ("position_error_mean_continuous", "rotor_energy")
        each = [
            skyarm.score(skyarm.run(dataclasses.replace(planned, episode=k)), wanted)
            for k in range(2)
        ]
    for name in wanted:
        mean = np.mean([one[name] for one in each])
        # a batch on our own plant may round a product and a sum at once
        assert summary["own"]["metrics"][name]["mean"] == pytest.approx(
            mean, rel=1e-9
        ), name
    assert "drag torque" in done.out, "the words of the metric"
    assert set(found["plugins"]) == {plugin.name for plugin in EVERY}


@pytest.mark.thorough
def test_what_was_flown_is_not_flown_again_but_with_another_plugin(
    tmp_path: Path,
) -> None:
    words = [
        "added.toml",
        "--out",
        "out",
        "--laws",
        f"own,angles,{LAW}",
        "--seeds",
        "2",
    ]
    first = compare(tmp_path, *words)
    assert first.code == 0, first.err
    cells = {
        file.name: file.stat().st_mtime_ns
        for file in (tmp_path / "out" / "rows").iterdir()
    }
    assert len(cells) == 3
    again = compare(tmp_path, *words)
    assert again.out == first.out
    assert {
        file.name: file.stat().st_mtime_ns
        for file in (tmp_path / "out" / "rows").iterdir()
    } == cells
    plugin = tmp_path / "gps.py"
    plugin.write_text(plugin.read_text("utf-8") + "\n# better\n", "utf-8")
    changed = compare(tmp_path, *words)
    assert changed.code == 0, changed.err
    both = {
        file.name: file.stat().st_mtime_ns
        for file in (tmp_path / "out" / "rows").iterdir()
    }
    assert len(both) == 2 * len(cells)
    assert cells.items() <= both.items()


def test_a_shipped_scenario_is_compared_by_its_own_law_and_the_usual_ones(
    tmp_path: Path,
) -> None:
    (tmp_path / "short.toml").write_text(
        'schema = 1\nname = "short"\nduration = 0.2\n[plant]\nvehicle ='
        ' "hummingbird_arm2_rotors"\n[model]\nvehicle ='
        ' "hummingbird_arm2"\n[controller]\nlaw ='
        ' "hybrid_computed_torque"\n[reference.base]\nkind = "hover"\nposition = [0, 0,'
        " 1]\n",
        "utf-8",
    )
    done = compare(tmp_path, "short.toml", "--out", "out", plugins=False)
    assert done.code == 0, done.err
    found = json.loads((tmp_path / "out" / "results.json").read_text())
    laws = found["summaries"]["given"]["short"]
    assert list(laws) == ["own", "paper_pd", "paper_ct", "centroidal_tip"]
    # nothing in it is by chance: one flight each
    assert {each["episodes"] for each in laws.values()} == {1}


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (
            ["paper"],
            (
                "suite = 'paper': must be one of paper-suite, envelope-suite,"
                " survive-suite, contact-suite, team-suite, a suite or scenario of your"
                " own (.toml), or a shipped scenario"
            ),
        ),
        (["case3", "--only", "noisy"], "--only: must be left out for scenario case3"),
        (["case3", "--laws", "anlges"], "--laws = 'anlges'"),
        (
            ["case3", "--plant", "instant_rotor"],
            "--plant = 'instant_rotor': must be one of",
        ),
        (["case3", "--laws", ","], "--laws: must name at least one"),
        (
            ["nowhere.toml"],
            "suite = 'nowhere.toml': no such file; must be one of paper-suite",
        ),
    ],
)
def test_what_cannot_be_compared_is_one_line(
    tmp_path: Path, words: list[str], told: str
) -> None:
    done = compare(tmp_path, *words, "--out", "out", plugins=False)
    assert done.code == 2
    (line,) = done.err.strip().splitlines()
    assert told in line
    assert not (tmp_path / "out").exists()
