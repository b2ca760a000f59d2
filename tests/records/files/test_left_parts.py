"""Temporary files that a killed process left: the next process that writes into the
folder removes them.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from skyarm.records.files import writing
from skyarm.records.files.writing import write_atomically, writing_atomically

WRITES = """
import sys, time
from skyarm.records.files.writing import writing_atomically
with writing_atomically(sys.argv[1]) as stream:
    stream.write(b"half"); stream.flush()
    print("writing", flush=True)
    time.sleep(60)
"""


def parts(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.glob(".*"))


@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGKILL")
def test_the_part_of_a_killed_writer_goes_and_that_of_a_living_one_stays(
    tmp_path: Path,
) -> None:
    killed = subprocess.Popen(
        [sys.executable, "-c", WRITES, tmp_path / "killed.npz"], stdout=subprocess.PIPE
    )
    with killed, writing_atomically(tmp_path / "alive.npz") as stream:
        assert killed.stdout is not None
        assert killed.stdout.readline() == b"writing\n"
        killed.kill()
        killed.wait()
        assert len(parts(tmp_path)) == 2, "a kill leaves its part"
        stream.write(b"whole")
        writing._cleared.clear()  # as a process of its own would begin
        write_atomically(tmp_path / "next.json", b"{}")
        (left,) = parts(tmp_path)
        assert left.startswith(".alive.npz."), "a living process keeps its part"
    assert (tmp_path / "alive.npz").read_bytes() == b"whole"
    assert not parts(tmp_path)


def test_only_parts_of_ours_are_removed(tmp_path: Path) -> None:
    ours, theirs = f".flight.npz.{'0a' * 6}.part", ".download.part"
    for name in (ours, theirs):
        (tmp_path / name).write_bytes(b"half")
    with writing_atomically(tmp_path / "flight.npz") as stream:
        stream.write(b"whole")
        assert ours not in parts(tmp_path)
    assert parts(tmp_path) == [theirs]


def test_a_writer_whose_new_part_another_takes_away_makes_another(
    tmp_path: Path, monkeypatch
) -> None:
    """Between the file's making and its lock another process may take it for that of a
    dead one.
    """
    lock, taken = writing._lock, []

    def taken_away(handle: int) -> None:
        if not taken:
            (part,) = tmp_path.glob(".*.part")
            part.unlink()
            taken.append(part)
        lock(handle)

    monkeypatch.setattr(writing, "_lock", taken_away)
    write_atomically(tmp_path / "flight.npz", b"whole")
    assert taken
    assert (tmp_path / "flight.npz").read_bytes() == b"whole"
    assert not parts(tmp_path)
