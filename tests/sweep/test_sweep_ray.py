"""The same rows from a cluster, also when one of its workers is killed."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from skyarm.sweep import run_sweep
from sweeps import document, files_of, small_study

pytest.importorskip("pyarrow")

PROGRAM = """
import json, os, signal, sys, threading, time
from pathlib import Path
import ray
from skyarm.sweep import run_sweep, study_from

ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False, logging_level="error")

@ray.remote(num_cpus=1)
def who():
    time.sleep(0.2)
    return os.getpid()

workers = set(ray.get([who.remote() for _ in range(4)]))
killed = []

def progress(done, total):
    # the pool keeps its workers: these are the ones that fly; one is killed while it does
    if 0 < done < total and not killed:
        killed.append(workers.pop())
        os.kill(killed[0], signal.SIGKILL)

run_sweep(study_from(json.loads(sys.argv[1])), Path(sys.argv[2]), ray="auto", progress=progress)
alive = set(ray.get([who.remote() for _ in range(4)]))
print(json.dumps({"killed": killed, "alive": sorted(alive)}))
"""

FIELDS = {"episodes": 64, "chunk": 4, "duration": 2.0}


@pytest.mark.thorough
@pytest.mark.skipif(sys.platform == "win32", reason="there is no SIGKILL")
def test_a_cluster_that_loses_a_worker_gives_the_same_files(tmp_path: Path) -> None:
    pytest.importorskip("ray")
    run_sweep(small_study(**FIELDS), tmp_path / "here")
    finished = subprocess.run(
        [sys.executable, "-c", PROGRAM, json.dumps(document(**FIELDS)), str(tmp_path / "cluster")],
        capture_output=True,
        text=True,
        timeout=240,
        check=False,
    )
    assert finished.returncode == 0, finished.stderr[-2000:]
    told = json.loads(finished.stdout.splitlines()[-1])
    assert len(told["killed"]) == 1
    assert told["killed"][0] not in told["alive"]
    assert files_of(tmp_path / "cluster") == files_of(tmp_path / "here")


def test_a_missing_library_is_named_with_its_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(ValueError, match=r"needs the extra 'ray'; .*python -m pip install .*\[ray\]"):
        run_sweep(small_study(), tmp_path, ray="local")


def test_rows_without_their_library_are_refused_before_any_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(
        ValueError, match=r"pyarrow: is missing; needs the extra 'sweep'; .*python -m pip install .*\[sweep\]"
    ):
        run_sweep(small_study(), tmp_path / "out")
    assert not (tmp_path / "out").exists()
