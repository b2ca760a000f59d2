"""docs/clusters.md: its commands run on clusters of this machine, its numbers are those
of the code.
"""

from __future__ import annotations

import os
import re
import shutil
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from skyarm.studies.flights import ray_cluster
from skyarm.studies.flights.processes import MOST_TRIES
from support.cases import toml_text
from support.studies import document

DOCS = Path(__file__).resolve().parents[1] / "docs"
PAGE, DATA = (
    (DOCS / name).read_text("utf-8") for name in ("clusters.md", "data/clusters.md")
)
BLOCKS = re.findall(r"^```(\w+)(?: title=\"([^\"]+)\")?\n(.*?)^```$", PAGE, re.M | re.S)
ONE, TWO, CLOUD = (
    text for language, title, text in BLOCKS if language == "bash" and not title
)
(PYTHON,) = (text for language, _, text in BLOCKS if language == "python")
YAML = (DOCS.parent / "examples" / "files" / "cluster.yaml").read_text("utf-8")
JOBS = {title: text for language, title, text in BLOCKS if language == "bash" and title}
JOBS["sweep.sbatch"] = (DOCS.parent / "examples/files/sweep.sbatch").read_text("utf-8")

posix = pytest.mark.skipif(sys.platform == "win32", reason="scripts of a POSIX shell")


def test_the_page_says_what_the_code_does() -> None:
    text = " ".join(PAGE.split())
    assert MOST_TRIES == 3
    assert "begins its work items again elsewhere, three times" in text
    assert ray_cluster.LOOK_SECONDS == ray_cluster.ANSWER_SECONDS == 5.0
    assert "counts the processors every five seconds" in text
    assert "exit code 2 within five seconds" in text
    assert ray_cluster.JOIN_SECONDS == 30.0
    assert "within half a minute" in text
    for name in ray_cluster.kin():
        assert {"code": "skyarm", "mujoco-core": "MuJoCo"}.get(
            name, name
        ).lower() in text.lower(), name


def test_the_sums_on_paper_are_right() -> None:
    rows = {
        cells[0]: [float(cell.replace(" ", "")) for cell in cells[1:]]
        for cells in (
            [cell.strip() for cell in line.strip("| ").split(" | ")]
            for line in DATA.splitlines()
        )
        if len(cells) == 3 and all(re.fullmatch(r"[\d .]+", cell) for cell in cells[1:])
    }
    for k, chunk in enumerate(rows["flights in a work item (`chunk`)"]):
        works = rows["work items, and files"][k]
        assert works == -(-1e9 // chunk)
        assert rows["a work item: processor time, s"][k] == pytest.approx(
            chunk * 0.45e-3, rel=0.03
        )
        assert rows["all files, GB"][k] == pytest.approx(
            works * rows["a work item: its file, kB"][k] * 1e-6, abs=0.06
        )
        together = sum(
            values[k] for name, values in rows.items() if name.startswith("driver: ")
        )
        assert rows["driver, together, ms"][k] == pytest.approx(together)
        busy = rows["processors that one driver keeps busy"][k]
        assert busy == pytest.approx(chunk * 0.45 / together, rel=0.03)
        assert rows["driver's time for all, min"][k] == pytest.approx(
            works * together / 6e4, rel=0.03
        )
    assert "125 hours" in DATA
    assert pytest.approx(125.0) == 1e9 * 0.45e-3 / 3600.0


@posix
@pytest.mark.parametrize("text", [ONE, TWO, CLOUD, *JOBS.values()])
def test_scripts_are_scripts(text: str) -> None:
    done = subprocess.run(
        ["bash", "-n"], input=text, text=True, capture_output=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")


class TestOnRay:
    """Needs the package."""

    @pytest.fixture(autouse=True)
    def _package(self) -> None:
        pytest.importorskip("ray", reason="needs the extra ray: make ray")

    @pytest.fixture
    def here(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
        """A folder with the study in small and the commands of this environment; what
        they start ends with it.
        """
        small = document(
            name="my_study", episodes=32, duration=0.5, windows={"steady": [0.2, 0.5]}
        )
        (tmp_path / "my_study.toml").write_text(toml_text(small))
        commands = tmp_path / "bin"
        commands.mkdir()
        (commands / "skyarm").write_text(
            f'#!/bin/sh\nexec "{sys.executable}" -m skyarm "$@"\n'
        )
        (commands / "skyarm").chmod(0o755)
        monkeypatch.setenv(
            "PATH",
            f"{commands}{os.pathsep}{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
        )
        monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, sys.path)))
        monkeypatch.setenv("HOME", str(tmp_path))
        monkeypatch.setenv("RAY_USAGE_STATS_ENABLED", "0")
        monkeypatch.chdir(tmp_path)
        yield tmp_path
        for folder in Path("/proc").glob("[0-9]*"):
            try:
                ours = (
                    f"HOME={tmp_path}\0".encode() in (folder / "environ").read_bytes()
                )
            except OSError:
                continue
            if ours:
                os.kill(int(folder.name), signal.SIGKILL)

    def run(self, text: str) -> str:
        """Run a script, but for installing and for what would end other people's
        Ray.
        """
        lines = [
            line
            for line in text.splitlines()
            if not line.startswith(("python -m pip", "ray stop"))
        ]
        script = "\n".join(["set -e", *lines])
        done = subprocess.run(
            ["bash"],
            input=script,
            text=True,
            capture_output=True,
            timeout=180.0,
            check=False,
        )
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    @posix
    def test_one_machine(self, here: Path) -> None:
        assert (
            "64 flights in out/my_study: 32 episodes under paper_ct, paper_pd"
            in self.run(ONE)
        )
        shutil.rmtree(here / "out")
        done = subprocess.run(
            [sys.executable, "-c", PYTHON], capture_output=True, text=True, check=False
        )
        assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
        assert len([*(here / "out/my_study/rows").iterdir()]) == 4

    @posix
    def test_two_machines_with_a_token(
        self, here: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """Both nodes are of this machine."""
        with socket.create_server(("", 0)) as free:
            port = free.getsockname()[1]
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as outward:
            outward.connect(("192.0.2.1", 9))
            address = outward.getsockname()[0]
        told = self.run(TWO.replace("10.0.0.1", address).replace("6379", str(port)))
        assert (
            "64 flights in out/my_study: 32 episodes under paper_ct, paper_pd" in told
        )
        # whoever has no token stays outside
        (here / ".ray" / "auth_token").write_text("another")
        monkeypatch.setenv("RAY_AUTH_MODE", "token")
        command = [
            sys.executable,
            "-m",
            "skyarm",
            "sweep",
            "my_study.toml",
            "--on",
            f"ray:{address}:{port}",
            "-q",
        ]
        refused = subprocess.run(
            [*command, "--out", "out/other"],
            capture_output=True,
            text=True,
            check=False,
        )
        assert (refused.returncode, refused.stdout, refused.stderr.count("\n")) == (
            2,
            "",
            1,
        )
        assert refused.stderr.startswith(
            f"skyarm: on = 'ray:{address}:{port}': cannot be joined ("
        )
        assert not (here / "out" / "other").exists()

    def test_the_cloud_s_file_is_one_that_ray_takes(self) -> None:
        import yaml
        from ray.autoscaler._private.util import validate_config

        # a field that the launcher adds
        validate_config({**yaml.safe_load(YAML), "cluster_synced_files": []})
