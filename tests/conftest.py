"""What holds for every process of the tests, before NumPy is loaded."""

from __future__ import annotations

import gc
import os

# one thread of BLAS a process, as the command line sets it: the processes of the tests take every core already, and
# threads that wait for each other there made some tests five times slower
for name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")

# a trace makes a hundred thousand nodes and no garbage; looking for some after every 700 took a sixth of all the time
gc.set_threshold(50_000, 20, 100)


def pytest_collection_finish() -> None:
    """Collected tests and imported modules stay: they need not be looked through again and again."""
    gc.collect()
    gc.freeze()
