"""``skyarm bench`` and ``skyarm show --ops`` as a shell runs them."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path


def shell(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-W", "error", "-m", "skyarm", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)


def test_show_counts_operations():
    done = shell("show", "hummingbird_arm2_rotors", "--ops")
    assert done.returncode == 0, done.stderr
    for what in ("forward dynamics", "inverse dynamics", "euler step", "rk4 step"):
        assert re.search(rf"^{what} +\d+$", done.stdout, re.MULTILINE), what


def test_a_file_that_cannot_be_written_is_said_before_anything_is_measured(tmp_path: Path):
    blocked = tmp_path / "file"
    blocked.write_text("in the way")
    done = shell("bench", "--quick", "--out", str(blocked / "bench.json"))
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "must be writable" in done.stderr


def test_bench_has_help():
    done = shell("bench", "--help")
    assert done.returncode == 0
    assert "--quick" in done.stdout
    assert "--out" in done.stdout
