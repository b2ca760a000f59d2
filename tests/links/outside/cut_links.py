"""Cuts of the link in flight: the law is killed or frozen at random times beside a real
PX4, and the vehicle watched.

    python tests/links/outside/cut_links.py COUNT [INSTANCE]

The simulator with PX4 is one process, the law another, as users start them. Needs
SKYARM_PX4, the path of PX4's program.
"""

from __future__ import annotations

import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from beside_px4 import command_of, descendants, simulator, start_law

FROZEN = 0.15
"""Share of the cuts that freeze the process for two seconds in place of killing it."""

LAW = 'preset = "paper_ct"'


def take_over(folder: Path, instance: int) -> subprocess.Popen[str]:
    """Start a law, and wait until it flies.

    Raises:
        RuntimeError: it does not.
    """
    law, said = start_law(folder, instance, LAW, 60.0), []
    assert law.stdout is not None
    for line in law.stdout:
        said.append(line.strip())
        if "the law flies" in line:
            return law
    raise RuntimeError(f"the law did not fly: {said}")


def cut(law: subprocess.Popen[str], *, freeze: bool) -> int:
    """Kill the law, or freeze it for two seconds; its exit code."""
    if not freeze:
        law.kill()
        return law.wait()
    law.send_signal(signal.SIGSTOP)
    time.sleep(2.0)
    law.send_signal(signal.SIGCONT)
    return law.wait(20.0)


def cut_links(count: int, instance: int = 0, seed: int = 1) -> dict[str, object]:
    """Cut the link so many times in one flight; numbers of what the vehicle did.

    Returns:
        ``cuts``: how many. ``codes``: exit codes of frozen laws. ``status``: of the
        simulator's flight.
        ``excursion_m``, ``sink_m``: median and largest distance, and loss of height,
        from the place of a cut within three seconds. ``left``: processes that still
        run.
    """
    rng, times, codes = random.Random(seed), [], []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with simulator(folder, instance, 30.0 * count + 20.0) as process:
            law = None
            try:
                while len(times) < count and process.poll() is None:
                    law = take_over(folder, instance)
                    time.sleep(rng.uniform(0.2, 4.0))
                    freeze = rng.random() < FROZEN
                    times.append(time.time())
                    code = cut(law, freeze=freeze)
                    codes += [code] if freeze else []
                    print(
                        f"cut {len(times)}: {'frozen' if freeze else 'killed'}",
                        flush=True,
                    )
                    time.sleep(1.5)
                time.sleep(2.0)
                pids = descendants(process.pid)
            finally:
                if law is not None and law.poll() is None:
                    law.kill()
        path = np.load(folder / "path.npy")
        status = (folder / "status").read_text()
    apart, sunk = [], []
    for at in times:
        after = path[(path[:, 0] >= at) & (path[:, 0] < at + 3.0), 1:]
        apart.append(np.linalg.norm(after - after[0], axis=1).max())
        sunk.append(after[0, 2] - after[:, 2].min())
    time.sleep(0.5)
    return {
        "cuts": len(times),
        "codes": codes,
        "status": status,
        "excursion_m": [
            round(float(found), 3) for found in (np.median(apart), max(apart))
        ],
        "sink_m": [round(float(found), 3) for found in (np.median(sunk), max(sunk))],
        "left": [name for pid in pids if (name := command_of(pid))],
    }


if __name__ == "__main__":
    print(cut_links(int(sys.argv[1]), *map(int, sys.argv[2:])))
