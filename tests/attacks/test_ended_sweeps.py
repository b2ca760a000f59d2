"""Sweeps that are killed at random times, lose files while they run, or meet a full
disk: the folder ends the same.
"""

from __future__ import annotations

import json
import random
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from skyarm.studies.sweep import run_sweep
from skyarm.studies.sweep.manifest import MANIFEST
from support.cases import sampled
from support.studies import document, files_of, small_study

pytest.importorskip("pyarrow")
pytestmark = pytest.mark.skipif(
    sys.platform == "win32", reason="POSIX signals and limits"
)

STUDY = {"episodes": 240, "chunk": 8, "duration": 1.0}

PROGRAM = """
import json, sys
from pathlib import Path
from skyarm.studies.sweep import run_sweep, study_from
study = study_from(json.loads(sys.argv[1]))
print("ready", flush=True)
run_sweep(
    study, Path(sys.argv[2]), progress=lambda done, total: print(done, flush=True)
)
"""

LIMITED = """
import json, resource, signal, sys
from pathlib import Path
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
from skyarm.studies.sweep import run_sweep, study_from
study = study_from(json.loads(sys.argv[1]))
def progress(done, total):
    if done >= 16:
        resource.setrlimit(
            resource.RLIMIT_FSIZE, (int(sys.argv[3]), resource.RLIM_INFINITY)
        )
try:
    run_sweep(study, Path(sys.argv[2]), progress=progress)
except OSError as error:
    print(error)
    sys.exit(2)
"""


def started(folder: Path) -> subprocess.Popen[str]:
    command = [
        sys.executable,
        "-c",
        PROGRAM,
        json.dumps(document(**STUDY)),
        str(folder),
    ]
    return subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )


def killed(folder: Path, dice: random.Random) -> int:
    """Kill a sweep at a random time after its study was read; returns how it ended."""
    with started(folder) as process:
        assert process.stdout is not None
        for _ in range(dice.randrange(1, 4)):
            process.stdout.readline()
        time.sleep(dice.uniform(0.0, 0.05))
        process.send_signal(signal.SIGKILL)
        process.stdout.read()
    return process.returncode


@pytest.mark.attack
def test_sixty_kills_at_random_times_leave_the_bytes_of_an_uninterrupted_sweep(
    tmp_path: Path,
) -> None:
    run_sweep(small_study(**STUDY), tmp_path / "whole")
    dice, kills, round_ = random.Random(60), 0, 0
    while kills < 60:
        folder = tmp_path / str(round_)
        for _ in range(10):
            kills += killed(folder, dice) == -signal.SIGKILL
            held = folder / MANIFEST
            if held.exists() and json.loads(held.read_text())["complete"]:
                break
        run_sweep(small_study(**STUDY), folder)
        assert files_of(folder) == files_of(tmp_path / "whole")
        round_ += 1


@pytest.mark.attack
def test_files_that_vanish_at_random_times_are_flown_again_or_said(
    tmp_path: Path,
) -> None:
    run_sweep(small_study(**STUDY), tmp_path / "whole")
    right = files_of(tmp_path / "whole")
    for seed in range(10):
        folder, dice, stop = (
            tmp_path / str(seed),
            random.Random(seed),
            threading.Event(),
        )

        def thief(
            folder: Path = folder,
            dice: random.Random = dice,
            stop: threading.Event = stop,
        ) -> None:
            while not stop.wait(dice.uniform(0.0, 0.05)):
                there = list((folder / "rows").glob("chunk_*.parquet"))
                if there:
                    dice.choice(there).unlink(missing_ok=True)

        thread = threading.Thread(target=thief)
        thread.start()
        try:
            run_sweep(small_study(**STUDY), folder)
        finally:
            stop.set()
            thread.join()
        run_sweep(small_study(**STUDY), folder)
        assert files_of(folder) == right


@pytest.mark.parametrize("size", sampled([100, 4096], 2))
def test_a_disk_without_room_is_one_line_and_leaves_nothing_half_written(
    tmp_path: Path, size: int
) -> None:
    small = {
        "episodes": 32,
        "chunk": 8,
        "duration": 0.4,
        "windows": {"steady": [0.1, 0.4]},
    }
    run_sweep(small_study(**small), tmp_path / "whole")
    command = [
        sys.executable,
        "-c",
        LIMITED,
        json.dumps(document(**small)),
        str(tmp_path / "full"),
        str(size),
    ]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stdout.count("\n")) == (2, 1), ended
    assert "must be writable (File too large)" in ended.stdout
    right, left = files_of(tmp_path / "whole"), files_of(tmp_path / "full")
    assert set(left) <= set(right), "no rest of a file"
    assert all(
        content == right[name] for name, content in left.items() if name != MANIFEST
    )
    assert json.loads(left[MANIFEST])["complete"] is False
    assert run_sweep(small_study(**small), tmp_path / "full").found == 16
    assert files_of(tmp_path / "full") == right
