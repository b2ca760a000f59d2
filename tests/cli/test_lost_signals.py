"""A signal that lands where Python drops what is raised, in a destructor, still ends the command."""

from __future__ import annotations

import subprocess
import sys

import pytest

LOST = """
import signal, sys, time
from skyarm.cli.main import Ended, endings

class Old:
    def __del__(self):
        signal.raise_signal(signal.SIGTERM)

with endings() as came:
    try:
        Old()
        time.sleep(600)
    except Ended:
        print("ended", sorted({each.name for each in came}))
        sys.exit(0)
print("not ended")
sys.exit(1)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_a_signal_that_a_destructor_drops_comes_again_and_leaves_no_traceback() -> None:
    done = subprocess.run([sys.executable, "-c", LOST], capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "ended ['SIGTERM']\n", "")
