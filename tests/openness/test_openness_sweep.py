"""What a stranger adds flies through sweeps: by threads; another plugin is another
study.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from added_flight import EXAMPLES, PLUGINS, toml

import skyarm
from skyarm.records.registry.plugins import identities, load_plugin
from skyarm.studies.sweep import Study, run_sweep
from skyarm.studies.sweep.plan import at_episode
from skyarm.studies.sweep.stats import Rows, statistics
from skyarm.studies.sweep.study_file import study_from
from support.components import registry_kept
from support.studies import drop_chunk, files_of, read

pytest.importorskip("pyarrow")

EVERY = (*PLUGINS, EXAMPLES / "own_metric.py")

VARY = {
    "environment.air.gusty.sigma": {"uniform": [0.2, 0.8]},
    "environment.forces.near_ground.radius": {"uniform": [0.05, 0.15]},
    "sensors.gps.walk": {"uniform": [0.0, 0.01]},
    "estimator.gain": {"uniform": [0.001, 0.02]},
    "plant.drives.joint1.stiffness": {"uniform": [6.0, 10.0]},
    "endings.ceiling.height": {"uniform": [1.02, 1.3]},
}
METRICS = ["position_error_mean", "iae_joint", "rotor_energy"]


@pytest.fixture(autouse=True, scope="module")
def _loaded() -> Iterator[None]:
    with registry_kept():
        for plugin in EVERY:
            load_plugin(plugin)
        yield


def written(folder: Path, **changes: Any) -> Path:
    """A study's file and its scenario's, beside each other."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "added.toml").write_text(
        toml(initial={"velocity": [0.0, 0.0, 0.6]}), "utf-8"
    )
    fields: dict[str, Any] = {
        "schema": 1,
        "name": "open",
        "scenario": "added.toml",
        "controllers": ["angles", "paper_pd"],
        "duration": 0.5,
        "episodes": 1000,
        "chunk": 500,
        "precision": "bit_exact",
        "metrics": METRICS,
        "windows": {
            "steady": [0.1, 0.5],
            "transient": [0.0, 0.1],
            "gust": [0.1, 0.5],
            "hover": [0.0, 0.1],
        }
        | {"holds": [[0.1, 0.2]], "last": 0.1},
    }
    fields |= changes
    lines = [f"{name} = {_value(value)}" for name, value in fields.items()]
    lines += [
        "[vary]",
        *(f'"{path}" = {_value(value)}' for path, value in VARY.items()),
    ]
    file = folder / "study.toml"
    file.write_text("\n".join(lines) + "\n", "utf-8")
    return file


def _value(value: Any) -> str:
    if isinstance(value, dict):
        return (
            "{ "
            + ", ".join(f"{name} = {_value(each)}" for name, each in value.items())
            + " }"
        )
    return json.dumps(value)


def study(folder: Path, **changes: Any) -> Study:
    import tomllib

    return study_from(
        tomllib.loads(written(folder, **changes).read_text("utf-8")), folder
    )


@pytest.mark.thorough
def test_a_thousand_lanes_of_it_are_the_flights_one_by_one(tmp_path: Path) -> None:
    """Metrics of a lane are those of the log of its flight; endings of one's own are
    rows too.
    """
    planned = study(tmp_path)
    run_sweep(planned, tmp_path / "out", workers=2)
    rows = read(tmp_path / "out")
    assert set(rows) == {"angles", "paper_pd"}
    ends = {
        law: dict(zip(*np.unique(each["status"], return_counts=True), strict=True))
        for law, each in rows.items()
    }
    assert ends["angles"]["ceiling"] > 50
    assert ends["angles"]["completed"] > 50
    for law, lane in (("angles", 3), ("angles", 999), ("paper_pd", 3)):
        row = {name: column[lane] for name, column in rows[law].items()}
        log = skyarm.run(
            at_episode(planned, law, {path: float(row[path]) for path in VARY}, lane)
        )
        assert log.status == row["status"]
        assert log.info["end_time"] == row["end_time"]
        for name, value in skyarm.score(log, METRICS, planned.windows).items():
            assert row[name] == pytest.approx(value, rel=1e-12, nan_ok=True), name
    # read back, with the plugins and without them
    found = statistics(Rows(tmp_path / "out"))
    assert found["controllers"]["angles"]["status"] == {
        name: int(count) for name, count in ends["angles"].items()
    }
    again = run_sweep(planned, tmp_path / "out")
    assert (again.flown, again.found) == (0, 1000)


def test_the_plugins_are_part_of_what_rows_and_logs_are(tmp_path: Path) -> None:
    planned = study(tmp_path, episodes=4, chunk=4)
    run_sweep(planned, tmp_path / "out")
    manifest = json.loads((tmp_path / "out" / "manifest.json").read_text())
    assert manifest["study"]["plugins"] == identities()
    assert {name.split()[0] for name in identities()} >= {
        "own_wind.py",
        "gps.py",
        "additions.py",
    }
    log = skyarm.run(
        at_episode(
            planned,
            "angles",
            dict.fromkeys(VARY, 0.1) | {"endings.ceiling.height": 3.0},
            0,
        )
    )
    assert log.info["plugins"] == identities()


def command(*words: str, folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "skyarm", *words],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=240,
        check=False,
    )


def copies(folder: Path) -> list[str]:
    """The plugins copied beside the study, as words of the command line."""
    words = []
    for plugin in EVERY:
        words += ["--plugin", shutil.copy(plugin, folder)]
    return words


@pytest.mark.thorough
def test_a_plugin_that_has_changed_is_one_line_and_never_mixed_rows(
    tmp_path: Path,
) -> None:
    written(tmp_path, episodes=8, chunk=4)
    words = [*copies(tmp_path), "sweep", "study.toml", "--out", "out", "--workers", "2"]
    first = command(*words, folder=tmp_path)
    assert first.returncode == 0, first.stderr
    drop_chunk(tmp_path / "out", 1)
    before = files_of(tmp_path / "out")
    plugin = tmp_path / "own_wind.py"
    plugin.write_text(plugin.read_text("utf-8") + "\n# calmer\n", "utf-8")
    second = command(*words, folder=tmp_path)
    assert second.returncode == 2
    (line,) = second.stderr.strip().splitlines()
    assert "plugin 'own_wind.py' = 'sha256:" in line
    assert "must be 'sha256:" in line
    assert "choose another --out" in line
    assert files_of(tmp_path / "out") == before
    without = command("sweep", "study.toml", "--out", "out", folder=tmp_path)
    assert without.returncode == 2
    assert "reference.base.kind = 'sway': must be one of" in without.stderr
    assert "names of one's own come by --plugin FILE.py" in without.stderr


def test_a_number_of_a_plugins_record_that_is_misspelt_names_what_was_meant(
    tmp_path: Path,
) -> None:
    for path, meant in (
        ("environment.air.gutsy.sigma", "gusty"),
        ("environment.air.gusty.sigm", "sigma"),
        ("sensors.gsp.walk", "gps"),
        ("enviroment.air.gusty.sigma", "environment.air"),
    ):
        fields = {
            "schema": 1,
            "name": "x",
            "scenario": "added.toml",
            "episodes": 2,
            "vary": {path: {"list": [0.1]}},
        }
        (tmp_path / "added.toml").write_text(toml(), "utf-8")
        with pytest.raises(
            ValueError, match=rf"vary.*{path}.*did you mean '{meant}'\?"
        ):
            study_from(fields, tmp_path)
