"""``make bench`` as a shell runs it."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import bench_engines as engines
import measure_engines
import measure_peers
import peers
import pytest
from bench_timing import Contender


def shell(
    *arguments: str, seconds: float = 60, of: ModuleType = measure_engines
) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-W", "error", str(of.__file__), *arguments]
    return subprocess.run(
        command, capture_output=True, text=True, timeout=seconds, check=False
    )


def test_a_file_that_cannot_be_written_is_said_before_anything_is_measured(
    tmp_path: Path,
):
    blocked = tmp_path / "file"
    blocked.write_text("in the way")
    done = shell("--quick", "--out", str(blocked / "bench.json"))
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "must be writable" in done.stderr


@pytest.fixture
def instant(monkeypatch: pytest.MonkeyPatch) -> None:
    """A bench whose own engines, which compile for minutes, are done at once; MuJoCo
    and the counts are measured.
    """

    def one(*_: object) -> list[Contender]:
        return [Contender("ours", "done at once", lambda: 1.0)]

    monkeypatch.setattr(engines, "native", one)
    monkeypatch.setattr(engines, "flights", lambda _scenario: {"rk4": None})
    monkeypatch.setattr(engines, "straight_line", lambda _flight: one()[0])
    monkeypatch.setattr(engines, "accuracy", lambda *_: {"rk4 f64": 1.5e-9})
    monkeypatch.setattr(
        measure_engines,
        "compiled_step_time",
        lambda *_: {"p50_us": 0.25, "p99_us": 0.31},
    )
    monkeypatch.setattr(
        measure_engines, "flown_step_time", lambda *_: {"p50_us": 0.25, "p99_us": 0.31}
    )
    monkeypatch.setattr(
        measure_engines, "start", lambda _rounds: {"python_alone": 0.12}
    )


@pytest.mark.usefixtures("instant")
def test_bench_prints_and_writes_what_it_measured(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    measure_engines.main(["--quick", "--out", str(tmp_path / "bench.json")])
    out = capsys.readouterr().out
    found = json.loads((tmp_path / "bench.json").read_text("utf-8"))
    assert f"MuJoCo {found['machine']['mujoco-core']}\n" in out
    assert "1.50e-09" in out
    assert all(score["rate"] > 0.0 for score in found["speed"])
    for score in found["speed"]:
        assert f"  {score['name']:<26} {score['rate']:10.4g}" in out


@pytest.mark.usefixtures("instant")
@pytest.mark.parametrize("name", ["speed", "times"])
def test_the_tables_of_the_page_have_its_columns(
    name: str, capsys: pytest.CaptureFixture[str]
):
    measure_engines.main(["--quick", "--table", name])
    printed = [
        line for line in capsys.readouterr().out.splitlines() if line.startswith("|")
    ]
    page = (
        (Path(__file__).resolve().parents[3] / "docs" / "data" / "performance.md")
        .read_text("utf-8")
        .splitlines()
    )
    assert printed[0] in page
    assert len(printed) >= 4
    rows = {line.split("|")[1].strip() for line in page if line.startswith("|")}
    assert {line.split("|")[1].strip() for line in printed[2:]} <= rows


@pytest.mark.thorough
def test_a_quick_bench_measures_everything(tmp_path: Path):
    """Two minutes on two cores, nearly all of them compilers."""
    done = shell("--quick", "--out", str(tmp_path / "bench.json"), seconds=900)
    assert done.returncode == 0, done.stderr
    found = json.loads((tmp_path / "bench.json").read_text("utf-8"))
    assert all(found.values()), {name for name in found if not found[name]}
    assert found["accuracy_m"]["rk4 f64 exact"] < found["accuracy_m"]["rk4 f32"]


def test_peers_are_measured_by_a_program_as_its_page_says():
    done = shell("--help", of=measure_peers)
    assert done.returncode == 0, done.stderr
    assert "--small" in done.stdout


@pytest.mark.usefixtures("instant")
def test_every_group_of_peers_has_a_contest_and_absent_ones_are_named(
    monkeypatch, capsys
):
    def one(name: str):
        return lambda *_: [Contender(name, "done at once", lambda: 1.0)]

    for module, name in (
        (peers, "pinocchio"),
        (peers, "jax"),
        (peers, "environments"),
        (engines, "mujoco_rollout"),
        (measure_peers.contact_speed, "standing_contenders"),
    ):
        flown = one(name)
        monkeypatch.setattr(
            module,
            name,
            flown if name != "mujoco_rollout" else lambda *_, each=flown: each()[0],
        )
    monkeypatch.setattr(peers, "PEERS", {"away": pytest.fail, "there": one("there")})
    monkeypatch.setattr(peers, "GUESTS", {"crazyflow": lambda _: one("crazyflow")()[0]})
    monkeypatch.setattr(
        peers, "crazyflow", lambda worlds: one(f"crazyflow {worlds}")()[0]
    )
    monkeypatch.setattr(peers, "bare_quadrotor", lambda *_: one("bare")()[0])
    monkeypatch.setattr(
        peers, "installed", lambda name: name in ("gymnasium", "crazyflow", "there")
    )
    monkeypatch.setattr(measure_peers.growth, "growth", lambda *_: [])
    measure_peers.main(["--small"])
    out = capsys.readouterr().out
    for name in (
        "pinocchio",
        "jax",
        "crazyflow",
        "crazyflow 16",
        "bare",
        "standing_contenders",
        "there",
    ):
        assert f"  {name} " in out
    assert out.endswith("not installed, not measured: jax, pinocchio, away\n")
